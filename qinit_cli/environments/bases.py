"""What a family has unless it says otherwise, and families that are given by the transitions of their tasks."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.family import Role
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learning import Learning
from qinit_cli.options import check, options
from qinit_cli.rewards import Payment, exact_returns, exact_variances, payment

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Tasks
    from qinit_cli.kernels.batch import Worlds
    from qinit_cli.kernels.tables import Tables
    from qinit_store.schema import Axis, Column

EXACT_TOLERANCE = 1e-12  # on V
JUDGED = 10  # greedy episodes by which a task without a table is judged
LIKELY = 0.5  # a policy has solved a task that reaches the goal at least so often


class DrawnFamily:
    """What families have in common whose tasks are drawn, each by itself, and start where all start."""

    name: ClassVar[str]
    counted: ClassVar[bool] = True

    def axes(self) -> tuple[Axis, ...]:
        """The state axes."""
        raise NotImplementedError

    def covers(self) -> tuple[tuple[float, float], ...]:
        """What each state axis covers, from low to high, in bins of one width; NaN where that is unknown.

        The labels are the bins' centres: whole numbers reach from half below the least to half above the largest.
        """
        return tuple(_covered(axis.values) for axis in self.axes())

    def draw(self, rng: np.random.Generator) -> tuple[Any, ...]:
        """One task: a value for each parameter."""
        raise NotImplementedError

    def task(self, index: int, role: Role, rng: np.random.Generator) -> tuple[Any, ...]:
        """One draw, whichever task it is."""
        return self.draw(rng)

    def available(self, role: Role) -> int | None:
        """None: any number of tasks is drawn."""
        return None

    def opened(self) -> Self:
        """Itself: it names no module, and no task of it stands in a file."""
        return self

    @property
    def present(self) -> bool:
        """True: no task stands in a file."""
        return True

    def holding_out(self, targets: str | None, *, allow_overlap: bool) -> Self:
        """Itself; UsageError where tasks of a file are asked for."""
        if targets is not None or allow_overlap:
            given = "--targets" if targets is not None else "--allow-overlap"
            raise UsageError(
                f"{self.name} draws its tasks, and {given} is about tasks of a file; leave it out"
            )
        return self

    def to_weights(self, table: Floats) -> Floats:
        """What the loop learns in the place of a table (..., S, A): the table itself."""
        return table

    def kept(self, weights: Floats) -> dict[str, Floats]:
        """What is kept of learned weights (B, S, A), by the names of columns: the table."""
        return {"q": weights}

    def check_learned(self, weights: Floats, width: float) -> None:
        """Nothing: a table does not diverge."""

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at the target start, (B,)."""
        raise NotImplementedError

    def start_values(self, tasks: Tasks, q: Floats) -> Floats:
        """`start_value`: all tasks start there."""
        return self.start_value(q)


