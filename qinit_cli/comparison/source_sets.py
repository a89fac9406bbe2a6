"""Which runs may be compared: those of one distribution that met the same targets, from one source set or several.

A source set is one set of sources, however fitted: fits of the same sources are other options of a method, and fits of
sources from another distribution are no replicates. The folds of a file are source sets, each with the fold left out as its
targets. Several sets may share their targets (one transfer seed), or each may
have its own; which of the two it is shows in the targets' digests and decides how intervals are made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from qinit_cli.artefacts.settings import plain_learning
from qinit_cli.comparison.distinctions import (
    OF_METHOD,
    OF_RECORD,
    Words,
    joined,
    settings,
    told_apart,
    with_words,
)
from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.environments.task_ranges import folds_of
from qinit_cli.errors import NotAllowed
from qinit_store.wording import as_name

LEARNED = ("alpha", "epsilon", "learner", "explore")  # how targets are learned, not what they are
VALUE_TOLERANCE = 1e-9  # of V*, which is solved to 1e-12 and summed in any order


@dataclass(frozen=True)
class Entry:
    """One method with one choice of options: its runs, one for each source set."""

    label: str  # the method, with the settings that tell it from the others it is shown with
    runs: tuple[ComparedRun, ...]

    @property
    def method(self) -> str:
        """The method's name."""
        return self.runs[0].method

    def beside(self, run: ComparedRun) -> ComparedRun | None:
        """This method's run on the same targets and from the same source set as `run`; None if there is none.

        A method that reads no sources is the same from every set, so that one run of it serves all.
        """
        same = [own for own in self.runs if own.target_digest == run.target_digest]
        beside = next((own for own in same if own.source_set == run.source_set), None)
        return same[0] if beside is None and same and not self.reads_sources else beside

    @property
    def plus(self) -> bool:
        """Whether the method starts from another."""
        return self.runs[0].plus

    @property
    def blended(self) -> bool:
        """Whether what the method starts from gives way to learned values."""
        return self.runs[0].settings.method.blended

    @property
    def reads_sources(self) -> bool:
        """Whether other sources would make the method start otherwise."""
        return self.runs[0].reads_sources

    @property
    def settings(self) -> Words:
        """What all of its runs share."""
        found = [settings(run.settings, reads_sources=self.reads_sources) for run in self.runs]
        return {key: word for key, word in found[0].items() if all(one.get(key) == word for one in found)}


@dataclass(frozen=True)
class RunGroup:
    """Runs that may be compared with each other."""

    sets: int  # source sets
    shared: bool  # whether the sets met the same targets
    entries: tuple[Entry, ...]

    @property
    def any_run(self) -> ComparedRun:
        """A run; what groups have in common can be read from any."""
        return self.entries[0].runs[0]

    @property
    def of_folds(self) -> bool:
        """Whether its source sets leave out a fold each, on whose tasks they are tried."""
        return not self.shared and bool(self.any_run.settings.family.fold)

    @property
    def label(self) -> str:
        """What the targets' family calls its distribution; of several folds not which of them is left out."""
        family = self.any_run.settings.family
        if not self.of_folds:
            return family.label
        return family.label.replace(as_name(family.fold), as_name(folds_of(family.fold)))


def grouped(runs: Sequence[ComparedRun]) -> list[RunGroup]:
    """The groups, in order of appearance; a run that is named twice counts once.

    NotAllowed where runs of the same targets have other exact values of them: those were not the same targets.
    """
    once = list({run.name: run for run in runs}.values())
    for met in _by(once, lambda run: run.target_digest):
        _expect_equal_values(met)
    return _labelled([group for same in _by(once, _distribution) for group in _groups(same)])


def told_of_groups(groups: Sequence[RunGroup]) -> list[Words]:
    """The settings that distinguish each group from the others, but for those in which methods of one group differ."""
    varying = _varying(groups)
    shared = [
        {
            key: word
            for entry in group.entries
            for key, word in entry.settings.items()
            if _of_group(key, varying)
        }
        for group in groups
    ]
    return told_apart(shared)


def _varying(groups: Sequence[RunGroup]) -> set[str]:
    """The settings in which methods of one group differ."""
    return {
        key
        for group in groups
        for words in told_apart([one.settings for one in group.entries])
        for key in words
    }


def _of_group(key: str, varying: set[str]) -> bool:
    return key not in varying and not key.startswith((OF_METHOD, OF_RECORD))


