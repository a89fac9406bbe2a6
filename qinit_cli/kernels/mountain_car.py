# mypy: allow-untyped-defs, allow-untyped-calls
"""Q-learning in Mountain Car, compiled: many tasks a call, eight side by side, whose cars move as one vector.

The dynamics are those of Gymnasium's MountainCar-v0, with a push eta on the right hill. The car's state is
continuous; the table sees its bin, row position and column velocity. Actions: 0 left, 1 none, 2 right. What a
task learns depends on its own streams alone, not on its batch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Integers
from qinit_cli.kernels.choices import ACTIONS, SLIPS, decide, greedy_choice
from qinit_cli.kernels.compiled import inlined, inner, lean
from qinit_cli.kernels.cosine import cosine
from qinit_cli.kernels.lane import (
    BLOCK,
    Memory,
    end_block,
    evaluation_due,
    is_idle,
    lanes_in_use,
    make_terminal,
    memory,
    record_end,
    take,
    update,
)
from qinit_cli.kernels.policies import begin, followed, learn_of_episode
from qinit_cli.kernels.posterior import begin as begin_weighing
from qinit_cli.kernels.posterior import end_episode, refresh, weigh, weighs
from qinit_cli.kernels.random_streams import Words, draw, draw_block, slip_limit, unit
from qinit_cli.kernels.reals import EIGHT, bits, chosen, load_reals, reals, store_reals, store_whole, whole
from qinit_cli.learning import QLearning

LEFT, RIGHT, GOAL, FASTEST = -1.2, 0.6, 0.5, 0.07
FORCE, GRAVITY = 0.001, 0.0025
PUSHES = np.array([-FORCE, 0.0, FORCE])  # by action
ALL_ACTIONS = np.uint64(0b111)
NO_SLIP = slip_limit(np.ones(SLIPS - 1))

FEW = 2  # tasks that learn faster one after the other than as two of eight: 35 M steps/s against 14 for each of eight

ANYWHERE, POINT, VALLEY = 0, 1, 2
Place = Literal["point", "valley"]


class CarWorld(NamedTuple):
    """The mountain cars of a batch as the loop reads them, and where those in the lanes are."""

    eta: Any  # f8 (B,) push of a task
    hill: float
    bins: int
    start: int  # of episodes: ANYWHERE, POINT or VALLEY
    target_start: int  # of evaluation
    noise: float  # standard deviation of a push that is drawn anew every step
    noise_dice: Any  # u8 (B, 4), or None if pushes belong to tasks
    position: Any  # f8 (L,)
    velocity: Any  # f8 (L,)
    time: Any  # f8 (L,) steps in the current episode
    cell: Any  # u4 (L,)
    after: Any  # u4 (L,) the cell that the step leads to
    action: Any  # u1 (L,)
    lane_eta: Any  # f8 (L,)
    gusts: Any  # f8 (L * BLOCK,), eta of every step, eight lanes side by side; None if pushes belong to tasks
    start_position: Any  # f8 (L, BLOCK), e % BLOCK for where the car is after the e-th episode
    start_velocity: Any  # f8 (L, BLOCK)


@dataclass(frozen=True)
class MountainCars:
    """Mountain Car tasks to learn, B of them."""

    eta: NDArray[np.float64]  # (B,) added to the position where the position before the step is >= hill
    hill: float = 0.0
    bins: int = 30  # along position and velocity
    start: Place = (
        "point"  # if learning.start is "fixed": x = -0.5, v = 0, or Gymnasium's x ~ U(-0.6, -0.4), v = 0
    )
    noise: float = 0.0  # standard deviation of a further push, drawn every step
    noise_dice: Words | None = None  # (B, 4) its streams

    actions: ClassVar[int] = 3
    lanes: ClassVar[int] = EIGHT

    def __post_init__(self) -> None:
        if self.bins < 1:
            raise ValueError(f"{self.bins} bins; there must be at least 1")
        if self.noise > 0 and self.noise_dice is None:
            raise ValueError("a push drawn every step needs streams of its own: noise_dice")

    @property
    def states(self) -> int:
        """Number of bins."""
        return self.bins**2

    def __len__(self) -> int:
        return len(self.eta)

    def queue(self) -> Integers:
        """Those first that are pushed back most: they take up to twelve times the steps of the others."""
        return np.argsort(self.eta, kind="stable")

    def loop(self, learning: QLearning, lanes: int) -> tuple[Any, CarWorld]:
        """The compiled loop and the world it takes."""
        if lanes % EIGHT:
            raise ValueError(f"{lanes} lanes; Mountain Car is learned in multiples of {EIGHT}")
        gusty = self.noise > 0
        target_start = POINT if self.start == "point" else VALLEY
        world = CarWorld(
            eta=np.ascontiguousarray(self.eta, np.float64),
            hill=float(self.hill),
            bins=self.bins,
            start=ANYWHERE if learning.start == "anywhere" else target_start,
            target_start=target_start,
            noise=float(self.noise),
            noise_dice=self.noise_dice.copy() if gusty and self.noise_dice is not None else None,
            position=np.full(lanes, -0.5),
            velocity=np.zeros(lanes),
            time=np.zeros(lanes),
            cell=np.zeros(lanes, np.uint32),
            after=np.zeros(lanes, np.uint32),
            action=np.zeros(lanes, np.uint8),
            lane_eta=np.zeros(lanes),
            gusts=np.zeros(lanes * BLOCK) if gusty else None,
            start_position=np.zeros((lanes, BLOCK)),
            start_velocity=np.zeros((lanes, BLOCK)),
        )
        return advance, world


@inlined
def pull(position):
    """What gravity adds to the velocity in a step; one car, or eight side by side."""
    return cosine(3.0 * position) * -GRAVITY


@inlined
def move(position, velocity, push, eta, hill):
    """The car's position and velocity after a step; one car, or eight side by side.

    push: PUSHES of the action. eta is added to the position where that is >= hill before the step.
    """
    return roll(position, velocity, push + pull(position), eta, hill)


@inlined
def roll(position, velocity, change, eta, hill):
    """`move`, given what push and gravity together add to the velocity."""
    gust = chosen(position >= hill, eta, 0.0)
    velocity = _between(velocity + change, -FASTEST, FASTEST)
    position = _between(position + (velocity + gust), LEFT, RIGHT)
    velocity = chosen((position == LEFT) & (velocity < 0.0), 0.0, velocity)
    return position, velocity


@inlined
def is_done(position, velocity):
    """True once the car is at the flag and does not roll back."""
    return (position >= GOAL) & (velocity >= 0.0)


@inlined
def bin_of(position, velocity, bins):
    """The table's state, a whole number but float64: bin of the position * bins + bin of the velocity."""
    last = bins - 1.0
    row = whole((position - LEFT) * (bins / (RIGHT - LEFT)))
    column = whole((velocity + FASTEST) * (bins / (2 * FASTEST)))
    return chosen(row > last, last, row) * bins + chosen(column > last, last, column)


