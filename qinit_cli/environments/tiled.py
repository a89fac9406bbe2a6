"""A family whose values are linear in the tiles of its continuous state: its "states" are probes, the same for all tasks."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.bases import JUDGED, LIKELY
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learners.exploration import Ucb
from qinit_cli.options import check, option
from qinit_cli.schedules import ByVisits
from qinit_cli.tile_coding import TileCoding

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.kernels.tiles import TiledWorlds
    from qinit_cli.learning import Learning
    from qinit_cli.projection import Projection
    from qinit_store.schema import Axis

# columns of their states, of what tasks learn, and of the values that a start's weights have there
PROBES, WEIGHTS, PROJECTED = "probes", "weights", "projected"
DIVERGED = 100.0  # widths of the attainable return: values beyond are no estimate of any return


@dataclass(frozen=True)
class Tiles:
    """How a value function is tiled, and where it is looked at."""

    tilings: int = option(8, "Grids of tiles, each shifted by another part of a tile.", low=1, high=64)
    tiles: int = option(8, "Tiles of a grid along each dimension.", low=1, high=1000)
    probes: int = option(
        4096,
        "States at which the values of all tasks are kept, fitted and started from.",
        low=16,
        high=1_000_000,
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class TiledFamily:
    """A family of continuous states, learned by tiles; whatever is not told here is the family's own.

    A table of it is over P probes. `at` are their states (P, D), the first where targets start; they belong to the sources
    (pipeline.probes) and travel in artefacts. UsageError for a family without continuous states. `coding` raises NotAllowed
    for too many tiles; it may ask an environment for its box, which constructing the family does not.
    """

    # a Family with `box`, `target_state` and `continuous` worlds; also with `greedy_episodes` if its steps are Python's, where
    # no state can be chosen
    family: Any
    cut: Tiles
    at: Floats | None = field(default=None, compare=False, repr=False)

    tabular: ClassVar[bool] = False
    counted: ClassVar[bool] = False  # a weight belongs to many states

    def __post_init__(self) -> None:
        if not hasattr(self.family, "box"):
            raise UsageError(
                f"{self.family.name} has no continuous states, and --representation tiles is of those; leave it out"
            )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "family":  # while it is copied it has none
            raise AttributeError(name)
        return getattr(self.family, name)

    @cached_property
    def coding(self) -> TileCoding:
        """The tiles over the family's box; UsageError where an environment has none, NotAllowed for too many."""
        box = self.family.box()
        low, high = (tuple(float(one[place]) for one in box) for place in (1, 2))
        return TileCoding(low, high, self.cut.tilings, self.cut.tiles)

    @cached_property
    def projection(self) -> Projection:
        """Between values at the probes and weights; ValueError where the probes are unknown."""
        from qinit_cli.projection import Projection

        if self.at is None:
            raise ValueError(f"the probes of {self.label} are unknown; they stand in its sources")
        return Projection(self.coding, self.at)

    def placed(self, at: Floats | None) -> Any:
        """The family with its probes there."""
        return dataclasses.replace(self, at=at)

    @property
    def label(self) -> str:
        """The family's, and how it is tiled."""
        return f"{self.family.label}-tiles-{self.cut.tilings}x{self.cut.tiles}"

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of probes."""
        return (self.cut.probes,)

    def axes(self) -> tuple[Axis, ...]:
        """The probes, counted from 0."""
        import numpy as np

        from qinit_store.schema import Axis

        return (Axis("probe", np.arange(self.cut.probes), "1", "index of the probe state"),)

    def covers(self) -> tuple[tuple[float, float], ...]:
        """The box, from low to high along each dimension of a state."""
        return tuple(zip(self.coding.low, self.coding.high, strict=True))

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The target start and two probes more."""
        return tuple((float(place),) for place in (0, self.cut.probes // 2, self.cut.probes - 1))

    def goal_chances(self) -> Floats:
        """Zeros, (P,): a goal is no probe."""
        import numpy as np

        return np.zeros(self.cut.probes)

    def closed(self) -> Mapping[str, Flags]:
        """Nothing: all probes are open."""
        return {}

    @property
    def untabled(self) -> str:
        """Why there are no exact tables."""
        return f"{self.family.name} by tiles has no table"

    def opened(self) -> Self:
        """With the family opened."""
        return dataclasses.replace(self, family=self.family.opened())

    def shifted(self, changes: dict[str, Any]) -> Self:
        """With the family shifted; ValueError where its states would be others."""
        changed = dataclasses.replace(self, family=self.family.shifted(changes))
        if changed.coding != self.coding:
            raise ValueError(
                f"the tiles are over {self.family.box()}, with that change {changed.family.box()}"
            )
        return changed

    def holding_out(self, targets: str | None, *, allow_overlap: bool) -> Self:
        """With the tasks of the family's file held out."""
        return dataclasses.replace(self, family=self.family.holding_out(targets, allow_overlap=allow_overlap))

    def refusal(self, learning: Learning) -> str:
        """Why its tasks cannot be learned so; empty if they can."""
        if not learning.learner.sums:
            return (
                f"--learner {learning.learner} keeps what belongs to a state of a table; by tiles learn with q-learning, "
                "sarsa, expected-sarsa, q-lambda or sarsa-lambda"
            )
        if isinstance(learning.alpha, ByVisits):
            return f"--alpha {learning.alpha} counts updates of a state of a table, which tiles have not; give a number"
        if isinstance(learning.explore, Ucb):
            return f"--explore {learning.explore} counts visits of a state of a table, which tiles have not"
        _ = self.coding  # says so itself if there is none
        refusal: str = self.family.refusal(learning)
        return refusal

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> TiledWorlds:
        """The tasks as the compiled loop takes them."""
        from qinit_cli.kernels.python_steps import TiledPythonWorlds
        from qinit_cli.kernels.tiles import TiledWorlds

        made = TiledPythonWorlds if self._played else TiledWorlds
        return made(self.family.worlds(tasks, own), self.coding)

    def to_weights(self, table: Floats) -> Floats:
        """The weights (..., T, A) that come nearest to a table (..., P, A)."""
        return self.projection.weights(table)

    def kept(self, weights: Floats) -> dict[str, Floats]:
        """The weights (B, T, A) and their values at the probes."""
        return {"q": self.projection.values(weights), WEIGHTS: weights}

    def check_learned(self, weights: Floats, width: float) -> None:
        """NotAllowed where learning has diverged: weights (B, T, A) that are no numbers, or values far beyond any return."""
        import numpy as np

        largest = np.abs(weights).max(axis=(1, 2), initial=0.0) * self.cut.tilings
        sound = largest <= DIVERGED * width  # NaN is not
        if not sound.all():
            raise NotAllowed(
                f"learning diverged: values of up to {largest[~sound][0]:g} where returns span {width:g}; "
                "lower --alpha, or learn by sarsa"
            )

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, P, A) at the first probe, where targets start, (B,)."""
        values: Floats = q[:, 0].max(axis=1)
        return values

    def start_values(self, tasks: Tasks, q: Floats) -> Floats:
        """`start_value`."""
        return self.start_value(q)

    def path_lengths(self, tasks: Tasks, weights: Floats, horizon: int) -> NDArray[np.int32]:
        """Steps of the greedy path from each probe by each action first, without noise, (B, P, A); -1 where it does not arrive.

        -1 throughout, for unknown, where steps are Python's.
        """
        import numpy as np

        if self._played:
            return np.full((*weights.shape[:1], *self.shape, weights.shape[2]), -1, np.int32)
        from qinit_cli.kernels.tile_paths import path_lengths

        return path_lengths(*self._alone(tasks), weights, self.projection.probes, horizon)

    def solved(self, tasks: Tasks, weights: Floats, horizon: int) -> Flags:
        """Whether at least every other of 10 greedy episodes from where targets start reaches the goal, (B,); noise included."""
        import numpy as np

        if self._played:
            reached = [[goal for _, goal in each] for each in self._episodes(tasks, weights, horizon, JUDGED)]
            return np.array([np.mean(each) for each in reached], np.float64) >= LIKELY
        from qinit_cli.kernels.tile_paths import greedy_paths

        arrived = np.zeros(len(tasks))
        for episode in range(JUDGED):
            _, steps = greedy_paths(*self._alone(tasks, episode), weights, horizon, anywhere=False)
            arrived += steps > 0
        likely: Flags = arrived >= LIKELY * JUDGED
        return likely

    def visited(self, tasks: Tasks, weights: Floats, horizon: int, paths: int) -> Floats:
        """The states on so many greedy paths of each task, (N, D).

        One begins where targets start, and the others anywhere; all of them where targets start if no state can be chosen.
        """
        import numpy as np

        if self._played:
            played = self._episodes(tasks, weights, horizon, paths)
            return np.concatenate([states for each in played for states, _ in each])
        from qinit_cli.kernels.tile_paths import greedy_paths

        again = np.repeat(np.arange(len(tasks)), paths - 1)
        first, _ = greedy_paths(*self._alone(tasks), weights, horizon, anywhere=False)
        worlds, rng = self._alone(tasks[again], np.arange(1, len(again) + 1))  # each begins elsewhere
        others, _ = greedy_paths(worlds, rng, weights[again], horizon, anywhere=True)
        states = np.concatenate([each.reshape(-1, each.shape[-1]) for each in (first, others)])
        on_the_way: Floats = states[np.isfinite(states).all(axis=1)]  # NaN once a path is over
        return on_the_way

    @property
    def _played(self) -> bool:
        """Whether steps are Python's."""
        return hasattr(self.family, "greedy_episodes")

    def _episodes(
        self, tasks: Tasks, weights: Floats, horizon: int, episodes: int
    ) -> Iterator[list[tuple[Floats, bool]]]:
        """Of each task so many greedy episodes: the states that were met, (steps, D), and whether the goal was reached."""
        for task, own in zip(tasks, weights, strict=True):
            yield self.family.greedy_episodes(task, partial(self._greedy, own), horizon, episodes)

    def _greedy(self, weights: Floats, state: Floats) -> int:
        """The first of the actions whose weights, those of the active tiles, sum up to most."""
        return int(weights[self.coding.active(state[None])[0]].sum(axis=0).argmax())

    def _alone(self, tasks: Tasks, numbers: Integers | int = 0) -> tuple[TiledWorlds, Any]:
        """The worlds of some tasks and the draws of a path in each, by its seed, whatever the task learned from."""
        import numpy as np

        from qinit_cli.kernels.random_streams import seeds

        streams = [np.random.SeedSequence(seed) for seed in np.broadcast_to(numbers, len(tasks)).tolist()]
        return self.worlds(tasks, streams), seeds(streams)

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """NotAllowed: there are no exact values."""
        raise NotAllowed(f"{self.untabled}: there are no exact values; learn it by q-learning")

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """NotAllowed, as `solve`."""
        raise NotAllowed(f"{self.untabled}: the value of a policy on it is not defined")

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """NotAllowed: a path meets no probe."""
        raise NotAllowed(f"{self.untabled}, and a path meets no state of one; occupancy is of tables")

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """NotAllowed: the theory is of tables."""
        raise NotAllowed(f"{self.untabled}, and the theory of path lengths is of tables; leave it out")

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """NotAllowed: the distances are of tables."""
        raise NotAllowed(f"{self.untabled}, and drs shapes by distances of tables; choose another method")
