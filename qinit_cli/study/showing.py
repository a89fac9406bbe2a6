"""What a study shows: tables and pictures of the artefacts that its file selects."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from qinit_cli.comparison.table import MEASURES
from qinit_cli.environments.family import task_count
from qinit_cli.nearest import nearest
from qinit_cli.study.given import Given
from qinit_cli.study.planned import (
    Artefact,
    Metric,
    PlannedFit,
    PlannedPicture,
    PlannedRun,
    PlannedSources,
    PlannedTable,
    PlannedTuning,
    named,
)
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.study.combining import Selectable

KINDS: dict[str, type[Artefact]] = {
    "sources": PlannedSources,
    "fit": PlannedFit,
    "tuning": PlannedTuning,
    "run": PlannedRun,
}
METRICS: tuple[Metric, ...] = ("return", "success", "steps")
SELECTING = ("distributions", "fits", "methods", "where")
OF_TABLE = (
    "name",
    "figure",
    "title",
    "first",
    "baseline",
    "metric",
    "columns",
    "each",
    "select",
    *SELECTING,
)
OF_PLOT = ("name", "figure", "kind", "title", "caption", "each", "select", *SELECTING)


def pictures(entry: Given, planned: Sequence[Selectable]) -> Iterator[PlannedPicture]:
    """The picture of an entry, or one of each distribution, method or set."""
    from qinit_cli.plots import PLOTS

    kind = PLOTS[entry.values["kind"]]
    plots = list(entry.instances(kind, [key for key in entry.values if key not in OF_PLOT]))
    selected = select(entry, planned, tuple(KINDS[one] for one in kind.takes.kinds if one in KINDS))
    name = entry.of("name", str) or kind.name
    for ending, those in _each(entry, selected):
        artefacts = tuple(one.artefact for one in those)
        if len(artefacts) > 1 and not kind.takes.several:
            apart = "" if "each" in entry.values else ', or give each = "distribution"'
            entry.refuse(
                f"a picture of {kind.name} takes one artefact, and {len(artefacts)} are selected; narrow it "
                f"by where{apart}"
            )
        for at, plot in enumerate(plots):
            numbered = f"-{at + 1}" if len(plots) > 1 else ""
            yield PlannedPicture(
                f"{name}{ending}{numbered}",
                entry.of("figure", str) or name,
                plot,
                artefacts,
                _filled(entry.of("title", str), those),
                _filled(entry.of("caption", str) or "{sizes}.", those) or "",
            )


def tables(entry: Given, planned: Sequence[Selectable], study: Given) -> Iterator[PlannedTable]:
    """The table of an entry, or one of each distribution, method or set."""
    selected = select(entry, planned, (PlannedRun,))
    name = entry.of("name", str) or "compare"
    first = entry.of("first", int)
    if first is not None and first < 1:
        entry.refuse(f"first is {first}; it must be at least 1", "first")
    title = entry.of("title", str) or "Methods on the same targets"
    if first is None and "{first}" in title:
        entry.refuse("title has {first}, and first is not given; give it too, or leave {first} out", "title")
    baseline = baseline_of(entry, planned) or baseline_of(study, planned) or "zero"
    runs = [one.artefact for one in selected if isinstance(one.artefact, PlannedRun)]
    unlike = {(run.family, run.learning): run for run in runs}
    for run in () if first is None else unlike.values():
        family = run.learning.family(run.family.opened())
        count = task_count(family, "target", run.learning.tasks)
        if first > count:
            entry.refuse(f"first is {first}, and {named(run)} has {counted(count, 'target')}", "first")
    metric = metric_of(entry) or metric_of(study) or "return"
    columns = entry.texts("columns") or ()
    for column in columns:
        if column not in (metric, *MEASURES):
            entry.refuse(f"columns has {column!r}; {nearest(column, (metric, *MEASURES))}", "columns")
    for ending, those in _each(entry, selected):
        yield PlannedTable(
            f"{name}{ending}",
            entry.of("figure", str) or name,
            tuple(one.artefact for one in those if isinstance(one.artefact, PlannedRun)),
            (_filled(title, those) or "").replace("{first}", str(first)),
            first,
            baseline,
            metric,
            columns,
        )


def select(
    entry: Given, planned: Sequence[Selectable], kinds: tuple[type[Artefact], ...]
) -> list[Selectable]:
    """The artefacts of the first of the kinds that the entry selects, by distribution, method and source set; refuses none."""
    selections = entry.tables("select")
    for one in selections:
        one.check_keys(SELECTING)
    for kind in kinds:
        those = [one for one in planned if isinstance(one.artefact, kind)]
        found = [one for one in those if _selected(entry, one, those)]
        if selections:
            found = [one for one in found if any(_selected(each, one, those) for each in selections)]
        if found:
            return once(sorted(found, key=lambda one: one.place))
    return entry.refuse(
        "no artefact of the study is selected; widen distributions, methods, fits, where or select"
    )


def once(those: Iterable[Selectable]) -> list[Selectable]:
    """Each artefact once: two entries of the file may plan the same."""
    once: dict[Artefact, Selectable] = {}
    for one in those:
        once.setdefault(one.artefact, one)
    return list(once.values())


def _selected(entry: Given, one: Selectable, those: Sequence[Selectable]) -> bool:
    """Whether it has one of the names that are listed for what it has, and the values that are asked for."""
    applying = [("distributions", one.distributions)]
    if not isinstance(one.artefact, PlannedSources):
        applying.append(("fits", one.fits))
    if isinstance(one.artefact, PlannedRun):
        applying.append(("methods", one.methods))
    for key, names in applying:
        listed = entry.texts(key)
        if listed is not None and not names & set(listed):
            return False
    there = dict(one.settings)
    for key, value in _flat(entry.table("where").values):
        if key not in there:
            known = {name for each in those for name, _ in each.settings}
            if key not in known:
                entry.refuse(f"where names {key}; {nearest(key, sorted(known))}", "where")
            return False
        several = value if isinstance(value, list) else [value]
        if not any(_same(there[key], each) for each in several):
            return False
    return True


def _same(there: Any, asked: Any) -> bool:
    """Whether they are one value; Python holds False for 0 and True for 1."""
    return bool(there == asked) and isinstance(there, bool) == isinstance(asked, bool)


def _flat(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _each(entry: Given, selected: list[Selectable]) -> Iterator[tuple[str, list[Selectable]]]:
    """The selection whole, or cut by `each`, with what a file's name ends with."""
    each = entry.of("each", str)
    if each is None:
        yield "", selected
        return
    if each not in (*EACH, "targets"):
        entry.refuse(f"each is {each!r}; {nearest(each, [*EACH, 'targets'])}", "each")
    yield from cut(selected, each)


