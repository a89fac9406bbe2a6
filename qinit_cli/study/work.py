"""One study from the plan to the report: what stands in the store is found, the rest is made, then all of it is shown."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.comparison.table import MEASURES, with_columns
from qinit_cli.errors import Interrupted, QinitError
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.pace import Pace
from qinit_cli.pipeline.reporter import Reporter, Whole
from qinit_cli.pipeline.together import together
from qinit_cli.study.ahead import Ahead, report_spent
from qinit_cli.study.drawing import Drawing, file_of, made_of
from qinit_cli.study.folder import PROGRESS, REPORT, opened
from qinit_cli.study.foresight import PICTURE_SECONDS, Cost, Foresight
from qinit_cli.study.making import Maker, Place
from qinit_cli.study.manifest import COUNTED, FolderKind, Spent, entries_of, manifest
from qinit_cli.study.pace import DRAWING, kind_of
from qinit_cli.study.planned import (
    STAGES,
    Artefact,
    PlannedJudgement,
    PlannedPicture,
    PlannedShares,
    PlannedTable,
    Shown,
    inputs,
    named,
    ordered,
)
from qinit_cli.study.reading import Study
from qinit_store.errors import StoreError, SystemFailed
from qinit_store.wording import shell_line

if TYPE_CHECKING:
    from qinit_cli.pipeline.job import Made
    from qinit_store.reading import Description

ManifestEntries = dict[str, dict[str, Any]]  # of the manifest, by file


@dataclass(frozen=True)
class Failed:
    """An artefact that could not be made, or a picture or table of which none could be drawn."""

    name: str
    problem: str
    command: str = ""  # that tries an artefact alone


@dataclass
class StudyWork:
    """What was asked for, and how far it is."""

    study: Study
    name: str  # on its lines
    kind: FolderKind
    asked: Mapping[str, Any]  # what a folder must agree with to be gone on with
    told: Mapping[str, Any]  # what its manifest says besides
    output: Path  # the folder
    keeping: Keeping  # where artefacts go
    machine: Machine
    force: bool = False
    at_once: int = 1  # artefacts
    found: dict[Artefact, Description] = field(default_factory=dict)  # what stands in the store
    paths: dict[Artefact, Path] = field(default_factory=dict)  # of the same
    digests: dict[Artefact, str] = field(default_factory=dict)  # content hashes of the same
    failed: list[Failed] = field(default_factory=list)
    spent: dict[str, Spent] = field(default_factory=lambda: {stage: Spent() for stage in COUNTED})

    def __post_init__(self) -> None:
        self._maker = Maker(self.keeping, self._share(), self.study.imports)
        self._entries: ManifestEntries = {}
        self._left_out: dict[str, dict[str, str]] = {}  # optional pictures, by file
        self._counting = threading.Lock()  # of `spent`, which the threads of several artefacts add to

    def _share(self) -> Machine:
        """How much of the machine one artefact uses."""
        if self.at_once == 1 or self.machine.dask is not None:
            return self.machine
        return replace(self.machine, jobs=max(1, self.machine.threads // self.at_once))

    @cached_property
    def shown(self) -> dict[str, Shown]:
        """Pictures, tables and verdicts by file."""
        return {file_of(one): one for one in self.study.shown}

    @cached_property
    def artefacts(self) -> tuple[Artefact, ...]:
        """All that are made, in the order in which they are made."""
        return ordered(self.study.artefacts)

    def plan(self) -> Ahead:
        """What there is, and what is still to be done; refuses a folder that holds something else."""
        self._folder = opened(self.output, self.kind, dict(self.asked), force=self.force)
        self.find()
        self._entries = {file: entry for file in self.shown if (entry := self._standing(file))}
        before = self._folder.before.get("left_out", {})
        self._left_out = {file: told for file, told in before.items() if self._of_now(file, told)}
        missing = [one for one in self.artefacts if one not in self.paths]
        return Ahead(
            self.name,
            self.asked["scale"],
            self.artefacts,
            Foresight(self.machine).expected(missing),
            tuple(self.shown),
            len(self._undrawn),
            self.keeping.store or Path(),
            self.machine.threads,
            self.kind,
        )

    def find(self) -> dict[Artefact, Place]:
        """Looks for every artefact whose inputs stand in the store; where each of these belongs."""
        places: dict[Artefact, Place] = {}
        for artefact in self.artefacts:
            if all(given in self.found for given in inputs(artefact)):
                places[artefact] = place = self._maker.place(artefact, self.found)
                if place.there is not None:
                    self._keep(artefact, place.there)
        return places

    def make(self, ahead: Ahead, reporter: Reporter) -> dict[str, Any]:
        """Makes and shows what `plan` found missing; what was done, as plain values."""
        undrawn = self._undrawn
        # a file may show fewer pictures than before, or caption them otherwise, with nothing to be made
        changed = {entry["file"]: entry for entry in entries_of(self._folder.before)} != self._entries
        whole = self._folder.before.get("complete") and self._folder.has_report
        if ahead.takes or undrawn or changed or not whole:
            self._complete(ahead.takes, undrawn, reporter)
        else:
            reporter.note(f"{self.name}: already complete")
        return {
            "schema": self.kind.done,
            "path": str(self._folder.path),
            "manifest": str(self._folder.path / self.kind.manifest),
            "artefacts": len(self.artefacts),
            "made": sum(self.spent[stage].made for stage in STAGES.values()),
            "drawn": len(undrawn),
            "failed": [asdict(one) for one in self.failed],
            "steps": sum(spent.steps for spent in self.spent.values()),
            "seconds": {stage: round(spent.seconds, 3) for stage, spent in self.spent.items()},
        }

    def _keep(self, artefact: Artefact, there: Description) -> None:
        self.found[artefact] = there
        self.paths[artefact] = there.path
        self.digests[artefact] = there.content_sha256

    @property
    def _undrawn(self) -> list[str]:
        """The files that are still to be made."""
        return [file for file in self.shown if file not in self._entries and file not in self._left_out]

    def _of_now(self, file: str, told: Mapping[str, str]) -> bool:
        """Whether a picture that was left out would be made of the same."""
        return file in self.shown and told["made_of"] == made_of(self.shown[file], self.digests)

    def _standing(self, file: str) -> dict[str, Any] | None:
        """The manifest's entry of a picture or table that need not be made again."""
        shown = self.shown[file]
        if not isinstance(shown, PlannedJudgement) and any(
            artefact not in self.digests for artefact in shown.artefacts
        ):
            return None
        entry = self._folder.standing(file, made_of(shown, self.digests))
        if entry is None:
            return None
        told = {"caption": shown.caption} if isinstance(shown, PlannedPicture) else {}
        return entry | {"name": shown.figure} | told

    def _complete(self, takes: Mapping[Artefact, Cost], undrawn: list[str], reporter: Reporter) -> None:
        folder = self._folder
        folder.begin(self.shown)
        started, began = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), time.monotonic()

        def write(*, complete: bool) -> None:
            told = manifest(
                self.kind,
                {
                    **self.asked,
                    **self.told,
                    "complete": complete,
                    "failed": [asdict(one) for one in self.failed],
                    "left_out": self._left_out,
                },
                [self._entries[file] for file in self.shown if file in self._entries],
                [self.paths[artefact] for artefact in self.artefacts if artefact in self.paths],
                self.spent,
                folder.before,
                started,
                time.monotonic() - began,
            )
            folder.write_json(self.kind.manifest, told)

        write(complete=False)  # from now on the folder is known as ours
        foreseen: dict[tuple[str, ...], float] = {DRAWING: len(undrawn) * PICTURE_SECONDS}
        for artefact, cost in takes.items():
            kind = kind_of(artefact)
            foreseen[kind] = foreseen.get(kind, 0.0) + cost.seconds
        try:
            with reporter.whole(len(takes) + len(undrawn), Pace(foreseen), folder.path / PROGRESS) as whole:
                self._make(takes, whole)
                self._draw(undrawn, whole)
        except Exception:
            write(complete=False)
            raise
        except Interrupted as interrupted:
            write(complete=False)
            raise Interrupted(
                f"stopped: {len(self.paths)} of {len(self.artefacts)} artefacts are complete, {len(self._entries)} of "
                f"{len(self.shown)} pictures and tables drawn; the same command goes on with the rest",
                interrupted.exit_code,
            ) from None
        folder.remove_report()  # one that stands there is of what the manifest says
        write(complete=not self.failed)
        self._report()
        report_spent(self.name, self.spent, time.monotonic() - began, reporter, complete=not self.failed)

    def _make(self, takes: Mapping[Artefact, Cost], whole: Whole) -> None:
        calls = {artefact: partial(self._one, artefact, cost, whole) for artefact, cost in takes.items()}
        if self.at_once == 1:
            for artefact, call in calls.items():
                self._take(artefact, call(), whole)
            return
        needs = {artefact: [given for given in inputs(artefact) if given in takes] for artefact in takes}
        with self._connected():
            for artefact, future in together(calls, needs, self.at_once):
                self._take(artefact, future.result(), whole)

    def _connected(self) -> AbstractContextManager[None]:
        """One connection to the cluster for all artefacts, if they are learned on one."""
        if self.machine.dask is None:
            return nullcontext()
        from qinit_cli.pipeline import cluster

        return cluster.shared(self.machine.dask)

    def _one(self, artefact: Artefact, cost: Cost, whole: Whole) -> Made | Failed:
        """Makes one, in whatever thread; what was wrong where it failed."""
        if lacking := [given for given in inputs(artefact) if given not in self.paths]:
            return Failed(named(artefact), f"needs {named(lacking[0])}, which failed")
        with whole.thing(named(artefact), kind_of(artefact), cost.seconds):
            try:
                with self._counted(STAGES[type(artefact)]) as spent:
                    made = self._maker.make(artefact, self.paths, whole)
                    spent.steps = made.tally.steps
                return made
            except SystemFailed:  # a full disk fails all that follows
                raise
            except Exception as error:  # of any kind: one artefact of hundreds ends no study
                command = shell_line("qinit", *self._maker.command(artefact, self.paths))
                return Failed(named(artefact), _problem(error), command)

    def _take(self, artefact: Artefact, made: Made | Failed, whole: Whole) -> None:
        if isinstance(made, Failed):
            self._fail(made, whole)
        else:
            from qinit_store.reading import describe

            self._keep(artefact, describe(made.path))

    def _fail(self, failed: Failed, reporter: Reporter) -> None:
        self.failed.append(failed)
        alone = f"; alone it is {failed.command}" if failed.command else ""
        reporter.note(f"failed: {failed.name}: {failed.problem}{alone}")

    def _draw(self, undrawn: list[str], whole: Whole) -> None:
        drawing = Drawing(self.paths)
        for file in undrawn:
            shown = self.shown[file]
            lacking = [artefact for artefact in shown.artefacts if artefact not in self.paths]
            if lacking and not isinstance(shown, PlannedJudgement):
                self._fail(Failed(shown.name, f"needs {named(lacking[0])}, which failed"), whole)
                continue
            with whole.thing(shown.name, DRAWING, PICTURE_SECONDS):
                try:
                    self._entries[file] = self._shown(shown, file, drawing, whole)
                except QinitError as error:
                    if isinstance(shown, PlannedPicture) and shown.optional:
                        told = {"name": shown.name, "problem": _problem(error)}
                        self._left_out[file] = told | {"made_of": made_of(shown, self.digests)}
                        whole.note(f"{shown.name} is left out: {told['problem']}")
                    else:
                        self._fail(Failed(shown.name, _problem(error)), whole)

    def _shown(self, shown: Shown, file: str, drawing: Drawing, reporter: Reporter) -> dict[str, Any]:
        """Draws one; its entry in the manifest."""
        entry: dict[str, Any] = {"name": shown.figure, "file": file, "title": shown.title or ""}
        match shown:
            case PlannedPicture():
                with self._counted("pictures"):
                    entry |= self._picture(shown, drawing, reporter)
            case PlannedTable():
                with self._counted("tables"):
                    table = drawing.table(shown)
                    columns = shown.columns or (shown.metric, *MEASURES)
                    entry |= self._table(shown.name, table, with_columns(table["rows"], columns))
            case PlannedShares():
                with self._counted("tables"):
                    shares = drawing.shares(shown)
                    entry |= self._table(shown.name, shares, shares["rows"])
            case PlannedJudgement():
                with self._counted("verdicts"):
                    self._folder.write_json(file, drawing.verdicts(shown))
        return entry | {"made_of": made_of(shown, self.digests)}

    def _picture(self, shown: PlannedPicture, drawing: Drawing, reporter: Reporter) -> dict[str, str]:
        """Draws and saves it in both formats; its part of the manifest's entry."""
        drawn = drawing.picture(shown)
        for said in drawn.notes:
            reporter.note(f"{shown.name}: {said}")
        png = f"{shown.name}.png"
        for file in (file_of(shown), png):
            drawn.save(self._folder.picture(file))
        return {"png": png, "caption": shown.caption, "alt": drawn.alt, "title": shown.title or drawn.title}

    def _table(self, name: str, table: dict[str, Any], rows: list[dict[str, Any]]) -> dict[str, str]:
        """Saves it as JSON, its rows as CSV and, with pyarrow, Parquet; its part of the manifest's entry."""
        from qinit_cli.study.table_files import csv_of, parquet_of

        self._folder.write_json(f"{name}.json", table)
        files: dict[str, str] = {}
        for kind, content in (("csv", csv_of(rows)), ("parquet", parquet_of(rows))):
            if content is not None:
                files[kind] = f"{name}.{kind}"
                self._folder.write(files[kind], content)
        return files

    def _report(self) -> None:
        """Writes the page, once the manifest is there."""
        from qinit_cli import __version__
        from qinit_cli.report.document import page
        from qinit_cli.report.page import html
        from qinit_cli.report.reproduced import material

        made = material(self._folder.path, str(self.keeping.store), None, None)
        self._folder.write(REPORT, html(page(made, f"qinit {__version__}")).encode())

    @contextmanager
    def _counted(self, stage: str) -> Iterator[Spent]:
        """Counts the time, one thing made, and the steps that the block notes, for that stage."""
        began, own = time.monotonic(), Spent()
        try:
            yield own
            own.made = 1
        finally:
            own.seconds = time.monotonic() - began
            with self._counting:
                self.spent[stage] += own


def _problem(error: Exception) -> str:
    """What is reported of an error, in one line; of one that nobody foresaw with its type."""
    told = " ".join(str(error).split())
    return told if isinstance(error, QinitError | StoreError) else f"{type(error).__name__}: {told}"
