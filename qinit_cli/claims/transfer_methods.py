"""C7 and C12: LogQInit and the "+" variants against reward shaping and policy transfer.

Differences are judged as those of initialisations are (see `initialisations`): in pairs, by the interval over source sets and
targets and by Holm's p over all pairs that the claim asks of that distribution.

OPS-TL's rank hangs on a decay that the paper does not give, so that all three of DECAYS decide: no claim of beating policy
transfer stands unless it holds for all. What it earns while it follows a policy it earns without exploring; the same with
--explore-while-following stands beside. The paper's text starts the "+" variants from LogQInit-mean, the caption of its
Figure 6 from LogQInit-median: the caption's decide, and the text's too where they are there. DRS reads the target's goal.

C12, "no measurable improvement": a method gives nothing where the whole interval of its difference to learning from zero lies
below a twentieth of what LogQInit-median gains over zero, which no picture of learning curves would show.
"""

from __future__ import annotations

from collections.abc import Iterator

from qinit_cli.claims.claim import RANK_SETS, Claim, Finding
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.initialisations import MEAN, MEDIAN, ZERO, against, minus, pair_findings
from qinit_cli.claims.scores import Pair
from qinit_cli.claims.setting import (
    ASKED_NOISES,
    GRIDWORLD,
    MOUNTAIN_CAR,
    NOISES,
    UNIFORM,
    VARIANCES,
    variance,
)

DECAYS = ("", " rho=1.0", " rho=1.0 nu=1.0")  # of ops-tl, as its label tells them; "" is rho .99, nu .98
FREE, HANDICAPPED = "ops-tl", " explore-while-following"
# the third follows for ever and never acts on its own table: its "+" is the same run
STARTED_DECAYS = DECAYS[:2]
NOTHING = 1 / 20  # of LogQInit-median's gain over zero


def label(method: str, init: str = "", options: str = "") -> str:
    """A method's label with what it starts from and its options."""
    return (f"{method}+{init}" if init else method) + options


def without_decay(aspect: str) -> str:
    """What is looked at, whatever the decay is."""
    for decay in sorted(DECAYS, key=len, reverse=True):
        aspect = aspect.replace(decay, "") if decay else aspect
    return aspect


PLAIN = ("ptrs", "drs", *(label(FREE, options=decay) for decay in DECAYS))


def pluses(init: str) -> list[Pair]:
    """Each method started by an initialisation, and without."""
    shaping = [(label(name, init), name) for name in ("ptrs", "drs")]
    return shaping + [(label(FREE, init, decay), label(FREE, options=decay)) for decay in STARTED_DECAYS]


def beaten(evidence: Evidence) -> Iterator[Finding]:
    """C7: LogQInit against each method, and each "+" against the same without."""
    deciding = [
        *against(MEDIAN, *PLAIN),
        *against(MEAN, *PLAIN),
        *pluses(MEDIAN),
        *pluses(MEAN),
    ]
    beside = [
        (start, label(FREE, options=decay + HANDICAPPED)) for start in (MEDIAN, MEAN) for decay in DECAYS
    ]
    for setting, scores in evidence.scores.items():
        if setting.family == GRIDWORLD:
            yield from pair_findings(setting, scores, deciding, beside)


def nothing(evidence: Evidence) -> Iterator[Finding]:
    """C12: what the other methods gain over zero, against what LogQInit-median does."""
    for setting, scores in evidence.scores.items():
        if setting.family != MOUNTAIN_CAR:
            continue
        contrasts = scores.contrasts([(name, ZERO) for name in (*PLAIN, MEDIAN)])
        gain = contrasts.pop((MEDIAN, ZERO), None)
        for pair, found in contrasts.items():
            holds = None if gain is None else found.high < NOTHING * gain.value
            yield Finding(setting, minus(pair), found, holds)
        if gain is not None:
            yield Finding(setting, minus((MEDIAN, ZERO)), gain)


_ALL = ", ".join(["ptrs", "drs", "ops-tl", "ops-tl --rho 1", "ops-tl --rho 1 --nu 1"])

BEATEN = Claim(
    name="C7",
    statement="LogQInit earns more than PTRS, OPS-TL and DRS, and these earn more when LogQInit starts them (+) than without.",
    source="section 7.1.2, Figure 6(b)",
    statistic="paired difference of average return, LogQInit minus each method, and each + minus the same without",
    aspects="the pair of methods",
    needs=tuple((variance(7), minus(pair)) for pair in [*against(MEDIAN, *PLAIN), *pluses(MEDIAN)]),
    headline=(variance(7), minus((MEDIAN, FREE))),
    command="qinit train-sources {family} --seed SEED | qinit fit - | qinit transfer METHOD -, with SEED 0 to 9 and METHOD "
    f"logqinit-median, {_ALL}, and these with --init logqinit-median",
    look=beaten,
    sets=RANK_SETS,
    also=(*VARIANCES, UNIFORM),
    option=("OPS-TL's decay", without_decay),
    digits=4,
)
NOTHING_GAINED = Claim(
    name="C12",
    statement="On Mountain Car the other transfer methods give no measurable improvement over 1000 episodes.",
    source="section 7.2.2",
    statistic="paired difference of average return, each method minus zero, against a twentieth of logqinit-median's",
    aspects="the method",
    needs=tuple((level, minus((name, ZERO))) for level in ASKED_NOISES for name in PLAIN),
    headline=(ASKED_NOISES[0], minus(("ptrs", ZERO))),
    also=NOISES,
    command="qinit train-sources {family} --seed SEED | qinit fit - | qinit transfer METHOD -, with SEED 0 to 9 and METHOD "
    f"zero, logqinit-median, {_ALL}",
    look=nothing,
    sets=RANK_SETS,
    option=("OPS-TL's decay", without_decay),
    digits=4,
)
