"""A picture within a page: what it draws is kept, its ids are its own, and whatever is no drawing is refused."""

from __future__ import annotations

import io
import itertools
from xml.etree import ElementTree

import pytest

from qinit_cli.errors import NotAllowed
from qinit_cli.report.svg import inline

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 252 180">'


def picture(inside: str) -> str:
    return f"{HEAD}{inside}</svg>"


def placed(inside: str, name: str = "figure-1") -> ElementTree.Element:
    return ElementTree.fromstring(inline(picture(inside), name, "Title", "Words"))


def attributes(root: ElementTree.Element, tag: str) -> dict[str, str]:
    """Those of the only element of that name."""
    [found] = root.iter(tag)
    return found.attrib


def test_a_picture_of_matplotlib_keeps_every_shape() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.add_subplot()
    axes.plot([1, 2], [3, 4], label="a line")
    axes.bar([1, 2], [3, 4], hatch="//")
    axes.imshow([[1, 2], [3, 4]])
    axes.legend()
    image = io.BytesIO()
    figure.savefig(image, format="svg")
    before = ElementTree.fromstring(image.getvalue())
    after = ElementTree.fromstring(inline(image.getvalue().decode(), "figure-1", "Title", "Words"))
    for shape in ("path", "use", "rect", "image", "pattern", "clipPath"):
        count = len(list(before.iter(f"{{http://www.w3.org/2000/svg}}{shape}")))
        assert count > 0, shape
        assert len(list(after.iter(shape))) == count, shape


def test_the_picture_is_named_by_its_title_and_its_words() -> None:
    root = placed("", "figure-7")
    assert root.get("role") == "img"
    told = {element.get("id"): element.text for element in root}
    assert told == {"figure-7-title": "Title", "figure-7-alt": "Words"}
    assert root.get("aria-labelledby") == "figure-7-title figure-7-alt"


def test_words_are_escaped() -> None:
    text = inline(picture(""), "figure-1", "<script>alert(1)</script>", "a & b")
    assert "<script>" not in text
    assert "a &amp; b" in text


def test_the_size_on_paper_becomes_pixels() -> None:
    root = placed("")
    assert (root.get("width"), root.get("height")) == ("336", "240")  # 3.5 and 2.5 inches of 96


def test_ids_and_references_to_them_bear_the_picture_s_name() -> None:
    root = placed(
        '<defs><clipPath id="c"><rect width="1" height="1"/></clipPath><path id="p" d="M 0 0"/></defs>'
        '<use xlink:href="#p" clip-path="url(#c)" style="fill: url(#c)"/>',
        "figure-2",
    )
    assert attributes(root, "clipPath")["id"] == "figure-2-c"
    assert attributes(root, "path")["id"] == "figure-2-p"
    assert attributes(root, "use") == {
        "href": "#figure-2-p",
        "clip-path": "url(#figure-2-c)",
        "style": "fill: url(#figure-2-c)",
    }


def test_an_id_that_nothing_refers_to_is_left_out() -> None:
    assert attributes(placed('<g id="axes_1"/>'), "g") == {}


def test_coordinates_keep_two_decimals() -> None:
    root = placed('<path d="M 1.23456 -2.5\nL 100 3.999999"/>')
    assert attributes(root, "path")["d"] == "M 1.23 -2.5 L 100 3.99"


def test_the_picture_s_style_sheet_does_not_reach_the_page() -> None:
    sheet = "<defs><style>*{stroke-linejoin: round; stroke-linecap: butt}</style></defs>"
    text = inline(picture(sheet), "figure-1", "", "")
    assert "<style" not in text
    assert "stroke-linejoin:round" in text


@pytest.mark.parametrize(
    "inside",
    [
        "<script>alert(1)</script>",
        "<foreignObject/>",
        "<a xlink:href='#x'/>",
        "<animate/>",
        "<style>body{display:none}</style>",
        '<path onload="alert(1)"/>',
        '<path class="scroll"/>',
        '<image xlink:href="http://example.org/x.png"/>',
        '<image href="//example.org/x.png"/>',
        '<image xlink:href="file:///etc/passwd"/>',
        '<image xlink:href="data:image/svg+xml;base64,AAAA"/>',
        '<use href="javascript:alert(1)"/>',
        '<path style="fill: url(http://example.org/x)"/>',
        '<path style="fill: u\\72l(http://example.org/x)"/>',
        '<path style="background: image-set(x)"/>',
        '<path clip-path="url(http://example.org/x#y)"/>',
        "<html:script xmlns:html='http://www.w3.org/1999/xhtml'/>",
    ],
)
def test_what_does_more_than_draw_is_refused(inside: str) -> None:
    with pytest.raises(NotAllowed):
        inline(picture(inside), "figure-1", "", "")


@pytest.mark.parametrize(
    "text", ["", "no markup", "<html/>", "<svg/>", picture("<g>"), HEAD.replace("252", "1e9") + "</svg>"]
)
def test_what_is_no_picture_is_refused(text: str) -> None:
    with pytest.raises(NotAllowed):
        inline(text, "figure-1", "", "")


def test_nothing_outside_is_read_and_entities_do_not_grow_without_bound() -> None:
    names = "abcdefghi"
    layers = "".join(f'<!ENTITY {name} "{f"&{before};" * 10}">' for before, name in itertools.pairwise(names))
    bomb = f'<!DOCTYPE svg [<!ENTITY a "{"a" * 100}">{layers}]>{picture("<text>&i;</text>")}'
    outside = f'<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]>{picture("<text>&a;</text>")}'
    for text in (bomb, outside):
        with pytest.raises(NotAllowed):
            inline(text, "figure-1", "", "")