@inlined
def _between(number, low, high):
    number = chosen(number > high, high, number)
    return chosen(number < low, low, number)


@lean
def advance(blocks, world, setting, tasks, lanes, potential, visits, td_var, evaluation, choosing, posterior):
    """Learns for that many blocks of steps in every lane, or until the batch is done.

    Writes into `tasks` and the records. potential f8 (B or 1, S), visits i8 (B, S, 3), td_var f8 (B, S, 3), an
    Evaluation, a Choosing, a Posterior: each may be None, and then costs nothing. Lanes whose task is done take
    the next one of the batch. Called again it goes on where it stopped.
    """
    for _ in range(blocks):
        for lane in range(len(lanes.task)):
            if is_idle(tasks, lanes, lane):
                take(tasks, lanes, lane, setting.gamma, potential, visits, td_var)
                _place(world, setting, tasks, lanes, lane, evaluation, choosing, posterior)
        count = lanes_in_use(tasks, lanes)
        if count == 0:
            return
        for place in range(count):
            lane = lanes.order[place]
            draw_block(tasks.rng[lanes.task[lane]], lanes.draws)
            decide(lanes.draws, setting.exploration, ALL_ACTIONS, NO_SLIP, lanes.choices[lane])
            _draw_gusts(lanes.task[lane], lane, world, world.noise_dice)
        gusts, eights = world.gusts, len(lanes.task)
        if count <= FEW and (posterior is None or not weighs(posterior, 0, eights)):
            eights = 0
            for place in range(count):
                _learn_in_one(
                    lanes.order[place],
                    world,
                    setting,
                    tasks,
                    lanes,
                    potential,
                    visits,
                    td_var,
                    gusts,
                    evaluation,
                    choosing,
                )
        for first in range(0, eights, EIGHT):
            if posterior is not None and weighs(posterior, first, first + EIGHT):
                _learn_in_eight(
                    first,
                    world,
                    setting,
                    tasks,
                    lanes,
                    potential,
                    visits,
                    td_var,
                    gusts,
                    evaluation,
                    choosing,
                    posterior,
                )
            else:
                _learn_in_eight(
                    first,
                    world,
                    setting,
                    tasks,
                    lanes,
                    potential,
                    visits,
                    td_var,
                    gusts,
                    evaluation,
                    choosing,
                    None,
                )
        for place in range(count):
            lane = lanes.order[place]
            first = tasks.episode[lanes.task[lane]]
            end_block(tasks, lanes, lane, setting.episodes)
            _draw_starts(world, tasks, lanes, lane, first, lanes.ended[lane])


