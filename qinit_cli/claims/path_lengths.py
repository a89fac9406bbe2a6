"""C1, C8 and C9: are path lengths normal over the tasks, and what does Mountain Car's noise do to their mean and spread?

Path lengths are whole numbers, so they are tested against the rounded normal (a bootstrap of W), which is conservative where
the spread is small. C1 asks all state-actions: if every one were normal, at most 5 % would be rejected on average, however
they depend on each other. What decides is that share, averaged over the source sets: the claim fails where it lies above 5 %
(one-sided t test over the source sets at 5 %, shared by Bonferroni among the claim's ten rows). It is asked apart of the
states among the goals (the smallest set that holds 95 % of them) and of those beyond, for near its centre the distance to a
normal goal is folded. Corrections and effect sizes stand beside it.

C8 asks the lengths from the start, as Figure 8 does, by how many source sets reject at 5 %: normal where no more do than
chance lets (one-sided exact binomial test at 5 %, shared among the five levels). Tasks whose path never arrives have no
length.

C9, means: a level's mean agrees where the whole interval of its difference to the mean without noise is narrower than the
noise floor, the standard deviation of the lengths of one and the same task learned again and again (noise 0). Spread: it
grows where the whole interval of its ratio to that of the level below lies above 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from qinit_cli.analysis import intervals, resampling
from qinit_cli.analysis.intervals import Estimate
from qinit_cli.analysis.length_sample import LengthSample
from qinit_cli.analysis.multiplicity import benjamini_hochberg, benjamini_yekutieli
from qinit_cli.analysis.permutation import LEVEL
from qinit_cli.arrays import Flags, Floats
from qinit_cli.claims import over_sets
from qinit_cli.claims.claim import ENOUGH_SETS, Claim, Finding
from qinit_cli.claims.evidence import Evidence, Lengths, LengthTests
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.setting import (
    ASKED_NOISES,
    GRIDWORLD,
    MOUNTAIN_CAR,
    NOISES,
    VARIANCES,
    Setting,
    variance,
)
from qinit_cli.seeding import Stream, generator

AMONG, BEYOND = "among the goals", "beyond the goals"
REJECTED = "share of state-actions rejected at 5 %"
AT_START = "share of source sets that reject a rounded normal at the start"
MEAN = "mean steps minus those of noise 0"
SPREAD = "standard deviation over that of the level below"


def everywhere(evidence: Evidence) -> Iterator[Finding]:
    """C1: the share of state-actions whose lengths are rejected, among the goals and beyond; all else beside it."""
    for setting, sets in evidence.tested.items():
        if setting.family != GRIDWORLD:
            continue
        regions = {AMONG: [one.among_goals for one in sets], BEYOND: [~one.among_goals for one in sets]}
        for region, places in regions.items():
            shares = np.array(
                [_share(one.p[at] <= LEVEL, one.p[at]) for one, at in zip(sets, places, strict=True)]
            )
            share = over_sets.mean(shares)
            within = not over_sets.above(shares, LEVEL, rows=len(VARIANCES) * len(regions))
            yield Finding(setting, f"{REJECTED} {region}", share, within if share.sets else None)
        yield from _beside(setting, sets)


def _beside(setting: Setting, sets: Sequence[LengthTests]) -> Iterator[Finding]:
    told = {
        REJECTED: [_share(one.p <= LEVEL, one.p) for one in sets],
        "the same by Benjamini-Hochberg": [_share(benjamini_hochberg(one.p) <= LEVEL, one.p) for one in sets],
        "the same by Benjamini-Yekutieli": [
            _share(benjamini_yekutieli(one.p) <= LEVEL, one.p) for one in sets
        ],
        "share of state-actions not testable": [float(np.isnan(one.p).mean()) for one in sets],
        "median W": [_median(one.statistic) for one in sets],
        "median |skewness|": [_median(np.abs(one.skewness)) for one in sets],
        "median |excess kurtosis|": [_median(np.abs(one.kurtosis)) for one in sets],
    }
    for aspect, values in told.items():
        yield Finding(setting, aspect, over_sets.mean(np.array(values)))


def at_the_start(evidence: Evidence) -> Iterator[Finding]:
    """C8: how many source sets reject the lengths from the start."""
    for setting, sets in _of_the_car(evidence):
        tests = np.array([_sample(one).rounded_normal(generator(0, Stream.BOOTSTRAP, 0)) for one in sets])
        rejected = over_sets.share_rejected(tests[:, 1])
        yield Finding(
            setting,
            AT_START,
            rejected,
            None if not rejected.sets else not over_sets.beyond_chance(tests[:, 1], rows=len(NOISES)),
        )
        yield Finding(setting, "W at the start", over_sets.mean(tests[:, 0]))
        never = np.array([one.never / (one.never + one.arrived.size) for one in sets])
        yield Finding(setting, "share of tasks whose path never arrives", over_sets.mean(never))
    for setting, tested in evidence.tested.items():
        if setting.family == MOUNTAIN_CAR:
            yield from _beside(setting, tested)


def over_noise(evidence: Evidence) -> Iterator[Finding]:
    """C9: means against the mean without noise, and each level's spread against that of the level below."""
    levels = dict(_of_the_car(evidence))
    for setting, sets in levels.items():
        lengths = [one.arrived for one in sets if one.arrived.size > 1]
        if not lengths:
            continue
        mean = over_sets.mean(np.array([own.mean() for own in lengths]))
        spread = np.array([own.var(ddof=1) for own in lengths])
        yield Finding(setting, "mean steps", mean)
        yield Finding(
            setting, "standard deviation of steps", OverSets(float(np.sqrt(spread.mean())), sets=len(spread))
        )
        floor = _floor(levels, setting)
        if floor is not None and setting.level > 0:
            yield _mean_against(setting, np.array([own.mean() for own in lengths]), floor)
        below = _below(levels, setting)
        if below is not None:
            yield _spread_against(setting, spread, below)


