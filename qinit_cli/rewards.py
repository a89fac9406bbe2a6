"""What steps pay, and what a return can be: free of numpy so that help stays fast.

Artefacts and the compiled loop hold returns. Methods, estimators and logarithms see shares: how far a value is on the way
from the least return to the largest, which with a reward of 1 at the goal is the return itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Self

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats

Reward = Literal["goal", "step"]
NativeReward = Literal["goal", "step", "native"]
SHARE = "x"  # (Q - low) / (high - low), in the labels of pictures
REWARD = "Reward: goal, 1 on reaching the goal; step, -1 a step until the goal is reached."  # a help text
EACH_STEP = -1.0  # what a step pays with --reward step


@dataclass(frozen=True)
class ReturnBounds:
    """The least and the largest return; ValueError where they do not differ."""

    low: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(
                f"the least return is {self.low:g} and the largest {self.high:g}; they must differ"
            )

    @classmethod
    def read(cls, text: str) -> Self:
        """The bounds in LOW:HIGH, as --returns takes them; ValueError where they are none, or 0 is not within them."""
        try:
            low, high = map(float, text.split(":"))
        except ValueError:
            low, high = math.nan, math.nan
        if not (math.isfinite(low) and math.isfinite(high) and low <= 0 <= high and low < high):
            raise ValueError(f"--returns is {text}; it must be LOW:HIGH with 0 within them, such as -200:0")
        return cls(low, high)

    @property
    def width(self) -> float:
        """The largest return less the least."""
        return self.high - self.low

    def share(self, value: float) -> float:
        """(Q - low) / (high - low) of one value."""
        return (value - self.low) / self.width

    def value(self, share: float) -> float:
        """low + (high - low) x of one share."""
        return self.low + self.width * share

    def shares(self, returns: Floats) -> Floats:
        """(Q - low) / (high - low); itself where returns are from 0 to 1."""
        return returns if self == UNIT else (returns - self.low) / self.width

    def returns(self, shares: Floats) -> Floats:
        """low + (high - low) x, the inverse of `shares`."""
        return shares if self == UNIT else self.low + self.width * shares


UNIT = ReturnBounds()


@dataclass(frozen=True)
class Payment:
    """What steps pay where that is not 1 at the goal alone; having reached the goal is worth 0."""

    bounds: ReturnBounds
    step: float | None  # what every step pays; None: the world tells it
    lost: float  # what having ended elsewhere is worth


@dataclass(frozen=True)
class PaidRange:
    """The least and the largest reward of steps after which an episode goes on, and of those that end it."""

    going_on: tuple[float, float]
    ending: tuple[float, float]

    def bounds(self, gamma: float) -> ReturnBounds:
        """The bounds of the discounted return of episodes of any length, 0 within them; ValueError with a gamma of 1."""
        check_discount(gamma)
        least, most = (reward / (1 - gamma) for reward in self.going_on)
        return ReturnBounds(min(0.0, self.ending[0], least), max(0.0, self.ending[1], most))


def payment(reward: str, gamma: float) -> Payment | None:
    """What `--reward` goal and step pay: None for 1 at the goal; for -1 a step, being lost is worth -1 a step for ever.

    ValueError for any other reward, and with a gamma of 1, where a return has no bounds.
    """
    if reward == "goal":
        return None
    if reward != "step":
        raise ValueError(f"the reward is {reward!r}, for which nothing is known; it must be goal or step")
    check_discount(gamma)
    low = EACH_STEP / (1 - gamma)
    return Payment(ReturnBounds(low, 0.0), EACH_STEP, low - EACH_STEP)


def check_discount(gamma: float) -> None:
    """ValueError with a gamma of 1, where a return has no bounds."""
    if gamma == 1:
        raise ValueError(
            "--gamma is 1, and returns of costs have no bounds without a discount; give --gamma below 1"
        )


def exact_returns(paid: Payment | None, gamma: float, value: Floats) -> Floats:
    """Exact returns, any shape, given the values of a reward of 1 at the goal, or shares where the world tells its rewards."""
    if paid is None:
        return value
    return paid.bounds.returns(_scale(paid, gamma) * value)


def exact_variances(paid: Payment | None, gamma: float, variance: Floats) -> Floats:
    """The variances of the targets of `exact_returns`, given those of what that is given."""
    return variance if paid is None else (_scale(paid, gamma) * paid.bounds.width) ** 2 * variance


def _scale(paid: Payment, gamma: float) -> float:
    """-1 a step until the goal is gamma times a reward of 1 at the goal, as shares."""
    return 1.0 if paid.step is None else gamma


def in_label(reward: str) -> str:
    """What a family's label ends with."""
    return "" if reward == "goal" else f"-reward-{reward}"
