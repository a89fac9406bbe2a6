"""Learning target tasks from what a method starts them with."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.run import projection_errors
from qinit_cli.artefacts.tile_columns import joined, probe_columns, start_columns, weight_columns
from qinit_cli.environments.family import Family, bounds_of, task_count
from qinit_cli.environments.tiled import PROJECTED, TiledFamily
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learners import LEARNERS, Learner
from qinit_cli.learners.exploration import EpsilonGreedy
from qinit_cli.methods import Initial, Method
from qinit_cli.pipeline.probes import probes_of
from qinit_cli.pipeline.sources import (
    Rows,
    by_learner,
    check_learned,
    check_returns,
    in_names,
    sequences,
    shaped,
    tells_returns,
)
from qinit_cli.tasks import TargetTasks

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.fitted import FittedTables
    from qinit_cli.pipeline.asked import LearningTargets
    from qinit_cli.pipeline.beginning import Beginning
    from qinit_cli.pipeline.degenerate import TargetsLearned
    from qinit_cli.pipeline.job import Made, Plan, Prepared
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.watch import Watch

EPISODE_BYTES, EVALUATION_BYTES = 5, 20  # in a run: steps and goal; return, share that arrives and steps
RETURN_BYTES = 8  # of an episode whose rewards the world tells


def targets_of(
    method: Method, learning: LearningTargets, sources: SourcesSettings
) -> tuple[TargetTasks, int]:
    """The target tasks that are asked for, given the sources of a fit, and how many; NotAllowed where no run could hold them.

    UsageError where they cannot be learned so from what the method starts them with.
    """
    from qinit_cli.pipeline.room import Footprint, check_artefact

    family = learning.family(sources.family.installed())
    settings = learning.learning(family, sources.learning)
    check_together(method, settings.learner, blends=learning.blends)
    check_counted(method, family)
    check_learned(family, settings)
    targets = TargetTasks(
        family,
        settings,
        learning.seed,
        learning.keep_q,
        learning.evaluate_every,
        known_at=learning.updates_known,
    )
    count = task_count(family, "target", learning.tasks)
    episode = EPISODE_BYTES + RETURN_BYTES * tells_returns(family, settings.gamma)
    check_artefact(Footprint(count, settings.episodes * episode + targets.evaluations * EVALUATION_BYTES))
    return targets, count


def check_together(method: Method, learner: Learner, *, blends: bool = False) -> None:
    """UsageError where the learner cannot use what the method brings beside a start table, or one of them goes with no blend."""
    beside = {
        "changes its start": method.weighs,
        "shapes rewards": method.shapes,
        "follows policies": method.follows,
    }
    if blends and any(beside.values()):
        brings = next(what for what, holds in beside.items() if holds)
        raise UsageError(
            f"{method.name} {brings} while a task is learned, and --blend takes a method that is a start table alone; "
            "leave out --blend"
        )
    if blends and not learner.blends:
        raise UsageError(
            f"--blend changes a one-step update of one value, which --learner {learner.name} does not make; {_those('blends')} do"
        )
    if method.weighs and not learner.weighs:
        raise UsageError(
            f"{method.name} changes its start while a task is learned, as --learner {learner.name} does not allow; "
            f"{_those('weighs')} do"
        )
    if method.shapes and not learner.shapes:
        raise UsageError(
            f"{method.name} shapes rewards, from which --learner {learner.name} does not learn; {_those('shapes')} do"
        )


def check_counted(method: Method, family: Family) -> None:
    """NotAllowed where the method needs what is counted by state-action, and the family does not count."""
    if method.weighs and not family.counted:
        raise NotAllowed(
            f"{method.name} corrects for the (1 - alpha)^n of the start that n updates leave in an entry of a table, which "
            "weights that many states share do not obey; choose another method, or learn tables"
        )


def _those(what: str) -> str:
    """The learners that are said to have something."""
    return ", ".join(name for name, kind in LEARNERS.items() if getattr(kind, what))


def learning_bytes(episodes: int) -> int:
    """Bytes in memory for the episodes of a task while it is learned: its steps and goals, 8 bytes each."""
    return 16 * episodes


def stem_of(method: Method, targets: TargetTasks, count: int) -> str:
    """What the default name of a run begins with."""
    learner = in_names(targets.learning.learner.name)
    return (
        f"{targets.family.label}-{_in_a_name(targets.label_of(method))}{learner}-{count}-seed-{targets.seed}"
    )


def plan_of(
    method: Method,
    targets: TargetTasks,
    beginning: Beginning,
    count: int,
    known: Knowledge,
    more: Sequence[Mapping[str, str]] = (),
) -> Plan:
    """The run of so many targets from what the method starts them with; `more` are inputs beside the fit and the tables."""
    from qinit_cli.artefacts.settings import RunSettings
    from qinit_cli.pipeline.job import Plan

    if isinstance(targets.family, TiledFamily) and isinstance(known.family, TiledFamily):
        targets = replace(targets, family=targets.family.placed(known.family.at))
    return Plan(
        stem=stem_of(method, targets, count),
        settings=RunSettings.of(method, targets, count, known.content_sha256, known.settings),
        family=targets.family,
        schema=_schema(targets, beginning.outline),
        prepare=partial(_prepared, targets, beginning, [known.given, *more]),
        what=targets.label_of(method),
        read=known.source,
        learning_bytes=learning_bytes(targets.learning.episodes),
    )


def _prepared(targets: TargetTasks, beginning: Beginning, inputs: Sequence[Mapping[str, str]]) -> Prepared:
    """How the targets are learned, with the arrays that the method makes and their projection onto tiles."""
    from qinit_cli.pipeline.job import Prepared

    initial = beginning.initial
    return Prepared(
        learn=partial(learn_targets, targets, initial),
        kernel=_kernel(targets, initial),
        inputs=[*inputs, *beginning.inputs],
        statics=statics(initial, targets.family),
    )


def from_zeros(targets: TargetTasks, count: int) -> Plan:
    """A run of so many targets from a start of zeros, for trials: of no fit, and not to be kept."""
    from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings
    from qinit_cli.fitted import FitOptions
    from qinit_cli.kernels.policies import Policies
    from qinit_cli.methods.zero import Zero
    from qinit_cli.pipeline.job import Plan, Prepared
    from qinit_cli.pipeline.probes import with_probes
    from qinit_cli.tasks import SourceTasks

    sources = SourceTasks(targets.family, targets.learning.learner.name, targets.learning, targets.seed)
    sources = with_probes(sources)
    family = sources.family
    targets = replace(targets, family=family)
    states, nothing = math.prod(family.shape), "0" * 64
    start = np.zeros((states, len(family.actions)))
    initial = Initial(start, np.zeros(states), Policies(np.empty((0, states), np.int64)), 0, 0)
    fit = FitSettings.of(SourcesSettings.of(sources, count), nothing, FitOptions())
    return Plan(
        stem="trial",
        settings=RunSettings.of(Zero(), targets, count, nothing, fit),
        family=family,
        schema=_schema(targets, initial),
        prepare=lambda: Prepared(partial(learn_targets, targets, initial), _kernel(targets, initial)),
        what="a trial",
        learning_bytes=learning_bytes(targets.learning.episodes),
    )


def _in_a_name(label: str) -> str:
    """The label as it may stand in an artefact's name."""
    return re.sub(r"[^A-Za-z0-9._-]", "-", label.replace("+", "-plus-"))


