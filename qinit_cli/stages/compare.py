"""Runs that met the same targets, side by side: averages, and paired differences to a baseline with their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches

from qinit_cli.environments import label_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.methods import METHODS
from qinit_cli.runs import Run
from qinit_cli.stages.estimates import Chance, Estimate, Estimates, estimates
from qinit_cli.stages.scores import Metric, Scores, attainable, scores
from qinit_cli.stages.source_sets import Entry, Group, grouped


@dataclass(frozen=True)
class Row(Estimates):
    """One method against the baseline; its p adjusted by Holm over the rows."""

    label: str
    remark: str  # what a reader must know of the method
    sets: int  # source sets it was run from
    negative_transfer: (
        bool | None
    )  # worse than learning from zero, beyond its interval; None where that is not set against


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

    `baseline` is a method's label or an artefact's name; "" for averages alone. One source set: intervals over targets.
    Several: over sets and targets, both resampled where the targets are shared, targets within sets where each has its own.
    """
    comparisons = [_comparison(group, baseline, metric) for group in grouped(runs)]
    _check_baseline(comparisons, baseline)
    return comparisons


def remark(method: str) -> str:
    """What a reader of a table must know of the method."""
    kind = METHODS.get(method)
    if kind is None:
        return "not installed here"
    remarks = {"privileged": kind.privileged, "reconstruction": kind.reconstructed}
    return ", ".join(name for name, holds in remarks.items() if holds)


def _comparison(group: Group, baseline: str, metric: Metric) -> Comparison:
    from qinit_store.spec import canonical_json

    base = _baseline(group, baseline)
    possible = attainable(group)
    scored = {
        run.name: scores(run, metric, None if possible is None else possible(run))
        for entry in group.entries
        for run in entry.runs
    }
    chance = Chance(group.shared, int(group.any_run.spec["seed"]))
    rows = [_row(entry, None if entry is base else base, metric, scored, chance) for entry in group.entries]
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
    label, counted = label_of(group.any_run.spec), f"{episodes} {group.any_run.unit}{anywhere}"
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


def _row(entry: Entry, base: Entry | None, metric: Metric, scored: dict[str, Scores], chance: Chance) -> Row:
    paired = [base.beside(run) for run in entry.runs] if base is not None else []
    others = [other for other in paired if other is not None]
    whole = bool(others) and len(others) == len(entry.runs)
    found = estimates(
        [scored[run.name] for run in entry.runs],
        [scored[other.name] for other in others] if whole else None,
        metric,
        chance,
    )
    return Row(
        **vars(found),
        label=entry.label,
        remark=remark(entry.method),
        sets=len(entry.runs),
        negative_transfer=_worse(found.difference, metric)
        if base is not None and base.method == "zero"
        else None,
    )


def _worse(difference: Estimate | None, metric: Metric) -> bool | None:
    """Whether the whole interval of a difference lies on the worse side of 0; None without an interval."""
    if difference is None or math.isnan(difference.low):
        return None
    return difference.low > 0 if metric == "steps" else difference.high < 0


def _holm(rows: list[Row]) -> tuple[Row, ...]:
    """The rows with their p adjusted for how many there are."""
    import numpy as np

    from qinit_cli.analysis.multiplicity import holm

    adjusted = holm(np.array([np.nan if row.p is None else row.p for row in rows]))
    return tuple(
        row if row.p is None else replace(row, p=float(p)) for row, p in zip(rows, adjusted, strict=True)
    )
