"""What a first look at an environment finds: its states, numbered or in bins, its actions, and where it cuts episodes off."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.foreign import Improper
from qinit_cli.environments.gym_episodes import numbered, reset_state, shortest_cut
from qinit_cli.environments.gym_making import has_table, opened, time_limit
from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.environments.gym_tables import read
from qinit_cli.errors import UsageError

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers

DEFAULT_BINS = 10
UNBOUNDED = 1e6  # a bound beyond it is none
ROUNDED = 1e-4  # of a bin, by which an observation in single precision may miss a bound
RESETS = 200  # seeds 0 to 199, whose states are taken for where episodes start


@dataclass(frozen=True, eq=False)
class Seen:
    """What a first look at an environment found."""

    shape: tuple[int, ...]
    actions: int
    table: bool
    lows: tuple[float, ...]  # of a Box
    highs: tuple[float, ...]
    resets: Integers  # states after RESETS resets
    first: int = 0  # the number of the first state
    own: tuple[bool, ...] = ()  # whether a dimension's bins cover the environment's own bounds
    beyond: Counter[int] = field(
        default_factory=Counter
    )  # observations beyond those, by dimension, so far in this process
    limit: int = 0  # steps after which it cuts an episode off, as far as that is known; 0: never

    @property
    def states(self) -> int:
        """How many the table has."""
        return math.prod(self.shape)

    def state(self, observation: Any) -> int:
        """The table's state that an observation is in; beyond the bins, in the last; Improper where there is none."""
        if not self.lows:
            return numbered(observation, self.first, self.states)
        state = 0
        sides = zip(_row(observation, len(self.lows)), self.lows, self.highs, self.shape, strict=True)
        for dimension, (value, low, high, bins) in enumerate(sides):
            if not isfinite(value):
                raise Improper(
                    f"the environment observed {value} in dimension {dimension}, which is in no bin; its "
                    "observations must be finite"
                )
            place = (value - low) / (high - low) * bins
            if not -ROUNDED <= place <= bins + ROUNDED and self.own[dimension]:
                self.beyond[dimension] += 1
            state = state * bins + int(min(max(place, 0), bins - 1))
        return state


def _row(observation: Any, length: int) -> list[float]:
    kind = getattr(getattr(observation, "dtype", None), "kind", "O")
    try:  # float() would take text, and the real part of complex numbers
        row = [float(value) for value in observation] if kind in "biufO" else []
    except (TypeError, ValueError):
        row = []
    if len(row) != length:
        raise Improper(f"the environment observed {observation!r:.80}, which is no row of {length} numbers")
    return row


@lru_cache(64)
def seen(recipe: Recipe, bins: str, ranges: tuple[str, ...]) -> Seen:
    """What it finds; UsageError for spaces that do not suit, NotAllowed for a faulty table or unseeded randomness."""
    import numpy as np

    with opened(recipe) as env:
        there = _spaces(recipe.env_id, env, bins, ranges)
        if there.table:
            read(recipe)  # before a step fails by what is wrong with it
        resets = [reset_state(recipe.env_id, env, seed, there.state) for seed in range(RESETS)]
        limits = [time_limit(env), shortest_cut(recipe)]
    return replace(
        there,
        resets=np.array(resets, np.int64),
        limit=min((limit for limit in limits if limit), default=0),
    )


def _spaces(env_id: str, env: Any, bins: str, ranges: tuple[str, ...]) -> Seen:
    import numpy as np

    kinds = env.observation_space, env.action_space
    observed, acted = (type(space).__name__ for space in kinds)
    if acted != "Discrete":
        raise UsageError(f"{env_id} has actions of the kind {acted}; numbered ones (Discrete) are needed")
    if (first_action := int(env.action_space.start)) != 0:
        raise UsageError(
            f"{env_id} numbers its actions from {first_action}; actions numbered from 0 are needed"
        )
    if observed == "Discrete" and (bins or ranges):
        raise UsageError(f"{env_id} numbers its states; leave out --bins and --range")
    lows: tuple[float, ...] = ()
    highs: tuple[float, ...] = ()
    if observed == "Discrete":
        shape = _grid(env)
    elif observed == "Box" and len(env.observation_space.shape) == 1:
        lows, highs = _bounds(env_id, env.observation_space, ranges)
        shape = _bins(env_id, bins, len(lows))
    else:
        raise UsageError(
            f"{env_id} observes a {observed}{getattr(kinds[0], 'shape', None) or ''}; a Discrete or a Box of one row is needed"
        )
    first = 0 if lows else int(env.observation_space.start)
    actions = int(env.action_space.n)
    tabled = has_table(env) and observed == "Discrete" and first == 0  # P numbers states from 0 on
    given = {text.partition("=")[0] for text in ranges}
    own = tuple(str(place) not in given for place in range(len(lows)))
    return Seen(shape, actions, tabled, lows, highs, np.empty(0, np.int64), first, own)


def _grid(env: Any) -> tuple[int, ...]:
    """Rows and columns where the environment says them, else the number of states."""
    states = int(env.observation_space.n)
    bare = env.unwrapped
    said: Any = ((getattr(bare, "nrow", 0), getattr(bare, "ncol", 0)), getattr(bare, "shape", ()))
    for sides in said:
        if len(sides) == 2 and sides[0] * sides[1] == states:
            return int(sides[0]), int(sides[1])
    return (states,)


def _bins(env_id: str, bins: str, dimensions: int) -> tuple[int, ...]:
    texts = bins.split(",") if bins else [str(DEFAULT_BINS)]
    if not all(text.strip().isdigit() and int(text) > 0 for text in texts) or len(texts) not in (
        1,
        dimensions,
    ):
        raise UsageError(
            f"--bins {bins}: {env_id} has {dimensions} dimensions; give one number, or one for each"
        )
    counts = tuple(int(text) for text in texts)
    return counts * dimensions if len(counts) == 1 else counts


def _bounds(env_id: str, space: Any, ranges: tuple[str, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    lows, highs = [float(low) for low in space.low], [float(high) for high in space.high]
    for text in ranges:
        told = re.fullmatch(r"(\d+)=([^:]+):([^:]+)", text)
        try:
            place, low, high = (int(told[1]), float(told[2]), float(told[3])) if told else (-1, 0.0, 0.0)
        except ValueError:
            place, low, high = -1, 0.0, 0.0
        if not (0 <= place < len(lows) and low < high):
            raise UsageError(
                f"--range {text}: write DIM=LOW:HIGH, DIM from 0 to {len(lows) - 1}, LOW below HIGH"
            )
        lows[place], highs[place] = low, high
    unbounded = [
        place
        for place, (low, high) in enumerate(zip(lows, highs, strict=True))
        if not (abs(low) < UNBOUNDED and abs(high) < UNBOUNDED)
    ]
    if unbounded:
        dimensions = "dimension" if len(unbounded) == 1 else "dimensions"
        raise UsageError(
            f"{env_id} sets no bounds to {dimensions} {' and '.join(map(str, unbounded))} of what it observes; give "
            f"{' '.join(f'--range {place}=LOW:HIGH' for place in unbounded)}"
        )
    return tuple(lows), tuple(highs)
