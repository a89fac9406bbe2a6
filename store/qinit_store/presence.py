"""What stands on the disk: absent is only what the system reports absent; a call that fails is an error."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from qinit_store.errors import SystemFailed

AGAIN = "; the same command goes on once that is mended"

T = TypeVar("T")


def status(path: Path) -> os.stat_result | None:
    """What the name itself stands for, a link not followed; None where nothing has it. SystemFailed."""
    return _looked(path, lambda: os.lstat(path))


def exists(path: Path) -> bool:
    """Whether something can be reached under this name; SystemFailed where that cannot be told."""
    return _looked(path, lambda: os.stat(path)) is not None


def is_folder(path: Path) -> bool:
    """Whether the name itself is a folder's; a link to one is none. SystemFailed."""
    found = status(path)
    return found is not None and stat.S_ISDIR(found.st_mode)


def names(folder: Path) -> list[str]:
    """The names in `folder`, sorted; none where there is no folder. SystemFailed."""
    return sorted(_looked(folder, lambda: os.listdir(folder)) or [])


def refusal(doing: str, path: Path, problem: OSError) -> SystemFailed:
    """The sentence for a call of the system that failed on `path`."""
    return SystemFailed(f"cannot {doing} {path}: {problem.strerror or type(problem).__name__}{AGAIN}")


def _looked(path: Path, call: Callable[[], T]) -> T | None:
    try:
        return call()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as problem:
        raise refusal("look at", path, problem) from problem
