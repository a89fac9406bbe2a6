"""A picture as it is handed on: the figure, and what it shows in words."""

from __future__ import annotations

import io
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.output_file import OutputFile
from qinit_cli.plots.style import house_style
from qinit_store.wording import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MAKER = {"png": "Software", "svg": "Creator", "pdf": "Creator"}  # where each form says what made it
MARKS = {
    "png": "Software\0{}",
    "svg": "<dc:title>{}</dc:title>",
    "pdf": "/Creator ({})",
}  # ... as it stands in the file


@dataclass(frozen=True)
class PictureFile:
    """Where a picture goes, and the command that draws it: what the same command drew may be replaced."""

    path: Path
    maker: str = "qinit"
    force: bool = False

    @property
    def kind(self) -> str:
        """png, svg or pdf."""
        return self.path.suffix.lstrip(".").lower()

    @property
    def output(self) -> OutputFile:
        """The file as it is written."""
        return OutputFile(self.path, self.force, self.maker, MARKS[self.kind].format(self.maker).encode())


@dataclass(frozen=True)
class Drawn:
    """A figure, its title, and the sentence for those who do not see it, with the data's main numbers."""

    figure: Figure
    title: str
    alt: str
    notes: tuple[str, ...] = ()  # what is not in the picture, and why

    def __post_init__(self) -> None:
        from matplotlib.text import Text

        for text in self.figure.findobj(Text):
            text.set_text(printable(text.get_text(), keep="\n"))

    def save(self, file: PictureFile) -> None:
        """Writes it whole or not at all; the folder is made. The same figure gives the same bytes."""
        image = self._image(file.kind, {MAKER[file.kind]: file.maker})
        file.path.parent.mkdir(parents=True, exist_ok=True)
        file.output.write(image)

    def svg(self) -> str:
        """The picture as an SVG element to stand in a page, title and description in it."""
        text = self._image("svg").decode()
        return text[text.index("<svg") :]

    def _image(self, kind: str, further: dict[str, str] | None = None) -> bytes:
        title, alt = printable(self.title), printable(self.alt)
        said: dict[str, dict[str, Any]] = {
            "png": {"Software": None, "Title": title, "Description": alt},
            "svg": {"Date": None, "Title": title, "Description": alt},
            "pdf": {"CreationDate": None, "ModDate": None, "Title": title, "Subject": alt},
        }
        image = io.BytesIO()
        with house_style():
            self.figure.savefig(image, format=kind, metadata={**said[kind], **(further or {})})
        return _described(image.getvalue(), alt) if kind == "svg" else image.getvalue()


def _described(svg: bytes, alt: str) -> bytes:
    """With the description where browsers and screen readers look for it: matplotlib writes it as metadata alone."""
    text = svg.decode()
    opening, title, rest = text.partition("</title>")
    opening = opening.replace("<svg ", '<svg role="img" ', 1)
    return f"{opening}{title}\n <desc>{escape(alt, quote=False)}</desc>{rest}".encode()
