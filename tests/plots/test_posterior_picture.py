"""Weights of the sources while targets are learned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import pytest

from qinit_cli.plots.posterior import NUMBER_LABEL, SHARE_LABEL, Weighed, _alt

Draw = Callable[..., Any]


def test_lines_are_the_medians_of_kishs_number_and_of_the_heaviest_weight(drawn: Draw, pipeline: Any) -> None:
    figure = drawn("posterior", pipeline.runs["posterior"])
    with h5py.File(pipeline.runs["posterior"]) as file:
        weight, moment = file["weight"][...].astype(float), file["moment"][...]
    number, share = figure.axes
    assert (number.get_ylabel(), share.get_ylabel()) == (NUMBER_LABEL, SHARE_LABEL)
    for axes, expected in ((number, 1 / (weight**2).sum(axis=2)), (share, weight.max(axis=2))):
        [line] = axes.lines
        np.testing.assert_array_equal(line.get_xdata(), moment)
        np.testing.assert_allclose(line.get_ydata(), np.median(expected, axis=0), rtol=1e-6)


def test_runs_of_one_method_are_pooled_and_others_have_lines_of_their_own(
    drawn: Draw, here: Draw, pipeline: Any
) -> None:
    options = ("--tasks", 4, "--episodes", 30, "-q")
    some = [here("transfer", "posterior", pipeline.fit, "--seed", seed, *options).path for seed in (1, 2)]
    strong = here("transfer", "posterior", pipeline.fit, "--temperature", 1, *options).path
    figure = drawn("posterior", *some, strong, "--width", "column", "--title", "")
    assert [text.get_text() for text in figure.legends[0].texts] == [
        "posterior, gridworld-6-variance-2",
        "posterior temperature=1.0, gridworld-6-variance-2",
    ]
    both = []
    for path in some:
        with h5py.File(path) as file:
            both.append(file["weight"][...].astype(float).max(axis=2))
    expected = np.median(np.concatenate(both), axis=0)
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), expected, rtol=1e-6)


def test_runs_of_another_discount_are_not_pooled(drawn: Draw, here: Draw, pipeline: Any) -> None:
    other = here(
        "transfer", "posterior", pipeline.fit, "--gamma", 0.9, "--tasks", 4, "--episodes", 60, "-q"
    ).path
    figure = drawn("posterior", pipeline.runs["posterior"], other)
    assert [text.get_text() for text in figure.legends[0].texts] == [
        "posterior, gridworld-6-variance-2, gamma 0.95",
        "posterior, gridworld-6-variance-2, gamma 0.9",
    ]


@pytest.mark.parametrize("method", ["zero", "ops-tl"])
def test_runs_that_weigh_nothing_are_refused_by_name(refused: Draw, pipeline: Any, method: str) -> None:
    ended, sentence = refused("posterior", pipeline.runs[method])
    assert f"it is a run of {method}, not of posterior" in sentence
    assert ended == 4


def test_the_alternative_text_counts_the_targets_of_all_runs_and_those_that_never_froze() -> None:
    moments = np.array([0, 30])
    shown = Weighed("posterior", moments, np.array([[4, 1.0]] * 3), np.array([[0.25, 0.9]] * 3))
    runs = [(moments, np.ones((3, 2, 4)), 1), (moments, np.ones((2, 2, 4)), 0)]
    assert "(medians of 5 targets, 1 of which never froze)" in _alt([shown], {"posterior": runs})
