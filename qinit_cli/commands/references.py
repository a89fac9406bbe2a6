"""Artefacts named on the command line: a path, a name in the store, or `-` for references on stdin, one a line."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    from qinit_store.catalog import Store


LEARNING = "qinit_cli.kernels.batch"  # a slow module that whatever learns needs: Numba comes with it


def many(references: list[str], store: str, *needed: str, output: str | Path | None = None) -> list[Path]:
    """The paths that the references lead to, in order; stdin is read only for an explicit `-`.

    `needed` are slow modules that the command will need: while the stage before is still at work, they are imported.
    UsageError where `output`, the file that the command writes, is one of them.
    """
    from qinit_store.catalog import Store

    if "-" in references:
        for module in needed:
            import_module(module)
    paths = [_resolved(name, Store(Path(store))) for name in listed(references)]
    if output is not None:
        check_not_read(Path(output), paths)
    return paths


def listed(references: list[str]) -> list[str]:
    """The references, with what stdin brings in the place of `-`."""
    return [name for reference in references for name in (_from_stdin() if reference == "-" else [reference])]


def one(reference: str, store: str, *needed: str, output: str | Path | None = None) -> Path:
    """The path of a single artefact; UsageError where stdin brings several. `needed` and `output` as for `many`."""
    paths = many([reference], store, *needed, output=output)
    if len(paths) > 1:
        raise UsageError(
            f"one artefact was expected, stdin brought {len(paths)}; run the command once for each"
        )
    return paths[0]


def check_not_read(output: Path, read: Iterable[Path]) -> None:
    """UsageError where the output would take the place of a file that is read, with --force or without."""
    if output.exists() and any(path.exists() and output.samefile(path) for path in read):
        raise UsageError(f"{output} is read by this command, which never replaces it; choose another name")


def _resolved(name: str, store: Store) -> Path:
    """The artefact's path; NotFound says how to go on with one that is unfinished."""
    from qinit_cli.artefacts.opening import settings_of
    from qinit_store.errors import NotFound, Refused
    from qinit_store.wording import recorded_command

    try:
        return store.resolve(name)
    except (NotFound, Refused):
        _refuse_other_file(name)
        stem = Path(name).name.removesuffix(".h5")
        for entry in store.entries():
            if entry.state == "unfinished" and entry.path.stem == stem:
                command = recorded_command(entry.provenance.get("command")) or "the command that began it"
                settings = settings_of(entry)
                wanted = "?" if settings is None else settings.sources.tasks
                raise NotFound(
                    f"{name} is unfinished: {entry.tasks} of {wanted} tasks; go on with {command}"
                ) from None
        raise


def _refuse_other_file(name: str) -> None:
    """UsageError if a file or folder of that name lies here: it was meant, but read as a name in the store."""
    from qinit_store.wording import shell_line

    path = Path(name)
    if "/" in name or not name or name.endswith(".h5") or not path.exists():
        return
    if path.is_dir():
        raise UsageError(f"{name} is a folder here; name an artefact in it, as {name}/NAME.h5")
    raise UsageError(
        f"{name} lies here, but the file of an artefact ends in .h5; write {shell_line(f'./{name}')} if it is an artefact all"
        " the same"
    )


def _from_stdin() -> list[str]:
    named = [line.removesuffix("\n").removesuffix("\r") for line in sys.stdin if line.strip()]
    if not named:
        raise NotAllowed("nothing came on stdin: the stage before produced nothing")
    return named