def _labelled(groups: list[RunGroup]) -> list[RunGroup]:
    """The groups, their methods with the settings that tell them apart, copies with what they keep or the end of their name."""
    varying = _varying(groups)
    apart = iter(told_apart([entry.settings for group in groups for entry in group.entries]))
    return [
        replace(group, entries=_distinct([(entry, next(apart)) for entry in group.entries], varying))
        for group in groups
    ]


def _distinct(entries: Sequence[tuple[Entry, Words]], varying: set[str]) -> tuple[Entry, ...]:
    kept = [{key: word for key, word in words.items() if key.startswith(OF_RECORD)} for _, words in entries]
    labels = [
        with_words(
            entry.label,
            joined(
                {k: w for k, w in words.items() if not k.startswith(OF_RECORD) and not _of_group(k, varying)}
            ),
        )
        for entry, words in entries
    ]
    labels = _where_equal(labels, [f", {joined(words)}" if words else "" for words in kept])
    labels = _where_equal(labels, [f" {entry.runs[0].name[-8:]}" for entry, _ in entries])
    return tuple(replace(entry, label=label) for (entry, _), label in zip(entries, labels, strict=True))


def _expect_equal_values(runs: list[ComparedRun]) -> None:
    known = [(run.name, run.v_star) for run in runs if run.v_star is not None]
    for name, values in known[1:]:
        first, expected = known[0]
        apart = ~np.isclose(values, expected, rtol=0, atol=VALUE_TOLERANCE)
        if apart.any():
            place = int(apart.argmax())
            raise NotAllowed(
                f"{first} and {name} met the same targets by their settings, but the best value of target {place} is "
                f"{expected[place]:.6g} in one and {values[place]:.6g} in the other: their environments were not the "
                "same, by their version or by chance that no seed reaches; transfer both again"
            )


def _where_equal(labels: Sequence[str], ends: Sequence[str]) -> list[str]:
    """The labels, those that stand there twice with their ends."""
    count = Counter(labels)
    return [label + end if count[label] > 1 else label for label, end in zip(labels, ends, strict=True)]


def _groups(runs: list[ComparedRun]) -> list[RunGroup]:
    by_targets = _by(runs, lambda run: run.target_digest)
    if len(by_targets) == 1:
        return [RunGroup(_sets(runs), True, _entries(runs))]
    if all(_sets(met) == 1 for met in by_targets) and _sets(runs) == len(by_targets):
        return [RunGroup(len(by_targets), False, _entries(runs))]
    return [RunGroup(_sets(met), True, _entries(met)) for met in by_targets]


def _entries(runs: list[ComparedRun]) -> tuple[Entry, ...]:
    earlier: Counter[Any] = Counter()
    copies: dict[str, int] = {}  # of what was run before on the same targets from the same source set
    for run in runs:
        same = (_options(run), run.target_digest, run.source_set)
        copies[run.name] = earlier[same]
        earlier[same] += 1
    variants = _by(runs, lambda run: (_options(run), copies[run.name]))
    return tuple(
        Entry(
            variant[0].label,
            tuple(sorted(variant, key=lambda run: (run.target_digest, run.source_set))),
        )
        for variant in variants
    )


def _options(run: ComparedRun) -> tuple[str, str, str, str]:
    fitted = run.fitted if run.reads_sources else {}
    told = run.settings
    return (
        run.label,
        "" if run.tuned else _canonical(told.method.spec()),
        _canonical(plain_learning(told.learning)),
        _canonical(fitted),
    )


def _sets(runs: Sequence[ComparedRun]) -> int:
    return len({run.source_set for run in runs})


def _distribution(run: ComparedRun) -> tuple[str, str, tuple[int, ...]]:
    met = {
        name: value for name, value in plain_learning(run.settings.learning).items() if name not in LEARNED
    }
    return _canonical(run.settings.family.distribution()), _canonical(met), run.steps.shape


def _by(runs: Sequence[ComparedRun], key: Any) -> list[list[ComparedRun]]:
    """The runs in lists of equal key, in order of appearance."""
    lists: dict[Any, list[ComparedRun]] = {}
    for run in runs:
        lists.setdefault(key(run), []).append(run)
    return list(lists.values())


def _canonical(value: object) -> str:
    from qinit_store.spec import canonical_json

    return canonical_json(value)
