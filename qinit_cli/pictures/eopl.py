"""How long the paths from the target start are, over the tasks of each distribution; Figure 8.

Each task's path is its own greedy one: the length that its table has for its best action there. It is that of the table's
state, on Mountain Car of the bin's centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.distributions import distributions, learned_otherwise, named
from qinit_cli.pictures.names import listed, place

if TYPE_CHECKING:
    from qinit_cli.arrays import Tasks
    from qinit_cli.environments import Family
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.eopl import DrawnLengths
    from qinit_cli.pictures.distributions import Distribution

MOST = 7  # distributions that are legible below each other


def drawn(paths: Sequence[Path], *, title: str | None = None, width: float = TEXT) -> Drawn:
    """Path lengths of sources, a histogram a distribution in their order, sources whose tasks are all alike last: the floor."""
    from qinit_cli.figures import eopl as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    found = distributions(paths, ("q", "eopl"), _at_start)
    if len({(one.family.name, one.family.shape) for one in found}) > 1:
        labels = ", ".join(dict.fromkeys(one.family.label for one in found))
        raise NotAllowed(f"path lengths of one picture start in the same state; those of {labels} do not")
    if len(found) > MOST:
        raise UsageError(f"{len(found)} distributions do not fit below each other; draw at most {MOST}")
    names = named(found)
    shown = sorted(
        (_shown(name, one) for name, one in zip(names, found, strict=True)),
        key=lambda each: each.floor,
    )
    family = found[0].family
    own = f"{family.name}, expected optimal path lengths at {place(family.shown_states()[0])}"
    with house_style():
        figure = drawing.eopl(shown, own if title is None else title, width)
    parts = [f"{each.name.replace(chr(10), ', ')}: {each.words.replace(chr(10), ', ')}" for each in shown]
    alt = f"Histograms and densities of path lengths over source tasks, {own}. {listed(parts)}."
    return Drawn(figure, title or own, alt, tuple(learned_otherwise(found, names)))


def _at_start(family: Family, spec: dict[str, Any], tasks: Tasks, block: dict[str, Any]) -> Any:
    """Lengths (B,) of the greedy paths from the target start."""
    start = (slice(None), *_place(family))
    greedy = block["q"][start].argmax(axis=-1)
    return np.take_along_axis(block["eopl"][start], greedy[:, None], axis=-1)[:, 0]


def _place(family: Family) -> tuple[int, ...]:
    """The target start on the state axes."""
    return tuple(
        int(np.abs(axis.values - coordinate).argmin())
        for axis, coordinate in zip(family.axes(), family.shown_states()[0], strict=True)
    )


def _shown(name: str, one: Distribution) -> DrawnLengths:
    """The lengths as they are drawn."""
    from qinit_cli.analysis.length_sample import LengthSample
    from qinit_cli.analysis.rounded_normal import RESAMPLES
    from qinit_cli.figures.eopl import DrawnLengths
    from qinit_cli.seeding import Stream, generator

    sample = LengthSample.of(np.concatenate(one.found))
    statistic, p = sample.rounded_normal(generator(int(one.spec["seed"]), Stream.BOOTSTRAP, 0))
    sets = f" in {one.sets} source sets" if one.sets > 1 else ""
    counted = f"n = {sample.lengths.size}{sets}" + (f", {sample.never} never arrive" if sample.never else "")
    moments = f"\nmean {sample.mean:.1f}, sd {sample.deviation:.1f}, " if sample.lengths.size else ", "
    least = 1 / (RESAMPLES + 1)
    verdict = f"W = {statistic:.3f}, p {'≤' if p <= least else '='} {p:.2g}"
    words = counted + moments + ("not testable" if np.isnan(p) else verdict)
    floor = one.alike
    return DrawnLengths(f"{name}, noise floor" if floor else name, words, sample, floor)
