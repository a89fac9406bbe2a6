"""Where over the states a quantity is normal over the tasks: the test's statistic, and its raw p in classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from qinit_cli.errors import UsageError
from qinit_cli.figures.heatmaps import ANY_SHAPE, Side, ticks
from qinit_cli.figures.style import COLUMN, TEXT, VALUE_COLOURS, folded, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from qinit_cli.arrays import Floats

CLASSES = (0.0, 0.001, 0.01, 0.05, 0.2, 1.0)  # of p
# of the colour map: a step in lightness at 0.05, so that what is rejected is told in grey too
SHADES = (0.0, 0.2, 0.4, 0.8, 1.0)
BULK = (0.02, 0.98)  # quantiles between which colours tell values of the statistic apart
LEAST = 0.85  # inches, the width of a panel that can still be read
TICKS, BAR, GAP, TITLE, THICK, PAD = 0.5, 0.85, 0.08, 0.22, 0.11, 0.03  # inches


@dataclass(frozen=True)
class Map:
    """One map of each, (upright, across), NaN where not testable."""

    name: str  # what tells it from the others: an action
    statistic: Floats
    p: Floats


@dataclass(frozen=True)
class Words:
    """What stands beside the colour bars."""

    statistic: str
    p: str


def normality(
    tested: Sequence[Map], words: Words, upright: Side, across: Side, title: str, width: float = TEXT
) -> Figure:
    """The statistic and p: side by side, or each in a row where there are several. Call it within `house_style`."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    side_by_side = len(tested) == 1 and width > COLUMN
    rows, columns = (1, 2) if side_by_side else (2, len(tested))
    shape = min(max(len(upright.places) / len(across.places), ANY_SHAPE[0]), ANY_SHAPE[1])
    bars = 2 if side_by_side else 1
    panel = (width - TICKS - bars * BAR) / columns - GAP
    if panel < LEAST:
        raise UsageError(
            f"{columns} panels are too small to read on {width:g} inches; draw them with --width text"
        )
    layout = ConstrainedLayoutEngine(compress=True, h_pad=PAD, w_pad=PAD, hspace=0.0, wspace=0.0)
    height = rows * (panel * shape + GAP) + TICKS + TITLE * (bool(title) + (len(tested) > 1))
    figure = Figure(figsize=(width, height), layout=layout)
    panels = figure.subplots(rows, columns, squeeze=False)
    upper, lower = ([panels[0, 0]], [panels[0, 1]]) if side_by_side else (list(panels[0]), list(panels[1]))
    for axes in panels.flat:
        axes.set_box_aspect(shape)
    statistic = _statistic_colours(tested)
    images = [
        _draw(axes, each.statistic, (upright, across), *statistic)
        for axes, each in zip(upper, tested, strict=True)
    ]
    _bar(figure, images[0], upper, words.statistic, panel * shape, _ends(tested, statistic[0]))
    images = [
        _draw(axes, each.p, (upright, across), *_p_colours())
        for axes, each in zip(lower, tested, strict=True)
    ]
    _bar(figure, images[0], lower, words.p, panel * shape, "neither")
    _label(panels, tested, (upright, across), panel)
    if title:
        figure.suptitle(title)
    return figure


def _statistic_colours(tested: Sequence[Map]) -> tuple[Normalize, Any]:
    """Colours over the bulk of the statistic, so that a few odd state-actions do not hide the others."""
    import matplotlib
    from matplotlib.colors import Normalize

    known = np.concatenate([each.statistic[np.isfinite(each.statistic)] for each in tested])
    low, high = np.quantile(known, BULK) if known.size else (0.0, 1.0)
    return Normalize(low, high if high > low else low + 1e-9), matplotlib.colormaps[VALUE_COLOURS]


def _p_colours() -> tuple[Normalize, Any]:
    import matplotlib
    from matplotlib.colors import BoundaryNorm, ListedColormap

    shades = [matplotlib.colormaps[VALUE_COLOURS](shade) for shade in SHADES]
    return BoundaryNorm(CLASSES, len(shades)), ListedColormap(shades)


def _ends(tested: Sequence[Map], norm: Normalize) -> Literal["neither", "both", "min", "max"]:
    """Pointed ends of the colour bar where values lie beyond them."""
    known = np.concatenate([each.statistic[np.isfinite(each.statistic)] for each in tested])
    below, above = bool((known < norm.vmin).any()), bool((known > norm.vmax).any())
    return "both" if below and above else "min" if below else "max" if above else "neither"


def _draw(axes: Axes, values: Floats, sides: tuple[Side, Side], norm: Normalize, colours: Any) -> AxesImage:
    from matplotlib.patches import Rectangle

    upright, across = sides
    bottom, top = reversed(upright.ends) if upright.downwards else upright.ends
    image = axes.imshow(
        np.ma.masked_invalid(values),
        cmap=colours.with_extremes(bad=(0, 0, 0, 0)),
        norm=norm,
        origin="upper" if upright.downwards else "lower",
        extent=(*across.ends, bottom, top),
        aspect="auto",
        interpolation="none",
        zorder=1,
    )
    if np.isnan(values).any():  # a grey would read like one of the lighter colours
        axes.add_patch(
            Rectangle(
                (0, 0), 1, 1, transform=axes.transAxes, facecolor="white", edgecolor="#777777", hatch="//////",
                linewidth=0, zorder=0,
            )
        )  # fmt: skip
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.5)
    ticks(axes.xaxis, across)
    ticks(axes.yaxis, upright)
    return image


def _bar(
    figure: Figure,
    image: AxesImage,
    beside: list[Axes],
    label: str,
    height: float,
    extend: Literal["neither", "both", "min", "max"],
) -> None:
    from matplotlib.colors import BoundaryNorm
    from matplotlib.ticker import FixedLocator, MaxNLocator

    classes = isinstance(image.norm, BoundaryNorm)
    bar = figure.colorbar(
        image, ax=beside, location="right", pad=0.02, aspect=height / THICK, extend=extend, spacing="uniform"
    )
    bar.locator = FixedLocator(CLASSES) if classes else MaxNLocator(5, steps=[1, 2, 2.5, 5, 10])
    bar.update_ticks()
    bar.minorticks_off()
    plain_numbers(bar.long_axis)
    bar.outline.set_linewidth(0.5)
    bar.set_label(folded(label, height))


def _label(panels: Any, tested: Sequence[Map], sides: tuple[Side, Side], width: float) -> None:
    """Numbers and labels at the left and at the bottom; the actions' names above where there are several."""
    upright, across = sides
    rows, columns = panels.shape
    for at in range(columns):
        for row in range(rows):
            axes = panels[row, at]
            axes.tick_params(length=2, pad=2, labelleft=at == 0, labelbottom=row == rows - 1)
        panels[-1, at].set_xlabel(folded(across.label, width))
        if len(tested) > 1:
            panels[0, at].set_title(tested[at].name, pad=3)
    for row in range(rows):
        panels[row, 0].set_ylabel(upright.label)
