"""Parameters are chosen by sources in the place of targets, each started by a fit that has not seen it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qinit_cli.artefacts.choice import FOLDS, edges, folds, judged, worth
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import METHODS
from qinit_cli.pipeline.cross_validation import CrossValidation, candidates, parameters_of
from qinit_cli.pipeline.transfer import learn_targets
from qinit_cli.pipeline.tuning import with_parameters
from qinit_cli.seeding import Stream
from qinit_cli.tasks import TARGETS, VALIDATION, TargetTasks
from qinit_cli.watch import Watch

FAMILY = Gridworld(size=5, variance=2)
LEARNING = replace(FAMILY.target_learning, episodes=40)
STANDING_IN = TargetTasks(FAMILY, LEARNING, 7, False, streams=VALIDATION)
QUANTILE = METHODS["logqinit-quantile"]()


def _fits(count: int) -> list[Any]:
    """Fits that differ: one table each."""
    from qinit_cli.fitted import FittedTables

    made = []
    for number in range(count):
        table = np.full((25, 4), 0.1 + 0.1 * number)
        nothing = np.empty((0, 25, 4))
        made.append(
            FittedTables(
                np.log(table), np.full_like(table, 0.5), table, table, table, table, table, table,
                np.ones(table.shape, np.int64), table.max(axis=1), nothing, nothing, FitOptions().estimator,
            )
        )  # fmt: skip
    return made


def test_each_usable_source_is_in_one_fold_and_folds_are_even() -> None:
    kept = np.ones(23, bool)
    kept[[3, 11]] = False
    fold = folds(kept)
    assert set(fold[~kept]) == {-1}
    sizes = np.bincount(fold[kept])
    assert len(sizes) == FOLDS
    assert sizes.max() - sizes.min() <= 1


def test_the_first_candidate_is_the_method_as_it_is_and_none_comes_twice() -> None:
    tried = candidates(METHODS["ops-tl"](), {"rho": (0.9, 0.99), "nu": (0.98, 1.0)})
    assert tried[0] == METHODS["ops-tl"]()
    assert len(tried) == 4  # the default is among the four combinations
    assert len({(one.rho, one.nu) for one in tried}) == 4  # type: ignore[attr-defined]


def test_a_value_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"--quantile is 1\.5"):
        candidates(QUANTILE, {"quantile": (0.2, 1.5)})


def test_a_source_starts_from_the_fit_of_the_other_folds() -> None:
    fold = np.repeat(np.arange(FOLDS), 2)
    tried = candidates(QUANTILE, {"quantile": (0.3,)})
    validation = CrossValidation(STANDING_IN, tried, _fits(FOLDS), fold)
    ids, rows = validation(np.arange(10), Watch())
    np.testing.assert_array_equal(ids, np.arange(10))
    for column, method in enumerate(tried):
        initial = method.initial_of_all(_fits(FOLDS)[3], STANDING_IN.family, STANDING_IN.learning)
        _, alone = learn_targets(STANDING_IN, initial, np.array([6, 7]), Watch())
        earned = np.where(alone["reached"] == 1, LEARNING.gamma ** (alone["steps"] - 1.0), 0.0).mean(axis=1)
        np.testing.assert_allclose(rows["average"][6:8, column], earned, rtol=1e-12)


def test_the_batch_does_not_matter_and_an_unusable_source_is_not_tried() -> None:
    fold = np.array([0, 0, -1, 1, 1, 2, 2, 3, 3, 4, 4])
    validation = CrossValidation(STANDING_IN, [QUANTILE], _fits(FOLDS), fold)
    _, together = validation(np.arange(11), Watch())
    _, alone = validation(np.array([4]), Watch())
    assert together["average"][4] == alone["average"][0]
    assert np.isnan(together["average"][2]).all()
    assert together["steps"][2] == 0


def test_the_tasks_are_the_sources_own_and_the_dice_are_nobody_elses() -> None:
    indices = np.arange(4)
    np.testing.assert_array_equal(
        STANDING_IN.draw(indices), draw_tasks(FAMILY, 7, Stream.SOURCE_TASK, indices)
    )
    used = {VALIDATION.rng, VALIDATION.start, VALIDATION.evaluation, VALIDATION.choice, VALIDATION.world}
    theirs = {TARGETS.task, TARGETS.rng, TARGETS.start, TARGETS.evaluation, TARGETS.choice, TARGETS.world}
    assert not used & theirs


def test_the_largest_mean_is_chosen_and_differences_are_paired() -> None:
    average = np.array([[0.1, 0.3, 0.2], [0.3, 0.5, 0.1], [np.nan, np.nan, np.nan], [0.2, 0.4, 0.3]])
    found = judged(average, {"quantile": np.array([0.2, 0.1, 0.5])}, 0)
    assert [one.parameters["quantile"] for one in found] == [0.1, 0.2, 0.5]
    [best] = [one for one in found if one.chosen]
    [default] = [one for one in found if one.default]
    assert best.parameters == {"quantile": 0.1}
    assert best.average.value == pytest.approx(0.4)
    assert (best.difference.value, best.difference.low, best.difference.high) == pytest.approx(
        (0.2, 0.2, 0.2)
    )
    assert default.average.value == pytest.approx(0.2)


def test_of_equals_the_default_is_chosen() -> None:
    found = judged(np.full((4, 2), 0.5), {"kappa": np.array([10.0, 1.0])}, 0)
    assert [one.chosen for one in found if one.default] == [True]


def test_parameters_are_told_and_put_back() -> None:
    tried = candidates(METHODS["ops-tl"](), {"rho": (0.9,)})
    assert parameters_of(tried, ["rho"])["rho"].tolist() == [0.99, 0.9]
    assert with_parameters(METHODS["ops-tl"](), {"rho": 0.9, "library": 7.0}) == METHODS["ops-tl"](
        rho=0.9, library=7
    )  # type: ignore[call-arg]


def test_a_part_of_a_whole_number_is_refused() -> None:
    with pytest.raises(ValueError, match=r"--library is 2\.5; it must be a whole number"):
        with_parameters(METHODS["ops-tl"](), {"library": 2.5})


def test_what_choosing_is_worth_is_judged_by_sources_that_did_not_choose() -> None:
    average = np.zeros((10, 2))
    average[0, 1] = 1.0  # one lucky source of the first fold makes its candidate the best of all ...
    assert [one.chosen for one in judged(average, {"kappa": np.array([10.0, 1.0])}, 0) if one.default] == [
        False
    ]
    found = worth(average, 0)
    assert found.value == 0.0  # ... and the other folds choose it, to which it is worth nothing


def test_a_candidate_that_is_better_everywhere_is_worth_what_it_gains() -> None:
    average = np.tile([0.2, 0.3, 0.1], (15, 1))
    average[4] = np.nan
    found = worth(average, 0)
    assert (found.value, found.low, found.high) == pytest.approx((0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("best", "grid", "found"),
    [
        (0.99, (0.9, 0.99, 0.999), {}),
        (0.9, (0.9, 0.99, 0.999), {"rho": "smallest"}),
        (0.999, (0.9, 0.99, 0.999), {"rho": "largest"}),
        (1.0, (0.9, 0.99, 1.0), {}),  # there is no more
        (0.9, (0.9,), {}),  # no range was asked for
    ],
)
def test_an_end_of_what_was_tried_is_one_where_there_is_more(
    best: float, grid: tuple[float, ...], found: dict[str, str]
) -> None:
    rho = np.array([0.99, *(value for value in grid if value != 0.99)])
    average = np.where(rho == best, 0.5, 0.1) * np.ones((5, 1))
    assert edges("ops-tl", judged(average, {"rho": rho}, 0), {"rho": grid}) == found