@inner
def _learn_in_eight(
    first, world, setting, tasks, lanes, potential, visits, td_var, gusts, evaluation, choosing, posterior
):
    """A block of steps in eight lanes; what happens in those without a task is nobody's."""
    alpha, gamma, hill, bins = setting.alpha, setting.gamma, world.hill, np.float64(world.bins)
    goal, horizon = bins * bins, np.float64(setting.horizon)
    end = first + EIGHT
    rows, ties = lanes.rows[first:end], lanes.ties[first:end]
    counts, spreads = lanes.visits[first:end], lanes.td_var[first:end]
    choices, actions = lanes.choices[first:end], world.action[first:end]
    cells, afters = world.cell[first:end], world.after[first:end]
    position, velocity = load_reals(world.position, first), load_reals(world.velocity, first)
    time, eta, gravity = load_reals(world.time, first), load_reals(world.lane_eta, first), pull(position)
    for step in range(BLOCK):
        for lane in range(EIGHT):
            if posterior is not None and posterior.live[first + lane]:
                own = Memory(rows[lane], ties[lane], counts[lane], spreads[lane], choices[lane])
                refresh(posterior, first + lane, own, cells[lane], gamma)
            choice, tied = choices[lane, step], ties[lane, cells[lane]]
            if choosing is None:
                actions[lane] = ACTIONS[choice | tied]
            else:
                actions[lane] = ACTIONS[followed(choosing, first + lane, choice, tied, cells[lane])]
        if gusts is not None:
            eta = load_reals(gusts, _gust_place(first, step))
        position, velocity = roll(position, velocity, _pushes(actions) + gravity, eta, hill)
        done = is_done(position, velocity)
        store_whole(afters, 0, chosen(done, goal, bin_of(position, velocity, bins)))
        gravity = pull(position)  # of the next step: as long as the updates, which need not wait for it
        time = time + 1.0
        for lane in range(EIGHT):
            own = Memory(rows[lane], ties[lane], counts[lane], spreads[lane], choices[lane])
            if posterior is not None and posterior.live[first + lane] and afters[lane] < bins * bins:
                refresh(posterior, first + lane, own, afters[lane], gamma)
            update(own, cells[lane], actions[lane], afters[lane], alpha, gamma, potential, visits, td_var)
            if posterior is not None and posterior.live[first + lane]:
                weigh(
                    posterior,
                    first + lane,
                    lanes.task[first + lane],
                    cells[lane],
                    actions[lane],
                    afters[lane],
                )
            cells[lane] = afters[lane]
        ended = bits(done | (time == horizon))
        if ended:
            store_reals(world.position, first, position)
            store_reals(world.velocity, first, velocity)
            store_reals(world.time, first, time)
            reached = bits(done)
            for place in range(EIGHT):
                if ended >> place & 1:
                    lane, won = first + place, reached >> place & 1
                    _end(
                        lane,
                        won,
                        world,
                        setting,
                        tasks,
                        lanes,
                        visits,
                        td_var,
                        evaluation,
                        choosing,
                        posterior,
                    )
            position, velocity = load_reals(world.position, first), load_reals(world.velocity, first)
            time, gravity = load_reals(world.time, first), pull(position)
    store_reals(world.position, first, position)
    store_reals(world.velocity, first, velocity)
    store_reals(world.time, first, time)


