"""Mountain Car as a distribution of sources has it: the hill, the car, the flag and the push; Figure A1."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.errors import NotAllowed
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes, Width
from qinit_cli.plots.style import COLOURS, TEXT, folded, house_style, plain_numbers

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats
    from qinit_cli.environments.mountain_car import MountainCar

STEEPNESS = 3  # gravity pulls by cos(3 x), so the hill is as high as sin(3 x)
POINTS = 400  # along a curve
GROUND, NOISE = "#8c8c8c", "#f6d7c3"
CAR, FLAG, PUSH = COLOURS[0], COLOURS[2], COLOURS[1]
HEADROOM = 0.75  # of the hill's height, above it: for the density
WHEEL = 0.05  # from the car's middle
BODY = (  # from its middle on the ground; upwards as a share of the hill's height
    (-0.09, 0.05), (-0.09, 0.12), (-0.05, 0.12), (-0.03, 0.18), (0.04, 0.18), (0.06, 0.12), (0.09, 0.12), (0.09, 0.05)
)  # fmt: skip
MINUS = "\N{MINUS SIGN}"
DEVIATIONS = 3.5  # to either side of the density


@dataclass(frozen=True)
class CarPlot(Plot):
    """Mountain Car in profile as these sources have it: the hill, the start, the flag, where the noise acts,
    and its distribution.
    """

    name: ClassVar[str] = "car"
    takes: ClassVar[Takes] = Takes(("sources",), "Sources of mountain-car")
    titled: ClassVar[str] = "the distribution"
    wide: ClassVar[Width] = "column"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """The world of Mountain Car sources, with the density of the push and the tasks' pushes."""
        [path] = paths
        from qinit_cli.artefacts.opening import family_in, open_artefact
        from qinit_cli.environments.mountain_car import MountainCar
        from qinit_cli.environments.tiled import TiledFamily

        with open_artefact(path, "sources") as artefact:
            family = family_in(artefact)
            world = family.family if isinstance(family, TiledFamily) else family
            if not isinstance(world, MountainCar):
                raise NotAllowed(
                    f"{path} holds sources of {family.name}, where there is no car; draw those of mountain-car"
                )
            hill = _hill(world, artefact.read("eta"))
        with house_style():
            figure = car(hill, family.label if frame.title is None else frame.title, frame.width)
        return Drawn(
            figure, frame.title or f"The car, the hill and the noise, {family.label}", _alt(hill, world)
        )


def _hill(family: MountainCar, pushes: Floats) -> Hill:
    import numpy as np

    from qinit_cli.environments.mountain_car import POSITIONS, START
    from qinit_cli.kernels.mountain_car import GOAL

    every_step = family.noise_per == "step"
    return Hill(
        left=POSITIONS[0],
        right=POSITIONS[1],
        height=lambda at: np.sin(STEEPNESS * at),
        start=START[0],
        goal=GOAL,
        noisy_from=family.hill,
        spread=family.spread,
        pushes=pushes[:0] if every_step else pushes,
        of_what="one every step" if every_step else "one a task",
    )


def _alt(hill: Hill, family: MountainCar) -> str:
    import numpy as np

    pushes = (
        f"; the {hill.pushes.size} tasks' pushes go from {hill.pushes.min():.3g} to {hill.pushes.max():.3g}, "
        f"standard deviation {np.std(hill.pushes):.3g}"
        if hill.pushes.size
        else ""
    )
    return (
        f"Profile of Mountain Car, {family.label}: a valley between two hills, the car at rest at position {hill.start:g}, "
        f"the flag at {hill.goal:g}; on the right hill, from position {hill.noisy_from:g}, a push of standard deviation "
        f"{hill.spread:g} is added to every step, {hill.of_what}{pushes}."
    )


@dataclass(frozen=True)
class Hill:
    """The world of a task distribution."""

    left: float
    right: float
    height: Callable[[Floats], Floats]  # over positions
    start: float
    goal: float
    noisy_from: float  # position
    spread: float  # standard deviation of the push
    pushes: Floats  # (N,) those of the tasks; none where they are drawn every step
    of_what: str  # how often a push is drawn


