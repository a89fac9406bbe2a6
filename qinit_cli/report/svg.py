"""A picture's SVG as a part of a page: what it draws and nothing else, its ids its own, named for those who do not see it.

The file may come from anywhere, so elements, attributes and references are those that matplotlib draws with; any other is
refused, not mended. Style sheets would style the whole page; matplotlib's, the only one that is known, goes to the root.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

from qinit_cli.errors import NotAllowed
from qinit_store.wording import printable

SVG = "http://www.w3.org/2000/svg"
XLINK = "http://www.w3.org/1999/xlink"
HOUSE_SHEET = "*{stroke-linejoin: round; stroke-linecap: butt}"
DROPPED = ("metadata", "title", "desc")  # which are written anew
SHAPES = {"path", "rect", "circle", "ellipse", "line", "polyline", "polygon", "image", "text", "tspan"}
DRAWN = SHAPES | {"svg", "g", "defs", "clipPath", "use", "pattern", "linearGradient", "stop"}
PLACES = {
    "d",
    "x",
    "y",
    "x1",
    "y1",
    "x2",
    "y2",
    "cx",
    "cy",
    "r",
    "rx",
    "ry",
    "dx",
    "dy",
    "width",
    "height",
    "points",
}
LOOKS = {"style", "fill", "stroke", "stroke-width", "opacity", "offset", "clip-path", "text-anchor"}
UNITS = {"patternUnits", "patternTransform", "gradientUnits", "gradientTransform", "preserveAspectRatio"}
ATTRIBUTES = PLACES | LOOKS | UNITS | {"id", "transform"}
POINTS_TO_PIXELS = 96 / 72
# of an inch's 72nd, or of a letter's 64th: far below what is seen, and half of the bytes
DECIMALS = re.compile(r"(\.\d\d)\d+")
URL = re.compile(r"url\(\s*['\"]?([^)'\"]*)['\"]?\s*\)", re.IGNORECASE)
OTHER_CALLS = re.compile(r"(?<!url)\(|[\\@]")
IMAGE = re.compile(r"data:image/png;base64,[A-Za-z0-9+/=\s]+")


def inline(svg: str, name: str, title: str, alt: str) -> str:
    """The picture as an element of a page, `name` before each of its ids; NotAllowed where it does more than draw."""
    root = _root(svg, name)
    width, height = _size(root, name)
    root.attrib = {}
    _clean(root, name)
    root.attrib = {
        "role": "img",
        "aria-labelledby": f"{name}-title {name}-alt",
        "viewBox": f"0 0 {width:g} {height:g}",
        # as large as on paper, or larger where there is room
        "width": f"{width * POINTS_TO_PIXELS:.0f}",
        "height": f"{height * POINTS_TO_PIXELS:.0f}",
        "style": "stroke-linejoin:round;stroke-linecap:butt",
    }
    for place, (tag, words) in enumerate({"title": title, "desc": alt}.items()):
        told = ElementTree.Element(tag, id=f"{name}-{'title' if tag == 'title' else 'alt'}")
        told.text = printable(words, keep="\n")
        root.insert(place, told)
    return ElementTree.tostring(root, encoding="unicode")


def _root(svg: str, name: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(svg)  # drops comments; reads nothing from outside
    except ElementTree.ParseError as error:
        raise NotAllowed(f"{name} is no picture that a page can hold: {error}") from error
    if root.tag != f"{{{SVG}}}svg":
        raise NotAllowed(f"{name} is no SVG picture: it begins with {root.tag}")
    return root


def _size(root: ElementTree.Element, name: str) -> tuple[float, float]:
    """Width and height in points."""
    box = re.fullmatch(r"0 0 (\d+(?:\.\d+)?) (\d+(?:\.\d+)?)", root.get("viewBox", ""))
    if box is None:
        raise NotAllowed(f"{name} is no picture of qinit plot: its viewBox is {root.get('viewBox')!r}")
    return float(box[1]), float(box[2])


def _clean(root: ElementTree.Element, name: str) -> None:
    """Leaves what is drawn, in place."""
    for parent in list(root.iter()):
        for child in list(parent):
            kind = child.tag.removeprefix(f"{{{SVG}}}")
            if kind in DROPPED or (kind == "style" and (child.text or "").strip() == HOUSE_SHEET):
                parent.remove(child)
    referred = {reference.removeprefix("#") for element in root.iter() for reference in _references(element)}
    for element in root.iter():
        element.tag = element.tag.removeprefix(f"{{{SVG}}}")
        if element.tag not in DRAWN:
            raise NotAllowed(f"{name} holds <{element.tag}>, which no picture of qinit plot does")
        element.attrib = {
            key: value
            for key, value in (_attribute(*pair, name) for pair in element.attrib.items())
            if key != "id" or value.removeprefix(f"{name}-") in referred
        }
        element.text = (element.text or "").strip() if element.tag in ("text", "tspan") else None
        element.tail = None


def _attribute(key: str, value: str, name: str) -> tuple[str, str]:
    key = key.removeprefix(f"{{{XLINK}}}") if key == f"{{{XLINK}}}href" else key
    if key == "href":
        return key, _reference(value, name)
    if key not in ATTRIBUTES:
        raise NotAllowed(f"{name} has the attribute {key}, which no picture of qinit plot has")
    match key:
        case "id":
            return key, f"{name}-{value}"
        case "d" | "points":
            return key, DECIMALS.sub(r"\1", " ".join(value.split()))
        case "style":
            if OTHER_CALLS.search(value):
                raise NotAllowed(f"{name} has the style {value[:60]!r}, which no picture of qinit plot has")
            return key, URL.sub(lambda found: f"url({_reference(found[1], name)})", value)
        case _:
            return key, URL.sub(lambda found: f"url({_reference(found[1], name)})", value)


def _reference(value: str, name: str) -> str:
    """A reference to a part of the same picture, or the image itself; NotAllowed for any other place."""
    if value.startswith("#"):
        return f"#{name}-{value[1:]}"
    if IMAGE.fullmatch(value):
        return "".join(value.split())
    raise NotAllowed(f"{name} refers to {value[:60]!r}, which is not in the picture")


def _references(element: ElementTree.Element) -> list[str]:
    linked = [element.get("href"), element.get(f"{{{XLINK}}}href")]
    return [value for value in linked if value] + [
        found for value in element.attrib.values() for found in URL.findall(value)
    ]
