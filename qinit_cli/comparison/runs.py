"""A run as it is compared and drawn: how one method fared on target tasks, episode by episode."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.settings import RunSettings, StoredFamily
from qinit_cli.errors import NotAllowed
from qinit_store.wording import counted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats
    from qinit_cli.rewards import ReturnBounds
    from qinit_store.reading import Artefact


OF_TARGETS = (  # what a run has of each target
    "steps",
    "reached",
    "attainable",
    "v_star",
    "evaluation_steps",
    "evaluation_reached",
    "told_returns",
    "told_evaluations",
)


@dataclass(frozen=True)
class ComparedRun:
    """Steps and goals of T target tasks over E episodes, with the settings that they were learned with."""

    name: str  # the artefact's, without its ending
    method: str
    label: str  # the method, with what it starts from
    settings: RunSettings
    steps: NDArray[Any]  # (T, E), NaN where they are unknown, as those of imported curves may be
    reached: NDArray[Any]  # (T, E) likewise
    attainable: Floats | None  # (T,) exact value of what learning comes to; None where it is unknown
    v_star: Floats | None  # (T,) exact value of Q* from the start; None likewise
    evaluation_steps: (
        NDArray[np.int32] | None
    )  # (T, V) of greedy evaluations while learning; None where not kept
    evaluation_reached: Flags | None  # (T, V) likewise
    target_digest: str  # equal for runs that met the same targets: these are compared in pairs
    told_returns: Floats | None = None  # (T, E) where the world told its rewards
    told_evaluations: Floats | None = None  # (T, V) likewise
    unit: str = "episodes"  # what is counted along the second axis: episodes, or greedy evaluations
    drawn: tuple[NDArray[Any], ...] = ()  # (T,) each of the targets' ids and parameters
    tuned: bool = False  # whether its options are those that its sources chose: others from other sources

    @property
    def plus(self) -> bool:
        """Whether the method starts from another."""
        return self.settings.method.plus

    @property
    def reads_sources(self) -> bool:
        """Whether other sources would make the method start otherwise."""
        return self.settings.method.reads_sources

    @property
    def gamma(self) -> float:
        """The discount of its returns."""
        return self.settings.learning.gamma

    @property
    def bounds(self) -> ReturnBounds:
        """The least and the largest return."""
        return self.settings.bounds

    def returns(self) -> Floats:
        """The discounted return of every episode, (T, E)."""
        from qinit_cli.analysis.returns import earned

        rows: dict[str, Any] = {"steps": self.steps, "reached": self.reached}
        if self.told_returns is not None:
            rows["return"] = self.told_returns
        return earned(rows, self.settings.family.payment(self.gamma), self.gamma)

    @property
    def horizon(self) -> int:
        """The longest an episode may take."""
        return self.settings.learning.horizon

    @property
    def source_set(self) -> str:
        """The content hash of the sources whose fit it started from."""
        return self.settings.source_set.content

    @property
    def fitted(self) -> dict[str, Any]:
        """How those sources were drawn, learned and fitted: replicates of a source set share all of it."""
        source_set = self.settings.source_set
        return source_set.shared() | {"family": source_set.family.distribution()}

    def by_tuning(self) -> ComparedRun:
        """The run as one of a method whose options each source set chooses."""
        return replace(self, name=f"{self.name} tuned", label=f"{_untuned(self)} tuned", tuned=True)

    def first(self, count: int) -> ComparedRun:
        """The run as if it had had the first `count` targets only: a task's result depends on its index alone."""
        if count > len(self.steps):
            raise NotAllowed(f"{self.name} has {counted(len(self.steps), 'target')}; {count} are needed")
        drawn = tuple(values[:count] for values in self.drawn)
        there = {name: getattr(self, name) for name in OF_TARGETS}
        first: dict[str, Any] = {
            name: values if values is None else values[:count] for name, values in there.items()
        }
        return replace(
            self,
            settings=replace(self.settings, tasks=count),
            drawn=drawn,
            target_digest=_target_digest(self.settings, drawn),
            **first,
        )

    def greedy(self) -> ComparedRun:
        """The greedy evaluations as if they were the episodes; NotAllowed where there are none."""
        if self.evaluation_steps is None or self.evaluation_reached is None:
            if self.settings.evaluate_every:
                raise NotAllowed(
                    f"{self.name} was made by a version that kept of greedy evaluations only what they earn, not their steps; "
                    "the command that made it makes it again with --force"
                )
            raise NotAllowed(f"{self.name} has no greedy evaluations; transfer again with --evaluate-every")
        return replace(
            self,
            steps=self.evaluation_steps,
            reached=self.evaluation_reached,
            attainable=self.v_star,
            told_returns=self.told_evaluations,
            unit="evaluations",
        )

    @classmethod
    def from_artefact(cls, artefact: Artefact) -> ComparedRun:
        """The run in an artefact, every task's digest verified."""
        settings = RunSettings.read(artefact.spec)
        parameters = _parameters(settings.family)
        names = {column.name for column in artefact.schema.task_columns}
        there = names.intersection(("v_eps", "v_star", "eval_steps", "eval_reached", "return"))
        if "return" in there and settings.evaluate_every:
            there.add("eval_return")
        there |= names.intersection(("steps", "reached"))
        rows = artefact.columns((*parameters, *there))
        unknown = np.full((artefact.task_count, artefact.schema.sizes["episode"]), np.nan)
        drawn = (artefact.tasks, *(rows[name] for name in parameters))
        return cls(
            name=artefact.path.stem,
            method=settings.method.name,
            label=settings.method.label,
            settings=settings,
            steps=rows.get("steps", unknown),
            reached=rows["reached"].astype(bool) if "reached" in rows else unknown,
            attainable=_known(rows.get("v_eps")),
            v_star=rows.get("v_star"),
            evaluation_steps=rows.get("eval_steps"),
            evaluation_reached=rows["eval_reached"].astype(bool) if "eval_reached" in names else None,
            target_digest=_target_digest(settings, drawn),
            told_returns=rows.get("return"),
            told_evaluations=rows.get("eval_return"),
            drawn=drawn,
        )


