"""Runs that met the same targets, side by side: averages, and paired differences to a baseline with their intervals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from qinit_cli.errors import NotAllowed
from qinit_cli.methods import METHODS
from qinit_cli.runs import Run
from qinit_cli.seeding import Stream, generator
from qinit_cli.specs import family_of

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats

Metric = Literal["return", "success", "steps"]


@dataclass(frozen=True)
class Estimate:
    """A mean over targets and its 95 % interval; NaN bounds where there is one target."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class Row:
    """One run against the baseline."""

    label: str
    remark: str  # what a reader must know of the method
    average: Estimate  # over all episodes
    jumpstart: Estimate  # over the first 10 episodes
    asymptotic: Estimate  # over the last tenth
    steps: float  # mean of min(steps, horizon)
    success: float  # share of episodes that reach the goal
    difference: Estimate | None  # of averages, paired on the same targets; None without a baseline
    regret: Estimate | None  # to what is possible, see `attainable`; None where that is not known


@dataclass(frozen=True)
class Comparison:
    """Runs that met the same targets."""

    title: str
    targets: int
    episodes: int
    rows: tuple[Row, ...]
    baseline: str | None


def compare(runs: Sequence[Run], baseline: str, metric: Metric) -> list[Comparison]:
    """One comparison per set of shared targets, in order of appearance; `baseline` is a method or an artefact's name."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        met = groups.setdefault(run.target_digest, [])
        if run.name not in {other.name for other in met}:
            met.append(run)
    return [_comparison(group, baseline, metric) for group in groups.values()]


def curve(run: Run, metric: Metric) -> Floats:
    """What the metric says of every episode, (T, E)."""
    from qinit_cli.analysis import returns

    match metric:
        case "return":
            return returns.discounted_returns(run.steps, run.reached, run.gamma)
        case "success":
            return run.reached.astype(float)
        case "steps":
            return returns.restricted_steps(run.steps, run.horizon)


def labels(runs: Sequence[Run]) -> list[str]:
    """Each run's method; where one stands there twice, with the end of the artefact's name."""
    count = Counter(run.label for run in runs)
    return [run.label if count[run.label] == 1 else f"{run.label} {run.name[-8:]}" for run in runs]


def _comparison(runs: list[Run], baseline: str, metric: Metric) -> Comparison:
    base = _baseline(runs, baseline)
    against = None if base is None else curve(base, metric)
    possible = attainable(runs)
    rows = tuple(
        _row(run, label, metric, None if run is base else against, possible)
        for run, label in zip(runs, labels(runs), strict=True)
    )
    seed = runs[0].spec["seed"]
    targets, episodes = runs[0].steps.shape
    title = f"{family_of(runs[0].spec).label}, {targets} targets of seed {seed}, {episodes} episodes"
    return Comparison(
        title, targets, episodes, rows, None if base is None else labels(runs)[runs.index(base)]
    )


def _baseline(runs: list[Run], baseline: str) -> Run | None:
    """The run that the others are set against; None where there is none, NotAllowed where several could be meant."""
    meant = [run for run in runs if baseline in (run.label, run.name)]
    if len(meant) > 1:
        names = ", ".join(run.name for run in meant)
        raise NotAllowed(f"the baseline {baseline} could be any of {names}; name one of them with --baseline")
    return meant[0] if meant else None


def attainable(runs: Sequence[Run]) -> Floats | None:
    """The return that learning can hope for on each target, (T,): what regret is counted from.

    The exact value of epsilon-greedy on Q* (v_eps) where there are exact tables; else what the run of `optimal` earns in its
    last tenth; None without either.
    """
    from qinit_cli.analysis import returns

    for run in runs:
        if run.v_eps is not None:
            return run.v_eps
    for run in runs:
        if run.method == "optimal":
            return returns.asymptotic(curve(run, "return"))
    return None


def remark(method: str) -> str:
    """What a reader of a table must know of the method."""
    kind = METHODS.get(method)
    if kind is None:
        return "not installed here"
    remarks = {"privileged": kind.privileged, "reconstruction": kind.reconstructed}
    return ", ".join(name for name, holds in remarks.items() if holds)


def _row(run: Run, label: str, metric: Metric, against: Floats | None, possible: Floats | None) -> Row:
    import numpy as np

    from qinit_cli.analysis import intervals, returns

    values = curve(run, metric)
    summaries = {
        "average": returns.average(values),
        "jumpstart": returns.jumpstart(values),
        "asymptotic": returns.asymptotic(values),
    }
    if against is not None:
        summaries["difference"] = summaries["average"] - returns.average(against)
    if possible is not None:
        summaries["regret"] = possible - returns.average(curve(run, "return"))
    # one stream for every row: the same resamples of targets for each method
    chance = generator(int(run.spec["seed"]), Stream.BOOTSTRAP, 0)
    interval = intervals.over_targets(np.stack(list(summaries.values()), axis=1), chance)
    estimates = {
        name: Estimate(float(mean), float(low), float(high))
        for name, mean, low, high in zip(
            summaries, interval.estimate, interval.low, interval.high, strict=True
        )
    }
    return Row(
        label=label,
        remark=remark(run.method),
        average=estimates["average"],
        jumpstart=estimates["jumpstart"],
        asymptotic=estimates["asymptotic"],
        steps=float(returns.restricted_steps(run.steps, run.horizon).mean()),
        success=float(run.reached.mean()),
        difference=estimates.get("difference"),
        regret=estimates.get("regret"),
    )
