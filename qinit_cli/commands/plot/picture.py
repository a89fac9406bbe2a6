"""What all pictures share: where they go, how wide they are, what stands above them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from qinit_cli.commands.messages import note, print_path
from qinit_cli.commands.option_groups import Display, Group
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from qinit_cli.figures.drawn import Drawn, PictureFile

Width = Literal["column", "text"]


@dataclass(frozen=True)
class Picture:
    """Where the picture goes; None: as this picture has it."""

    output: str | None = option(
        None,
        "The picture: .png, .svg or .pdf; one of the same command is drawn anew.",
        short="-o",
        metavar="FILE",
    )
    title: str | None = option(None, "Title above the picture; '' for none.")
    width: Width | None = option(None, "As wide as a paper's column, 3.5 inches, or as its text, 7 inches.")
    force: bool = option(False, "Replace a file of that name that another command made.")

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

    def file(self, picture: Picture) -> PictureFile:
        """Where it goes; UsageError where that names no picture, NotAllowed where another command's file stands."""
        from qinit_cli.figures.drawn import PictureFile
        from qinit_cli.figures.style import checked_path

        path = checked_path(picture.output or f"{self.name}.png")
        file = PictureFile(path, f"qinit plot {self.name}", picture.force)
        file.output.check()
        return file

    def inches(self, picture: Picture) -> float:
        """How wide it is."""
        from qinit_cli.figures.style import COLUMN, TEXT

        return COLUMN if (picture.width or self.width) == "column" else TEXT


def publish(drawn: Drawn, file: PictureFile, display: Display) -> None:
    """Saves the picture and prints its path; what is not in it is noted."""
    for said in drawn.notes:
        note(display, said)
    drawn.save(file)
    print_path(file.path)
