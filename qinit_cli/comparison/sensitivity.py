"""How the average over all episodes changes with a setting, what decides it, and how methods rank over distributions.

A description, not a paired test: runs that differ in the variance met other targets. Where a setting means nothing to a method,
as the number of sources to one that reads none, its runs count at every value of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.analysis.intervals import FEW_SOURCE_SETS, Estimate, Resampling
from qinit_cli.analysis.variance_shares import MOST_FACTORS, variance_shares
from qinit_cli.comparison.scores import Metric, curve
from qinit_cli.comparison.setting_text import setting_text
from qinit_cli.comparison.varied import DISTRIBUTION, METHOD, Value, VariedRuns, VariedSetting, Where
from qinit_cli.errors import NotAllowed
from qinit_cli.seeding import Stream, generator
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.analysis.ranks import RankComparison
    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.comparison.runs import ComparedRun

SCHEMA = "qinit.sensitivity/1"
SHARES = ("setting", "values", "share")  # what a row of shares has
SHARE_DIGITS = 9
INTERACTIONS, RESIDUAL = "interactions", "source sets and targets"


@dataclass(frozen=True)
class SensitivityPoint:
    """A method at one value of a setting, with the others as `where` says."""

    method: str  # as its line is labelled
    value: Value
    where: Where
    average: Estimate
    sets: int
    targets: int  # of each set, of the one with the fewest


@dataclass(frozen=True)
class VarianceShare:
    """What one setting, their combinations or the draws have of the variance of the runs' averages."""

    setting: str
    values: int  # how many it takes; 0 of what is no setting
    share: float


class Averages:
    """The averages of runs, and of all that are set alike."""

    def __init__(self, varied: VariedRuns, metric: Metric) -> None:
        self.varied, self.metric = varied, metric
        self._of_run = {run.name: _average(run, metric) for run in varied.runs}

    def mean(self, run: ComparedRun) -> float:
        """Of all targets of a run."""
        return float(self._of_run[run.name].mean())

    def at(self, where: Where) -> list[ComparedRun]:
        """The runs with these settings, or to which those that they lack mean nothing."""
        return [
            run
            for run, known in zip(self.varied.runs, self.varied.known, strict=True)
            if all(known.get(name, value) == value for name, value in where)
        ]

    def estimate(self, runs: Sequence[ComparedRun]) -> tuple[Estimate, int, int]:
        """The mean of these runs with its interval over source sets and targets; how many sets, and how many targets each has.

        Where sets met unequally many targets each counts by its mean, and the least number is told.
        """
        sets: dict[str, dict[str, list[Floats]]] = {}
        for run in runs:
            own_set = run.source_set if run.reads_sources else ""  # whatever fit it was given, it is the same
            sets.setdefault(own_set, {}).setdefault(run.target_digest, []).append(self._of_run[run.name])
        met = {frozenset(own) for own in sets.values()}
        values = [
            np.concatenate([np.mean(own[digest], axis=0) for digest in sorted(own)]) for own in sets.values()
        ]
        targets = [len(own) for own in values]
        if len(set(targets)) > 1:
            values = [own.mean(keepdims=True) for own in values]
        table = np.stack(values)
        rng = generator(runs[0].settings.seed, Stream.BOOTSTRAP, 0)
        found = Resampling(shared=len(met) == 1).interval(table[:, :, None], rng)
        return found.at(0), len(values), min(targets)


def sensitivity_points(
    averages: Averages, over: VariedSetting, others: Sequence[VariedSetting]
) -> list[SensitivityPoint]:
    """A point for each method at each value of `over` and each combination of the `others`; what else varies is averaged over.

    Combinations to which `over` or one of the others means nothing for every method are left out.
    """
    varied = averages.varied
    return [point for where in varied.combinations(others) for point in _points(averages, over, where)]


