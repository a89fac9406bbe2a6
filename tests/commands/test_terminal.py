"""What a person sees on a terminal of 80 columns, through a pseudo-terminal, and what a pipe gets instead."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from ready import Ready
from running import QINIT, on_terminal

COLOURS = re.compile(r"\x1b\[[0-9;]*(?:3[0-9]|4[0-9]|9[0-7]|10[0-7])(?:;[0-9;]*)?m")
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
LEARN = ("train-sources", "gridworld", "--size", "10", "--tasks", "32", "--episodes", "40000", "--jobs", "2")


def _lines(seen: str) -> list[str]:
    """Every line that was ever drawn, without its escape codes."""
    return [line for line in re.split(r"[\r\n]+", ESCAPES.sub("", seen)) if line.strip()]


@pytest.fixture(scope="module")
def learning(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A stage on a terminal, from its first to its last sign."""
    seen, code = on_terminal(QINIT, LEARN, tmp_path_factory.mktemp("terminal"))
    assert code == 0, seen
    return seen


def test_learning_on_a_terminal_shows_one_bar_with_tasks_and_speed(learning: str) -> None:
    bars = [line for line in _lines(learning) if "━" in line or "/32" in line]
    assert bars
    assert any(re.search(r"\b(16|32)/32\b", line) for line in bars)
    assert any("M steps/s" in line for line in bars)


def test_no_line_of_the_bar_is_wider_than_the_terminal(learning: str) -> None:
    drawn = [line for line in _lines(learning) if "━" in line]
    assert max(map(len, drawn)) <= 80


def test_the_bar_is_gone_when_the_path_is_printed(learning: str) -> None:
    *_, summary, path = _lines(learning)
    assert "32 tasks learned" in learning
    assert path.endswith(".h5")
    assert "━" not in summary + path
    assert "\x1b[?25h" in learning  # the cursor is given back


@pytest.mark.parametrize("env", [{"NO_COLOR": "1"}, {"TERM": "dumb"}], ids=str)
def test_colour_is_left_out_where_the_surroundings_say_so(
    env: dict[str, str], pipeline: Any, tmp_path: Path, ready: Ready
) -> None:
    for words in (("compare", *pipeline.runs.values()), ("list", "--store", pipeline.store)):
        seen, code = on_terminal(ready.qinit, words, tmp_path, env)
        assert code == 0, seen
        assert not COLOURS.search(seen)
    if "TERM" in env:
        assert "\x1b" not in seen


def test_colour_is_left_out_of_the_bar_with_color_never(tmp_path: Path, ready: Ready) -> None:
    seen, code = on_terminal(ready.qinit, (*LEARN, "--color", "never"), tmp_path)
    assert code == 0, seen
    assert not COLOURS.search(seen)


def test_a_dumb_terminal_gets_no_bar_drawn_over_itself(tmp_path: Path, ready: Ready) -> None:
    seen, code = on_terminal(ready.qinit, LEARN, tmp_path, {"TERM": "dumb"})
    assert code == 0, seen
    assert "\x1b" not in seen


def test_a_table_on_a_terminal_fits_its_eighty_columns(pipeline: Any, tmp_path: Path, ready: Ready) -> None:
    seen, code = on_terminal(ready.qinit, ("compare", *pipeline.runs.values()), tmp_path)
    assert code == 0, seen
    lines = _lines(seen)
    assert max(map(len, lines)) <= 80
    assert any("logqinit-median" in line for line in lines)
    assert "conditional on this source set" in " ".join(lines)


def test_in_a_pipe_nothing_is_coloured_and_no_bar_is_drawn(qinit: Any, pipeline: Any) -> None:
    ended = qinit(*LEARN, "-o", "a.h5")
    assert ended.code == 0
    assert "\x1b" not in ended.out + ended.err
    assert "━" not in ended.err
    assert "\r" not in ended.err
    ended = qinit("compare", *pipeline.runs.values())
    assert "\x1b" not in ended.out + ended.err


@pytest.mark.parametrize("colour", ["never", "auto"])
def test_a_table_in_a_pipe_has_colour_only_where_always_is_asked_for(
    colour: str, here: Any, pipeline: Any
) -> None:
    words = ("compare", *pipeline.runs.values(), "--format", "table")
    assert "\x1b" not in here(*words, "--color", colour).out
    assert "\x1b" in here(*words, "--color", "always").out


def test_quiet_draws_no_bar(tmp_path: Path, ready: Ready) -> None:
    seen, code = on_terminal(ready.qinit, (*LEARN, "-q"), tmp_path)
    assert code == 0
    [path] = _lines(seen)
    assert path.endswith(".h5")
