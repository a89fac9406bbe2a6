"""The gridworld whose goal changes from task to task; section 7.1 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.environments.normal_goals import NormalGoals
from qinit_cli.environments.slippery_grid import START, SlipperyGrid
from qinit_cli.options import check, option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats


@dataclass(frozen=True)
class Gridworld(SlipperyGrid):
    """A square grid with slippery moves; the goal and the slip change from task to task (section 7.1)."""

    size: int = option(30, "Cells along each side.", low=2, high=1000)
    goals: Literal["normal", "uniform"] = option(
        "normal", "How goals are drawn: around a mean, or uniformly over the cells but the target start."
    )
    mean: float | None = option(
        None, "Mean of the goal's row and column.", default_text="2/3 of the size", low=0
    )
    variance: float | None = option(
        None,
        "Variance of the goal's row and column; the paper's are 1, 3, 5, 7, 10.",
        default_text="7",
        low=0,
    )
    p_low: float = option(0.6, "Lowest probability that a move goes where it was meant to.", low=0.25, high=1)
    p_high: float = option(0.9, "Highest such probability; each task draws its own.", low=0.25, high=1)
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "gridworld"

    def __post_init__(self) -> None:
        if self.goals == "uniform":
            for name in ("mean", "variance"):
                if getattr(self, name) is not None:
                    raise ValueError(f"--{name} belongs to normal goals; with --goals uniform leave it out")
        elif self.goals == "normal":
            if self.mean is None:
                object.__setattr__(self, "mean", 2 * self.size / 3)
            if self.variance is None:
                object.__setattr__(self, "variance", 7.0)
        check(self)
        self._check_slip()
        if self.goals == "normal":
            self._normal()

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        goals = "uniform" if self.goals == "uniform" else f"variance-{self.variance:g}"
        mean = "" if self.mean is None or self.mean == 2 * self.size / 3 else f"-mean-{self.mean:g}"
        return self._label(f"{goals}{mean}")

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The target start, the middle of the goals and the far corner; Figure 5 of the paper."""
        far = self.size - 1.0
        middle = min(float(round(2 * self.size / 3 if self.mean is None else self.mean)), far)
        return (0.0, 0.0), (middle, middle), (far, far)

    def goal_chances(self) -> Floats:
        """How likely each cell is to be a task's goal, (S,)."""
        import numpy as np

        if self.goals == "normal":
            return self._normal().probabilities()
        probabilities = np.full(self.size**2, 1 / (self.size**2 - 1))
        probabilities[START] = 0.0
        return probabilities

    def shifted(self, changes: dict[str, Any]) -> Gridworld:
        """The family with some fields changed; what belongs to the old kind of goals alone is dropped with it."""
        kept = {} if changes.get("goals", self.goals) == self.goals else {"mean": None, "variance": None}
        return super().shifted(kept | changes)

    def draw(self, rng: np.random.Generator) -> tuple[int, int, float]:
        """One task: goal row, goal column and p. The target start (0, 0) is never a goal."""
        row, column = self._normal().draw(rng) if self.goals == "normal" else self._uniform(rng)
        return row, column, self._slip(rng)

    def _normal(self) -> NormalGoals:
        mean = self.mean or 0.0
        return NormalGoals(self.size, mean, mean, self.variance or 0.0)

    def _uniform(self, rng: np.random.Generator) -> tuple[int, int]:
        row, column = 0, 0
        while (row, column) == (0, 0):
            row, column = (int(cell) for cell in rng.integers(self.size, size=2))
        return row, column