def _points(averages: Averages, over: VariedSetting, where: Where) -> list[SensitivityPoint]:
    varied = averages.varied
    own = {run.name for run in averages.at(where)}
    there = {
        known[over.name]
        for run, known in zip(varied.runs, varied.known, strict=True)
        if run.name in own and over.name in known
    }
    found = []
    for method, value in product([""] if over is varied.method else varied.method.values, over.values):
        line = () if over is varied.method else ((varied.method.name, method),)
        runs = averages.at((*line, (over.name, value), *where)) if value in there else []
        if runs:
            found.append(SensitivityPoint(str(method), value, where, *averages.estimate(runs)))
    return found


def intervals_of(points: Sequence[SensitivityPoint]) -> str:
    """What the intervals are over, in words."""
    sets = sorted({point.sets for point in points})
    if sets == [1]:
        return "95 % bootstrap intervals over targets, conditional on one source set each"
    few = (
        f"; under {FEW_SOURCE_SETS} source sets they cover less than 95 %"
        if sets[0] < FEW_SOURCE_SETS
        else ""
    )
    span = str(sets[0]) if len(sets) == 1 else f"{sets[0]} to {sets[-1]}"
    once = "; of one, or of a method that reads none, over targets" if sets[0] == 1 else ""
    return f"95 % bootstrap intervals over {span} source sets and their targets{once}{few}"


def averaged_over(varied: VariedRuns, *used: VariedSetting) -> str:
    """The settings that vary and are none of those used, in words; "" where there is none."""
    others = varied.others(*used)
    if not others:
        return ""
    names = [one.name for one in others]
    met: dict[object, set[object]] = {}
    for known in varied.known:
        at = tuple(known.get(one.name) for one in (varied.method, *used))
        met.setdefault(at, set()).add(tuple(known.get(name) for name in names))
    whole = len({frozenset(own) for own in met.values()}) == 1
    return f"averaged over {', '.join(names)}" + ("" if whole else ", each over what it was run with")


def variance_table(averages: Averages) -> list[VarianceShare]:
    """The share of each setting that varies, largest first, then what their combinations add, then the rest.

    NotAllowed where nothing varies, where the averages do not, or for more than MOST_FACTORS settings.
    """
    varied = averages.varied
    factors = varied.factors()
    if not factors:
        raise NotAllowed("no setting varies among these runs; give runs that differ in one at least")
    if len(factors) > MOST_FACTORS:
        raise NotAllowed(
            f"{len(factors)} settings vary among these runs; shares are taken of {MOST_FACTORS} at most: give fewer runs"
        )
    levels = [_levels(factor, varied.known) for factor in factors]
    found = variance_shares(np.array([averages.mean(run) for run in varied.runs]), levels)
    if np.isnan(found.residual):
        raise NotAllowed(f"all runs have the same average {averages.metric}; there is no variance to share")
    rows = [
        VarianceShare(factor.name, len(set(level[level >= 0].tolist())), float(share))
        for factor, level, share in zip(factors, levels, found.main, strict=True)
    ]
    rows.sort(key=lambda row: -row.share)
    rest = [VarianceShare(INTERACTIONS, 0, found.interactions)] if len(factors) > 1 else []
    noise = [VarianceShare(RESIDUAL, 0, found.residual)] if found.replicated else []
    return [*rows, *rest, *noise]


def shares_words(rows: Sequence[VarianceShare], metric: Metric) -> str:
    """What the shares are of, and what they are not."""
    noise = ""
    if len(rows) == 1:
        noise = "; every value was run once, so that its share holds the noise of source sets and targets too"
    elif rows[-1].setting != RESIDUAL:
        noise = "; every combination was run once, so that interactions hold the noise of source sets and targets too"
    return (
        f"shares of the sum of squares of the runs' average {metric}: what a setting adds to R2, averaged over all orders of "
        f"taking settings in{noise}. They depend on which values were tried"
    )


