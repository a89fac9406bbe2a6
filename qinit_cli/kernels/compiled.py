"""The one decorator of compiled functions, and the folder that keeps their machine code between runs.

Numba's own stamp covers a function's own file: after an edit to a callee elsewhere the old code would keep
running. The folder is therefore named for the bytes of every kernel file and the version of Numba: other
code, other folder. What a plug-in compiles goes to a folder that is named for its files as well. Any number of
processes may use and fill a folder at once, and be killed while they do.

Numba's files are pickles: whoever can write them has code run by the next process that reads them. The folder is
therefore ours alone, and one that is not is left alone; kernels are then compiled in every process, as where the folder
is full or cannot be written.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from typing import Any

from qinit_cli.kernels import private_numba
from qinit_cli.kernels.trusted import Untrusted, check_own, resolved

LEAN: dict[str, Any] = {"_nrt": False}
UNUSED_SECONDS = 30 * 24 * 3600.0  # after which machine code of other versions is removed
INNER = LEAN | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
INLINED = INNER | {"forceinline": True}


@cache
def cache_folder(*modules: str) -> Path | None:
    """Where machine code of these modules' packages is kept, made if need be; None if that place cannot be written or trusted.

    Beneath NUMBA_CACHE_DIR if that is set, else beneath the user's cache folder (XDG_CACHE_HOME or ~/.cache). The reason
    for None is printed on stderr, once.
    """
    digest = hashlib.sha256(metadata.version("numba").encode())
    for file in [*sorted(Path(__file__).parent.glob("*.py")), *_others(modules)]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    try:
        return _made(resolved(_base()) / f"kernels-{digest.hexdigest()[:16]}")
    except Untrusted as reason:
        _report(f"{reason}")
    except OSError as error:
        _report(f"{_base()} cannot be written ({error.strerror}); make it writable")
    return None


def _made(folder: Path) -> Path:
    """The folder, for us alone to read and write, and marked as used."""
    if not folder.exists():
        for missing in reversed([place for place in (folder, *folder.parents) if not place.exists()]):
            with contextlib.suppress(FileExistsError):  # another process was faster
                missing.mkdir(mode=0o700)
        _remove_unused(folder.parent)
    check_own(folder)
    with tempfile.TemporaryFile(dir=folder):
        os.utime(folder)
    return folder


def cache_statement() -> str | None:
    """Why machine code cannot be kept, with the remedy; None if it can."""
    return None if cache_folder() is not None else _reported[-1]


_reported: list[str] = []  # what was printed on stderr


def _report(problem: str) -> None:
    statement = (
        f"kernels are compiled anew in every run: {problem}, or set NUMBA_CACHE_DIR to a folder of your own"
    )
    if statement not in _reported:
        print(statement, file=sys.stderr, flush=True)
    _reported.append(statement)


_hearing: list[Callable[[str], None]] = []  # called for each compiling, the innermost last


@contextlib.contextmanager
def heard(tell: Callable[[str], None]) -> Iterator[None]:
    """Within the block `tell` is called with the module of each function that is compiled, in any thread; kept code is silent."""
    _hearing.append(tell)
    try:
        yield
    finally:
        _hearing.remove(tell)


_under_way: list[str] = []  # modules whose functions are being compiled, the innermost last


def compiling() -> bool:
    """Whether a function is being compiled, which nothing interrupts."""
    return bool(_under_way)


def _ended() -> None:
    _under_way.pop()


def _tell(module: str) -> None:
    if _hearing:
        _hearing[-1](module)


def compiled(function: Callable[..., Any]) -> Any:
    """The function, compiled at its first call and kept in the cache folder; runs without the lock."""
    return _compile(function, {}, cache_folder(function.__module__))


def lean(function: Callable[..., Any]) -> Any:
    """As `compiled`, for functions that make no array: nobody counts references to those they are given."""
    return _compile(function, LEAN, cache_folder(function.__module__))


def inner(function: Callable[..., Any]) -> Any:
    """As `lean`, for functions that only compiled functions call: half the time to compile."""
    return _compile(function, INNER, cache_folder(function.__module__))


def inlined(function: Callable[..., Any]) -> Any:
    """As `inner`, and made part of each caller."""
    return _compile(function, INLINED, cache_folder(function.__module__))


def kept_with(modules: tuple[str, ...], function: Callable[..., Any]) -> Any:
    """As `lean`, kept with the code of those modules' packages, which the function calls for some of its arguments."""
    return _compile(function, LEAN, cache_folder(*modules))


