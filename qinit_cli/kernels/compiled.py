"""The one decorator of compiled functions, and the folder that keeps their machine code between runs.

Numba's own stamp covers a function's own file: after an edit to a callee elsewhere the old code would keep
running. The folder is therefore named for the bytes of every kernel file and the version of Numba: other
code, other folder. What a plug-in compiles goes to a folder that is named for its files as well. Any number of
processes may use and fill a folder at once, and be killed while they do.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import sys
import tempfile
import time
import uuid
from collections.abc import Callable
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

LEAN = {"_nrt": False}
UNUSED_SECONDS = 30 * 24 * 3600.0  # after which machine code of other versions is removed
UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


@cache
def cache_folder(module: str = __name__) -> Path | None:
    """Where machine code of a module's package is kept, made if need be; None if that place cannot be written.

    Beneath NUMBA_CACHE_DIR if that is set, else beneath the user's cache folder (XDG_CACHE_HOME or ~/.cache).
    """
    digest = hashlib.sha256(metadata.version("numba").encode())
    for file in [*sorted(Path(__file__).parent.glob("*.py")), *_others(module)]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    folder = _base() / f"kernels-{digest.hexdigest()[:16]}"
    try:
        if not folder.exists():
            folder.mkdir(parents=True, exist_ok=True)
            _remove_unused(folder.parent)
        with tempfile.TemporaryFile(dir=folder):
            os.utime(folder)  # says that it is used
            return folder
    except OSError:
        return None


def cache_statement() -> str | None:
    """What to tell the user if machine code cannot be kept, with the remedy; None if it can."""
    if cache_folder() is not None:
        return None
    return (
        f"{_base()} cannot be written: kernels are compiled anew in every run; set NUMBA_CACHE_DIR elsewhere"
    )


def needs_compiling(job: str) -> bool:
    """True if nobody has noted yet that what this job ("gridworld-sources") calls is compiled: that takes seconds."""
    folder = cache_folder()
    return folder is None or not (folder / f"{job}.compiled").exists()


def note_compiled(job: str) -> None:
    """Notes that all that this job calls has been compiled and kept."""
    if (folder := cache_folder()) is not None:
        folder.mkdir(parents=True, exist_ok=True)  # whoever thought it unused may have removed it
        (folder / f"{job}.compiled").touch()


def compiled(function: Callable[..., Any]) -> Any:
    """The function, compiled at its first call and kept in the cache folder; runs without the lock."""
    return _compile(function, {}, cache_folder(function.__module__))


def lean(function: Callable[..., Any]) -> Any:
    """As `compiled`, for functions that make no array: nobody counts references to those they are given."""
    return _compile(function, LEAN, cache_folder(function.__module__))


def inner(function: Callable[..., Any]) -> Any:
    """As `lean`, for functions that only compiled functions call: half the time to compile."""
    return _compile(function, LEAN | UNWRAPPED, cache_folder(function.__module__))


def inlined(function: Callable[..., Any]) -> Any:
    """As `inner`, and made part of each caller."""
    return _compile(function, LEAN | UNWRAPPED | {"forceinline": True}, cache_folder(function.__module__))


def kept_with(module: str, function: Callable[..., Any]) -> Any:
    """As `lean`, kept with the code of that module's package, which the function calls for some of its arguments."""
    return _compile(function, LEAN, cache_folder(module))


def unkept(function: Callable[..., Any]) -> Any:
    """As `inner`, kept in its callers alone: for what calls code of other packages, as `kept_with` says."""
    return _compile(function, LEAN | UNWRAPPED, None)


def unkept_inlined(function: Callable[..., Any]) -> Any:
    """As `unkept`, and made part of each caller."""
    return _compile(function, LEAN | UNWRAPPED | {"forceinline": True}, None)


def _compile(function: Callable[..., Any], options: dict[str, Any], folder: Path | None) -> Any:
    numba = _numba()
    config: Any = numba.config
    kept = config.CACHE_DIR
    config.CACHE_DIR = str(folder or "")
    try:
        made = numba.njit(nogil=True, cache=folder is not None, error_model="numpy", **options)(function)
    finally:
        config.CACHE_DIR = kept  # of other users of Numba in this process
    if folder is not None:
        _keep_apart(made)
    return made


def _keep_apart(made: Any) -> None:
    """Gives all that is kept of a function a file name of its own.

    Numba numbers these files by the index it reads before it writes. Two processes that compile the function for other types
    at once, or one that is killed beside the files of an older index, then leave an index that leads to the code for other
    types, and whoever comes next runs that.
    """
    file = made._cache._cache_file
    stem = file._index_name.removesuffix(".nbi")
    file._data_name = lambda number: f"{stem}.{uuid.uuid4().hex}.nbc"


@cache
def _numba() -> Any:
    """Numba, with all that it else loads at its first compiled call.

    While it does, it imports scipy.linalg, 0.2 s, only to learn whether there is a BLAS for np.cov. There is: whatever needs
    it imports it when it is compiled.
    """
    import numba
    from numba.core.registry import cpu_target
    from numba.np import linalg

    asks = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        cpu_target.target_context.refresh()
    finally:
        linalg.ensure_blas = asks
    return numba


def _remove_unused(base: Path) -> None:
    """Removes the machine code of other versions that nobody has used for long; who uses it after all compiles it again."""
    for folder in base.glob("kernels-*"):
        with contextlib.suppress(OSError):  # another process was faster, or it is not ours to remove
            if time.time() - folder.stat().st_mtime > UNUSED_SECONDS:
                doomed = base / f"removed-{os.getpid()}-{folder.name}"
                folder.rename(doomed)  # at once: nobody finds half a folder
                shutil.rmtree(doomed)


def _others(module: str) -> list[Path]:
    """The files of the package that a module belongs to, none if that is ours."""
    top = sys.modules[module.partition(".")[0]]
    if top is sys.modules[__name__.partition(".")[0]]:
        return []
    if hasattr(top, "__path__"):
        return sorted(file for folder in top.__path__ for file in Path(folder).rglob("*.py"))
    return [Path(top.__file__)] if top.__file__ else []


def _base() -> Path:
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen).expanduser() / "qinit"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "qinit"
