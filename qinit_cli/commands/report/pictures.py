"""The pictures that artefacts allow: each kind has its own, one source set of each distribution where a picture holds no more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.report.content import Figure
    from qinit_cli.runs import Run

Described = dict[Path, dict[str, Any]]
Planned = tuple[str, Callable[[], "Drawn"]]  # what stands beneath a picture, and what draws it

FIRST = "Of several source sets of a distribution the first is shown."
CAPTIONS = {
    "eopl": "Each task's greedy path from the target start: its length, with the normal of the same mean and deviation, and "
    "smooth densities of all distributions.",
    "histograms": "Values over the source tasks at the action of the largest mean, with the fitted log-normal; beneath, how "
    "they lie along its quantiles. A p that does not reject is no evidence of normality.",
    "heatmaps": "The largest initial value over actions in each state, one colour scale for all; above, where goals are drawn.",
    "normality": "The test's statistic and its raw p in each state. A p that does not reject is no evidence of normality.",
    "curves": "Each point is the mean of the last 20 episodes, over targets and source sets.",
    "bars": "Means over all episodes.",
}


def figures(sources: Described, fits: Described, runs: list[Run]) -> tuple[list[Figure], list[str]]:
    """The pictures in the order of the pipeline, and what is not in them and why."""
    from qinit_cli.report.content import Figure

    drawn, undrawn = [], list[str]()
    for caption, draw in (*_of_sources(sources), *_of_fits(fits), *_of_runs(runs)):
        try:
            picture = draw()
        except (NotAllowed, UsageError) as refusal:
            undrawn.append(str(refusal))
        else:
            undrawn += picture.notes
            drawn.append(Figure(picture.title, caption, picture.alt, picture.svg()))
    return drawn, undrawn


def _of_sources(sources: Described) -> Iterator[Planned]:
    from qinit_cli.pictures import eopl, histograms

    for same in _alike(sources, _states).values():
        yield CAPTIONS["eopl"], partial(eopl.drawn, same)
    for path, caption in _firsts(sources, "histograms"):
        yield caption, partial(histograms.drawn, path)


def _of_fits(fits: Described) -> Iterator[Planned]:
    from qinit_cli.pictures import heatmaps, normality

    firsts = dict(_firsts(fits, "heatmaps"))
    for same in _alike({path: fits[path] for path in firsts}, _states).values():
        caption = next((firsts[path] for path in same if FIRST in firsts[path]), firsts[same[0]])
        yield caption, partial(heatmaps.drawn, same)
    for path, caption in _firsts(fits, "normality"):
        if fits[path]["spec"]["normality"] != "none":
            yield caption, partial(normality.drawn, path)


def _of_runs(runs: list[Run]) -> Iterator[Planned]:
    from qinit_cli.pictures import bars, curves
    from qinit_cli.stages.source_sets import grouped

    families: dict[str, list[Run]] = {}
    for group in grouped(runs):
        same = [run for entry in group.entries for run in entry.runs]
        families.setdefault(group.any_run.spec["family"]["name"], []).extend(same)
        yield CAPTIONS["curves"], partial(curves.drawn, same)
    for same in families.values():
        yield CAPTIONS["bars"], partial(bars.drawn, same)


def _firsts(artefacts: Described, picture: str) -> Iterable[tuple[Path, str]]:
    """The first source set of each distribution and choice of options, with what stands beneath its picture."""
    for same in _alike(artefacts, _choice).values():
        yield same[0], f"{CAPTIONS[picture]} {FIRST}" if len(same) > 1 else CAPTIONS[picture]


def _alike(artefacts: Described, key: Callable[[dict[str, Any]], str]) -> dict[str, list[Path]]:
    """The paths by what their artefacts share, in order of appearance."""
    found: dict[str, list[Path]] = {}
    for path, told in artefacts.items():
        found.setdefault(key(told["spec"]), []).append(path)
    return found


def _states(spec: dict[str, Any]) -> str:
    """What decides the states that a picture shows."""
    from qinit_cli.environments import family_of

    family = family_of(spec.get("sources", spec))
    return f"{family.name} {family.shape}"


def _choice(spec: dict[str, Any]) -> str:
    """All that is the same for every source set of a distribution."""
    from qinit_store.spec import canonical_json

    def without_set(settings: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in settings.items() if name not in ("seed", "inputs", "tasks")}

    alone = without_set(spec)
    return canonical_json(alone | {"sources": without_set(alone["sources"])} if "sources" in alone else alone)
