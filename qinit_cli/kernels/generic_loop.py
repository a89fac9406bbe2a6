# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="untyped-decorator, arg-type"
"""Q-learning in worlds that say where an episode starts and what a step does, and no more; any number of actions.

A world is a NamedTuple of arrays and scalars whose class has registered two compiled functions by `starts` and `steps`. The
loop is compiled for each such class, with its functions inlined, and kept with their package's code. The gridworld's and
Mountain Car's own loops are faster, as they know what they step through.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba.extending import overload

from qinit_cli.arrays import Integers
from qinit_cli.kernels.compiled import LEAN, inlined, kept_with, unkept, unkept_inlined
from qinit_cli.kernels.lane import BLOCK, TD_VAR_RATE, evaluation_due, is_idle, lanes_in_use
from qinit_cli.kernels.policies import begin, learn_of_episode
from qinit_cli.kernels.posterior import begin as begin_weighing
from qinit_cli.kernels.posterior import count_goal, mean_at, weigh
from qinit_cli.kernels.random_streams import LOW_12, LOW_20, THIRTY_TWO, TWELVE, Words, draw, draw_block, unit
from qinit_cli.learning import QLearning

GOAL = -1  # a step led to the goal: the episode ends, with reward 1
LOST = -2  # a step ended the episode elsewhere, with reward 0
CUT = -3  # CUT - state: a step led to that state, and the world itself cut the episode off there

Function = Callable[..., Any]

_STARTS: dict[type, Any] = {}
_STEPS: dict[type, Any] = {}
_CUTTING: set[type] = set()  # the worlds that may cut an episode off


class Stepping(NamedTuple):
    """The worlds of a batch as the loop reads them, and where those in the lanes are."""

    own: Any  # what the family's functions read
    rng: Any  # u8 (B, 4) randomness of a task beyond the steps' own
    anywhere: bool  # where episodes start; else at the target start
    state: Any  # i8 (L,)
    worth: Any  # f8 (L, S + 2) of entering a state: gamma max_a Q; the last two are the goal's, 1, and that of being lost, 0
    draws: Any  # u8 (L, BLOCK)


@dataclass(frozen=True)
class SteppedWorlds:
    """Tasks to learn, B of them, of a family that says what a step does."""

    world: Any  # a NamedTuple whose class has registered `starts` and `steps`
    states: int
    actions: int
    rng: Words  # (B, 4)

    lanes: ClassVar[int] = 8

    def __len__(self) -> int:
        return len(self.rng)

    def queue(self) -> Integers:
        """As they are: what takes long is not known."""
        return np.arange(len(self))

    def loop(self, learning: QLearning, lanes: int) -> tuple[Any, Stepping]:
        """The compiled loop and the world it takes."""
        worth = np.zeros((lanes, self.states + 2))
        worth[:, self.states] = 1.0
        world = Stepping(
            own=self.world,
            rng=self.rng.copy(),
            anywhere=learning.start == "anywhere",
            state=np.zeros(lanes, np.int64),
            worth=worth,
            draws=np.zeros((lanes, BLOCK), np.uint64),
        )
        return _loop(type(self.world)), world


def starts(world: type) -> Callable[[Function], Any]:
    """Registers where episodes start in worlds of that class, and compiles it.

    The function takes (world, task, lane, rng, anywhere) and returns the table's state, from 0 to S - 1.
    """
    return lambda function: _STARTS.setdefault(world, inlined(function))


def steps(world: type, *, cuts: bool = False) -> Callable[[Function], Any]:
    """Registers what a step does in worlds of that class, and compiles it.

    The function takes (world, task, lane, state, action, uniform, rng) and returns the table's state that the step leads to,
    GOAL or LOST. `uniform` is uniform in [0, 1); what needs more draws from `rng`. What the table does not see is kept in
    arrays of the world, at `lane`. With `cuts` it may also return CUT - state: the episode ends in that state as it does
    at the horizon, without the goal, and the state's value still counts.
    """
    if cuts:
        _CUTTING.add(world)
    return lambda function: _STEPS.setdefault(world, inlined(function))


@cache
def _loop(world: type) -> Any:
    return kept_with(world.__module__, advance)


def start_of(world, task, lane, rng, anywhere):
    """Where an episode starts; compiled code calls what the world's class has registered."""
    return _STARTS[type(world)].py_func(world, task, lane, rng, anywhere)


def step_of(world, task, lane, state, action, uniform, rng):
    """Where a step leads to; compiled code calls what the world's class has registered."""
    return _STEPS[type(world)].py_func(world, task, lane, state, action, uniform, rng)


