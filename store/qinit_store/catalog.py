"""A store is a directory of artefacts: their names, how they are referred to, and what there is.

h5py is imported where files are read, so that names can be completed without it.
"""

from __future__ import annotations

import difflib
import errno
import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from qinit_store.errors import Damaged, NotFound, Refused, SystemFailed
from qinit_store.folder import read_record, tasks_saved
from qinit_store.kinds import folder_of, folders, kind_in
from qinit_store.lock import being_held
from qinit_store.presence import exists, is_folder, names, refusal, status
from qinit_store.spec import Spec, canonical_json, spec_sha256, without_tasks

if TYPE_CHECKING:
    from qinit_store.reading import Description

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
SUFFIX = ".h5"
WORK = f"{SUFFIX}.work"
NOT_ALLOWED = (errno.EACCES, errno.EPERM)


@dataclass(frozen=True)
class Store:
    """The artefacts under `root`, each in the folder of its kind."""

    root: Path

    def path_for(self, kind: str, stem: str, spec: Spec) -> Path:
        """Where an artefact with this spec belongs: `<stem>-<first 8 digits of the spec's hash>.h5`."""
        name = f"{stem}-{spec_sha256(spec)[:8]}{SUFFIX}"
        return self.root / folder_of(kind) / _checked(name)

    def resolve(self, reference: str) -> Path:
        """The path of the artefact `reference`: a path, or a name in the store with or without `.h5`.

        "FOLDER/NAME" tells apart a name that stands in two folders. NotFound, with the nearest name; Refused
        where the name is ambiguous or no name.
        """
        is_path = "/" in reference or reference.endswith(SUFFIX)
        if is_path and exists(Path(reference)):
            return Path(reference)
        folder, _, name = reference.rpartition("/")
        if folder and folder not in folders(self.root):
            raise NotFound(f"there is no {reference}{_meant(reference, _beside(reference))}")
        found = [path for path in self._named(_checked(name)) if folder in ("", path.parent.name)]
        if len(found) > 1:
            both = " and ".join(f"{path.parent.name}/{path.stem}" for path in found)
            raise Refused(f"{reference} is the name of {both}; write one of these")
        if not found:
            here = "here or " if is_path and not folder else ""
            known = [*(_beside(name) if here else []), *self.names()]
            raise NotFound(f"there is no {reference} {here}in {self.root}{_meant(name, known)}")
        return found[0]

    def names(self) -> list[str]:
        """The names of the finished artefacts, without `.h5`, in order."""
        return sorted(
            name.removesuffix(SUFFIX)
            for folder in folders(self.root)
            for name in self._finished_names(folder)
        )

    def entries(self) -> Iterator[Description]:
        """What there is, finished and not, in the order of folders and names; one that is damaged says so."""
        for path in self.paths():
            yield from self.entry(path)
        yield from self.unfinished()

    def paths(self) -> Iterator[Path]:
        """The paths of the finished artefacts, in the order of folders and names."""
        for folder in folders(self.root):
            yield from self._finished(folder)

    def entry(self, path: Path) -> Iterator[Description]:
        """The finished artefact at `path`, one that is damaged says so; nothing where it has gone since it was listed."""
        with suppress(NotFound):
            yield _row(path, partial(_description, path))

    def unfinished(self) -> Iterator[Description]:
        """What is begun and not finished, in the order of folders and names."""
        for folder in folders(self.root):
            for name in names(self.root / folder):
                if not (name.startswith(".") and name.endswith(WORK)):
                    continue
                work = self.root / folder / name
                if is_folder(work):
                    yield _row(_target(work), partial(_unfinished, work))

    def relatives(
        self, kind: str, spec: Spec, compared: Callable[[Spec], Spec] = without_tasks
    ) -> list[Description]:
        """The finished artefacts of `kind` with the same spec, the largest first; `compared` gives the part that counts.

        A file without permission to read is skipped; SystemFailed if reading one fails otherwise, as its tasks would
        be learned again.
        """
        wanted = canonical_json(compared(spec))
        found = [
            entry
            for entry in map(_known_description, self._finished(folder_of(kind)))
            if entry.state == "done" and entry.kind == kind and canonical_json(compared(entry.spec)) == wanted
        ]
        return sorted(found, key=lambda entry: -entry.tasks)

    def _finished(self, folder: str) -> list[Path]:
        return [self.root / folder / name for name in self._finished_names(folder)]

    def _finished_names(self, folder: str) -> list[str]:
        there = names(self.root / folder)
        return [name for name in there if name.endswith(SUFFIX) and not name.startswith(".")]

    def _named(self, name: str) -> list[Path]:
        full = name if name.endswith(SUFFIX) else name + SUFFIX
        paths = [self.root / folder / full for folder in folders(self.root)]
        return [path for path in paths if exists(path)]


