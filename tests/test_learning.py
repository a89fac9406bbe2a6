from __future__ import annotations

import math
from dataclasses import replace

import pytest

from qinit_cli.learning import Learning

USUAL = Learning(alpha=0.1, gamma=0.95, epsilon=0.1, episodes=10, horizon=20, start="fixed")


@pytest.mark.parametrize(
    "wrong",
    [
        {"alpha": 0.0},
        {"alpha": 1.5},
        {"alpha": math.nan},
        {"gamma": 0.0},
        {"gamma": 1.01},
        {"epsilon": -0.1},
        {"epsilon": 1.1},
        {"episodes": 0},
        {"horizon": 0},
        {"start": "nowhere"},
    ],
)
def test_settings_that_cannot_be_meant_are_refused_by_name(wrong: dict[str, object]) -> None:
    [name] = wrong
    with pytest.raises(ValueError, match=f"^{name} is "):
        replace(USUAL, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("edge", [{"alpha": 1.0}, {"gamma": 1.0}, {"epsilon": 0.0}, {"epsilon": 1.0}])
def test_the_edges_of_the_ranges_are_allowed(edge: dict[str, float]) -> None:
    assert replace(USUAL, **edge) != USUAL  # type: ignore[arg-type]
