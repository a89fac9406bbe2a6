"""What is complete is recognised without making what learning takes: pilots of tiles, projections, the targets' own tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import pytest
from running import Ended, Pipeline

from qinit_cli.pipeline import probes
from qinit_cli.pipeline.optimal_tables import OptimalTables

TILES = ("train-sources", "mountain-car", "--representation", "tiles", "--tiles", 4, "--probes", 64)


def _made(*_: Any) -> NoReturn:
    raise AssertionError("it was made")


def test_a_complete_run_of_optimal_makes_no_tables(
    here: Callable[..., Ended], pipeline: Pipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("transfer", "optimal", pipeline.fit, "--episodes", 20, "-o", "a.h5", "--json")
    first = here(*words, "--tasks", 3).json
    monkeypatch.setattr(OptimalTables, "_made", _made)
    again = here(*words, "--tasks", 3).json
    assert (again["digest"], again["skipped"]) == (first["digest"], 3)
    assert here(*words, "--tasks", 4).code == 1  # they are made where a task is missing


def test_complete_sources_by_tiles_learn_no_pilots_and_a_dry_run_learns_them_once(
    here: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = (*TILES, "--tasks", 2, "--episodes", 40)
    pilots, usual = [], probes._visited
    monkeypatch.setattr(probes, "_visited", lambda of: pilots.append(of) or usual(of))
    probes._placed.cache_clear()
    assert here(*words, "--dry-run").code == 0
    assert len(pilots) == 1
    first = here(*words, "--json").json
    probes._placed.cache_clear()
    pilots.clear()
    assert here(*words, "--json").json["digest"] == first["digest"]
    assert pilots == []
