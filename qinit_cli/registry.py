"""Families, methods and learners by name: our own, and those of installed plug-ins, loaded once somebody looks there.

A plug-in is a package with an entry point in a group such as `qinit.families` or `qinit.methods`, which is called like the family
or method. One that cannot be used is told in one sentence on stderr, once, and left out; everything else works.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from qinit_cli.wrapping import wrapped
from qinit_store.wording import printable

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

NAME = re.compile(r"[a-z][a-z0-9-]*")  # of a subcommand
PLUG_IN = "plug-in"  # an artefact's provenance has "plug-in NAME": the distribution and its version
COMPLETING = "_QINIT_COMPLETE"  # set while the shell completes a line: a warning would tear it

Kind = TypeVar("Kind")


class Registry(Mapping[str, type[Kind]], Generic[Kind]):
    """Classes by name. Looking up one of our own loads no plug-in, another name that one alone, iterating all of them."""

    def __init__(
        self,
        group: str,
        noun: str,
        own: Iterable[type[Any]],
        fault: Callable[[type[Any]], str],
        unlisted: Iterable[type[Any]] = (),
    ) -> None:
        """`fault` says what a plug-in's class lacks, "" where it lacks nothing; `unlisted` are looked up, never iterated."""
        self.group, self.noun = group, noun
        listed = {each.name: each for each in own}
        self._listed = tuple(listed)
        self._own: dict[str, type[Kind]] = listed | {each.name: each for each in unlisted}
        self._fault = fault
        self._entries: dict[str, EntryPoint] | None = None
        self._loaded: dict[str, type[Kind]] = {}

    def __getitem__(self, name: str) -> type[Kind]:
        if name in self._own:
            return self._own[name]
        if name not in self._loaded and name in self._plugins():
            self._load(name)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        for name in list(self._plugins()):
            if name not in self._loaded:
                self._load(name)
        return iter([*self._listed, *sorted(self._loaded)])

    def __len__(self) -> int:
        return len(list(iter(self)))

    @property
    def own(self) -> tuple[str, ...]:
        """The names of what comes with qinit itself and is listed; no plug-in is looked for."""
        return self._listed

    def is_own(self, name: str) -> bool:
        """Whether it comes with qinit itself."""
        return name in self._own

    def package(self, name: str) -> str:
        """The distribution that a plug-in comes from, and its version; "" for our own, and for what is not installed."""
        entry = None if name in self._own else self._plugins().get(name)
        return _origin(entry) if entry else ""

    def refuse(self, name: str, why: str) -> None:
        """Leaves a plug-in out from now on, and says so."""
        entry = self._plugins().pop(name)
        self._loaded.pop(name, None)
        self._warn(entry, why)

    def forget(self) -> None:
        """Looks anew for what is installed, the next time that somebody asks."""
        self._entries = None
        self._loaded = {}

    def _plugins(self) -> dict[str, EntryPoint]:
        if self._entries is None:
            from importlib import metadata

            self._entries = {}
            for entry in metadata.entry_points(group=self.group):
                other = self._entries.get(entry.name)
                if entry.name in self._own:
                    self._warn(entry, f"qinit has a {self.noun} of that name itself")
                elif other is not None and other.value != entry.value:
                    self._warn(entry, f"{_origin(other)} has a {self.noun} of that name too")
                else:
                    self._entries[entry.name] = entry
        return self._entries

    def _load(self, name: str) -> None:
        try:
            found = self._plugins()[name].load()
        except (Exception, SystemExit) as error:  # whatever a plug-in does, the rest works
            self.refuse(name, f"loading it raised {type(error).__name__}: {error}")
            return
        if fault := _general_fault(name, found) or self._fault(found):
            self.refuse(name, fault)
        else:
            self._loaded[name] = found

    def _warn(self, entry: EntryPoint, why: str) -> None:
        if COMPLETING not in os.environ:
            sentence = printable(" ".join(why.split()).rstrip("."))
            told = f"qinit: warning: the {self.noun} {entry.name} of {_origin(entry)} is left out: {sentence}"
            print(wrapped(told, sys.stderr), file=sys.stderr)


def _origin(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value


def _general_fault(name: str, found: Any) -> str:
    if not isinstance(found, type) or not is_dataclass(found):
        return "it is no dataclass"
    if not found.__dataclass_params__.frozen:  # type: ignore[attr-defined]  # of every dataclass
        return "it is no frozen dataclass"
    if getattr(found, "name", None) != name:
        return f"its class calls itself {getattr(found, 'name', None)!r}"
    if not NAME.fullmatch(name):
        return "its name is no subcommand's: small letters, digits and -"
    return ""
