"""What evidence is of: a distribution of tasks, and where its making differs from the paper's."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Setting:
    """A distribution, and what differs from the paper's settings or, where it gives none, from ours for it."""

    family: str  # "gridworld"
    distribution: str  # "variance 7", "uniform goals", "noise 0.005"
    level: float  # the variance, infinite where goals are uniform, or the noise: the order of rows
    variant: str = ""  # "exact sources, gamma 0.9"; "" where nothing differs
    full: bool = True  # nothing is smaller than in the paper

    @property
    def label(self) -> str:
        """Its name in a row."""
        return ", ".join(part for part in (self.distribution, self.variant) if part)

    @property
    def order(self) -> tuple[bool, str, float, str]:
        """Sorts the paper's own settings first, then by distribution."""
        return bool(self.variant), self.variant, self.level, self.distribution

    def over(self, distribution: str) -> Setting:
        """The same for several distributions together, after each of them."""
        return replace(self, distribution=distribution, level=float("inf"))


GRIDWORLD, MOUNTAIN_CAR = "gridworld", "mountain-car"
UNIFORM = "uniform goals"


def variance(value: float) -> str:
    """The gridworld's distribution with normal goals of this variance."""
    return f"variance {value:g}"


def noise(value: float) -> str:
    """Mountain Car's distribution with pushes of this standard deviation."""
    return f"noise {value:g}"


VARIANCES = tuple(variance(value) for value in (1, 3, 5, 7, 10))  # the paper's
NOISES = tuple(noise(value) for value in (0.0002, 0.005, 0.01, 0.015, 0.02))  # the paper's
# a low and a high level, without which no claim on Mountain Car is judged; the others decide where they are there
ASKED_NOISES = (NOISES[1], NOISES[3])
