"""`qinit plot histograms`: are the values of a state-action log-normal over source tasks?

One action a state, the same for all tasks: the one whose mean over the tasks is largest. Each task's own best action would give
the largest of several values, which is not what is fitted to any state-action.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish
from qinit_cli.errors import UsageError
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.environments import Family
    from qinit_cli.figures.histograms import Shown
    from store.reading import Artefact

USUAL = Usual("histograms", "text", "the distribution, and how many tasks")
MINUS = "\N{MINUS SIGN}"
MOST_STATES = {"column": 2, "text": 4}  # that are legible side by side


@dataclass(frozen=True)
class Binning:
    """Which states are shown."""

    state: list[str] | None = option(
        None,
        "A state by its coordinates, such as 0,0; may be given several times.",
        metavar="COORDINATES",
        default_text="from the family: the paper's three",
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "histograms",
        histograms,
        {"picture": USUAL.group, "binning": Group(Binning, "States"), "reading": READING, "display": DISPLAY},
        references=(Reference("sources", "Sources: a path, a name in the store, or - for stdin."),),
        help="Histograms of Q and ln Q over source tasks at some states, with the fitted log-normal and its quantiles; "
        "of the action whose mean over the tasks is largest.",
    )


def histograms(sources: str, picture: Picture, binning: Binning, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands import references
    from qinit_cli.environments import family_of
    from qinit_cli.figures import histograms as drawing
    from qinit_cli.figures.style import house_style
    from store.reading import open_artefact

    path = USUAL.path(picture)
    with open_artefact(references.one(sources, reading.store), "sources") as artefact:
        family = family_of(artefact.spec)
        states = _states(binning, family)
        most = MOST_STATES[picture.width or USUAL.width]
        if len(states) > most:
            raise UsageError(
                f"{len(states)} states do not fit side by side; name at most {most} with --state, or draw several pictures"
            )
        values = _values(artefact, list(states.values()))
        title = (
            f"{family.label}, {artefact.task_count} source tasks" if picture.title is None else picture.title
        )
    shown = [_shown(name, values[:, at], family) for at, name in enumerate(states)]
    with house_style():
        publish(drawing.histograms(shown, title, USUAL.inches(picture)), path)


def _states(binning: Binning, family: Family) -> dict[str, tuple[int, ...]]:
    """The states' names and their indices on the state axes, in the order they were asked for."""
    asked = None if binning.state is None else [_coordinates(text, family) for text in binning.state]
    coordinates = family.shown_states() if asked is None else asked
    return {_name(places): _indices(places, family) for places in coordinates}


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
    import numpy as np

    found = []
    for place, axis in zip(places, family.axes(), strict=True):
        nearest = int(np.abs(axis.values - place).argmin())
        step = (axis.values[-1] - axis.values[0]) / max(1, len(axis.values) - 1)
        whole = axis.values.dtype.kind in "iu"
        if not abs(axis.values[nearest] - place) <= (0 if whole else step / 2 * (1 + 1e-9)):
            raise UsageError(
                f"--state {_name(places)}: {axis.name} is "
                f"{'a whole number ' if whole else ''}from {axis.values[0]:g} to {axis.values[-1]:g}"
            )
        found.append(nearest)
    return tuple(found)


def _name(places: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{place:g}" for place in places) + ")"


def _values(artefact: Artefact, states: list[tuple[int, ...]]) -> Floats:
    """The action values of the states in every task, (N, STATE, A); one block of tasks is in memory at a time."""
    import numpy as np

    places = tuple(np.array(states).T)  # of each axis
    blocks = artefact.blocks(("q",), artefact.schema.block_size)
    return np.concatenate([block["q"][:, *places] for block in blocks])


def _shown(name: str, values: Floats, family: Family) -> Shown:
    """The sample (N, A) of one state as it is drawn."""
    import numpy as np

    from qinit_cli.analysis.value_sample import ValueSample, shapiro_wilk_of
    from qinit_cli.figures.histograms import Shown

    positive = values > 0
    # as the fit counts it: over the tasks with a positive value
    means = np.sum(values, axis=0, where=positive) / np.maximum(positive.sum(axis=0), 1)
    greedy = int(means.argmax())
    sample = ValueSample.of(values[:, greedy])
    return Shown(
        sample=sample,
        of_values=f"{name.replace('-', MINUS)}, {family.actions[greedy]}\nn = {sample.values.size}, masked {sample.masked}\n"
        + _verdict(*shapiro_wilk_of(sample.values)),
        of_logarithms=_verdict(*shapiro_wilk_of(sample.logarithms)),
    )


def _verdict(statistic: float, p: float) -> str:
    if statistic != statistic:
        return "W not testable"
    return f"W = {statistic:.3f}, " + (f"p = {p:.2g}" if p >= 1e-4 else "p < 0.0001")
