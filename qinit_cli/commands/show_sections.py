"""How `qinit show` tells people of an artefact: a few sections, short lines, nothing wider than the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from qinit_store.wording import printable

if TYPE_CHECKING:
    from rich.console import Console

    Told = dict[str, Any]

SHORT = 12  # digits of a hash that tell artefacts apart


def print_sections(told: Told, terminal: Console) -> None:
    """Origin, settings, numbers and datasets; `told` as `qinit show --json` has it."""
    terminal.print(printable(f"{told['kind']} {told['name']}"), style="bold", soft_wrap=True)
    _print_rows(_origin(told), terminal)
    _print_section("settings", _settings(told["spec"]), terminal)
    _print_section(
        "numbers", [(_words(key), _number(value)) for key, value in told["numbers"].items()], terminal
    )
    _print_section(
        "axes", [(name, _axis(axis)) for name, axis in told["axes"].items() if name != "byte"], terminal
    )
    for dims, rows in _datasets(told["datasets"]).items():
        _print_section(f"datasets over {', '.join(dims)}", rows, terminal)


def _origin(told: Told) -> list[tuple[str, str]]:
    origin = told["provenance"]
    made = origin.get("time", "").replace("T", " ").removesuffix("Z")
    versions = ", ".join(
        f"{key} {value}" for key, value in origin.items() if key not in ("command", "time") and value
    )
    pairs = [
        ("file", told["path"]),
        ("size", f"{told['bytes'] / 1e6:.2f} MB"),
        ("content", told["content_sha256"]),
        ("made", f"{made} UTC" if made else ""),
        ("command", origin.get("command", "")),
        ("with", versions),
    ]
    pairs += [
        (
            f"from {one.get('role', 'input')}",
            f"{one.get('name', '')}  {one.get('content_sha256', '')[:SHORT]}",
        )
        for one in told["inputs"]
    ]
    return [(key, value) for key, value in pairs if value]


def _settings(spec: Told) -> list[tuple[str, str]]:
    """One line for each group of settings; hashes of inputs stand with the origin, the version with --json."""
    lines = []
    for key, value in spec.items():
        if key in ("kind", "inputs", "algorithm_version"):
            continue
        if key == "sources" and isinstance(value, dict):  # those of a fit's sources, one level down
            lines += _settings(value)
        else:
            lines.append((key, _setting(value)))
    return lines


def _setting(value: Any) -> str:
    if not isinstance(value, dict):
        return _plain(value)
    rest = ", ".join(
        f"{key} {_setting(part)}" for key, part in value.items() if key != "name" and part is not None
    )
    return f"{value['name']}{': ' if rest else ''}{rest}" if "name" in value else rest


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _number(value: Any) -> str:
    if value is None:
        return "unknown"
    return (
        f"{value:.4g}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)
    )


def _axis(axis: Told) -> str:
    if "labels" in axis:
        values = ", ".join(axis["labels"])
    else:
        values = f"{_plain(axis['first'])} to {_plain(axis['last'])}" if axis["length"] else "empty"
    unit = f" {axis['unit']}" if axis["unit"] not in ("", "1") else ""
    return f"{axis['length']}: {values}{unit}"


def _datasets(datasets: Told) -> dict[tuple[str, ...], list[tuple[str, str, str]]]:
    """By their dimensions: name, type and meaning of each."""
    groups: dict[tuple[str, ...], list[tuple[str, str, str]]] = {}
    for name, kept in datasets.items():
        unit = f" [{kept['unit']}]" if kept["unit"] not in ("", "1") else ""
        row = (name, kept["dtype"].lstrip("<|"), kept["long_name"] + unit)
        groups.setdefault(tuple(kept["dims"]), []).append(row)
    return groups


def _words(name: str) -> str:
    return name.replace("_", " ")


def _print_section(title: str, rows: Sequence[Sequence[str]], terminal: Console) -> None:
    if rows:
        terminal.print(f"\n{printable(title)}", style="bold")
        _print_rows(rows, terminal)


def _print_rows(rows: Sequence[Sequence[str]], terminal: Console) -> None:
    """Rows of equal length; the last column is folded where it does not fit."""
    from rich.table import Table

    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True, style="cyan")
    for column in range(1, len(rows[0])):
        table.add_column(no_wrap=column < len(rows[0]) - 1, overflow="fold")
    for key, *values in rows:
        table.add_row(f"  {printable(key)}", *map(printable, values))
    terminal.print(table)
