"""A corridor with a door at a place that changes from task to task, and a floor that is more or less slippery."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.plugin import TableFamily, option

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.plugin.kernels import Axis, Column, SteppedWorlds, Tables


@dataclass(frozen=True)
class Corridor(TableFamily):
    """A corridor whose door, and whose slippery floor, change from task to task."""

    length: int = option(20, "Cells of the corridor.", low=4, high=10_000)
    slip: float = option(0.2, "Largest probability that a step goes the other way.", low=0, high=0.5)

    name: ClassVar[str] = "corridor"
    actions: ClassVar[tuple[str, ...]] = ("back", "forth")

    def axes(self) -> tuple[Axis, ...]:
        """The cells."""
        import numpy as np

        from qinit_cli.plugin.kernels import Axis

        return (Axis("cell", np.arange(self.length, dtype=np.int32), "1", "cell of the corridor"),)

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of."""
        from qinit_cli.plugin.kernels import Column

        return (
            Column("door", ("task",), "<i4", "1", "cell of the door", low=1, high=self.length - 1),
            Column(
                "slip",
                ("task",),
                "<f8",
                "1",
                "probability that a step goes the other way",
                low=0,
                high=self.slip,
            ),
        )

    def draw(self, rng: np.random.Generator) -> tuple[int, float]:
        """One task: the door in the farther half, and how slippery the floor is."""
        return int(rng.integers(self.length // 2, self.length)), float(rng.uniform(0, self.slip))

    def tables(self, tasks: Any) -> Tables:
        """Where steps lead: for exact tables, path lengths and whether a task is solved."""
        import numpy as np

        from qinit_cli.plugin.kernels import GOAL, Tables

        cells = np.arange(self.length)
        back, forth = np.maximum(cells - 1, 0), np.minimum(cells + 1, self.length - 1)
        ways = np.stack([[back, forth], [forth, back]], axis=-1).transpose(
            1, 0, 2
        )  # (S, A, O): meant, slipped
        after = np.where(ways == tasks["door"][:, None, None, None], GOAL, ways).astype(np.int32)
        slip = np.broadcast_to(tasks["slip"][:, None, None], after.shape[:3])
        starts = np.broadcast_to(self.starts(), (len(tasks), self.length))
        return Tables(after, np.stack([1 - slip, slip], axis=-1), starts, cells != tasks["door"][:, None])

    def worlds(self, tasks: Any, own: Sequence[np.random.SeedSequence]) -> SteppedWorlds:
        """The tasks for learning: by a step of our own, where `tables(tasks).worlds` would do."""
        from qinit_cli.plugin.kernels import SteppedWorlds, seeds
        from qinit_corridor.kernel import World

        world = World(self.length, tasks["door"].astype("i8"), tasks["slip"].copy())
        return SteppedWorlds(world, self.length, len(self.actions), seeds(own))
