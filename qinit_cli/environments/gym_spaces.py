"""What a first look at an environment finds: its states, numbered or in bins, its actions, and where it cuts episodes off."""

from __future__ import annotations

import math
import operator
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from math import isfinite
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.foreign import Improper
from qinit_cli.environments.gym_episodes import numbered, reset_state, shortest_cut
from qinit_cli.environments.gym_leaves import Leaf, Unsuited, leaves, reader
from qinit_cli.environments.gym_making import has_table, opened, time_limit
from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.environments.gym_tables import read
from qinit_cli.errors import UsageError
from qinit_store.wording import counted, noun

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from qinit_cli.arrays import Floats, Integers

DEFAULT_BINS = 10
UNBOUNDED = 1e6  # a bound beyond it is none
ROUNDED = 1e-4  # of a bin, by which an observation in single precision may miss a bound
MOST = 2**31 - 1  # values of a table: the compiled loop counts states in 32 bits
RESETS = 200  # seeds 0 to 199, whose states are taken for where episodes start


@dataclass(frozen=True)
class Dimension:
    """One number of a state: a whole one from low to high, or anything between them, in so many bins."""

    name: str
    low: float
    high: float
    length: int
    whole: bool
    own: bool  # the bounds are the environment's, not those of --range

    @property
    def covered(self) -> tuple[float, float]:
        """Where the first bin begins and the last one ends; a whole number is the middle of its bin."""
        beyond = 0.5 if self.whole else 0.0
        return self.low - beyond, self.high + beyond

    def values(self) -> NDArray[Any]:
        """The numbers, or the bins' centres, (length,)."""
        import numpy as np

        if self.whole:
            return np.arange(int(self.low), int(self.high) + 1, dtype=np.int32)
        return self.low + (np.arange(self.length) + 0.5) * ((self.high - self.low) / self.length)


@dataclass(frozen=True, eq=False)
class Seen:
    """What a first look at an environment found."""

    shape: tuple[int, ...]
    actions: tuple[str, ...]  # what they are called
    table: bool
    dimensions: tuple[Dimension, ...]  # of a state; none where it is one number, from `first` on
    resets: Integers  # states after RESETS resets
    row: Callable[[Any], list[Any]]  # an observation's numbers
    first: int = 0  # the number of the first state
    beyond: Counter[int] = field(
        default_factory=Counter
    )  # observations beyond the environment's own bounds, by dimension, so far in this process
    limit: int = 0  # steps after which it cuts an episode off, as far as that is known; 0: never
    start: tuple[float, ...] = ()  # means of the dimensions after the resets

    @property
    def states(self) -> int:
        """How many the table has."""
        return math.prod(self.shape)

    @cached_property
    def state(self) -> Callable[[Any], int]:
        """The table's state that an observation is in; beyond the bins, in the last; Improper where there is none."""
        if not self.dimensions:
            return partial(numbered, first=self.first, states=self.states)
        read, careful, bins = self.row, self._careful, self._bins
        if not bins:
            return lambda observation: careful(read(observation))

        def quick(observation: Any) -> int:  # most steps are done with this; its names are local to be so
            row = read(observation)
            state = 0
            for value, (low, span, count, length) in zip(row, bins):  # noqa: B905 strict costs 0.1 microseconds
                place = (value - low) / span * count
                if not 0.0 <= place < count:  # nor where the value is no number
                    return careful(row)
                state = state * length + int(place)
            return state

        return quick

    def write(self, state: Floats, observation: Any) -> int:
        """Writes an observation's numbers f8 (D,), none of them a whole one, and gives 0; Improper where one is not finite."""
        row = self.row(observation)
        for number, (value, dimension) in enumerate(zip(row, self.dimensions, strict=True)):
            if not dimension.low <= value <= dimension.high:  # nor where the value is no number
                self._bin(value, number, dimension)
        state[:] = row
        return 0

    @cached_property
    def _bins(self) -> list[tuple[float, float, float, int]]:
        """Of each dimension where the bins begin, what they cover and how many there are; none if one is of whole numbers."""
        if any(each.whole for each in self.dimensions):
            return []
        return [(each.low, each.high - each.low, float(each.length), each.length) for each in self.dimensions]

    def _careful(self, row: list[Any]) -> int:
        """The state of these numbers, wherever they are; Improper where there is none."""
        state = 0
        for number, (value, dimension) in enumerate(zip(row, self.dimensions, strict=True)):
            place = _numbered if dimension.whole else self._bin
            state = state * dimension.length + place(value, number, dimension)
        return state

    def _bin(self, value: float, number: int, dimension: Dimension) -> int:
        if not isfinite(value):
            raise Improper(
                f"the environment observed {value} in dimension {number}; its observations must be finite"
            )
        bins = dimension.length
        place = (value - dimension.low) / (dimension.high - dimension.low) * bins
        if not -ROUNDED <= place <= bins + ROUNDED and dimension.own:
            self.beyond[number] += 1
        return int(min(max(place, 0), bins - 1))


