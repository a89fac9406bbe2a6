"""A study's file: which distributions, fits, methods and targets are combined, and what is shown of them.

Every option of the plain commands can stand in it, and a list makes one of each value. All of it is read before anything is
made: an unknown key, an impossible value or an empty selection is refused with its file and line.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from qinit_cli.errors import UsageError
from qinit_cli.nearest import nearest
from qinit_cli.study.combining import Combining, Selectable
from qinit_cli.study.entries import Entries, keys
from qinit_cli.study.folder import PROGRESS
from qinit_cli.study.given import Given
from qinit_cli.study.lines import lines
from qinit_cli.study.planned import (
    Artefact,
    PlannedJudgement,
    PlannedPicture,
    PlannedShares,
    PlannedTable,
    Shown,
    inputs,
)
from qinit_cli.study.scaled_file import ENTRIES, ScaledFile
from qinit_cli.study.showing import OF_PLOT, OF_TABLE, family_of, pictures, tables
from qinit_cli.study.usual import usual

TOP = ("study", "sources", "targets", "verdicts", "part", "scale", *ENTRIES)
OF_STUDY = ("title", "question", "import", "baseline", "metric")
FILE_NAME = re.compile(r"[\w+=-][\w.+= -]*")  # no folder, and none that is hidden
LONGEST = 200  # bytes of a name, to which endings and .part are added
OWN_FILES = ("study.json", "reproduction.json", PROGRESS)  # that a folder holds beside its tables


@dataclass
class Study:
    """A study that was read. `read` makes it."""

    file: Path
    text: str
    scale: str | None
    title: str
    question: str | None
    imports: tuple[str, ...]
    planned: tuple[Selectable, ...]
    shown: tuple[Shown, ...]
    parts: Mapping[str, tuple[str, ...]]
    sets: int | None
    selected: tuple[str, ...] = ()  # names of what alone is asked for; (): all of it

    @classmethod
    def read(cls, file: Path, scale: str | None = None, sets: int | None = None) -> Study:
        """The study in a file, at one of its scales and with so many source sets; UsageError where it is none."""
        try:
            text = file.read_bytes().decode("utf-8-sig")
        except OSError as error:
            problem = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror
            raise UsageError(f"{file}: {problem}; qinit study init writes an example") from error
        except UnicodeDecodeError as error:
            raise UsageError(f"{file} is not UTF-8 (byte {error.start}); save it as UTF-8") from error
        return cls.of(text, file, scale, sets)

    @classmethod
    def of(cls, text: str, file: Path, scale: str | None = None, sets: int | None = None) -> Study:
        """The study that a text describes."""
        try:
            values = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise UsageError(f"{file} is no TOML: {error}") from error
        except RecursionError as error:
            raise UsageError(
                f"{file} nests its lists or tables too deeply; nothing in a study needs more than three"
            ) from error
        return _Reading(Given(str(file), (), values, lines(text)), text, file, scale, sets).study()

    @property
    def digest(self) -> str:
        """SHA-256 of the file's text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def only(self, names: Sequence[str]) -> Study:
        """What the named parts, figures, pictures and tables need, and nothing else; all of it where none is named.

        Claims are judged whole where parts alone are named, else as far as these artefacts bear on them.
        """
        if not names:
            return self
        wanted = {part for name in names for part in self.parts.get(name, (name,))}
        known = {name for one in self.shown for name in (one.name, one.figure)}
        if unknown := sorted(wanted - known):
            raise UsageError(
                f"{self.file} shows no {unknown[0]}; {nearest(unknown[0], [*self.parts, *sorted(known)])}"
            )
        shown: list[Shown] = []
        for one in self.shown:
            if not isinstance(one, PlannedJudgement) and wanted & {one.name, one.figure}:
                shown.append(one)
        needed = dict.fromkeys(artefact for one in shown for artefact in one.artefacts)
        whole = all(name in self.parts for name in names)
        if whole:
            families = {family_of(artefact) for artefact in needed}
            needed |= dict.fromkeys(one for one in _ends(self.planned) if family_of(one) in families)
        if any(isinstance(one, PlannedJudgement) for one in self.shown):
            shown.append(PlannedJudgement(tuple(needed), whole))
        kept = tuple(one for one in self.planned if one.artefact in needed)
        return replace(self, planned=kept, shown=tuple(shown), selected=tuple(names))

    @property
    def artefacts(self) -> tuple[Artefact, ...]:
        """All that is made."""
        shown = [artefact for one in self.shown for artefact in one.artefacts]
        return tuple(dict.fromkeys([*(one.artefact for one in self.planned), *shown]))


def _ends(planned: Sequence[Selectable]) -> list[Artefact]:
    """The artefacts of which no other is made."""
    given = {one for each in planned for one in inputs(each.artefact)}
    return [one.artefact for one in planned if one.artefact not in given]


