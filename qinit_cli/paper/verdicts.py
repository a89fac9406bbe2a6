"""The paper's claims judged from artefacts: each is read once, and only the few arrays that claims ask for are kept of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings, plain_learning
from qinit_cli.claims.setting import GRIDWORLD, MOUNTAIN_CAR, Setting
from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.comparison.source_sets import Entry, RunGroup, grouped
from qinit_cli.environments import Family
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FittedTables
from qinit_cli.paper import settings as paper_settings

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.arrays import Floats
    from qinit_cli.claims.evidence import Evidence, Lengths, LengthTests, Maps, Values
    from qinit_cli.claims.scores import Arm, Arms
    from qinit_cli.claims.verdict import Verdict
    from qinit_store.reading import Artefact

AMONG_GOALS = 0.95  # of the goals


def verdicts(evidence: Evidence) -> tuple[Verdict, ...]:
    """A verdict on each of the paper's claims, in order; those without evidence say what is lacking."""
    from qinit_cli.claims.registry import CLAIMS

    return tuple(claim.judge(evidence) for claim in CLAIMS)


def evidence(artefacts: Iterable[Artefact]) -> Evidence:
    """What sources, fits and runs of any number of source sets say, every task verified; one is read at a time.

    Families that no claim is about and optimal's tables are passed over, copies count once.
    """
    from qinit_cli.claims.evidence import Evidence

    read = _Read()
    for artefact in artefacts:
        read.add(artefact)
    return Evidence(
        lengths=_by_setting(read.lengths),
        values=_by_setting(read.values),
        tested=_by_setting(read.tested),
        maps=_by_setting(read.maps),
        scores=_scores(list(read.runs.values()), read.averages),
        passed_over=tuple(read.passed_over),
    )


@dataclass
class _Read:
    """What was kept of the artefacts so far."""

    lengths: dict[tuple[Setting, str], Lengths] = field(default_factory=dict)
    values: dict[tuple[Setting, str], Values] = field(default_factory=dict)
    tested: dict[tuple[Setting, str], LengthTests] = field(default_factory=dict)
    maps: dict[tuple[Setting, str], Maps] = field(default_factory=dict)
    runs: dict[str, ComparedRun] = field(default_factory=dict)  # without their episodes, by content hash
    averages: dict[str, Floats] = field(default_factory=dict)  # (T,) by content hash
    passed_over: list[str] = field(default_factory=list)

    def add(self, artefact: Artefact) -> None:
        """Keeps what claims ask of an artefact."""
        match told := KINDS[artefact.kind].read(artefact.spec):
            case SourcesSettings(role="source") if paper_settings.known(told):
                self._add_sources(artefact, told)
            case FitSettings() if paper_settings.known(told.sources):
                self._add_fit(artefact, told)
            case RunSettings() if paper_settings.known(told):
                self._add_run(artefact)
            case _:
                self.passed_over.append(artefact.path.stem)

    def _add_sources(self, artefact: Artefact, told: SourcesSettings) -> None:
        family = told.family.installed()
        key = (paper_settings.of_sources(told), artefact.content_sha256)
        if key in self.values:
            return
        q, eopl = _at_states(artefact, [_place(family, places) for places in family.shown_states()])
        self.values[key] = _values(family, q)
        if family.name == MOUNTAIN_CAR:
            self.lengths[key] = _lengths(q[:, 0], eopl[:, 0])

    def _add_fit(self, artefact: Artefact, told: FitSettings) -> None:
        family = told.sources.family.installed()
        key = (paper_settings.of_fit(told), told.content)
        if told.options.eopl_normality == "rounded" and key not in self.tested:
            self.tested[key] = _tested(artefact, family)
        if family.name == GRIDWORLD and key not in self.maps:
            try:
                self.maps[key] = _maps(artefact, family, told)
            except NotAllowed:  # an estimator without a median has no such map
                return

    def _add_run(self, artefact: Artefact) -> None:
        from qinit_cli.analysis.returns import average
        from qinit_cli.comparison.scores import curve

        if artefact.content_sha256 in self.runs:
            return
        run = replace(ComparedRun.from_artefact(artefact), name=artefact.content_sha256)
        self.averages[run.name] = average(curve(run, "return"))
        # its episodes are let go: of a hundred runs they would fill 100 MB
        blank = np.broadcast_to(np.zeros((), np.int32), run.steps.shape)
        self.runs[run.name] = replace(run, steps=blank, reached=blank.astype(bool, copy=False))


def _by_setting(found: Mapping[tuple[Setting, str], Any]) -> dict[Setting, tuple[Any, ...]]:
    by: dict[Setting, list[Any]] = {}
    for (setting, _), kept in found.items():
        by.setdefault(setting, []).append(kept)
    return {setting: tuple(sets) for setting, sets in by.items()}


def _place(family: Family, places: tuple[float, ...]) -> tuple[int, ...]:
    """The cell, or the nearest bin, at these coordinates."""
    return tuple(
        int(np.abs(axis.values - place).argmin()) for axis, place in zip(family.axes(), places, strict=True)
    )


def _at_states(artefact: Artefact, states: Sequence[tuple[int, ...]]) -> tuple[Any, Any]:
    """Values and path lengths of the states in every task, (N, STATE, A) each; a block of tasks is in memory at a time."""
    at = tuple(np.array(states).T)  # of each axis
    blocks = [
        (block["q"][:, *at], block["eopl"][:, *at])
        for block in artefact.blocks(("q", "eopl"), artefact.schema.block_size)
    ]
    return np.concatenate([q for q, _ in blocks]), np.concatenate([eopl for _, eopl in blocks])


