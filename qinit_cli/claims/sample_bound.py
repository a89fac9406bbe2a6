"""C13: can MaxQInit's 4754 samples be derived?

The bound is m >= ln(delta) / ln(1 - p_min) (Abel et al., 2018), and the paper gives neither. It can be derived with a
distribution where one of the usual probabilities of failure leads to 4754 with the probability of its least likely goal. What
decides is the delta that 4754 would need, (1 - p_min)^4754: nothing is measured, and no artefact is needed.

Rows tell the reverse too: of how many equally likely tasks each usual delta would make 4754 the bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from qinit_cli.analysis.sample_size import tasks_for_one_target
from qinit_cli.claims.claim import Claim, Finding
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.setting import GRIDWORLD, UNIFORM, VARIANCES, Setting

STATED = 4754  # samples
USUAL = (0.1, 0.05, 0.01, 0.005, 0.001)  # probabilities of failure
CELLS = 900  # of the paper's grid; uniform goals are drawn from all of them
NEEDED = f"probability of failure that leads to {STATED}"


def findings(evidence: Evidence) -> Iterator[Finding]:
    """The delta that each distribution's least likely goal asks for; the evidence has no say."""
    uniform = Setting(GRIDWORLD, UNIFORM, math.inf)
    yield _needed(uniform, NEEDED, 1 / CELLS)
    yield _needed(uniform, f"{NEEDED}, the start left out", 1 / (CELLS - 1))
    for delta in USUAL:
        yield Finding(
            uniform,
            f"samples for probability of failure {delta:g}",
            OverSets(tasks_for_one_target(1 / CELLS, delta)),
        )
        yield Finding(
            uniform,
            f"equally likely tasks that probability of failure {delta:g} takes {STATED} samples for",
            OverSets(_tasks(delta)),
        )
    for distribution, least in _least_chances().items():
        yield _needed(Setting(GRIDWORLD, distribution, float(distribution.split()[1])), NEEDED, least)


def _needed(setting: Setting, aspect: str, p_min: float) -> Finding:
    derived = any(tasks_for_one_target(p_min, delta) == STATED for delta in USUAL)
    return Finding(setting, aspect, OverSets((1 - p_min) ** STATED), derived)


def _tasks(delta: float) -> float:
    return 1 / -math.expm1(math.log(delta) / STATED)


def _least_chances() -> dict[str, float]:
    """The probability of the least likely cell to be the goal, by the paper's distributions with normal goals."""
    from qinit_cli.environments.gridworld import Gridworld

    least = {}
    for distribution in VARIANCES:
        probabilities = Gridworld(variance=float(distribution.split()[1])).goal_chances()
        least[distribution] = float(probabilities[probabilities > 0].min())
    return least


CLAIM = Claim(
    name="C13",
    statement=f"MaxQInit would need {STATED} samples.",
    source="section 7.1.2",
    statistic=f"probability of failure with which ln(delta)/ln(1 - p_min) is {STATED}, p_min the least likely goal's; "
    "it is derived where that is one of .1, .05, .01, .005, .001",
    aspects="how goals are counted",
    needs=((UNIFORM, NEEDED), *((distribution, NEEDED) for distribution in VARIANCES)),
    headline=(UNIFORM, NEEDED),
    command="qinit sample-size",  # nothing can be lacking
    look=findings,
    digits=5,
)
