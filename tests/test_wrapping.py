"""Sentences on a terminal are broken between words, and what is to be copied is whole."""

from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qinit_cli.wrapping import columns, wrapped


class Terminal(io.StringIO):
    """A stream that goes to a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def forty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")


SENTENCE = "qinit fit: there is no such thing as sources.h5 in the store of this folder; qinit list shows what there is"


def test_in_a_pipe_a_sentence_is_one_line() -> None:
    assert wrapped(SENTENCE, io.StringIO()) == SENTENCE


def test_on_a_terminal_no_line_is_wider_and_no_word_is_broken() -> None:
    lines = wrapped(SENTENCE, Terminal()).split("\n")
    assert len(lines) > 2
    assert max(map(len, lines)) <= 40
    assert " ".join(lines) == SENTENCE


@pytest.mark.parametrize(
    ("sentence", "command"),
    [
        (
            "ucoi was chosen among six; qinit transfer ucoi FIT --tuned a.h5 takes it",
            "qinit transfer ucoi FIT --tuned a.h5",
        ),
        ("--dask needs another package: pip install -e '.[dask]'", "pip install -e '.[dask]'"),
        (
            "finish what is unfinished with `qinit train-sources gridworld -o a.h5`",
            "`qinit train-sources gridworld -o a.h5`",
        ),
        (
            "no scheduler answers: dask scheduler --scheduler-file s.json",
            "dask scheduler --scheduler-file s.json",
        ),
        (
            "far too long for one line; see qinit train-sources gridworld --help",
            "qinit train-sources gridworld --help",
        ),
    ],
)
def test_a_command_stays_on_one_line(sentence: str, command: str) -> None:
    told = wrapped(sentence, Terminal())
    assert command in told
    assert told.replace("\n", " ") == sentence


def test_words_that_go_on_behind_a_command_may_be_broken() -> None:
    told = wrapped("it is not there, and qinit list shows what there is in the store now", Terminal())
    assert "\n" in told
    assert max(map(len, told.split("\n"))) <= 40


def test_a_path_that_is_wider_than_the_terminal_is_left_whole() -> None:
    path = "/a/very/long/folder/that/no/terminal/can/show/sources.h5"
    assert path in wrapped(f"there is no {path} here", Terminal()).split("\n")


def test_lines_that_were_given_stay_lines() -> None:
    assert wrapped("one\n  two", Terminal()) == "one\n  two"


@given(st.text(st.characters(codec="utf-8", exclude_characters="\n"), max_size=200))
def test_nothing_but_blanks_becomes_the_end_of_a_line(text: str) -> None:
    assert wrapped(text, Terminal()).replace("\n", " ") == text


def test_a_stream_that_goes_to_no_terminal_has_no_width() -> None:
    assert columns(io.StringIO()) is None
    assert columns(Terminal()) == 40
