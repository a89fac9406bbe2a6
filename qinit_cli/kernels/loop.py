# mypy: allow-untyped-defs, allow-untyped-calls
"""Learning, compiled: one loop for every world, learner and exploration, many tasks a call, a few side by side.

The loop is compiled for their classes, with their parts inlined, and kept with the code of their packages. What a task
learns depends on its own streams alone, not on its batch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from qinit_cli.arrays import Integers
from qinit_cli.kernels.compiled import inlined, kept_with, unkept, unkept_inlined
from qinit_cli.kernels.exploration import choose, count_step, decided_limit
from qinit_cli.kernels.lane import (
    BLOCK,
    empty,
    end_block,
    evaluation_due,
    greedy_action,
    in_use,
    is_idle,
    own,
    read,
    take,
)
from qinit_cli.kernels.learner import Step, arrive, begin_task, chose, end_learning, is_state, update
from qinit_cli.kernels.parts import Function
from qinit_cli.kernels.payment import (
    begin_gaining,
    gain,
    note_evaluation,
    note_return,
    reward_of,
    share_of_episode,
)
from qinit_cli.kernels.policies import begin, learn_of_episode
from qinit_cli.kernels.posterior import begin as begin_weighing
from qinit_cli.kernels.posterior import end_episode, refresh, weigh, weighs
from qinit_cli.kernels.random_streams import THIRTY_TWO, Words, draw, draw_block
from qinit_cli.kernels.worlds import (
    GOAL,
    beside,
    entered,
    move,
    moves_at_once,
    place_of,
    prepare,
    start_of,
    step_of,
)
from qinit_cli.learning import Learning

# by a number of eight bits: its lowest that is 1
LOWEST = np.array([(number & -number).bit_length() - 1 for number in range(1 << 8)])


@dataclass(frozen=True)
class SteppedWorlds:
    """Tasks to learn, B of them, of a family that says what a step does."""

    world: Any  # a NamedTuple whose class has registered `starts` and `steps`
    states: int
    actions: int
    rng: Words  # (B, 4) randomness of a task beyond the steps' own

    lanes: ClassVar[int] = 4
    alone: ClassVar[int] = 3  # lanes are learned side by side where all of a group are in use

    def __len__(self) -> int:
        return len(self.rng)

    def queue(self) -> Integers:
        """As they are: what takes long is not known."""
        return np.arange(len(self))

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, Any]:
        """The compiled loop and the world it takes."""
        world: Any = self.world
        if "paid" in getattr(world, "_fields", ()):
            world = world._replace(paid=np.zeros(lanes))
        return compiled_loop(learning, world.__class__), world


def compiled_loop(learning: Learning, *worlds: Any) -> Function:
    """`advance` for worlds of that class, and of those that it is made of, learned so."""
    return _loop_for(*(each.__module__ for each in (*worlds, type(learning.learner))))


@cache
def _loop_for(*modules: str) -> Function:
    loop: Function = kept_with(modules, advance)
    return loop


def advance(blocks, world, setting, tasks, lanes, recording, hooks):
    """Learns for that many blocks of steps in every lane, or until the batch is done.

    Writes into `tasks` and `recording`. Lanes whose task is done take the next one of the batch. Called again it goes on where
    it stopped.
    """
    for _ in range(blocks):
        count = 0
        for lane in range(len(lanes.task)):
            if is_idle(tasks, lanes, lane):
                _take(
                    world,
                    setting,
                    tasks,
                    lanes,
                    lane,
                    recording,
                    hooks,
                    hooks.choosing,
                    hooks.posterior,
                    lanes.waiting,
                )
            if in_use(tasks, lanes, lane):
                _prepare(world, setting, tasks, lanes, lane)
                count += 1
        if count == 0:
            return
        _advance_groups(world, setting, tasks, lanes, recording, hooks, hooks.posterior)
        for lane in range(len(lanes.task)):
            if in_use(tasks, lanes, lane):
                end_block(tasks, lanes, lane, setting.episodes)


@unkept_inlined
def _prepare(world, setting, tasks, lanes, lane):
    """Draws for a block of steps in a lane, and what they decide."""
    task, memory = lanes.task[lane], own(lanes.memory, lane)
    draw_block(tasks.rng[task], memory.draws)
    prepare(
        world,
        lane,
        task,
        tasks.world_dice[task],
        decided_limit(setting.explore),
        setting.all_actions,
        memory.draws,
        memory.choices,
    )


@unkept_inlined
def _advance_groups(world, setting, tasks, lanes, recording, hooks, posterior):
    """A block of steps in every lane in use: side by side where enough of a group are, else one after the other."""
    side_by_side = beside(world)
    for first in range(0, len(lanes.task), side_by_side):
        end, count = min(first + side_by_side, len(lanes.task)), 0
        for lane in range(first, end):
            count += in_use(tasks, lanes, lane)
        if count > setting.alone:
            if posterior is not None and weighs(posterior, first, end):
                _learn(first, True, world, setting, tasks, lanes, recording, hooks, posterior)
            else:
                _learn(first, True, world, setting, tasks, lanes, recording, hooks, None)
        else:
            for lane in range(first, end):
                if in_use(tasks, lanes, lane):
                    if posterior is not None and posterior.live[lane]:
                        _learn(lane, None, world, setting, tasks, lanes, recording, hooks, posterior)
                    else:
                        _learn(lane, None, world, setting, tasks, lanes, recording, hooks, None)


@unkept
def _learn(first, group, world, setting, tasks, lanes, recording, hooks, posterior):
    """A block of steps in the lanes from `first` on, side by side, or in that lane alone if `group` is None."""
    count, at_once, gamma = 1, False, setting.gamma
    states = lanes.memory.ties.shape[1] - 2
    if group is not None:
        count, at_once = beside(world), moves_at_once(world)
    end = first + count
    task, time, memories = lanes.task[first:end], lanes.time[first:end], own(lanes.memory, slice(first, end))
    state, action, after = lanes.state[first:end], lanes.action[first:end], lanes.after[first:end]
    cut_off = _cut_off(time, setting.horizon)
    for step in range(BLOCK):
        ended = False
        if at_once:
            for place in range(count):
                memory = own(memories, place)
                _, action[place] = _chosen(
                    memory,
                    step,
                    first + place,
                    task[place],
                    state[place],
                    setting,
                    lanes.ended,
                    lanes.waiting,
                    hooks,
                    hooks.choosing,
                    posterior,
                    recording,
                )
            ended = move(world, first, step, action, states, after)
        for place in range(count):
            lane, memory, here = first + place, own(memories, place), state[place]
            if at_once:
                acts, there = action[place], after[place]
            else:
                choice, acts = _chosen(
                    memory,
                    step,
                    lane,
                    task[place],
                    here,
                    setting,
                    lanes.ended,
                    lanes.waiting,
                    hooks,
                    hooks.choosing,
                    posterior,
                    recording,
                )
                there = place_of(
                    world,
                    task[place],
                    lane,
                    step,
                    here,
                    choice,
                    acts,
                    memory.draws[step],
                    tasks.world_dice,
                    states,
                )
                ended |= there >= states
            state[place] = there
            there = np.uint32(entered(world, there, states))
            if posterior is not None and posterior.live[lane] and there < states:
                refresh(posterior, lane, memory, there, gamma)
            reward = reward_of(setting.payment, lane)
            gain(setting.payment, lane, gamma)
            if _waits(lanes.waiting, lane, here, acts, reward, there < states):
                continue
            _learn_step(
                memory,
                lane,
                task[place],
                here,
                acts,
                reward,
                there,
                -1,
                setting,
                lanes.ended,
                hooks,
                posterior,
                recording,
            )
        if ended or step == cut_off:
            over = 0  # a bit for each lane whose episode is; a branch for each would often be guessed wrong
            for place in range(count):
                length = time[place] + step + 1
                over |= ((state[place] >= states) | (length == setting.horizon)) << place
            while over > 0:
                place = LOWEST[over]
                over &= over - 1
                lane, length = first + place, time[place] + step + 1
                if task[place] >= 0:
                    reached = state[place] == states
                    _end(
                        lane,
                        length,
                        reached,
                        world,
                        setting,
                        tasks,
                        lanes,
                        recording,
                        recording.evaluation,
                        hooks,
                        hooks.choosing,
                        posterior,
                    )
                else:
                    state[place] = 0  # nobody learns there
                time[place] = -1 - step
            if group is None and lanes.ended[first] >= setting.episodes:
                return  # nothing is learned for nothing
            cut_off = _cut_off(time, setting.horizon)
    for place in range(count):
        time[place] += BLOCK


@unkept_inlined
def _chosen(
    memory,
    step,
    lane,
    task,
    state,
    setting,
    ended,
    waiting,
    hooks,
    choosing,
    posterior,
    recording,
):
    """What a lane's step does: its choice, and the action that follows from it, for which the step before may have waited."""
    if posterior is not None and posterior.live[lane]:
        refresh(posterior, lane, memory, state, setting.gamma)
    read(memory, state, setting.gamma)
    arrive(setting.learner, memory, lane, state, setting.gamma)
    choice, action = choose(memory, setting.explore, step, lane, state, ended[lane], choosing)
    count_step(setting.explore, memory, lane, state, action)
    _learn_waiting(
        waiting, memory, lane, task, state, np.int64(action), setting, ended, hooks, posterior, recording
    )
    chose(setting.learner, memory, lane, state, action)
    return choice, action


