"""A method's numbers from the scores of its runs, with intervals that resample source sets and targets together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis.aggregate import improvements, interquartile_mean, resampled_interquartile_means
from qinit_cli.analysis.intervals import Estimate, Resampling, percentiles, tails
from qinit_cli.analysis.permutation import paired_p
from qinit_cli.analysis.resampling import units
from qinit_cli.analysis.survival import kaplan_meier, resampled_medians
from qinit_cli.analysis.transfer_ratio import transfer_ratio
from qinit_cli.arrays import Flags, Floats, Integers
from qinit_cli.comparison.scores import Arrival, Metric, Scores
from qinit_cli.seeding import Stream, generator

# of what is counted through in order, which costs more: the ends of an interval move by 2 % of its width
RANK_RESAMPLES = 2_000


@dataclass(frozen=True)
class Threshold:
    """Episodes until the return comes to half of what can be hoped for."""

    median: Estimate  # Kaplan-Meier; infinite where half of the targets never arrive
    restricted_mean: Estimate  # who never arrives counts as the last episode
    censored: float  # share of targets that never arrive


@dataclass(frozen=True)
class Estimates:
    """A method over all its runs, and beside the baseline on the same targets and from the same source sets."""

    average: Estimate  # over all episodes
    jumpstart: Estimate  # over the first 10 episodes, or before anything was learned (greedy evaluations)
    asymptotic: Estimate  # over the last tenth
    iqm: Estimate  # interquartile mean of the averages over source sets and targets
    steps: float  # mean of min(steps, horizon)
    success: float  # share of episodes that reach the goal
    difference: Estimate | None  # of averages, paired on the same targets; None without a baseline
    p: float | None  # of the difference, sign-flip permutation
    ratio: Estimate | None  # of averages; None too where the baseline's interval touches 0
    improvement: Estimate | None  # probability of improvement over the baseline
    regret: Estimate | None  # to what is possible, see `attainable`; None where that is not known
    threshold: Threshold | None  # None likewise, and of greedy evaluations


def estimates(
    own: Sequence[Scores],
    baseline: Sequence[Scores] | None,
    metric: Metric,
    resampling: Resampling,
    seed: int,
) -> Estimates:
    """The numbers of R runs of one method, and beside the `baseline`'s runs of the same targets and source sets.

    Every method is resampled by one stream of the `seed`, from its beginning, so that all meet the same samples.
    """
    tables = _tables(own, baseline)
    arrivals = [scores.arrival for scores in own if scores.arrival is not None]
    better = None if baseline is None else _better(own, baseline, metric, resampling)
    drawn = _drawn(tables, arrivals, better, resampling, seed)
    means = {name: drawn.estimate(table.mean(), drawn.means[name]) for name, table in tables.items()}
    return Estimates(
        average=means["average"],
        jumpstart=means["jumpstart"],
        asymptotic=means["asymptotic"],
        iqm=drawn.estimate(interquartile_mean(tables["average"]), drawn.iqms),
        steps=float(np.mean([scores.steps for scores in own])),
        success=float(np.mean([scores.success for scores in own])),
        difference=means.get("difference"),
        p=paired_p(tables["difference"], _rng(seed)) if "difference" in tables else None,
        ratio=drawn.ratio(tables) if "baseline" in tables else None,
        improvement=None if better is None else drawn.estimate(better.mean(), drawn.improvements),
        regret=means.get("regret"),
        threshold=_threshold(arrivals, means["arrival"], drawn) if arrivals else None,
    )


@dataclass(frozen=True)
class _Drawn:
    """What samples say; empty where nothing can be resampled."""

    units: int  # source sets, or the targets of one
    means: dict[str, Floats]  # (B,) of each table
    iqms: Floats  # (B',)
    medians: Floats  # (B',)
    improvements: Floats  # (B,)

    def estimate(self, value: float, resampled: Floats) -> Estimate:
        """A number and the interval of its resampled values."""
        if not len(resampled):
            return Estimate(float(value))
        return percentiles(np.asarray(value), resampled, self.units).at()

    def median(self, value: float) -> Estimate:
        """The same of a median, without interpolation: some of the resampled are infinite."""
        if not len(self.medians):
            return Estimate(value)
        ordered = np.sort(self.medians)
        low, high = (ordered[round(tail * (len(ordered) - 1))] for tail in tails(self.units))
        return Estimate(value, float(low), float(high))

    def ratio(self, tables: dict[str, Floats]) -> Estimate | None:
        """The ratio of averages; None where the baseline's interval touches 0, or is not known."""
        if not len(self.means["baseline"]):
            return None
        mean, baseline = float(tables["average"].mean()), float(tables["baseline"].mean())
        found = transfer_ratio(mean, baseline, self.means["average"], self.means["baseline"], self.units)
        return None if np.isnan(found.estimate) else found.at()


