# mypy: allow-untyped-defs, allow-untyped-calls
"""Tasks given as tables of transitions, and the compiled step through them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Flags, Floats
from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.loop import SteppedWorlds
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.random_streams import THIRTY_TWO, Words, below, unit
from qinit_cli.kernels.worlds import GOAL, LOST, place_of, starts, steps
from qinit_cli.rewards import ReturnBounds

ROUNDING = 1e-9  # of probabilities that were added up or divided
PLACE_BITS = np.uint64(24)
PLACE = np.uint64((1 << 24) - 1)
ENDS = (GOAL, LOST)  # places after the states


@dataclass(frozen=True)
class Tables:
    """Where the steps of B tasks lead: up to O outcomes of each action in each state, those that are not there of probability 0.

    NotAllowed where a kernel could not take them, naming the first task, state and action that are wrong: next states that
    are none, probabilities that are not finite and positive or do not sum to 1. Rows of states that are not open are not summed.
    """

    after: NDArray[np.int32]  # (B, S, A, O) the next state, GOAL or LOST
    probability: Floats  # (B, S, A, O), 1 in sum
    start: Floats  # (B, S) probability that a target's episode starts there
    open: Flags  # (B, S) episodes go on there: where "anywhere" may start
    reward: Floats | None = None  # (B, S, A, O) of each outcome; None: 1 for the goal

    def __post_init__(self) -> None:
        if fault := _fault(self):
            raise NotAllowed(f"a table of transitions cannot be learned: {fault}")

    def __len__(self) -> int:
        return len(self.after)

    def worlds(self, rng: Words) -> SteppedWorlds:
        """The tasks as the compiled loop takes them; `rng` u8 (B, 4) is not used: one uniform a step is enough."""
        _, states, actions, _ = self.after.shape
        places = np.argsort(~self.open, axis=1, kind="stable").astype(np.int32)
        world: TableWorld | PaidTableWorld = TableWorld(
            outcomes=_outcomes(self.after, _cumulative(self.probability)),
            start=_cumulative(self.start),
            places=places,
            count=self.open.sum(axis=1).astype(np.int64),
        )
        if self.reward is not None:
            rewards = np.ascontiguousarray(self.reward, np.float64)
            world = PaidTableWorld(**world._asdict(), rewards=rewards, paid=np.empty(0))
        return SteppedWorlds(world, states, actions, rng)

    def gains(self, bounds: ReturnBounds, gamma: float) -> Floats:
        """What the rewards (B, S, A, O) add to shares of the attainable return; NotAllowed without rewards."""
        if self.reward is None:
            raise NotAllowed("the tables have no rewards")
        # low + width x = r + gamma (low + width x'), and r alone at an end
        kept = np.where(self.after < 0, 1.0, 1.0 - gamma)
        gains: Floats = (self.reward - bounds.low * kept) / bounds.width
        return gains


class TableWorld(NamedTuple):
    """The tables of a batch as the loop reads them."""

    outcomes: Any  # u8 (B, S, A, O): the upper 40 bits are the limit of a draw's upper half, the lower 24 the place after it
    start: Any  # f8 (B, S) running sums
    places: Any  # i4 (B, S) the open states first
    count: Any  # i8 (B,) of them


class PaidTableWorld(NamedTuple):
    """As TableWorld, with rewards."""

    outcomes: Any
    start: Any
    places: Any
    count: Any
    rewards: Any  # f8 (B, S, A, O)
    paid: Any  # f8 (L,) the reward of each lane's last step


@starts(TableWorld, PaidTableWorld)
def start(world, task, lane, rng, anywhere):
    """A state drawn from the target's starts, or any open one."""
    if anywhere:
        return np.int64(world.places[task, below(rng, world.count[task])])
    return np.searchsorted(world.start[task], unit(rng), side="right")


@steps(TableWorld)
def step(world, task, lane, state, action, uniform, rng):
    """The outcome whose share of [0, 1) the uniform falls into."""
    states = world.outcomes.shape[1]
    place = np.int64(_place(world, task, state, action, np.uint64(uniform * 2.0**32)))
    return place if place < states else states - 1 - place


@steps(PaidTableWorld)
def paid_step(world, task, lane, state, action, uniform, rng):
    """As `step`, with the outcome's reward."""
    states = world.outcomes.shape[1]
    place = np.int64(_paid_place(world, task, lane, state, action, np.uint64(uniform * 2.0**32)))
    return place if place < states else states - 1 - place


@body(place_of, TableWorld)
def _place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    return np.uint32(_place(world, task, state, action, drawn >> THIRTY_TWO))


@body(place_of, PaidTableWorld)
def _paid_place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    return np.uint32(_paid_place(world, task, lane, state, action, drawn >> THIRTY_TWO))


