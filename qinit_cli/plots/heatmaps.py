"""What methods start from, or what a fit holds, over the state axes: a row a method, a column a distribution; Figure 4."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.comparison.distinctions import above_words, distinctions
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.options import option
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import MINUS, distinct, distribution, listed, number, place
from qinit_cli.plots.plot import PLAIN, SLICE, UNSLICED, Frame, Plot, Takes
from qinit_cli.plots.reported import Contents, Planned, alike, firsts, states
from qinit_cli.plots.state_axes import (
    ANY_SHAPE,
    Side,
    closed_states,
    closed_words,
    draw_closed,
    sides,
    ticks,
    without_closed,
)
from qinit_cli.plots.style import (
    COLUMN,
    TALLEST,
    TEXT,
    UNKNOWN_COLOUR,
    VALUE_COLOURS,
    folded,
    house_style,
    plain_numbers,
)

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats
    from qinit_cli.plots.panels import Panels
    from qinit_store.schema import Axis

Quantity = Literal[
    "start",
    "mu",
    "sigma",
    "mean",
    "std",
    "min",
    "max",
    "lognormal-median",
    "lognormal-mean",
    "n",
    "n-masked",
    "eopl-mean",
    "eopl-std",
    "eopl-n",
]
DECADES = 3  # that a logarithmic scale reaches below its largest value
LEAST = 0.85  # inches, the width of a panel that can still be read
GAP, TITLE, TICKS, NAMES, BESIDE, BENEATH, THICK = 0.08, 0.2, 0.45, 0.2, 0.7, 0.55, 0.11  # inches
PAD = 0.03  # inches, around everything

CAPTION = (
    "The largest initial value over actions in each state, one colour scale for all; grey where it is no "
    "source's; above, where goals are drawn."
)  # in a report


@dataclass(frozen=True)
class HeatmapsPlot(Plot):
    """What methods start from over the states: a row a method, a column a distribution, one colour scale."""

    name: ClassVar[str] = "heatmaps"
    takes: ClassVar[Takes] = Takes(("fit", "run"), "Fits and runs", several=True)
    titled: ClassVar[str] = "the distribution, where there is one"
    heading: ClassVar[str] = "Panels"

    method: list[str] | None = option(
        None,
        "Draw this initialisation's start from each fit; may be given several times.",
        default_text="every initialisation that needs the fit alone",
    )
    quantity: Quantity = option(
        "start",
        "The start, largest over actions; or a table of the fits, at the action of the largest mean.",
    )
    scale: Literal["linear", "log"] = option("linear", "Colours by the value, or by its logarithm.")
    bare: bool = option(False, "Leave out the probabilities of the goal.")
    slice_: list[str] | None = option(None, SLICE, metavar="NAME=VALUE", default_text=UNSLICED)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.method and self.quantity != "start":
            raise ValueError(f"--method draws starts; with --quantity {self.quantity} leave it out")

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """Columns in the order of the artefacts; initialisations that a fit does not allow are left out, with a note."""
        from qinit_cli.plots.panels import read_panels
        from qinit_cli.plots.profiles import profiles

        found, notes = read_panels(paths, self.method, self.quantity, self.slice_ or ())
        upright, across = _sides(found)
        words = distinctions([panels.settings for panels in found])
        names = distinct(
            [above_words(distribution(panels.family), own) for panels, own in zip(found, words, strict=True)],
            [f"fit {panels.fit[:8]}" for panels in found],
        )
        shape = (len(upright.places), len(across.places))
        layers = list(_goals(found, names, shape)) if not self.bare and self.quantity == "start" else []
        layers.append(_layer(found, names, shape, self.quantity, logarithmic=self.scale == "log"))
        alone = found[0].family.label if len(found) == 1 else ""
        title = alone if frame.title is None else frame.title
        along = found[0].shown.continuous and len(found[0].shown.axes) == 1
        with house_style():
            if along:
                figure = profiles(layers[-1], across, title, frame.width)
            else:
                figure = heatmaps(layers, upright, across, title, frame.width)
        named = ", ".join(dict.fromkeys(panels.family.label for panels in found))
        drawn = f"Curves over the {across.label}" if along else "Heatmaps"
        alt = _alt(layers[-1], names, upright, across, drawn if along else "Heatmaps over the states")
        return Drawn(figure, frame.title or f"{drawn}, {named}", alt, tuple(notes))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture of all fits of the same states, one source set of each distribution."""
        fits = contents.kinds["fit"]
        captions = {path: caption for path, caption, _ in firsts(fits, CAPTION)}
        for same in alike({path: fits[path] for path in captions}, states).values():
            caption = next((captions[path] for path in same if captions[path] != CAPTION), CAPTION)
            yield Planned(caption, "", partial(cls(slice_=contents.sliced(same)).drawn, same))


