"""Tables that were learned elsewhere: states and actions by name, and no environment to learn another task in."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Never, Self

from qinit_cli.environments.bases import NeutralFamily
from qinit_cli.errors import NotAllowed
from qinit_cli.learning import Learning
from qinit_cli.options import check, option
from qinit_cli.rewards import Payment, ReturnBounds
from qinit_store.wording import as_name

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Tasks
    from qinit_store.schema import Axis, Column

REMEDY = "take a start table to your own agent with qinit start METHOD FIT -o start.npz"
AXIS = re.compile(r"[a-z][a-z0-9_]{0,63}")  # as the store names axes
EACH = ":"  # between the coordinates of an axis


@dataclass(frozen=True)
class ImportedTables(NeutralFamily):
    """The distribution behind imported tables, of which only the layout is known."""

    title: str = option("tables", "What the distribution is called.")
    states: list[str] = option(
        (), "State axes, NAME=LENGTH or NAME=X:X:... with a coordinate for each entry."
    )
    moves: list[str] = option((), "The actions' names.")
    returns: str | None = option(None, "The least and the largest discounted return, LOW:HIGH; None: 0 to 1.")

    name: ClassVar[str] = "imported"

    def __post_init__(self) -> None:
        check(self)
        for name in ("states", "moves"):
            given = getattr(self, name)
            object.__setattr__(self, name, (given,) if isinstance(given, str) else tuple(given))
        if bool(self.states) != bool(self.moves):
            raise ValueError("imported tables have at least one state axis and one action")
        if odd := [name for name in self.moves if not name.isascii()]:
            raise ValueError(f"the action {odd[0]!r} is no ASCII text; name it otherwise")
        if len(set(self.moves)) < len(self.moves):
            raise ValueError(f"the actions {', '.join(self.moves)} are not distinct")
        names = [name for name, _ in map(axis_told, self.states)]
        if len(set(names)) < len(names):
            raise ValueError(f"the state axes {', '.join(names)} are not distinct")
        if self.returns is not None:
            ReturnBounds.read(self.returns)

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        return f"{self.name}-{as_name(self.title)}".rstrip("-.")

    @property
    def untabled(self) -> str:
        """Why there are no exact tables."""
        return f"{self.label} was learned elsewhere, and has no environment here"

    @property
    def actions(self) -> tuple[str, ...]:  # type: ignore[override]  # of the tables
        """The actions' names."""
        return tuple(self.moves)

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: coordinates, or places counted from 0."""
        import numpy as np

        from qinit_store.schema import Axis

        return tuple(Axis(name, np.array(values), "1", name) for name, values in map(axis_told, self.states))

    def payment(self, gamma: float) -> Payment | None:
        """What steps pay is unknown; the bounds are those of --returns, None: a reward of 1 at the goal."""
        return None if self.returns is None else Payment(ReturnBounds.read(self.returns), None, 0.0)

    def shifted(self, changes: dict[str, Any]) -> Self:
        """ValueError: there is no environment to change."""
        raise ValueError(self._why)

    def refusal(self, learning: Learning) -> str:
        """Why no task can be learned."""
        return self._why

    def parameters(self) -> tuple[Column, ...]:
        """Nothing: what the tasks were drawn as is unknown."""
        return ()

    def draw(self, rng: np.random.Generator) -> tuple[Any, ...]:
        """NotAllowed, as all that takes an environment."""
        self._refuse()

    def start_value(self, q: Floats) -> Floats:
        """NotAllowed: where targets start is unknown."""
        self._refuse()

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """NotAllowed: where steps lead is unknown."""
        self._refuse()

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """NotAllowed, as `path_lengths`."""
        self._refuse()

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task can be solved is unknown: none is left out, (B,)."""
        import numpy as np

        return np.ones(len(tasks), np.bool_)

    @property
    def _why(self) -> str:
        return f"{self.untabled}; {REMEDY}"

    def _refuse(self) -> Never:
        raise NotAllowed(self._why)


def axis_text(name: str, values: Sequence[float]) -> str:
    """The inverse of `axis_told`."""
    if list(values) == list(range(len(values))):
        return f"{name}={len(values)}"
    return f"{name}={EACH.join(repr(float(value)) for value in values)}"


def axis_told(text: str) -> tuple[str, list[int] | list[float]]:
    """The name and the coordinates in NAME=LENGTH or NAME=X:X:...; ValueError for any other."""
    name, equals, told = text.partition("=")
    parts = told.split(EACH)
    try:
        values = [float(part) for part in parts]
    except ValueError:
        values = []
    counted = len(values) == 1 and parts[0].strip().isdigit()
    if equals and not AXIS.fullmatch(name):
        raise ValueError(
            f"the state axis {name!r} is no name: small letters, digits and _; name it otherwise"
        )
    fits = equals and values and all(map(math.isfinite, values)) and sorted(set(values)) == values
    if not fits or (counted and values[0] < 1):
        raise ValueError(
            f"the state axis {text!r} is neither NAME=LENGTH nor NAME=X:X:... with ascending coordinates"
        )
    if counted:
        return name, list(range(int(values[0])))
    return name, [int(value) for value in values] if all(map(float.is_integer, values)) else values
