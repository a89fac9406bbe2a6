"""Learning source tasks: what one batch of them leaves behind."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.columns import ROUNDING
from qinit_cli.artefacts.tile_columns import joined, probe_columns, weight_columns
from qinit_cli.environments.family import Family, bounds_of, draw_tasks
from qinit_cli.environments.tiled import TiledFamily
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learners import QLearner
from qinit_cli.learners.exploration import EpsilonGreedy
from qinit_cli.learning import Learning
from qinit_cli.schedules import Schedule
from qinit_cli.seeding import Stream, sequence
from qinit_cli.tasks import SourceTasks

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats, Integers, Tasks
    from qinit_cli.pipeline.asked import LearningSources
    from qinit_cli.pipeline.job import Plan, Prepared
    from qinit_cli.watch import Watch

Rows = dict[str, Any]  # column name: array with a leading task axis


def tasks_of(family: Family, sources: LearningSources) -> SourceTasks:
    """The tasks that are asked for; UsageError where the family cannot be learned so."""
    learning = sources.learning(type(family))
    if (cut := sources.cut) is not None:
        _check_no_bins(family)
        family = TiledFamily(family, cut).placed(None)
    if sources.exact and not family.tabular:
        raise UsageError(f"{family.untabled}, so there are no exact tables; leave out --learner exact")
    check_learned(family, learning)
    return SourceTasks(family, "exact" if sources.exact else learning.learner.name, learning, sources.seed)


def _check_no_bins(family: Any) -> None:
    """UsageError where a family that is to be tiled was asked for other bins than it has by default."""
    usual = {one.name: one.default for one in fields(family) if one.name == "bins"}
    if usual and family.bins != replace(family, **usual).bins:
        raise UsageError(
            "--bins is of a table, and --representation tiles has --tiles in its place; leave out one of them"
        )


def check_learned(family: Family, learning: Learning) -> None:
    """UsageError where the family cannot be learned so."""
    if refusal := family.refusal(learning):
        raise UsageError(refusal)
    try:
        family.payment(learning.gamma)
    except ValueError as error:
        raise UsageError(str(error)) from error


def plan_of(tasks: SourceTasks, count: int) -> Plan:
    """The artefact that holds these tasks, learned to the end."""
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.pipeline.job import Plan

    role = "" if tasks.role == "source" else "-targets"
    return Plan(
        stem=f"{tasks.family.label}{in_names(tasks.learner)}{role}-{count}-seed-{tasks.seed}",
        settings=SourcesSettings.of(tasks, count),
        family=tasks.family,
        schema=_schema(tasks),
        prepare=partial(_prepared, tasks),
        what="sources" if tasks.role == "source" else "optimal tables",
    )


def _prepared(tasks: SourceTasks) -> Prepared:
    """How the tasks are learned, with the probes of tiles, which pilots are learned for."""
    from qinit_cli.pipeline.job import Prepared
    from qinit_cli.pipeline.probes import probes_of, with_probes

    exact, placed = tasks.learner == "exact", with_probes(tasks)
    return Prepared(
        learn=partial(learn_sources, placed),
        kernel=f"{tasks.family.name} {'exact tables' if exact else f'sources{by_learner(tasks.learning)}'}",
        statics=probes_of(placed.family),
    )


def in_names(learner: str) -> str:
    """The learner in an artefact's name: nothing where it is Q-learning."""
    return "" if learner == QLearner.name else f"-{learner}"


def by_learner(learning: Learning) -> str:
    """Learner, exploration and schedules in the name of compiled code: nothing for epsilon-greedy Q-learning by numbers."""
    several = (learning.learner.name, learning.explore.name)
    unusual = [name for name in several if name not in (QLearner.name, EpsilonGreedy.name)]
    scheduled = {"alpha": learning.alpha, "epsilon": learning.epsilon}
    unusual += [f"{one.name} {name}" for name, one in scheduled.items() if isinstance(one, Schedule)]
    return f" by {', '.join(unusual)}" if unusual else ""


def _schema(tasks: SourceTasks) -> Any:
    from qinit_cli.artefacts.opening import action_axis
    from qinit_cli.artefacts.sources import sources_schema

    family, bounds = tasks.family, bounds_of(tasks.family, tasks.learning.gamma)
    of_tiles = joined(probe_columns(family), weight_columns(family, kept=True))
    return sources_schema(
        family.axes(),
        action_axis(family),
        family.parameters(),
        tasks.bins,
        bounds,
        *of_tiles,
        tiled=isinstance(family, TiledFamily),
    )


