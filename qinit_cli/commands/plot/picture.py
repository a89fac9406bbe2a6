"""What all pictures share: where they go, how wide they are, what stands above them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from qinit_cli.commands.build import Group
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from store.schema import Axis

Width = Literal["column", "text"]

METRIC_LABELS = {
    "return": "discounted return",
    "success": "share of episodes at the goal",
    "steps": "steps, at most the horizon",
}
SPELLED_OUT = {"col": "column"}  # what an axis is called in files and in pictures


@dataclass(frozen=True)
class Picture:
    """Where the picture goes; None: as this picture has it."""

    output: str | None = option(None, "The picture: .png, .svg or .pdf.", short="-o", metavar="FILE")
    title: str | None = option(None, "Title above the picture; '' for none.")
    width: Width | None = option(None, "As wide as a paper's column, 3.5 inches, or as its text, 7 inches.")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Usual:
    """What a picture has where nothing else is asked for."""

    name: str
    width: Width
    title: str  # in words, for the help

    @property
    def group(self) -> Group:
        """The options, with these defaults told in the help."""
        texts = {"output": f"{self.name}.png", "title": self.title, "width": self.width}
        return Group(Picture, "Picture", texts)

    def path(self, picture: Picture) -> Path:
        """Where it goes; UsageError where it cannot go there."""
        from qinit_cli.figures.style import checked_path

        return checked_path(picture.output or f"{self.name}.png")

    def inches(self, picture: Picture) -> float:
        """How wide it is."""
        from qinit_cli.figures.style import COLUMN, TEXT

        return COLUMN if (picture.width or self.width) == "column" else TEXT


def publish(figure: Any, path: Path) -> None:
    """Saves the picture and prints its path; call it within `house_style`."""
    from qinit_cli.figures.style import save

    save(figure, path)
    typer.echo(path)


def marked(label: str, method: str) -> str:
    """The label of a method's line, bar or panel, with what a reader must know of it."""
    from qinit_cli.stages.compare import remark

    known = remark(method)
    return f"{label} ({known})" if known else label


def distribution(name: str, label: str) -> str:
    """The distribution as a picture names it: the family's label without the family's name."""
    return label.removeprefix(f"{name}-").replace("-", " ")


def distinct(names: Sequence[str], *additions: Sequence[str]) -> list[str]:
    """The names; those that stand there twice with the first addition, on a line of its own, that tells all of them apart."""
    for addition in ((), *additions):
        longer = list(names)
        if addition:
            longer = [
                f"{name}\n{more}" if names.count(name) > 1 else name
                for name, more in zip(names, addition, strict=True)
            ]
        if len(set(longer)) == len(longer):
            return longer
    return longer


def axis_label(axis: Axis) -> str:
    """What stands along a state axis: its name and unit; whole numbers without one count cells."""
    unit = "cell" if axis.unit == "1" and axis.values.dtype.kind in "iu" else axis.unit
    name = SPELLED_OUT.get(axis.name, axis.name)
    return name if unit in ("", "1") else f"{name} ({unit})"