@inlined
def _waits(waiting, lane, state, action, reward, goes_on):
    """True if the step waits for the action after it; notes it."""
    if waiting is not None and goes_on:
        waiting.state[lane], waiting.action[lane], waiting.reward[lane] = state, action, reward
        return True
    return False


@unkept_inlined
def _learn_waiting(
    waiting, memory, lane, task, after, following, setting, ended, hooks, posterior, recording
):
    """Learns from the step that waited, given the row that it led to and the action that follows; -1: none does."""
    if waiting is not None and waiting.state[lane] >= 0:
        _learn_step(
            memory,
            lane,
            task,
            waiting.state[lane],
            waiting.action[lane],
            waiting.reward[lane],
            after,
            following,
            setting,
            ended,
            hooks,
            posterior,
            recording,
        )
        waiting.state[lane] = -1
        if is_state(memory, after):
            read(memory, after, setting.gamma)  # before what is learned from the step there


@unkept_inlined
def _learn_step(
    memory, lane, task, state, action, reward, after, following, setting, ended, hooks, posterior, recording
):
    """Learns from a step, and lets it move the weights of hypotheses."""
    after = np.int64(after)
    if is_state(memory, after):
        read(memory, after, setting.gamma)
        arrive(setting.learner, memory, lane, after, setting.gamma)
    step = Step(lane, np.int64(state), np.int64(action), reward, after, following, ended[lane])
    alpha = update(setting.learner, memory, step, setting, hooks, recording)
    if posterior is not None and posterior.live[lane]:
        weigh(posterior, setting.payment, lane, task, state, action, reward, after, 1.0 - alpha)


