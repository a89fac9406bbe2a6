"""`qinit doctor`: whether this installation is in order."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer

from qinit_cli import __version__, cores
from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Reading, Tabular
from qinit_cli.commands.typer_commands import add_command
from qinit_store.errors import SystemFailed


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "doctor",
        doctor,
        {"reading": READING, "tabular": TABULAR, "display": DISPLAY},
        help="Check this installation: versions, HDF5, compiled kernels, cores, and the store's file system.",
    )


def doctor(reading: Reading, tabular: Tabular, display: Display) -> None:
    """Prints one row per check; SystemFailed, exit code 7, where one fails."""
    from qinit_cli.commands.tables import TableColumn, print_table

    checks: list[tuple[str, Callable[[], str]]] = [
        ("qinit", lambda: __version__),
        ("python", platform.python_version),
        ("numpy, scipy", _numerics),
        ("HDF5", _hdf5),
        ("numba", _compiler),
        ("kernels' folder", _kernels),
        ("cores", lambda: f"{cores.usable()} usable of {os.cpu_count()}"),
        ("plug-ins", _plug_ins),
        ("store", lambda: _store(Path(reading.store))),
        ("file system", lambda: _file_system(Path(reading.store))),
    ]
    rows = [_row(name, check) for name, check in checks]
    columns = [TableColumn("check"), TableColumn("state"), TableColumn("detail")]
    print_table("qinit.doctor/1", columns, rows, tabular, display)
    if failed := [row["check"] for row in rows if row["state"] != "ok"]:
        raise SystemFailed(f"not in order: {', '.join(failed)}")


def _row(name: str, check: Callable[[], str]) -> dict[str, Any]:
    try:
        return {"check": name, "state": "ok", "detail": check()}
    except Exception as error:  # whatever is wrong is what is asked for
        return {"check": name, "state": "failed", "detail": str(error)}


def _numerics() -> str:
    import numpy
    import scipy

    return f"{numpy.__version__}, {scipy.__version__}"


def _hdf5() -> str:
    import h5py

    filters = [h5py.h5z.filter_avail(code) for code in (h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32)]
    if not all(filters):
        raise SystemFailed(
            "this HDF5 lacks the gzip or fletcher32 filter; pip install --force-reinstall h5py"
        )
    return f"{h5py.version.hdf5_version}, h5py {h5py.__version__}"


def _compiler() -> str:
    import numba
    import numpy

    from qinit_cli.grid_map import open_map
    from qinit_cli.kernels.gridworld_exact import distances

    found = numpy.empty((1, 4), numpy.int64)
    distances(open_map(2).moves, numpy.array([[1]]), found)
    if found.tolist() != [[1, 0, 2, 1]]:
        raise SystemFailed("a compiled function gave a wrong answer")
    return f"{numba.__version__}, compiles"


def _kernels() -> str:
    from qinit_cli.kernels.compiled import cache_folder, cache_statement

    if statement := cache_statement():
        raise SystemFailed(statement)
    return str(cache_folder())


def _plug_ins() -> str:
    """What is installed beside qinit; one that cannot be used is told on stderr."""
    from qinit_cli.environments import FAMILIES
    from qinit_cli.methods import METHODS

    there = [
        f"{registry.noun} {name} ({registry.package(name)})"
        for registry in (FAMILIES, METHODS)
        for name in registry
        if not registry.is_own(name)
    ]
    return ", ".join(there) or "none"


def _store(root: Path) -> str:
    """Where artefacts go, and the room there."""
    from qinit_cli.pipeline.room import free_on_disk

    free = free_on_disk(_nearest(root))
    room = "free space unknown" if free is None else f"{free / 1e9:.1f} GB free"
    state = "" if root.exists() else ", made when first needed"
    return f"{root}, {room}{state}"


def _file_system(root: Path) -> str:
    """Whether artefacts can be written there, and how: a lock, a hard link and the flush of a directory are tried."""
    from qinit_store.probe import tried
    from qinit_store.work import DISK

    found = tried(_nearest(root), DISK)
    links = (
        f"no hard links ({found.links}): a finished artefact is renamed under its lock"
        if found.links
        else "hard links"
    )
    flushes = (
        "directories are flushed"
        if found.flushes_directories
        else "directories cannot be flushed: after a power cut the last artefact may be missing"
    )
    return f"locks; {links}; {flushes}"


def _nearest(root: Path) -> Path:
    """The store, or the folder above it that exists already."""
    return next(folder for folder in (root, *root.absolute().parents) if folder.exists())