def _mean_against(setting: Setting, means: Floats, floor: Floats) -> Finding:
    """The means of the source sets (R,) against tasks without noise (n,), which are one task learned anew."""
    own, other = _resampled(means, 0), _resampled(floor, 1)
    found = intervals.percentiles(np.asarray(means.mean() - floor.mean()), own - other).at()
    if len(means) < 2:
        found = Estimate(found.value)
    agrees = max(abs(found.low), abs(found.high)) < float(floor.std(ddof=1))
    return Finding(setting, MEAN, OverSets(**vars(found), sets=len(means)), agrees)


def _spread_against(setting: Setting, variances: Floats, below: Floats) -> Finding:
    """The ratio of standard deviations, from the variances within the source sets of two levels (R,) and (R',)."""
    ratio = float(np.sqrt(variances.mean() / below.mean()))
    sets = min(len(variances), len(below))
    if sets < 2:
        return Finding(setting, SPREAD, OverSets(ratio, sets=sets), ratio > 1)
    found = intervals.percentiles(np.asarray(ratio), np.sqrt(_resampled(variances, 0) / _resampled(below, 1)))
    return Finding(setting, SPREAD, OverSets(**vars(found.at()), sets=sets), bool(found.low > 1))


def _floor(levels: Mapping[Setting, Sequence[Lengths]], setting: Setting) -> Floats | None:
    """Lengths of all tasks without noise, (n,); they differ by what learning draws, so that each is a unit."""
    for other, sets in levels.items():
        if other.level == 0 and other.variant == setting.variant:
            lengths: Floats = np.concatenate([one.arrived for one in sets])
            return lengths if lengths.size > 1 else None
    return None


def _below(levels: Mapping[Setting, Sequence[Lengths]], setting: Setting) -> Floats | None:
    """Variances within the source sets of the nearest of the paper's levels below that has enough of them, (R,)."""
    below = NOISES[: NOISES.index(setting.distribution)] if setting.distribution in NOISES else ()
    for before in reversed(below):
        for other, sets in levels.items():
            found = [one.arrived.var(ddof=1) for one in sets if one.arrived.size > 1]
            same = other.distribution == before and other.variant == setting.variant
            if same and len(found) >= min(ENOUGH_SETS, len(levels[setting])) and min(found) > 0:
                return np.array(found)
    return None


def _of_the_car(evidence: Evidence) -> Iterator[tuple[Setting, Sequence[Lengths]]]:
    for setting, sets in evidence.lengths.items():
        if setting.family == MOUNTAIN_CAR:
            yield setting, sets


def _sample(lengths: Lengths) -> LengthSample:
    return LengthSample(lengths.arrived, lengths.never)


def _resampled(values: Floats, stream: int) -> Floats:
    """Means of resamples of (R,), (B,): each stream its own, so that two levels vary independently."""
    samples = resampling.of_targets(len(values), generator(0, Stream.BOOTSTRAP, stream))
    return np.concatenate([sample.means(values[None, :, None])[:, 0] for sample in samples])


def _share(chosen: Flags, among: Floats) -> float:
    """Share of the cells chosen among those that are known."""
    known = np.isfinite(among)
    return float(chosen[known].mean()) if known.any() else np.nan


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


GRIDWORLD_CLAIM = Claim(
    name="C1",
    statement="With normal goals the expected optimal path lengths of every state-action are normal over the tasks.",
    source="section 7.1.1",
    statistic="share of state-actions whose path lengths a rounded normal is rejected for at 5 %, where chance alone rejects 5 %",
    aspects="whether the state lies among the goals",
    needs=tuple((level, f"{REJECTED} {region}") for level in VARIANCES for region in (AMONG, BEYOND)),
    headline=(variance(7), f"{REJECTED} {AMONG}"),
    command="qinit train-sources {family} --seed SEED | qinit fit - --eopl-normality rounded, with SEED 0 to 9",
    look=everywhere,
)
START_CLAIM = Claim(
    name="C8",
    statement="On Mountain Car the path lengths from the start are normal over the tasks.",
    source="section 7.2.2, Figure 8",
    statistic="share of source sets in which a rounded normal is rejected at 5 % for the path lengths from the start",
    aspects="the state",
    needs=tuple((level, AT_START) for level in ASKED_NOISES),
    also=NOISES,
    headline=(ASKED_NOISES[0], AT_START),
    command="qinit train-sources {family} --seed SEED, with SEED 0 to 9",
    look=at_the_start,
    digits=2,
)
NOISE_CLAIM = Claim(
    name="C9",
    statement="On Mountain Car the mean path lengths of all noise levels nearly agree with that without noise, "
    "and their spread grows with the noise.",
    source="section 7.2.2, Figure 8",
    statistic="mean steps from the start minus those without noise, against the standard deviation of the latter; "
    "standard deviation over that of the level below",
    aspects="whether mean or spread is asked",
    needs=(*((level, MEAN) for level in ASKED_NOISES), (ASKED_NOISES[1], SPREAD)),
    also=NOISES,
    headline=(ASKED_NOISES[1], MEAN),
    command="qinit train-sources {family} --seed SEED, with SEED 0 to 9, and qinit train-sources mountain-car --noise 0",
    look=over_noise,
    digits=1,
)
