"""A disk whose operations can be counted and broken, before they happen, halfway or after."""

from __future__ import annotations

import errno
import os

from qinit_store.disk import Disk

CHANGES = (
    "make the directory",
    "open the lock",
    "create",
    "reserve room for",
    "write",
    "cut to size",
    "flush to the disk",
    "close",
    "flush the directory",
    "link",
    "rename to",
    "remove",
    "remove the directory",
)


class Unflushed(Disk):
    """Does not wait for the device: what a killed process leaves does not depend on it."""

    def attempt(self, operation, path, call):
        return None if operation.startswith("flush") else call()


class Killed(BaseException):
    """Stands for the process ending: nothing catches it."""


class Breakable(Unflushed):
    """Breaks operation number `at` (from 0) and, as a dead process would, does nothing afterwards."""

    def __init__(self, at=None, when="before", trouble=None):
        self.at = at
        self.when = when
        self.trouble = Killed("killed") if trouble is None else trouble
        self.done = []  # (operation, file name) of everything that was tried
        self.dead = False

    def attempt(self, operation, path, call):
        if self.dead:
            raise Killed("dead already")
        number = len(self.done)
        self.done.append((operation, path.name))
        if number != self.at:
            return super().attempt(operation, path, call)
        self.dead = isinstance(self.trouble, Killed)
        if self.when == "after":
            super().attempt(operation, path, call)
        raise self.trouble

    def write(self, descriptor, path, content, offset):
        if self.when == "middle" and len(self.done) == self.at and not self.dead:
            os.pwrite(descriptor, content[: len(content) // 2], offset)
        return super().write(descriptor, path, content, offset)


class ShortWrites(Unflushed):
    """Takes at most seven bytes at a time, as a system may."""

    def write(self, descriptor, path, content, offset):
        return super().write(descriptor, path, content[:7], offset)


class Liar(Unflushed):
    """Says that all went well and changes the last byte of write number `at` to the file that begins with `name`."""

    def __init__(self, name, at):
        self.name = name
        self.at = at

    def write(self, descriptor, path, content, offset):
        if path.name.startswith(self.name):
            self.at -= 1
            if self.at == -1:
                content = bytes(content[:-1]) + bytes([content[-1] ^ 1])
        return super().write(descriptor, path, content, offset)


class Full(Disk):
    """Has room for `room` bytes, then the disk is full."""

    def __init__(self, room, operations=("write", "reserve room for")):
        self.room = room
        self.operations = operations

    def write(self, descriptor, path, content, offset):
        written = super().write(descriptor, path, content, offset)
        self.room -= written
        return written

    def attempt(self, operation, path, call):
        if operation == "reserve room for":
            self.room_at_reserve = self.room
        if operation in self.operations and self.room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return call()


def operations_of(make):
    """Every (operation, file name) that `make(disk)` asks of the disk, in order."""
    disk = Breakable()
    make(disk)
    return disk.done


def moments(operations):
    """The numbers of the operations worth breaking: of a run of writes to one file the first, middle and last."""
    chosen, first = [], 0
    for at in range(1, len(operations) + 1):
        if at == len(operations) or operations[at] != operations[first]:
            chosen += sorted({first, (first + at - 1) // 2, at - 1})
            first = at
    return chosen
