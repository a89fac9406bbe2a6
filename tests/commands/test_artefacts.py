"""What the stages leave on the disk, as those see it who have never heard of qinit: through xarray, by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray


def _opened(path: Path) -> Any:
    return xarray.load_dataset(path, engine="h5netcdf")


def test_sources_open_with_named_axes_and_the_contract_s_names(pipeline: Any) -> None:
    sources = _opened(pipeline.sources)
    assert {"task": 4, "row": 6, "col": 6, "action": 4, "bin": 100}.items() <= dict(sources.sizes).items()
    for name in ("q", "td_var", "eopl", "visits"):
        assert sources[name].dims == ("task", "row", "col", "action"), name
    for name in ("curve_steps", "curve_reached"):
        assert sources[name].dims == ("task", "bin")
    for name in ("goal_row", "goal_col", "p", "solved", "steps", "seconds"):
        assert sources[name].dims == ("task",), name
    assert sources.action.values.astype(str).tolist() == ["up", "down", "left", "right"]
    assert (sources.q.dtype, sources.eopl.dtype, sources.visits.dtype) == (np.float64, np.int32, np.int64)
    goal = sources.isel(task=0)
    assert not goal.q.sel(row=goal.goal_row.item(), col=goal.goal_col.item()).any()


def test_a_fit_opens_with_named_axes_and_the_contract_s_names(pipeline: Any) -> None:
    fit = _opened(pipeline.fit)
    names = (
        "mu sigma lognormal_median lognormal_mean mean std min max eopl_mean eopl_std n n_masked eopl_n flags"
    )
    for name in names.split():
        assert fit[name].dims == ("row", "col", "action"), name
    assert fit.value_mean.dims == ("row", "col")
    for name in ("library_q", "library_td_var"):
        assert fit[name].dims == ("library", "row", "col", "action")
    assert fit.library_task.values.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("method", ["zero", "logqinit-median"])
def test_a_run_opens_with_named_axes_and_the_contract_s_names(method: str, pipeline: Any) -> None:
    run = _opened(pipeline.runs[method])
    for name, kind in (("steps", np.int32), ("reached", np.uint8)):
        assert run[name].dims == ("task", "episode")
        assert run[name].dtype == kind
    for name in ("goal_row", "goal_col", "p", "v_star", "v_eps"):
        assert run[name].dims == ("task",)
    assert run.start.dims == ("row", "col", "action")
    assert run.potential.dims == ("row", "col")
    assert dict(run.sizes)["episode"] == 60


def test_exact_sources_have_no_curve_and_tables_of_a_run_are_kept_on_request(
    here: Callable[..., Any], pipeline: Any
) -> None:
    made = here("train-sources", "gridworld", "--size", 4, "--tasks", 2, "--learner", "exact", "-q")
    sources = _opened(made.path)
    assert "bin" not in sources.sizes
    assert not sources.visits.values.any()
    kept = here("transfer", "zero", pipeline.fit, "--tasks", 2, "--episodes", 5, "--keep-q", "-q")
    assert _opened(kept.path).q.dims == ("task", "row", "col", "action")


def test_a_start_that_depends_on_the_target_has_a_task_axis(here: Callable[..., Any], pipeline: Any) -> None:
    made = here("transfer", "optimal", pipeline.fit, "--tasks", 3, "--episodes", 5, "-q")
    run = _opened(made.path)
    assert run.start.dims == ("task", "row", "col", "action")
    np.testing.assert_array_equal(run.start.sel(row=0, col=0).max("action"), run.v_star)


def test_the_fit_s_library_and_moments_are_those_of_its_sources(pipeline: Any) -> None:
    sources, fit = _opened(pipeline.sources), _opened(pipeline.fit)
    np.testing.assert_array_equal(fit.library_q, sources.q)
    positive = sources.q.where(sources.q > 0)
    known = (fit.n > 0).values
    np.testing.assert_allclose(fit.mu.values[known], np.log(positive).mean("task").values[known], rtol=1e-12)


def test_logqinit_median_starts_where_the_fit_says(pipeline: Any) -> None:
    fit, run = _opened(pipeline.fit), _opened(pipeline.runs["logqinit-median"])
    np.testing.assert_array_equal(run.start, fit.lognormal_median.fillna(0).clip(0, 1))


def test_every_method_meets_the_same_targets(pipeline: Any) -> None:
    runs = [_opened(path) for path in pipeline.runs.values()]
    for name in ("goal_row", "goal_col", "p", "v_eps"):
        for run in runs[1:]:
            np.testing.assert_array_equal(run[name], runs[0][name])


def test_names_say_what_an_artefact_is(pipeline: Any) -> None:
    assert pipeline.sources.name.startswith("gridworld-6-variance-2-4-seed-0-")
    assert pipeline.fit.name.startswith("gridworld-6-variance-2-4-mle-")
    assert pipeline.runs["zero"].name.startswith("gridworld-6-variance-2-zero-4-seed-0-")
    parents = [path.parent.name for path in (pipeline.sources, pipeline.fit, pipeline.runs["zero"])]
    assert parents == ["sources", "fits", "runs"]


def test_asking_for_more_learns_only_what_is_new_and_ends_as_if_asked_at_once(
    here: Callable[..., Any],
) -> None:
    words = ("train-sources", "gridworld", "--size", 5, "--episodes", 100, "--json", "-q")
    here(*words, "--tasks", 3, "-o", "grown.h5")
    grown = here(*words, "--tasks", 7, "-o", "grown.h5").json
    at_once = here(*words, "--tasks", 7, "-o", "at-once.h5").json
    assert grown["skipped"] == 3
    assert grown["digest"] == at_once["digest"]
