"""A model of what a power cut leaves: unflushed contents and unflushed directory entries may vanish.

A directory's changes survive in order, up to any one after the last flush of that directory. A file's content is
certain only as of its last flush; what was written since may be there, in part, or not at all.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

from qinit_store.disk import Disk


@dataclass
class File:
    content: bytearray = field(default_factory=bytearray)
    flushed: bytes = b""

    def survivors(self):
        """What the content may be after the cut."""
        now = bytes(self.content)
        return (
            [self.flushed, now]
            if now == self.flushed
            else [self.flushed, now[: len(now) // 2], bytes(len(now))]
        )


@dataclass
class Directory:
    states: list = field(default_factory=lambda: [{}])  # every one since the last flush, the latest last

    @property
    def entries(self):
        return self.states[-1]


class Recorder(Disk):
    """Does everything for real and keeps, after each operation, a copy of what is certain and what is not."""

    def __init__(self, root):
        self.root = root
        self.directories = {root: Directory()}
        self.files = {}
        self.reported = []
        self.moments = []  # (root directory, tasks reported as saved)

    def note(self):
        tree, reported = copy.deepcopy((self.directories, self.reported))
        self.moments.append((tree, reported))

    def _enter(self, path, value):
        directory = self.directories[path.parent]
        directory.states.append({**directory.entries, path.name: value})

    def _leave(self, path):
        directory = self.directories[path.parent]
        directory.states.append({name: one for name, one in directory.entries.items() if name != path.name})

    def make_directory(self, path):
        super().make_directory(path)
        self.directories[path] = Directory()
        self._enter(path, path)
        self.note()

    def open_lock(self, path):
        descriptor = super().open_lock(path)
        if path.name not in self.directories[path.parent].entries:
            self._enter(path, File())
        return descriptor

    def create(self, path):
        descriptor = super().create(path)
        self.files[descriptor] = File()
        self._enter(path, self.files[descriptor])
        self.note()
        return descriptor

    def write(self, descriptor, path, content, offset):
        written = super().write(descriptor, path, content, offset)
        kept = self.files[descriptor].content
        kept.extend(bytes(max(0, offset + written - len(kept))))
        kept[offset : offset + written] = content[:written]
        return written

    def truncate(self, descriptor, path, size):
        super().truncate(descriptor, path, size)
        del self.files[descriptor].content[size:]

    def sync(self, descriptor, path):
        self.note()
        super().sync(descriptor, path)
        self.files[descriptor].flushed = bytes(self.files[descriptor].content)
        self.note()

    def sync_directory(self, path):
        super().sync_directory(path)
        del self.directories[path].states[:-1]
        self.note()

    def link(self, path, name):
        super().link(path, name)
        self._enter(name, self.directories[path.parent].entries[path.name])
        self.note()

    def replace(self, path, name):
        super().replace(path, name)
        value = self.directories[path.parent].entries[path.name]
        if path.parent == name.parent:
            directory = self.directories[path.parent]
            left = {one: kept for one, kept in directory.entries.items() if one != path.name}
            directory.states.append({**left, name.name: value})
        else:
            self._enter(name, value)
            self._leave(path)
        self.note()

    def remove(self, path):
        super().remove(path)
        self._leave(path)
        self.note()

    def remove_directory(self, path):
        super().remove_directory(path)
        self._leave(path)
        self.note()


def survive(moment, root, target, probability, *, least):
    """Write under `target` what the cut leaves of `moment`; the `least` there can be, else a drawn mixture."""
    directories, _ = moment

    def lay(path, to):
        to.mkdir(exist_ok=True)
        states = directories[path].states
        entries = states[0] if least else probability.choice(states)
        for name, value in entries.items():
            if isinstance(value, File):
                contents = value.survivors()
                (to / name).write_bytes(contents[0] if least else probability.choice(contents))
            else:
                lay(value, to / name)

    lay(root, target)