def _kernel(targets: TargetTasks, initial: Initial) -> str:
    """The name of the compiled code that these targets need: features that are not used are not compiled in."""
    features = {
        "with shaping": initial.potential.any(),
        "with policies": len(initial.policies.actions) > 0,
        "with evaluations": targets.evaluate_every > 0,
        "with weights": initial.hypothesis_count > 0,
        "with a blend": targets.known_at is not None,
    }
    first = f"{targets.family.name} targets{by_learner(targets.learning)}"
    return ", ".join([first, *(name for name, used in features.items() if used)])


def _schema(targets: TargetTasks, initial: Initial) -> Any:
    from qinit_cli.artefacts.opening import action_axis
    from qinit_cli.artefacts.run import run_schema

    family = targets.family
    more_axes, more = joined(
        probe_columns(family),
        start_columns(family, per_task=initial.start_per_task),
        weight_columns(family, kept=targets.keep_q),
    )
    return run_schema(
        family.axes(),
        action_axis(family),
        family.parameters(),
        targets.learning.episodes,
        start_per_task=initial.start_per_task,
        potential_per_task=initial.potential_per_task,
        exact_values=family.tabular,
        attainable=isinstance(targets.learning.explore, EpsilonGreedy),
        bounds=bounds_of(family, targets.learning.gamma),
        told_returns=tells_returns(family, targets.learning.gamma),
        evaluations=targets.evaluations,
        keep_q=targets.keep_q,
        updating=targets.keep_visits,
        hypotheses=initial.hypothesis_count,
        moments=targets.moments,
        more_axes=more_axes,
        more=more,
        tiled=isinstance(family, TiledFamily),
    )