def entered(world, after):
    """What the learner sees of a step: the state that it led to, also where the episode is cut off there, GOAL or LOST."""
    return CUT - after if type(world) in _CUTTING and after <= CUT else after


@overload(start_of, jit_options=LEAN)
def _start_of(world, task, lane, rng, anywhere):
    registered = _STARTS[_class_of(world)]
    return lambda world, task, lane, rng, anywhere: registered(world, task, lane, rng, anywhere)


@overload(step_of, jit_options=LEAN)
def _step_of(world, task, lane, state, action, uniform, rng):
    registered = _STEPS[_class_of(world)]
    return lambda world, task, lane, state, action, uniform, rng: registered(
        world, task, lane, state, action, uniform, rng
    )


@overload(entered, jit_options=LEAN)
def _entered(world, after):
    if _class_of(world) not in _CUTTING:  # nothing is compiled in
        return lambda world, after: after
    return lambda world, after: CUT - after if after <= CUT else after


def _class_of(world: Any) -> Any:
    return world.instance_class


def advance(blocks, world, setting, tasks, lanes, potential, visits, td_var, evaluation, choosing, posterior):
    """Learns for that many blocks of steps in every lane, or until the batch is done.

    Writes into `tasks` and the records. potential f8 (B or 1, S), visits i8 (B, S, A), td_var f8 (B, S, A), an Evaluation, a
    Choosing, a Posterior: each may be None, and then costs nothing. Lanes whose task is done take the next one of the batch.
    Called again it goes on where it stopped.
    """
    for _ in range(blocks):
        for lane in range(len(lanes.task)):
            if is_idle(tasks, lanes, lane):
                _take(world, setting, tasks, lanes, lane, evaluation, choosing, posterior)
        count = lanes_in_use(tasks, lanes)
        if count == 0:
            return
        for place in range(count):
            lane = lanes.order[place]
            draw_block(tasks.rng[lanes.task[lane]], world.draws[lane])
        for step in range(BLOCK):
            for place in range(count):  # while one task waits for its last step, the others go on
                lane = lanes.order[place]
                task = lanes.task[lane]
                if not tasks.finished[task]:
                    code = _step(
                        step,
                        task,
                        lane,
                        world,
                        setting,
                        tasks,
                        potential,
                        visits,
                        td_var,
                        choosing,
                        posterior,
                    )
                    world.state[lane] = code
                    lanes.time[lane] += 1
                    if code < 0 or lanes.time[lane] == setting.horizon:
                        _end(
                            task,
                            lane,
                            code == GOAL,
                            world,
                            setting,
                            tasks,
                            lanes,
                            evaluation,
                            choosing,
                            posterior,
                        )


@unkept_inlined
def _step(step, task, lane, world, setting, tasks, potential, visits, td_var, choosing, posterior):
    """One step of Q-learning: the state it leads to, GOAL, LOST or the code of a state in which the episode is cut off."""
    state, drawn = world.state[lane], world.draws[lane, step]
    if posterior is not None and posterior.live[lane]:
        _refresh(posterior, task, lane, state, world, tasks, setting.gamma)
    explores = ((drawn >> TWELVE) & LOW_20) < setting.exploration
    action = _chosen(tasks.q[task, state], drawn, explores)
    if choosing is not None:
        follows = unit(choosing.words[lane]) < choosing.psi[lane]
        choosing.psi[lane] *= choosing.nu
        if follows and not (explores and choosing.explore_while_following):
            action = np.int64(choosing.policies[choosing.chosen[lane], state])
    uniform = np.float64(drawn >> THIRTY_TWO) * 2.0**-32
    code = step_of(world.own, task, lane, state, action, uniform, world.rng[task])
    after = entered(world.own, code)
    gamma, place = setting.gamma, after if after >= 0 else tasks.q.shape[1] - 1 - after
    if posterior is not None and posterior.live[lane] and after >= 0:
        _refresh(posterior, task, lane, after, world, tasks, gamma)
    target = world.worth[lane, place]
    if potential is not None:
        shape = potential[task % len(potential)]
        # zero where the episode ends, else shaping would change which policy is best (Ng et al., 1999)
        target = target + (gamma * shape[after] if after >= 0 else 0.0) - shape[state]
    error = target - tasks.q[task, state, action]
    tasks.q[task, state, action] += setting.alpha * error
    world.worth[lane, state] = gamma * _largest(tasks.q[task, state])
    if visits is not None:
        visits[task, state, action] += 1
    if td_var is not None:
        spread = td_var[task, state, action]
        td_var[task, state, action] = spread + TD_VAR_RATE * (error * error - spread)
    if posterior is not None and posterior.live[lane]:
        weigh(posterior, lane, task, state, action, place)
    return code


