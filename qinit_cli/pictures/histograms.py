"""Are the values of a state-action log-normal over source tasks? Histograms of Q and ln Q; Figures 5 and 10.

One action a state, the same for all tasks: the one whose mean over the tasks is largest. Each task's own best action would give
the largest of several values, which is not what is fitted to any state-action.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.errors import UsageError
from qinit_cli.figures.style import COLUMN, TEXT
from qinit_cli.pictures.names import listed, number, place

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.environments import Family
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.histograms import StateHistograms
    from qinit_store.reading import Artefact

MOST_STATES = {COLUMN: 2, TEXT: 4}  # that are legible side by side


def drawn(
    path: Path, states: Sequence[str] | None = None, *, title: str | None = None, width: float = TEXT
) -> Drawn:
    """Q and ln Q of sources at `states`, such as "0,0"; None: the family's, the paper's three."""
    from qinit_cli.artefacts.opening import family_in, open_artefact
    from qinit_cli.figures import histograms as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    with open_artefact(path, "sources") as artefact:
        family = family_in(artefact)
        chosen = _states(states, family)
        if len(chosen) > MOST_STATES[width]:
            raise UsageError(
                f"{len(chosen)} states do not fit side by side; name at most {MOST_STATES[width]} with --state, "
                "or draw several pictures"
            )
        values = _values(artefact, list(chosen.values()))
        own = f"{family.label}, {artefact.task_count} source tasks"
    shown = [_shown(name, values[:, at], family) for at, name in enumerate(chosen)]
    with house_style():
        figure = drawing.histograms(shown, own if title is None else title, width)
    return Drawn(figure, title or f"Histograms of Q, {own}", _alt(shown, own))


def _alt(shown: list[StateHistograms], own: str) -> str:
    """The size, the median and both tests of each state-action."""
    parts = [
        ", ".join(" ".join(state.of_values.split("\n")[:2]).split(", masked 0"))
        + f", median of Q {number(state.sample.median)}, Shapiro-Wilk of Q {state.of_values.splitlines()[-1]}, "
        f"of ln Q {state.of_logarithms}"
        for state in shown
    ]
    return f"Histograms of Q and of ln Q with the fitted log-normal, and quantiles of ln Q, {own}: {listed(parts)}."


def _states(asked: Sequence[str] | None, family: Family) -> dict[str, tuple[int, ...]]:
    """The states' names and their indices on the state axes, in the order they were asked for."""
    named = None if asked is None else [_coordinates(text, family) for text in asked]
    coordinates = family.shown_states() if named is None else named
    return {place(places): _indices(places, family) for places in coordinates}


def _coordinates(text: str, family: Family) -> tuple[float, ...]:
    names = [axis.name for axis in family.axes()]
    try:
        places = tuple(float(part) for part in text.split(","))
    except ValueError:
        places = ()
    if len(places) != len(names):
        raise UsageError(f"--state {text}: write {','.join(name.upper() for name in names)}, a number each")
    return places


def _indices(places: tuple[float, ...], family: Family) -> tuple[int, ...]:
    """The cell, or the nearest bin, of each coordinate; UsageError where the axis does not reach so far."""
    found = []
    for coordinate, axis in zip(places, family.axes(), strict=True):
        nearest = int(np.abs(axis.values - coordinate).argmin())
        step = (axis.values[-1] - axis.values[0]) / max(1, len(axis.values) - 1)
        whole = axis.values.dtype.kind in "iu"
        if not abs(axis.values[nearest] - coordinate) <= (0 if whole else step / 2 * (1 + 1e-9)):
            raise UsageError(
                f"--state {','.join(f'{each:g}' for each in places)}: {axis.name} is "
                f"{'a whole number ' if whole else ''}from {axis.values[0]:g} to {axis.values[-1]:g}"
            )
        found.append(nearest)
    return tuple(found)


def _values(artefact: Artefact, states: list[tuple[int, ...]]) -> Floats:
    """The action values of the states in every task, (N, STATE, A); one block of tasks is in memory at a time."""
    places = tuple(np.array(states).T)  # of each axis
    blocks = artefact.blocks(("q",), artefact.schema.block_size)
    return np.concatenate([block["q"][:, *places] for block in blocks])


def _shown(name: str, values: Floats, family: Family) -> StateHistograms:
    """The sample (N, A) of one state as it is drawn."""
    from qinit_cli.analysis.value_sample import ValueSample, shapiro_wilk_of
    from qinit_cli.figures.histograms import StateHistograms

    positive = values > 0
    # as the fit counts it: over the tasks with a positive value
    means = np.sum(values, axis=0, where=positive) / np.maximum(positive.sum(axis=0), 1)
    greedy = int(means.argmax())
    sample = ValueSample.of(values[:, greedy])
    return StateHistograms(
        sample=sample,
        of_values=f"{name}, {family.actions[greedy]}\nn = {sample.values.size}, masked {sample.masked}\n"
        + _verdict(*shapiro_wilk_of(sample.values)),
        of_logarithms=_verdict(*shapiro_wilk_of(sample.logarithms)),
    )


def _verdict(statistic: float, p: float) -> str:
    if statistic != statistic:
        return "W not testable"
    return f"W = {statistic:.3f}, " + (f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001")
