"""What artefacts were made with: settings that all share in a list, those that differ in a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.artefacts.settings import Settings, Spec
from qinit_cli.report.content import Block, Cell, PageColumn, Pairs, Subheading, Table
from qinit_cli.report.numbers import setting

Words = dict[str, str]  # settings by a name that says where they belong

FIRST = ("method", "family", "learner")
UNTOLD = ("kind", "role", "algorithm_version", "inputs")


def blocks(several: Sequence[Settings]) -> list[Block]:
    """A part for each heading under which the kinds show their settings."""
    found: list[Block] = []
    for heading, settings in _parts(several).items():
        found += [Subheading(heading), *_told(heading, settings)]
    return found


def _parts(several: Sequence[Settings]) -> dict[str, list[Words]]:
    """The settings by heading. Artefacts that are not here themselves are told by what was made of them."""
    parts = [
        part
        for kind in KINDS.values()
        for one in several
        if one.kind == kind.name
        for part in kind.reported(one)
    ]
    found: dict[str, list[Words]] = {part.heading: [] for part in parts}
    for heading, settings in found.items():
        own = [part for part in parts if part.heading == heading]
        least = min(part.distance for part in own)
        settings += [_flat(part.settings) for part in own if part.distance == least]
    return found


def _told(heading: str, settings: list[Words]) -> Iterator[Block]:
    """What all share, then a row for each choice of what differs; where that is one setting alone, its values in the list."""
    settings = _short(settings)
    names = list(dict.fromkeys(name for one in settings for name in one))
    names.sort(key=lambda name: name not in FIRST)
    differing = [name for name in names if len({one.get(name) for one in settings}) > 1]
    shared = [(name, settings[0][name]) for name in names if name not in differing]
    seeds = {one["seed"]: None for one in settings if "seed" in differing}
    others = [name for name in differing if name != "seed"]
    rows: dict[tuple[str, ...], dict[str, None]] = {}  # seeds by the rest
    for one in settings:
        rows.setdefault(tuple(one.get(name, "") for name in others), {})[one.get("seed", "")] = None
    if len(others) <= 1 and all(len(own) == max(1, len(seeds)) for own in rows.values()):
        several = [(others[0], ", ".join(values[0] for values in rows))] if others else []
        yield Pairs([*shared, *several, *([("seed", _ranges(seeds))] if seeds else [])])
        return
    if shared:
        yield Pairs(shared)
    columns = [*(PageColumn(name) for name in others), *([PageColumn("seed")] if seeds else [])]
    body = [
        [*(Cell(value) for value in values), *([Cell(_ranges(own))] if seeds else [])]
        for values, own in rows.items()
    ]
    yield Table(f"{heading}: what differs", columns, body)


def _short(settings: list[Words]) -> list[Words]:
    """The same under the last words of their names, where these tell them apart, spelled as options are."""
    names = dict.fromkeys(name for one in settings for name in one)
    last = Counter(name.rpartition(" ")[2] for name in names)
    return [
        {
            (name.rpartition(" ")[2] if last[name.rpartition(" ")[2]] == 1 else name): value
            for name, value in one.items()
        }
        for one in settings
    ]


def _flat(settings: Spec, above: str = "") -> Words:
    """Nested settings by one name each, "family size"; what has a name and options stands under its own name."""
    found: Words = {}
    for key, value in settings.items():
        if key in UNTOLD:
            continue
        name = f"{above} {key}".strip().replace("_", "-")
        if isinstance(value, dict):
            found |= _flat(value, name)
        else:
            found[name.removesuffix(" name") if above else name] = (
                ", ".join(map(setting, value)) if isinstance(value, list) else setting(value)
            )
    # sources have their learner by name, and again with its options
    if found.get("learning learner") == found.get("learner"):
        found.pop("learning learner", None)
    return found


def _ranges(seeds: Iterable[str]) -> str:
    """Whole numbers as they follow each other: "0 to 9, 12"."""
    numbers = sorted({int(seed) for seed in seeds})
    runs: list[list[int]] = []
    for one in numbers:
        if runs and one == runs[-1][-1] + 1:
            runs[-1].append(one)
        else:
            runs.append([one])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)
