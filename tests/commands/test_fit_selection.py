"""What `qinit fit` says of sources that have no path to the goal."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest

Run = Callable[..., Any]
LAKE = ("gym", "FrozenLake-v1", "--vary", "success_rate=uniform:0.34,0.8", "--horizon", 30, "--tasks", 8)
LEARNED = "could be solved but were not learned"
EXACT = "have a best policy that reaches the goal within 30 steps less than every other time"


def _fails(sources: Path) -> int:
    with h5py.File(sources) as file:
        return int((file["solved"][...] == 0).sum())


@pytest.mark.parametrize(
    ("learner", "said", "not_said"),
    [(("--learner", "exact"), EXACT, LEARNED), (("--episodes", 5), LEARNED, EXACT)],
    ids=["exact", "learned"],
)
def test_exact_tables_that_seldom_arrive_are_not_said_to_be_unlearned(
    here: Run, learner: tuple[object, ...], said: str, not_said: str
) -> None:
    sources = here("train-sources", *LAKE, *learner, "-q").path
    failing = _fails(sources)
    assert failing > 0
    fitted = here("fit", sources)
    assert f"; {failing} {said}\n" in fitted.err
    assert not_said not in fitted.err


def test_a_fit_without_them_says_so_too_where_too_few_are_left(here: Run) -> None:
    sources = here("train-sources", *LAKE, "--learner", "exact", "-q").path
    held = 8 - _fails(sources)
    refused = here("fit", sources, "--exclude-unlearned", "--holdout", held)
    assert refused.code == 4
    assert f"{8 - held} {EXACT})" in refused.err
