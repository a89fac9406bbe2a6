"""The page on learners has every learner, exploration and schedule with its options, and what it says to type can be typed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from qinit_cli.learners import LEARNERS
from qinit_cli.learners.exploration import EXPLORATIONS
from qinit_cli.options import options
from qinit_cli.pipeline.asked import LearningSources, LearningTargets
from qinit_cli.schedules import KINDS

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "learners.md").read_text()
TYPED = re.findall(r"^qinit .*--(?:learner|explore|alpha|epsilon) .*$", PAGE, re.MULTILINE)


@pytest.mark.parametrize("kind", [*(LEARNERS[name] for name in LEARNERS.own), *EXPLORATIONS.values()])
def test_each_has_a_row_with_its_options_and_their_defaults(kind: Any) -> None:
    rows = [line for line in PAGE.splitlines() if line.startswith("|")]
    assert any(row.startswith(f"| `{kind.name}` |") for row in rows)
    for option in options(kind):
        told = [row for row in rows if f"`{option.name.rstrip('_')}`" in row]
        assert any(str(option.default) in row for row in told), option.name


def test_each_schedule_is_there_as_it_is_written() -> None:
    for kind in KINDS.values():
        assert f"| `{kind.form}` |" in PAGE


@pytest.mark.parametrize("line", TYPED)
def test_what_the_page_says_can_be_typed(line: str) -> None:
    words = line.split()
    found = {
        word.removeprefix("--"): words[place + 1]
        for place, word in enumerate(words)
        if word in ("--learner", "--explore", "--alpha", "--epsilon")
    }
    kind = LearningSources if words[1] == "train-sources" else LearningTargets
    kind(**found)  # type: ignore[arg-type]  # texts, all of them


def test_the_page_types_every_learner() -> None:
    typed = {match for line in TYPED for match in re.findall(r"--learner ([a-z-]+)", line)}
    assert typed == {*LEARNERS.own, "exact"}