def _beside(reference: str) -> list[str]:
    """The artefacts in the folder that a path leads to, written as it is; none for a name in the store."""
    if not reference.endswith(SUFFIX):
        return []
    folder = reference[: reference.rfind("/") + 1]
    with suppress(SystemFailed):
        return [folder + name for name in names(Path(folder)) if name.endswith(SUFFIX) and name[0] != "."]
    return []


def _meant(reference: str, known: list[str]) -> str:
    """What to do about a reference that leads nowhere: the nearest of the `known` ones, compared without `.h5`."""
    stems = {name.removesuffix(SUFFIX): name for name in reversed(known)}
    near = difflib.get_close_matches(reference.removesuffix(SUFFIX), stems, n=1)
    return f"; did you mean {stems[near[0]]}?" if near else "; `qinit list` shows what the store holds"


def _checked(name: str) -> str:
    if not NAME.fullmatch(name):
        raise Refused(
            f"{name!r} is no name: letters, digits, '.', '_' and '-', at most 100, a letter or digit first"
        )
    return name


def _row(path: Path, known: Callable[[], Description]) -> Description:
    """What is `known` of an artefact; of one that cannot be read, why. NotFound."""
    try:
        return known()
    except SystemFailed as failure:
        return replace(_nothing_known(path), state="unreadable", problem=str(failure))


def _description(path: Path) -> Description:
    from qinit_store.reading import describe

    try:
        return describe(path)
    except Damaged as damage:
        return replace(_nothing_known(path), state=damage.state, problem=str(damage))


def _known_description(path: Path) -> Description:
    """The same, read once while the file stands there: whoever makes many artefacts looks for relatives of each."""
    try:
        there = os.lstat(path)
        return _immutable(path, there.st_ino, there.st_mtime_ns, there.st_size)
    except (FileNotFoundError, NotFound):
        return replace(_nothing_known(path), state="gone")
    except OSError as problem:
        raise refusal("look at", path, problem) from problem
    except SystemFailed as failure:
        if failure.code not in NOT_ALLOWED:
            raise
        return replace(_nothing_known(path), state="unreadable", problem=str(failure))


@lru_cache(maxsize=65_536)
def _immutable(path: Path, *which: int) -> Description:
    return _description(path)


def _unfinished(work: Path) -> Description:
    """What a work folder is to become; `tasks` are those saved so far, by the names of its parts."""
    target = _target(work)
    state = "being written" if being_held(work) else "unfinished"
    entry = replace(_nothing_known(target), state=state, tasks=tasks_saved(work))
    record = read_record(work)
    if record is None:
        return replace(entry, problem="its settings cannot be read")
    return replace(
        entry,
        kind=record.kind,
        spec=dict(record.spec),
        spec_sha256=spec_sha256(record.spec),
        provenance=record.provenance,
    )


def _target(work: Path) -> Path:
    """The artefact that a work folder belongs to."""
    return work.with_name(work.name.removeprefix(".").removesuffix(".work"))


def _size(path: Path) -> int:
    """In bytes; 0 if unknown, which another message reports."""
    try:
        found = status(path)
    except SystemFailed:
        return 0
    return found.st_size if found is not None and stat.S_ISREG(found.st_mode) else 0


def _nothing_known(path: Path) -> Description:
    from qinit_store.reading import Description

    return Description(
        path=path,
        kind=kind_in(path.parent.name),
        spec={},
        spec_sha256="",
        content_sha256="",
        provenance={},
        inputs=(),
        tasks=0,
        schema_version=0,
        size=_size(path),
    )
