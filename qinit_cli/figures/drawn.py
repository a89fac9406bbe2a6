"""A picture as it is handed on: the figure, and what it shows in words."""

from __future__ import annotations

import io
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.figures.style import house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Drawn:
    """A figure, its title, and the sentence for those who do not see it, with the data's main numbers."""

    figure: Figure
    title: str
    alt: str
    notes: tuple[str, ...] = ()  # what is not in the picture, and why

    def save(self, path: Path) -> None:
        """Writes it whole or not at all, in place of what was there; the folder is made. The same figure gives the same bytes."""
        image = self._image(path.suffix.lstrip(".").lower())
        path.parent.mkdir(parents=True, exist_ok=True)
        beside = path.with_name(f".{path.name}.part")
        beside.write_bytes(image)
        beside.replace(path)

    def svg(self) -> str:
        """The picture as an SVG element to stand in a page, title and description in it."""
        text = self._image("svg").decode()
        return text[text.index("<svg") :]

    def _image(self, kind: str) -> bytes:
        said: dict[str, dict[str, Any]] = {
            "png": {"Software": None, "Title": self.title, "Description": self.alt},
            "svg": {"Date": None, "Title": self.title, "Description": self.alt},
            "pdf": {"CreationDate": None, "ModDate": None, "Title": self.title, "Subject": self.alt},
        }
        image = io.BytesIO()
        with house_style():
            self.figure.savefig(image, format=kind, metadata=said[kind])
        return _described(image.getvalue(), self.alt) if kind == "svg" else image.getvalue()


def _described(svg: bytes, alt: str) -> bytes:
    """With the description where browsers and screen readers look for it: matplotlib writes it as metadata alone."""
    text = svg.decode()
    opening, title, rest = text.partition("</title>")
    opening = opening.replace("<svg ", '<svg role="img" ', 1)
    return f"{opening}{title}\n <desc>{escape(alt, quote=False)}</desc>{rest}".encode()