@inner
def _learn_in_one(lane, world, setting, tasks, lanes, potential, visits, td_var, gusts, evaluation, choosing):
    """A block of steps in one lane, whose task no longer weighs hypotheses."""
    alpha, gamma, hill, bins = setting.alpha, setting.gamma, world.hill, np.float64(world.bins)
    goal, horizon = bins * bins, np.float64(setting.horizon)
    own, cell, eta = memory(lanes, lane), world.cell[lane], world.lane_eta[lane]
    position, velocity, time = world.position[lane], world.velocity[lane], world.time[lane]
    gravity = pull(position)
    for step in range(BLOCK):
        choice, tied = own.choices[step], own.ties[cell]
        if choosing is not None:
            choice, tied = followed(choosing, lane, choice, tied, cell), 0
        action = ACTIONS[choice | tied]
        if gusts is not None:
            eta = gusts[_gust_place(lane, step)]
        position, velocity = roll(position, velocity, PUSHES[action] + gravity, eta, hill)
        done = is_done(position, velocity)
        after = np.uint32(chosen(done, goal, bin_of(position, velocity, bins)))
        gravity = pull(position)
        time = time + 1.0
        update(own, cell, action, after, alpha, gamma, potential, visits, td_var)
        cell = after
        if done or time == horizon:
            world.time[lane] = time
            _end(lane, done, world, setting, tasks, lanes, visits, td_var, evaluation, choosing, None)
            position, velocity, time = world.position[lane], world.velocity[lane], world.time[lane]
            cell, gravity = world.cell[lane], pull(position)
    world.position[lane], world.velocity[lane] = position, velocity
    world.time[lane], world.cell[lane] = time, cell


@inlined
def _gust_place(lane, step):
    """Where the push of a step in a lane stands."""
    return lane // EIGHT * EIGHT * BLOCK + step * EIGHT + lane % EIGHT


@inlined
def _pushes(actions):
    """PUSHES of eight actions, read one by one: a vector cannot be read at once where its parts were just written."""
    return reals(
        PUSHES[actions[0]],
        PUSHES[actions[1]],
        PUSHES[actions[2]],
        PUSHES[actions[3]],
        PUSHES[actions[4]],
        PUSHES[actions[5]],
        PUSHES[actions[6]],
        PUSHES[actions[7]],
    )


@inlined
def _end(lane, reached, world, setting, tasks, lanes, visits, td_var, evaluation, choosing, posterior):
    """Notes an episode's end, with all that hangs on it, and puts the car where the next one starts."""
    length = np.int64(world.time[lane])
    if posterior is not None and posterior.live[lane]:
        evaluated = False
        if evaluation is not None:
            evaluated = evaluation_due(evaluation, lanes.ended[lane] + 1, setting.episodes)
        goal = np.int64(world.bins * world.bins)
        end_episode(posterior, lanes, memory(lanes, lane), lane, reached, goal, setting, evaluated)
    episode = record_end(length, reached, setting, tasks, lanes, lane, visits, td_var)
    if evaluation is not None and evaluation_due(evaluation, episode + 1, setting.episodes):
        _evaluate(world, setting, lanes, lane, episode + 1, evaluation, world.gusts)
    if choosing is not None:
        learn_of_episode(choosing, lane, length, reached, setting.gamma)
    _put(
        lane, world.start_position[lane, episode % BLOCK], world.start_velocity[lane, episode % BLOCK], world
    )


