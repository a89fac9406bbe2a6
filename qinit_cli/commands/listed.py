"""What `qinit list` shows of each artefact, remembered from one listing to the next: opening 10,000 files takes half a minute.

An entry counts only while the file is the one that was read: same name, device, inode, size, and times of its content and of
its inode, of which no program can set the last. It is JSON in the user's cache folder, as others may write in the store.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli import __version__
from qinit_store.kinds import kind_in

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import Settings
    from qinit_store.catalog import Store
    from qinit_store.reading import Description

    Stamp = list[int]

FORM = f"qinit.listed/1 {__version__}"
WORTH = 32  # artefacts read anew before the file is written again: a few are read as fast
SETTLED = 2.0  # seconds: a file that changed this lately could change again within one tick of the file system's clock
LARGEST = 2**28  # bytes of a file that is read; 10,000 artefacts take about 2**24


@dataclass(frozen=True)
class Line:
    """What is shown of one artefact."""

    kind: str
    stem: str
    state: str
    problem: str
    tasks: int
    wanted: int | None  # tasks asked for, where its settings are known
    size: int  # bytes
    time: str
    command: str
    content: str  # hash
    family: str
    method: str
    seed: int | None  # of sources
    words: dict[str, str] | None  # its settings by a key; None where they are not known
    seed_key: str  # of a run: the one whose word is the seed of its sources
    made_of: str  # of a run: the content hash of its sources

    def fits(self) -> bool:
        """Whether each value is of its type: a line that was read from a file may hold anything."""
        texts = ("kind", "stem", "state", "problem", "time", "command", "content", "family", "method")
        counts = (self.tasks, self.size, self.wanted or 0, self.seed or 0)
        return (
            all(isinstance(getattr(self, name), str) for name in (*texts, "seed_key", "made_of"))
            and all(type(count) is int for count in counts)
            and isinstance(self.words, dict)
            and all(isinstance(word, str) for word in self.words.values())
        )


NAMES = [field.name for field in fields(Line)]


def lines(store: Store) -> list[tuple[Path, Line]]:
    """Each artefact of the store, finished and not, by its path; what was remembered of it, or else what its file says.

    What cannot be remembered (no cache folder, a full disk) is read again next time.
    """
    place = _place(store.root)
    known = _remembered(place)
    found: list[tuple[Path, Line]] = []
    kept: dict[str, tuple[Stamp, list[Any]]] = {}
    anew = 0
    for path in store.paths():
        key, stamp = f"{path.parent.name}/{path.name}", _stamp(path)
        line = _line_of(known.get(key), stamp, path)
        if line is not None and stamp is not None:
            kept[key] = known[key]
            found.append((path, line))
            continue
        for entry in store.entry(path):
            line, lasting = _read(entry)
            found.append((path, line))
            if lasting and stamp is not None and stamp == _stamp(path) and _settled(stamp):
                kept[key] = (stamp, list(asdict(line).values()))
                anew += 1
    if anew >= WORTH and place is not None:
        _remember(place, kept)
    found += [(entry.path, _read(entry)[0]) for entry in store.unfinished()]
    return found


def _read(entry: Description) -> tuple[Line, bool]:
    """The line, and whether it follows from the file and this version of qinit alone."""
    from qinit_cli.artefacts.opening import described

    entry, told = described(entry)
    line = Line(
        kind=entry.kind,
        stem=entry.path.stem,
        state=entry.state,
        problem=entry.problem,
        tasks=entry.tasks,
        wanted=None if told is None else told.sources.tasks,
        size=entry.size,
        time=entry.provenance.get("time", ""),
        command=entry.provenance.get("command", ""),
        content=entry.content_sha256,
        family="" if told is None else told.sources.family.name,
        method="",
        seed=None,
        words=None,
        seed_key="",
        made_of="",
    )
    if told is None:
        return line, False
    return _with_settings(line, told), entry.state == "done" and not entry.problem and _ours_alone(told)


def _with_settings(line: Line, told: Settings) -> Line:
    from qinit_cli.artefacts.settings import RunSettings, SourcesSettings, TuningSettings
    from qinit_cli.comparison.distinctions import seed_key, settings

    if isinstance(told, SourcesSettings):
        line = replace(line, seed=told.seed)
    if isinstance(told, RunSettings | TuningSettings):
        line = replace(line, method=told.method.label)
    if isinstance(told, RunSettings):
        line = replace(line, seed_key=seed_key(told.source_set), made_of=told.source_set.content)
        told = replace(told, source_set=replace(told.source_set, seed=0))  # its word is put in by `list`
    return replace(line, words=settings(told, labelled=False))


def _ours_alone(told: Settings) -> bool:
    """Whether no plug-in, other package or file of tasks has a say in how its settings read."""
    from qinit_cli.environments import FAMILIES
    from qinit_cli.environments.folds import OF_FILES
    from qinit_cli.learners import LEARNERS
    from qinit_cli.methods import METHODS

    here: object = told.sources.family.here
    if here is None or isinstance(here, OF_FILES) or getattr(here, "packages", None):
        return False
    own = {name for one in (FAMILIES, METHODS, LEARNERS) for name in one if one.is_own(name)}
    named = {name for key, name in _named(told.spec()) if key in ("family", "method", "init", "learner")}
    return named <= own


def _named(spec: Any, above: str = "") -> Iterator[tuple[str, str]]:
    """The name of each family, method and learner in a spec, behind the key that it stands under."""
    if isinstance(spec, Mapping):
        for key, value in spec.items():
            if key == "name":
                yield above, str(value)
            yield from _named(value, key)


def _stamp(path: Path) -> Stamp | None:
    """What tells this file from another, or from itself changed; None for what is no plain file, which is read each time."""
    try:
        found = os.lstat(path)
    except OSError:
        return None
    if not stat.S_ISREG(found.st_mode):
        return None
    return [
        found.st_dev,
        found.st_ino,
        found.st_size,
        found.st_mtime_ns,
        found.st_ctime_ns,
        found.st_mode,
        found.st_uid,
    ]


def _settled(stamp: Stamp) -> bool:
    return max(stamp[3], stamp[4]) < time.time_ns() - SETTLED * 1e9


def _line_of(remembered: Any, stamp: Stamp | None, path: Path) -> Line | None:
    match remembered:
        case [there, [*values]] if there == stamp and len(values) == len(NAMES):
            line = Line(*values)
            own = line.fits() and line.stem == path.stem and line.kind == kind_in(path.parent.name)
            return line if own and os.access(path, os.R_OK) else None
    return None


def _place(root: Path) -> Path | None:
    """The file for the store at `root`; None where this user has no cache folder."""
    chosen = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if not os.path.isabs(chosen):
        return None
    name = hashlib.sha256(os.fsencode(os.path.realpath(root))).hexdigest()[:32]
    return Path(chosen, "qinit", "listed", f"{name}.json")


def _remembered(place: Path | None) -> dict[str, Any]:
    """What the file holds by "FOLDER/NAME"; nothing where there is none, or none of this version's that this user wrote."""
    if place is None:
        return {}
    try:
        with open(os.open(place, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            found = os.fstat(file.fileno())
            safe = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o022
            told = json.loads(file.read()) if safe and found.st_size <= LARGEST else None
    except (OSError, ValueError, RecursionError):
        return {}
    match told:
        case {"form": str(form), "artefacts": {} as artefacts} if form == FORM:
            return dict(artefacts)
    return {}


def _remember(place: Path, kept: Mapping[str, Any]) -> None:
    """Writes the file whole or not at all; two that write at once both write what is so."""
    text = json.dumps({"form": FORM, "artefacts": kept})
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        number, name = tempfile.mkstemp(dir=place.parent, prefix=".listed-")
        try:
            with open(number, "w", encoding="ascii") as file:
                file.write(text)
            os.replace(name, place)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(name)
            raise
