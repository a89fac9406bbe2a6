"""The HTML of a page: one file that needs no other, no script and no network."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from qinit_store.wording import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from jinja2 import Template
    from markupsafe import Markup

    from qinit_cli.report.content import Block, Page

GENERATOR = "qinit report"  # how a page of ours is told from other files
MARK = f'<meta name="generator" content="{GENERATOR}'  # within the first KB of each


def html(page: Page) -> str:
    """The page; the same content gives the same text. Everything in it is escaped but the pictures, see `svg`."""
    numbered = {id(block): number for number, block in enumerate(_all(page, "figure"), 1)}
    tables = {id(block): number for number, block in enumerate(_all(page, "table"), 1)}

    def number(block: Block) -> int:
        return (numbered | tables)[id(block)]

    return _template().render(page=page, number=number, picture=_picture, style=_style(), mark=GENERATOR)


def _all(page: Page, kind: str) -> Iterator[Block]:
    """The blocks of that kind, folded ones too, in reading order."""

    def within(blocks: Any) -> Iterator[Block]:
        for block in blocks:
            if block.kind == kind:
                yield block
            if block.kind == "folded":
                yield from within(block.blocks)
            if block.kind == "judgement" and block.details:
                yield from within([block.details])

    for section in page.sections:
        yield from within(section.blocks)


def _picture(figure: Any, number: int) -> Markup:
    from markupsafe import Markup

    from qinit_cli.report.svg import inline

    return Markup(
        inline(figure.svg, f"figure-{number}", figure.title, figure.alt)
    )  # nothing but drawing is in it


@cache
def _template() -> Template:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    house = Environment(
        loader=PackageLoader("qinit_cli.report", "."),
        autoescape=True,
        finalize=_legible,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    house.filters["kept"] = _kept
    return house.get_template("page.html.jinja")


def _legible(value: object) -> object:
    """Text without what is obeyed or hidden when it is shown; what is HTML already as it is."""
    from markupsafe import Markup

    return printable(value, keep="\n") if isinstance(value, str) and not isinstance(value, Markup) else value


def _kept(words: str) -> str:
    """The words with no line's end between a number and its per cent."""
    return words.replace(" %", "\N{NO-BREAK SPACE}%")


@cache
def _style() -> Markup:
    from importlib.resources import files

    from markupsafe import Markup

    return Markup((files("qinit_cli.report") / "page.css").read_text("utf-8"))