def learn_targets(
    targets: TargetTasks, initial: Initial, indices: Integers, watch: Watch
) -> tuple[Integers, Rows]:
    """The ids of the tasks that were finished, and a row for each column of the artefact; fewer once `watch` was stopped."""
    from qinit_cli.analysis.returns import earned
    from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
    from qinit_cli.kernels.random_streams import lane_seeds, seeds

    family, learning = targets.family, targets.learning
    tasks, paid = targets.draw(indices), family.payment(learning.gamma)
    own = initial.of(indices)
    learned = learn(
        family.worlds(tasks, sequences(targets.seed, targets.streams.world, indices)),
        learning,
        Start(
            family.to_weights(own.start),
            family.to_weights(own.potential[..., None])[..., 0] if own.potential.any() else None,
            own.policies,
            own.hypotheses,
            targets.known_at,
        ),
        LaneStreams(
            rng=lane_seeds(sequences(targets.seed, targets.streams.rng, indices)),
            starts=seeds(sequences(targets.seed, targets.streams.start, indices)),
            evaluation=seeds(sequences(targets.seed, targets.streams.evaluation, indices)),
            choices=seeds(sequences(targets.seed, targets.streams.choice, indices)),
            learner=seeds(sequences(targets.seed, targets.streams.learner, indices)),
        ),
        Records(
            bins=learning.episodes,
            visits=targets.keep_visits,
            evaluate_every=targets.evaluate_every,
            moments=targets.moments,
        ),
        watch,
        payment=paid,
    )
    kept = learned.finished
    family.check_learned(learned.q[kept], bounds_of(family, learning.gamma).width)
    rows: Rows = {
        "steps": learned.steps[kept].astype(np.int32),
        "reached": learned.reached[kept].astype(np.uint8),
        "seconds": learned.seconds[kept],
        **{name: tasks[name][kept] for name in tasks.dtype.names or ()},
    }
    if learned.returns is not None:
        rows["return"] = learned.returns[kept]
    if family.tabular:
        exact, _ = family.solve(tasks[kept], learning.gamma)
        check_returns(family, learning.gamma, exact)
        rows["v_star"] = family.start_values(tasks[kept], exact)
        if isinstance(learning.explore, EpsilonGreedy):
            rows["v_eps"] = family.exploring_value(tasks[kept], exact, learning)
        else:  # what other explorations are worth depends on all that was met before
            rows["v_eps"] = np.full(len(exact), np.nan)
    if learned.evaluation_steps is not None and learned.evaluation_reached is not None:
        reached = learned.evaluation_reached[kept].astype(bool)
        evaluated: Rows = {"steps": learned.evaluation_steps[kept], "reached": reached}
        if learned.evaluation_returns is not None:
            evaluated["return"] = learned.evaluation_returns[kept]
        rows["eval_return"] = earned(evaluated, paid, learning.gamma)
        rows["eval_reached"] = reached.astype(np.float64)
        rows["eval_steps"] = learned.evaluation_steps[kept].astype(np.int32)
    if learned.weighing is not None:
        rows["weight"] = learned.weighing.weights[kept].astype(np.float32)
        rows["moves"] = learned.weighing.moves[kept].astype(np.int32)
        rows["frozen"] = learned.weighing.frozen[kept].astype(np.int32)
    if targets.keep_q:
        rows |= family.kept(learned.q[kept])
    if learned.visits is not None:
        rows["visits"] = learned.visits[kept]
    if initial.start_per_task:
        rows["start"] = own.start[kept]
    if initial.potential_per_task:
        rows["potential"] = own.potential[kept].reshape(-1, *family.shape)
    return indices[kept], shaped(rows, family, ("q", "visits", "start"))