def learn_sources(sources: SourceTasks, indices: Integers, watch: Watch) -> tuple[Integers, Rows]:
    """The ids of the tasks that were finished, and a row for each column of the artefact; fewer once `watch` was stopped."""
    tasks = draw_tasks(sources.family, sources.seed, sources.streams.task, indices)
    rows = _exact(sources, tasks) if sources.learner == "exact" else learned(sources, tasks, indices, watch)
    finished = rows.pop("finished")
    tasks, kept = tasks[finished], {name: values[finished] for name, values in rows.items()}
    family, q = sources.family, kept.pop("q")  # tables, or weights of tiles
    family.check_learned(q, bounds_of(family, sources.learning.gamma).width)
    kept["eopl"] = family.path_lengths(tasks, q, sources.learning.horizon)
    kept["solved"] = family.solved(tasks, q, sources.learning.horizon)
    kept |= family.kept(q)
    check_returns(family, sources.learning.gamma, kept["q"])
    kept |= {name: tasks[name] for name in tasks.dtype.names or ()}
    return indices[finished], shaped(kept, sources.family)


def shaped(rows: Rows, family: Family, tables: tuple[str, ...] = ("q", "td_var", "eopl", "visits")) -> Rows:
    """The rows with the tables' state axis (S) laid out along the family's state axes."""
    return {
        name: values.reshape(len(values), *family.shape, len(family.actions)) if name in tables else values
        for name, values in rows.items()
    }


def _exact(sources: SourceTasks, tasks: Tasks) -> Rows:
    import time

    sources.family.solve(tasks[:0], sources.learning.gamma)  # compiles, if need be, outside the time
    began = time.perf_counter()
    q, td_var = sources.family.solve(tasks, sources.learning.gamma)
    share = (time.perf_counter() - began) / max(1, len(tasks))
    return {
        "q": q,
        "td_var": td_var,
        "visits": np.zeros(q.shape, np.int64),
        "steps": np.zeros(len(tasks), np.int64),
        "seconds": np.full(len(tasks), share),
        "finished": np.ones(len(tasks), bool),
    }


def learned(sources: SourceTasks, tasks: Tasks, indices: Integers, watch: Watch) -> Rows:
    """What learning alone leaves of these tasks, without path lengths; meaningless where not `finished`."""
    from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
    from qinit_cli.kernels.random_streams import lane_seeds, seeds

    family, gamma = sources.family, sources.learning.gamma
    optimism = sources.learning.learner.optimism
    # Q-learning begins at a return of 0, whatever the bounds
    first = optimism and bounds_of(family, gamma).value(optimism)
    worlds = family.worlds(tasks, sequences(sources.seed, sources.streams.world, indices))
    batch = learn(
        worlds,
        sources.learning,
        Start(np.full((worlds.states, worlds.actions), first)),
        LaneStreams(
            rng=lane_seeds(sequences(sources.seed, sources.streams.rng, indices)),
            starts=seeds(sequences(sources.seed, sources.streams.start, indices)),
            learner=seeds(sequences(sources.seed, sources.streams.learner, indices)),
        ),
        Records(sources.bins, visits=family.counted, td_var=family.counted),
        watch,
        payment=family.payment(gamma),
    )
    episodes = bin_sizes(sources.learning.episodes, sources.bins)
    counted = {"td_var": batch.td_var, "visits": batch.visits} if family.counted else {}
    return {
        "q": batch.q,
        **counted,
        "curve_steps": (batch.steps / episodes).astype(np.float32),
        "curve_reached": (batch.reached / episodes).astype(np.float32),
        "steps": batch.step_count,
        "seconds": batch.seconds,
        "finished": batch.finished,
    }


def tells_returns(family: Family, gamma: float) -> bool:
    """Whether the world tells its rewards, so that a run keeps the return of each episode."""
    paid = family.payment(gamma)
    return paid is not None and paid.step is None


def check_returns(family: Family, gamma: float, returns: Floats) -> None:
    """NotAllowed where values leave the bounds of rewards that the world tells: their shares would have no meaning.

    Sums of weights leave them by approximating; `check_learned` judges those.
    """
    if isinstance(family, TiledFamily) or not tells_returns(family, gamma):
        return
    bounds = bounds_of(family, gamma)
    slack = ROUNDING * bounds.width
    beyond = returns[~((returns >= bounds.low - slack) & (returns <= bounds.high + slack))]
    if beyond.size:
        raise NotAllowed(
            f"a task of {family.label} has the value {beyond[0]:g}, and returns are from {bounds.low:g} to {bounds.high:g}; "
            f"give wider bounds"
        )


def sequences(seed: int, stream: Stream, indices: Integers) -> list[np.random.SeedSequence]:
    """The seed sequences of some tasks."""
    return [sequence(seed, stream, int(index)) for index in indices]


def bin_sizes(episodes: int, bins: int) -> Integers:
    """How many episodes fall into each bin, (bins,), where episode e falls into bin e * bins // episodes."""
    # Python's numbers: no product is too large
    first = [-(-number * episodes // bins) for number in range(bins + 1)]
    return np.array([after - before for before, after in pairwise(first)], np.int64)