def car(hill: Hill, title: str, width: float = TEXT) -> Figure:
    """The world in profile, with the density of the push above the noisy part. Call it within `house_style`."""
    import numpy as np
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, 0.45 * width + 0.5 + (0.2 if title else 0)))
    axes = figure.add_subplot()
    at = np.linspace(hill.left, hill.right, POINTS)
    ground = hill.height(at)
    low, high = float(ground.min()), float(ground.max())
    rise = high - low
    axes.set_xlim(hill.left, hill.right)
    axes.set_ylim(low - 0.15 * rise, high + HEADROOM * rise)
    axes.axvspan(max(hill.left, hill.noisy_from), hill.right, color=NOISE, linewidth=0, zorder=0)
    axes.fill_between(at, axes.get_ylim()[0], ground, color=GROUND, linewidth=0, alpha=0.35, zorder=1)
    axes.plot(at, ground, color="black", zorder=2)
    _car(axes, hill, rise)
    _flag(axes, hill, rise)
    where = f"noise acts where the position is at least {hill.noisy_from:g}".replace("-", MINUS)
    axes.annotate(
        folded(where, 0.3 * width),
        (max(hill.left, hill.noisy_from), low + 0.02 * rise),
        xytext=(4, 0),
        textcoords="offset points",
        fontsize=7,
    )
    axes.set(xlabel="position", yticks=[])
    axes.spines["left"].set_visible(False)
    axes.set_title(title)
    plain_numbers(axes.xaxis)
    _density(axes.inset_axes((0.1, 0.66, 0.4, 0.24)), hill)
    return figure


def _car(axes: Axes, hill: Hill, rise: float) -> None:
    """The car at rest where it starts."""
    import numpy as np

    foot = float(hill.height(np.array([hill.start]))[0])
    places = np.array(BODY) * (1.0, rise) + (hill.start, foot)
    axes.fill(places[:, 0], places[:, 1], color=CAR, zorder=4)
    wheels = [hill.start - WHEEL, hill.start + WHEEL]
    axes.plot(wheels, [foot + 0.04 * rise] * 2, "o", color="black", markersize=5, zorder=5)
    _say(axes, f"start ({hill.start:g}, 0)", hill.start, foot + 0.2 * rise)


def _flag(axes: Axes, hill: Hill, rise: float) -> None:
    """The flag where an episode ends."""
    import numpy as np

    foot = float(hill.height(np.array([hill.goal]))[0])
    top = foot + 0.32 * rise
    axes.plot([hill.goal] * 2, [foot, top], color="black", zorder=4)
    cloth = [hill.goal, hill.goal - 0.1, hill.goal], [top, top - 0.06 * rise, top - 0.12 * rise]
    axes.fill(*cloth, color=FLAG, zorder=4)
    _say(axes, f"goal {hill.goal:g}", hill.goal - 0.05, top)


def _say(axes: Axes, words: str, x: float, y: float) -> None:
    """The words, centred just above a place."""
    axes.annotate(
        words.replace("-", MINUS),
        (x, y),
        xytext=(0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=7,
    )


def _density(axes: Axes, hill: Hill) -> None:
    """The density of the push, and those of the tasks beneath it."""
    import numpy as np

    axes.set_title(f"push η ~ N(0, {hill.spread:g}²), {hill.of_what}", fontsize=7, pad=3)
    axes.spines["left"].set_visible(False)
    axes.set(yticks=[])
    axes.tick_params(labelsize=6.5, pad=2)
    plain_numbers(axes.xaxis)
    if hill.spread == 0:
        axes.axvline(0, color=PUSH)
        axes.set_xlim(-1, 1)
        axes.set_xticks([0])
        return
    reach = max(DEVIATIONS * hill.spread, 1.05 * float(np.abs(hill.pushes).max(initial=0.0)))
    at = np.linspace(-reach, reach, POINTS)
    density = np.exp(-((at / hill.spread) ** 2) / 2) / (hill.spread * np.sqrt(2 * np.pi))
    axes.plot(at, density, color=PUSH)
    axes.fill_between(at, density, color=NOISE, linewidth=0)
    beneath = np.full(hill.pushes.size, -0.08 * density.max())
    axes.plot(hill.pushes, beneath, "|", color="black", markersize=4, markeredgewidth=0.5)
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-0.16 * density.max(), 1.08 * density.max())
    axes.set_xticks([-2 * hill.spread, 0, 2 * hill.spread])
