"""Learners and explorations as they are typed: what is read is what was meant, or one sentence says why not."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import pytest

from qinit_cli.learners import LEARNERS
from qinit_cli.learners.exploration import EXPLORATIONS, Boltzmann, EpsilonGreedy, Ucb
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learners.traces import QLambda, SarsaLambda
from qinit_cli.spelling import read


@pytest.mark.parametrize(
    ("text", "kinds", "meant"),
    [
        ("sarsa-lambda", LEARNERS, SarsaLambda()),
        ("sarsa-lambda:lambda=0.8,traces=accumulating", LEARNERS, SarsaLambda(0.8, "accumulating")),
        ("q-lambda:lambda=1", LEARNERS, QLambda(lambda_=1.0)),
        ("delayed-q:epsilon1=0.01,m=3", LEARNERS, DelayedQ(3, 0.01)),
        ("r-max:known=4", LEARNERS, RMax(4)),
        ("epsilon-greedy", EXPLORATIONS, EpsilonGreedy()),
        ("boltzmann:temperature=0.5", EXPLORATIONS, Boltzmann(0.5)),
        ("ucb:c=2", EXPLORATIONS, Ucb(2.0)),
    ],
)
def test_a_text_is_what_it_writes_and_is_written_so_again(
    text: str, kinds: Mapping[str, type[Any]], meant: Any
) -> None:
    assert read(text, kinds) == meant
    assert read(str(meant), kinds) == meant


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("sarza", "is 'sarza'; did you mean sarsa?"),
        ("best", "is 'best'; it is one of q-learning, "),
        ("sarsa:lambda=1", "is 'sarsa:lambda=1': sarsa has no options"),
        ("q-lambda:", "is 'q-lambda:': write KEY=VALUE, KEY one of lambda, least, traces"),
        ("q-lambda:lamda=1", "is 'q-lambda:lamda=1': q-lambda has no lamda; did you mean lambda?"),
        ("q-lambda:lambda=2", "is 'q-lambda:lambda=2': lambda is 2.0; it must be from 0 to 1"),
        ("q-lambda:lambda=much", "is 'q-lambda:lambda=much': 'much' is no number"),
        ("q-lambda:lambda=0,lambda=1", "is 'q-lambda:lambda=0,lambda=1': lambda is given twice"),
        ("q-lambda:traces=long", "traces is 'long'; it is one of replacing, accumulating"),
        ("delayed-q:m=2.5", "is 'delayed-q:m=2.5': '2.5' is no whole number"),
    ],
)
def test_a_text_that_writes_nothing_is_refused_by_what_there_is(text: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=re.escape(sentence)):
        read(text, LEARNERS)