def cut(selected: Sequence[Selectable], each: str) -> Iterator[tuple[str, list[Selectable]]]:
    """The selection by what `each` names, with what a file's name ends with."""
    ending = _by_targets(selected) if each == "targets" else EACH[each]
    cut: dict[str, list[Selectable]] = {}
    for one in selected:
        cut.setdefault(ending(one), []).append(one)
    for name, those in cut.items():
        yield f"-{name}" if name else "", those


def _by_targets(selected: Sequence[Selectable]) -> Callable[[Selectable], str]:
    """What names how targets are learned: the options that differ among the selection."""
    there = [dict(one.settings) for one in selected]
    varied = [
        name
        for name in dict.fromkeys(name for one in there for name in one)
        if name.startswith("targets.")
        and name != "targets.tasks"  # of fewer targets the first are the same
        and len({str(one.get(name)) for one in there}) > 1
    ]

    def ending(one: Selectable) -> str:
        told = dict(one.settings)
        words = [f"{name.removeprefix('targets.')}-{told.get(name)}" for name in varied]
        return re.sub(r"[^A-Za-z0-9.]+", "-", "-".join(words)).strip("-")

    return ending


def _distribution(one: Selectable) -> str:
    family = family_of(one.artefact)
    return family.label.removeprefix(f"{family.name}-")


