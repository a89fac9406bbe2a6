"""Families whose state is a point of several dimensions, which a table sees by bins: what follows from the world and its box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.bases import JUDGED, LIKELY, NeutralFamily
from qinit_cli.environments.physical_parameters import PhysicalParameter
from qinit_cli.environments.varied_values import VariedValues
from qinit_cli.options import options
from qinit_store.wording import as_name, counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.kernels.continuous import Binned, ContinuousWorlds
    from qinit_cli.kernels.parts import Function
    from qinit_store.schema import Axis, Column

MOST_BINS = 1_000_000  # of a table; the paths from all their centres are followed
BINS = "Bins along each dimension of the table: one number, or one for each."  # a help text


class ContinuousFamily(NeutralFamily):
    """A family whose world is a class of kernels.continuous; subclasses say parameters, draw, box, continuous_world and starts.

    A subclass is a frozen dataclass with an option `bins`, and has `name`, `actions` and the defaults of learning.
    """

    bins: str | None  # N or N,N,...; None only until the usual ones are filled in
    usual_bins: ClassVar[str]
    # targets start uniformly within it of `target_state`, in every dimension
    start_spread: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        counts = self.bin_counts
        # what means the same is stored the same, whichever way it was written
        same = len(set(counts)) == 1
        object.__setattr__(self, "bins", str(counts[0]) if same else ",".join(map(str, counts)))

    def box(self) -> tuple[tuple[str, float, float], ...]:
        """Name, low and high of each dimension of the continuous state; beyond them it counts as at the edge."""
        raise NotImplementedError

    def continuous_world(self, tasks: Tasks, rng_words: NDArray[np.uint64]) -> Any:
        """The tasks as a world of kernels.continuous, its lanes not yet allocated.

        `rng_words` (B, 4) are the first states of the streams that its steps draw from, for a world that draws beforehand.
        """
        raise NotImplementedError

    def target_state(self) -> tuple[float, ...]:
        """Where targets start; the mean of that where it is drawn."""
        raise NotImplementedError

    @property
    def label(self) -> str:
        """The name, with the options that are not at their default."""
        usual = self._usual()
        told = [
            f"{field.name.replace('_', '-')}-{value}"
            for field in options(type(self))
            if (value := getattr(self, field.name)) != usual.get(field.name, field.default)
        ]
        return as_name("-".join([self.name, *told]))

    @property
    def bin_counts(self) -> tuple[int, ...]:
        """Bins along each dimension."""
        return self._counts(self.usual_bins if self.bins is None else self.bins)

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths."""
        return self.bin_counts

    def axes(self) -> tuple[Axis, ...]:
        """The dimensions, by their bins' centres."""
        import numpy as np

        from qinit_store.schema import Axis

        return tuple(
            Axis(
                name,
                low + (np.arange(count) + 0.5) * ((high - low) / count),
                "1",
                f"{name} at the bin's centre",
            )
            for (name, low, high), count in zip(self.box(), self.bin_counts, strict=True)
        )

    def covers(self) -> tuple[tuple[float, float], ...]:
        """The box, from low to high along each dimension."""
        return tuple((low, high) for _, low, high in self.box())

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The target start, and the middle of the box where that is another bin."""
        middle = tuple((low + high) / 2 for _, low, high in self.box())
        start = self.target_state()
        return (start,) if self._bin(start) == self._bin(middle) else (start, middle)

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError where the bins would be others."""
        changed = super().shifted(changes)
        if changed.box() != self.box():
            raise ValueError(f"{' and '.join(changes)} cannot be shifted: the bins would cover another box")
        return changed

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> ContinuousWorlds:
        """The tasks as the compiled loop takes them."""
        from qinit_cli.kernels.random_streams import seeds

        return self._worlds(tasks, seeds(own))

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) in the bins where targets start, (B,); the mean over them where that is drawn."""
        values: Floats = (q.max(axis=2) * self._starts()).sum(axis=1)
        return values

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Steps to the goal from each bin's centre, (B, S, A): the continuous state, without noise, greedy in `q`.

        0 where the centre is in the goal; -1 where the path ends elsewhere, and beyond the horizon.
        """
        import numpy as np

        from qinit_cli.kernels import continuous_paths as paths

        lengths = np.empty(q.shape, np.int32)
        binned = self._alone(tasks, horizon, noisy=False)
        follow = paths.for_world(paths.path_lengths, binned)
        follow(binned, q.argmax(axis=2), self._centres(), _words(1)[0], horizon, lengths)
        return lengths

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether at least every other of 10 greedy episodes from the target start reaches the goal, (B,); noise included."""
        from qinit_cli.kernels.continuous_paths import arrivals

        return self._likely(arrivals, tasks, horizon, q.argmax(axis=2))

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """How often the greedy path from `target_state`, without noise, is in each bin, (B, S), both its ends included.

        Zeros where it does not arrive within the horizon.
        """
        import numpy as np

        from qinit_cli.kernels import continuous_paths as paths

        visits = np.empty(q.shape[:2], np.int32)
        binned = self._alone(tasks, horizon, noisy=False)
        start = np.array(self.target_state(), np.float64)
        paths.for_world(paths.greedy_visits, binned)(
            binned, q.argmax(axis=2), start, _words(1)[0], horizon, visits
        )
        return visits

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task was solved, or every other of 10 episodes of the world's plain controller reaches the goal, (B,)."""
        from qinit_cli.kernels.continuous_paths import guided_arrivals

        return solved | self._likely(guided_arrivals, tasks, horizon)

    def _likely(self, arrivals: Function, tasks: Tasks, horizon: int, *policy: Integers) -> Flags:
        """Whether at least every other episode arrives, (B,)."""
        import numpy as np

        from qinit_cli.kernels.continuous_paths import for_world

        counts = np.empty(len(tasks), np.int64)
        binned = self._alone(tasks, horizon, noisy=True)
        words = np.tile(_words(JUDGED), (len(tasks), 1, 1))
        for_world(arrivals, binned)(binned, *policy, words, horizon, counts)
        likely: Flags = counts >= LIKELY * JUDGED
        return likely

    def _usual(self) -> dict[str, Any]:
        """What options are unless others are asked for, where None stands for that."""
        return {"bins": self.usual_bins}

    def _corners(self) -> dict[str, Floats]:
        """The box's corners as a world's fields `low` and `high`."""
        import numpy as np

        _, low, high = zip(*self.box(), strict=True)
        return {"low": np.array(low, np.float64), "high": np.array(high, np.float64)}

    def _worlds(self, tasks: Tasks, words: NDArray[np.uint64]) -> ContinuousWorlds:
        from qinit_cli.kernels.continuous import ContinuousWorlds

        _, low, high = zip(*self.box(), strict=True)
        world = self.continuous_world(tasks, words)
        return ContinuousWorlds(world, low, high, self.bin_counts, len(self.actions), words)

    def _alone(self, tasks: Tasks, horizon: int, *, noisy: bool) -> Binned:
        """The world with one lane, in which paths are followed."""
        binned = self._worlds(tasks, _words(len(tasks))).binned(1, horizon)
        if noisy or "noise" not in binned.world._fields:
            return binned
        return binned._replace(world=binned.world._replace(noise=0.0))

    def _starts(self) -> Floats:
        """The probability that a target's episode starts in each bin, (S,)."""
        import numpy as np

        shares = np.ones(1)
        for (_, low, high), count, at in zip(self.box(), self.bin_counts, self.target_state(), strict=True):
            edges = low + np.arange(count + 1) * ((high - low) / count)
            edges[0], edges[-1] = -math.inf, math.inf  # what lies beyond the box counts in the outermost bins
            if self.start_spread:
                below = np.clip((edges - at) / self.start_spread / 2 + 0.5, 0.0, 1.0)
                along: Floats = np.diff(below)
            else:
                along = ((edges[:-1] <= at) & (at < edges[1:])).astype(np.float64)
            shares = np.multiply.outer(shares, along).ravel()
        return shares

    def _centres(self) -> Floats:
        """The bins' centres, (S, D)."""
        import numpy as np

        along = np.meshgrid(*(axis.values for axis in self.axes()), indexing="ij")
        return np.stack(along, axis=-1).reshape(-1, len(along)).astype(np.float64)

    def _bin(self, state: Sequence[float]) -> int:
        """The number of the bin that a state is in."""
        number = 0
        for (_, low, high), count, at in zip(self.box(), self.bin_counts, state, strict=True):
            number = number * count + min(max(int((at - low) * (count / (high - low))), 0), count - 1)
        return number

    def _counts(self, text: str) -> tuple[int, ...]:
        """The bins along each dimension in N or N,N,...; ValueError where there are none."""
        names = [name for name, _, _ in self.box()]
        told = f"--bins {text}"
        parts = text.split(",")
        if not all(part.strip().isdecimal() and int(part) > 0 for part in parts) or len(parts) not in (
            1,
            len(names),
        ):
            raise ValueError(
                f"{told}: {self.name} has {counted(len(names), 'dimension')}, {', '.join(names)}; give one whole number "
                "above 0, or one for each"
            )
        counts = tuple(map(int, parts))
        counts = counts * len(names) if len(counts) == 1 else counts
        if (bins := math.prod(counts)) > MOST_BINS:
            raise ValueError(
                f"{told}: these are {bins:,} bins, and a table has {MOST_BINS:,} at most; give fewer"
            )
        return counts


