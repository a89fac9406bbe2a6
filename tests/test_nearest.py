"""A name that nothing has comes with the nearest, else with what there is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from qinit_cli.nearest import nearest

if TYPE_CHECKING:
    from running import Ended, Pipeline


def test_a_slip_of_the_hand_gets_the_name_that_was_meant() -> None:
    assert nearest("maxqnit", ["zero", "maxqinit"]) == "did you mean maxqinit?"


def test_a_name_like_nothing_gets_what_there_is() -> None:
    assert nearest("basil", ["mint", "dill"]) == "it is one of mint, dill"


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["transfer", "ptrs", "-", "--init", "logqinit-medan"], "did you mean logqinit-median?"),
        (["train-sources", "gridworld", "--goals", "unifrom"], "'normal', 'uniform'"),
    ],
)
def test_an_option_s_misspelt_value_is_answered_with_the_nearest(
    here: Callable[..., Ended], arguments: list[str], meant: str
) -> None:
    ended = here(*arguments)
    assert ended.code == 2
    assert meant in ended.err


def test_a_misspelt_shift_is_answered_with_the_nearest(
    pipeline: Pipeline, here: Callable[..., Ended]
) -> None:
    ended = here("transfer", "zero", pipeline.fit, "--shift", "varianse=10")
    assert ended.code == 2
    assert "gridworld has no varianse; did you mean variance?" in ended.err