def _tables(own: Sequence[Scores], baseline: Sequence[Scores] | None) -> dict[str, Floats]:
    """What is averaged over source sets and targets, (R, T) each."""
    tables = {
        "average": np.stack([scores.average for scores in own]),
        "jumpstart": np.stack([scores.jumpstart for scores in own]),
        "asymptotic": np.stack([scores.asymptotic for scores in own]),
    }
    if baseline is not None:
        tables["baseline"] = np.stack([scores.average for scores in baseline])
        tables["difference"] = tables["average"] - tables["baseline"]
    known = [scores.regret for scores in own if scores.regret is not None]
    if known:
        tables["regret"] = np.stack(known)
    times = [scores.arrival.times for scores in own if scores.arrival is not None]
    if times:
        tables["arrival"] = np.stack(times).astype(np.float64)
    return tables


def _better(
    own: Sequence[Scores], baseline: Sequence[Scores], metric: Metric, resampling: Resampling
) -> Floats:
    """On which targets the method beats the baseline: (R, R, T) over all pairs of runs, as rliable has it.

    (1, R, T), in pairs of one source set, where each set met targets of its own: those of two sets are no pair.
    """
    method, other = (np.stack([scores.average for scores in runs]) for runs in (own, baseline))
    if metric == "steps":  # the fewer the better
        method, other = -method, -other
    return (
        improvements(method[:, None], other[None]) if resampling.shared else improvements(method, other)[None]
    )


def _drawn(
    tables: dict[str, Floats],
    arrivals: Sequence[Arrival],
    better: Floats | None,
    resampling: Resampling,
    seed: int,
) -> _Drawn:
    stacked = np.stack(list(tables.values()), axis=2)
    means, iqms, medians, improved = [stacked[:0, 0]], [np.empty(0)], [np.empty(0)], [np.empty(0)]
    ranked = 0
    sets, targets = stacked.shape[:2]
    for sample in resampling.samples(sets, targets, _rng(seed)):
        means.append(sample.means(stacked))
        if better is not None:
            improved.append(sample.pair_means(better))
        if ranked < RANK_RESAMPLES:
            counts = sample.counts()[: RANK_RESAMPLES - ranked]
            ranked += len(counts)
            iqms.append(resampled_interquartile_means(tables["average"], counts))
            if arrivals:
                times, reached = _joined(arrivals)
                medians.append(resampled_medians(times, reached, counts))
    by_table = np.concatenate(means).T
    return _Drawn(
        units(sets, targets),
        dict(zip(tables, by_table, strict=True)),
        np.concatenate(iqms),
        np.concatenate(medians),
        np.concatenate(improved),
    )


def _joined(arrivals: Sequence[Arrival]) -> tuple[Integers, Flags]:
    """Times and whether they were reached, over source sets and targets, (R * T,) each."""
    return (
        np.concatenate([arrival.times for arrival in arrivals]),
        np.concatenate([arrival.reached for arrival in arrivals]),
    )


def _threshold(arrivals: Sequence[Arrival], restricted_mean: Estimate, drawn: _Drawn) -> Threshold:
    times, reached = _joined(arrivals)
    found = kaplan_meier(times, reached, int(times.max()))
    return Threshold(drawn.median(found.median), restricted_mean, found.censored)


def _rng(seed: int) -> np.random.Generator:
    return generator(seed, Stream.BOOTSTRAP, 0)
