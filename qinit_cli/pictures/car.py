"""Mountain Car as a distribution of sources has it: the hill, the car, the flag and the push; Figure A1."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.errors import NotAllowed
from qinit_cli.figures.style import TEXT

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.environments.mountain_car import MountainCar
    from qinit_cli.figures.car import Hill
    from qinit_cli.figures.drawn import Drawn

STEEPNESS = 3  # gravity pulls by cos(3 x), so the hill is as high as sin(3 x)


def drawn(path: Path, *, title: str | None = None, width: float = TEXT) -> Drawn:
    """The world of Mountain Car sources: hill, start, goal, where the noise acts, its density and the tasks' pushes."""
    from qinit_cli.artefacts.opening import family_in, open_artefact
    from qinit_cli.environments.mountain_car import MountainCar
    from qinit_cli.figures import car as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    with open_artefact(path, "sources") as artefact:
        family = family_in(artefact)
        if not isinstance(family, MountainCar):
            raise NotAllowed(
                f"{path} holds sources of {family.name}, where there is no car; draw those of mountain-car"
            )
        hill = _hill(family, artefact.read("eta"))
    with house_style():
        figure = drawing.car(hill, family.label if title is None else title, width)
    return Drawn(figure, title or f"The car, the hill and the noise, {family.label}", _alt(hill, family))


def _hill(family: MountainCar, pushes: Floats) -> Hill:
    from qinit_cli.environments.mountain_car import POSITIONS, START
    from qinit_cli.figures.car import Hill
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
