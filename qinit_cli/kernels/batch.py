"""Learning a batch of tasks: what goes in, what comes out, and the call that turns one into the other."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from qinit_cli.arrays import Flags, Floats, Integers
from qinit_cli.kernels.blend import new_blend
from qinit_cli.kernels.lane import (
    FEW,
    Evaluation,
    Hooks,
    LaneSetting,
    Recording,
    Tasks,
    new_lanes,
    new_memory,
)
from qinit_cli.kernels.learner import Batch, new_rate
from qinit_cli.kernels.parts import Function
from qinit_cli.kernels.payment import AsTheWorldSays, new_payment
from qinit_cli.kernels.policies import Choosing, Policies, new_choosing
from qinit_cli.kernels.posterior import Hypotheses, PosteriorState, new_posterior
from qinit_cli.kernels.random_streams import Words
from qinit_cli.kernels.tiles import TiledWorld, tile_memory
from qinit_cli.learning import Learning
from qinit_cli.rewards import Payment
from qinit_cli.watch import Watch

CALL_SECONDS = 0.01  # of learning between two looks at the watch


class Worlds(Protocol):
    """The tasks of one family, B of them; a kernel file has its own.

    Worlds that hold something open are context managers too, and are entered while they are learned.
    """

    @property
    def states(self) -> int: ...

    @property
    def actions(self) -> int: ...

    @property
    def lanes(self) -> int:
        """How many tasks are best learned side by side."""
        ...

    @property
    def alone(self) -> int:
        """Lanes in use of a group that are learned one after the other if there are no more."""
        ...

    @property
    def rng(self) -> Words | None:
        """Randomness of each task's world beyond the steps' own, (B, 4); None: there is none."""
        ...

    def __len__(self) -> int: ...

    def queue(self) -> Integers:
        """The tasks, (B,), in the order in which lanes take them: long ones first, or they end alone."""
        ...

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, Any]:
        """The compiled loop, and the world, a NamedTuple, that it takes."""
        ...


@dataclass(frozen=True)
class LaneStreams:
    """The streams of a batch, as random_streams.lane_seeds and random_streams.seeds make them."""

    rng: Words  # (B, 4, 8) slips, exploration and picks
    starts: Words  # (B, 4) where episodes start
    evaluation: Words | None = None  # (B, 4) greedy episodes; needed if there are any
    choices: Words | None = None  # (B, 4) choosing and following policies; needed if there are any
    learner: Words | None = None  # (B, 4) what a learner draws by itself; needed if it does


@dataclass(frozen=True)
class Start:
    """What learning starts from: the three arrays of a method, and what may change the first of them on the way."""

    table: Floats  # (S, A) or (B, S, A)
    potential: Floats | None = None  # (S,) or (B, S); None: no shaping
    policies: Policies | None = None  # None, or none of them: plain learning
    hypotheses: Hypotheses | None = None  # None, or none of them: the start table stays what it is
    known_at: int | None = (
        None  # updates after which a value is learned alone; None: the table is learned from
    )


@dataclass(frozen=True)
class Records:
    """What is kept of a task besides its table."""

    bins: int  # of the learning curve; as many as episodes keeps every episode
    visits: bool = False
    td_var: bool = False  # running mean, rate 0.01, of the squared TD error
    evaluate_every: int = 0  # a greedy episode before the first and after every n-th; 0: none
    moments: Integers | None = None  # (R,) episodes after which the weights of hypotheses are kept, ascending


@dataclass(frozen=True)
class Weighing:
    """What a batch thought of its hypotheses."""

    weights: Floats  # (B, R, K)
    moves: Integers  # (B,) times that the start table changed
    frozen: Integers  # (B,) episodes after which the weights froze, -1: never


@dataclass(frozen=True)
class Learned:
    """What a batch learned. Of tasks that are not `finished`, nothing else here means anything."""

    q: Floats  # (B, S, A)
    visits: Integers | None  # (B, S, A)
    td_var: Floats | None  # (B, S, A)
    steps: Integers  # (B, bins) sums over the episodes of a bin
    reached: Integers  # (B, bins)
    evaluation_steps: Integers | None  # (B, 1 + episodes // evaluate_every)
    evaluation_reached: Integers | None  # (B, 1 + episodes // evaluate_every)
    weighing: Weighing | None
    returns: (
        Floats | None
    )  # (B, bins) of the episodes where the world tells its rewards and every episode is kept
    evaluation_returns: Floats | None  # (B, 1 + episodes // evaluate_every) as well
    step_count: Integers  # (B,) of learning
    seconds: Floats  # (B,) each task's share, by steps, of the time of its batch
    finished: Flags  # (B,)


def learn(
    worlds: Worlds,
    learning: Learning,
    start: Start,
    streams: LaneStreams,
    records: Records,
    watch: Watch,
    lanes: int | None = None,
    payment: Payment | None = None,
) -> Learned:
    """What the tasks learn: each from its own world, start and streams alone, whatever learns beside it.

    Nothing that is passed in is changed, but the watch. `payment` None: 1 on reaching the goal. ValueError if shapes do not fit.
    """
    batch = len(worlds)
    shape = (batch, worlds.states, worlds.actions)
    _expect("start table", start.table.shape, shape[1:], shape)
    _expect("rng", streams.rng.shape, (batch, 4, 8))
    _expect("start streams", streams.starts.shape, (batch, 4))
    if not 1 <= records.bins <= learning.episodes:
        raise ValueError(f"{records.bins} bins of {learning.episodes} episodes; a bin holds one at least")
    tasks = Tasks(
        q=np.broadcast_to(start.table, shape).astype(np.float64, order="C"),
        rng=streams.rng.copy(),
        start_dice=streams.starts.copy(),
        world_dice=np.zeros((batch, 4), np.uint64) if worlds.rng is None else worlds.rng.copy(),
        episode=np.zeros(batch, np.int64),
        step_count=np.zeros(batch, np.int64),
        finished=np.zeros(batch, np.bool_),
        steps=np.zeros((batch, records.bins), np.int64),
        reached=np.zeros((batch, records.bins), np.int64),
    )
    visits = np.zeros(shape, np.int64) if records.visits else None
    td_var = np.zeros(shape) if records.td_var else None
    evaluation = _evaluation(records.evaluate_every, learning.episodes, streams.evaluation, batch)
    lanes = lanes or worlds.lanes
    advance, world = worlds.loop(learning, lanes)
    if isinstance(world, TiledWorld):
        shaped = start.potential is not None
        if records.visits or records.td_var:
            raise ValueError("visits and TD errors are of the entries of a table, which tiles have not")
        memory: Any = tile_memory(world, worlds.states, worlds.actions, shaped)
    else:
        memory = new_memory(lanes, worlds.states, worlds.actions)
    posterior = _posterior(start.hypotheses, learning.gamma, payment, records.moments, lanes, shape)
    if posterior is not None and start.known_at is not None:
        raise ValueError("hypotheses change the start table, and a blend keeps it")
    if streams.learner is not None:
        _expect("learner streams", streams.learner.shape, (batch, 4))
    inside = Batch(lanes, worlds.states, worlds.actions, streams.learner)
    hooks = Hooks(
        _potential(start.potential, batch, worlds.states),
        _choosing(start.policies, streams.choices, lanes, shape),
        posterior,
    )
    evaluations = 0 if evaluation is None else evaluation.steps.shape[1]
    episodes = records.bins if records.bins == learning.episodes else 0  # returns are of single episodes
    paid = new_payment(payment, world, batch, episodes, evaluations)
    arguments = (
        world,
        _setting(learning, worlds, inside, start.known_at, paid),
        tasks,
        new_lanes(memory, worlds.queue(), learning.learner.waits),
        Recording(visits, td_var, evaluation),
        hooks,
    )
    with worlds if isinstance(worlds, AbstractContextManager) else nullcontext():
        seconds = _run(advance, arguments, tasks, learning.episodes, watch)
    return Learned(
        q=tasks.q,
        visits=visits,
        td_var=td_var,
        steps=tasks.steps,
        reached=tasks.reached,
        evaluation_steps=None if evaluation is None else evaluation.steps,
        evaluation_reached=None if evaluation is None else evaluation.reached,
        weighing=None
        if posterior is None
        else Weighing(posterior.weights, posterior.moves, posterior.frozen),
        returns=paid.returns if isinstance(paid, AsTheWorldSays) else None,
        evaluation_returns=paid.evaluated if isinstance(paid, AsTheWorldSays) else None,
        step_count=tasks.step_count,
        seconds=seconds,
        finished=tasks.finished,
    )


def _run(advance: Any, arguments: tuple[Any, ...], tasks: Tasks, episodes: int, watch: Watch) -> Floats:
    """Calls the loop until the batch is done or the watch stopped; each task's share of the time, (B,)."""
    seconds = np.zeros(len(tasks.q))
    advance(0, *arguments)  # compiles, if need be, outside the time
    blocks = 64
    while not (tasks.finished.all() or watch.stopped):
        before, ended, finished = tasks.step_count.copy(), tasks.episode.sum(), tasks.finished.sum()
        began = time.perf_counter()
        advance(blocks, *arguments)
        elapsed = time.perf_counter() - began
        learned = tasks.step_count - before
        seconds += elapsed * learned / max(1, learned.sum())
        watch.add(
            int(learned.sum()),
            float(tasks.episode.sum() - ended) / episodes,
            int(tasks.finished.sum() - finished),
        )
        blocks = max(1, int(blocks * min(2.0, CALL_SECONDS / max(elapsed, 1e-6))))
    return seconds


