"""Runs that met the same targets, side by side: averages, and paired differences to a baseline with their intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, Literal

from qinit_cli.environments import family_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.methods import METHODS
from qinit_cli.runs import Run
from qinit_cli.seeding import Stream, generator
from qinit_cli.stages.source_sets import Entry, Group, grouped

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats

Metric = Literal["return", "success", "steps"]

FIRST_EVALUATIONS = 1  # before anything is learned: a greedy evaluation's jumpstart


@dataclass(frozen=True)
class Estimate:
    """A mean and its 95 % interval; NaN bounds where there is one unit only."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True)
class Row:
    """One method against the baseline."""

    label: str
    remark: str  # what a reader must know of the method
    sets: int  # source sets it was run from
    average: Estimate  # over all episodes
    jumpstart: Estimate  # over the first 10 episodes, or before anything was learned (greedy evaluations)
    asymptotic: Estimate  # over the last tenth
    steps: float  # mean of min(steps, horizon)
    success: float  # share of episodes that reach the goal
    difference: Estimate | None  # of averages, paired on the same targets; None without a baseline
    p: float | None  # of the difference, sign-flip permutation, Holm over the rows
    regret: Estimate | None  # to what is possible, see `attainable`; None where that is not known


@dataclass(frozen=True)
class Comparison:
    """Methods that met the same targets."""

    title: str
    distribution: str  # of the targets, in canonical JSON
    intervals: str  # what they are over, in words
    sets: int
    targets: int
    episodes: int
    rows: tuple[Row, ...]
    baseline: str | None


def compare(runs: Sequence[Run], baseline: str, metric: Metric) -> list[Comparison]:
    """One comparison per group of runs that may be compared, in order of appearance.

    `baseline` is a method's label or an artefact's name; "" for averages alone. One source set: intervals
    over targets. Several: over sets and
    targets, both resampled where the targets are shared, targets within sets where each has its own.
    """
    comparisons = [_comparison(group, baseline, metric) for group in grouped(runs)]
    _check_baseline(comparisons, baseline)
    return comparisons


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


def attainable(group: Group) -> Callable[[Run], Floats] | None:
    """The return that learning can hope for on each target of a run, (T,): what regret is counted from.

    The exact value of epsilon-greedy on Q* (v_eps; of Q* for greedy evaluations) where there are exact tables; else what the
    run of `optimal` on the same targets earns in its last tenth; None without either.
    """
    from qinit_cli.analysis import returns

    if all(run.attainable is not None for entry in group.entries for run in entry.runs):
        return lambda run: (
            run.attainable if run.attainable is not None else returns.average(curve(run, "return"))
        )
    optimal = next((entry for entry in group.entries if entry.method == "optimal"), None)
    if optimal is None or not all(optimal.beside(run) for entry in group.entries for run in entry.runs):
        return None
    return lambda run: returns.asymptotic(curve(optimal.beside(run) or run, "return"))


def remark(method: str) -> str:
    """What a reader of a table must know of the method."""
    kind = METHODS.get(method)
    if kind is None:
        return "not installed here"
    remarks = {"privileged": kind.privileged, "reconstruction": kind.reconstructed}
    return ", ".join(name for name, holds in remarks.items() if holds)


def _comparison(group: Group, baseline: str, metric: Metric) -> Comparison:
    from store.spec import canonical_json

    base = _baseline(group, baseline)
    possible = attainable(group)
    rows = [_row(entry, group, metric, None if entry is base else base, possible) for entry in group.entries]
    targets, episodes = group.any_run.steps.shape
    return Comparison(
        title=_title(group, targets, episodes),
        distribution=canonical_json(group.any_run.spec["family"]),
        intervals=_intervals(group),
        sets=group.sets,
        targets=targets,
        episodes=episodes,
        rows=_holm(rows),
        baseline=None if base is None else base.label,
    )


def _title(group: Group, targets: int, episodes: int) -> str:
    anywhere = ", from anywhere" if group.any_run.spec["learning"].get("start") == "anywhere" else ""
    label, counted = family_of(group.any_run.spec).label, f"{episodes} {group.any_run.unit}{anywhere}"
    if not group.shared:
        return f"{label}, {group.sets} source sets, {targets} targets of each, {counted}"
    sets = "" if group.sets == 1 else f"{group.sets} source sets, "
    return f"{label}, {sets}{targets} targets of seed {group.any_run.spec['seed']}, {counted}"


