"""Are the values of a state-action log-normal over source tasks? Histograms of Q and ln Q; Figures 5 and 10.

One action a state, the same for all tasks: the one whose mean over the tasks is largest. Each task's own best action would give
the largest of several values, which is not what is fitted to any state-action.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.errors import UsageError
from qinit_cli.options import option
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import listed, number, place
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.reported import Contents, Planned, firsts
from qinit_cli.plots.state_axes import shown_states
from qinit_cli.plots.style import COLOURS, COLUMN, TEXT, house_style, plain_numbers
from qinit_cli.rewards import SHARE, UNIT

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.value_sample import ValueSample
    from qinit_cli.arrays import Floats
    from qinit_cli.environments import Family
    from qinit_store.reading import Artefact

MOST_STATES = {COLUMN: 2, TEXT: 4}  # that are legible side by side
BAR_COLOUR = "#b3cde3"
POINT_COLOUR = COLOURS[0]
FIT_COLOUR = COLOURS[1]
FIT_LABEL = "fitted log-normal"
POINT_LABEL = "source tasks"
BAND_LABEL = "95 % band under the fit, point by point"
POINTS = 200  # along a curve
MOST_BINS = 40
FIT_ROOM = 1.4  # of the tallest bar: how far up the fitted curve is shown
HEIGHT = 5.6  # inches
XLABELS = {"Q": "Q (discounted return)", SHARE: f"{SHARE}, share of the attainable return"}

CAPTION = (
    "Values over the source tasks at the action of the largest mean, with the fitted log-normal; beneath, "
    "how they lie along its quantiles. A p that does not reject is no evidence of normality."
)  # in a report


@dataclass(frozen=True)
class HistogramsPlot(Plot):
    """Histograms of Q and ln Q over source tasks at some states, with the fitted log-normal and its quantiles;
    of the action whose mean over the tasks is largest.
    """

    name: ClassVar[str] = "histograms"
    takes: ClassVar[Takes] = Takes(("sources",), "Sources")
    titled: ClassVar[str] = "the distribution, and how many tasks"
    heading: ClassVar[str] = "States"

    state: list[str] | None = option(
        None,
        "A state by its coordinates, such as 0,0; may be given several times.",
        metavar="COORDINATES",
        default_text="from the family: the paper's three",
    )

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """Q and ln Q of sources at the states that were asked for, else at the family's."""
        [path] = paths
        from qinit_cli.artefacts.opening import family_in, open_artefact
        from qinit_cli.artefacts.sources import Shares

        with open_artefact(path, "sources") as artefact:
            family = family_in(artefact)
            chosen = _states(self.state, family)
            if len(chosen) > MOST_STATES[frame.width]:
                raise UsageError(
                    f"{len(chosen)} states do not fit side by side; name at most {MOST_STATES[frame.width]} with --state, "
                    "or draw several pictures"
                )
            values = _values(artefact, family, list(chosen.values()))
            own = f"{family.label}, {artefact.task_count} source tasks"
            quantity = "Q" if Shares.of(artefact).bounds == UNIT else SHARE
        shown = [_shown(name, values[:, at], family) for at, name in enumerate(chosen)]
        with house_style():
            figure = histograms(shown, own if frame.title is None else frame.title, frame.width, quantity)
        return Drawn(figure, frame.title or f"Histograms of {quantity}, {own}", _alt(shown, own, quantity))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture of the first source set of each distribution."""
        for path, caption, words in firsts(contents.kinds["sources"], CAPTION):
            yield Planned(caption, words, partial(cls().drawn, [path]))


def _alt(shown: list[StateHistograms], own: str, quantity: str) -> str:
    """The size, the median and both tests of each state-action."""
    parts = [
        ", ".join(" ".join(state.of_values.split("\n")[:2]).split(", masked 0"))
        + f", median of {quantity} {number(state.sample.median)}, Shapiro-Wilk of {quantity} "
        f"{state.of_values.splitlines()[-1]}, of ln {quantity} {state.of_logarithms}"
        for state in shown
    ]
    return (
        f"Histograms of {quantity} and of ln {quantity} with the fitted log-normal, and quantiles of ln {quantity}, {own}: "
        f"{listed(parts)}."
    )


def _states(asked: Sequence[str] | None, family: Family) -> dict[str, tuple[float, ...]]:
    """The states by their names, in the order they were asked for: indices on the state axes, coordinates of continuous ones."""
    named = None if asked is None else [_coordinates(text, family) for text in asked]
    coordinates = shown_states(family) if named is None else named
    return {place(places): _found(places, family) for places in coordinates}


def _coordinates(text: str, family: Family) -> tuple[float, ...]:
    names = [name for name, _ in _dimensions(family)]
    try:
        places = tuple(float(part) for part in text.split(","))
    except ValueError:
        places = ()
    if len(places) != len(names):
        raise UsageError(f"--state {text}: write {','.join(name.upper() for name in names)}, a number each")
    return places


def _found(places: tuple[float, ...], family: Family) -> tuple[float, ...]:
    """The index, or what a continuous state has, of each coordinate; UsageError where its dimension does not reach so far."""
    try:
        return tuple(find(each) for each, (_, find) in zip(places, _dimensions(family), strict=True))
    except ValueError as error:
        raise UsageError(f"--state {','.join(f'{each:g}' for each in places)}: {error}") from error


def _dimensions(family: Family) -> list[tuple[str, Callable[[float], float]]]:
    """The name of each dimension of a state, and what finds a coordinate along it."""
    from qinit_cli.artefacts.slices import entry, inside
    from qinit_cli.environments.tiled import TiledFamily

    if isinstance(family, TiledFamily):
        return [(one[0], partial(inside, one)) for one in family.family.box()]
    return [(axis.name, partial(entry, axis)) for axis in family.axes()]


def _values(artefact: Artefact, family: Family, states: list[tuple[float, ...]]) -> Floats:
    """The states' values as shares, see rewards.ReturnBounds, in every task, (N, STATE, A); a block of tasks is in memory."""
    import numpy as np

    from qinit_cli.artefacts.sources import Shares, blocks_in_shares
    from qinit_cli.environments.tiled import WEIGHTS, TiledFamily
    from qinit_cli.projection import Projection

    if isinstance(family, TiledFamily):
        there, shares = Projection(family.coding, np.array(states)), Shares.of(artefact).bounds.shares
        learned = artefact.blocks((WEIGHTS,), artefact.schema.block_size)
        return np.concatenate([shares(there.values(block[WEIGHTS])) for block in learned])
    places = tuple(np.array(states).T)  # of each axis
    blocks = blocks_in_shares(artefact, ("q",))
    return np.concatenate([block["q"][:, *places] for block in blocks])


