"""One reproduction from the plan to the manifest: what stands in the store is found, the rest is made, then it is drawn."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from qinit_cli.errors import Interrupted
from qinit_cli.paper import experiments
from qinit_cli.paper.drawing import Drawing, file_of, made_of
from qinit_cli.paper.expected import PICTURE_SECONDS, Cost, expected
from qinit_cli.paper.experiments import (
    Artefact,
    PlannedFit,
    PlannedJudgement,
    PlannedPicture,
    PlannedSources,
    PlannedTable,
    Shown,
    Study,
)
from qinit_cli.paper.folder import Folder, opened
from qinit_cli.paper.making import Maker, inputs, ordered
from qinit_cli.paper.manifest import MANIFEST, STAGES, Spent, manifest
from qinit_cli.paper.telling import KINDS, Ahead, say_spent
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.reporter import Reporter, Whole

Entries = dict[str, dict[str, Any]]  # of the manifest, by file


@dataclass
class Reproduction:
    """What was asked for, and how far it is."""

    target: str
    scale: str
    source_sets: int
    output: str  # the folder
    force: bool
    keeping: Keeping  # where artefacts go
    machine: Machine
    paths: dict[Artefact, Path] = field(default_factory=dict)  # of what stands in the store
    digests: dict[Artefact, str] = field(default_factory=dict)  # content hashes of the same
    spent: dict[str, Spent] = field(default_factory=lambda: {stage: Spent() for stage in STAGES})

    def __post_init__(self) -> None:
        self._maker = Maker(self.keeping, self.machine)

    @cached_property
    def shown(self) -> dict[str, tuple[str, Shown]]:
        """Pictures, tables and verdicts by file, with the figure that each belongs to."""
        study = Study(experiments.SCALES[self.scale], self.source_sets)
        found: dict[str, tuple[str, Shown]] = {}
        for name in experiments.TARGETS[self.target]:
            each = experiments.experiment(name, study)
            found |= {file_of(picture): (name, picture) for picture in each.pictures}
            found |= {file_of(table): (name, table) for table in each.tables}
        judgement = experiments.judgement(self.target, study)
        return found | {file_of(judgement): (judgement.name, judgement)}

    @cached_property
    def artefacts(self) -> tuple[Artefact, ...]:
        """All that they need, in the order in which it is made."""
        return ordered(artefact for _, shown in self.shown.values() for artefact in shown.artefacts)

    @property
    def asked(self) -> dict[str, Any]:
        """What a folder must agree with to be gone on with."""
        sizes = {name: asdict(each) for name, each in experiments.SCALES[self.scale].sizes.items()}
        return {
            "target": self.target,
            "scale": self.scale,
            "source_sets": self.source_sets,
            "sizes": sizes,
        }

    def plan(self) -> Ahead:
        """What there is, and what is still to be done; refuses a folder that holds something else."""
        self._folder = opened(Path(self.output), self.asked, force=self.force)
        self._find()
        self._entries = {file: entry for file in self.shown if (entry := self._standing(self._folder, file))}
        takes = expected((one for one in self.artefacts if one not in self.paths), self.machine.threads)
        return Ahead(
            self.target,
            self.scale,
            self.artefacts,
            takes,
            tuple(self.shown),
            len([file for file in self.shown if file not in self._entries]),
            self.keeping.store or Path(),
            self.machine.threads,
        )

    def make(self, ahead: Ahead, reporter: Reporter) -> dict[str, Any]:
        """Makes and draws what `plan` found missing; what was done, as plain values."""
        folder, undrawn = self._folder, [file for file in self.shown if file not in self._entries]
        if ahead.takes or undrawn or not folder.before.get("complete"):
            self._complete(folder, ahead.takes, undrawn, self._entries, reporter)
        else:
            reporter.note(f"{self.target}: already complete")
        return {
            "schema": "qinit.reproduce/1",
            "path": str(folder.path),
            "manifest": str(folder.path / MANIFEST),
            "artefacts": len(self.artefacts),
            "made": len(ahead.takes),
            "drawn": len(undrawn),
            "steps": sum(spent.steps for spent in self.spent.values()),
            "seconds": {stage: round(spent.seconds, 3) for stage, spent in self.spent.items()},
        }

    def _find(self) -> None:
        """Looks for every artefact whose inputs stand in the store."""
        for artefact in self.artefacts:
            if all(given in self.paths for given in inputs(artefact)):
                place = self._maker.place(artefact, self.paths)
                if place.complete:
                    self._keep(artefact, place.path)

    def _keep(self, artefact: Artefact, path: Path) -> None:
        from qinit_store.reading import describe

        self.paths[artefact] = path
        self.digests[artefact] = describe(path).content_sha256

    def _standing(self, folder: Folder, file: str) -> dict[str, Any] | None:
        """The manifest's entry of a picture or table that need not be drawn again."""
        _, shown = self.shown[file]
        if any(artefact not in self.digests for artefact in shown.artefacts):
            return None
        return folder.standing(file, made_of(shown, self.digests))

    def _complete(
        self,
        folder: Folder,
        takes: Mapping[Artefact, Cost],
        undrawn: Sequence[str],
        entries: Entries,
        reporter: Reporter,
    ) -> None:
        folder.begin()
        started, began = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), time.monotonic()

        def write(*, complete: bool) -> None:
            told = manifest(
                {**self.asked, "complete": complete},
                [entries[file] for file in self.shown if file in entries],
                [self.paths[artefact] for artefact in self.artefacts if artefact in self.paths],
                self.spent,
                folder.before,
                started,
                time.monotonic() - began,
            )
            folder.write_json(MANIFEST, told)

        write(complete=False)  # from now on the folder is known as ours
        seconds = sum(each.seconds for each in takes.values()) + len(undrawn) * PICTURE_SECONDS
        try:
            with reporter.whole(len(takes) + len(undrawn), seconds) as whole:
                self._make(takes, whole)
                self._draw(folder, undrawn, entries, whole)
        except Exception:
            write(complete=False)
            raise
        except Interrupted as interrupted:
            write(complete=False)
            raise Interrupted(
                f"stopped: {len(self.paths)} of {len(self.artefacts)} artefacts are complete, {len(entries)} of "
                f"{len(self.shown)} pictures and tables drawn; the same command goes on with the rest",
                interrupted.exit_code,
            ) from None
        write(complete=True)
        say_spent(self.target, self.spent, time.monotonic() - began, reporter)

    def _make(self, takes: Mapping[Artefact, Cost], whole: Whole) -> None:
        for artefact, each in takes.items():
            whole.begin(_named(artefact), each.seconds)
            with self._counted(KINDS[type(artefact)]) as spent:
                made = self._maker.make(artefact, self.paths, whole)
                spent.steps += made.tally.steps
            self._keep(artefact, made.path)

    def _draw(self, folder: Folder, undrawn: Sequence[str], entries: Entries, whole: Whole) -> None:
        drawing = Drawing(self.paths)
        for file in undrawn:
            figure, shown = self.shown[file]
            whole.begin(shown.name, PICTURE_SECONDS)
            entry = {"name": figure, "file": file, "title": shown.title}
            match shown:
                case PlannedPicture():
                    with self._counted("pictures"):
                        entry |= self._picture(folder, shown, drawing, whole)
                case PlannedTable():
                    with self._counted("tables"):
                        folder.write_json(file, drawing.table(shown))
                case PlannedJudgement():
                    with self._counted("verdicts"):
                        folder.write_json(file, drawing.verdicts(shown))
            entries[file] = entry | {"made_of": made_of(shown, self.digests)}

    def _picture(
        self, folder: Folder, shown: PlannedPicture, drawing: Drawing, reporter: Reporter
    ) -> dict[str, str]:
        """Draws and saves it in both formats; its part of the manifest's entry."""
        drawn = drawing.picture(shown)
        for said in drawn.notes:
            reporter.note(f"{shown.name}: {said}")
        png = f"{shown.name}.png"
        for file in (file_of(shown), png):
            drawn.save(folder.picture(file))
        return {"png": png, "caption": shown.caption, "alt": drawn.alt}

    @contextmanager
    def _counted(self, stage: str) -> Iterator[Spent]:
        """Counts the time, and one thing made, for that stage."""
        began, spent = time.monotonic(), self.spent[stage]
        try:
            yield spent
            spent.made += 1
        finally:
            spent.seconds += time.monotonic() - began


def _named(artefact: Artefact) -> str:
    """The artefact on the line of progress."""
    match artefact:
        case PlannedSources():
            return f"sources {artefact.family.label}"
        case PlannedFit():
            return f"fit {artefact.sources.family.label}"
        case _:
            return f"{artefact.method.label} {artefact.family.label}"
