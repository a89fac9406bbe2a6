"""Warnings about settings that leave nothing to learn, though the command succeeds and its artefact looks like a result.

With a discount of 1 all values are alike; with a horizon of one step, or too few episodes, no goal is met.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from qinit_cli.fitted import in_shares
from qinit_cli.learners.exploration import EpsilonGreedy
from qinit_cli.learning import Learning
from qinit_cli.rewards import UNIT, ReturnBounds
from qinit_cli.schedules import Schedule
from qinit_store.wording import counted, magnitude

ALIKE = 1e-3  # relative: values that differ by less tell no state from another
SAME = 1e-9  # relative: values that differ by less differ by rounding
UNMOVED = 0.01  # share of the way to its target that a value at most goes, below which nothing is learned
FAR = 0.5  # median relative error from which sources are far from learned


@dataclass(frozen=True)
class SourcesLearned:
    """What became of source tasks."""

    tasks: int
    positive: int  # tasks that have a value above 0
    solvable: int
    solved: int
    least: float  # of the values above 0 of all of them; NaN where there are none
    largest: float
    steps: float  # of a task, in the mean; 0 where none was learned by steps
    anywhere: bool = True  # whether their episodes may start anywhere
    error: float = math.nan  # median relative error against exact tables; NaN where it is not known


def of_sources(learner: str, learning: Learning, found: SourcesLearned) -> Iterator[str]:
    """Why these sources teach nothing, or little."""
    exact = learner == "exact"
    if not found.tasks:
        return
    if not found.positive:
        yield f"{_nothing_met(exact, learning, found.anywhere)}: all values are 0, and there is nothing to transfer"
        return
    if found.positive < found.tasks:
        lost = found.tasks - found.positive
        yield f"{lost} of {counted(found.tasks, 'source')} never met the goal: all their values are 0"
    yield from _of_values(learning.gamma, found.least, found.largest)
    if not found.solvable:
        yield (
            f"no task can be solved from its target start within --horizon {learning.horizon}: qinit fit leaves such "
            "sources out"
        )
    elif not found.solved:
        yield "no source is solved: its greedy policy does not reach the goal from the target start within the horizon"
    if exact:
        return
    unmoved = list(_of_step_size(learning, found.steps))
    yield from unmoved
    if learning.epsilon == 0 and learning.learner.explores and isinstance(learning.explore, EpsilonGreedy):
        yield "with --epsilon 0 a source explores only until it first knows a way, and other states stay unknown"
    if found.error >= FAR and not unmoved:
        yield f"the sources are far from learned, by {found.error:.0%} in the median; ask for more --episodes"


def of_fit(gamma: float, arrays: Mapping[str, Any], bounds: ReturnBounds = UNIT) -> Iterator[str]:
    """Why a fit with these arrays tells nothing, of sources with this discount and returns within these bounds."""
    arrays = in_shares(arrays, bounds)
    known = np.asarray(arrays["n"]) > 0
    if not known.any():
        yield "no source has a value above 0 anywhere: there is nothing to transfer"
        return
    least, largest = float(arrays["min"][known].min()), float(arrays["max"][known].max())
    yield from _of_values(gamma, least, largest)
    several = np.asarray(arrays["n"]) > 1
    highest = arrays["max"][several]
    if not several.any():
        yield "no state-action has a value above 0 in two sources: there is no spread to fit"
    elif (highest - arrays["min"][several] <= SAME * highest).all():
        yield "all sources have the same values: there is no distribution to transfer from"


@dataclass(frozen=True)
class TargetsLearned:
    """What became of target tasks."""

    tasks: int
    reached: int  # episodes that reached the goal, of all targets
    unsolvable: int
    steps: float  # of a task, in the mean; 0 where none was learned
    knows: bool  # whether any source has a value above 0
    least_return: float | None = 0.0  # of an episode without the goal; None where that depends on the episode


def of_targets(learning: Learning, found: TargetsLearned) -> Iterator[str]:
    """Why this run tells no method from another."""
    if not found.knows:
        yield "no source of this fit has a value above 0: there is nothing to transfer"
    if found.tasks and not found.reached and found.least_return is not None:
        cannot = (
            f", as none can within --horizon {learning.horizon}" if found.unsolvable == found.tasks else ""
        )
        yield (
            f"no target reached the goal in any episode{cannot}: all returns are {found.least_return:g}, and no method can be "
            "told from another; ask for a longer --horizon or more --episodes"
        )
    if learning.gamma == 1:
        yield "with --gamma 1 a return is 1 in however many steps the goal is reached: it is the share of success"
    if learning.epsilon == 1:
        yield "with --epsilon 1 every step explores, so what a table knows changes no return"
    yield from _of_step_size(learning, found.steps)


def _nothing_met(exact: bool, learning: Learning, anywhere: bool) -> str:
    if exact:
        return "no way leads to the goal in any task"
    more = "more --episodes or a longer --horizon"
    if learning.start == "fixed" and anywhere:
        more = "more --episodes, a longer --horizon, or --start anywhere"
    return f"no source met the goal in {counted(learning.episodes, 'episode')} of --horizon {learning.horizon} (ask for {more})"


def _of_values(gamma: float, least: float, largest: float) -> Iterator[str]:
    if largest - least <= ALIKE * largest:
        why = "with --gamma 1 nothing is discounted, and " if gamma == 1 else ""
        yield f"{why}all values above 0 are {largest:.3g}: they tell no state or action from another"
    elif gamma == 1:
        yield "with --gamma 1 a value is the probability of reaching the goal at all, in however many steps"


def _of_step_size(learning: Learning, steps: float) -> Iterator[str]:
    learner = learning.learner
    if isinstance(learning.alpha, Schedule) or not (learner.steps and learner.counts):
        return
    moved = -math.expm1(steps * math.log1p(-learning.alpha)) if learning.alpha < 1 else 1.0
    if steps and moved < UNMOVED:
        yield (
            f"with --alpha {learning.alpha:g} the {magnitude(steps)} steps of a task move a value by no more than {moved:.2g} of "
            "the way to its target"
        )
    if learning.alpha == 1 and learner.weighs:
        yield "with --alpha 1 a value is its last sample: where steps are a matter of chance it never settles"