def _setting(
    learning: Learning, worlds: Worlds, batch: Batch, known_at: int | None, payment: Any
) -> LaneSetting:
    learner = learning.learner.kernel(learning, batch)
    return LaneSetting(
        gamma=learning.gamma,
        learner=learner if known_at is None else new_blend(learner, known_at, batch),
        rate=new_rate(learning, batch),
        explore=learning.explore.kernel(learning, batch),
        payment=payment,
        episodes=learning.episodes,
        horizon=learning.horizon,
        anywhere=learning.start == "anywhere",
        all_actions=np.uint64((1 << worlds.actions) - 1 if worlds.actions <= FEW else 0),
        alone=worlds.alone,
    )


def _evaluation(every: int, episodes: int, rng: Words | None, batch: int) -> Evaluation | None:
    if every == 0:
        return None
    if every < 0 or rng is None:
        raise ValueError(f"evaluation after every {every} episodes: at least 1, with streams of its own")
    _expect("evaluation streams", rng.shape, (batch, 4))
    shape = batch, 1 + episodes // every
    return Evaluation(every, rng.copy(), steps=np.zeros(shape, np.int64), reached=np.zeros(shape, np.int64))


def _choosing(
    policies: Policies | None, rng: Words | None, lanes: int, shape: tuple[int, int, int]
) -> Choosing | None:
    batch, states, actions = shape
    if policies is None or len(policies.actions) == 0:
        return None
    if policies.weights is None:
        _expect("policies", policies.actions.shape, (len(policies.actions), states))
    else:
        _expect("policies' weights", policies.weights.shape, (len(policies.actions), states, actions))
    if rng is None or policies.actions.min() < 0 or policies.actions.max() >= actions:
        raise ValueError(f"policies need streams of their own, and actions from 0 to {actions - 1}")
    _expect("choice streams", rng.shape, (batch, 4))
    return new_choosing(policies, rng, lanes)


def _posterior(
    hypotheses: Hypotheses | None,
    gamma: float,
    payment: Payment | None,
    moments: Integers | None,
    lanes: int,
    shape: tuple[int, int, int],
) -> PosteriorState | None:
    batch = shape[0]
    if hypotheses is None or len(hypotheses.q) == 0:
        return None
    _expect("hypotheses", hypotheses.q.shape, (len(hypotheses.q), *shape[1:]))
    _expect("hypotheses' TD variance", hypotheses.td_var.shape, hypotheses.q.shape)
    kept = np.empty(0, np.int64) if moments is None else moments
    return new_posterior(hypotheses, gamma, payment, kept, batch, lanes)


def _potential(potential: Floats | None, batch: int, states: int) -> Floats | None:
    if potential is None:
        return None
    _expect("potential", potential.shape, (states,), (batch, states))
    return np.ascontiguousarray(np.atleast_2d(potential), np.float64)


def _expect(name: str, shape: tuple[int, ...], *wanted: tuple[int, ...]) -> None:
    if shape not in wanted:
        raise ValueError(f"the {name} has shape {shape}; it must be {' or '.join(map(str, wanted))}")