@inlined
def _place(world, task, state, action, upper):
    """The place that a step leads to, given the upper 32 bits of its draw."""
    outcomes = world.outcomes[task, state, action]
    drawn, passed = upper << PLACE_BITS | PLACE, 0
    for outcome in range(len(outcomes) - 1):  # no branch that a processor could guess wrong
        passed += drawn >= outcomes[outcome]
    return outcomes[passed] & PLACE


@inlined
def _paid_place(world, task, lane, state, action, upper):
    """The same; notes the reward."""
    outcomes = world.outcomes[task, state, action]
    drawn, passed = upper << PLACE_BITS | PLACE, 0
    for outcome in range(len(outcomes) - 1):
        passed += drawn >= outcomes[outcome]
    world.paid[lane] = world.rewards[task, state, action, passed]
    return outcomes[passed] & PLACE


def _outcomes(after: NDArray[np.int32], limits: Floats) -> Words:
    """Limits and places of the outcomes, put together; the last limit is never looked at."""
    states = after.shape[1]
    place = np.where(after >= 0, after, states - 1 - after).astype(np.uint64)
    # a uniform k * 2^-32 reaches a limit where k does its product with 2^32, rounded up
    limit = np.ceil(np.minimum(limits, 1.0) * 2.0**32).astype(np.uint64)
    return np.ascontiguousarray(limit << PLACE_BITS | place)


def _cumulative(probabilities: Floats) -> Floats:
    """Running sums over the last axis; from the last probability that is not 0 on they are 2, whatever rounding did."""
    sums: Floats = np.cumsum(probabilities, axis=-1)
    rest = np.cumsum(probabilities[..., ::-1], axis=-1)[..., ::-1]  # of the probabilities from here on
    following = np.concatenate([rest[..., 1:], np.zeros_like(rest[..., :1])], axis=-1)
    sums[following == 0] = 2.0
    return sums


def _fault(tables: Tables) -> str:
    """The first thing that is wrong with them, with its place; empty if nothing."""
    after, probability, start, open = tables.after, tables.probability, tables.start, tables.open
    if (
        after.ndim != 4
        or probability.shape != after.shape
        or not start.shape == open.shape == after.shape[:2]
    ):
        shapes = ", ".join(str(each.shape) for each in (after, probability, start, open))
        return f"after, probability, start and open have the shapes {shapes}, not (B, S, A, O) twice and (B, S) twice"
    if after.dtype.kind not in "iu" or open.dtype.kind != "b":
        return f"after and open are of {after.dtype} and {open.dtype}, not of integers and of bool"
    if tables.reward is not None and tables.reward.shape != after.shape:
        return f"the rewards have the shape {tables.reward.shape}, and the outcomes {after.shape}"
    states = after.shape[1]
    if states + len(ENDS) > PLACE:
        return f"{states} states are more than the {int(PLACE) - len(ENDS)} that a table may have"
    nowhere = (after < LOST) | (after >= states)
    improper = ~((probability >= -ROUNDING) & (probability <= 1 + ROUNDING))  # NaN is neither
    unlikely = open[..., None] & ~(np.abs(probability.sum(axis=-1) - 1) <= ROUNDING)
    if nowhere.any():
        place = _first(nowhere)
        return (
            f"{_told(place)} leads to state {after[place]}, of {states} states (-1 is the goal, -2 is lost)"
        )
    if improper.any():
        place = _first(improper)
        return f"{_told(place)} has an outcome of probability {probability[place]:g}, which is not within 0 and 1"
    if unlikely.any():
        place = _first(unlikely)
        return f"{_told(place)} has outcomes whose probabilities sum to {probability[place].sum():g}, not 1"
    improper = ~((start >= -ROUNDING) & (start <= 1 + ROUNDING))
    if improper.any():
        task, state = _first(improper)
        return f"task {task} of the batch starts in state {state} with probability {start[task, state]:g}, not within 0 and 1"
    if tables.reward is not None and not np.isfinite(tables.reward).all():
        place = _first(~np.isfinite(tables.reward))
        return f"{_told(place)} pays {tables.reward[place]:g}, which is no finite number"
    unlikely = ~(np.abs(start.sum(axis=-1) - 1) <= ROUNDING)
    if unlikely.any():
        task = _first(unlikely)[0]
        return (
            f"the probabilities of where task {task} of the batch starts sum to {start[task].sum():g}, not 1"
        )
    closed = np.asarray(~open.any(axis=-1))
    if closed.any():
        return f"task {_first(closed)[0]} of the batch has no state in which its episodes go on"
    return ""


def _first(wrong: Flags) -> tuple[int, ...]:
    return tuple(int(at) for at in np.unravel_index(int(wrong.argmax()), wrong.shape))


def _told(place: tuple[int, ...]) -> str:
    return f"action {place[2]} in state {place[1]} of task {place[0]} of the batch"
