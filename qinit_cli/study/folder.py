"""The folder of a study: its manifest, what may be written into it, and every file whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.output_file import OutputFile
from qinit_cli.study.manifest import FolderKind, entries_of
from qinit_store.errors import SystemFailed

if TYPE_CHECKING:
    from qinit_cli.plots.drawn import PictureFile


REPORT, PROGRESS = "report.html", "progress.json"
OTHERS = (REPORT, PROGRESS)  # files that no entry of the manifest names


@dataclass
class Folder:
    """A study's folder. Made by `opened`."""

    path: Path
    kind: FolderKind
    before: dict[str, Any] = field(default_factory=dict)  # the manifest of the same settings that stood there
    replaced: dict[str, Any] = field(default_factory=dict)  # that of other settings, whose files go

    def begin(self, shown: Iterable[str]) -> None:
        """Makes room: what is replaced, and what is no longer among the files that are `shown`, is removed."""
        _remove(self.path, self.kind, self.replaced)
        there = set(shown)
        for entry in entries_of(self.before):
            if entry["file"] not in there:
                _unlink(self.path, files_of(entry))

    def picture(self, name: str) -> PictureFile:
        """Where the picture of this name goes."""
        from qinit_cli.plots.drawn import PictureFile

        return PictureFile(self.path / name, self.kind.command, force=True)

    @property
    def has_report(self) -> bool:
        """Whether the report of what the manifest says stands there."""
        return (self.path / REPORT).is_file()

    def remove_report(self) -> None:
        """Removes the report, which is of an earlier manifest."""
        _unlink(self.path, [REPORT])

    def write(self, name: str, content: bytes) -> None:
        """Brings a file under this name, whole or not at all; the folder is made. SystemFailed where that is refused."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SystemFailed(
                f"cannot make the folder {self.path}: {error.strerror or error}; name another with -o"
            ) from error
        OutputFile(self.path / name, force=True).write(content)

    def write_json(self, name: str, content: dict[str, Any]) -> None:
        """The same for one JSON object; NaN is refused."""
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        self.write(name, text.encode())

    def standing(self, file: str, made_of: str) -> dict[str, Any] | None:
        """What the manifest says of a picture, a table or verdicts, if it stands there and was made of the same."""
        for entry in entries_of(self.before):
            if entry["file"] == file and entry["made_of"] == made_of:
                there = all((self.path / name).is_file() for name in files_of(entry))
                return dict(entry) if there else None
        return None


def files_of(entry: dict[str, Any]) -> list[str]:
    """The names of the files that an entry of a manifest is of."""
    return [entry[key] for key in ("file", "png", "csv", "parquet") if key in entry]


def opened(path: Path, kind: FolderKind, asked: dict[str, Any], *, force: bool) -> Folder:
    """The folder, not made yet, to be gone on with where it holds what is `asked`.

    NotAllowed where it holds something else, or one of other settings; with `force` the files of such a one are removed once
    something is written.
    """
    if path.exists() and not path.is_dir():
        raise UsageError(f"-o {path} is a file; name a folder")
    # an attempt that was killed may have left a part of a file behind
    if not path.exists() or all(file.name.endswith(".part") for file in path.iterdir()):
        return Folder(path, kind)
    before = read_manifest(path, kind)
    if before is None:
        raise NotAllowed(f"{path} holds something other than a {kind.noun}; name another folder with -o")
    if all(before.get(name) == value for name, value in asked.items()):
        return Folder(path, kind, before)
    if not force:
        there = ", ".join(f"{name.replace('_', ' ')} {before.get(name)}" for name in kind.told)
        raise NotAllowed(
            f"{path} holds a {kind.noun} of other settings ({there}); name another folder with -o, or replace it with --force"
        )
    return Folder(path, kind, replaced=before)


def read_manifest(path: Path, kind: FolderKind) -> dict[str, Any] | None:
    """The manifest in the folder; None where there is none of this kind."""
    try:
        there = json.loads((path / kind.manifest).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return there if isinstance(there, dict) and there.get("schema") == kind.schema else None


def _remove(path: Path, kind: FolderKind, manifest: dict[str, Any]) -> None:
    """Removes the files that the manifest names, and it; nothing outside the folder."""
    if not manifest:
        return
    named = [name for entry in entries_of(manifest) for name in files_of(entry)]
    _unlink(path, [*named, *OTHERS, kind.manifest])


def _unlink(path: Path, names: Iterable[str]) -> None:
    for name in names:
        if Path(name).name == name:
            (path / name).unlink(missing_ok=True)
