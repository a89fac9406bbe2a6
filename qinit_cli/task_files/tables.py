"""Tasks of one's own as tables of transitions: what a file says of each, checked, with ends told apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Flags, Floats
from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.rewards import PaidRange

ROUNDING = 1e-6  # of rows of probabilities, which may be written in single precision
NEITHER = -3  # an end, before it is known whether it is the goal
KEYS = {  # of an archive, with what each holds
    "P": "(N, S, A, S)",
    "after": "(N, S, A, O), O being 1 without chance",
    "chance": "(N, S, A, O)",
    "R": "(N, S, A, S), (N, S, A, O) or (N, S, A)",
    "transitions": "(N, S, A) or (S, A)",
    "rewards": "(N, S, A) or (S, A)",
    "start": "(N, S) or (S,)",
    "goal": "(N, S) or (S,)",
    "terminal": "(N, S) or (S,)",
    "split": "(N,)",
}
# the ways to write transitions: what one has, and what it must have
LAYOUTS = (({"P"}, {"P"}), ({"after", "chance"}, {"after"}), ({"transitions", "rewards"},) * 2)
SHARED = ("start", "goal", "terminal")  # may be the same for all tasks

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class OwnTask:
    """One task: up to O outcomes of each action in each state."""

    after: NDArray[np.int32]  # (S, A, O) the next state, GOAL or LOST
    probability: Floats  # (S, A, O)
    reward: Floats | None  # (S, A, O)
    start: Floats  # (S,)
    open: Flags  # (S,)

    @property
    def has_goal(self) -> bool:
        """Whether an outcome reaches the goal."""
        return bool(self._possible(self.after == GOAL).any())

    def digest(self, *, rewards: bool) -> str:
        """What equal tasks share, their `rewards` where these count."""
        parts = (self.after, self.probability, self.reward if rewards else None, self.start, self.open)
        held = sha256()
        for part in parts:
            held.update(b"" if part is None else np.ascontiguousarray(part).tobytes())
        return held.hexdigest()

    def paid(self, where: Flags) -> Floats:
        """The rewards of the possible outcomes that `where` (S, A, O) marks, and 0."""
        rewards = np.zeros(1) if self.reward is None else self.reward[self._possible(where)]
        return np.append(rewards, 0.0)

    def _possible(self, where: Flags) -> Flags:
        there: Flags = where & (self.probability > 0) & self.open[:, None, None]
        return there


@dataclass(frozen=True, eq=False)
class OwnTaskSet:
    """The tasks of a file, N of them, over the same states and actions."""

    tasks: Sequence[OwnTask]
    splits: tuple[str, ...]  # a label for each, or none at all
    axes: str  # NAME=LENGTH,...
    actions: tuple[str, ...]

    @property
    def paid(self) -> PaidRange:
        """The least and the largest reward of all outcomes that an episode goes on after, and that end one."""
        going_on = np.concatenate([task.paid(task.after >= 0) for task in self.tasks])
        ending = np.concatenate([task.paid(task.after < 0) for task in self.tasks])
        return PaidRange(
            (float(going_on.min()), float(going_on.max())), (float(ending.min()), float(ending.max()))
        )


def own_tasks(arrays: Arrays, named: str) -> list[OwnTask]:
    """The tasks that the arrays of a file describe, `named` so, their ends not yet told apart.

    NotAllowed, one sentence, for what cannot be learned.
    """
    arrays = _with_task_axis(arrays, named)
    return [_own_task(one, f"task {task} of {named}") for task, one in enumerate(_each(arrays))]


def told_apart(tasks: Sequence[OwnTask]) -> list[OwnTask]:
    """The tasks with ends of which nothing is known made goals: those that pay more than 0, or all where no end pays so."""
    paying = any((task.paid(task.after == NEITHER) > 0).any() for task in tasks)

    def resolved(task: OwnTask) -> OwnTask:
        good = True if task.reward is None or not paying else task.reward > 0
        ends = np.where(good, GOAL, LOST)
        return replace(task, after=np.where(task.after == NEITHER, ends, task.after).astype(np.int32))

    return [resolved(task) for task in tasks]


def _with_task_axis(arrays: Arrays, named: str) -> Arrays:
    """P or after, and what stands beside it, N tasks each; a task that stands alone may lack the first axis.

    NotAllowed for unknown or missing keys, and for shapes that do not belong together.
    """
    if unknown := sorted(set(arrays) - set(KEYS)):
        raise NotAllowed(
            f"{named} holds {unknown[0]!r}, which is no array of tasks; known are {', '.join(KEYS)}"
        )
    layouts = [needed for held, needed in LAYOUTS if held & set(arrays)]
    if len(layouts) != 1 or not layouts[0] <= set(arrays):
        raise NotAllowed(
            f"{named} has {', '.join(sorted(arrays)) or 'no arrays'}; transitions are P, after and chance, or transitions and "
            "rewards, one of the three"
        )
    if "transitions" in arrays:
        if "R" in arrays:
            raise NotAllowed(f"{named} has both R and rewards; leave one of them out")
        arrays = dict(arrays)
        after, rewards = arrays.pop("transitions"), arrays.pop("rewards")
        if after.shape != rewards.shape:
            raise NotAllowed(
                f"{named} has transitions {after.shape} and rewards {rewards.shape}; both are {KEYS['rewards']}"
            )
        arrays |= {"after": after[..., None], "R": rewards}
    if arrays[_main(arrays)].ndim == 3:
        alone = {"P", "after", "chance", "R"}
        arrays = {key: value[None] if key in alone else value for key, value in arrays.items()}
    _check_shapes(arrays, named)
    return arrays


def _main(arrays: Arrays) -> str:
    return "P" if "P" in arrays else "after"


def _check_shapes(arrays: Arrays, named: str) -> None:
    main = _main(arrays)
    shape = arrays[main].shape
    if len(shape) != 4 or 0 in shape or (main == "P" and shape[1] != shape[3]):
        raise NotAllowed(f"{named} has {main} of shape {shape}, not {KEYS[main]}")
    tasks, states = shape[:2]
    wanted: dict[str, tuple[tuple[int, ...], ...]] = {
        "chance": (shape,),
        "R": (shape, shape[:3]),
        "split": ((tasks,),),
        **dict.fromkeys(SHARED, ((tasks, states), (states,))),
    }
    for key, shapes in wanted.items():
        if key in arrays and arrays[key].shape not in shapes:
            raise NotAllowed(
                f"{named} has {key} of shape {arrays[key].shape}; beside {main} of shape {shape} it is {KEYS[key]}"
            )
    for key, kinds in {"P": "fiu", "chance": "fiu", "R": "fiu", "start": "fiu", "after": "iu"}.items():
        if key in arrays and arrays[key].dtype.kind not in kinds:
            raise NotAllowed(
                f"{named} has {key} of {arrays[key].dtype}, not of {'whole ' if kinds == 'iu' else ''}numbers"
            )
    for key in ("goal", "terminal"):
        if key in arrays and not np.isin(arrays[key], (0, 1)).all():
            raise NotAllowed(f"{named} has {key} with other values than true and false; it marks states")


def _each(arrays: Arrays) -> Iterator[dict[str, NDArray[Any]]]:
    """The arrays of each task."""
    count, states = arrays[_main(arrays)].shape[:2]
    shared = {key for key in SHARED if key in arrays and arrays[key].shape == (states,)}
    for task in range(count):
        yield {
            key: value if key in shared else value[task] for key, value in arrays.items() if key != "split"
        }


def _own_task(arrays: Arrays, named: str) -> OwnTask:
    after, probability, reward = _sparse(arrays) if "P" in arrays else _listed(arrays)
    states = len(after)
    possible = probability != 0
    nowhere = possible & ((after < LOST) | (after >= states))
    if nowhere.any():
        place = _first(nowhere)
        raise NotAllowed(
            f"{_told(place, named)} leads to state {after[place]}, and there are {states} (-1 is an end, -2 one without the goal)"
        )
    goal, terminal = (
        arrays[key].astype(bool) if key in arrays else np.zeros(states, bool) for key in ("goal", "terminal")
    )
    stays = (after == np.arange(states)[:, None, None]) | ~possible
    absorbing = (stays & (np.abs(probability.sum(axis=2, keepdims=True) - 1) <= ROUNDING)).all(axis=(1, 2))
    if reward is not None:
        absorbing &= (np.where(possible, reward, 0.0) == 0).all(axis=(1, 2))
    ends = goal | terminal | absorbing
    _check(after, probability, reward, ~ends, named)
    unmarked = LOST if "goal" in arrays else NEITHER
    kinds = np.where(goal, GOAL, np.where(ends, unmarked, np.arange(states)))
    # an end that is written as one (-1) is the goal where no states are marked, and nothing else is known of it
    written = np.where(after == GOAL, NEITHER, LOST)
    after = np.where(after >= 0, kinds[np.clip(after, 0, states - 1)], written)
    closed = ends[:, None, None] | ~possible
    to = np.where(closed, LOST, after).astype(np.int32)
    probability = np.where(closed, 0.0, probability)
    with np.errstate(invalid="ignore", divide="ignore"):  # rows of ends sum to nothing
        sums = probability.sum(axis=2, keepdims=True)
        probability = np.where(sums > 0, probability / sums, probability)
    reward = None if reward is None else np.where(closed, 0.0, reward)
    return OwnTask(to, probability, reward, _start(arrays, ends, named), ~ends)


def _listed(arrays: Arrays) -> tuple[NDArray[np.int64], Floats, Floats | None]:
    """Next states, probabilities and rewards (S, A, O) as they are listed; one that is alone is certain."""
    after = arrays["after"].astype(np.int64)
    probability = arrays["chance"].astype(np.float64) if "chance" in arrays else np.ones(after.shape)
    return after, probability, _of_outcomes(arrays.get("R"), after)


def _sparse(arrays: Arrays) -> tuple[NDArray[np.int64], Floats, Floats | None]:
    """Next states, probabilities and rewards (S, A, O) of those outcomes that are possible, in the order of states."""
    dense = arrays["P"]
    possible = dense != 0
    counts = np.count_nonzero(possible, axis=2)
    outcomes = max(1, int(counts.max()))
    state, action, to = np.nonzero(possible)
    first = np.cumsum(counts.ravel()) - counts.ravel()
    place = np.arange(len(to)) - np.repeat(first, counts.ravel())
    after = np.zeros((*counts.shape, outcomes), np.int64)
    probability = np.zeros(after.shape)
    after[state, action, place] = to
    probability[state, action, place] = dense[state, action, to]
    given = arrays.get("R")
    if given is None or given.ndim == 2:
        return after, probability, _of_outcomes(given, after)
    reward = np.zeros(after.shape)
    reward[state, action, place] = given[state, action, to]
    return after, probability, reward


def _of_outcomes(reward: NDArray[Any] | None, after: NDArray[np.int64]) -> Floats | None:
    if reward is None:
        return None
    wide = reward[..., None] if reward.ndim == 2 else reward
    return np.broadcast_to(wide.astype(np.float64), after.shape)


def _check(
    after: NDArray[np.int64], probability: Floats, reward: Floats | None, open: Flags, named: str
) -> None:
    """NotAllowed for what is no probability, does not sum to 1 or pays no number, in states where an episode goes on."""
    here = open[:, None, None]
    improper = ~((probability >= 0) & np.isfinite(probability)) & here
    if improper.any():
        place = _first(improper)
        raise NotAllowed(
            f"{_told(place, named)} leads to state {after[place]} with probability {probability[place]:g}, which is none"
        )
    sums = probability.sum(axis=2)
    unlikely = (np.abs(sums - 1) > ROUNDING) & open[:, None]
    if unlikely.any():
        place = _first(unlikely)
        raise NotAllowed(f"{_told(place, named)} has probabilities that sum to {sums[place]:g}, not 1")
    unpaid = (probability > 0) & here & ~np.isfinite(0.0 if reward is None else reward)
    if reward is not None and unpaid.any():
        place = _first(unpaid)
        raise NotAllowed(f"{_told(place, named)} pays {reward[place]:g}, which is no finite number")


def _start(arrays: Arrays, ends: Flags, named: str) -> Floats:
    """The probabilities of where targets start, (S,): the first state unless `start` tells others."""
    start = arrays["start"].astype(np.float64) if "start" in arrays else np.eye(1, len(ends))[0]
    if not ((start >= 0) & np.isfinite(start)).all() or abs(start.sum() - 1) > ROUNDING:
        raise NotAllowed(
            f"{named} has a start that is no distribution: its probabilities sum to {start.sum():g}"
        )
    if (start[ends] > 0).any():
        state = int(np.flatnonzero(ends & (start > 0))[0])
        raise NotAllowed(f"{named} starts in state {state}, where an episode ends; give another start")
    return np.asarray(start / start.sum(), np.float64)


def _first(wrong: Flags) -> tuple[int, ...]:
    return tuple(int(at) for at in np.unravel_index(int(wrong.argmax()), wrong.shape))


def _told(place: tuple[int, ...], named: str) -> str:
    return f"action {place[1]} in state {place[0]} of {named}"