def read_runs(paths: Iterable[Path]) -> list[ComparedRun]:
    """The runs at these paths, verified; each once, those of one file name told apart by their folders."""
    from qinit_cli.artefacts.opening import open_artefact

    found: dict[str, tuple[Path, ComparedRun]] = {}
    for path in paths:
        with open_artefact(path, "run") as artefact:
            found.setdefault(artefact.content_sha256, (path, ComparedRun.from_artefact(artefact)))
    count = Counter(run.name for _, run in found.values())
    return [
        run if count[run.name] == 1 else replace(run, name=str(path.with_suffix("")))
        for path, run in found.values()
    ]


def _untuned(run: ComparedRun) -> str:
    """The method, and what it starts from, without its options."""
    return run.label.partition(" ")[0]


def _known(values: Floats | None) -> Floats | None:
    """The values; None where they are NaN, as those of explorations other than epsilon-greedy are."""
    return None if values is None or np.isnan(values).any() else values


def _parameters(family: StoredFamily) -> list[str]:
    """What its tasks are made of; nothing where the family is a plug-in that is not installed: settings and seed say it too."""
    return [] if family.here is None else [parameter.name for parameter in family.here.parameters()]


def _target_digest(settings: RunSettings, drawn: Sequence[NDArray[Any]]) -> str:
    """SHA-256 of what makes targets the same to every method: the draws, the streams' seed, and how a return is counted."""
    from qinit_store.spec import canonical_json

    met = {name: getattr(settings.learning, name) for name in ("gamma", "episodes", "horizon", "start")}
    digest = hashlib.sha256(canonical_json([settings.family.spec(), settings.seed, met]).encode())
    for column in drawn:
        digest.update(column.tobytes())
    return digest.hexdigest()
