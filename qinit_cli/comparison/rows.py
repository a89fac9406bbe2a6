"""Runs that met the same targets, side by side: averages, and paired differences to a baseline with their intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.analysis import resampling
from qinit_cli.analysis.intervals import Estimate, Resampling
from qinit_cli.analysis.permutation import LEVEL, adjusted, can_be_small, fewest_units
from qinit_cli.comparison.distinctions import OF_SOURCES, Words, joined, separator, with_words
from qinit_cli.comparison.estimates import Estimates, estimates
from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.comparison.scores import Metric, Scores, attainable, scores
from qinit_cli.comparison.source_sets import Entry, RunGroup, grouped, told_of_groups
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learning import IMPORTED
from qinit_cli.methods import METHODS
from qinit_store.wording import noun

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers


class SeveralBaselines(NotAllowed):
    """A baseline's name that several rows of one table have."""


@dataclass(frozen=True)
class Row(Estimates):
    """One method against the baseline; its p adjusted by Holm over the rows, None where it could not come to LEVEL."""

    label: str
    method: str  # its name
    plus: bool  # whether it starts from another
    remark: str  # what a reader must know of the method
    sets: int  # source sets it was run from
    negative_transfer: (
        bool | None
    )  # worse than learning from zero, beyond its interval; None where that is not set against


@dataclass(frozen=True)
class GroupComparison:
    """Methods that met the same targets."""

    title: str
    distribution: str  # of the targets, in canonical JSON
    intervals: str  # what they are over, in words
    sets: int
    targets: int
    episodes: int
    rows: tuple[Row, ...]
    baseline: str | None
    untested: str  # why a row with a difference has no p, in words; empty where all have one


def compare(runs: Sequence[ComparedRun], baseline: str, metric: Metric) -> list[GroupComparison]:
    """One comparison per group of runs that may be compared, in order of appearance.

    `baseline` is a method's label or an artefact's name; "" for averages alone. One source set: intervals over targets.
    Several: over sets and targets, both resampled where the targets are shared, targets within sets where each has its own.
    """
    groups = grouped(runs)
    comparisons = [
        _comparison(group, title, baseline, metric)
        for group, title in zip(groups, _titles(groups), strict=True)
    ]
    _check_baseline(comparisons, baseline)
    return comparisons


def remark(method: str, *, imported: bool = False, blended: bool = False) -> str:
    """What a reader of a table must know of the method, of its curves that were `imported`, or of its start that is `blended`."""
    if imported:
        return IMPORTED
    kind = METHODS.get(method)
    if kind is None:
        return "not installed here"
    remarks = {"privileged": kind.privileged, "reconstruction": kind.reconstructed or blended}
    return ", ".join(name for name, holds in remarks.items() if holds)


def _comparison(group: RunGroup, title: str, baseline: str, metric: Metric) -> GroupComparison:
    from qinit_store.spec import canonical_json

    base = _baseline(group, baseline)
    possible = attainable(group)
    scored = {
        run.name: scores(run, metric, None if possible is None else possible(run))
        for entry in group.entries
        for run in entry.runs
    }
    rows = [_row(entry, None if entry is base else base, metric, scored, group) for entry in group.entries]
    targets, episodes = group.any_run.steps.shape
    return GroupComparison(
        title=title,
        distribution=canonical_json(group.any_run.settings.family.spec()),
        intervals=_intervals(group),
        sets=group.sets,
        targets=targets,
        episodes=episodes,
        rows=_holm(rows, targets),
        baseline=None if base is None else base.label,
        untested=_untested(rows, targets),
    )


def _titles(groups: Sequence[RunGroup]) -> list[str]:
    """The title of each comparison, no two alike: with the targets' digest where no setting differs."""
    titles = [_title(group, words) for group, words in zip(groups, told_of_groups(groups), strict=True)]
    return [
        with_words(title, f"targets {group.any_run.target_digest[:8]}") if titles.count(title) > 1 else title
        for group, title in zip(groups, titles, strict=True)
    ]


def _title(group: RunGroup, words: Words) -> str:
    """The distribution, `words` but for what is told of the targets, and the targets."""
    targets, episodes = group.any_run.steps.shape
    anywhere = ", from anywhere" if group.any_run.settings.learning.start == "anywhere" else ""
    counted = f"{episodes} {noun(episodes, group.any_run.unit.removesuffix('s'))}{anywhere}"
    said = {"seed", "tasks", "learning start"} | (
        {"learning episodes"} if group.any_run.unit == "episodes" else set()
    )
    others = {
        key: word
        for key, word in words.items()
        if key.startswith(OF_SOURCES) or key.partition(" ")[2] not in said
    }
    label = with_words(group.label, joined(others))
    told = f"{targets} {noun(targets, 'target')}"
    if not group.shared:
        return f"{label}, {group.sets} source sets, {told} of each, {counted}"
    sets = "" if group.sets == 1 else f"{group.sets} source sets, "
    return f"{label}, {sets}{told} of seed {group.any_run.settings.seed}, {counted}"