@inlined
def _cut_off(time, horizon):
    """The first step of the block after which an episode is cut off."""
    longest = time[0]
    for place in range(1, len(time)):
        longest = max(longest, time[place])
    return horizon - 1 - longest


@unkept
def _take(world, setting, tasks, lanes, lane, recording, hooks, choosing, posterior, waiting):
    """Puts the next task into the lane, and itself where its first episode starts."""
    take(
        tasks,
        lanes,
        lane,
        setting.gamma,
        setting.payment,
        hooks.potential,
        recording.visits,
        recording.td_var,
    )
    task = lanes.task[lane]
    _evaluate(world, setting, tasks, lanes, lane, 0, recording.evaluation)
    if choosing is not None:
        begin(choosing, lane, task)
    if posterior is not None:
        begin_weighing(posterior, tasks, lane, task)
    memory = own(lanes.memory, lane)
    begin_task(setting.learner, memory, lane, task)
    begin_task(setting.rate, memory, lane, task)
    begin_task(setting.explore, memory, lane, task)
    if waiting is not None:
        # what was learned for nothing in the rest of a block waits for no action of this task
        waiting.state[lane] = -1
    begin_gaining(setting.payment, lane)
    lanes.state[lane] = start_of(world, task, lane, tasks.start_dice[task], setting.anywhere)


