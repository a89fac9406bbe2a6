"""C2 and C10: is ln Q normal at the states that the paper shows?

The paper looks at histograms of 100 tasks. Here Shapiro-Wilk's test at 5 % is asked of every source set, and what decides is
how many sets reject: one set's p says little, and tasks of all sets pooled reject whatever departs at all. A state counts as
normal where no more sets reject than the 5 % that would if it were (one-sided exact binomial test at 5 %, shared by
Bonferroni among the rows that the claim asks for: four of ten), and as not normal where more do. That is no proof of
normality: W and the p of all tasks pooled stand beside it, and the same for Q itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from qinit_cli.analysis.value_sample import shapiro_wilk_of
from qinit_cli.arrays import Floats
from qinit_cli.claims import over_sets
from qinit_cli.claims.claim import Claim, Finding
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.setting import ASKED_NOISES, GRIDWORLD, MOUNTAIN_CAR, NOISES, Setting, variance
from qinit_cli.elementary import ln

GRIDWORLD_PLACES = ("(0, 0)", "(20, 20)", "(29, 29)")
MOST_POOLED = 5_000  # values that Shapiro-Wilk's p was made for
MOUNTAIN_CAR_PLACES = ("(-0.5, 0)", "(-0.3, 0.02)", "(0.2, 0.04)")


def findings(evidence: Evidence, family: str, exception: int, rows: int) -> Iterator[Finding]:
    """How many source sets reject ln Q at each place; normal is expected everywhere but at the `exception`.

    `rows` is how many of them the claim asks for.
    """
    for setting, sets in evidence.values.items():
        if setting.family == family:
            for at, place in enumerate(sets[0].places):
                samples = [values.positive[at] for values in sets]
                yield from _at(setting, place, samples, at != exception, rows)


def _at(setting: Setting, place: str, samples: list[Floats], normal: bool, rows: int) -> Iterator[Finding]:
    tests = {
        "ln Q": np.array([shapiro_wilk_of(ln(sample)) for sample in samples]),
        "Q itself": np.array([shapiro_wilk_of(sample) for sample in samples]),
    }
    for quantity, tested in tests.items():
        p = tested[:, 1]
        rejected = over_sets.share_rejected(p)
        decides = quantity == "ln Q" and rejected.sets > 0
        yield Finding(
            setting,
            aspect(quantity, place),
            rejected,
            over_sets.beyond_chance(p, rows) != normal if decides else None,
        )
        statistic = over_sets.mean(tested[:, 0])
        yield Finding(
            setting,
            f"W of {quantity} at {place}",
            statistic,
        )
    pooled = np.sort(np.concatenate(samples))
    if pooled.size <= MOST_POOLED:
        yield Finding(
            setting,
            f"p of ln Q at {place}, all tasks pooled",
            OverSets(shapiro_wilk_of(ln(pooled))[1], sets=len(samples)),
        )


def aspect(quantity: str, place: str) -> str:
    """What is looked at."""
    return f"share of source sets that reject a normal for {quantity} at {place}"


def expected(places: tuple[str, ...]) -> list[str]:
    """The aspects that decide."""
    return [aspect("ln Q", place) for place in places]


GRIDWORLD_CLAIM = Claim(
    name="C2",
    statement="ln Q is normal over the tasks at (0, 0) and (29, 29), and not at (20, 20), the centre of the goals.",
    source="section 7.1.2, Figure 5",
    statistic="share of source sets in which Shapiro-Wilk rejects a normal for ln Q at 5 %, greedy action",
    aspects="the state",
    needs=tuple((variance(7), each) for each in expected(GRIDWORLD_PLACES)),
    headline=(variance(7), aspect("ln Q", "(0, 0)")),
    command="qinit train-sources {family} --seed SEED, with SEED 0 to 9",
    look=partial(findings, family=GRIDWORLD, exception=1, rows=len(GRIDWORLD_PLACES)),
    digits=2,
)
MOUNTAIN_CAR_CLAIM = Claim(
    name="C10",
    statement="On Mountain Car ln Q is normal over the tasks at [-0.5, 0] and [-0.3, 0.02], and not at [0.2, 0.04].",
    # the paper does not say at which noise: all that are there decide
    source="section 7.2.2, Figure 10",
    statistic="share of source sets in which Shapiro-Wilk rejects a normal for ln Q at 5 %, greedy action",
    aspects="the state",
    needs=tuple((level, each) for level in ASKED_NOISES for each in expected(MOUNTAIN_CAR_PLACES)),
    also=NOISES,
    headline=(ASKED_NOISES[0], aspect("ln Q", "(-0.5, 0)")),
    command="qinit train-sources {family} --seed SEED, with SEED 0 to 9",
    look=partial(findings, family=MOUNTAIN_CAR, exception=2, rows=len(NOISES) * len(MOUNTAIN_CAR_PLACES)),
    digits=2,
)
