"""The page's HTML: whole, in order, the same each time, and nothing of what it tells can act in it."""

from __future__ import annotations

import re
from html.parser import HTMLParser

from qinit_cli.report.content import (
    Cell,
    Figure,
    Folded,
    Judgement,
    Page,
    PageColumn,
    Pairs,
    Points,
    Section,
    Subheading,
    Table,
    Text,
)
from qinit_cli.report.page import MARK, html

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 252 180"><path d="M 0 0"/></svg>'
HOSTILE = (
    """</title></style></script><script>alert(1)</script><img src=x onerror='alert(1)'>"&amp;{{ 7 * 7 }}"""
)
VOID = {"meta", "link", "img", "br", "hr", "input"}


def whole(words: str) -> Page:
    """A page with every kind of block, all of it these words."""
    columns = [PageColumn(words), PageColumn(words, numeric=True), PageColumn(words, code=True)]
    table = Table(words, columns, [[Cell(words), Cell(words, words), Cell(words, "", "good")]], [words])
    blocks = [
        Text(words),
        Points([words]),
        Subheading(words),
        Pairs([(words, words)]),
        table,
        Figure(words, words, words, SVG),
        Judgement(words, Cell(words, tone="bad"), [(words, words)], Table(words, columns, [])),
        Folded(words, [Text(words), Table(words, columns, [])]),
    ]
    return Page(words, words, [Section("one", words, blocks), Section("two", words, [Text(words)])], words)


class Elements(HTMLParser):
    """Every element in order, refusing one that is not closed where it should be."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def elements(text: str) -> Elements:
    parser = Elements()
    parser.feed(text)
    parser.close()
    assert not parser.open
    return parser


def test_every_element_is_closed_and_every_reference_leads_somewhere() -> None:
    found = elements(html(whole("words"))).found
    ids = [attributes["id"] for _, attributes in found if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = {str(attributes["href"]).removeprefix("#") for tag, attributes in found if tag == "a"}
    assert links == {"content", "one", "two"}
    named = {name for _, told in found for name in (told.get("aria-labelledby") or "").split()}
    assert named
    assert (links | named) <= set(ids)


def test_hostile_words_are_told_and_do_nothing() -> None:
    page = html(whole(HOSTILE))
    parser = elements(page)
    names = {tag for tag, _ in parser.found}
    assert not names & {"script", "img", "iframe", "object", "link", "base", "form"}
    assert not any(name.startswith("on") for _, attributes in parser.found for name in attributes)
    assert "".join(parser.text).count(HOSTILE) > 20


def test_hostile_words_change_no_element() -> None:
    names = [tag for tag, _ in elements(html(whole("words"))).found]
    assert [tag for tag, _ in elements(html(whole(HOSTILE))).found] == names


def test_nothing_is_loaded_or_run() -> None:
    page = html(whole("words"))
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    rules = {rule.split()[0]: rule.split()[1:] for rule in policy[1].split(";")}
    assert rules["default-src"] == ["'none'"]
    assert rules["img-src"] == ["data:"]
    assert "script-src" not in rules
    assert not re.search(r"""\b(?:src|href|srcset|action|poster)\s*=\s*["'](?!#)""", page)
    assert not re.search(r"url\(|@import|https?:", page)


def test_the_policy_stands_before_all_that_it_forbids() -> None:
    page = html(whole("words"))
    assert page.index("Content-Security-Policy") < page.index("<title>") < page.index("<style>")


def test_the_page_says_at_once_who_made_it() -> None:
    assert MARK in html(whole("words"))[:200]


def test_tables_and_figures_are_numbered_as_they_are_read() -> None:
    page = html(whole("words"))
    assert re.findall(r"<b>Table (\d+)\.", page) == ["1", "2", "3"]
    assert re.findall(r"<b>Figure (\d+)\.", page) == ["1"]


def test_equal_pictures_have_numbers_of_their_own() -> None:
    same = [Figure("same", "same", "same", SVG) for _ in range(3)]
    page = html(Page("", "", [Section("one", "", same)], ""))
    assert re.findall(r"<b>Figure (\d+)\.", page) == ["1", "2", "3"]


def test_a_table_says_what_its_rows_and_columns_are() -> None:
    found = elements(html(whole("words"))).found
    assert {told.get("scope") for tag, told in found if tag == "th"} == {"col", "row"}
    tags = [tag for tag, _ in found]
    assert tags.count("caption") == tags.count("table") == 3


def test_the_same_content_gives_the_same_bytes() -> None:
    assert html(whole("words")) == html(whole("words"))


def test_a_number_and_its_per_cent_stay_on_one_line() -> None:
    assert "95\N{NO-BREAK SPACE}% of" in html(whole("95 % of"))


def test_there_is_one_first_heading() -> None:
    assert [tag for tag, _ in elements(html(whole("words"))).found].count("h1") == 1