def ranked(averages: Averages) -> tuple[list[str], list[str], RankComparison]:
    """Methods, distributions, and how the methods rank over these, each by its average over source sets and other settings.

    Of the other settings those combinations count that every method was run with. NotAllowed where fewer than two methods met
    two distributions.
    """
    from qinit_cli.analysis.ranks import rank_comparison

    varied = averages.varied
    methods = [str(method) for method in varied.method.values]
    others = varied.others(varied.distribution)
    blocks: dict[str, list[float]] = {}
    for distribution in varied.distribution.values:
        rows = []
        for where in varied.combinations(others, ((DISTRIBUTION, distribution),)):
            found = [
                averages.at(((METHOD, method), (DISTRIBUTION, distribution), *where)) for method in methods
            ]
            if all(found):
                rows.append([np.mean([averages.mean(run) for run in own]) for own in found])
        if rows:
            blocks[setting_text(distribution)] = [float(one) for one in np.mean(rows, axis=0)]
    if len(methods) < 2 or len(blocks) < 2:
        raise NotAllowed(
            f"{counted(len(methods), 'method')} met together {counted(len(blocks), 'distribution')}; ranks need two methods "
            "at least that were run on the same two distributions"
        )
    values_of = np.array(list(blocks.values()))
    return methods, list(blocks), rank_comparison(values_of, fewest=averages.metric == "steps")


@dataclass(frozen=True)
class SensitivityTable:
    """Rows of plain values, and what they are of, in words."""

    metric: Metric
    rows: list[dict[str, Any]]
    about: str


def points_told(runs: Sequence[ComparedRun], over: str, metric: Metric) -> SensitivityTable:
    """A row for each method at each value of the setting `over` and each combination of what else varies."""
    varied = VariedRuns.of(runs)
    setting = varied.named(over, "--over")
    points = sensitivity_points(Averages(varied, metric), setting, varied.others(setting))
    return SensitivityTable(metric, point_rows(points, setting, metric), intervals_of(points))


def shares_told(runs: Sequence[ComparedRun], metric: Metric) -> SensitivityTable:
    """A row for each setting that varies, its share in the variance of the runs' averages."""
    shares = variance_table(Averages(VariedRuns.of(runs), metric))
    return SensitivityTable(metric, share_rows(shares), shares_words(shares, metric))


def point_rows(points: Sequence[SensitivityPoint], over: VariedSetting, metric: str) -> list[dict[str, Any]]:
    """The points as plain values."""
    return [
        {
            "setting": over.name,
            "value": point.value,
            "method": point.method,
            "where": ", ".join(f"{name} {setting_text(value)}" for name, value in point.where),
            **_bounds(metric, point.average),
            "sets": point.sets,
            "targets": point.targets,
        }
        for point in points
    ]


def share_rows(shares: Sequence[VarianceShare]) -> list[dict[str, Any]]:
    """The shares as plain values; least squares leaves their last bits to the processor."""
    return [
        dict(zip(SHARES, (row.setting, row.values or None, round(row.share, SHARE_DIGITS)), strict=True))
        for row in shares
    ]


def _bounds(name: str, estimate: Estimate) -> dict[str, float | None]:
    found = {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}
    return {key: value if np.isfinite(value) else None for key, value in found.items()}


def _average(run: ComparedRun, metric: Metric) -> Floats:
    from qinit_cli.analysis import returns

    values = curve(run, metric)
    if np.isnan(values).any():
        raise NotAllowed(
            f"{metric} of {run.name} is unknown: it was imported without; ask for --metric return"
        )
    return returns.average(values)


def _levels(factor: VariedSetting, known: Sequence[Mapping[str, Value]]) -> Integers:
    """The number of each run's value, -1 where the setting means nothing to the run."""
    number = {value: at for at, value in enumerate(factor.values)}
    return np.array(
        [number.get(own[factor.name], -1) if factor.name in own else -1 for own in known], np.int64
    )