def statics(initial: Initial, family: Family) -> dict[str, Floats]:
    """What a run keeps of the method's arrays that is the same for every target, laid out along the state axes."""
    kept: dict[str, Floats] = probes_of(family)
    if isinstance(family, TiledFamily) and not initial.start_per_task:
        kept["start_weights"] = family.to_weights(initial.start)
        kept[PROJECTED] = family.projection.values(kept["start_weights"])
    if not initial.start_per_task:
        kept["start"] = initial.start.reshape(*family.shape, -1)
    if not initial.potential_per_task:
        kept["potential"] = initial.potential.reshape(family.shape)
    return kept


def projected(made: Made, family: Family) -> dict[str, float]:
    """Errors at the probes of the weights that stand for a run's start, and how many weights there are.

    Nothing for tables, nor where every target has a start of its own. `family` is that of the sources, with its probes.
    """
    from qinit_cli.artefacts.opening import open_artefact

    if not isinstance(family, TiledFamily):
        return {}
    with open_artefact(made.source, "run") as artefact:
        if PROJECTED not in {column.name for column in artefact.schema.static_columns}:
            return {}
        start, values = artefact.read("start"), artefact.read(PROJECTED)
    rank = family.projection.rank
    return {
        **projection_errors(start, values),
        "weights": family.coding.weights,
        "weights_untouched": family.projection.untouched,
        **({} if rank is None else {"weights_rank": rank}),
    }


def learned(made: Made, targets: TargetTasks, fit: FittedTables) -> TargetsLearned:
    """What became of the targets of a run; unsolvable are those that neither the family's own rule nor any episode solved."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.pipeline.degenerate import TargetsLearned

    with open_artefact(made.source, "run") as artefact:
        reached: Flags = np.zeros(artefact.task_count, np.bool_)
        first = episodes = steps = 0
        for block in artefact.blocks(("reached", "steps"), artefact.schema.block_size):
            reached[first : first + len(block["task"])] = block["reached"].any(axis=1)
            first += len(block["task"])
            episodes += int(block["reached"].sum())
            steps += int(block["steps"].sum())
        drawn = targets.draw(artefact.tasks)
    solvable = targets.family.solvable(drawn, reached, targets.learning.horizon)
    return TargetsLearned(
        tasks=len(reached),
        reached=episodes,
        unsolvable=int((~solvable).sum()),
        steps=steps / len(reached) if len(reached) else 0.0,
        knows=bool(fit.known.any()),
        least_return=_without_the_goal(targets),
    )


def _without_the_goal(targets: TargetTasks) -> float | None:
    """The return of an episode without the goal; None where the world tells its rewards."""
    gamma = targets.learning.gamma
    return None if tells_returns(targets.family, gamma) else bounds_of(targets.family, gamma).low
