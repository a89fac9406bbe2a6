from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.fitted import MASKED, UNKNOWN, FitOptions
from qinit_cli.pipeline.fit import BLOCK, Selection, fit, select

TASKS, SHAPE = 150, (3, 2, 4)  # three blocks, the last of them short


def _sources() -> dict[str, Any]:
    """Log-normal tables; some entries are zero or negative, one pair is known to nobody, one to a single source."""
    probability = np.random.default_rng(11)
    q = np.exp(probability.normal(-3, 0.7, (TASKS, *SHAPE)))
    q[probability.random(q.shape) < 0.03] = 0.0
    q[:, 2, 0, 1] = 0.5 * np.exp(probability.normal(0, 0.1, TASKS))  # masked nowhere
    q[:, 0, 0, 0] = 0.0
    q[:, 0, 0, 1] = 0.0
    q[7, 0, 0, 1] = 0.25
    q[3, 1, 1, 1] = -0.1
    eopl = probability.integers(1, 40, q.shape).astype(np.int32)
    eopl[probability.random(q.shape) < 0.05] = -1
    return {"task": np.arange(TASKS), "q": q, "td_var": probability.random(q.shape), "eopl": eopl}


SOURCES = _sources()
EVERY_SOURCE = Selection(kept=np.ones(TASKS, bool), unsolvable=0, unlearned=0)


def _blocks(sources: dict[str, Any], size: int = BLOCK) -> Iterator[dict[str, Any]]:
    for first in range(0, len(sources["task"]), size):
        yield {name: values[first : first + size] for name, values in sources.items()}


def _fitted(options: FitOptions | None = None) -> dict[str, Any]:
    return fit(_blocks(SOURCES), EVERY_SOURCE, options or FitOptions())


