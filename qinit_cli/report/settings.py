"""What artefacts were made with: settings that all share in a list, those that differ in a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from qinit_cli.report.content import Block, Cell, PageColumn, Pairs, Subheading, Table
from qinit_cli.report.numbers import setting

Spec = dict[str, Any]
Settings = dict[str, str]  # by a name that says where they belong

HEADINGS = {
    "source tasks": "Source tasks",
    "fits": "Fits",
    "target tasks": "Target tasks",
    "methods": "Methods",
    "tunings": "Tunings",
}
FITTED = ("estimator", "library", "holdout", "exclude_unlearned")  # what a run tells of its fit
FIRST = ("method", "family", "learner")
UNTOLD = ("kind", "role", "algorithm_version", "inputs", "sources", "source_set", "method", "label")


def blocks(specs: Sequence[Spec]) -> list[Block]:
    """A part for source tasks, fits, target tasks and methods each, where there are such."""
    found: list[Block] = []
    for part, settings in _parts(specs).items():
        if settings:
            found += [Subheading(HEADINGS[part]), *_told(part, settings)]
    return found


def _parts(specs: Sequence[Spec]) -> dict[str, list[Settings]]:
    """The settings by what they are of. Sources that are not here themselves are told by what was made of them."""
    fits = [spec for spec in specs if spec["kind"] == "fit"]
    runs = [spec for spec in specs if spec["kind"] == "run"]
    sets = [run["source_set"] for run in runs]
    sources = [spec for spec in specs if spec["kind"] == "sources"] or [
        spec["sources"] for spec in specs if "sources" in spec
    ]
    of_fits = [{name: one[name] for name in FITTED if name in one} for one in sets]
    return {
        "source tasks": [_flat(spec) for spec in sources] or [_flat(one, (*UNTOLD, *FITTED)) for one in sets],
        "fits": [_flat(spec) for spec in fits or of_fits],
        "target tasks": [_flat(spec) for spec in runs],
        "methods": [_method(run["method"]) for run in runs],
        "tunings": [_method(spec["method"]) | _flat(spec) for spec in specs if spec["kind"] == "tuning"],
    }


def _method(method: Spec) -> Settings:
    """The method as tables call it, then its options."""
    options = {name: value for name, value in method.items() if name != "name"}
    return {"method": str(method["label"])} | _flat(options)


def _told(part: str, settings: list[Settings]) -> Iterator[Block]:
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
    yield Table(f"{HEADINGS[part]}: what differs", columns, body)


def _short(settings: list[Settings]) -> list[Settings]:
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


def _flat(settings: Spec, untold: Sequence[str] = UNTOLD, above: str = "") -> Settings:
    """Nested settings by one name each, "family size"; what has a name and options stands under its own name."""
    found: Settings = {}
    for key, value in settings.items():
        if key in untold:
            continue
        name = f"{above} {key}".strip().replace("_", "-")
        if isinstance(value, dict):
            found |= _flat(value, untold, name)
        else:
            found[name.removesuffix(" name") if above else name] = (
                ", ".join(map(setting, value)) if isinstance(value, list) else setting(value)
            )
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
