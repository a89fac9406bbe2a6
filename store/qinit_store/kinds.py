"""The kinds of artefacts that a program registers: their folders, what makes them, and what each must hold.

Where none is registered, every kind is read and kept in the folder of its name; else those that are, and no others.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from qinit_store.presence import is_folder, names

if TYPE_CHECKING:
    from qinit_store.schema import Schema

NAME = re.compile(r"[a-z][a-z0-9_-]{0,63}")


class Lack(Protocol):
    """What a schema lacks of the columns that its kind must have, in words, "" where nothing; a part has task columns alone."""

    def __call__(self, schema: Schema, *, part: bool) -> str: ...


@dataclass(frozen=True)
class Registered:
    """What is known of one kind."""

    folder: str
    maker: str  # the subcommand that makes it
    lack: Lack


REGISTERED: dict[str, Registered] = {}  # by name, in the order in which they are listed


def register(name: str, folder: str, maker: str, lack: Lack) -> None:
    """Makes a kind known; ValueError where its name cannot stand in a file."""
    if not NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name for a kind: small letters, digits, _ and -")
    REGISTERED[name] = Registered(folder, maker, lack)


def known(name: str) -> bool:
    """Whether artefacts of this kind are read."""
    return name in REGISTERED if REGISTERED else NAME.fullmatch(name) is not None


def folder_of(name: str) -> str:
    """The folder in a store for artefacts of this kind."""
    return REGISTERED[name].folder if name in REGISTERED else name


def kind_in(folder: str) -> str:
    """The kind whose artefacts stand in this folder; "" where there is none."""
    names = {one.folder: name for name, one in REGISTERED.items()}
    return names.get(folder, "") if REGISTERED else folder


def folders(root: Path) -> list[str]:
    """The folders of a store, in order."""
    if REGISTERED:
        return [one.folder for one in REGISTERED.values()]
    return [name for name in names(root) if not name.startswith(".") and is_folder(root / name)]


def lack(schema: Schema, *, part: bool) -> str:
    """What a schema lacks of the columns that its kind must have, in words; "" where it has all."""
    return REGISTERED[schema.kind].lack(schema, part=part) if schema.kind in REGISTERED else ""
