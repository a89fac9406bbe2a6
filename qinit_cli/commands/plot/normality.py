"""`qinit plot normality`: where over the states ln Q, or the path length, is normal over the source tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, axis_label, publish
from qinit_cli.errors import NotAllowed
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.figures.heatmaps import Side
    from qinit_cli.figures.normality import Map, Words
    from store.reading import Artefact

UNBROKEN = "\N{NO-BREAK SPACE}"
USUAL = Usual("normality", "text", "the distribution, and what is tested")
PREFIXES = {"values": "normality", "lengths": "eopl_normality"}
QUANTITIES = {"values": "ln Q", "lengths": "path length"}
TESTED_BY = {"values": "--normality shapiro", "lengths": "--eopl-normality rounded"}


@dataclass(frozen=True)
class Maps:
    """What the maps show."""

    of: Literal["values", "lengths"] = option("values", "The test of ln Q, or that of the path lengths.")
    action: Literal["greedy", "all"] = option(
        "greedy", "At the action of the largest mean of each state, or at every action."
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "normality",
        normality,
        {"picture": USUAL.group, "maps": Group(Maps, "Maps"), "reading": READING, "display": DISPLAY},
        references=(Reference("fit", "A fit: a path, a name in the store, or - for stdin."),),
        help="Maps of a fit's test of normality over the states: its statistic (W) and its raw p.",
    )


def normality(fit: str, picture: Picture, maps: Maps, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands import references
    from qinit_cli.environments import family_of
    from qinit_cli.figures import normality as drawing
    from qinit_cli.figures.style import house_style
    from store.reading import open_artefact

    path = USUAL.path(picture)
    with open_artefact(references.one(fit, reading.store), "fit") as artefact:
        family = family_of(artefact.spec["sources"])
        tested = _tested(artefact, family, maps)
        words = _words(artefact, tested, maps)
    upright, across = _sides(family)
    at = "every action" if maps.action == "all" else "action of the largest mean"
    title = f"{family.label}, {QUANTITIES[maps.of]}, {at}" if picture.title is None else picture.title
    with house_style():
        publish(drawing.normality(tested, words, upright, across, title, USUAL.inches(picture)), path)


def _tested(artefact: Artefact, family: Family, maps: Maps) -> list[Map]:
    """The maps that are drawn; NotAllowed where the fit was not tested so."""
    import numpy as np

    from qinit_cli.figures.normality import Map

    prefix = PREFIXES[maps.of]
    if f"{prefix}_p" not in {column.name for column in artefact.schema.columns}:
        raise NotAllowed(
            f"{artefact.path} has no test of {QUANTITIES[maps.of]}; fit its sources again with {TESTED_BY[maps.of]}"
        )
    statistic, p, mean = (artefact.read(name) for name in (f"{prefix}_w", f"{prefix}_p", "mean"))
    if maps.action == "all":
        return [Map(name, statistic[..., at], p[..., at]) for at, name in enumerate(family.actions)]
    greedy = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=-1)[..., None]

    def there(table: Any) -> Any:
        return np.take_along_axis(table, greedy, axis=-1)[..., 0]

    return [Map("", there(statistic), there(p))]


def _words(artefact: Artefact, tested: list[Map], maps: Maps) -> Words:
    """What the maps show, of how many tasks, and how many state-actions are rejected by each correction."""
    import numpy as np

    from qinit_cli.figures.normality import Words
    from qinit_cli.stages.fit_findings import rejected

    prefix = PREFIXES[maps.of]
    [column] = [column for column in artefact.schema.columns if column.name == f"{prefix}_w"]
    n = artefact.read(f"{prefix}_n")
    tasks = f"n = {n.max()}" if n.min() == n.max() else f"n {n.min()} to {n.max()}"
    p = np.stack([each.p for each in tested])
    unknown = "; hatched: not testable" if np.isnan(p).any() else ""
    shares = rejected(p)
    raw, hochberg, yekutieli = (
        "none" if share is None else f"{100 * share:.0f}{UNBROKEN}%" for share in shares.values()
    )
    return Words(
        f"{column.long_name}, {tasks}{unknown}",
        f"raw p; below 0.05: {raw}, BH{UNBROKEN}{hochberg}, BY{UNBROKEN}{yekutieli}",
    )


def _sides(family: Family) -> tuple[Side, Side]:
    """The state axes: the first stands upright, the second lies across."""
    import numpy as np

    from qinit_cli.figures.heatmaps import Side

    axes = family.axes()
    if len(axes) != 2:
        names = ", ".join(axis.name for axis in axes)
        raise NotAllowed(f"a map has two state axes, {family.name} has {names}")
    upright, across = (
        Side(
            axis_label(axis),
            axis.values.astype(np.float64),
            downwards=axis.values.dtype.kind in "iu",  # cells are counted as the rows of a matrix
        )
        for axis in axes
    )
    return upright, across
