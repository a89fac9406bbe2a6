"""C4, C5, C6 and C11: the ranks of the initialisations, by average return over all episodes.

Every rank is a matter of differences in pairs, on the same targets and from the same source sets. One method is ahead of
another where the difference's 95 % interval, over source sets and targets, lies above 0 and its sign-flip p over source sets,
by Holm over all pairs that the claim asks of that distribution, is at most 5 %. What cannot be told apart is not ahead, so
that a claim of being better does not hold there. A rank has a confidence set: from one more than those ahead of it to the
last less those behind.

"Best" (C4) is set against the paper's other initialisations and against no transfer: an initialisation that is worse than
zeros is not best. "Third" (C5) and "last" (C6) are ranks among the paper's four initialisations; MaxQInit against no transfer
stands beside. At variance 1 the paper claims nothing, since there "the initial value functions are basically similar": its
rows are told, and do not decide. The plain mean is not among the paper's methods; it stands beside too.

C11: "low" noise is .0002 and .005, "high" .015 and .02; between them nothing is claimed of .01.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from qinit_cli.claims.claim import RANK_SETS, Claim, Finding
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.scores import Arms, Pair
from qinit_cli.claims.setting import (
    ASKED_NOISES,
    GRIDWORLD,
    MOUNTAIN_CAR,
    NOISES,
    UNIFORM,
    VARIANCES,
    Setting,
    variance,
)

ZERO, MAXQINIT, UCOI, PLAIN_MEAN = "zero", "maxqinit", "ucoi", "mean"
MEDIAN, MEAN = "logqinit-median", "logqinit-mean"
INITIALISATIONS = (MEDIAN, UCOI, MEAN, MAXQINIT)  # the paper's
CLAIMED = (*VARIANCES[1:], UNIFORM)
LOW, HIGH = NOISES[:2], NOISES[3:]
THIRD = f"rank of {MEAN} among {len(INITIALISATIONS)}"
METHODS = ", ".join((ZERO, *INITIALISATIONS))
TRANSFERS = (
    "qinit train-sources {family} --seed SEED | qinit fit - | qinit transfer METHOD -, with SEED 0 to 9 and METHOD "
    f"{METHODS}"
)


def minus(pair: Pair) -> str:
    """How a pair is called."""
    return " minus ".join(pair)


def against(method: str, *others: str) -> list[Pair]:
    """The method in a pair with each of the others."""
    return [(method, other) for other in others]


def pair_findings(
    setting: Setting, scores: Arms, deciding: Sequence[Pair], beside: Sequence[Pair] = ()
) -> Iterator[Finding]:
    """A row for each pair there is; the claim holds where the first is ahead. Holm's correction is over the deciding pairs.

    A pair that too few source sets could tell apart does not decide.
    """
    for pairs, decides in ((deciding, True), (beside, False)):
        for pair, found in scores.contrasts(pairs).items():
            yield Finding(setting, minus(pair), found, found.above if decides and found.tested else None)


def best(evidence: Evidence) -> Iterator[Finding]:
    """C4: LogQInit-median against each of the others."""
    for setting, scores in _of(evidence, GRIDWORLD):
        claimed = setting.distribution in CLAIMED
        pairs = against(MEDIAN, UCOI, MEAN, MAXQINIT, ZERO)
        plain = against(MEDIAN, PLAIN_MEAN)
        yield from pair_findings(
            setting, scores, pairs if claimed else (), plain if claimed else pairs + plain
        )


def third(evidence: Evidence) -> Iterator[Finding]:
    """C5: the rank of LogQInit-mean and its confidence set."""
    others = tuple(name for name in INITIALISATIONS if name != MEAN)
    for setting, scores in _of(evidence, GRIDWORLD):
        contrasts = scores.contrasts(against(MEAN, *others))
        if len(contrasts) == len(others):
            best_rank = 1 + sum(found.below for found in contrasts.values())
            worst_rank = len(INITIALISATIONS) - sum(found.above for found in contrasts.values())
            rank = 1 + sum(found.value < 0 for found in contrasts.values())
            sets = min(found.sets for found in contrasts.values())
            decides = setting.distribution in CLAIMED and all(found.tested for found in contrasts.values())
            holds = best_rank == worst_rank == 3 if decides else None
            yield Finding(setting, THIRD, OverSets(rank, best_rank, worst_rank, sets), holds)
        for pair, found in contrasts.items():
            yield Finding(setting, minus(pair), found, None)


def last(evidence: Evidence) -> Iterator[Finding]:
    """C6: each of the others against MaxQInit."""
    for setting, scores in _of(evidence, GRIDWORLD):
        claimed = setting.distribution in CLAIMED
        pairs = [(name, MAXQINIT) for name in INITIALISATIONS if name != MAXQINIT]
        zero = [(ZERO, MAXQINIT)]
        yield from pair_findings(setting, scores, pairs if claimed else (), zero if claimed else pairs + zero)


def by_noise(evidence: Evidence) -> Iterator[Finding]:
    """C11: LogQInit-median, then UCOI, ahead of the others at low noise; LogQInit-mean at high noise."""
    for setting, scores in _of(evidence, MOUNTAIN_CAR):
        pairs = CLAIMED_BY_NOISE.get(setting.distribution, [])
        every = [pair for claimed in (FIRST_AND_SECOND, MEAN_FIRST) for pair in claimed]
        told = [pair for pair in every if pair not in pairs and pair[::-1] not in pairs]
        yield from pair_findings(setting, scores, pairs, [*told, *against(MEDIAN, PLAIN_MEAN)])


def _of(evidence: Evidence, family: str) -> Iterator[tuple[Setting, Arms]]:
    for setting, scores in evidence.scores.items():
        if setting.family == family:
            yield setting, scores


FIRST_AND_SECOND = [*against(MEDIAN, UCOI, MEAN, MAXQINIT, ZERO), *against(UCOI, MEAN, MAXQINIT, ZERO)]
MEAN_FIRST = against(MEAN, MEDIAN, UCOI, MAXQINIT, ZERO)
CLAIMED_BY_NOISE = dict.fromkeys(LOW, FIRST_AND_SECOND) | dict.fromkeys(HIGH, MEAN_FIRST)

BEST = Claim(
    name="C4",
    statement="LogQInit earns the largest average return of all initialisations with every distribution of goals but variance 1.",
    source="section 7.1.2, Figure 6",
    statistic="paired difference of average return, logqinit-median minus each other initialisation and minus zero",
    aspects="the method that it is set against",
    needs=tuple(
        (level, minus(pair)) for level in CLAIMED for pair in against(MEDIAN, UCOI, MEAN, MAXQINIT, ZERO)
    ),
    headline=(variance(7), minus((MEDIAN, UCOI))),
    command=TRANSFERS,
    look=best,
    sets=RANK_SETS,
    digits=4,
)
THIRD_CLAIM = Claim(
    name="C5",
    statement="LogQInit-mean ranks third of the initialisations.",
    source="section 7.1.2, Figure 6",
    statistic="rank of logqinit-mean by average return among the paper's four initialisations, with its confidence set",
    aspects="the rank",
    needs=tuple((level, THIRD) for level in CLAIMED),
    headline=(variance(7), THIRD),
    command=TRANSFERS,
    look=third,
    sets=RANK_SETS,
    digits=0,
)
LAST = Claim(
    name="C6",
    statement="MaxQInit earns the least of the initialisations.",
    source="section 7.1.2, Figure 6",
    statistic="paired difference of average return, each other initialisation minus maxqinit",
    aspects="the method that it is set against",
    needs=tuple(
        (level, minus((name, MAXQINIT))) for level in CLAIMED for name in INITIALISATIONS if name != MAXQINIT
    ),
    headline=(variance(7), minus((UCOI, MAXQINIT))),
    command=TRANSFERS,
    look=last,
    sets=RANK_SETS,
    digits=4,
)
BY_NOISE = Claim(
    name="C11",
    statement="On Mountain Car LogQInit-median, then UCOI, earn most at low noise, and LogQInit-mean at high noise.",
    source="section 7.2.2, Figure 9",
    statistic="paired difference of average return between the initialisation named and each other one",
    aspects="the pair of methods",
    needs=tuple((level, minus(pair)) for level in ASKED_NOISES for pair in CLAIMED_BY_NOISE[level]),
    also=(*LOW, *HIGH),
    headline=(NOISES[1], minus((MEDIAN, UCOI))),
    command=TRANSFERS,
    look=by_noise,
    sets=RANK_SETS,
    digits=4,
)