def _shown(name: str, values: Floats, family: Family) -> StateHistograms:
    """The sample (N, A) of one state as it is drawn."""
    import numpy as np

    from qinit_cli.analysis.value_sample import ValueSample, shapiro_wilk_of

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


@dataclass(frozen=True)
class StateHistograms:
    """A state-action's sample and what stands above its histograms."""

    sample: ValueSample
    of_values: str
    of_logarithms: str


def histograms(
    shown: Sequence[StateHistograms], title: str, width: float = TEXT, quantity: str = "Q"
) -> Figure:
    """A column a state-action: histogram of Q, histogram of ln Q, quantiles of ln Q. Call it within `house_style`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, HEIGHT))
    panels = figure.subplots(3, len(shown), squeeze=False)
    for (values, logarithms, quantiles), state in zip(panels.T, shown, strict=True):
        sample = state.sample
        _histogram(values, sample.values, sample, sample.density)
        _histogram(logarithms, sample.logarithms, sample, sample.log_density)
        _quantiles(quantiles, sample)
        values.set(title=state.of_values, xlabel=XLABELS[quantity])
        logarithms.set(title=state.of_logarithms, xlabel=f"ln {quantity}")
        quantiles.set(xlabel="standard normal quantile")
    for axes, beside in zip(panels[:, 0], ("source tasks", "source tasks", f"ln {quantity}"), strict=True):
        axes.set_ylabel(beside)
    figure.align_ylabels(panels[:, 0])
    _legend(figure, 3 if width > COLUMN else 1)
    if title:
        figure.suptitle(title)
    return figure


def _histogram(axes: Axes, values: Floats, sample: ValueSample, density: Callable[[Floats], Floats]) -> None:
    """Counts in equal bins, and the fitted density times n and a bin's width: what the fit would have counted."""
    import numpy as np

    _ticks(axes)
    if not values.size:
        axes.text(0.5, 0.5, "no value above 0", transform=axes.transAxes, ha="center", va="center")
        return
    edges = _edges(values)
    counts, *_ = axes.hist(values, list(edges), color=BAR_COLOUR, edgecolor="black", linewidth=0.4)
    # a fit that is far off peaks out of sight rather than making the bars invisible
    axes.set_ylim(0, FIT_ROOM * float(np.max(counts)))
    if sample.sigma > 0:
        at = np.linspace(edges[0], edges[-1], POINTS)
        counted = density(at) * values.size * (edges[1] - edges[0])
        axes.plot(at, counted, color=FIT_COLOUR, label=FIT_LABEL)


def _edges(values: Floats) -> Floats:
    """Bins by the rule of Freedman and Diaconis, at most MOST_BINS."""
    import numpy as np

    edges: Floats = np.histogram_bin_edges(values, "fd")
    return edges if len(edges) <= MOST_BINS + 1 else np.histogram_bin_edges(values, MOST_BINS)


def _quantiles(axes: Axes, sample: ValueSample) -> None:
    _ticks(axes)
    if not sample.values.size:
        return
    scores = sample.normal_scores()
    low, high = sample.band()
    axes.fill_between(scores, low, high, color="#cccccc", linewidth=0, label=BAND_LABEL)
    axes.plot(scores, sample.mu + sample.sigma * scores, color=FIT_COLOUR)
    axes.plot(scores, sample.logarithms, ".", markersize=3, color=POINT_COLOUR, label=POINT_LABEL)


def _ticks(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)


def _legend(figure: Figure, columns: int) -> None:
    """What the lines, points and bands are, once each."""
    named = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    labels = [label for label in (FIT_LABEL, POINT_LABEL, BAND_LABEL) if label in named]
    figure.legend([named[label] for label in labels], labels, loc="outside lower center", ncols=columns)
