"""Where over the states ln Q, or the path length, is normal over the source tasks: maps of the test's statistic and raw p."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.errors import NotAllowed
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import sides

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.normality import Map, Words
    from qinit_store.reading import Artefact

UNBROKEN = "\N{NO-BREAK SPACE}"
PREFIXES = {"values": "normality", "lengths": "eopl_normality"}
QUANTITIES = {"values": "ln Q", "lengths": "path length"}
TESTED_BY = {"values": "--normality shapiro", "lengths": "--eopl-normality rounded"}


def drawn(
    path: Path, of: str = "values", action: str = "greedy", *, title: str | None = None, width: float = TEXT
) -> Drawn:
    """The test of a fit's "values" or "lengths", at the "greedy" action of the largest mean or at "all"."""
    from qinit_cli.artefacts.opening import family_in, open_artefact
    from qinit_cli.figures import normality as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    with open_artefact(path, "fit") as artefact:
        family = family_in(artefact)
        tested = _tested(artefact, family, of, action)
        words = _words(artefact, tested, of)
    axes = sides(family)
    if len(axes) != 2:
        names = ", ".join(axis.name for axis in family.axes())
        raise NotAllowed(f"a map has two state axes, {family.name} has {names}")
    at = "every action" if action == "all" else "action of the largest mean"
    own = f"{family.label}, {QUANTITIES[of]}, {at}"
    with house_style():
        figure = drawing.normality(tested, words, axes[0], axes[1], own if title is None else title, width)
    return Drawn(figure, title or f"Maps of normality, {own}", _alt(tested, words, own))


def _alt(tested: list[Map], words: Words, own: str) -> str:
    """The middle of the statistic, and the shares that are rejected."""
    statistics = np.stack([each.statistic for each in tested])
    known = statistics[np.isfinite(statistics)]
    if not known.size:
        return f"Maps of a test of normality over the states, {own}: not testable anywhere."
    low, middle, high = np.quantile(known, [0.05, 0.5, 0.95])
    return (
        f"Maps of a test of normality over the states, {own}: {words.statistic}, median {middle:.3f}, 90 % of states from "
        f"{low:.3f} to {high:.3f}; {words.p.replace(UNBROKEN, ' ')}."
    )


def _tested(artefact: Artefact, family: Family, of: str, action: str) -> list[Map]:
    """The maps that are drawn; NotAllowed where the fit was not tested so."""
    from qinit_cli.figures.normality import Map

    prefix = PREFIXES[of]
    if f"{prefix}_p" not in {column.name for column in artefact.schema.columns}:
        raise NotAllowed(
            f"{artefact.path} has no test of {QUANTITIES[of]}; fit its sources again with {TESTED_BY[of]}"
        )
    statistic, p, mean = (artefact.read(name) for name in (f"{prefix}_w", f"{prefix}_p", "mean"))
    if action == "all":
        return [Map(name, statistic[..., at], p[..., at]) for at, name in enumerate(family.actions)]
    greedy = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=-1)[..., None]

    def there(table: Any) -> Any:
        return np.take_along_axis(table, greedy, axis=-1)[..., 0]

    return [Map("", there(statistic), there(p))]


def _words(artefact: Artefact, tested: list[Map], of: str) -> Words:
    """What the maps show, of how many tasks, and how many state-actions are rejected by each correction."""
    from qinit_cli.artefacts.fit_findings import rejected
    from qinit_cli.figures.normality import Words

    prefix = PREFIXES[of]
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