def _sides(found: list[Panels]) -> tuple[Side, Side]:
    """The state axes: the first stands upright, the second lies across; a single one lies."""
    import numpy as np

    if len({(panels.family.name, *map(_scale_of, panels.shown.axes)) for panels in found}) > 1:
        spaces = ", ".join(dict.fromkeys(panels.family.label for panels in found))
        raise NotAllowed(f"panels of one picture share their state axes; those of {spaces} differ")
    drawn = sides(found[0].shown.axes)
    return (drawn[0], drawn[1]) if len(drawn) == 2 else (Side("", np.zeros(1)), drawn[0])


def _scale_of(axis: Axis) -> tuple[str, bytes]:
    return axis.name, axis.values.tobytes()


def _goals(found: list[Panels], names: list[str], shape: tuple[int, int]) -> Iterator[Layer]:
    """The probabilities of the goal, where it differs from task to task."""
    from qinit_cli.plots.style import CHANCE_COLOURS

    closed = _closed(found, names, shape)
    probabilities = {
        name: panels.shown.of_states(chances).reshape(shape)
        for name, panels in zip(names, found, strict=True)
        if (chances := panels.family.goal_chances()).any()
    }
    changing = {
        ("goals", name): without_closed(probability, closed[name])
        for name, probability in probabilities.items()
    }
    if changing:
        label = "probability that the goal is there"
        yield Layer(label, changing, logarithmic=True, colours=CHANCE_COLOURS, closed=closed)


def _closed(found: list[Panels], names: list[str], shape: tuple[int, int]) -> dict[str, dict[str, Flags]]:
    """The closed states of each column."""
    return {
        name: {
            kind: panels.shown.of_states(there).reshape(shape)
            for kind, there in closed_states(panels.family).items()
        }
        for name, panels in zip(names, found, strict=True)
    }


def _layer(
    found: list[Panels], names: list[str], shape: tuple[int, int], quantity: str, *, logarithmic: bool
) -> Layer:
    """What was asked for."""
    closed = _closed(found, names, shape)
    tables = {
        (row, name): without_closed(table.reshape(shape), closed[name])
        for name, panels in zip(names, found, strict=True)
        for row, table in panels.tables.items()
    }
    if logarithmic and any((table < 0).any() for table in tables.values()):
        raise UsageError(f"--scale log: {quantity} has values below 0; use --scale linear")
    label = found[0].label + found[0].shown.told.replace(" -", f" {MINUS}")
    return Layer(label, tables, logarithmic=logarithmic, closed=closed)


def _alt(layer: Layer, names: list[str], upright: Side, across: Side, drawn: str) -> str:
    """What is drawn, and where each row is largest in its first and its last column."""
    rows = dict.fromkeys(row for row, _ in layer.panels)
    ends = list(dict.fromkeys((names[0], names[-1])))
    parts = []
    for row in rows:
        shown = [name for name in ends if (row, name) in layer.panels]
        peaks = [_peak(layer, row, name, upright, across, named=len(names) > 1) for name in shown]
        parts.append(f"{row} {', '.join(peaks)}")
    columns = "" if len(names) == 1 else f" for {', '.join(name.replace(chr(10), ', ') for name in names)}"
    return f"{drawn}{columns}: {layer.label}. Largest: {listed(parts)}."


def _peak(layer: Layer, row: str, name: str, upright: Side, across: Side, *, named: bool) -> str:
    import numpy as np

    table = layer.panels[row, name]
    if np.isnan(table).all():
        return "unknown everywhere"
    at = np.unravel_index(int(np.nanargmax(table)), table.shape)
    there = [
        float(side.places[i]) for side, i in zip((upright, across), at, strict=True) if len(side.places) > 1
    ]
    where = f" ({name.replace(chr(10), ', ')})" if named else ""
    return f"{number(float(table[at]))} at {place(there)}{where}"


@dataclass(frozen=True)
class Layer:
    """Panels that share a colour scale: tables (upright, across) by row and column of the picture, NaN where unknown."""

    label: str  # of the scale, with its unit
    panels: Mapping[tuple[str, str], Floats]
    logarithmic: bool = False
    colours: str = VALUE_COLOURS
    closed: Mapping[str, Mapping[str, Flags]] = field(
        default_factory=dict
    )  # by column, (upright, across) of what stands there


