"""Where an artefact is kept: in a store, in a file of its own, or in memory."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from qinit_cli.errors import UsageError
from qinit_cli.output_file import check_one_line

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_cli.artefacts.settings import Settings
    from qinit_store.held import HeldWork
    from qinit_store.schema import Schema
    from qinit_store.work import Work

LONGEST_STEM = 80  # of the 100 characters that a name may have; the hash behind it tells names apart


@dataclass(frozen=True)
class Keeping:
    """Where an artefact is kept, and the words behind `qinit` that make it."""

    store: Path | None = None  # a name made of what it is, in this folder; None: in memory
    output: Path | None = None  # this file instead
    force: bool = False  # replaces what stands there with other settings
    wait: bool = False  # while another process writes it
    command: tuple[str, ...] = ()

    @property
    def in_memory(self) -> bool:
        """Whether no file is written."""
        return self.store is None and self.output is None


def target_path(keeping: Keeping, stem: str, settings: Settings) -> Path:
    """Where the artefact with these settings goes: the file asked for, else a name in the store made of what it is."""
    path = keeping.output
    if path is None:
        from qinit_store.catalog import Store

        root = keeping.store or Path()
        check_one_line(root)
        named = Store(root).path_for(settings.kind, stem[:LONGEST_STEM].rstrip("-._"), settings.spec())
        return Path(named.name) if keeping.in_memory else named
    check_one_line(path)
    if path.suffix != ".h5":
        raise UsageError(f"-o {path}: an artefact's name ends in .h5")
    return path


def working(
    path: Path,
    schema: Schema,
    settings: Settings,
    keeping: Keeping,
    origin: Mapping[str, str],
    *,
    tasks: Integers | None = None,
) -> AbstractContextManager[Work | HeldWork]:
    """The work on an artefact, in a file or in memory."""
    from qinit_store.held import HeldWork
    from qinit_store.work import open_work

    if keeping.in_memory:
        return nullcontext(HeldWork(path, schema, settings.spec()))
    return open_work(
        path, schema, settings.spec(), tasks=tasks, force=keeping.force, wait=keeping.wait, provenance=origin
    )
