"""Where over the states ln Q, or the path length, is normal over the source tasks: maps of the test's statistic and raw p."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.options import option
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.reported import Contents, Planned, firsts
from qinit_cli.plots.state_axes import ANY_SHAPE, Side, closed_states, closed_words, draw_closed, sides, ticks
from qinit_cli.plots.style import COLUMN, TEXT, VALUE_COLOURS, folded, house_style, plain_numbers

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from qinit_cli.arrays import Flags, Floats
    from qinit_cli.environments import Family
    from qinit_store.reading import Artefact

UNBROKEN = "\N{NO-BREAK SPACE}"
PREFIXES = {"values": "normality", "lengths": "eopl_normality"}
QUANTITIES = {"values": "ln Q", "lengths": "path length"}
TESTED_BY = {"values": "--normality shapiro", "lengths": "--eopl-normality rounded"}
CLASSES = (0.0, 0.001, 0.01, 0.05, 0.2, 1.0)  # of p
# of the colour map: a step in lightness at 0.05, so that what is rejected is told in grey too
SHADES = (0.0, 0.2, 0.4, 0.8, 1.0)
BULK = (0.02, 0.98)  # quantiles between which colours tell values of the statistic apart
LEAST = 0.85  # inches, the width of a panel that can still be read
TICKS, BAR, GAP, TITLE, THICK, PAD = 0.5, 0.85, 0.08, 0.22, 0.11, 0.03  # inches

CAPTION = (
    "The test's statistic and its raw p in each state. A p that does not reject is no evidence of "
    "normality."
)  # in a report


@dataclass(frozen=True)
class NormalityPlot(Plot):
    """Maps of a fit's test of normality over the states: its statistic (W) and its raw p."""

    name: ClassVar[str] = "normality"
    takes: ClassVar[Takes] = Takes(("fit",), "A fit")
    titled: ClassVar[str] = "the distribution, and what is tested"
    heading: ClassVar[str] = "Maps"

    of: Literal["values", "lengths"] = option("values", "The test of ln Q, or that of the path lengths.")
    action: Literal["greedy", "all"] = option(
        "greedy", "At the action of the largest mean of each state, or at every action."
    )

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """The test of a fit's values or path lengths, where it was made."""
        [path] = paths
        from qinit_cli.artefacts.opening import family_in, open_artefact
        from qinit_cli.environments.tiled import TiledFamily

        with open_artefact(path, "fit") as artefact:
            family = family_in(artefact)
            if isinstance(family, TiledFamily):
                raise NotAllowed(
                    f"{path} has a test at each of {family.cut.probes} probes, which make no map; write them with "
                    f"`qinit export {path} --what state-actions`"
                )
            tested = _tested(artefact, family, self.of, self.action)
            words = _words(artefact, tested, self.of)
        axes = sides(family.axes())
        if len(axes) != 2:
            names = ", ".join(axis.name for axis in family.axes())
            raise NotAllowed(f"a map has two state axes, {family.name} has {names}")
        at = "every action" if self.action == "all" else "action of the largest mean"
        own = f"{family.label}, {QUANTITIES[self.of]}, {at}"
        with house_style():
            figure = normality(
                tested, words, axes[0], axes[1], own if frame.title is None else frame.title, frame.width
            )
        return Drawn(figure, frame.title or f"Maps of normality, {own}", _alt(tested, words, own))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture of the first source set of each distribution whose values were tested."""
        fits = contents.kinds["fit"]
        for path, caption, words in firsts(fits, CAPTION):
            if fits[path]["settings"].options.normality != "none":
                yield Planned(caption, words, partial(cls().drawn, [path]))


def _alt(tested: list[Map], words: Words, own: str) -> str:
    """The middle of the statistic, and the shares that are rejected."""
    import numpy as np

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
    import numpy as np

    prefix = PREFIXES[of]
    if f"{prefix}_p" not in {column.name for column in artefact.schema.columns}:
        raise NotAllowed(
            f"{artefact.path} has no test of {QUANTITIES[of]}; fit its sources again with {TESTED_BY[of]}"
        )
    statistic, p, mean = (artefact.read(name) for name in (f"{prefix}_w", f"{prefix}_p", "mean"))
    closed = closed_states(family)
    if action == "all":
        return [Map(name, statistic[..., at], p[..., at], closed) for at, name in enumerate(family.actions)]
    greedy = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=-1)[..., None]

    def there(table: Any) -> Any:
        return np.take_along_axis(table, greedy, axis=-1)[..., 0]

    return [Map("", there(statistic), there(p), closed)]


def _words(artefact: Artefact, tested: list[Map], of: str) -> Words:
    """What the maps show, of how many tasks, and how many state-actions are rejected by each correction."""
    import numpy as np

    from qinit_cli.artefacts.fit_findings import rejected

    prefix = PREFIXES[of]
    [column] = [column for column in artefact.schema.columns if column.name == f"{prefix}_w"]
    n, closed = artefact.read(f"{prefix}_n"), tested[0].closed
    open_states = ~np.any(list(closed.values()), axis=0) if closed else np.ones(n.shape[:-1], np.bool_)
    n = n[open_states]
    tasks = f"n = {n.max()}" if n.min() == n.max() else f"n {n.min()} to {n.max()}"
    p = np.stack([each.p for each in tested])
    unknown = "; hatched: not testable" if np.isnan(p[:, open_states]).any() else ""
    shares = rejected(p)
    raw, hochberg, yekutieli = (
        "none" if share is None else f"{100 * share:.0f}{UNBROKEN}%" for share in shares.values()
    )
    return Words(
        f"{column.long_name}, {tasks}{unknown}{closed_words(closed)}",
        f"raw p; below 0.05: {raw}, BH{UNBROKEN}{hochberg}, BY{UNBROKEN}{yekutieli}",
    )


@dataclass(frozen=True)
class Map:
    """One map of each, (upright, across), NaN where not testable."""

    name: str  # what tells it from the others: an action
    statistic: Floats
    p: Floats
    closed: Mapping[str, Flags] = field(default_factory=dict)  # (upright, across) of what stands there


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
    for row in (upper, lower):
        for axes, each in zip(row, tested, strict=True):
            draw_closed(axes, each.closed, (upright, across))
    _bar(figure, images[0], lower, words.p, panel * shape, "neither")
    _label(panels, tested, (upright, across), panel)
    if title:
        figure.suptitle(title)
    return figure


def _statistic_colours(tested: Sequence[Map]) -> tuple[Normalize, Any]:
    """Colours over the bulk of the statistic, so that a few odd state-actions do not hide the others."""
    import matplotlib
    import numpy as np
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
    import numpy as np

    known = np.concatenate([each.statistic[np.isfinite(each.statistic)] for each in tested])
    below, above = bool((known < norm.vmin).any()), bool((known > norm.vmax).any())
    return "both" if below and above else "min" if below else "max" if above else "neither"


def _draw(axes: Axes, values: Floats, sides: tuple[Side, Side], norm: Normalize, colours: Any) -> AxesImage:
    import numpy as np
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