@unkept_inlined
def _refresh(posterior, task, lane, state, world, tasks, gamma):
    """Brings a state's values, and what entering it is worth, up to date with the weights."""
    if posterior.current[lane, state] != posterior.version[lane]:
        posterior.current[lane, state] = posterior.version[lane]
        start, left = posterior.start[lane], posterior.left[lane]
        for action in range(posterior.actions):
            pair = posterior.actions * state + action
            mean = mean_at(posterior, lane, pair)
            tasks.q[task, state, action] += left[pair] * (mean - start[pair])
            start[pair] = mean
        world.worth[lane, state] = gamma * _largest(tasks.q[task, state])


@inlined
def _chosen(values, drawn, explores):
    """One of the greedy actions, or of all where the step explores, by the lower 12 bits of its draw."""
    best, tied, chosen = _largest(values), 0, 0
    for value in values:
        tied += (value == best) | explores
    pick = np.int64(((drawn & LOW_12) * np.uint64(tied)) >> TWELVE)
    for action in range(len(values)):  # no branch that a processor could guess wrong
        may = (values[action] == best) | explores
        chosen = action if may & (pick == 0) else chosen
        pick -= may
    return chosen


@inlined
def _largest(values):
    best = values[0]
    for action in range(1, len(values)):
        best = max(best, values[action])
    return best


@unkept
def _take(world, setting, tasks, lanes, lane, evaluation, choosing, posterior):
    """Puts the next task into the lane, and itself where its first episode starts."""
    task = lanes.queue[lanes.following[0]]
    lanes.following[0] += 1
    lanes.task[lane] = task
    for state in range(tasks.q.shape[1]):
        world.worth[lane, state] = setting.gamma * _largest(tasks.q[task, state])
    if evaluation is not None:
        _evaluate(task, lane, 0, world, setting, tasks, evaluation)
    if choosing is not None:
        begin(choosing, lane, task)
    if posterior is not None:
        begin_weighing(posterior, tasks, lane, task)
    lanes.time[lane] = 0
    world.state[lane] = start_of(world.own, task, lane, tasks.start_dice[task], world.anywhere)


@unkept
def _end(task, lane, reached, world, setting, tasks, lanes, evaluation, choosing, posterior):
    """Notes an episode's end, with all that hangs on it, and goes where the next one starts."""
    episode, length = tasks.episode[task], lanes.time[lane]
    place = episode * tasks.steps.shape[1] // setting.episodes
    tasks.steps[task, place] += length
    tasks.reached[task, place] += reached
    tasks.step_count[task] += length
    tasks.episode[task] = episode + 1
    evaluated = evaluation is not None and evaluation_due(evaluation, episode + 1, setting.episodes)
    if posterior is not None and posterior.live[lane]:
        last = count_goal(posterior, task, lane, reached, episode + 1, setting.episodes)
        if last or evaluated:
            for state in range(tasks.q.shape[1]):
                _refresh(posterior, task, lane, state, world, tasks, setting.gamma)
    if evaluation is not None and evaluated:
        _evaluate(task, lane, episode + 1, world, setting, tasks, evaluation)
    if choosing is not None:
        learn_of_episode(choosing, lane, length, reached, setting.gamma)
    if episode + 1 == setting.episodes:
        tasks.finished[task] = True
    lanes.time[lane] = 0
    world.state[lane] = start_of(world.own, task, lane, tasks.start_dice[task], world.anywhere)


@unkept
def _evaluate(task, lane, ended, world, setting, tasks, evaluation):
    """Plays a greedy episode from the target start with what the task has learned in `ended` episodes."""
    rng, length = evaluation.rng[task], 0
    state = start_of(world.own, task, lane, rng, False)
    while state >= 0 and length < setting.horizon:
        drawn = draw(rng)
        action = _chosen(tasks.q[task, state], drawn, False)
        uniform = np.float64(drawn >> THIRTY_TWO) * 2.0**-32
        state = step_of(world.own, task, lane, state, action, uniform, rng)
        length += 1
    evaluation.steps[task, ended // evaluation.every] = length
    evaluation.reached[task, ended // evaluation.every] = state == GOAL
