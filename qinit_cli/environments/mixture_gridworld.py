"""The gridworld with goals from a mixture of normals: the paper's first limit, distributions with more than one mode.

Moves and tables are the gridworld's; only the draw of the goal differs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.environments.normal_goals import NormalGoals
from qinit_cli.environments.slippery_grid import SlipperyGrid
from qinit_cli.options import check, option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats

LONGEST = 10  # letters of a number that a name has in full: names of stored artefacts do not change


@dataclass(frozen=True)
class MixtureGridworld(SlipperyGrid):
    """The gridworld with goals around several means: each task draws one of them, then its goal around that."""

    size: int = option(30, "Cells along each side.", low=2, high=1000)
    means: str | None = option(
        None,
        "Means of the goals, ROW:COLUMN each, with commas between them.",
        default_text="1/3 and 2/3 of the size, on the diagonal",
    )
    variances: str = option("7", "Variance of row and column around each mean, or one for all.")
    weights: str = option("1", "How often each mean is drawn, relative to the others; or 1: equally often.")
    p_low: float = option(0.6, "Lowest probability that a move goes where it was meant to.", low=0.25, high=1)
    p_high: float = option(0.9, "Highest such probability; each task draws its own.", low=0.25, high=1)
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "mixture-gridworld"

    def __post_init__(self) -> None:
        check(self)
        self._check_slip()
        if self.means is None:
            third = self.size / 3
            object.__setattr__(self, "means", f"{third}:{third},{2 * third}:{2 * third}")
        means = [_mean(text) for text in (self.means or "").split(",")]
        shares = _each("weights", self.weights, len(means))
        if sum(shares) <= 0:
            raise ValueError(f"--weights {self.weights}: at least one must be above 0")
        # what means the same is stored the same, whichever way it was written
        weights = [share / sum(shares) for share in shares]
        variances = _each("variances", self.variances, len(means))
        object.__setattr__(self, "means", ",".join(f"{row:.12g}:{column:.12g}" for row, column in means))
        object.__setattr__(self, "variances", _told(variances))
        object.__setattr__(self, "weights", "1" if len(set(weights)) == 1 else _told(weights))
        self._parts()

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        means = "-and-".join(f"{part.row:g}-{part.column:g}" for _, part in self._parts())
        weights = "" if self.weights == "1" else f"-weights-{'-'.join(map(_short, self.weights.split(',')))}"
        return self._label(f"at-{means}-variance-{self.variances.replace(',', '-')}{weights}")

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The target start, the cell of each mean and the far corner."""
        far = self.size - 1.0
        middles = [
            (min(float(round(part.row)), far), min(float(round(part.column)), far))
            for _, part in self._parts()
        ]
        return tuple(dict.fromkeys([(0.0, 0.0), *middles, (far, far)]))

    def goal_chances(self) -> Floats:
        """How likely each cell is to be a task's goal, (S,)."""
        import numpy as np

        probabilities: Floats = np.sum(
            [weight * part.probabilities() for weight, part in self._parts()], axis=0
        )
        return probabilities

    def draw(self, rng: np.random.Generator) -> tuple[int, int, float]:
        """One task: goal row, goal column and p.

        A goal off the grid or at the target start is redrawn around the same mean, so that the weights stay what they are.
        """
        parts = self._parts()
        which = int(rng.choice(len(parts), p=[weight for weight, _ in parts]))
        return (*parts[which][1].draw(rng), self._slip(rng))

    def _parts(self) -> list[tuple[float, NormalGoals]]:
        """The weight and the normal of each mean; ValueError where one hardly meets the grid."""
        means = [_mean(text) for text in (self.means or "").split(",")]
        shares = _each("weights", self.weights, len(means))
        variances = _each("variances", self.variances, len(means))
        return [
            (share / sum(shares), NormalGoals(self.grid, *mean, variance))
            for share, mean, variance in zip(shares, means, variances, strict=True)
        ]


def _mean(text: str) -> tuple[float, float]:
    row, colon, column = text.partition(":")
    if not colon:
        raise ValueError(f"--means has {text!r}; write ROW:COLUMN for each, such as 10:20,20:10")
    return _number("means", row), _number("means", column)


def _each(name: str, text: str, count: int) -> list[float]:
    """A number for each of `count` means: those given, or the one given for all."""
    numbers = [_number(name, part) for part in text.split(",")]
    if len(numbers) not in (1, count):
        raise ValueError(
            f"--{name} has {len(numbers)} numbers for {count} means; give one for each, or one for all"
        )
    return numbers * count if len(numbers) == 1 else numbers


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f"--{name} has {text!r}, which is no number") from None
    if not 0 <= number < float("inf"):
        raise ValueError(f"--{name} has {text.strip()}; a number there is finite and at least 0")
    return number


def _short(text: str) -> str:
    """A number as it stands in a name: thirds, of twelve digits, by three of them."""
    return text if len(text) <= LONGEST else f"{float(text):.3g}"


def _told(numbers: list[float]) -> str:
    return ",".join(f"{number:.12g}" for number in (numbers if len(set(numbers)) > 1 else numbers[:1]))
