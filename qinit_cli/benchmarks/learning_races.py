"""The compiled loops that train-sources and transfer run, records and all, beside plain loops that keep nothing but the table."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from qinit_cli.arrays import Floats, Tasks
from qinit_cli.benchmarks import plain_loops
from qinit_cli.benchmarks.race import Race, Runner
from qinit_cli.environments.family import Family, draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
from qinit_cli.kernels.random_streams import Words, lane_seeds, seeds
from qinit_cli.learning import Learning
from qinit_cli.pipeline.sources import sequences
from qinit_cli.schedules import Schedule
from qinit_cli.seeding import Stream, sequence
from qinit_cli.watch import Watch

SOURCE_BINS = 100  # of the learning curve, as train-sources has it
CONVERGED_STEPS = 3e8  # of Mountain Car sources, over all tasks: what a converged table has behind it

Plain = Callable[
    [Tasks, Learning, Floats], int
]  # learns each task's table (B, S, A) in place: the steps taken


@dataclass(frozen=True)
class Size:
    """How much is learned in a turn."""

    tasks: int
    scale: float  # of the episodes


FULL, QUICK = Size(16, 1.0), Size(8, 0.02)


@dataclass(frozen=True)
class Stage:
    """A way of learning: what train-sources does, or transfer."""

    name: str
    learning: Learning
    records: Callable[[int], Records]  # given the episodes
    early: int  # episodes from zeros
    converged: int  # episodes from tables learned before


def races(size: Size, loops: ctypes.CDLL | None) -> Iterator[Race]:
    """Both families, learning sources and targets, early and converged; `loops` as plain_c makes them, or None."""
    gridworld, car = Gridworld(), MountainCar()
    yield from _races(
        gridworld,
        size,
        (_sources(gridworld, 2_000, 8_000), _targets(gridworld, 500, 4_000)),
        lambda tasks: gridworld.solve(tasks, gridworld.source_learning.gamma)[0],
        {"plain Numba": _gridworld_in_numba, **({"plain C": _gridworld_in_c(loops)} if loops else {})},
    )
    yield from _races(
        car,
        size,
        (_sources(car, 1_000, 6_000), _targets(car, 500, 4_000)),
        lambda tasks: _converged_cars(car, tasks, size),
        {"plain Numba": _car_in_numba, **({"plain C": _car_in_c(loops)} if loops else {})},
    )
    if loops:
        yield from _tiled_races(car, size, loops)


def _tiled_races(car: MountainCar, size: Size, loops: ctypes.CDLL) -> Iterator[Race]:
    """Mountain Car by 8 tilings of 8 tiles, many tasks side by side and one alone."""
    family: Any = TiledFamily(car, Tiles())
    learning = replace(car.source_learning, episodes=max(10, round(2_000 * size.scale)))
    for count, what in ((size.tasks, "by tiles"), (1, "by tiles, one task")):
        tasks = draw_tasks(car, 0, Stream.SOURCE_TASK, np.arange(count))
        start = np.zeros((count, family.coding.weights, len(car.actions)))
        records = Records(min(SOURCE_BINS, learning.episodes))
        yield Race(
            "kernels",
            f"{car.name} {what}",
            "M steps/s",
            Runner("qinit", _ours(family, tasks, learning, start, records)),
            [Runner("plain C", _plain(_tiled_car_in_c(loops, family.cut), tasks, learning, start))],
        )


def _sources(family: Family, early: int, converged: int) -> Stage:
    def records(episodes: int) -> Records:
        return Records(min(SOURCE_BINS, episodes), visits=True, td_var=True)

    return Stage("sources", family.source_learning, records, early, converged)


def _targets(family: Family, early: int, converged: int) -> Stage:
    return Stage("targets", family.target_learning, Records, early, converged)


def _races(
    family: Family,
    size: Size,
    stages: tuple[Stage, ...],
    converged: Callable[[Tasks], Floats],
    plain: dict[str, Plain],
) -> Iterator[Race]:
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(size.tasks))
    tables = converged(tasks)
    for stage in stages:
        starts = (("early", np.zeros_like(tables), stage.early), ("converged", tables, stage.converged))
        for when, start, episodes in starts:
            learning = replace(stage.learning, episodes=max(10, round(episodes * size.scale)))
            yield Race(
                "kernels",
                f"{family.name} {stage.name}, {when}",
                "M steps/s",
                Runner("qinit", _ours(family, tasks, learning, start, stage.records(learning.episodes))),
                [Runner(name, _plain(loop, tasks, learning, start)) for name, loop in plain.items()],
            )


def _ours(
    family: Family, tasks: Tasks, learning: Learning, start: Floats, records: Records
) -> Callable[[], float]:
    return lambda: float(learned(family, tasks, learning, start, records)[1])


def learned(
    family: Family, tasks: Tasks, learning: Learning, start: Floats, records: Records
) -> tuple[Floats, int]:
    """The tables learned, (B, S, A), and the steps that took."""
    indices = np.arange(len(tasks))
    streams = LaneStreams(
        rng=lane_seeds(sequences(0, Stream.SOURCE_DICE, indices)),
        starts=seeds(sequences(0, Stream.SOURCE_START, indices)),
        learner=seeds(sequences(0, Stream.SOURCE_LEARNER, indices)),
    )
    worlds = family.worlds(tasks, sequences(0, Stream.SOURCE_WORLD, indices))
    batch = learn(worlds, learning, Start(start), streams, records, Watch())
    return batch.q, int(batch.step_count.sum())


def _converged_cars(family: MountainCar, tasks: Tasks, size: Size) -> Floats:
    """Tables of Mountain Car after long learning, (B, S, A); there are no exact ones."""
    steps_of_an_episode = 150
    episodes = max(10, round(CONVERGED_STEPS * size.scale / len(tasks) / steps_of_an_episode))
    learning = replace(family.source_learning, episodes=episodes)
    start = np.zeros((len(tasks), family.bins**2, len(family.actions)))
    return learned(family, tasks, learning, start, Records(1, visits=True, td_var=True))[0]


def _plain(loop: Plain, tasks: Tasks, learning: Learning, start: Floats) -> Callable[[], float]:
    return lambda: float(loop(tasks, learning, start.copy()))


def _numba_arguments(learning: Learning) -> tuple[bool, float, float, float, int, int]:
    alpha, epsilon = learning.alpha, learning.epsilon
    if isinstance(alpha, Schedule) or isinstance(epsilon, Schedule):
        raise NotAllowed("the plain loops know no schedules")
    return (
        learning.start == "anywhere",
        alpha,
        learning.gamma,
        epsilon,
        learning.episodes,
        learning.horizon,
    )


def _gridworld_in_numba(tasks: Tasks, learning: Learning, tables: Floats) -> int:
    rng, size = np.random.default_rng(0), round(tables.shape[1] ** 0.5)
    return sum(
        plain_loops.gridworld(
            rng, q, size, int(row) * size + int(column), float(p), *_numba_arguments(learning)
        )
        for q, (row, column, p) in zip(tables, tasks.tolist(), strict=True)
    )


def _car_in_numba(tasks: Tasks, learning: Learning, tables: Floats) -> int:
    rng, bins = np.random.default_rng(0), round(tables.shape[1] ** 0.5)
    return sum(
        plain_loops.mountain_car(rng, q, bins, float(eta), 0.0, *_numba_arguments(learning))
        for q, eta in zip(tables, tasks["eta"].tolist(), strict=True)
    )


def _gridworld_in_c(loops: ctypes.CDLL) -> Plain:
    def run(tasks: Tasks, learning: Learning, tables: Floats) -> int:
        state, size = _state(), round(tables.shape[1] ** 0.5)
        return sum(
            loops.gridworld(
                state.ctypes.data,
                q.ctypes.data,
                size,
                int(row) * size + int(column),
                p,
                *_numba_arguments(learning),
            )
            for q, (row, column, p) in zip(tables, tasks.tolist(), strict=True)
        )

    return run


def _car_in_c(loops: ctypes.CDLL) -> Plain:
    def run(tasks: Tasks, learning: Learning, tables: Floats) -> int:
        state, bins = _state(), round(tables.shape[1] ** 0.5)
        return sum(
            loops.mountain_car(state.ctypes.data, q.ctypes.data, bins, eta, 0.0, *_numba_arguments(learning))
            for q, eta in zip(tables, tasks["eta"].tolist(), strict=True)
        )

    return run


def _tiled_car_in_c(loops: ctypes.CDLL, cut: Tiles) -> Plain:
    def run(tasks: Tasks, learning: Learning, weights: Floats) -> int:
        state = _state()
        return sum(
            loops.tiled_car(
                state.ctypes.data, w.ctypes.data, cut.tilings, cut.tiles, eta, *_numba_arguments(learning)
            )
            for w, eta in zip(weights, tasks["eta"].tolist(), strict=True)
        )

    return run


def _state() -> Words:
    """The state of the C loops' generator, (4,)."""
    state: Words = seeds([sequence(0, Stream.SOURCE_DICE, 0)])[0]
    return state
