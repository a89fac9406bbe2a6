"""Learners and explorations as settings: what they are written as, and what they refuse."""

from __future__ import annotations

from typing import Any

import pytest

from qinit_cli.learners import LEARNERS
from qinit_cli.learners.exploration import EXPLORATIONS, Boltzmann, EpsilonGreedy, Ucb
from qinit_cli.learners.one_step import QLearner
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learners.traces import QLambda, SarsaLambda


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        (QLambda(0.5, "accumulating", 0.125), "q-lambda:lambda=0.5,traces=accumulating,least=0.125"),
        (SarsaLambda(traces="accumulating"), "sarsa-lambda:traces=accumulating"),
        (SarsaLambda(lambda_=0), "sarsa-lambda:lambda=0.0"),
        (DelayedQ(m=7), "delayed-q:m=7"),
        (RMax(tolerance=0.5), "r-max:tolerance=0.5"),
        (RMax(known=10), "r-max"),  # the usual number
        (QLearner(), "q-learning"),
        (Boltzmann(0.2), "boltzmann:temperature=0.2"),
        (Ucb(0.1), "ucb"),
        (EpsilonGreedy(), "epsilon-greedy"),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_what_is_not_usual_stands_after_the_name(setting: Any, text: str) -> None:
    assert str(setting) == text


def test_without_options_a_learner_is_its_name() -> None:
    assert [str(LEARNERS[name]()) for name in LEARNERS] == list(LEARNERS)
    assert [str(kind()) for kind in EXPLORATIONS.values()] == list(EXPLORATIONS)


@pytest.mark.parametrize(
    ("kind", "wrong", "message"),
    [
        (QLambda, {"lambda_": 1.1}, "--lambda is 1.1"),
        (QLambda, {"lambda_": -0.1}, "--lambda is -0.1"),
        (SarsaLambda, {"traces": "dutch"}, "--traces is 'dutch'"),
        (SarsaLambda, {"least": 0.0}, "--least is 0.0; it must be above 0"),
        (DelayedQ, {"m": 0}, "--m is 0; it must be from 1 to 1000000"),
        (DelayedQ, {"m": 10**20}, "--m is 100000000000000000000"),
        (DelayedQ, {"epsilon1": -0.1}, "--epsilon1 is -0.1"),
        (RMax, {"known": 0}, "--known is 0"),
        (RMax, {"known": 1.5}, "--known is 1.5"),
        (RMax, {"tolerance": -1.0}, "--tolerance is -1.0"),
        (Boltzmann, {"temperature": 0.0}, "--temperature is 0.0; it must be above 0"),
        (Ucb, {"c": -0.1}, "--c is -0.1; it must be at least 0"),
    ],
)
def test_options_out_of_their_range_are_refused_by_name(
    kind: type[Any], wrong: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        kind(**wrong)
