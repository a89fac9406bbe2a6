"""The page in a browser: it renders, asks for nothing, fits a phone, and is there for those who see little or nothing of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

Open = Callable[..., Any]
PHONE = 360
LEAST_CONTRAST = 4.5  # WCAG 2.2, 1.4.3

every_page = pytest.mark.parametrize("name", ["artefacts", "reproduction", "hostile"])
both_schemes = pytest.mark.parametrize("scheme", ["light", "dark"])

UNFOLD = "for (const each of document.querySelectorAll('details')) each.open = true"
# every text that is shown: its words, its colour, and the colours beneath it from its own element upwards
TEXTS = """() => {
  const found = []
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT)
  while (walker.nextNode()) {
    const words = walker.currentNode.textContent.trim()
    const own = walker.currentNode.parentElement
    if (!words || !own.checkVisibility() || own.closest('title, desc, style')) continue
    const beneath = []
    for (let at = own; at; at = at.parentElement) beneath.push(getComputedStyle(at).backgroundColor)
    const style = getComputedStyle(own)
    found.push([words, own.closest('svg') ? style.fill : style.color, beneath])
  }
  return found
}"""


@every_page
def test_nothing_but_the_file_is_asked_for_and_the_console_is_silent(
    name: str, pages: Mapping[str, Path], opened: Open
) -> None:
    page = opened(pages[name])
    page.evaluate(UNFOLD)
    page.mouse.wheel(0, 100_000)
    assert page.asked == [pages[name].as_uri()]
    assert page.said == []


def test_a_request_and_a_forbidden_script_would_have_been_noticed(opened: Open, tmp_path: Path) -> None:
    policy = "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'\">"
    (tmp_path / "asks.html").write_text("<img src='nowhere.png'>")
    (tmp_path / "acts.html").write_text(f"{policy}<script>document.title = 'acted'</script>")
    assert len(opened(tmp_path / "asks.html").asked) == 2
    acts = opened(tmp_path / "acts.html")
    assert acts.title() == ""
    assert any("Content Security Policy" in said for said in acts.said)


@every_page
def test_a_phone_shows_the_page_without_moving_it_sideways(
    name: str, pages: Mapping[str, Path], opened: Open
) -> None:
    page = opened(pages[name], PHONE)
    page.evaluate(UNFOLD)
    wide, room = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
    assert wide <= room == PHONE
    beyond = page.evaluate(
        "[...document.querySelectorAll('body *')].filter(each => !each.closest('.scroll, .skip') && "
        "each.getBoundingClientRect().right > innerWidth + 0.5).map(each => each.outerHTML.slice(0, 80))"
    )
    assert beyond == []


def test_on_a_phone_wide_tables_are_moved_by_themselves_under_their_caption(
    pages: Mapping[str, Path], opened: Open
) -> None:
    page = opened(pages["artefacts"], PHONE)
    table = page.locator("#comparisons .card.scroll").first
    table.evaluate("each => { each.scrollLeft = 200 }")
    assert table.evaluate("each => each.scrollLeft") > 0
    caption = table.locator("caption span").bounding_box()
    assert caption["x"] >= 0
    assert caption["x"] + caption["width"] <= PHONE


def test_on_a_phone_letters_are_legible(pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages["reproduction"], PHONE)
    page.evaluate(UNFOLD)
    smallest = page.evaluate(
        "Math.min(...[...document.querySelectorAll('body *')].filter(each => !each.closest('svg') && each.checkVisibility())"
        ".map(each => parseFloat(getComputedStyle(each).fontSize)))"
    )
    assert smallest >= 13


@every_page
def test_on_a_phone_every_picture_is_seen_whole(name: str, pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages[name], PHONE)
    page.evaluate(UNFOLD)
    shown = page.evaluate(
        "[...document.querySelectorAll('figure svg')].map(each => [each.getBoundingClientRect(), each.viewBox.baseVal])"
        ".map(([box, view]) => [box.left, box.right, box.width / box.height, view.width / view.height])"
    )
    assert shown
    for left, right, shape, drawn in shown:
        assert 0 <= left < right <= PHONE
        assert right - left > 0.85 * PHONE
        assert shape == pytest.approx(drawn, rel=0.01)


@every_page
@both_schemes
def test_every_text_stands_out_from_what_is_beneath_it(
    name: str, scheme: str, pages: Mapping[str, Path], opened: Open
) -> None:
    page = opened(pages[name], color_scheme=scheme)
    page.evaluate(UNFOLD)
    texts = page.evaluate(TEXTS)
    assert len(texts) > 50
    faint = [
        (words, ink, beneath) for words, ink, beneath in texts if _contrast(ink, beneath) < LEAST_CONTRAST
    ]
    assert faint == []


@pytest.mark.parametrize(
    ("ink", "beneath", "contrast"),
    [
        ("rgb(0, 0, 0)", ["rgb(255, 255, 255)"], 21.0),
        ("rgb(118, 118, 118)", ["rgba(0, 0, 0, 0)", "rgb(255, 255, 255)"], 4.54),  # the known limit on white
        ("rgb(255, 0, 0)", ["rgba(0, 0, 0, 0)"], 4.0),
        ("rgb(0, 0, 0)", ["rgba(255, 255, 255, 0.5)", "rgb(0, 0, 0)"], 5.28),
    ],
)
def test_contrast_is_that_of_the_guidelines(ink: str, beneath: list[str], contrast: float) -> None:
    assert _contrast(ink, beneath) == pytest.approx(contrast, abs=0.01)


def test_the_dark_page_is_dark_and_its_pictures_are_on_paper(pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages["reproduction"], color_scheme="dark")
    ground, paper = (
        _luminance(
            _rgb(page.locator(part).first.evaluate("each => getComputedStyle(each).backgroundColor"))[:3]
        )
        for part in ("body", ".paper")
    )
    assert ground < 0.02
    assert paper == 1


@every_page
def test_headings_are_in_order(name: str, pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages[name])
    levels = page.evaluate(
        "[...document.querySelectorAll('h1, h2, h3, h4, h5, h6')].map(each => +each.tagName[1])"
    )
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert page.evaluate("document.documentElement.lang") == "en"


@every_page
def test_every_picture_and_every_table_has_a_name(name: str, pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages[name])
    page.evaluate(UNFOLD)
    session = page.context.new_cdp_session(page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    seen = [node for node in nodes if not node["ignored"]]
    for role, tag in (("image", "svg"), ("table", "table")):
        names = [node["name"]["value"] for node in seen if node["role"]["value"] in (role, role[:3])]
        assert len(names) == page.locator(tag).count() > 0, role
        assert all(len(told) > 3 for told in names)
    pictures = [node["name"]["value"] for node in seen if node["role"]["value"] in ("image", "img")]
    assert all(re.search(r"\d", told) for told in pictures if name == "artefacts")  # the data's main numbers


@pytest.mark.parametrize("name", ["artefacts", "reproduction"])
@pytest.mark.parametrize(("width", "scheme"), [(PHONE, "light"), (1280, "dark")])
def test_axe_finds_nothing(
    name: str, scheme: str, width: int, pages: Mapping[str, Path], opened: Open
) -> None:
    from axe_playwright_python.sync_playwright import Axe

    page = opened(pages[name], width, color_scheme=scheme)
    page.evaluate(UNFOLD)
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    assert len(found.response["passes"]) > 20


def test_the_first_stop_of_the_keyboard_leads_past_the_contents(
    pages: Mapping[str, Path], opened: Open
) -> None:
    page = opened(pages["artefacts"])
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the content"
    assert page.locator(".skip").bounding_box()["x"] >= 0
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "content"


def test_all_of_it_is_there_without_scripts(pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages["reproduction"], java_script_enabled=False)
    assert page.locator("h1").inner_text() == "Figure 6 of LogQInit, made again"
    summary = page.locator("summary").first
    table = page.locator("details").first.locator("table")
    assert not table.is_visible()
    summary.click()
    assert table.is_visible()


def test_on_paper_what_is_folded_is_shown_and_the_contents_are_not(
    pages: Mapping[str, Path], opened: Open
) -> None:
    page = opened(pages["reproduction"], color_scheme="dark")
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    assert page.locator("details").first.locator("table").is_visible()
    assert (
        page.locator("body").evaluate("each => getComputedStyle(each).backgroundColor")
        == "rgb(255, 255, 255)"
    )
    assert page.pdf().startswith(b"%PDF")


def test_hostile_words_are_read_and_do_nothing(pages: Mapping[str, Path], opened: Open) -> None:
    page = opened(pages["hostile"])
    assert page.locator("script").count() == 0
    assert page.locator("img").count() == 0
    assert page.locator("text=<script>alert(1)</script>").count() > 0


def _contrast(ink: str, beneath: list[str]) -> float:
    """The ratio of the guidelines between a text's colour and what is beneath it, on white."""
    ground = (255.0, 255.0, 255.0)
    for colour in reversed(beneath):
        *own, opacity = _rgb(colour)
        ground = tuple(
            opacity * part + (1 - opacity) * under for part, under in zip(own, ground, strict=True)
        )  # type: ignore[assignment]
    light, dark = sorted((_luminance(_rgb(ink)[:3]), _luminance(ground)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _rgb(colour: str) -> tuple[float, ...]:
    """Red, green, blue to 255, and opacity to 1."""
    parts = tuple(float(part) for part in re.findall(r"[\d.]+", colour))
    assert colour.startswith("rgb"), colour
    return (*parts[:3], parts[3] if len(parts) > 3 else 1.0)


def _luminance(rgb: tuple[float, ...]) -> float:
    """Relative luminance of sRGB, as the guidelines define it."""
    linear = [
        part / 255 / 12.92 if part / 255 <= 0.04045 else ((part / 255 + 0.055) / 1.055) ** 2.4 for part in rgb
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