def _check_baseline(comparisons: list[GroupComparison], baseline: str) -> None:
    """NotAllowed where one distribution's runs met other targets than its baseline; UsageError for a name nobody has."""
    if not baseline:
        return
    there = [comparison for comparison in comparisons if comparison.baseline is not None]
    for comparison in comparisons:
        same = [other for other in there if other.distribution == comparison.distribution]
        if comparison.baseline is None and same:
            raise NotAllowed(
                f"runs of {comparison.title} did not meet the targets of {baseline}'s run ({same[0].title}), so they cannot be "
                f"compared in pairs; {_same(comparison)}"
            )
    if not there and baseline not in METHODS:
        known = [*METHODS, *(row.label for comparison in comparisons for row in comparison.rows)]
        near = get_close_matches(baseline, known, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise UsageError(f"--baseline {baseline} is neither a method nor among these runs{hint}")


def _same(comparison: GroupComparison) -> str:
    """What to do so that runs meet the same targets."""
    if comparison.rows[0].remark == IMPORTED:
        return "import both with the same --horizon, --gamma and --name, and with as many tasks and episodes"
    return "transfer both with the same --seed, --tasks and learning options"


def _intervals(group: RunGroup) -> str:
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
    folds = "; folds have sources in common, which these do not allow for" if group.of_folds else ""
    return f"95 % bootstrap intervals over {over}{once}, uncorrected{few}{folds}"


def _baseline(group: RunGroup, baseline: str) -> Entry | None:
    """What the others are set against; None where there is none, NotAllowed where several could be meant."""
    meant = [
        entry
        for entry in group.entries
        if baseline in (entry.label, entry.runs[0].label) or baseline in (run.name for run in entry.runs)
    ]
    if len(meant) > 1:
        labels = [entry.label for entry in meant]
        names = separator(labels).join(labels)
        raise SeveralBaselines(
            f"the baseline {baseline} could be any of {names}; name one of them with --baseline"
        )
    return meant[0] if meant else None


def _row(entry: Entry, base: Entry | None, metric: Metric, scored: dict[str, Scores], group: RunGroup) -> Row:
    paired = [base.beside(run) for run in entry.runs] if base is not None else []
    others = [other for other in paired if other is not None]
    whole = bool(others) and len(others) == len(entry.runs)
    found = estimates(
        [scored[run.name] for run in entry.runs],
        [scored[other.name] for other in others] if whole else None,
        metric,
        Resampling(group.shared),
        group.any_run.settings.seed,
    )
    return Row(
        **vars(found),
        label=entry.label,
        method=entry.method,
        plus=entry.plus,
        remark=remark(entry.method, imported=entry.runs[0].settings.imported, blended=entry.blended),
        sets=len(entry.runs),
        negative_transfer=None
        if base is None or _transfers(base.method)
        else _worse(found.difference, metric),
    )


def _transfers(method: str) -> bool:
    """Whether the method takes anything over; so it is of one that is not installed."""
    kind = METHODS.get(method)
    return kind is None or kind.transfers


def _worse(difference: Estimate | None, metric: Metric) -> bool | None:
    """Whether the whole interval of a difference lies on the worse side of 0; None without an interval."""
    if difference is None or math.isnan(difference.low):
        return None
    return difference.low > 0 if metric == "steps" else difference.high < 0


def _holm(rows: list[Row], targets: int) -> tuple[Row, ...]:
    """The rows with their p adjusted for how many there are; None where it could not come to LEVEL whatever the differences."""
    tested = [row for row in rows if row.p is not None]
    found = adjusted(np.array([row.p for row in tested], np.float64), _units(tested, targets))
    told = iter([None if math.isnan(p) else p for p in found.tolist()])
    return tuple(row if row.p is None else replace(row, p=next(told)) for row in rows)


def _untested(rows: list[Row], targets: int) -> str:
    """Why some rows have no p: how many units the sign-flip test would need."""
    tested = [row for row in rows if row.p is not None]
    short = [row for row, can in zip(tested, can_be_small(_units(tested, targets)), strict=True) if not can]
    if not short:
        return ""
    of = "targets" if all(row.sets == 1 for row in short) else "source sets"
    there = f"{len(tested)} method{'s' if tested[1:] else ''}"
    fewest = fewest_units(len(tested))
    if not fewest:
        return f"p: over {there} no number of {of} lets the sign-flip test reach {LEVEL:g}"
    return f"p: at least {fewest} {of} are needed for the sign-flip test over {there} to reach {LEVEL:g}"


def _units(rows: list[Row], targets: int) -> Integers:
    """What the test of each row flips the signs of, (M,): the targets of one source set, else whole sets."""
    return np.array([resampling.units(row.sets, targets) for row in rows], np.int64)
