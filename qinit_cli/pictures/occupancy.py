"""States visited on the optimal paths from the target start, over the tasks of each distribution; Figure 7.

A task's path is its own greedy one, replayed from its stored table: on the gridworld each step leads to the most likely next
cell, on Mountain Car the continuous state is followed with the task's own push, and its bin counted at every step. Start and
goal count too, so a path of H steps counts H + 1 times. Paths that do not arrive within the horizon have no place in the maps;
they are counted apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.figures.style import COLUMN, TEXT
from qinit_cli.pictures.distributions import distributions, learned_otherwise, named
from qinit_cli.pictures.names import listed, place, sides
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.arrays import Tasks
    from qinit_cli.environments import Family
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.occupancy import Visits
    from qinit_cli.pictures.distributions import Distribution

MOST = {COLUMN: 6, TEXT: 9}  # distributions whose maps and outlines can be told apart


def drawn(paths: Sequence[Path], *, title: str | None = None, width: float = TEXT) -> Drawn:
    """The states on the optimal paths of sources, a map a distribution in their order, and the outlines of all."""
    from qinit_cli.figures import occupancy as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    found = distributions(paths, ("q",), _visits)
    family = found[0].family
    if len({(one.family.name, one.family.shape) for one in found}) > 1:
        labels = ", ".join(dict.fromkeys(one.family.label for one in found))
        raise NotAllowed(f"maps of one picture share their state axes; those of {labels} differ")
    axes = sides(family)
    if len(axes) != 2:
        raise NotAllowed(f"a map has two state axes, {family.name} has {len(axes)}")
    if len(found) > MOST[width]:
        raise UsageError(f"{len(found)} distributions do not fit; draw at most {MOST[width]}")
    names = named(found)
    shown = [_shown(name, one) for name, one in zip(names, found, strict=True)]
    own = f"{family.name}, states on the optimal paths from {place(family.shown_states()[0])}"
    with house_style():
        figure = drawing.occupancy(shown, axes[0], axes[1], own if title is None else title, width)
    return Drawn(figure, title or own, _alt(shown, own), tuple(learned_otherwise(found, names)))


def _visits(family: Family, spec: dict[str, Any], tasks: Tasks, block: dict[str, Any]) -> Any:
    """Visits of each state (S,) over a block's paths, how many arrive, and how many do not."""
    q = block["q"].reshape(len(tasks), -1, len(family.actions))
    visits = family.visits(tasks, q, int(spec["learning"]["horizon"]))
    arrives = int(visits.any(axis=1).sum())
    return visits.sum(axis=0), arrives, len(tasks) - arrives


def _shown(name: str, one: Distribution) -> Visits:
    from qinit_cli.figures.occupancy import Visits

    counts = np.sum([visits for visits, _, _ in one.found], axis=0).reshape(one.family.shape)
    arrived, never = (sum(part[at] for part in one.found) for at in (1, 2))
    words = f"{arrived} path{'s' * (arrived != 1)}" + (f", {never} fail" if never else "")
    return Visits(name, words, counts, arrived)


def _alt(shown: list[Visits], own: str) -> str:
    """How many states each distribution's paths visit, and how often."""
    parts = [
        f"{each.name.replace(chr(10), ', ')}: {each.words}, {counted(int((each.counts > 0).sum()), 'state')} visited, "
        f"{counted(int(each.counts.sum()), 'visit')}, at most {int(each.counts.max())} to one state"
        for each in shown
    ]
    outlines = ", and the outlines of all" if len(shown) > 1 else ""
    return f"Maps of visits{outlines}, {own}; paths that fail to arrive are not in them. {listed(parts)}."
