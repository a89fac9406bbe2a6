"""`qinit transfer METHOD FIT`: learn target tasks from what a method starts them with."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, get_args, get_type_hints

import typer

from qinit_cli.commands.build import Group, Reference, add_command, add_each
from qinit_cli.commands.groups import DISPLAY, IMPORTS, OUTPUT, WORK, Display, Output, Work
from qinit_cli.commands.messages import note
from qinit_cli.environments import FAMILIES, Family, family_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.fields import check, flag, option, options, tunable
from qinit_cli.learning import Learning
from qinit_cli.methods import METHODS, Initial, Method
from qinit_cli.nearest import nearest
from qinit_store.wording import counted, magnitude, noun, plain

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags
    from qinit_cli.commands.making import Made, Plan, Tally
    from qinit_cli.fitted import Fit
    from qinit_cli.pipeline.degenerate import TargetsLearned
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.transfer import TargetTasks

EPISODE_BYTES, EVALUATION_BYTES = 5, 20  # in a run: steps and goal; return, share that arrives and steps
FROM_SOURCES = ("alpha", "gamma", "horizon")  # targets are learned with these settings of the sources


@dataclass(frozen=True)
class LearningTargets:
    """How target tasks are learned; None: as the fit's sources or the family have it."""

    tasks: int | None = option(None, "Target tasks.", low=1, metavar="N")
    seed: int = option(0, "Root of the targets' chance: every method meets the same tasks and dice.", low=0)
    episodes: int | None = option(None, "Episodes of each task.", low=1)
    horizon: int | None = option(None, "Steps after which an episode is cut off.", low=1, seldom=True)
    alpha: float | None = option(None, "Step size.", above=0, high=1, seldom=True)
    gamma: float | None = option(None, "Discount.", above=0, high=1, seldom=True)
    epsilon: float | None = option(None, "Chance that a step explores.", low=0, high=1, seldom=True)
    start: Literal["anywhere", "fixed"] | None = option(
        None, "Where episodes start: at the family's target start, or anywhere.", seldom=True
    )
    shift: list[str] | None = option(
        None,
        "Draw targets from a changed family, such as variance=10; may be given several times.",
        metavar="KEY=VALUE",
        seldom=True,
    )
    evaluate_every: int = option(
        0,
        "Evaluate greedily, without learning, before the first episode and after every N-th; 0: never.",
        low=0,
        metavar="N",
        seldom=True,
    )
    keep_q: bool = option(False, "Keep the learned tables too.", seldom=True)

    def __post_init__(self) -> None:
        check(self)

    def learning(self, family: Family, sources: dict[str, Any]) -> Learning:
        """The family's way of learning targets, with alpha, gamma and horizon of the sources, and what was asked on top."""
        given = {name: sources[name] for name in FROM_SOURCES}
        names = ("episodes", "horizon", "alpha", "gamma", "epsilon", "start")
        asked = {name: value for name in names if (value := getattr(self, name)) is not None}
        try:
            return replace(family.target_learning, **(given | asked))
        except ValueError as error:
            raise UsageError(f"--{error}") from error

    def family(self, sources: Family) -> Family:
        """The sources' family with the shifts made; UsageError, one sentence, where they cannot be."""
        changes = dict(_change(sources, text) for text in self.shift or [])
        try:
            return sources.shifted(changes) if changes else sources
        except ValueError as error:
            raise UsageError(f"--shift: {error}") from error


@dataclass(frozen=True)
class Tuned:
    """Where a method's parameters may come from."""

    tuned: str | None = option(
        None,
        "Take the parameters that qinit tune chose, and what it was given besides: its artefact.",
        metavar="TUNING",
        default_text="the method's options",
        seldom=True,
    )

    def applied(self, method: Method, output: Output, family: Family) -> tuple[Method, list[dict[str, str]]]:
        """The method with what was chosen, and the choice as an input; UsageError where both say something."""
        if self.tuned is None:
            return method, []
        from qinit_cli.artefacts.opening import open_artefact
        from qinit_cli.commands import references
        from qinit_cli.pipeline.tuning import settings

        with open_artefact(
            references.one(self.tuned, output.store, output=output.output), "tuning"
        ) as artefact:
            name = artefact.spec["method"]["name"]
            if name != method.name:
                raise NotAllowed(f"{self.tuned} chose parameters of {name}, not of {method.name}")
            drawn, wanted = family_of(artefact.spec), settings(artefact)
            given = {"role": "tuning", "name": artefact.path.stem, "content_sha256": artefact.content_sha256}
        if drawn != family:
            raise NotAllowed(
                f"{self.tuned} chose parameters for {drawn.label}; this fit is of {family.label}: tune its own sources"
            )
        defaults = {one.name: one.default for one in options(type(method))}
        clash = [one for one, value in wanted.items() if getattr(method, one) not in (defaults[one], value)]
        if clash:
            raise UsageError(
                f"{flag(clash[0])} and --tuned both say what {clash[0]} is; leave one of them out"
            )
        return replace(method, **wanted), [given]  # type: ignore[type-var]  # every concrete method is a dataclass