def _values(family: Family, q: Floats) -> Values:
    """The positive values of each state (N, STATE, A) at the action of the largest mean, as `qinit plot histograms` has them."""
    from qinit_cli.claims.evidence import Values

    positive = q > 0
    means = np.sum(q, axis=0, where=positive) / np.maximum(positive.sum(axis=0), 1)
    greedy = means.argmax(axis=1)
    samples = [q[:, state, action] for state, action in enumerate(greedy)]
    return Values(
        places=tuple(
            "(" + ", ".join(f"{place:g}" for place in places) + ")" for places in family.shown_states()
        ),
        positive=tuple(np.sort(sample[sample > 0]) for sample in samples),
    )


def _lengths(q: Floats, eopl: Any) -> Lengths:
    """Lengths along each task's own greedy path, from values and lengths of one state, (N, A) each."""
    from qinit_cli.analysis.length_sample import LengthSample
    from qinit_cli.claims.evidence import Lengths

    greedy = q.argmax(axis=1)
    sample = LengthSample.of(np.take_along_axis(eopl, greedy[:, None], axis=1)[:, 0])
    return Lengths(sample.lengths, sample.never)


def _tested(artefact: Artefact, family: Family) -> LengthTests:
    from qinit_cli.claims.evidence import LengthTests

    names = {"p": "p", "statistic": "w", "skewness": "skewness", "kurtosis": "kurtosis"}
    arrays = {
        name: artefact.read(f"eopl_normality_{stored}").reshape(-1, len(family.actions))
        for name, stored in names.items()
    }
    return LengthTests(**arrays, among_goals=_among(family.goal_chances()))


def _among(probabilities: Floats) -> Any:
    """The smallest set of states that holds AMONG_GOALS of the probabilities (S,); nowhere where all are 0."""
    order = np.argsort(-probabilities, kind="stable")
    before = np.cumsum(probabilities[order]) - probabilities[order]
    among = np.zeros(len(probabilities), np.bool_)
    among[order] = (before < AMONG_GOALS) & (probabilities[order] > 0)
    return among


def _maps(artefact: Artefact, family: Family, told: FitSettings) -> Maps:
    from qinit_cli.claims.evidence import Maps
    from qinit_cli.claims.heatmaps import MAPPED
    from qinit_cli.methods.plus import initialisations
    from qinit_cli.pipeline.fit_statistics import start

    names = (*FittedTables.TABLES, "value_mean", "library_q", "library_td_var")
    arrays = {name: artefact.read(name) for name in names}
    fit = FittedTables.from_arrays(arrays, family.goal_chances().size, told.options.estimator)
    methods, gamma = initialisations(), told.sources.learning.gamma
    return Maps(
        probabilities=family.goal_chances().reshape(family.shape),
        starts={
            name: start(methods[name](), fit, family, gamma).max(axis=1).reshape(family.shape)
            for name in MAPPED
        },
    )


def _scores(runs: Sequence[ComparedRun], averages: Mapping[str, Floats]) -> dict[Setting, Arms]:
    """The scores in each setting; of several target sets that cannot be taken together, that of most source sets."""
    found: dict[Setting, Arms] = {}
    most: dict[Setting, int] = {}
    for group in grouped(runs):
        for setting, scores in _of_group(group, averages):
            if group.sets > most.get(setting, 0):
                found[setting], most[setting] = scores, group.sets
    return found


def _of_group(group: RunGroup, averages: Mapping[str, Floats]) -> Iterator[tuple[Setting, Arms]]:
    """One for each way in which sources were drawn, learned and fitted; methods that read none join them all."""
    from qinit_cli.claims.scores import Arms
    from qinit_store.spec import canonical_json

    def targets(entry: Entry) -> str:
        return canonical_json(plain_learning(entry.runs[0].settings.learning))

    reading: dict[tuple[str, str], list[Entry]] = {}
    free: dict[str, list[Entry]] = {}
    for entry in group.entries:
        if not entry.reads_sources:
            free.setdefault(targets(entry), []).append(entry)
        else:
            reading.setdefault((targets(entry), canonical_json(entry.runs[0].fitted)), []).append(entry)
    for (learning, _), entries in reading.items():
        told = entries[0].runs[0].settings
        arms = _arms([*entries, *free.get(learning, [])], averages)
        yield paper_settings.of_run(told, told.source_set), Arms(arms, group.shared)
    for learning, entries in free.items():
        if not any(learning == other for other, _ in reading):
            setting = paper_settings.of_run(entries[0].runs[0].settings, None)
            yield setting, Arms(_arms(entries, averages), group.shared)


def _arms(entries: Iterable[Entry], averages: Mapping[str, Floats]) -> dict[str, Arm]:
    """By label; of copies, which differ by what they keep alone, the first."""
    from qinit_cli.claims.scores import Arm

    arms: dict[str, Arm] = {}
    for entry in entries:
        arm = Arm(
            averages=np.stack([averages[run.name] for run in entry.runs]),
            places=tuple((run.target_digest, run.source_set) for run in entry.runs),
            reads_sources=entry.reads_sources,
        )
        arms.setdefault(entry.runs[0].label, arm)
    return arms


def opened(paths: list[Path]) -> Iterator[Artefact]:
    """The artefacts, one open at a time."""
    from qinit_cli.artefacts.opening import open_artefact

    for path in paths:
        with open_artefact(path) as artefact:
            yield artefact


def told(found: Sequence[Verdict]) -> dict[str, Any]:
    """What --format json prints of these verdicts."""
    from qinit_cli.claims.verdict import SCHEMA

    return {"schema": SCHEMA, "rows": [verdict.told() for verdict in found]}