@dataclass(frozen=True)
class Grid:
    """Where panels stand: in their row and column; those of a single row or column one after the other."""

    rows: list[str]
    columns: list[str]
    widest: int  # panels side by side where they stand one after the other

    @property
    def wrapped(self) -> bool:
        return 1 in (len(self.rows), len(self.columns))

    @property
    def shape(self) -> tuple[int, int]:
        if not self.wrapped:
            return len(self.rows), len(self.columns)
        panels = len(self.rows) * len(self.columns)
        across = min(panels, self.widest)
        return -(-panels // across), across

    def place(self, row: str, column: str) -> tuple[int, int]:
        at = self.rows.index(row), self.columns.index(column)
        return divmod(max(at), self.shape[1]) if self.wrapped else at


def heatmaps(layers: Sequence[Layer], upright: Side, across: Side, title: str, width: float = TEXT) -> Figure:
    """Every panel in its row and column, with a colour bar for each layer. Call it within `house_style`."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    named = [name for layer in layers for name in layer.panels]
    rows, columns = (list(dict.fromkeys(names)) for names in zip(*named, strict=True))
    grid = Grid(rows, columns, widest=2 if width <= COLUMN else 4)
    shape = min(max(len(upright.places) / len(across.places), ANY_SHAPE[0]), ANY_SHAPE[1])
    panel, height = _sizes(grid, shape, len(layers) if grid.wrapped else 0, width, title)
    layout = ConstrainedLayoutEngine(compress=True, h_pad=PAD, w_pad=PAD, hspace=0.0, wspace=0.0)
    figure = Figure(figsize=(width, height), layout=layout)
    panels = figure.subplots(*grid.shape, squeeze=False)
    for axes in panels.flat:
        axes.set_box_aspect(shape)
        axes.set_frame_on(False)
        axes.set(xticks=[], yticks=[])
    for layer in layers:
        colours = _colours(layer)
        for name, values in layer.panels.items():
            axes = panels[grid.place(*name)]
            image = _draw(axes, values, (upright, across), layer, colours)
            draw_closed(axes, layer.closed.get(name[1], {}), (upright, across))
        if grid.wrapped:
            _bar_beneath(figure, image, layer, list(panels.flat), width)
        else:
            own = [at for at, row in enumerate(rows) if any(row == there for there, _ in layer.panels)]
            _bar_beside(figure, image, layer, list(panels[own].flat), len(own) * panel * shape)
    _label_outer(panels, (upright, across), panel)
    _name(panels, grid, panel, panel * shape)
    if title:
        figure.suptitle(title)
    return figure


def _sizes(grid: Grid, shape: float, beneath: int, width: float, title: str) -> tuple[float, float]:
    """The width of a panel and the height of the figure with so many bars beneath, in inches.

    UsageError where the panels would be too small to print.
    """
    down, across = grid.shape
    beside = 0.0 if beneath else NAMES + BESIDE
    above = TITLE * (1 + (1.5 if title else 0.0) + (down if grid.wrapped else 0))
    around = above + TICKS + beneath * BENEATH
    widest = (width - TICKS - beside) / across - GAP
    tallest = ((TALLEST - around) / down - GAP) / shape
    panel = min(widest, tallest)
    if panel < LEAST:
        raise UsageError(
            f"{down} rows of {across} panels are too small to read on {width:g} by {TALLEST:g} inches; "
            f"draw fewer methods or artefacts" + ("" if width > COLUMN else ", or --width text")
        )
    return panel, around + down * (panel * shape + GAP)


def _colours(layer: Layer) -> Normalize:
    """The scale from the least to the largest known value of the layer, widened where they are one."""
    import numpy as np
    from matplotlib.colors import LogNorm, Normalize

    known = np.concatenate([values[np.isfinite(values)] for values in layer.panels.values()])
    positive = known[known > 0]
    if layer.logarithmic and positive.size:
        largest = float(positive.max())
        least = max(float(positive.min()), largest / 10**DECADES)
        if least == largest:  # one value alone, in the middle of the scale
            return LogNorm(least / 10, largest * 10)
        return LogNorm(least, largest)
    least, largest = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return Normalize(least, largest) if least < largest else Normalize(least - 0.5, largest + 0.5)


def _draw(
    axes: Axes, values: Floats, sides: tuple[Side, Side], layer: Layer, colours: Normalize
) -> AxesImage:
    import matplotlib
    import numpy as np
    from matplotlib.colors import LogNorm

    upright, across = sides
    if isinstance(colours, LogNorm):  # which would take 0 for unknown: it is less than the least
        values = np.where(values <= 0, float(colours.vmin or 0.0) / 2, values)
    bottom, top = reversed(upright.ends) if upright.downwards else upright.ends
    axes.set_frame_on(True)
    image = axes.imshow(
        np.ma.masked_invalid(values),
        cmap=matplotlib.colormaps[layer.colours].with_extremes(bad=UNKNOWN_COLOUR),
        norm=colours,
        origin="upper" if upright.downwards else "lower",
        extent=(*across.ends, bottom, top),
        aspect="auto",
        interpolation="none",
    )
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.5)
    for axis, side in ((axes.xaxis, across), (axes.yaxis, upright)):
        if len(side.places) > 1:
            ticks(axis, side)
    return image


def _bar_beside(figure: Figure, image: AxesImage, layer: Layer, beside: list[Axes], height: float) -> None:
    bar = figure.colorbar(
        image, ax=beside, location="right", pad=0.02, aspect=height / THICK, extend=_end(image)
    )
    _finish_bar(bar, image, _label(image, layer, height))


def _bar_beneath(figure: Figure, image: AxesImage, layer: Layer, above: list[Axes], width: float) -> None:
    bar = figure.colorbar(
        image,
        ax=above,
        location="bottom",
        pad=0.02,
        shrink=0.8,
        aspect=0.7 * width / THICK,
        extend=_end(image),
    )
    _finish_bar(bar, image, _label(image, layer, width))


def _end(image: AxesImage) -> Literal["min", "neither"]:
    """A pointed end of the colour bar where values lie below its least."""
    values, least = image.get_array(), image.norm.vmin
    return "min" if values is not None and least is not None and (values < least).any() else "neither"


def _label(image: AxesImage, layer: Layer, room: float) -> str:
    import numpy as np

    closed = {column: np.any(list(own.values()), axis=0) for column, own in layer.closed.items() if own}
    unknown = any(
        (np.isnan(values) & ~closed.get(column, np.zeros((), np.bool_))).any()
        for (_, column), values in layer.panels.items()
    )
    label = layer.label + ("; grey: no source knows" if unknown else "")
    return folded(label + closed_words(name for own in layer.closed.values() for name in own), room)


def _finish_bar(bar: Colorbar, image: AxesImage, label: str) -> None:
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import LogLocator, MaxNLocator

    norm = image.norm
    if isinstance(norm, LogNorm):
        assert norm.vmin is not None
        assert norm.vmax is not None
        narrow = norm.vmax / norm.vmin < 50
        bar.locator = LogLocator(subs=(1, 2, 5) if narrow else (1,))
        bar.minorticks_off()
    else:
        bar.locator = MaxNLocator(5, steps=[1, 2, 2.5, 5, 10])
    bar.update_ticks()
    plain_numbers(bar.long_axis)
    bar.outline.set_linewidth(0.5)
    bar.set_label(label)


def _label_outer(panels: NDArray[Any], sides: tuple[Side, Side], width: float) -> None:
    """Numbers and labels at the left and at the bottom of what is drawn, and not between."""
    upright, across = sides
    drawn = [[bool(axes.images) for axes in row] for row in panels]
    for down, row in enumerate(panels):
        for at, axes in enumerate(row):
            leftmost, lowest = at == 0, not any(below[at] for below in drawn[down + 1 :])
            axes.tick_params(length=2, pad=2, labelleft=leftmost, labelbottom=lowest)
            if leftmost:
                axes.set_ylabel(upright.label)
            if lowest and drawn[down][at]:
                axes.set_xlabel(folded(across.label, width))


def _name(panels: NDArray[Any], grid: Grid, width: float, height: float) -> None:
    """The panels' rows and columns; one that stands alone needs no name."""
    if not grid.wrapped:
        for at, column in enumerate(grid.columns):
            panels[0, at].set_title(folded(column, width), pad=3)
        for at, row in enumerate(grid.rows):
            beside = (folded(row, height), panels[at, 0].get_ylabel())
            panels[at, 0].set_ylabel("\n".join(filter(None, beside)))
    elif len(grid.rows) * len(grid.columns) > 1:
        for row in grid.rows:
            for column in grid.columns:
                name = row if len(grid.columns) == 1 else column
                panels[grid.place(row, column)].set_title(folded(name, width), pad=3)