def _check_baseline(comparisons: list[Comparison], baseline: str) -> None:
    """NotAllowed where one distribution's runs met other targets than its baseline; UsageError for a name nobody has."""
    if not baseline:
        return
    there = [comparison for comparison in comparisons if comparison.baseline is not None]
    for comparison in comparisons:
        same = [other for other in there if other.distribution == comparison.distribution]
        if comparison.baseline is None and same:
            raise NotAllowed(
                f"runs of {comparison.title} did not meet the targets of {baseline}'s run ({same[0].title}), so they cannot be "
                f"compared in pairs; transfer both with the same --seed, --tasks and learning options"
            )
    if not there and baseline not in METHODS:
        known = [*METHODS, *(row.label for comparison in comparisons for row in comparison.rows)]
        near = get_close_matches(baseline, known, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise UsageError(f"--baseline {baseline} is neither a method nor among these runs{hint}")


def _intervals(group: Group) -> str:
    from qinit_cli.analysis.intervals import FEW_SOURCE_SETS

    if group.sets == 1:
        return "95 % bootstrap intervals over targets, conditional on this source set, uncorrected"
    over = (
        "source sets and targets, which the sets share"
        if group.shared
        else "source sets, and targets within them"
    )
    few = (
        f"; under {FEW_SOURCE_SETS} source sets they cover less than 95 %"
        if group.sets < FEW_SOURCE_SETS
        else ""
    )
    single = any(len(entry.runs) == 1 for entry in group.entries)
    once = "; of what was run from one source set alone, over targets" if single else ""
    return f"95 % bootstrap intervals over {over}{once}, uncorrected{few}"


def _baseline(group: Group, baseline: str) -> Entry | None:
    """What the others are set against; None where there is none, NotAllowed where several could be meant."""
    meant = [
        entry
        for entry in group.entries
        if baseline in (entry.label, entry.runs[0].label) or baseline in (run.name for run in entry.runs)
    ]
    if len(meant) > 1:
        names = ", ".join(entry.label for entry in meant)
        raise NotAllowed(f"the baseline {baseline} could be any of {names}; name one of them with --baseline")
    return meant[0] if meant else None


def _row(
    entry: Entry, group: Group, metric: Metric, base: Entry | None, possible: Callable[[Run], Floats] | None
) -> Row:
    import numpy as np

    from qinit_cli.analysis import returns

    curves = [curve(run, metric) for run in entry.runs]
    first = FIRST_EVALUATIONS if group.any_run.unit == "evaluations" else returns.JUMPSTART_EPISODES
    summaries = {
        "average": np.stack([returns.average(values) for values in curves]),
        "jumpstart": np.stack([returns.jumpstart(values, first) for values in curves]),
        "asymptotic": np.stack([returns.asymptotic(values) for values in curves]),
    }
    paired = [base.beside(run) for run in entry.runs] if base is not None else []
    others = [other for other in paired if other is not None]
    if others and len(others) == len(entry.runs):
        against = np.stack([returns.average(curve(other, metric)) for other in others])
        summaries["difference"] = summaries["average"] - against
    if possible is not None:
        earned = np.stack([returns.average(curve(run, "return")) for run in entry.runs])
        summaries["regret"] = np.stack([possible(run) for run in entry.runs]) - earned
    estimates = _estimates(summaries, group)
    return Row(
        label=entry.label,
        remark=remark(entry.method),
        sets=len(entry.runs),
        average=estimates["average"],
        jumpstart=estimates["jumpstart"],
        asymptotic=estimates["asymptotic"],
        steps=float(np.mean([returns.restricted_steps(run.steps, run.horizon).mean() for run in entry.runs])),
        success=float(np.mean([run.reached.mean() for run in entry.runs])),
        difference=estimates.get("difference"),
        p=_p(summaries["difference"], group) if "difference" in summaries else None,
        regret=estimates.get("regret"),
    )


def _estimates(summaries: dict[str, Floats], group: Group) -> dict[str, Estimate]:
    """Mean and interval of each summary (R, T), all resampled alike."""
    import numpy as np

    from qinit_cli.analysis import intervals

    values = np.stack(list(summaries.values()), axis=2)
    chance = _chance(group)
    if len(values) == 1:
        interval = intervals.over_targets(values[0], chance)
    elif group.shared:
        interval = intervals.pigeonhole(values, chance)
    else:
        interval = intervals.nested(values, chance)
    return {
        name: Estimate(float(mean), float(low), float(high))
        for name, mean, low, high in zip(
            summaries, interval.estimate, interval.low, interval.high, strict=True
        )
    }


def _p(differences: Floats, group: Group) -> float:
    """Sign-flip p of differences (R, T): targets flip where there is one source set, else whole sets do."""
    from qinit_cli.analysis.permutation import sign_flip_p

    units = differences.T if len(differences) == 1 else differences.mean(axis=1, keepdims=True)
    return float(sign_flip_p(units, _chance(group))[0])


def _holm(rows: list[Row]) -> tuple[Row, ...]:
    """The rows with their p adjusted for how many there are."""
    import numpy as np

    from qinit_cli.analysis.multiplicity import holm

    adjusted = holm(np.array([np.nan if row.p is None else row.p for row in rows]))
    return tuple(
        row if row.p is None else replace(row, p=float(p)) for row, p in zip(rows, adjusted, strict=True)
    )


def _chance(group: Group) -> np.random.Generator:
    """One stream for every row: the same resamples for each method."""
    return generator(int(group.any_run.spec["seed"]), Stream.BOOTSTRAP, 0)