class NeutralFamily(DrawnFamily):
    """A family that has no exact tables, no distance and no moving goal; subclasses replace the parts they have.

    A subclass is a frozen dataclass with `name` and `actions`, and has at least axes, parameters, draw, worlds, start_value,
    path_lengths, solved and solvable.
    """

    actions: ClassVar[tuple[str, ...]]
    reward: Any = "goal"  # a class attribute, or an option of the subclass
    tabular: ClassVar[bool] = False
    source_tasks: ClassVar[int] = 100
    target_tasks: ClassVar[int] = 100
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.5, episodes=10_000, horizon=200, start="anywhere"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.1, episodes=1_000, horizon=200, start="fixed"
    )

    def __post_init__(self) -> None:
        check(self)  # type: ignore[arg-type]  # every concrete family is a dataclass

    @property
    def label(self) -> str:
        """The name, with the options that are not at their default."""
        told = [
            f"{field.name.replace('_', '-')}-{getattr(self, field.name)}"
            for field in options(type(self))
            if getattr(self, field.name) != field.default
        ]
        return "-".join([self.name, *told])

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths."""
        return tuple(len(axis.values) for axis in self.axes())

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: one column each."""
        raise NotImplementedError

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The first state, the one in the middle and the last, along every axis."""
        return tuple(
            tuple(float(axis.values[int(at * (len(axis.values) - 1))]) for axis in self.axes())
            for at in (0.0, 0.5, 1.0)
        )

    def goal_chances(self) -> Floats:
        """Zeros, (S,): nothing is known of where goals are."""
        import numpy as np

        return np.zeros(int(np.prod(self.shape)))

    def closed(self) -> Mapping[str, Flags]:
        """Nothing: all states are open."""
        return {}

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError where tables of this family would not fit."""
        changed = dataclasses.replace(self, **changes)  # type: ignore[type-var]  # a dataclass
        if changed.shape != self.shape:
            named = " and ".join(changes)
            raise ValueError(f"the tables have {self.shape} states, with another {named} {changed.shape}")
        return changed

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; nothing."""
        return ""

    @property
    def untabled(self) -> str:
        """Why there are no exact tables; empty if there are."""
        return "" if self.tabular else f"{self.name} is not Markov in its table's states"

    def ends(self) -> dict[str, Any]:
        """Nothing: no setting decides which ends are the goal."""
        return {}

    def refusal(self, learning: Learning) -> str:
        """Why its tasks cannot be learned so: nothing."""
        return ""

    def payment(self, gamma: float) -> Payment | None:
        """What steps pay by the field `reward`; None, 1 on reaching the goal, for a family without one."""
        if self.reward == "native":
            raise ValueError(
                f"{self.name} gives native rewards and no bounds of their returns; override payment"
            )
        return payment(self.reward, gamma)

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> Worlds:
        """The tasks as a compiled loop takes them."""
        raise NotImplementedError

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """NotAllowed: there are no exact tables."""
        raise NotAllowed(f"{self.name} has no exact tables; learn it by q-learning")

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """NotAllowed, as `solve`."""
        raise NotAllowed(f"{self.name} has no exact tables, and the value of a policy on them is not defined")

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """NotAllowed: paths cannot be followed."""
        raise NotAllowed(f"paths of {self.name} cannot be followed without learning; there is no map of them")

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """NotAllowed: the probability of a path is no matter of its length alone."""
        raise NotAllowed(
            f"in {self.name} the probability of a path does not follow from its length; no theory to check"
        )

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """NotAllowed: there is no distance."""
        raise NotAllowed(
            f"{self.name} has no distance to its goal, which drs shapes by; choose another method"
        )


class TableFamily(NeutralFamily):
    """A family whose tasks are tables of transitions: say those in `tables`, and the rest follows, exact tables too."""

    tabular: ClassVar[bool] = True

    def tables(self, tasks: Tasks) -> Tables:
        """Where the steps of each task lead, with what probabilities."""
        raise NotImplementedError

    def starts(self) -> Floats:
        """The probability that a target's episode starts in each state, (S,): the first one."""
        import numpy as np

        first: Floats = np.eye(1, int(np.prod(self.shape)))[0]
        return first

    def _tables(self, tasks: Tasks) -> Tables:
        """`tables`, checked: NotAllowed if they are not of these tasks, states and actions, which kernels take for granted."""
        import math

        there = self.tables(tasks)
        wanted = (len(tasks), math.prod(self.shape), len(self.actions))
        if there.after.shape[:3] != wanted:
            raise NotAllowed(
                f"{self.name} gives tables of {there.after.shape[:3]} tasks, states and actions, where there are {wanted}"
            )
        return there

    def _gains(self, there: Tables, paid: Payment | None, gamma: float) -> Floats | None:
        """The rewards of the tables as shares of the way between the bounds; None where the goal or the step decides them."""
        if paid is None or paid.step is not None:
            return None
        if there.reward is None:
            raise NotAllowed(f"{self.name} has no rewards in its tables, which --reward native asks for")
        return there.gains(paid.bounds, gamma)

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> Worlds:
        """The tasks as the compiled loop takes them."""
        from qinit_cli.kernels.random_streams import seeds

        return self._tables(tasks).worlds(seeds(own))

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """Exact Q* and the variance of a step's target under it, (B, S, A) each; Gauss-Seidel value iteration."""
        import numpy as np

        from qinit_cli.kernels import tables_exact

        there = self._tables(tasks)
        paid = self.payment(gamma)
        gains = self._gains(there, paid, gamma)
        q = np.empty(there.after.shape[:3])
        td_var = np.empty_like(q)
        tables_exact.solve(
            there.after, there.probability, there.open, gains, gamma, EXACT_TOLERANCE, q, td_var
        )
        return exact_returns(paid, gamma, q), exact_variances(paid, gamma, td_var)

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """What acting epsilon-greedily on `q` (B, S, A) is worth from the target start, (B,)."""
        import numpy as np

        from qinit_cli.kernels import tables_exact

        there, paid = self._tables(tasks), self.payment(learning.gamma)
        value = np.empty(q.shape[:2])
        tables_exact.exploring_value(
            there.after,
            there.probability,
            there.open,
            self._gains(there, paid, learning.gamma),
            learning.gamma,
            learning.last_epsilon,
            EXACT_TOLERANCE,
            q,
            value,
        )
        at_start: Floats = (value * there.start).sum(axis=1)
        return exact_returns(paid, learning.gamma, at_start)

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at the target start, (B,); its mean where that is drawn."""
        values: Floats = (q.max(axis=2) * self.starts()).sum(axis=1)
        return values

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Expected optimal path lengths, (B, S, A); definition 1 of the paper, -1 where a path never arrives.

        The likeliest next state may be unlikely, where a step has many outcomes: then a length says little.
        """
        import numpy as np

        from qinit_cli.kernels import tables_exact

        there = self._tables(tasks)
        eopl = np.empty(q.shape, np.int32)
        tables_exact.path_lengths(there.after, there.probability, there.open, q, eopl)
        return eopl

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether greedy episodes from the target start reach the goal at least every other time, (B,)."""
        import numpy as np

        from qinit_cli.kernels import tables_exact

        there = self._tables(tasks)
        share = np.empty(len(tasks))
        tables_exact.arrival(there.after, there.probability, there.start, q, horizon, share)
        likely: Flags = share >= LIKELY
        return likely

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """The states on the way of likeliest steps from the likeliest start, (B, S); zeros where it does not arrive."""
        import numpy as np

        from qinit_cli.kernels import tables_exact

        there = self._tables(tasks)
        visits = np.empty(q.shape[:2], np.int32)
        tables_exact.greedy_visits(there.after, there.probability, there.start, q, horizon, visits)
        return visits

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a way leads from the target start to the goal within the horizon, (B,)."""
        import numpy as np

        from qinit_cli.kernels import tables_exact

        there = self._tables(tasks)
        steps = np.empty(len(tasks), np.int64)
        tables_exact.distances(there.after, there.probability, there.start, steps)
        possible: Flags = (steps > 0) & (steps <= horizon)
        return possible


def _covered(labels: NDArray[Any]) -> tuple[float, float]:
    """Low and high of bins of one width whose centres these are, NaN where there are none; one whole number has the width 1."""
    import numpy as np

    if labels.dtype.kind not in "iuf" or (len(labels) == 1 and labels.dtype.kind == "f"):
        return np.nan, np.nan
    first, last = float(labels[0]), float(labels[-1])
    width = (last - first) / (len(labels) - 1) if len(labels) > 1 else 1.0
    if not np.allclose(np.diff(labels), width, rtol=1e-9, atol=0.0):
        return np.nan, np.nan
    return first - width / 2, last + width / 2