@dataclass
class _Reading:
    """Reads one file."""

    top: Given
    text: str
    file: Path
    scale: str | None
    sets: int | None

    def study(self) -> Study:
        self.top.check_keys(TOP)
        told = self.top.table("study")
        told.check_keys(OF_STUDY)
        imports = _imported(told)
        self._scaled = ScaledFile(self.top, self.file, self.scale)
        entries = Entries(self._scaled, self.sets)
        if not entries.distributions:
            self.top.refuse("no [[distribution]] stands here; a study needs at least one")
        self._check_names(entries)
        planned = tuple(Combining(entries, self.top))
        shown = tuple(self._shown(planned, told))
        if self._judged():
            judged = [*(artefact for one in shown for artefact in one.artefacts), *_ends(planned)]
            shown = (*shown, PlannedJudgement(tuple(dict.fromkeys(judged)), whole=True))
        self._check_files(shown)
        return Study(
            file=self.file,
            text=self.text,
            scale=self.scale,
            title=told.of("title", str) or self.file.stem,
            question=told.of("question", str),
            imports=imports,
            planned=planned,
            shown=shown,
            parts=self._parts(shown),
            sets=self.sets,
        )

    def _check_names(self, entries: Entries) -> None:
        """Refuses a selection by a name that nothing has."""
        known: dict[str, set[str]] = {
            "distributions": {name for one in entries.distributions for name in one.names},
            "fits": {name for one in entries.fits for name in one.names},
            "methods": {name for one in entries.methods for name in one.names},
        }
        selecting = [entry for kind in ENTRIES for entry in self.top.tables(kind)]
        selecting += [
            one
            for kind in ("table", "plot")
            for entry in self.top.tables(kind)
            for one in entry.tables("select")
        ]
        for entry in selecting:
            for key in known.keys() & entry.values.keys():
                for name in entry.texts(key) or ():
                    if name not in known[key]:
                        there = sorted(known[key])
                        ending = nearest(name, there) if there else "there are none"
                        entry.refuse(f"{key} names {name!r}, which nothing is called; {ending}", key)

    def _parts(self, shown: Sequence[Shown]) -> dict[str, tuple[str, ...]]:
        parts = self.top.table("part")
        known = sorted({name for one in shown for name in (one.name, one.figure)})
        for part in parts.values:
            for name in parts.texts(part) or ():
                if name not in known:
                    parts.refuse(f"the study shows no {name}; {nearest(name, known)}", part)
        return {name: parts.texts(name) or () for name in parts.values}

    def _check_files(self, shown: Sequence[Shown]) -> None:
        """Refuses names that are no names of files, or that two pictures or two tables share."""
        for kind, called in (
            (PlannedPicture, "pictures"),
            (PlannedTable | PlannedShares | PlannedJudgement, "tables"),
        ):
            taken = set() if kind is PlannedPicture else {Path(one).stem for one in OWN_FILES}
            for one in shown:
                if not isinstance(one, kind):
                    continue
                if len(one.name.encode()) > LONGEST or not FILE_NAME.fullmatch(one.name):
                    self.top.refuse(
                        f"{one.name!r} cannot name a file; take at most {LONGEST} letters, digits, spaces and . _ - + ="
                    )
                if one.name.lower() in taken:  # of which some file systems have one, whatever the case
                    self.top.refuse(f"two {called} are called {one.name}; give each a name of its own")
                taken.add(one.name.lower())

    def _shown(self, planned: tuple[Selectable, ...], told: Given) -> Iterator[Shown]:
        if not any(self.top.tables(kind) for kind in ("table", "plot")):
            yield from usual(planned, told)
        for entry in self._scaled.entries("plot"):
            entry.check_keys([*OF_PLOT, *self._plot_keys(entry)])
            yield from pictures(entry, planned)
        for entry in self._scaled.entries("table"):
            entry.check_keys(OF_TABLE)
            yield from tables(entry, planned, told)

    def _judged(self) -> bool:
        """Whether the paper's claims are judged: [verdicts] stands there."""
        if "verdicts" not in self.top.values:
            return False
        self.top.table("verdicts").check_keys(())
        return True

    def _plot_keys(self, entry: Given) -> list[str]:
        from qinit_cli.plots import PLOTS

        kind = entry.of("kind", str)
        if kind is None:
            entry.refuse(f"kind is missing; it is one of {', '.join(PLOTS)}")
        if kind not in PLOTS:
            entry.refuse(f"there is no plot {kind}; {nearest(kind, PLOTS)}", "kind")
        return keys(PLOTS[kind])


def _imported(told: Given) -> tuple[str, ...]:
    """The modules that the study names, which register environments."""
    modules = told.texts("import") or ()
    if modules:
        from qinit_cli.environments.modules import import_named

        try:
            import_named(modules)
        except UsageError as error:
            told.refuse(str(error).removeprefix("--"), "import")
    return modules