def _numbered(value: Any, number: int, dimension: Dimension) -> int:
    """The place of a whole number; Improper where it is none, or none of those there are."""
    try:
        place = operator.index(value) - int(dimension.low)
    except TypeError:
        place = -1
    if not 0 <= place < dimension.length:
        bounds = (
            "that its space names"
            if dimension.own
            else f"of --range {number}={dimension.low:g}:{dimension.high:g}"
        )
        raise Improper(
            f"the environment observed {value!r:.40} in dimension {number} ({dimension.name}), which is none of the "
            f"{dimension.length} numbers {bounds}"
        )
    return place


@lru_cache(64)
def seen(recipe: Recipe, bins: str, ranges: tuple[str, ...]) -> Seen:
    """What it finds; UsageError for spaces that do not suit, NotAllowed for a faulty table or unseeded randomness."""
    import numpy as np

    with opened(recipe) as env:
        there = _spaces(recipe, env, bins, ranges)
        if there.table:
            read(recipe)  # before a step fails by what is wrong with it
        rows: list[list[Any]] = []

        def state(observation: Any) -> int:
            if there.dimensions:
                rows.append(there.row(observation))
            return there.state(observation)

        resets = [reset_state(recipe.env_id, env, seed, state) for seed in range(RESETS)]
        limits = [time_limit(env), shortest_cut(recipe)]
    return replace(
        there,
        resets=np.array(resets, np.int64),
        start=tuple(np.mean(rows, axis=0).tolist()) if rows else (),
        limit=min((limit for limit in limits if limit), default=0),
    )


def _spaces(recipe: Recipe, env: Any, bins: str, ranges: tuple[str, ...]) -> Seen:
    import numpy as np

    actions = _actions(recipe, env)
    nothing = np.empty(0, np.int64)
    space = env.observation_space
    if not recipe.state and type(space).__name__ == "Discrete":
        if bins or ranges:
            raise UsageError(f"{recipe} numbers its states; leave out --bins and --range")
        first = int(space.start)
        tabled = has_table(env) and first == 0  # P numbers states from 0 on
        return Seen(_grid(env), actions, tabled, (), nothing, list, first)
    dimensions = _dimensions(recipe, _observed(recipe, env), bins, ranges)
    if (states := math.prod(each.length for each in dimensions)) * len(actions) > MOST:
        raise UsageError(
            f"a table of {recipe} would have {len(dimensions)} dimensions and {_told(states)} states; give fewer --bins, or "
            "the attributes that matter: --state ATTRIBUTE,..."
        )
    row = partial(_all_there, len(dimensions)) if recipe.state else reader(space)
    return Seen(tuple(each.length for each in dimensions), actions, False, dimensions, nothing, row)


def _all_there(length: int, row: list[Any]) -> list[Any]:
    """The numbers of the attributes; Improper where they are more or fewer than at the first look."""
    if len(row) != length:
        raise Improper(
            f"the attributes of --state are {counted(len(row), 'number')}, and were {length} at first"
        )
    return row


def _actions(recipe: Recipe, env: Any) -> tuple[str, ...]:
    """What they are called, by their numbers."""
    from qinit_cli.environments.gym_wrappers import NumberedActions

    if isinstance(env, NumberedActions):
        return env.names
    if (kind := type(env.action_space).__name__) != "Discrete":
        raise UsageError(
            f"{recipe} has actions of the kind {kind}; numbered ones are needed: Discrete, MultiDiscrete, MultiBinary, or a "
            "Tuple or Dict of such"
        )
    return tuple(map(str, range(int(env.action_space.n))))


def _observed(recipe: Recipe, env: Any) -> list[Leaf]:
    """The numbers of which a state is made; UsageError where they are none, or their bounds are unknown."""
    if recipe.state:
        reset_state(recipe.env_id, env, 0, lambda observation: 0)
        found: list[Leaf] = env.get_wrapper_attr("leaves")()
        return found
    try:
        return leaves(env.observation_space)
    except Unsuited as unsuited:
        raise UsageError(
            f"{recipe} observes {unsuited}; what is numbered (Discrete, MultiDiscrete, MultiBinary), a Box, or a Tuple or "
            "Dict of such is needed: give --wrap MODULE:FACTORY, or attributes by --state ATTRIBUTE,..."
        ) from unsuited


