"""Whether anybody else can change what lies at a path: code that is loaded from there runs as this user.

The super-user is trusted, and so is a folder of theirs that all may write where nobody can move what others own (/tmp).
"""

from __future__ import annotations

import os
import shlex
import stat
from collections import deque
from pathlib import Path

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS_ENTER = stat.S_IXGRP | stat.S_IXOTH
MOST_LINKS = 40  # on one path, as for the kernel


class Untrusted(Exception):
    """Somebody else can change what lies there; the message names the place and the remedy."""


def resolved(path: Path) -> Path:
    """The path without symbolic links; what does not exist yet stands as it is.

    Untrusted where a folder or link on the way belongs to another user, or others may replace what is in it.
    """
    here, waiting, links = "/", deque(path.absolute().parts[1:]), 0
    _check_way(here, os.lstat(here))
    while waiting:
        part = waiting.popleft()
        if part == "..":
            here = os.path.dirname(here)
            continue
        place = os.path.join(here, part)
        try:
            found = os.lstat(place)
        except FileNotFoundError:
            return Path(place, *waiting)
        _check_way(place, found)
        if not stat.S_ISLNK(found.st_mode):
            here = place
            continue
        links += 1
        if links > MOST_LINKS:
            raise Untrusted(f"{path} leads through more than {MOST_LINKS} symbolic links; remove some")
        target = Path(place).readlink()
        waiting.extendleft(reversed(target.parts[1:] if target.is_absolute() else target.parts))
        here = "/" if target.is_absolute() else here
    return Path(here)


def check_own(folder: Path) -> None:
    """Untrusted unless the folder and all in it are ours, no links, and for nobody else to write."""
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise Untrusted(f"{folder} is no folder; remove it")
    _check_owner(folder, found)
    _check_mode(folder, found)
    _check_content(folder, open_to_others=bool(found.st_mode & OTHERS_ENTER))


def _check_content(folder: str | Path, *, open_to_others: bool) -> None:
    with os.scandir(folder) as entries:
        for entry in entries:
            try:
                found = entry.stat(follow_symlinks=False)
            except FileNotFoundError:  # the temporary file of another process
                continue
            _check_owner(entry.path, found)
            if open_to_others:  # else nobody reaches it, whatever its mode
                _check_mode(entry.path, found)
            if stat.S_ISDIR(found.st_mode):
                _check_content(entry.path, open_to_others=open_to_others)
            elif not stat.S_ISREG(found.st_mode):
                raise Untrusted(f"{entry.path} is no regular file; remove it")


def _check_way(place: str | Path, found: os.stat_result) -> None:
    """Nobody but us and the super-user can replace what is in this folder, or turn this link elsewhere."""
    if found.st_uid not in (0, os.geteuid()) and not _unmapped(found.st_uid):
        raise Untrusted(
            f"{place} belongs to another user (uid {found.st_uid}), who can replace what is in it"
        )
    if stat.S_ISDIR(found.st_mode) and not found.st_mode & stat.S_ISVTX:
        _check_mode(place, found)


def _check_owner(place: str | Path, found: os.stat_result) -> None:
    if found.st_uid != os.geteuid():
        raise Untrusted(f"{place} belongs to another user (uid {found.st_uid}); remove it")


def _check_mode(place: str | Path, found: os.stat_result) -> None:
    if found.st_mode & OTHERS_WRITE:
        raise Untrusted(f"others may write {place}; forbid it with chmod go-w {shlex.quote(str(place))}")


def _unmapped(uid: int) -> bool:
    """True for the owner that a container shows where it has no name for the real one, as of the folders above it."""
    try:
        overflow = int(Path("/proc/sys/kernel/overflowuid").read_text())
        ranges = [line.split() for line in Path("/proc/self/uid_map").read_text().splitlines()]
    except OSError:
        return False
    return uid == overflow and not any(
        int(first) <= uid < int(first) + int(count) for first, _, count in ranges
    )