def test_mu_and_sigma_are_numpys_two_pass_values() -> None:
    positive = np.where(SOURCES["q"] > 0, SOURCES["q"], np.nan)
    known = ~np.isnan(positive).all(axis=0)
    arrays = _fitted()
    logs = np.log(positive[:, known])
    np.testing.assert_allclose(arrays["mu"][known], np.nanmean(logs, axis=0), rtol=1e-12)
    np.testing.assert_allclose(arrays["sigma"][known], np.nanstd(logs, axis=0), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("name", ["mean", "std", "min", "max"])
def test_moments_of_q_leave_out_what_is_masked(name: str) -> None:
    positive = np.where(SOURCES["q"] > 0, SOURCES["q"], np.nan)
    known = ~np.isnan(positive).all(axis=0)
    expected = getattr(np, f"nan{name}")(positive[:, known], axis=0)
    np.testing.assert_allclose(_fitted()[name][known], expected, rtol=1e-12, atol=1e-15)


def test_where_nothing_is_masked_the_fit_is_scipys_lognormal() -> None:
    values = SOURCES["q"][:, 2, 0, 1]
    assert (values > 0).all()
    sigma, _, scale = stats.lognorm.fit(values, floc=0)
    arrays = _fitted()
    assert arrays["mu"][2, 0, 1] == pytest.approx(np.log(scale), rel=1e-9)
    assert arrays["sigma"][2, 0, 1] == pytest.approx(sigma, rel=1e-9)
    assert arrays["lognormal_median"][2, 0, 1] == pytest.approx(scale, rel=1e-9)
    mean = stats.lognorm.mean(sigma, scale=scale)
    assert arrays["lognormal_mean"][2, 0, 1] == pytest.approx(mean, rel=1e-9)


def test_masked_entries_are_counted_never_floored() -> None:
    arrays = _fitted()
    np.testing.assert_array_equal(arrays["n"], (SOURCES["q"] > 0).sum(axis=0))
    np.testing.assert_array_equal(arrays["n_masked"], (SOURCES["q"] <= 0).sum(axis=0))


def test_a_pair_that_no_source_knows_is_not_a_number_and_flagged() -> None:
    arrays = _fitted()
    for name in ("mu", "sigma", "lognormal_median", "lognormal_mean", "mean", "std", "min", "max"):
        assert np.isnan(arrays[name][0, 0, 0]), name
        assert np.isnan(arrays[name]).sum() == 1, name
    assert arrays["n"][0, 0, 0] == 0
    assert arrays["flags"][0, 0, 0] == UNKNOWN


def test_a_pair_that_one_source_knows_has_no_spread() -> None:
    arrays = _fitted()
    assert (arrays["n"][0, 0, 1], arrays["mean"][0, 0, 1], arrays["sigma"][0, 0, 1]) == (1, 0.25, 0)
    assert arrays["lognormal_median"][0, 0, 1] == pytest.approx(0.25)


def test_flags_tell_pairs_with_masked_sources() -> None:
    q = SOURCES["q"]
    expected = np.where((q <= 0).any(axis=0), MASKED, 0)
    expected[0, 0, 0] = UNKNOWN
    np.testing.assert_array_equal(_fitted()["flags"], expected)


def test_path_lengths_that_never_arrive_are_no_lengths() -> None:
    arrays = _fitted()
    lengths = np.where(SOURCES["eopl"] >= 0, SOURCES["eopl"], np.nan)
    np.testing.assert_allclose(arrays["eopl_mean"], np.nanmean(lengths, axis=0), rtol=1e-12)
    np.testing.assert_allclose(arrays["eopl_std"], np.nanstd(lengths, axis=0), rtol=1e-12)
    np.testing.assert_array_equal(arrays["eopl_n"], (SOURCES["eopl"] >= 0).sum(axis=0))


def test_the_mean_value_of_a_state_is_over_all_sources() -> None:
    expected = SOURCES["q"].max(axis=3).mean(axis=0)
    np.testing.assert_allclose(_fitted()["value_mean"], expected, rtol=1e-12)


@pytest.mark.parametrize("size", [0, 1, BLOCK, BLOCK + 5, TASKS, TASKS + 50])
def test_the_library_is_the_first_tables_whole(size: int) -> None:
    arrays = _fitted(FitOptions(library=size))
    kept = min(size, TASKS)
    np.testing.assert_array_equal(arrays["library_q"], SOURCES["q"][:kept])
    np.testing.assert_array_equal(arrays["library_td_var"], SOURCES["td_var"][:kept])
    np.testing.assert_array_equal(arrays["library_task"], np.arange(kept))


def test_an_estimator_without_a_median_leaves_it_unknown() -> None:
    arrays = _fitted(FitOptions(estimator="shen"))
    assert np.isnan(arrays["lognormal_median"]).all()
    assert np.isnan(arrays["lognormal_mean"]).sum() == 1


def test_the_estimator_changes_the_mean_and_the_median_alone() -> None:
    mle, other = _fitted(), _fitted(FitOptions(estimator="umvue"))
    different = {name for name in mle if not np.array_equal(mle[name], other[name], equal_nan=True)}
    assert different == {"lognormal_median", "lognormal_mean"}


def test_a_library_cannot_be_smaller_than_empty() -> None:
    with pytest.raises(ValueError, match="--library is -1; it must be at least 0"):
        FitOptions(library=-1)


def test_sources_that_are_left_out_leave_no_trace() -> None:
    kept = np.random.default_rng(5).random(TASKS) < 0.4
    some = fit(_blocks(SOURCES), Selection(kept, 0, 0), FitOptions(library=20))
    positive = np.where(SOURCES["q"][kept] > 0, SOURCES["q"][kept], np.nan)
    known = ~np.isnan(positive).all(axis=0)
    np.testing.assert_allclose(some["mean"][known], np.nanmean(positive[:, known], axis=0), rtol=1e-12)
    np.testing.assert_array_equal(some["n"], (SOURCES["q"][kept] > 0).sum(axis=0))
    np.testing.assert_array_equal(some["library_task"], np.flatnonzero(kept)[:20])
    np.testing.assert_array_equal(some["library_q"], SOURCES["q"][kept][:20])


@pytest.mark.parametrize(("excluded", "kept"), [(False, [1, 1, 0]), (True, [1, 0, 0])])
def test_unsolvable_sources_are_left_out_and_unlearned_ones_if_asked(excluded: bool, kept: list[int]) -> None:
    family = MountainCar(noise=0.02)
    tasks = np.array(
        [(0.0,), (0.0,), (-0.5,)], [("eta", "f8")]
    )  # the last is thrown back wherever it arrives
    solved = np.array([True, False, False])
    chosen = select(family, tasks, solved, 1000, FitOptions(exclude_unlearned=excluded))
    assert chosen.kept.tolist() == [bool(one) for one in kept]
    assert (chosen.unsolvable, chosen.unlearned) == (1, 1)
