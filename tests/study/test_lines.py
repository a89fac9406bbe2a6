"""Lines of keys and tables, against those counted by hand."""

from __future__ import annotations

import pytest

from qinit_cli.study.lines import KeyPlace, lines

TEXT = '''\
# [not.a.table] and key = 1 in a comment
title = "a [bracket] and a # mark"

[study]   # a comment with ] and "
question = """
[[distribution]]
looks = "like keys"
"""
baseline = 'zero'

[[distribution]]
family = "gridworld"
variance = [
    1,  # with a bracket [ here
    3,
]
sources.tasks = 4
"quoted key" = 1

[[distribution]]
  family = 'mountain-car'

[distribution.sources]
seed = 3

[[plot]]
select = [
    { methods = ["zero"] },
]
kind = "curves"

[scale."very quick".goals]
targets = { tasks = 2 }
'''
COUNTED: list[tuple[KeyPlace, int]] = [
    (("title",), 2),
    (("study",), 4),
    (("study", "question"), 5),
    (("study", "baseline"), 9),
    (("distribution", 0), 11),
    (("distribution", 0, "family"), 12),
    (("distribution", 0, "variance"), 13),
    (("distribution", 0, "sources", "tasks"), 17),
    (("distribution", 0, "quoted key"), 18),
    (("distribution", 1), 20),
    (("distribution", 1, "family"), 21),
    (("distribution", 1, "sources"), 23),
    (("distribution", 1, "sources", "seed"), 24),
    (("plot", 0), 26),
    (("plot", 0, "select"), 27),
    (("plot", 0, "kind"), 30),
    (("scale", "very quick", "goals"), 32),
    (("scale", "very quick", "goals", "targets"), 33),
]


@pytest.mark.parametrize(("place", "line"), COUNTED)
def test_each_table_and_key_has_the_line_it_stands_in(place: KeyPlace, line: int) -> None:
    assert lines(TEXT)[place] == line


def test_nothing_else_is_taken_for_a_key() -> None:
    assert set(lines(TEXT)) == {place for place, _ in COUNTED}


def test_lines_of_windows_are_counted_alike() -> None:
    assert lines(TEXT.replace("\n", "\r\n")) == lines(TEXT)
