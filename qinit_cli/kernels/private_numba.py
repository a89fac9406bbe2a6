"""The parts of Numba that its documentation does not promise: what each buys, and what happens in a version that lacks it.

- The option `_nrt`: no references are counted. With them learning ends in a corrupt heap (Numba 0.68; the cause is unknown).
  Lacking it, nothing is compiled.
- The options `no_cpython_wrapper` and `no_cfunc_wrapper`, for functions that compiled functions alone call: 17.0 in the place
  of 19.3 processor seconds to compile what learns gridworld sources. Lacking them, wrappers are compiled that nobody calls.
- The cache of a compiled function: processes that compile at once never run each other's code for other types, and a full disk
  does not stop learning. Lacking it, no machine code is kept, and every process compiles its own.
- `ensure_blas`, which imports scipy.linalg to learn whether there is a BLAS for np.cov: 0.3 s of a process. Lacking it, that
  import stays.
- The event of compiling. Lacking it, compiling is not announced.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

from qinit_cli.errors import NotAllowed

OPTIONS: dict[str, Any] = {"_nrt": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
NEEDED = "_nrt"
FAULTS = (OSError, EOFError, UnpicklingError)  # the last two: what was cut off by a full disk or a power cut


def known(options: dict[str, Any]) -> dict[str, Any]:
    """Options of numba.njit without those of OPTIONS that this version does not take; NotAllowed where it must take one."""
    taken = _taken_options()
    if NEEDED in options and NEEDED not in taken:
        raise NotAllowed(
            f"Numba {version('numba')} has no option {NEEDED}, without which kernels are not safe; install a version that "
            "pyproject.toml allows"
        )
    return {name: value for name, value in options.items() if name not in OPTIONS or name in taken}


@cache
def _taken_options() -> frozenset[str]:
    """The names of OPTIONS that this version takes."""
    try:
        from numba.core.registry import cpu_target

        return frozenset(name for name in OPTIONS if hasattr(cpu_target.options, name))
    except (ImportError, AttributeError):
        return frozenset()


def keeps(made: Any) -> bool:
    """Whether the cache of a compiled function is as it is handled here."""
    kept = getattr(made, "_cache", None)
    file = getattr(kept, "_cache_file", None)
    needed = ((kept, ("cache_path", "load_overload", "save_overload")), (file, ("_index_name", "_data_name")))
    return all(hasattr(owner, name) for owner, names in needed for name in names)


def cache_path(made: Any) -> Path:
    """Where the machine code of a function is kept."""
    return Path(made._cache.cache_path)


def keep_apart(made: Any) -> None:
    """Gives all that is kept of a function a file name of its own.

    Numba numbers these files by the index it reads before it writes. Two processes that compile the function for other types
    at once, or one that is killed beside the files of an older index, then leave an index that leads to the code for other
    types, and whoever comes next runs that.
    """
    file = made._cache._cache_file
    stem = file._index_name.removesuffix(".nbi")
    file._data_name = lambda number: f"{stem}.{uuid.uuid4().hex}.nbc"


def keep_going(made: Any, gave_up: Callable[[], bool], give_up: Callable[[Exception], None]) -> None:
    """Lets the function run where its machine code cannot be saved or read: a full disk is no reason to learn nothing."""
    kept = made._cache
    load, save = kept.load_overload, kept.save_overload

    def loaded(*asked: Any) -> Any:
        try:
            return load(*asked)
        except FAULTS as error:
            give_up(error)
            return None

    def saved(*given: Any) -> None:
        if gave_up():
            return
        try:
            save(*given)
        except FAULTS as error:  # it reads the index first
            give_up(error)

    kept.load_overload, kept.save_overload = loaded, saved


@contextmanager
def without_blas() -> Iterator[None]:
    """Within the block Numba does not look for a BLAS; whatever needs it imports it when it is compiled."""
    try:
        from numba.np import linalg

        asks = linalg.ensure_blas
    except (ImportError, AttributeError):
        yield
        return
    linalg.ensure_blas = lambda: None
    try:
        yield
    finally:
        linalg.ensure_blas = asks


def load_target() -> None:
    """Loads all that Numba else loads at its first compiled call."""
    try:
        from numba.core.registry import cpu_target

        cpu_target.target_context.refresh()
    except (ImportError, AttributeError):  # then it loads that at the first call
        return


def listen(starts: Callable[[str], None], ends: Callable[[], None]) -> None:
    """Calls `starts` with the module of each function that is compiled from now on, and `ends` once it is."""
    try:
        from numba.core import event

        listener: Any = event.Listener
    except (ImportError, AttributeError):
        return

    class Compiling(listener):  # type: ignore[misc]  # of a class that has no types
        def on_start(self, event: Any) -> None:
            starts(event.data["dispatcher"].py_func.__module__)

        def on_end(self, event: Any) -> None:
            ends()

    events: Any = event
    events.register("numba:compile", Compiling())
