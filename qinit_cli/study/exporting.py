"""A study as plain commands: each artefact, picture and table a file with a readable name, made from other files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from qinit_cli.environments.family import task_count
from qinit_cli.pipeline.words import option_words
from qinit_cli.study.planned import (
    STAGES,
    Artefact,
    PlannedFit,
    PlannedJudgement,
    PlannedPicture,
    PlannedRun,
    PlannedShares,
    PlannedSources,
    PlannedTable,
    Shown,
    inputs,
    named,
    ordered,
)
from qinit_cli.study.reading import Study
from qinit_cli.study.words import command

OMITTED = "no plain command makes it as the study does: a table of the first targets, or a picture that only some runs allow"
LONGEST = 100  # characters of a name, of the 255 that file systems have


@dataclass(frozen=True)
class ScriptStep:
    """One command and the file that it makes."""

    stage: str
    target: str
    inputs: tuple[str, ...]  # files that must stand there
    words: tuple[str, ...]  # behind `qinit`
    printed: bool = False  # whether the file is what the command prints
    tasks: int = 0  # that may be cut into shares; 0: none

    @property
    def job(self) -> str:
        """What it is called among jobs."""
        return PurePosixPath(self.target).stem


@dataclass(frozen=True)
class Exported:
    """The commands of a study, each behind those that it needs."""

    name: str  # of the study's file
    folder: str
    steps: tuple[ScriptStep, ...]
    omitted: tuple[str, ...]  # tables and pictures that no plain command makes

    @property
    def ends(self) -> list[str]:
        """Files that no other is made of."""
        given = {file for step in self.steps for file in step.inputs}
        return [step.target for step in self.steps if step.target not in given]

    @property
    def folders(self) -> list[str]:
        """The folders that files are made in."""
        return sorted({str(PurePosixPath(step.target).parent) for step in self.steps})


def exported(study: Study, folder: str) -> Exported:
    """The study's commands, with their files under a folder; nothing is looked for in a store."""
    artefacts = ordered(study.artefacts)
    files = _files(artefacts, folder)
    steps = [_of_artefact(one, files, study.imports, folder) for one in artefacts]
    omitted = [one.name for one in study.shown if _has_no_command(one)]
    steps += [_of_shown(one, files, study.imports, folder) for one in study.shown if one.name not in omitted]
    every = tuple(files[one] for one in artefacts)
    words = [
        "report",
        *every,
        "-o",
        f"{folder}/report.html",
        "--store",
        folder,
        "--title",
        _line(study.title),
    ]
    words += [] if study.question is None else ["--question", _line(study.question)]
    words += _imported(study.imports)
    steps.append(ScriptStep("report", f"{folder}/report.html", every, tuple(words)))
    return Exported(study.file.name, folder, tuple(steps), tuple(omitted))


def _has_no_command(shown: Shown) -> bool:
    """Whether no plain command makes it, or it is left out where its artefacts make none, which no script knows before."""
    if isinstance(shown, PlannedPicture):
        return shown.optional
    return isinstance(shown, PlannedTable) and shown.first is not None


def _of_artefact(
    artefact: Artefact, files: dict[Artefact, str], imports: tuple[str, ...], folder: str
) -> ScriptStep:
    output = ["-o", files[artefact]]
    privileged = isinstance(artefact, PlannedRun) and artefact.method.privileged
    # such runs keep the targets' own tables in a store, where another of them may be writing the same
    output += ["--store", folder, "--wait"] if privileged else []
    made_of = tuple(files[one] for one in inputs(artefact))
    words = tuple(command(artefact, files, tuple(output), imports))
    tasks = 0
    if isinstance(artefact, PlannedSources):
        tasks = task_count(artefact.family.opened(), "source", artefact.learning.tasks)
    return ScriptStep(STAGES[type(artefact)], files[artefact], made_of, words, tasks=tasks)


def _of_shown(shown: Shown, files: dict[Artefact, str], imports: tuple[str, ...], folder: str) -> ScriptStep:
    given = tuple(files[one] for one in shown.artefacts)
    name = _plain(shown.name)
    match shown:
        case PlannedPicture(plot=plot, title=title):
            target = f"{folder}/pictures/{name}.svg"
            words = ["plot", plot.name, *given, *option_words(plot), "-o", target, "--store", folder]
            words += [] if title is None else ["--title", _line(title)]
            return ScriptStep("pictures", target, given, (*words, *_imported(imports)))
        case PlannedTable(baseline=baseline, metric=metric, columns=columns):
            words = ["compare", *given, "--baseline", baseline, "--metric", metric, "--format", "csv"]
            words += ["--columns", ",".join(columns)] if columns else []
            return ScriptStep("tables", f"{folder}/tables/{name}.csv", given, tuple(words), printed=True)
        case PlannedShares(metric=metric):
            words = ["sensitivity", *given, "--metric", metric, "--format", "csv"]
            return ScriptStep("tables", f"{folder}/tables/{name}.csv", given, tuple(words), printed=True)
        case PlannedJudgement():
            words = ["verdicts", *given, "--format", "json"]
            return ScriptStep("verdicts", f"{folder}/{name}.json", given, tuple(words), printed=True)


def _files(artefacts: Sequence[Artefact], folder: str) -> dict[Artefact, str]:
    """Where each goes: named for what it is, by the options that it has only where others are called the same."""
    plain = {one: _plain(named(one)) for one in artefacts}
    count = Counter((type(one), name) for one, name in plain.items())
    found: dict[Artefact, str] = {}
    taken: set[str] = set()
    for one, name in plain.items():
        if count[type(one), name] > 1:
            name = _plain("-".join([name, *_telling(one)]))
        base, number, stage = name[:LONGEST], 1, STAGES[type(one)]
        while (file := f"{folder}/{stage}/{base}{'' if number == 1 else f'-{number}'}.h5") in taken:
            number += 1
        taken.add(file)
        found[one] = file
    return found


def _telling(artefact: Artefact) -> Iterator[str]:
    """The options that tell one from another of the same name."""
    match artefact:
        case PlannedSources(_, learning):
            yield from option_words(learning)
        case PlannedFit(sources, options):
            yield from [*option_words(sources.learning), *option_words(options)]
        case PlannedRun(fit, _, learning, tuning):
            yield from [*_telling(fit), *option_words(learning), *([] if tuning is None else ["tuned"])]
        case _:
            yield from _telling(artefact.sources)


def _plain(text: str) -> str:
    """The text of letters, digits, dots and hyphens alone: make and Snakemake read all others as something else."""
    words = text.replace("+", "-plus")
    return re.sub(r"-{2,}", "-", re.sub(r"[^A-Za-z0-9.]+", "-", words)).strip("-.") or "artefact"


def _line(text: str) -> str:
    """The text on one line."""
    return " ".join(text.split())


def _imported(modules: tuple[str, ...]) -> list[str]:
    return [word for module in modules for word in ("--import", module)]