def _grid(env: Any) -> tuple[int, ...]:
    """Rows and columns where the environment says them, else the number of states."""
    states = int(env.observation_space.n)
    bare = env.unwrapped
    said: Any = ((getattr(bare, "nrow", 0), getattr(bare, "ncol", 0)), getattr(bare, "shape", ()))
    for sides in said:
        if len(sides) == 2 and sides[0] * sides[1] == states:
            return int(sides[0]), int(sides[1])
    return (states,)


def _dimensions(
    recipe: Recipe, found: list[Leaf], bins: str, ranges: tuple[str, ...]
) -> tuple[Dimension, ...]:
    given = dict(_range(text, len(found)) for text in ranges)
    for place in given:
        if found[place].whole and isfinite(found[place].low):
            raise UsageError(
                f"dimension {place} of {recipe} is numbered from {found[place].low:g} to {found[place].high:g}; leave out "
                f"--range {place}"
            )
    sides = [(*given.get(place, (leaf.low, leaf.high)), leaf) for place, leaf in enumerate(found)]
    _check_bounds(recipe, sides)
    counts = iter(_bins(recipe, bins, sum(not leaf.whole for leaf in found)))
    return tuple(
        Dimension(
            leaf.name,
            low,
            high,
            int(high) - int(low) + 1 if leaf.whole else next(counts),
            leaf.whole,
            place not in given,
        )
        for place, (low, high, leaf) in enumerate(sides)
    )


def _bins(recipe: Recipe, bins: str, dimensions: int) -> tuple[int, ...]:
    texts = bins.split(",") if bins else [str(DEFAULT_BINS)]
    if bins and not dimensions:
        raise UsageError(f"{recipe} numbers its states; leave out --bins")
    if not all(text.strip().isdigit() and int(text) > 0 for text in texts) or len(texts) not in (
        1,
        dimensions,
    ):
        raise UsageError(
            f"--bins {bins}: {recipe} has {counted(dimensions, 'dimension')} that {noun(dimensions, 'is', 'are')} no whole "
            "numbers; give one number, or one for each"
        )
    counts = tuple(int(text) for text in texts)
    return counts * dimensions if len(counts) == 1 else counts


def _range(text: str, dimensions: int) -> tuple[int, tuple[float, float]]:
    """The dimension, and what --range says that it covers."""
    told = re.fullmatch(r"(\d+)=([^:]+):([^:]+)", text)
    try:
        place, low, high = (int(told[1]), float(told[2]), float(told[3])) if told else (-1, 0.0, 0.0)
    except ValueError:
        place, low, high = -1, 0.0, 0.0
    if not (0 <= place < dimensions and low < high):
        raise UsageError(
            f"--range {text}: write DIM=LOW:HIGH, DIM from 0 to {dimensions - 1}, LOW below HIGH"
        )
    return place, (low, high)


def _check_bounds(recipe: Recipe, sides: list[tuple[float, float, Leaf]]) -> None:
    """UsageError where a dimension has no bounds, or a range of whole numbers has others."""
    unbounded = [
        place
        for place, (low, high, _) in enumerate(sides)
        if not (abs(low) < UNBOUNDED and abs(high) < UNBOUNDED)
    ]
    if unbounded:
        dimensions = "dimension" if len(unbounded) == 1 else "dimensions"
        ranges = " ".join(f"--range {place}=LOW:HIGH" for place in unbounded)
        called = [sides[place][2].name for place in unbounded]
        names = "" if called == list(map(str, unbounded)) else f", of {', '.join(called)} in turn"
        raise UsageError(
            f"{recipe} sets no bounds to {dimensions} {' and '.join(map(str, unbounded))} of what it observes; give "
            f"{ranges}{names}"
        )
    for place, (low, high, leaf) in enumerate(sides):
        if leaf.whole and not (low.is_integer() and high.is_integer()):
            raise UsageError(
                f"--range {place}={low:g}:{high:g}: {leaf.name} is a whole number; LOW and HIGH are such numbers, both "
                "included"
            )


def _told(states: int) -> str:
    return str(states) if states < 10**9 else f"10^{len(str(states)) - 1}"
