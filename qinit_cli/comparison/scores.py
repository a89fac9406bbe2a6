"""What a run says of each of its targets: the numbers that comparisons average and resample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.comparison.source_sets import Entry, RunGroup
from qinit_cli.errors import NotAllowed
from qinit_cli.methods import METHODS

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers

Metric = Literal["return", "success", "steps"]

FIRST_EVALUATIONS = 1  # before anything is learned: a greedy evaluation's jumpstart
THRESHOLD = 0.5  # of what learning can hope for


@dataclass(frozen=True)
class Scores:
    """One run, target by target."""

    average: Floats  # (T,) of the metric, over all episodes
    jumpstart: Floats  # (T,) of the metric, over the first episodes
    asymptotic: Floats  # (T,) of the metric, over the last tenth
    steps: Floats  # (T,) mean of min(steps, horizon)
    success: Floats  # (T,) share of episodes that reach the goal
    regret: Floats | None  # (T,) what learning can hope for, less the average return
    arrival: Arrival | None


@dataclass(frozen=True)
class Arrival:
    """When the return comes to half of what learning can hope for, counted from the least return."""

    times: Integers  # (T,) the episode that ends the first window that is good enough; the last where none is
    reached: Flags  # (T,) whether one is


def scores(run: ComparedRun, metric: Metric, possible: Floats | None) -> Scores:
    """The scores of a run; without regret and arrival where it is not known what is `possible`, (T,)."""
    from qinit_cli.analysis import returns

    earned = curve(run, "return")
    values = earned if metric == "return" else curve(run, metric)
    if np.isnan(values).any():
        raise NotAllowed(
            f"{metric} of {run.name} is unknown: it was imported without; compare by --metric return"
        )
    greedy = run.unit == "evaluations"
    first = FIRST_EVALUATIONS if greedy else returns.JUMPSTART_EPISODES
    return Scores(
        average=returns.average(values),
        jumpstart=returns.jumpstart(values, first),
        asymptotic=returns.asymptotic(values),
        steps=returns.average(curve(run, "steps")),
        success=returns.average(curve(run, "success")),
        regret=None if possible is None else possible - returns.average(earned),
        # evaluations stand far apart: no window of them is a stretch of learning
        arrival=None
        if possible is None or greedy
        else _arrival(run.bounds.shares(earned), run.bounds.shares(possible)),
    )


def curve(run: ComparedRun, metric: Metric) -> Floats:
    """What the metric says of every episode, (T, E)."""
    from qinit_cli.analysis import returns

    match metric:
        case "return":
            return run.returns()
        case "success":
            return run.reached.astype(float)
        case "steps":
            return returns.restricted_steps(run.steps, run.horizon)


def attainable(group: RunGroup) -> Callable[[ComparedRun], Floats] | None:
    """The return that learning can hope for on each target of a run, (T,): what regret is counted from.

    The exact value of epsilon-greedy on Q* (v_eps; of Q* for greedy evaluations) where there are exact tables; else what the
    run of a method that attains it, as `optimal` does without a blend, earns on the same targets in its last tenth; None without
    either.
    """
    from qinit_cli.analysis import returns

    exact = {run.name: run.attainable for entry in group.entries for run in entry.runs}
    known = {name: values for name, values in exact.items() if values is not None}
    if len(known) == len(exact):
        return lambda run: known[run.name]
    best = next((entry for entry in group.entries if _attains(entry)), None)
    if best is None or not all(best.beside(run) for entry in group.entries for run in entry.runs):
        return None
    last = {own.name: returns.asymptotic(curve(own, "return")) for own in best.runs}
    return lambda run: last[(best.beside(run) or run).name]


def _attains(entry: Entry) -> bool:
    kind = METHODS.get(entry.method)
    return kind is not None and kind.attains and not entry.blended  # a blend gives the start away


def _arrival(earned: Floats, possible: Floats) -> Arrival:
    """When shares (T, E) come to half of those that are possible, (T,)."""
    from qinit_cli.analysis.survival import time_to_threshold

    # half of nothing would be reached at once: who can hope for nothing never arrives
    return Arrival(*time_to_threshold(earned, np.where(possible > 0, THRESHOLD * possible, np.inf)))
