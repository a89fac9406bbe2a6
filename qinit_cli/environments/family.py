"""What every family of tasks offers: a frozen description of a distribution, from which a task is one draw.

Families are dataclasses whose fields are the options of `qinit train-sources FAMILY` and what is stored. They import numpy and
the compiled kernels inside methods only, so that help stays fast.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, Self

from qinit_cli.errors import UsageError
from qinit_cli.learning import Learning
from qinit_cli.rewards import UNIT, Payment, ReturnBounds
from qinit_cli.seeding import Stream, generator

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.kernels.batch import Worlds
    from qinit_store.schema import Axis, Column

Role = Literal["source", "target"]


class Family(Protocol):
    """A distribution of tasks over one state-action space with a terminal goal."""

    name: ClassVar[str]
    source_tasks: ClassVar[int]  # unless told otherwise; 0: all that are available
    target_tasks: ClassVar[int]
    source_learning: ClassVar[Learning]
    target_learning: ClassVar[Learning]

    def __init__(self, **settings: Any) -> None: ...

    @property
    def actions(self) -> tuple[str, ...]:
        """The actions' names."""
        ...

    @property
    def counted(self) -> bool:
        """Whether visits and squared TD errors are counted by state-action."""
        ...

    @property
    def tabular(self) -> bool:
        """Whether it is Markov in its table's states: exact tables exist."""
        ...

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        ...

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths; S is their product."""
        ...

    def axes(self) -> tuple[Axis, ...]:
        """The state axes."""
        ...

    def covers(self) -> tuple[tuple[float, float], ...]:
        """What each state axis covers, from low to high, in bins of one width; NaN where that is unknown."""
        ...

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The states whose values a picture shows unless told otherwise: a coordinate on each state axis."""
        ...

    def goal_chances(self) -> Floats:
        """How likely each state is to be a task's goal, (S,); zeros where all tasks share one goal."""
        ...

    def closed(self) -> Mapping[str, Flags]:
        """The states that no episode is in, (S,), by what stands there, "wall" or "hole"; empty where all are open."""
        ...

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: one column each."""
        ...

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError where tables of this family would not fit."""
        ...

    def opened(self) -> Family:
        """The family once modules that it names are imported and files read; else itself. UsageError, NotAllowed if not."""
        ...

    @property
    def present(self) -> bool:
        """Whether tasks can be made here: the files that they stand in are there."""
        ...

    def holding_out(self, targets: str | None, *, allow_overlap: bool) -> Self:
        """The family with the tasks of its file that `targets` names as targets; UsageError for one that draws its tasks."""
        ...

    def available(self, role: Role) -> int | None:
        """How many tasks there are; None: any number."""
        ...

    def draw(self, rng: np.random.Generator) -> tuple[Any, ...]:
        """One task: a value for each parameter."""
        ...

    def task(self, index: int, role: Role, rng: np.random.Generator) -> tuple[Any, ...]:
        """The index-th source or target: `draw(rng)`, unless tasks are taken from a list. `rng` is the task's own."""
        ...

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; empty if nothing."""
        ...

    @property
    def untabled(self) -> str:
        """Why there are no exact tables; empty if there are."""
        ...

    def ends(self) -> dict[str, Any]:
        """Which ends are the goal, if settings decide that: `goal` in words, and further entries; else empty.

        The summary of train-sources prints `goal`, its --json holds all entries.
        """
        ...

    def refusal(self, learning: Learning) -> str:
        """Why its tasks cannot be learned so; empty if they can."""
        ...

    def payment(self, gamma: float) -> Payment | None:
        """What steps pay, and the bounds of the return with the discount gamma; None: 1 on reaching the goal."""
        ...

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> Worlds:
        """The tasks as the family's compiled loop takes them.

        `own` has a stream for each, for what a world draws beyond the slips of its steps.
        """
        ...

    def to_weights(self, table: Floats) -> Floats:
        """What the loop learns in the place of a table (..., S, A) of values: that table, or weights (..., T, A)."""
        ...

    def kept(self, weights: Floats) -> dict[str, Floats]:
        """What sources keep of learned weights (B, T, A), by the names of columns: `q` (B, S, A), and what else there is."""
        ...

    def check_learned(self, weights: Floats, width: float) -> None:
        """NotAllowed where weights (B, T, A) are no estimate of returns that span `width`: learning diverged."""
        ...

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """Exact Q* and the variance of a step's target under it, (B, S, A) each; NotAllowed if not tabular."""
        ...

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """What acting epsilon-greedily on `q` (B, S, A) is worth from the target start, (B,); NotAllowed if not tabular."""
        ...

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at the target start, (B,)."""
        ...

    def start_values(self, tasks: Tasks, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) where targets of each task start, (B,): `start_value`, unless tasks differ in that."""
        ...

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Expected optimal path lengths, (B, S, A), -1 where a path never arrives; definition 1 of the paper.

        `q` is what was learned, here and in `solved`: weights (B, T, A) where these are no table.
        """
        ...

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """ln of the probability that each step of a path goes where it most likely goes, or what stretches to that.

        `lengths` (B, S, A) are the paths'; values of lengths below 1 are undefined. NotAllowed where paths have no probability.
        """
        ...

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether the path greedy in `q` (B, S, A) from the target start reaches the goal within the horizon, (B,)."""
        ...

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """How often the path greedy in `q` (B, S, A) from the target start is in each state, (B, S), both its ends included.

        The path of `solved`: zeros where it does not arrive. NotAllowed where paths cannot be followed.
        """
        ...

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task can be solved at all, (B,), given which were: those that cannot teach nothing."""
        ...

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """How near each state is to the goal by a plain distance, 0 to 1, (S,), or (B, S) where goals differ."""
        ...


def is_in_python(family: Family) -> bool:
    """Whether its tasks are stepped in Python, where threads wait for each other: a family whose `in_python` says so.

    It has `beyond_bounds` too, a Counter of what a process observes beyond an environment's bounds, by dimension.
    """
    return bool(getattr(family, "in_python", False))


def draw_tasks(family: Family, seed: int, stream: Stream, indices: Integers | Sequence[int]) -> Tasks:
    """The tasks at these indices of a stream, (B,), one field per parameter, by `family.task`."""
    import numpy as np

    dtype = np.dtype([(column.name, column.dtype) for column in family.parameters()])
    role: Role = "target" if stream is Stream.TARGET_TASK else "source"
    drawn = [family.task(int(index), role, generator(seed, stream, int(index))) for index in indices]
    return np.array(drawn, dtype=dtype)


def task_count(family: Family, role: Role, asked: int | None) -> int:
    """How many tasks are learned: as many as asked, else all that are listed or as the family has it; UsageError for more."""
    there = family.available(role)
    usual = family.source_tasks if role == "source" else family.target_tasks
    count = asked or (usual if there is None else there)
    if there is not None and count > there:
        raise UsageError(f"--tasks is {count}, and {family.label} has {there} {role}s; ask for fewer")
    if not count:
        raise UsageError(
            f"the file of {family.label} has no {role}s; add rows to it, or mark some as {role} in the column split"
        )
    return count


def bounds_of(family: Family, gamma: float) -> ReturnBounds:
    """The least and the largest return of the family's tasks."""
    paid = family.payment(gamma)
    return UNIT if paid is None else paid.bounds


def relative_error(family: Family, gamma: float, tasks: Tasks, q: Floats) -> Floats:
    """|Q - Q*| / Q* of each entry of `q` (B, S, A) with Q* > 0, NaN elsewhere, (B, S, A); as shares, see rewards.ReturnBounds."""
    import numpy as np

    exact, _ = family.solve(tasks, gamma)
    exact = bounds_of(family, gamma).shares(exact)
    known = exact > 0
    return np.where(known, np.abs(q - exact) / np.where(known, exact, 1.0), np.nan)
