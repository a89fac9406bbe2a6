"""The folder of a reproduction: its manifest, what may be written into it, and every file whole or not at all."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.output_file import OutputFile
from qinit_cli.paper.manifest import MANIFEST, SCHEMA, entries_of

if TYPE_CHECKING:
    from qinit_cli.plots.drawn import PictureFile


@dataclass
class Folder:
    """A reproduction's folder. Made by `opened`."""

    path: Path
    before: dict[str, Any] = field(default_factory=dict)  # the manifest of the same settings that stood there
    replaced: dict[str, Any] = field(default_factory=dict)  # that of other settings, whose files go

    def begin(self) -> None:
        """Makes room: what is replaced is removed."""
        _remove(self.path, self.replaced)

    def picture(self, name: str) -> PictureFile:
        """Where the picture of this name goes."""
        from qinit_cli.plots.drawn import PictureFile

        return PictureFile(self.path / name, "qinit reproduce", force=True)

    def write(self, name: str, content: str) -> None:
        """Brings a text under this name, whole or not at all; the folder is made."""
        self.path.mkdir(parents=True, exist_ok=True)
        OutputFile(self.path / name, force=True).write(content.encode())

    def write_json(self, name: str, content: dict[str, Any]) -> None:
        """The same for one JSON object; NaN is refused."""
        self.write(name, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")

    def standing(self, file: str, made_of: str) -> dict[str, Any] | None:
        """What the manifest says of a picture, a table or verdicts, if it stands there and was made of the same."""
        for entry in entries_of(self.before):
            if entry["file"] == file and entry["made_of"] == made_of:
                there = all((self.path / entry[kind]).is_file() for kind in ("file", "png") if kind in entry)
                return dict(entry) if there else None
        return None


def opened(path: Path, asked: dict[str, Any], *, force: bool) -> Folder:
    """The folder, not made yet, to be gone on with where it holds a reproduction of what is `asked`.

    NotAllowed where it holds something else, or a reproduction of other settings; with `force` the files of such a one are
    removed once something is written.
    """
    if path.exists() and not path.is_dir():
        raise UsageError(f"-o {path} is a file; name a folder")
    # an attempt that was killed may have left a part of a file behind
    if not path.exists() or all(file.name.endswith(".part") for file in path.iterdir()):
        return Folder(path)
    before = _manifest(path)
    if before is None:
        raise NotAllowed(f"{path} holds something other than a reproduction; name another folder with -o")
    if all(before.get(name) == value for name, value in asked.items()):
        return Folder(path, before)
    if not force:
        told = ("target", "scale", "source_sets")
        there = ", ".join(f"{name.replace('_', ' ')} {before.get(name)}" for name in told)
        raise NotAllowed(
            f"{path} holds a reproduction of other settings ({there}); name another folder with -o, or replace it with --force"
        )
    return Folder(path, replaced=before)


def _manifest(path: Path) -> dict[str, Any] | None:
    """The manifest in the folder; None where there is none of ours."""
    try:
        there = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return there if isinstance(there, dict) and there.get("schema") == SCHEMA else None


def _remove(path: Path, manifest: dict[str, Any]) -> None:
    """Removes the files that the manifest names, and it; nothing outside the folder."""
    if not manifest:
        return
    named = [entry[kind] for entry in entries_of(manifest) for kind in ("file", "png") if kind in entry]
    for name in (*named, MANIFEST):
        if Path(name).name == name:
            (path / name).unlink(missing_ok=True)
