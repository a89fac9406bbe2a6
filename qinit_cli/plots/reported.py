"""What plots draw in a report: of several source sets of a distribution one, where a picture holds no more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.artefacts.settings import FitSettings, Settings, SourcesSettings
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.plots.drawn import Drawn

Described = dict["Path", dict[str, Any]]  # what a report tells of each artefact: its settings among the rest

FIRST = "Of several source sets of a distribution the first is shown."


@dataclass(frozen=True)
class Contents:
    """The artefacts of a report."""

    kinds: Mapping[str, Described]
    runs: list[ComparedRun]  # those of kind "run", as they were read
    slices: tuple[str, ...] = ()  # NAME=VALUE of dimensions of continuous states that are fixed

    def sliced(self, fits: Iterable[Path]) -> list[str] | None:
        """The slices, if the fits are over continuous states."""
        tiled = any(self.kinds["fit"][path]["settings"].sources.family.tiled for path in fits)
        return list(self.slices) if tiled and self.slices else None


@dataclass(frozen=True)
class Planned:
    """A picture of a report."""

    caption: str
    words: str  # the settings that distinguish it from others of its title
    draw: Callable[[], Drawn]


def firsts(artefacts: Described, caption: str) -> Iterable[tuple[Path, str, str]]:
    """The first source set of each distribution and choice of options, what stands beneath its picture, and what differs."""
    from qinit_cli.comparison.distinctions import distinctions

    found = list(alike(artefacts, _choice).values())
    words = distinctions([artefacts[same[0]]["settings"] for same in found])
    for same, own in zip(found, words, strict=True):
        yield same[0], f"{caption} {FIRST}" if len(same) > 1 else caption, own


def alike(artefacts: Described, key: Callable[[Any], str]) -> dict[str, list[Path]]:
    """The paths by what their artefacts share, in order of appearance."""
    found: dict[str, list[Path]] = {}
    for path, told in artefacts.items():
        found.setdefault(key(told["settings"]), []).append(path)
    return found


def states(settings: Settings) -> str:
    """What decides the states that a picture shows."""
    family = settings.sources.family.installed()
    return f"{family.name} {family.shape}"


def _choice(settings: SourcesSettings | FitSettings) -> str:
    """All that is the same for every source set of a distribution."""
    from qinit_store.spec import canonical_json

    return canonical_json(settings.choice().spec())
