"""Statistics through the stage, cell by cell against scipy, statsmodels and plain arithmetic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.diagnostic import lilliefors, normal_ad
from statsmodels.stats.multitest import multipletests

from qinit_cli.analysis.rounded_normal import rounded_normality
from qinit_cli.artefacts.fit_findings import findings, rejected
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.fitted import FitOptions, FittedTables
from qinit_cli.pipeline import fit_statistics as stage
from qinit_cli.pipeline.fit import Selection, fit, hold_out
from qinit_cli.seeding import Stream, generator

TASKS, SHAPE = 60, (3, 2, 4)
SEED = 5
ORIGIN = stage.Origin(Gridworld(), gamma=0.9, seed=SEED)
NOTHING = FitOptions(normality="none")


def _sources(tasks: int = TASKS) -> dict[str, Any]:
    """Tables from log-normal to normal; some entries masked, one pair known to too few, one always the same."""
    probability = np.random.default_rng(11)
    q = np.exp(probability.normal(-3, np.linspace(0.01, 0.9, 24).reshape(SHAPE), (tasks, *SHAPE)))
    q[probability.random(q.shape) < 0.03] = 0.0
    q[7:, 0, 0, 0] = 0.0
    q[:, 0, 0, 1] = 0.25
    eopl = np.rint(probability.normal(30, np.linspace(0.5, 6, 24).reshape(SHAPE), q.shape)).astype(np.int32)
    eopl[probability.random(q.shape) < 0.05] = -1
    eopl[:, 0, 0, 1] = 0
    return {"task": np.arange(tasks), "q": q, "td_var": np.zeros_like(q), "eopl": eopl}


SOURCES = _sources()
CELLS = [cell for cell in np.ndindex(SHAPE) if cell not in ((0, 0, 0), (0, 0, 1))]


def _blocks(sources: dict[str, Any], size: int = 64) -> Iterator[dict[str, Any]]:
    for first in range(0, len(sources["task"]), size):
        yield {name: values[first : first + size] for name, values in sources.items()}


def _statistics(
    options: FitOptions,
    sources: dict[str, Any] | None = None,
    size: int = 64,
    origin: stage.Origin = ORIGIN,
) -> dict[str, Any]:
    sources = SOURCES if sources is None else sources
    names = [name for name in stage.columns(options, ORIGIN.family) if name in sources]
    sample = stage.Sample(np.ones(len(sources["task"]), bool), SEED, tuple(names))
    for _ in sample.reading(_blocks(sources, size)):
        pass
    return stage.statistics(sample.columns, origin, options)


def _logarithms(cell: tuple[int, ...]) -> np.ndarray[Any, Any]:
    values = SOURCES["q"][(slice(None), *cell)]
    return np.log(values[values > 0])


def test_shapiro_wilk_of_every_cell_is_scipys() -> None:
    arrays = _statistics(FitOptions())
    for cell in CELLS:
        logs = _logarithms(cell)
        known = stats.shapiro(logs)
        assert arrays["normality_w"][cell] == pytest.approx(known.statistic, abs=1e-8)
        assert arrays["normality_p"][cell] == pytest.approx(known.pvalue, rel=1e-5, abs=1e-8)
        assert arrays["normality_n"][cell] == len(logs)
        assert arrays["normality_skewness"][cell] == pytest.approx(stats.skew(logs), rel=1e-8)
        assert arrays["normality_kurtosis"][cell] == pytest.approx(stats.kurtosis(logs), rel=1e-8)


def test_anderson_darling_of_every_cell_is_statsmodels() -> None:
    arrays = _statistics(FitOptions(normality="anderson"))
    for cell in CELLS:
        statistic, p = normal_ad(_logarithms(cell))
        assert arrays["normality_w"][cell] == pytest.approx(statistic, rel=1e-7)
        assert arrays["normality_p"][cell] == pytest.approx(p, rel=1e-6)


def test_lilliefors_statistic_of_every_cell_is_statsmodels() -> None:
    arrays = _statistics(FitOptions(normality="lilliefors"))
    for cell in CELLS:
        statistic, p = lilliefors(_logarithms(cell))
        assert arrays["normality_w"][cell] == pytest.approx(statistic, rel=1e-9)
        assert arrays["normality_p"][cell] == pytest.approx(
            p, rel=0.3, abs=0.02
        )  # between the sizes of their table


@pytest.mark.parametrize("test", ["shapiro", "anderson", "lilliefors"])
def test_too_few_or_equal_values_are_not_testable(test: Any) -> None:
    arrays = _statistics(FitOptions(normality=test))
    for name in ("w", "p", "skewness", "kurtosis"):
        assert np.isnan(arrays[f"normality_{name}"][0, 0, :2]).all()
    assert (arrays["normality_n"][0, 0, 0], arrays["normality_n"][0, 0, 1]) == (7, TASKS)


def test_path_lengths_are_tested_against_the_rounded_normal() -> None:
    arrays = _statistics(replace(NOTHING, eopl_normality="rounded"))
    probability = generator(SEED, Stream.NORMALITY, 2)
    lengths = SOURCES["eopl"].astype(float)
    known = rounded_normality(lengths, lengths >= 0, probability)
    np.testing.assert_array_equal(arrays["eopl_normality_p"], known.p)
    for cell in CELLS:
        values = lengths[(slice(None), *cell)]
        assert arrays["eopl_normality_w"][cell] == pytest.approx(
            stats.shapiro(values[values >= 0]).statistic, abs=1e-8
        )
    assert np.isnan(arrays["eopl_normality_p"][0, 0, 1])  # the goal of every task
    fair = arrays["eopl_normality_p"][np.isfinite(arrays["eopl_normality_p"])]
    assert (fair < 0.05).mean() < 0.2  # as they are rounded normals
    plain = [stats.shapiro(lengths[(slice(None), *cell)]).pvalue for cell in CELLS[:6]]
    assert np.mean(plain) < fair.mean()  # which the plain test punishes for the rounding


def test_dithered_path_lengths_are_scipys_shapiro_of_the_lengths_plus_uniform_noise() -> None:
    arrays = _statistics(replace(NOTHING, eopl_normality="dither"))
    noise = generator(SEED, Stream.NORMALITY, 2).uniform(-0.5, 0.5, (TASKS, 24)).reshape(TASKS, *SHAPE)
    lengths = SOURCES["eopl"]
    for cell in CELLS:
        arrives = lengths[(slice(None), *cell)] >= 0
        values = (lengths + noise)[(slice(None), *cell)][arrives]
        assert arrays["eopl_normality_p"][cell] == pytest.approx(stats.shapiro(values).pvalue, rel=1e-5)


def test_aic_of_every_distribution_is_that_of_scipys_maximum_likelihood_fit() -> None:
    arrays = _statistics(replace(NOTHING, alternatives=True))
    kinds = {"lognormal": stats.lognorm, "gamma": stats.gamma, "weibull": stats.weibull_min}
    names = stage.contents(replace(NOTHING, alternatives=True)).distributions
    for cell in CELLS[10::5]:
        values = np.exp(_logarithms(cell))
        for name, kind in kinds.items():
            fitted = kind.fit(values, floc=0)
            known = 4 - 2 * kind.logpdf(values, *fitted).sum()
            assert arrays["alternative_aic"][(names.index(name), *cell)] == pytest.approx(known, abs=1e-2)
        known = 4 - 2 * stats.norm.logpdf(values, *stats.norm.fit(values)).sum()
        assert arrays["alternative_aic"][(names.index("normal"), *cell)] == pytest.approx(known, rel=1e-9)
    assert np.isnan(arrays["alternative_aic"][names.index("empirical")]).all()


def test_the_held_out_log_score_is_that_of_fits_without_the_fold() -> None:
    arrays = _statistics(replace(NOTHING, alternatives=True))
    order = generator(SEED, Stream.HOLDOUT, 0).permutation(TASKS)
    fold = np.empty(TASKS, int)
    fold[order] = np.arange(TASKS) % stage.FOLDS
    for cell in CELLS[::7]:
        values = SOURCES["q"][(slice(None), *cell)]
        scores: list[float] = []
        for number in range(stage.FOLDS):
            train = values[(fold != number) & (values > 0)]
            held = values[(fold == number) & (values > 0)]
            scores += list(
                stats.lognorm.logpdf(held, np.log(train).std(), scale=np.exp(np.log(train).mean()))
            )
        assert arrays["alternative_log_score"][(0, *cell)] == pytest.approx(np.mean(scores), rel=1e-9)


def test_with_many_tasks_some_are_scored_and_the_rest_only_learned_from(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stage, "MOST_LEARNED", 40)
    monkeypatch.setattr(stage, "MOST_SCORED", 20)
    learned, folds = stage._folds(TASKS, SEED)
    assert len(learned) == 40
    assert (np.diff(learned) > 0).all()
    assert np.bincount(folds + 1).tolist() == [20, *[2] * stage.FOLDS]


def test_the_bound_on_memory_changes_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    options = FitOptions(alternatives=True)
    whole = _statistics(options)
    monkeypatch.setattr(stage, "VALUES_AT_ONCE", TASKS * 5)
    for name, values in _statistics(options).items():
        np.testing.assert_allclose(values, whole[name], rtol=1e-9, err_msg=name)


def test_how_sources_are_read_changes_no_number() -> None:
    options = FitOptions(eopl_normality="rounded")
    whole = _statistics(options)
    for name, values in _statistics(options, size=7).items():
        np.testing.assert_array_equal(values, whole[name], err_msg=name)


def test_of_many_tasks_5000_drawn_ones_are_tested() -> None:
    probability = np.random.default_rng(0)
    many = {"task": np.arange(5_200), "q": np.exp(probability.normal(size=(5_200, 1, 2)))}
    found = [_statistics(FitOptions(), many, size) for size in (64, 1_000)]
    assert (found[0]["normality_n"] == 5_000).all()
    np.testing.assert_array_equal(found[0]["normality_p"], found[1]["normality_p"])
    drawn = np.sort(generator(SEED, Stream.NORMALITY, 0).choice(5_200, 5_000, replace=False))
    known = stats.shapiro(np.log(many["q"][drawn, 0, 1]))
    assert found[0]["normality_w"][0, 1] == pytest.approx(known.statistic, abs=1e-8)


def test_sources_left_out_of_the_fit_are_not_tested() -> None:
    kept = np.arange(TASKS) % 3 > 0
    sample = stage.Sample(kept, SEED, ("q",))
    list(sample.reading(_blocks(SOURCES, 7)))
    np.testing.assert_array_equal(sample.columns["q"], SOURCES["q"][kept])


@pytest.mark.parametrize(
    ("options", "read"),
    [
        (NOTHING, ()),
        (FitOptions(), ("q",)),
        (replace(NOTHING, eopl_normality="dither"), ("eopl",)),
        (replace(NOTHING, check_theory=True), ("q", "eopl", "goal_row", "goal_col", "p")),
    ],
)
def test_only_what_is_asked_for_is_kept(options: FitOptions, read: tuple[str, ...]) -> None:
    assert stage.columns(options, ORIGIN.family) == read


def _theory(family: Gridworld) -> tuple[dict[str, Any], dict[str, Any]]:
    """The arrays of the theory, and the exact sources they are of."""
    sources = _exact(family, ORIGIN.gamma)
    origin = replace(ORIGIN, family=family)
    return _statistics(replace(NOTHING, check_theory=True), sources, origin=origin), sources


def _exact(family: Gridworld, gamma: float) -> dict[str, Any]:
    tasks = np.array(
        [family.draw(np.random.default_rng(index)) for index in range(30)],
        [(column.name, column.dtype) for column in family.parameters()],
    )
    q, _ = family.solve(tasks, gamma)
    eopl = family.path_lengths(tasks, q, 1_000)
    shape = (len(tasks), *family.shape, 4)
    columns = {name: tasks[name] for name in ("goal_row", "goal_col", "p")}
    return {"task": np.arange(30), "q": q.reshape(shape), "eopl": eopl.reshape(shape), **columns}


def test_certain_moves_are_worth_gamma_to_one_step_less_and_the_length_explains_all() -> None:
    arrays, _ = _theory(Gridworld(size=5, variance=2, p_low=1, p_high=1))
    np.testing.assert_allclose(arrays["theory_length_bias"], 0, atol=1e-9)
    np.testing.assert_allclose(arrays["theory_product_bias"], np.log(ORIGIN.gamma), rtol=1e-9)
    varies = np.isfinite(arrays["theory_explained"])
    assert varies.any()
    np.testing.assert_allclose(arrays["theory_explained"][varies], 1, atol=1e-9)
    np.testing.assert_allclose(arrays["theory_explained_by_gamma"][varies], 1, atol=1e-9)
    told = findings(arrays, FitOptions())["theory"]
    assert told["explained_pooled"] == pytest.approx(1)
    assert told["forms"][1]["median_mean_ratio"] == pytest.approx(1)


def test_slips_make_the_product_far_too_small_and_the_length_too_large() -> None:
    arrays, sources = _theory(Gridworld(size=5, variance=2))
    assert (arrays["theory_product_bias"] < 0).all()
    assert (arrays["theory_length_bias"] > 0).all()
    goal = (sources["q"] > 0) & (sources["eopl"] > 0)
    np.testing.assert_array_equal(arrays["theory_n"], goal.sum(axis=0))
    explained = arrays["theory_explained"]
    for cell in ((0, 0, 1), (4, 4, 0)):
        at = goal[(slice(None), *cell)]
        logs = np.log(sources["q"][(slice(None), *cell)][at])
        line = stats.linregress(sources["eopl"][(slice(None), *cell)][at], logs)
        assert explained[cell] == pytest.approx(line.rvalue**2, rel=1e-9)
        assert arrays["theory_variance"][cell] == pytest.approx(logs.var(), rel=1e-9)


def test_the_car_is_certain_given_its_push() -> None:
    family = MountainCar(noise=0.01)
    tasks = np.array([(0.0,), (0.01,)], [("eta", "f8")])
    assert not family.log_path(tasks, np.full((2, 900, 3), 7)).any()


def test_held_out_sources_are_the_last_that_are_kept_and_the_fit_does_not_see_them() -> None:
    kept = np.ones(TASKS, bool)
    kept[[3, TASKS - 1]] = False
    selection, held = hold_out(Selection(kept, 2, 0), 5)
    assert np.flatnonzero(held).tolist() == [TASKS - 6, TASKS - 5, TASKS - 4, TASKS - 3, TASKS - 2]
    assert not (held & selection.kept).any()
    arrays = fit(_blocks(SOURCES), selection, FitOptions())
    first = {name: values[: TASKS - 6] for name, values in SOURCES.items()}
    alone = fit(_blocks(first), Selection(kept[: TASKS - 6], 1, 0), FitOptions())
    for name, values in alone.items():
        np.testing.assert_array_equal(arrays[name], values, err_msg=name)


def test_holding_nothing_out_leaves_the_selection() -> None:
    selection, held = hold_out(Selection(np.ones(4, bool), 0, 0), 0)
    assert selection.kept.all()
    assert not held.any()


@pytest.mark.parametrize("estimator", ["mle", "shen"])
def test_held_out_errors_of_each_start_are_plain_means(estimator: Any) -> None:
    options = FitOptions(holdout=10, estimator=estimator)
    selection, held = hold_out(Selection(np.ones(TASKS, bool), 0, 0), 10)
    fitted = FittedTables.from_arrays(fit(_blocks(SOURCES), selection, options), 6, estimator)
    origin = stage.Origin(Gridworld(), 0.9, SEED)
    arrays = stage.held_out_errors(_blocks(SOURCES, 7), held, fitted, origin)
    names = stage.contents(options).initialisations
    np.testing.assert_array_equal(arrays["held_out_task"], np.arange(50, 60))
    tables = SOURCES["q"][50:].reshape(10, -1)
    zero, mean, median = (names.index(name) for name in ("zero", "mean", "logqinit-median"))
    np.testing.assert_allclose(arrays["held_out_absolute"][zero], tables.mean(axis=1), rtol=1e-12)
    positive = np.where(SOURCES["q"][:50] > 0, SOURCES["q"][:50], np.nan).reshape(50, -1)
    start = np.nanmean(positive, axis=0)
    np.testing.assert_allclose(
        arrays["held_out_squared"][mean], np.sqrt(np.mean((start - tables) ** 2, axis=1)), rtol=1e-9
    )
    np.testing.assert_allclose(arrays["held_out_bias"][mean], np.mean(start - tables, axis=1), rtol=1e-9)
    geometric = np.exp(np.nanmean(np.log(positive), axis=0))
    known = np.abs(geometric - tables).mean(axis=1)
    if estimator == "mle":
        np.testing.assert_allclose(arrays["held_out_absolute"][median], known, rtol=1e-9)
    else:
        assert np.isnan(arrays["held_out_absolute"][median]).all()
    told = findings(arrays | {"initialisation": np.array(names, "S")}, FitOptions())["holdout"]
    rows = {row["initialisation"]: row for row in told["initialisations"]}
    assert rows["zero"]["absolute"] == pytest.approx(tables.mean())
    assert rows["zero"]["absolute_error"] == pytest.approx(stats.sem(tables.mean(axis=1)))
    assert min(row["behind"] for row in rows.values() if row["behind"] is not None) == 0
    assert sum(row["nearest"] for row in rows.values()) == pytest.approx(1)
    assert (rows["logqinit-median"]["absolute"] is None) == (estimator == "shen")


def test_shares_rejected_are_statsmodels() -> None:
    p = np.random.default_rng(2).beta(0.3, 1, (6, 7))
    p[0, :3] = np.nan
    known = p[np.isfinite(p)]
    shares = rejected(p)
    assert shares["rejected_raw"] == np.mean(known < 0.05)
    for name, method in (("benjamini_hochberg", "fdr_bh"), ("benjamini_yekutieli", "fdr_by")):
        assert shares[f"rejected_{name}"] == multipletests(known, 0.05, method)[0].mean()
    assert len(set(shares.values())) == 3


def test_findings_are_shares_and_medians_over_testable_cells() -> None:
    options = FitOptions(alternatives=True)
    arrays = _statistics(options)
    names = np.array(stage.contents(options).distributions, "S")
    told = findings(arrays | {"distribution": names}, FitOptions())
    assert told["normality"]["test"] == "Shapiro-Wilk"
    assert (told["normality"]["tested"], told["normality"]["not_testable"]) == (22, 2)
    assert told["normality"]["median_statistic"] == np.nanmedian(arrays["normality_w"])
    wins = {one["distribution"]: one for one in told["alternatives"]["distributions"]}
    assert sum(one["aic_wins"] or 0 for one in wins.values()) == pytest.approx(1)
    assert sum(one["log_score_wins"] for one in wins.values()) == pytest.approx(1)
    assert wins["empirical"]["aic_wins"] is None
    best = np.nanargmin(arrays["alternative_aic"][:5].reshape(5, -1)[:, 2:], axis=0)
    assert wins["lognormal"]["aic_wins"] == np.mean(best == 0)


def test_where_nothing_is_testable_the_findings_have_no_numbers() -> None:
    few = {name: values[:5] for name, values in SOURCES.items()}
    told = findings(_statistics(FitOptions(), few), FitOptions())["normality"]
    assert (told["tested"], told["rejected_raw"], told["median_statistic"]) == (0, None, None)
