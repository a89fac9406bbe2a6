"""Values of a study's file as the dataclasses of options that commands read; each error names the file and the line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NoReturn, TypeVar, get_args, get_origin, get_type_hints

from qinit_cli.errors import QinitError, UsageError
from qinit_cli.nearest import nearest
from qinit_cli.options import UNIONS, key_of, options
from qinit_cli.study.lines import KeyPlace

Owner = TypeVar("Owner")

MOST = 100_000  # artefacts of a study: planning as many takes seconds, and lists that multiply soon ask for millions


@dataclass(frozen=True)
class Given:
    """One table of the file."""

    file: str
    place: KeyPlace
    values: Mapping[str, Any]
    lines: Mapping[KeyPlace, int]

    def refuse(self, problem: str, key: str | None = None) -> NoReturn:
        """UsageError, with the line of the key, or of the table."""
        raise UsageError(f"{self._where(key)}: {problem}")

    def _where(self, key: str | None) -> str:
        place: KeyPlace = self.place if key is None else (*self.place, key)
        while place and place not in self.lines:
            place = place[:-1]
        return f"{self.file}, line {self.lines[place]}" if place in self.lines else self.file

    def check_keys(self, known: Iterable[str], of: str = "") -> None:
        """Refuses a key that is not known, with the nearest one; `of` names what has these keys."""
        there = list(known)
        for key in self.values:
            if key not in there:
                ending = nearest(key, there) if there else "nothing stands in it"
                self.refuse(f"{of or self._titled} has no {key}; {ending}", key)

    @property
    def _titled(self) -> str:
        """The table as its header has it."""
        names = [part for part in self.place if isinstance(part, str)]
        many = self.place and isinstance(self.place[-1], int)
        return (
            f"[[{'.'.join(names)}]]" if many else f"[{'.'.join(names)}]" if names else "the top of the file"
        )

    def table(self, key: str) -> Given:
        """The table under the key; an empty one where there is none."""
        value = self.values.get(key, {})
        if not isinstance(value, Mapping):
            self.refuse(f"{key} is {value!r}; it must be a table", key)
        return Given(self.file, (*self.place, key), value, self.lines)

    def tables(self, key: str) -> list[Given]:
        """The tables of the list under the key."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(one, Mapping) for one in value):
            self.refuse(f"{key} must be a list of tables, each under [[{key}]]", key)
        return [Given(self.file, (*self.place, key, at), one, self.lines) for at, one in enumerate(value)]

    def of(self, key: str, kind: type[Owner], default: Any = None) -> Any:
        """The value of a key that is of one type."""
        value = self.values.get(key, default)
        wrong = isinstance(value, bool) and kind is not bool
        if value is not default and (wrong or not isinstance(value, kind)):
            words = {str: "a text", int: "a whole number", bool: "true or false", list: "a list"}
            self.refuse(f"{key} is {value!r}; it must be {words[kind]}", key)
        return value

    def texts(self, key: str) -> tuple[str, ...] | None:
        """A text, or a list of them; None where the key is not there."""
        if key not in self.values:
            return None
        value = self.values[key]
        several = value if isinstance(value, list) else [value]
        if not all(isinstance(one, str) for one in several):
            self.refuse(f"{key} is {value!r}; it must be a text or a list of texts", key)
        return tuple(several)

    def without(self, key: str) -> Given:
        """The table as if the key did not stand in it."""
        values = {name: value for name, value in self.values.items() if name != key}
        return Given(self.file, self.place, values, self.lines)

    def merged(self, other: Given) -> Given:
        """With the keys of another table in their place; tables within are merged too, and errors name either place."""
        values = dict(self.values)
        lines = dict(self.lines)
        for key, value in other.values.items():
            mine = values.get(key)
            if isinstance(mine, Mapping) and isinstance(value, Mapping):
                value = {**mine, **value}
            values[key] = value
            own: KeyPlace = (*other.place, key)
            while own and own not in other.lines:  # an inline table has one line
                own = own[:-1]
            if own:
                lines[(*self.place, key)] = other.lines[own]
            for place, line in other.lines.items():
                if place[: len(other.place) + 1] == (*other.place, key):
                    lines[(*self.place, *place[len(other.place) :])] = line
        return Given(self.file, self.place, values, lines)

    def instances(self, owner: type[Any], keys: Iterable[str] | None = None) -> Iterator[Any]:
        """An instance of a dataclass of options for each combination of the values that are lists, the last key varying fastest.

        `keys` are the keys that are its options; None: all.
        """
        hints = get_type_hints(owner)
        known = {key_of(one.name): one.name for one in options(owner)}
        wanted = list(self.values) if keys is None else [key for key in self.values if key in set(keys)]
        varied: list[list[tuple[str, Any]]] = []
        for key in wanted:
            if key not in known:
                self.check_keys(known)
            hint = hints[known[key]]
            varied.append([(key, value) for value in self._each(key, self.values[key], hint)])
        count = math.prod(map(len, varied))
        if count > MOST:
            self.refuse(
                f"its lists make {count:,} combinations; a study has at most {MOST:,} artefacts: shorten the lists"
            )
        for chosen in product(*varied):
            yield self._instance(owner, {known[key]: value for key, value in chosen}, hints)

    def _each(self, key: str, value: Any, hint: Any) -> list[Any]:
        """The values that a key varies over: the elements of a list; of an option that takes a list, those of a list of lists."""
        several = value if isinstance(value, list) else [value]
        if not several:
            self.refuse(f"{key} is an empty list; give a value, or leave it out", key)
        if not _takes_list(hint):
            return several
        if isinstance(value, list) and all(isinstance(one, list) for one in value):
            return [tuple(one) for one in value]
        return [tuple(several)]

    def _instance(self, owner: type[Any], values: dict[str, Any], hints: Mapping[str, Any]) -> Any:
        for name, value in values.items():
            if isinstance(value, str) and Path in get_args(hints[name]):
                values[name] = Path(value)
        lacking = [
            one.name for one in options(owner) if one.metadata["positional"] and one.name not in values
        ]
        if lacking:
            self.refuse(f"{lacking[0].replace('_', '-')} is missing: {owner.__name__} needs it")
        try:
            return owner(**values)
        except (ValueError, QinitError) as error:
            said = str(error).removeprefix("--")
            self.refuse(said, next((key for key in self.values if said.startswith(f"{key} ")), None))


def _takes_list(hint: Any) -> bool:
    parts = get_args(hint) if get_origin(hint) in UNIONS else (hint,)
    return any(get_origin(part) is list for part in parts)
