"""C3: do the initial tables look like the goals?

A table's map is its largest value over the actions of each state. "Follows": the rank correlation (Spearman) over the states
of LogQInit-median's map with the probability that the goal is there; it follows where the interval over source sets lies at .9 or
above. "Wider", at the two largest variances, as the paper says it of high ones: UCOI's share of states above half of its own
peak, less LogQInit-median's. "Irregular", but for variance 1, where the paper saw none: how many more local maxima MaxQInit's
map has (states above all of their eight neighbours; a smooth bump has one); and that their number grows with the variance, by
the rank correlation of the two. Differences hold where their whole interval over source sets lies above 0.

Rank correlation alone does not tell the methods apart, since values fall with the distance from the goals whatever the
method: UCOI's and MaxQInit's stand beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from qinit_cli.arrays import Floats
from qinit_cli.claims import over_sets
from qinit_cli.claims.claim import Claim, Finding
from qinit_cli.claims.evidence import Evidence, Maps
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.setting import GRIDWORLD, VARIANCES, Setting, variance

MAPPED = MEDIAN, UCOI, MAXQINIT = "logqinit-median", "ucoi", "maxqinit"
FOLLOWS = 0.9  # rank correlation from which a map follows the goals
HIGH = VARIANCES[-2:]  # variances at which UCOI's map is said to be wider

CORRELATION = "rank correlation with the goals' probability"
WIDER = f"share of states above half the peak, {UCOI} minus {MEDIAN}"
IRREGULAR = f"local maxima, {MAXQINIT} minus {MEDIAN}"
ALL = "all variances"
GROWING = f"rank correlation of {MAXQINIT}'s local maxima with the variance"


def findings(evidence: Evidence) -> Iterator[Finding]:
    """How each method's map relates to the goals, how wide and how irregular it is."""
    for setting, sets in evidence.maps.items():
        if setting.family != GRIDWORLD:
            continue
        if np.ptp(sets[0].probabilities) > 0 and setting.distribution in VARIANCES:
            yield from _correlations(setting, sets)
        yield from _widths(setting, sets)
        yield from _maxima(setting, sets)
    yield from _growing(evidence)


def half_peak(values: Floats) -> float:
    """Share of the states of a map whose value is at least half of its largest."""
    return float((values >= values.max() / 2).mean())


def local_maxima(values: Floats) -> int:
    """How many states of a map (rows, columns) lie above all of their up to eight neighbours."""
    framed = np.pad(values, 1, constant_values=-np.inf)
    rows, columns = values.shape
    neighbours = [
        framed[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]
        for down in (-1, 0, 1)
        for right in (-1, 0, 1)
        if (down, right) != (0, 0)
    ]
    return int(np.all([values > neighbour for neighbour in neighbours], axis=0).sum())


def rank_correlation(first: Floats, second: Floats) -> float:
    """Spearman's, equal values sharing their ranks; NaN where one of the two does not vary."""
    from scipy.stats import rankdata

    ranks = np.stack([rankdata(first), rankdata(second)])
    if (np.ptp(ranks, axis=1) == 0).any():
        return float("nan")
    one, other = ranks - ranks.mean(axis=1, keepdims=True)
    return float(np.sum(one * other) / np.sqrt(np.sum(one**2) * np.sum(other**2)))


def _correlations(setting: Setting, sets: Sequence[Maps]) -> Iterator[Finding]:
    for method in (MEDIAN, UCOI, MAXQINIT):
        found = over_sets.mean(
            np.array(
                [rank_correlation(one.starts[method].ravel(), one.probabilities.ravel()) for one in sets]
            )
        )
        follows = _least(found) >= FOLLOWS if method == MEDIAN else None
        yield Finding(setting, f"{CORRELATION}, {method}", found, follows)


def _widths(setting: Setting, sets: Sequence[Maps]) -> Iterator[Finding]:
    widths = {method: np.array([half_peak(one.starts[method]) for one in sets]) for method in (MEDIAN, UCOI)}
    found = over_sets.mean(widths[UCOI] - widths[MEDIAN])
    yield Finding(setting, WIDER, found, _least(found) > 0 if setting.distribution in HIGH else None)
    for method, values in widths.items():
        yield Finding(setting, f"share of states above half the peak, {method}", over_sets.mean(values))


def _maxima(setting: Setting, sets: Sequence[Maps]) -> Iterator[Finding]:
    counts = {
        method: np.array([float(local_maxima(one.starts[method])) for one in sets])
        for method in (MEDIAN, UCOI, MAXQINIT)
    }
    found = over_sets.mean(counts[MAXQINIT] - counts[MEDIAN])
    yield Finding(
        setting, IRREGULAR, found, _least(found) > 0 if setting.distribution in VARIANCES[1:] else None
    )
    for method, values in counts.items():
        yield Finding(setting, f"local maxima, {method}", over_sets.mean(values))


def _growing(evidence: Evidence) -> Iterator[Finding]:
    """Over source sets in the order given, each with a map of every variance; with other settings apart."""
    by_variant: dict[Setting, list[tuple[Setting, Sequence[Maps]]]] = {}
    for setting, sets in evidence.maps.items():
        if setting.family == GRIDWORLD and setting.distribution in VARIANCES:
            by_variant.setdefault(setting.over(ALL), []).append((setting, sets))
    for together, parts in by_variant.items():
        if len(parts) < len(VARIANCES):
            continue
        levels = np.array([setting.level for setting, _ in parts])
        count = min(len(sets) for _, sets in parts)
        found = over_sets.mean(
            np.array(
                [
                    rank_correlation(
                        np.array([float(local_maxima(sets[at].starts[MAXQINIT])) for _, sets in parts]),
                        levels,
                    )
                    for at in range(count)
                ]
            )
        )
        yield Finding(together, GROWING, found, _least(found) > 0)


def _least(found: OverSets) -> float:
    """The lower end of the interval; of a single source set its value."""
    return found.low if found.sets > 1 else found.value


CLAIM = Claim(
    name="C3",
    statement="LogQInit's initial values follow the distribution of the goals, UCOI's are wider at high variance, and MaxQInit's "
    "are irregular, the more so the larger the variance.",
    source="section 7.1.2, Figure 4",
    statistic="rank correlation of LogQInit-median's initial values with the goals' probability; area above half the peak; "
    "number of local maxima",
    aspects="which of the three is asked",
    needs=(
        *((level, f"{CORRELATION}, {MEDIAN}") for level in VARIANCES),
        *((level, WIDER) for level in HIGH),
        *((level, IRREGULAR) for level in VARIANCES[1:]),
        (ALL, GROWING),
    ),
    headline=(variance(7), f"{CORRELATION}, {MEDIAN}"),
    command="qinit train-sources {family} --seed SEED | qinit fit -, with SEED 0 to 9",
    look=findings,
)