@inlined
def _put(lane, position, velocity, world):
    """Puts the lane's car there."""
    world.time[lane], world.position[lane], world.velocity[lane] = 0.0, position, velocity
    world.cell[lane] = np.uint32(bin_of(position, velocity, np.float64(world.bins)))


@inner
def _place(world, setting, tasks, lanes, lane, evaluation, choosing, posterior):
    """Gets a task's push and first starts ready; the task is in its lane already."""
    task = lanes.task[lane]
    make_terminal(lanes.rows[lane], world.bins * world.bins)
    world.lane_eta[lane] = world.eta[task]
    position, velocity = _start(world.start, tasks.start_dice[task])
    _put(lane, position, velocity, world)
    _draw_starts(world, tasks, lanes, lane, 0, BLOCK)
    if evaluation is not None:
        _evaluate(world, setting, lanes, lane, 0, evaluation, world.gusts)
    if choosing is not None:
        begin(choosing, lane, task)
    if posterior is not None:
        begin_weighing(posterior, tasks, lane, task)


@inner
def _evaluate(world, setting, lanes, lane, ended, evaluation, gusts):
    """Plays a greedy episode from the target start with what the lane's task has learned in `ended` episodes."""
    task, ties, bins = lanes.task[lane], lanes.ties[lane], np.float64(world.bins)
    rng, eta, length = evaluation.rng[task], world.eta[task], 0
    position, velocity = _start(world.target_start, rng)
    while not is_done(position, velocity) and length < setting.horizon:
        choice = greedy_choice(draw(rng), NO_SLIP[0], NO_SLIP[1], NO_SLIP[2])
        action = ACTIONS[choice | ties[np.int64(bin_of(position, velocity, bins))]]
        if gusts is not None:
            eta = _gusts(world.eta[task], world.noise, rng)[0]
        position, velocity = move(position, velocity, PUSHES[action], eta, world.hill)
        length += 1
    evaluation.steps[task, ended // evaluation.every] = length
    evaluation.reached[task, ended // evaluation.every] = is_done(position, velocity)


@inner
def _draw_starts(world, tasks, lanes, lane, first, end):
    """Replaces the starts that episodes `first` to `end` - 1 left for: all of the next block have theirs."""
    for episode in range(first, end):
        position, velocity = _start(world.start, tasks.start_dice[lanes.task[lane]])
        world.start_position[lane, episode % BLOCK] = position
        world.start_velocity[lane, episode % BLOCK] = velocity


@inlined
def _start(start, rng):
    """Position and velocity at the start of an episode."""
    if start == ANYWHERE:
        position = LEFT + (GOAL - LEFT) * unit(rng)
        return position, -FASTEST + 2 * FASTEST * unit(rng)
    if start == VALLEY:
        return -0.6 + 0.2 * unit(rng), 0.0
    return -0.5, 0.0


@inner
def _draw_gusts(task, lane, world, noise_dice):
    """Pushes for every step of a block, in place of the task's."""
    if noise_dice is not None:
        for step in range(0, BLOCK, 2):
            one, other = _gusts(world.eta[task], world.noise, noise_dice[task])
            world.gusts[_gust_place(lane, step)], world.gusts[_gust_place(lane, step + 1)] = one, other


@inlined
def _gusts(eta, noise, rng):
    """Two normal pushes around eta; Marsaglia's polar method."""
    x, y, square = 0.0, 0.0, 0.0
    while square == 0.0 or square >= 1.0:
        x, y = 2 * unit(rng) - 1, 2 * unit(rng) - 1
        square = x * x + y * y
    scale = noise * math.sqrt(-2 * math.log(square) / square)
    return eta + scale * x, eta + scale * y