NOT_TUNED = Tuned()


def learning_group() -> Group:
    """How targets are learned, as options."""
    return Group(LearningTargets, "Targets", _defaults())


def add_to(methods: typer.Typer) -> None:
    """Adds one subcommand per method."""
    add_each(methods, METHODS, partial(_add, learning_group()))


def _add(targets: Group, methods: typer.Typer, name: str, method: type[Method]) -> None:
    add_command(
        methods,
        name,
        transfer,
        {
            "method": Group(method, "Method"),
            **({"tuned": Group(Tuned, "Method")} if tunable(method) else {}),
            "learning": targets,
            "output": OUTPUT,
            "work": WORK,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(Reference("fit", "A fit: a path, a name in the store, or - for stdin."),),
        help=method.__doc__ or "",
    )


def _defaults() -> dict[str, str]:
    from_family = {
        "tasks": _from_the_family({name: str(family.target_tasks) for name, family in FAMILIES.items()})
    }
    for setting in ("episodes", "epsilon", "start"):
        values = {name: str(getattr(family.target_learning, setting)) for name, family in FAMILIES.items()}
        from_family[setting] = _from_the_family(values)
    return from_family | dict.fromkeys(FROM_SOURCES, "from the fit")


def _from_the_family(values: dict[str, str]) -> str:
    """A default that each family sets, as the help shows it; `values` by family."""
    several = len(set(values.values())) > 1
    return "from the family: " + (
        ", ".join(f"{name} {value}" for name, value in values.items())
        if several
        else f"each has {next(iter(values.values()))}"
    )


def transfer(
    fit: str,
    method: Method,
    learning: LearningTargets,
    output: Output,
    work: Work,
    display: Display,
    tuned: Tuned = NOT_TUNED,
) -> None:
    """Learns what is missing of the targets asked for, publishes the run and prints its path."""
    from qinit_cli.artefacts.specs import outdated
    from qinit_cli.commands import references
    from qinit_cli.commands.dry_run import TRIAL_TASKS, foresee, say_expected, trial_episodes
    from qinit_cli.commands.making import make, say_result, warn
    from qinit_cli.commands.optimal_tables import OptimalTables
    from qinit_cli.commands.room import Footprint, check_memory
    from qinit_cli.pipeline.degenerate import of_targets
    from qinit_cli.pipeline.knowledge import Knowledge

    known = Knowledge.read(references.one(fit, output.store, references.LEARNING, output=output.output))
    method, choice = tuned.applied(method, output, known.family)
    targets, count = targets_of(learning, known.spec)
    _say_overrides(targets.learning, known.learning, display)
    _say_limits(method, known.fit, targets.family, display)
    if method.privileged:  # its arrays have a leading target axis
        check_memory(Footprint(count, math.prod(targets.family.shape) * 8), count, count)
    tables = OptimalTables(targets, count, known.learning, output, work, display)
    initial = method.initial(known.fit, targets.targets(count, tables))
    inputs = [*choice, *tables.inputs]
    plan = plan_of(method, targets, initial, count, known, inputs)
    if output.dry_run:
        episodes = targets.learning.episodes
        tried = trial_episodes(episodes)
        fewer = replace(targets, learning=replace(targets.learning, episodes=tried))
        trial = plan_of(method, fewer, initial, min(count, TRIAL_TASKS), known, inputs)
        say_expected(foresee(plan, trial, episodes, tried, output, work), output, display)
        return
    made = make(plan, output, work, display)
    found = learned(made, targets, known.fit)
    unsolvable = found.unsolvable
    made.tally.extra.update(filled=initial.filled, clipped=initial.clipped, unsolvable=unsolvable)
    warn(made, targets.family.warning, [*outdated(known.spec), *of_targets(targets.learning, found)], display)
    already = f"{method.label}, {counted(made.tally.tasks, 'target')}: already complete"
    sentence = already if made.complete_before else _summary(method, initial, made.tally, unsolvable)
    say_result(made, "qinit.transfer/1", sentence, output, display)


def targets_of(learning: LearningTargets, fitted: dict[str, Any]) -> tuple[TargetTasks, int]:
    """The target tasks that are asked for, given the spec of a fit, and how many; NotAllowed where no run could hold them."""
    from qinit_cli.commands.room import Footprint, check_artefact
    from qinit_cli.pipeline.transfer import TargetTasks

    sources = fitted["sources"]
    family = learning.family(family_of(sources))
    settings = learning.learning(family, sources["learning"])
    if refusal := family.refusal(settings):
        raise UsageError(refusal)
    targets = TargetTasks(
        family,
        settings,
        learning.seed,
        learning.keep_q,
        learning.evaluate_every,
    )
    count = learning.tasks or family.target_tasks
    check_artefact(
        Footprint(count, settings.episodes * EPISODE_BYTES + targets.evaluations * EVALUATION_BYTES)
    )
    return targets, count


def learning_bytes(episodes: int) -> int:
    """Bytes in memory for the episodes of a task while it is learned: its steps and goals, 8 bytes each."""
    return 16 * episodes


def stem_of(method: Method, targets: TargetTasks, count: int) -> str:
    """What the default name of a run begins with."""
    return f"{targets.family.label}-{_in_a_name(method.label)}-{count}-seed-{targets.seed}"


def plan_of(
    method: Method,
    targets: TargetTasks,
    initial: Initial,
    count: int,
    known: Knowledge,
    more: list[dict[str, str]],
) -> Plan:
    """The run of so many targets from what the method starts them with; `more` are inputs beside the fit."""
    from qinit_cli.artefacts import specs
    from qinit_cli.commands.making import Plan
    from qinit_cli.pipeline.transfer import learn_targets, statics

    inputs = [known.given, *more]
    return Plan(
        stem=stem_of(method, targets, count),
        spec=specs.run(method, targets, count, known.content_sha256, known.spec),
        schema=_schema(targets, initial),
        learn=partial(learn_targets, targets, initial),
        kernel=_kernel(targets, initial),
        what=method.label,
        read=known.path,
        inputs=inputs,
        learning_bytes=learning_bytes(targets.learning.episodes),
        statics=statics(initial, targets.family),
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
    }
    return ", ".join([f"{targets.family.name} targets", *(name for name, used in features.items() if used)])


def _change(family: Family, text: str) -> tuple[str, Any]:
    """A field of the family and its new value, from KEY=VALUE."""
    name, equals, value = text.partition("=")
    name = name.strip().replace("-", "_")
    known = {field.name: get_type_hints(type(family))[field.name] for field in options(type(family))}
    if not equals:
        raise UsageError(f"--shift {text}: write KEY=VALUE, KEY one of {', '.join(sorted(known))}")
    if name not in known:
        raise UsageError(f"--shift {text}: {family.name} has no {name}; {nearest(name, sorted(known))}")
    kinds = get_args(known[name]) or (known[name],)
    for kind in (kind for kind in (int, float) if kind in kinds):
        try:
            return name, kind(value)
        except ValueError as error:
            raise UsageError(f"--shift {text}: {value!r} is no {kind.__name__}") from error
    return name, value


def _say_overrides(learning: Learning, sources: dict[str, Any], display: Display) -> None:
    for name in FROM_SOURCES:
        if getattr(learning, name) != sources[name]:
            note(
                display,
                f"{name} {getattr(learning, name)}, where the sources were learned with {sources[name]}",
            )


def _say_limits(method: Method, fit: Fit, family: Family, display: Display) -> None:
    if family.warning:
        note(display, f"warning: {family.warning}")
    asked, there = getattr(method, "library", 0) or 0, len(fit.library_q)
    if asked > there:
        note(display, f"{method.name} was to choose among {asked} sources; this fit keeps {there}")


def _schema(targets: TargetTasks, initial: Initial) -> Any:
    from qinit_cli.artefacts.opening import action_axis
    from qinit_store.schema import run_schema

    family = targets.family
    return run_schema(
        family.axes(),
        action_axis(family),
        family.parameters(),
        targets.learning.episodes,
        start_per_task=initial.start_per_task,
        potential_per_task=initial.potential_per_task,
        exact_values=family.tabular,
        evaluations=targets.evaluations,
        keep_q=targets.keep_q,
        updating=targets.keep_visits,
        hypotheses=initial.hypothesis_count,
        moments=targets.moments,
    )


def learned(made: Made, targets: TargetTasks, fit: Fit) -> TargetsLearned:
    """What became of the targets of a run; unsolvable are those that neither the family's own rule nor any episode solved."""
    import numpy as np

    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.pipeline.degenerate import TargetsLearned

    with open_artefact(made.path, "run") as artefact:
        episodes = artefact.read("reached")
        steps = int(artefact.read("steps").sum())
        drawn = targets.draw(artefact.tasks)
    reached: Flags = np.asarray(episodes.any(axis=1), np.bool_)
    solvable = targets.family.solvable(drawn, reached, targets.learning.horizon)
    return TargetsLearned(
        tasks=len(reached),
        reached=int(episodes.sum()),
        unsolvable=int((~solvable).sum()),
        steps=steps / len(reached) if len(reached) else 0.0,
        knows=bool(fit.known.any()),
    )


def _summary(method: Method, initial: Initial, tally: Tally, unsolvable: int) -> str:
    learned = tally.tasks - tally.skipped - tally.failed
    sentence = f"{method.label}: {counted(learned, 'target')} learned"
    sentence += f", {magnitude(tally.steps)} steps in {plain(tally.seconds)} kernel seconds"
    if unsolvable:
        sentence += (
            f"; {counted(unsolvable, 'target')} cannot be solved, and {noun(unsolvable, 'stays', 'stay')}"
        )
    if initial.filled:
        sentence += f"; {counted(initial.filled, 'state-action')} that no source knows {noun(initial.filled, 'was', 'were')} "
        sentence += "filled"
    if initial.clipped:
        sentence += f"; {counted(initial.clipped, 'starting value')} clipped to [0, 1]"
    return sentence
