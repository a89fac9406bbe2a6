"""Settings from files: ./qinit.toml, then the user's own; beneath options and QINIT_* variables, above the defaults.

A key is an option's name without its dashes. At the top of the file it holds for every command that has the option, in a table
such as [transfer] or [train-sources.gridworld] for that command and those below it. A ~ at the beginning of a value is the home
folder. The file is UTF-8.

    store = "~/experiments"
    [train-sources.gridworld]
    variance = 3
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from qinit_cli.errors import UsageError

LOCAL = Path("qinit.toml")
OWN = frozenset({"dask"})  # what connects to those who could run code here: never from LOCAL
PREFIX = "QINIT_"

Command = tuple[str, ...]  # ("train-sources", "gridworld")
Commands = Mapping[Command, frozenset[str]]  # every command's options, by name


@dataclass(frozen=True)
class Configured:
    """One value from a file."""

    table: Command  # () at the top of the file
    name: str  # of an option, with underscores
    value: Any
    origin: Path


def files() -> list[Path]:
    """The configuration files that exist, the user's first: a later one wins."""
    user = _user_file()
    found = [path for path in (user, LOCAL) if path is not None and path.is_file()]
    return [user] if user is not None and len(found) > 1 and user.samefile(LOCAL) else found


def _user_file() -> Path | None:
    """None where the user has no home."""
    base = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    return None if base.startswith("~") else Path(base, "qinit", "qinit.toml")


def settings(commands: Commands) -> list[Configured]:
    """Every setting of every file, weakest first; UsageError for a file that is no TOML or a key that nothing has."""
    found = [setting for path in files() for setting in _read(path)]
    for setting in found:
        _refuse_foreign(setting)
        _check(setting, commands)
    # within a file what is said of one command is stronger than what is said of all
    return sorted(found, key=lambda setting: (setting.origin == LOCAL, len(setting.table)))


def chosen(command: Command, option: str, found: Iterable[Configured]) -> Configured | None:
    """The strongest setting for an option of a command."""
    meant = [s for s in found if s.name == option and s.table == command[: len(s.table)]]
    return meant[-1] if meant else None


def defaults(commands: Commands, found: list[Configured]) -> dict[str, Any]:
    """The settings as nested defaults, {command: {subcommand: {option: value}}}."""
    nested: dict[str, Any] = {}
    for command, options in commands.items():
        place = nested
        for word in command:
            place = place.setdefault(word, {})
        for option in options:
            if (setting := chosen(command, option, found)) is not None:
                place[option] = setting.value
    return nested


def check_variables(commands: Commands) -> None:
    """UsageError for a QINIT_* variable that no option has."""
    known = {PREFIX + option.upper() for options in commands.values() for option in options}
    for name in sorted(os.environ):
        if name.startswith(PREFIX) and name not in known:
            raise UsageError(f"the variable {name} sets no option{_nearest(name, known)}")


def _read(path: Path) -> Iterator[Configured]:
    import tomllib

    try:
        content = tomllib.loads(
            path.read_bytes().decode("utf-8-sig")
        )  # some editors begin a file with a mark
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is not UTF-8 (byte {error.start}); save it as UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path} is no TOML: {error}") from error
    yield from _settings(content, (), path)


def _settings(content: Mapping[str, Any], table: Command, path: Path) -> Iterator[Configured]:
    for key, value in content.items():
        if isinstance(value, Mapping):
            yield from _settings(value, (*table, key), path)
        else:
            yield Configured(table, key.replace("-", "_"), _at_home(value), path)


def _at_home(value: Any) -> Any:
    """The value, with a ~ at its beginning replaced by the home folder, as a shell does on the command line."""
    return os.path.expanduser(value) if isinstance(value, str) else value


def _check(setting: Configured, commands: Commands) -> None:
    below = {
        command: options
        for command, options in commands.items()
        if command[: len(setting.table)] == setting.table
    }
    if not below:
        words = {word for command in commands for word in command}
        raise UsageError(
            f"{setting.origin}: [{'.'.join(setting.table)}] is no command{_nearest(setting.table[-1], words)}"
        )
    known = {option for options in below.values() for option in options}
    if setting.name not in known:
        where = f" of {' '.join(setting.table)}" if setting.table else ""
        raise UsageError(
            f"{setting.origin}: {setting.name} is no option{where}{_nearest(setting.name, known)}"
        )


def _refuse_foreign(setting: Configured) -> None:
    """UsageError for what only the user may set: a folder's file comes with the folder, from whoever made that."""
    if setting.origin == LOCAL and setting.name in OWN:
        name = setting.name.replace("_", "-")
        raise UsageError(
            f"./{LOCAL}: {name} could run the code of others here, so no folder's file sets it; remove it, and give "
            f"--{name}, {PREFIX}{setting.name.upper()} or set it in the user's own file, "
            f"{_user_file() or '~/.config/qinit/qinit.toml'}"
        )


def _nearest(name: str, known: Iterable[str]) -> str:
    near = get_close_matches(name, sorted(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""