class PhysicalFamily(ContinuousFamily):
    """A continuous family each of whose parameters is fixed or drawn, by the option of its name; its steps are certain."""

    physical: ClassVar[tuple[PhysicalParameter, ...]]

    def __post_init__(self) -> None:
        super().__post_init__()
        for each in self.physical:
            each.read(getattr(self, each.name))

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; empty if nothing."""
        if all(low == high for low, high in (each.bounds for each in self._values())):
            return (
                "no parameter varies, and all tasks are the same: there is no distribution to transfer from"
            )
        return ""

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of, what is the same for all of them included."""
        return tuple(each.column(getattr(self, each.name)) for each in self.physical)

    def draw(self, rng: np.random.Generator) -> tuple[float, ...]:
        """One task: a value for each parameter."""
        return tuple(float(each.draw(rng, 0, "source")) for each in self._values())

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """0, (1, 1, 1): given the task every step is certain."""
        import numpy as np

        return np.zeros((1, 1, 1))

    def _parameters(self, tasks: Tasks) -> dict[str, Floats]:
        """The drawn values as a world's fields, (B,) each."""
        return {each.name: tasks[each.name].copy() for each in self.physical}

    def _values(self) -> list[VariedValues]:
        return [each.read(getattr(self, each.name)) for each in self.physical]


def _words(count: int) -> NDArray[np.uint64]:
    """First states of streams that are the same in every process, (count, 4)."""
    import numpy as np

    from qinit_cli.kernels.random_streams import seeds

    return seeds([np.random.SeedSequence(place) for place in range(count)])
