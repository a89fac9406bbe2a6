"""What a study says ahead, in units that people read."""

from __future__ import annotations

import pytest

from qinit_cli.study.ahead import duration


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(119, "119 s"), (120, "2.0 min"), (7199, "120.0 min"), (7200, "2.0 h"), (36e6, "10,000.0 h")],
)
def test_a_duration_has_the_largest_unit_of_which_there_are_two(seconds: float, said: str) -> None:
    assert duration(seconds) == said