def _method(one: Selectable) -> str:
    label = one.artefact.method.label if isinstance(one.artefact, PlannedRun) else "none"
    return label.replace("+", "-plus-").replace(" ", "-").replace("=", "-")


def _set(one: Selectable) -> str:
    return f"seed-{sources_of(one.artefact).learning.seed}"


EACH = {"distribution": _distribution, "method": _method, "set": _set}


def sources_of(artefact: Artefact) -> PlannedSources:
    """The sources that it comes from."""
    match artefact:
        case PlannedSources():
            return artefact
        case PlannedFit(sources) | PlannedTuning(sources):
            return sources
        case PlannedRun(fit):
            return fit.sources


def family_of(artefact: Artefact) -> Family:
    """What its sources are drawn from."""
    return sources_of(artefact).family


def metric_of(given: Given) -> Metric | None:
    asked = given.of("metric", str)
    if asked is None:
        return None
    for metric in METRICS:
        if metric == asked:
            return metric
    return given.refuse(f"metric is {asked!r}; {nearest(asked, METRICS)}", "metric")


def baseline_of(given: Given, planned: Sequence[Selectable]) -> str | None:
    """The label of a method of the study; None where none is named."""
    asked: str | None = given.of("baseline", str)
    labels = {one.artefact.method.label for one in planned if isinstance(one.artefact, PlannedRun)}
    if asked is not None and asked not in labels:
        ending = nearest(asked, sorted(labels)) if labels else "no method stands in the study"
        return given.refuse(f"baseline is {asked}; {ending}", "baseline")
    return asked


def _filled(text: str | None, those: Sequence[Selectable]) -> str | None:
    """A title or a caption with its sizes and names filled in."""
    if text is None:
        return None
    family = family_of(those[0].artefact)
    filled = {
        "sizes": sizes(those),
        "sources": sources_told(those[0]),
        "distribution": family.label.removeprefix(f"{family.name}-").replace("-", " "),
    }
    for name, value in filled.items():
        text = text.replace(f"{{{name}}}", value)
    return text


def sources_told(one: Selectable) -> str:
    """The sources in words."""
    sources = sources_of(one.artefact)
    learning = sources.learning.learning(type(sources.family))
    count = task_count(sources.family.opened(), "source", sources.learning.tasks)
    if sources.learning.exact:
        return f"{counted(count, 'source task')} with exact tables"
    return f"{counted(count, 'source task')} of {learning.episodes:,} episodes"


def sizes(those: Sequence[Selectable]) -> str:
    """Sources and targets in words: those of the first artefact, and of optimal where it has fewer targets."""
    first = those[0]
    if not isinstance(first.artefact, PlannedRun):
        return sources_told(first)
    seeds = {sources_of(one.artefact).learning.seed for one in those}
    sets = "one source set" if len(seeds) == 1 else f"{len(seeds)} source sets"
    tasks, episodes = _targets(first.artefact)
    told = f"{sets} of {sources_told(first)}; {counted(tasks, 'target')} of {episodes:,} episodes"
    for one in those:
        if isinstance(one.artefact, PlannedRun) and one.artefact.method.privileged:
            fewer, _ = _targets(one.artefact)
            if fewer < tasks:
                return f"{told}, {one.artefact.method.label} on the first {fewer} of them"
    return told


def _targets(run: PlannedRun) -> tuple[int, int]:
    """How many targets a run has, and of how many episodes."""
    learning, family = run.learning, run.family
    count = task_count(family.opened(), "target", learning.tasks)
    return count, learning.episodes or family.target_learning.episodes
