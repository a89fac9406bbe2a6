"""The arrays of each method, by hand from a tiny made-up fit; and what every method promises."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FittedTables
from qinit_cli.methods import METHODS, Initial, Method, Targets
from qinit_cli.methods.drs import Drs
from qinit_cli.methods.logqinit_mean import LogQInitMean
from qinit_cli.methods.logqinit_median import LogQInitMedian
from qinit_cli.methods.logqinit_quantile import LogQInitQuantile
from qinit_cli.methods.maxqinit import MaxQInit
from qinit_cli.methods.mean import Mean
from qinit_cli.methods.method import Initialisation
from qinit_cli.methods.ops_tl import OpsTl
from qinit_cli.methods.optimal import Optimal
from qinit_cli.methods.plus import Plus
from qinit_cli.methods.posterior import Posterior
from qinit_cli.methods.ptrs import Ptrs
from qinit_cli.methods.ucoi import Ucoi
from qinit_cli.methods.zero import Zero
from qinit_cli.seeding import Stream

NAN = float("nan")
FAMILY = Gridworld(size=2)
UNPRIVILEGED = [name for name, method in METHODS.items() if not method.privileged]


def _table(*rows: tuple[float, float, float, float]) -> Any:
    return np.array(rows)


MAX = _table((0.9, 0.5, 0.2, NAN), (0.3, 0.7, 0.1, 0.2), (0.6, 0.6, 0.6, 0.6), (NAN, NAN, NAN, NAN))
MEDIAN = _table((0.4, 0.2, 0.1, NAN), (0.1, 0.3, 0.1, 0.1), (0.5, 0.25, 0.5, 0.5), (NAN, NAN, NAN, NAN))
KNOWN = ~np.isnan(MAX)
LIBRARY = np.stack([np.nan_to_num(MAX), np.nan_to_num(MAX[:, ::-1])])

FIT = FittedTables(
    mu=np.log(MEDIAN),
    sigma=np.where(KNOWN, 0.5, NAN),
    lognormal_median=MEDIAN,
    lognormal_mean=MEDIAN * np.exp(0.125),
    mean=MEDIAN * 1.1,
    std=np.where(KNOWN, 0.05, NAN),
    min=MEDIAN / 2,
    max=MAX,
    n=np.where(KNOWN, 2, 0),
    value_mean=np.array([0.5, 0.4, 0.6, 0.0]),
    library_q=LIBRARY,
    library_td_var=np.full_like(LIBRARY, 0.01),
    estimator="mle",
)


def _targets(seed: int = 0) -> Targets:
    tasks = draw_tasks(FAMILY, seed, Stream.TARGET_TASK, np.arange(3))
    return Targets(
        FAMILY,
        FAMILY.target_learning,
        tasks,
        FAMILY.solve(tasks, FAMILY.target_learning.gamma)[0],
    )


def _initial(method: Method, fit: FittedTables = FIT) -> Initial:
    return method.initial(fit, _targets(0))


def test_zero_starts_with_nothing() -> None:
    initial = _initial(Zero())
    np.testing.assert_array_equal(initial.start, np.zeros((4, 4)))
    assert (initial.filled, initial.clipped) == (0, 0)


def test_maxqinit_is_the_largest_value_and_optimistic_where_nobody_knows() -> None:
    initial = _initial(MaxQInit())
    np.testing.assert_array_equal(initial.start, np.where(KNOWN, MAX, 0.9))
    assert (initial.filled, initial.clipped) == (5, 0)


def test_logqinit_median_is_the_fitted_median_and_zero_where_nobody_knows() -> None:
    initial = _initial(LogQInitMedian())
    np.testing.assert_array_equal(initial.start, np.where(KNOWN, MEDIAN, 0.0))
    assert (initial.filled, initial.clipped) == (5, 0)


def test_mean_is_the_mean_and_zero_where_nobody_knows() -> None:
    np.testing.assert_array_equal(_initial(Mean()).start, np.where(KNOWN, MEDIAN * 1.1, 0.0))


def test_logqinit_mean_is_the_fitted_mean() -> None:
    np.testing.assert_array_equal(_initial(LogQInitMean()).start, np.where(KNOWN, MEDIAN * np.exp(0.125), 0))


@pytest.mark.parametrize("quantile", [0.025, 0.5, 0.9])
def test_logqinit_quantile_is_scipys_quantile_of_the_fitted_lognormal(quantile: float) -> None:
    expected = stats.lognorm.ppf(quantile, 0.5, scale=MEDIAN)
    start = _initial(LogQInitQuantile(quantile=quantile)).start
    np.testing.assert_allclose(start[KNOWN], expected[KNOWN].clip(0, 1), rtol=1e-12)


def test_logqinit_quantile_is_one_sigma_below_the_median_unless_told_otherwise() -> None:
    start = _initial(LogQInitQuantile()).start
    np.testing.assert_allclose(start[KNOWN], MEDIAN[KNOWN] * np.exp(-0.5), rtol=1e-12)


@pytest.mark.parametrize("quantile", [0.0, 1.0, -0.1, float("nan")])
def test_a_quantile_lies_between_zero_and_one(quantile: float) -> None:
    with pytest.raises(ValueError, match="--quantile is"):
        LogQInitQuantile(quantile=quantile)


def test_a_quantile_of_another_estimator_is_refused_with_the_remedy() -> None:
    with pytest.raises(NotAllowed, match="this fit has umvue; fit again with --estimator mle"):
        _initial(LogQInitQuantile(), replace(FIT, estimator="umvue"))


def test_ucoi_lies_between_mean_and_maximum_by_confidence_and_spread() -> None:
    spread = replace(FIT, n=np.full((4, 4), 30), mean=np.full((4, 4), 0.3), max=np.full((4, 4), 0.5))
    spread = replace(spread, min=np.full((4, 4), 0.1), std=np.full((4, 4), 0.05))
    # c = 30/40, u = 2 * 0.05 / 0.4 = 1/4, b = 1 - 3/4 * 3/4 = 7/16
    np.testing.assert_allclose(_initial(Ucoi(), spread).start, 9 / 16 * 0.3 + 7 / 16 * 0.5)
    # where all sources agree, only their number counts: b = 1 - 3/4
    agreed = replace(spread, max=spread.mean, min=spread.mean, std=np.zeros((4, 4)))
    np.testing.assert_allclose(_initial(Ucoi(), agreed).start, 0.3)
    # values at either end: u = 1, so the maximum
    apart = replace(spread, std=np.full((4, 4), 0.2))
    np.testing.assert_allclose(_initial(Ucoi(), apart).start, 0.5)
    # rounding can put a deviation beyond half the width, but no start beyond the maximum
    beyond = replace(spread, std=np.full((4, 4), np.nextafter(0.2, 1) + 1e-9))
    assert _initial(Ucoi(), beyond).start.max() <= 0.5
    # with kappa 0 a number of sources counts in full: b = u
    np.testing.assert_allclose(_initial(Ucoi(kappa=0), spread).start, 0.75 * 0.3 + 0.25 * 0.5)


def test_optimal_starts_each_target_with_its_own_exact_table() -> None:
    targets = _targets(0)
    exact, _ = FAMILY.solve(targets.tasks, targets.learning.gamma)
    np.testing.assert_array_equal(Optimal().initial(FIT, targets).start, exact)
    assert len(np.unique(exact, axis=0)) > 1


@pytest.mark.parametrize("method", [Ptrs, Drs])
def test_a_plus_variant_differs_from_the_method_by_its_start_alone(method: type[Plus]) -> None:
    plain, plus = _initial(method()), _initial(method(init="logqinit-median"))
    np.testing.assert_array_equal(plus.potential, plain.potential)
    np.testing.assert_array_equal(plus.start, _initial(LogQInitMedian()).start)
    assert method(init="logqinit-median").label == f"{method.name}+logqinit-median"
    assert method().label == method.name


def test_who_reads_the_target_and_whose_formula_is_not_public_is_marked() -> None:
    assert {name for name, method in METHODS.items() if method.privileged} >= {"optimal"}
    assert {name for name, method in METHODS.items() if method.reconstructed} >= {"ucoi"}
    unmarked = {"zero", "mean", "maxqinit", "logqinit-median", "logqinit-mean", "logqinit-quantile"}
    assert not {name for name in unmarked if METHODS[name].privileged or METHODS[name].reconstructed}
    assert "reconstruction" in (METHODS["ucoi"].__doc__ or "")


@pytest.mark.parametrize(
    ("method", "elsewhere"),
    [
        (MaxQInit(fallback="zero"), 0.0),
        (MaxQInit(fallback="largest"), 0.9),
        (LogQInitMedian(fallback="zero"), 0.0),
        (LogQInitMedian(fallback="largest"), 0.5),  # the largest of its own table, not of the sources
    ],
    ids=repr,
)
def test_the_fallback_says_what_stands_where_nobody_knows(method: Method, elsewhere: float) -> None:
    assert set(_initial(method).start[~KNOWN]) == {elsewhere}


def test_a_fit_that_knows_nothing_gives_zeros_even_to_the_optimistic() -> None:
    nothing = replace(FIT, max=np.full((4, 4), NAN), lognormal_median=np.full((4, 4), NAN))
    for method in (MaxQInit(), LogQInitMedian(fallback="largest")):
        initial = _initial(method, nothing)
        np.testing.assert_array_equal(initial.start, np.zeros((4, 4)))
        assert initial.filled == 16


def test_values_above_the_largest_return_and_below_zero_are_clipped_and_counted() -> None:
    odd = MAX.copy()
    odd[0, 0], odd[1, 1], odd[1, 2] = 1.5, 2.0, -0.25
    initial = _initial(MaxQInit(fallback="zero"), replace(FIT, max=odd))
    assert (initial.start[0, 0], initial.start[1, 1], initial.start[1, 2]) == (1.0, 1.0, 0.0)
    assert initial.clipped == 3
    assert initial.start[0, 1] == 0.5


def test_an_optimistic_fallback_is_clipped_too() -> None:
    odd = MAX.copy()
    odd[0, 0] = 3.0
    initial = _initial(MaxQInit(), replace(FIT, max=odd))
    assert set(initial.start[~KNOWN]) == {1.0}
    assert initial.clipped == 1 + 5


def test_an_estimator_without_a_median_is_refused_with_the_remedy() -> None:
    with pytest.raises(NotAllowed, match="shen, has no median; fit again with --estimator mle"):
        _initial(LogQInitMedian(), replace(FIT, estimator="shen"))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_gives_three_arrays_of_the_right_shape(name: str) -> None:
    initial = _initial(METHODS[name]())
    leading = (3,) if METHODS[name].privileged else ()
    assert initial.start.shape in ((4, 4), (*leading, 4, 4))
    assert initial.potential.shape in ((4,), (*leading, 4))
    assert initial.policies.actions.shape[1:] == (4,)
    assert initial.start.dtype == initial.potential.dtype == np.float64
    assert np.issubdtype(initial.policies.actions.dtype, np.integer)
    assert ((initial.start >= 0) & (initial.start <= 1)).all()
    assert np.isfinite(initial.potential).all()


@pytest.mark.parametrize("name", UNPRIVILEGED)
def test_an_unprivileged_method_does_not_look_at_the_targets(name: str) -> None:
    method = METHODS[name]()
    one, other = method.initial(FIT, _targets(0)), method.initial(FIT, _targets(1))
    np.testing.assert_array_equal(one.start, other.start)
    np.testing.assert_array_equal(one.potential, other.potential)
    np.testing.assert_array_equal(one.policies.actions, other.policies.actions)


@pytest.mark.parametrize("name", METHODS)
def test_a_method_leaves_the_fit_as_it_was(name: str) -> None:
    before = {each: getattr(FIT, each).copy() for each in FittedTables.TABLES}
    _initial(METHODS[name]())
    for each, values in before.items():
        np.testing.assert_array_equal(getattr(FIT, each), values)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_says_what_it_is(name: str) -> None:
    method = METHODS[name]
    assert method.name == name
    assert method.formula
    assert (method.__doc__ or "").splitlines()[0].strip().endswith(".")


@pytest.mark.parametrize("method", [Zero(), MaxQInit(), LogQInitMedian()], ids=repr)
def test_a_start_table_alone_has_a_neutral_potential_and_no_policies(method: Method) -> None:
    initial = _initial(method)
    assert not initial.potential.any()
    assert initial.policies.actions.shape == (0, 4)


def test_a_fallback_that_is_none_of_the_two_is_refused() -> None:
    with pytest.raises(ValueError, match="--fallback is 'highest'; it is one of zero, largest"):
        Initialisation(fallback="highest")  # type: ignore[arg-type]


def test_ptrs_shapes_by_the_mean_of_the_largest_or_the_largest_of_the_means() -> None:
    np.testing.assert_array_equal(Ptrs().initial(FIT, _targets(3)).potential, FIT.value_mean)
    expected = np.nanmax(np.where(KNOWN, FIT.mean, 0.0), axis=1)
    np.testing.assert_array_equal(Ptrs(phi="max-mean").initial(FIT, _targets(3)).potential, expected)


def test_drs_shapes_by_the_manhattan_distance_to_each_targets_own_goal() -> None:
    targets = _targets(3)
    potential = Drs().initial(FIT, targets).potential
    for goal, found in zip(targets.tasks, potential, strict=True):
        by_hand = [
            FAMILY.target_learning.gamma ** (abs(row - goal["goal_row"]) + abs(col - goal["goal_col"]))
            for row in (0, 1)
            for col in (0, 1)
        ]
        np.testing.assert_allclose(found, by_hand)
    linear = Drs(distance="linear").initial(FIT, targets).potential
    distance = np.log(potential) / np.log(FAMILY.target_learning.gamma)
    np.testing.assert_allclose(linear, 1 - distance / 2, atol=1e-12)


@pytest.mark.parametrize("method", [Ptrs, Drs, OpsTl])
def test_plus_starts_where_the_initialisation_starts(method: Any) -> None:
    for init in ("zero", "maxqinit", "logqinit-median", "ucoi"):
        started = method(init=init).initial(FIT, _targets(3))
        np.testing.assert_array_equal(started.start, METHODS[init]().initial(FIT, _targets(3)).start)


@pytest.mark.parametrize("init", ["optimal", "ptrs", "nosuch"])
def test_only_a_start_table_made_from_the_fit_starts_another_method(init: str) -> None:
    with pytest.raises(ValueError, match=f"--init is {init}; it is one of zero, mean"):
        Ptrs(init=init)


def test_ops_tl_chooses_among_the_greedy_policies_of_the_first_tables() -> None:
    policies = OpsTl(library=1, c=0.3, nu=0.5).initial(FIT, _targets(3)).policies
    np.testing.assert_array_equal(policies.actions, LIBRARY[:1].argmax(axis=2))
    assert (policies.c, policies.psi0, policies.rho, policies.nu) == (0.3, 1.0, 0.99, 0.5)


@pytest.mark.parametrize(
    ("method", "label"),
    [
        (Zero(), "zero"),
        (Ucoi(), "ucoi"),
        (Ucoi(kappa=5.0), "ucoi kappa=5.0"),
        (Ptrs(init="logqinit-mean"), "ptrs+logqinit-mean"),
        (
            OpsTl(init="mean", rho=1.0, explore_while_following=True),
            "ops-tl+mean rho=1.0 explore-while-following",
        ),
    ],
)
def test_a_label_tells_the_options_that_are_not_at_their_default(method: Method, label: str) -> None:
    assert method.label == label


@pytest.mark.parametrize("mixing", ["arithmetic", "geometric"])
def test_posterior_starts_from_the_librarys_mean_over_those_that_know(mixing: Any) -> None:
    initial = _initial(Posterior(mixing=mixing))
    for state, action in np.ndindex(4, 4):
        known = [table[state, action] for table in LIBRARY if table[state, action] > 0]
        expected = 0.0 if not known else stats.gmean(known) if mixing == "geometric" else np.mean(known)
        assert initial.start[state, action] == pytest.approx(expected, rel=1e-13)
    assert initial.filled == (LIBRARY.max(axis=0) == 0).sum() > 0


def test_posteriors_evidence_is_cooler_and_of_more_goals_where_the_table_hides_part_of_the_state() -> None:
    names = ("evidence", "temperature", "freeze", "cap")
    told = [
        tuple(getattr(Posterior().on(family), name) for name in names)
        for family in (Gridworld(), MountainCar())
    ]
    assert told == [("centred", 0.05, 3, 200.0), ("bounded", 0.01, 30, 5.0)]
    given = Posterior(evidence="bounded", freeze=0, temperature=0.2).on(Gridworld())
    assert tuple(getattr(given, name) for name in names) == ("bounded", 0.2, 0, 5.0)


def test_posterior_weighs_the_first_tables_of_the_library_by_its_own_rules() -> None:
    method = Posterior(library=1, temperature=0.3, floor=0.2, excess=1.0, freeze=7, threshold=0.01)
    initial = _initial(method)
    hypotheses = initial.hypotheses
    assert hypotheses is not None
    assert initial.hypothesis_count == 1
    np.testing.assert_array_equal(hypotheses.q, LIBRARY[:1])
    np.testing.assert_array_equal(hypotheses.td_var, FIT.library_td_var[:1])
    rules = (
        hypotheses.temperature,
        hypotheses.floor,
        hypotheses.excess,
        hypotheses.freeze,
        hypotheses.threshold,
    )
    assert rules == (0.3, 0.2, 1.0, 7, 0.01)
    assert _initial(Posterior(library=0)).hypothesis_count == 0


def test_posterior_weighs_tables_within_what_a_return_can_be() -> None:
    odd = LIBRARY.copy()
    odd[0, 0, 0], odd[1, 1, 1] = 1.5, -0.25
    hypotheses = _initial(Posterior(), replace(FIT, library_q=odd)).hypotheses
    assert hypotheses is not None
    expected = LIBRARY.copy()
    expected[0, 0, 0], expected[1, 1, 1] = 1.0, 0.0
    np.testing.assert_array_equal(hypotheses.q, expected)


def test_posteriors_evidence_is_centred_where_states_are_markov_and_bounded_elsewhere() -> None:
    grid, car = Gridworld(), MountainCar()
    assert (Posterior().on(grid).evidence, Posterior().on(grid).cap) == ("centred", 200)
    assert (Posterior().on(car).evidence, Posterior().on(car).cap) == ("bounded", 5)
    assert Posterior(evidence="bounded").on(grid).cap == 5
    assert Posterior(cap=9.0).on(car).cap == 9
    hypotheses = _initial(Posterior()).hypotheses
    assert hypotheses is not None
    assert hypotheses.centred
    assert hypotheses.cap == 200


def test_no_other_method_leaves_anything_to_the_family() -> None:
    for name, method in METHODS.items():
        if name != "posterior":
            assert method().on(FAMILY) == method()


def test_a_method_that_looks_at_targets_starts_none_unseen() -> None:
    for method in METHODS.values():
        if method.privileged:
            with pytest.raises(NotAllowed, match="starts from the target itself"):
                method().initial_of_all(FIT, FAMILY, FAMILY.target_learning)
        elif method is not Posterior:
            unseen = method().initial_of_all(FIT, FAMILY, FAMILY.target_learning)
            np.testing.assert_array_equal(unseen.start, _initial(method()).start)
