"""The pictures that artefacts allow: each kind has its own, one source set of each distribution where a picture holds no more."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.comparison.distinctions import distinctions, joined, with_words
from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.report.content import Figure

Described = dict[Path, dict[str, Any]]
# what stands beneath a picture, the settings that tell it from others of its title, and what draws it
Planned = tuple[str, str, Callable[[], "Drawn"]]

FIRST = "Of several source sets of a distribution the first is shown."
CAPTIONS = {
    "eopl": "Each task's greedy path from the target start: its length, with the normal of the same mean and deviation, and "
    "smooth densities of all distributions.",
    "histograms": "Values over the source tasks at the action of the largest mean, with the fitted log-normal; beneath, how "
    "they lie along its quantiles. A p that does not reject is no evidence of normality.",
    "heatmaps": "The largest initial value over actions in each state, one colour scale for all; grey where it is no source's; "
    "above, where goals are drawn.",
    "normality": "The test's statistic and its raw p in each state. A p that does not reject is no evidence of normality.",
    "curves": "Each point is the mean of the last 20 episodes, over targets and source sets.",
    "bars": "Means over all episodes.",
    "tuning": "Return on the sources minus that of the method as it is by default, each source in the place of a target.",
}


def figures(kinds: Mapping[str, Described], runs: list[ComparedRun]) -> tuple[list[Figure], list[str]]:
    """The pictures, those of runs first, then in the order of the pipeline, and what is not in them and why."""
    from qinit_cli.report.content import Figure

    drawn, undrawn = list[tuple[Figure, str]](), list[str]()
    planned = (
        *_of_runs(runs),
        *_of_sources(kinds["sources"]),
        *_of_fits(kinds["fit"]),
        *_of_tunings(kinds["tuning"]),
    )
    for caption, words, draw in planned:
        try:
            picture = draw()
        except (NotAllowed, UsageError) as refusal:
            undrawn.append(str(refusal))
        else:
            undrawn += picture.notes
            drawn.append((Figure(picture.title, caption, picture.alt, picture.svg()), words))
    titles = [figure.title for figure, _ in drawn]
    return [
        replace(figure, title=with_words(figure.title, words)) if titles.count(figure.title) > 1 else figure
        for figure, words in drawn
    ], undrawn


def _of_sources(sources: Described) -> Iterator[Planned]:
    from qinit_cli.pictures import eopl, histograms

    for same in _alike(sources, _states).values():
        yield CAPTIONS["eopl"], "", partial(eopl.drawn, same)
    for path, caption, words in _firsts(sources, "histograms"):
        yield caption, words, partial(histograms.drawn, path)


def _of_fits(fits: Described) -> Iterator[Planned]:
    from qinit_cli.pictures import heatmaps, normality

    firsts = {path: caption for path, caption, _ in _firsts(fits, "heatmaps")}
    for same in _alike({path: fits[path] for path in firsts}, _states).values():
        caption = next((firsts[path] for path in same if FIRST in firsts[path]), firsts[same[0]])
        yield caption, "", partial(heatmaps.drawn, same)
    for path, caption, words in _firsts(fits, "normality"):
        if fits[path]["spec"]["normality"] != "none":
            yield caption, words, partial(normality.drawn, path)


def _of_runs(runs: list[ComparedRun]) -> Iterator[Planned]:
    from qinit_cli.comparison.source_sets import grouped, told_of_groups
    from qinit_cli.pictures import bars, curves

    families: dict[str, list[ComparedRun]] = {}
    groups = grouped(runs)
    for group, words in zip(groups, told_of_groups(groups), strict=True):
        same = [run for entry in group.entries for run in entry.runs]
        families.setdefault(group.any_run.spec["family"]["name"], []).extend(same)
        yield CAPTIONS["curves"], joined(words), partial(curves.drawn, same)
    for same in families.values():
        yield CAPTIONS["bars"], "", partial(bars.drawn, same)


def _of_tunings(tunings: Described) -> Iterator[Planned]:
    from qinit_cli.pictures import tuning

    words = distinctions([told["spec"] for told in tunings.values()])
    for path, own in zip(tunings, words, strict=True):
        yield CAPTIONS["tuning"], own, partial(tuning.drawn, path)


def _firsts(artefacts: Described, picture: str) -> Iterable[tuple[Path, str, str]]:
    """The first source set of each distribution and choice of options, what stands beneath its picture, and what differs."""
    alike = list(_alike(artefacts, _choice).values())
    words = distinctions([artefacts[same[0]]["spec"] for same in alike])
    for same, own in zip(alike, words, strict=True):
        yield same[0], f"{CAPTIONS[picture]} {FIRST}" if len(same) > 1 else CAPTIONS[picture], own


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