def unkept(function: Callable[..., Any]) -> Any:
    """As `inner`, kept in its callers alone: for what calls code of other packages, as `kept_with` says."""
    return _compile(function, INNER, None)


def unkept_inlined(function: Callable[..., Any]) -> Any:
    """As `unkept`, and made part of each caller."""
    return _compile(function, INLINED, None)


def _compile(function: Callable[..., Any], options: dict[str, Any], folder: Path | None) -> Any:
    numba = _numba()
    config: Any = numba.config
    kept = config.CACHE_DIR
    config.CACHE_DIR = str(folder or "")
    compiles = partial(numba.njit, nogil=True, error_model="numpy", **private_numba.known(options))
    try:
        made = compiles(cache=folder is not None)(function)
    except RuntimeError:  # Numba found no folder that it can write: ours was filled or removed a moment ago
        return compiles()(function)
    finally:
        config.CACHE_DIR = kept  # of other users of Numba in this process
    if folder is None:
        return made
    if not private_numba.keeps(made):
        _report(f"Numba {metadata.version('numba')} keeps machine code otherwise than is known here")
        return compiles()(function)
    if not private_numba.cache_path(made).is_relative_to(folder):  # nor would it be trusted
        return compiles()(function)
    private_numba.keep_apart(made)
    private_numba.keep_going(made, lambda: folder in _full, partial(_give_up, folder))
    return made


_full: set[Path] = set()  # folders that took nothing more in this process


def _give_up(folder: Path, error: Exception) -> None:
    _full.add(folder)
    what = error.strerror if isinstance(error, OSError) else f"{type(error).__name__}: {error}"
    _report(f"{folder} keeps nothing more ({what}); make room there or remove it")


@cache
def _numba() -> Any:
    """Numba, with all that it else loads at its first compiled call."""
    import numba

    with private_numba.without_blas():
        private_numba.load_target()

    def starts(module: str) -> None:
        _under_way.append(module)
        _tell(module)

    private_numba.listen(starts, _ended)
    return numba


def _remove_unused(base: Path) -> None:
    """Removes the machine code of other versions that nobody has used for long; who uses it after all compiles it again."""
    for folder in base.glob("kernels-*"):
        with contextlib.suppress(OSError):  # another process was faster, or it is not ours to remove
            if time.time() - folder.stat().st_mtime > UNUSED_SECONDS:
                doomed = base / f"removed-{os.getpid()}-{folder.name}"
                folder.rename(doomed)  # at once: nobody finds half a folder
                shutil.rmtree(doomed)


def _others(modules: tuple[str, ...]) -> list[Path]:
    """The files of the packages that the modules belong to, but for ours."""
    tops = {module.partition(".")[0] for module in modules} - {__name__.partition(".")[0]}
    files: list[Path] = []
    for top in (sys.modules[name] for name in sorted(tops)):
        if hasattr(top, "__path__"):
            files += sorted(file for folder in top.__path__ for file in Path(folder).rglob("*.py"))
        elif top.__file__:
            files.append(Path(top.__file__))
    return files


def _base() -> Path:
    if chosen := os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME"):
        return Path(os.path.expanduser(chosen), "qinit")
    home = os.path.expanduser("~")
    if home == "~":
        raise Untrusted("this user has no home folder to keep them in; set HOME")
    return Path(home, ".cache", "qinit")