@unkept_inlined
def _end(
    lane, length, reached, world, setting, tasks, lanes, recording, evaluation, hooks, choosing, posterior
):
    """Notes an episode's end, with all that hangs on it, and goes where the next one starts."""
    task, episode = lanes.task[lane], lanes.ended[lane]
    after = np.int64(entered(world, lanes.state[lane], lanes.memory.ties.shape[1] - 2))
    _learn_waiting(
        lanes.waiting,
        own(lanes.memory, lane),
        lane,
        task,
        after,
        -1,
        setting,
        lanes.ended,
        hooks,
        posterior,
        recording,
    )
    end_learning(setting.learner, lane)
    if posterior is not None and posterior.live[lane]:
        evaluated = False
        if evaluation is not None:
            evaluated = evaluation_due(evaluation, episode + 1, setting.episodes)
        memory = own(lanes.memory, lane)
        end_episode(
            posterior, task, lane, memory, reached, episode + 1, evaluated, setting.gamma, setting.episodes
        )
    note_return(setting.payment, lane, task, episode)
    lanes.lengths[lane, episode % BLOCK] = length if reached else -length
    lanes.ended[lane] = episode + 1
    if episode + 1 == setting.episodes:
        empty(own(lanes.memory, lane), tasks, task, recording.visits, recording.td_var)
    if choosing is not None:
        learn_of_episode(
            choosing, lane, share_of_episode(setting.payment, lane, length, reached, setting.gamma)
        )
    _evaluate(world, setting, tasks, lanes, lane, episode + 1, evaluation)
    begin_gaining(setting.payment, lane)
    lanes.state[lane] = start_of(world, task, lane, tasks.start_dice[task], setting.anywhere)


@unkept_inlined
def _evaluate(world, setting, tasks, lanes, lane, ended, evaluation):
    """Plays a greedy episode from the target start with what the lane's task has learned in `ended` episodes, if it is time."""
    if evaluation is not None and evaluation_due(evaluation, ended, setting.episodes):
        _play(world, setting, tasks, lanes, lane, ended, evaluation)


@unkept
def _play(world, setting, tasks, lanes, lane, ended, evaluation):
    """A greedy episode without learning."""
    task, memory = lanes.task[lane], own(lanes.memory, lane)
    rng, length = evaluation.rng[task], 0
    begin_gaining(setting.payment, lane)
    code = np.int64(start_of(world, task, lane, rng, False))
    while code >= 0 and length < setting.horizon:
        drawn = draw(rng)
        read(memory, code, setting.gamma)
        arrive(setting.learner, memory, lane, code, setting.gamma)
        action = np.int64(greedy_action(memory, code, drawn))
        uniform = np.float64(drawn >> THIRTY_TWO) * 2.0**-32
        code = np.int64(step_of(world, task, lane, code, action, uniform, rng))
        gain(setting.payment, lane, setting.gamma)
        length += 1
    note_evaluation(setting.payment, lane, task, ended // evaluation.every)
    evaluation.steps[task, ended // evaluation.every] = length
    evaluation.reached[task, ended // evaluation.every] = code == GOAL
