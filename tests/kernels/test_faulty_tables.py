"""Tables that no kernel may see: each is refused with the place of its first fault."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.windy_gridworld import WindyGridworld
from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.tables import Tables
from qinit_cli.seeding import Stream

TASKS, STATES, ACTIONS = 2, 3, 2


def sound() -> dict[str, Any]:
    """Two tasks of three states: a step stays or goes on, half of the time each; from the last state to the goal."""
    after = np.zeros((TASKS, STATES, ACTIONS, 2), np.int32)
    after[:, :, :, 0], after[:, :, :, 1] = np.arange(3)[:, None], np.array([1, 2, -1])[:, None]
    start = np.zeros((TASKS, STATES))
    start[:, 0] = 1
    return {
        "after": after,
        "probability": np.full(after.shape, 0.5),
        "start": start,
        "open": np.ones((TASKS, STATES), bool),
    }


def changed(name: str, place: tuple[int, ...], value: float) -> Callable[[dict[str, Any]], None]:
    def change(arrays: dict[str, Any]) -> None:
        arrays[name][place] = value

    return change


def another(name: str, made: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    def change(arrays: dict[str, Any]) -> None:
        arrays[name] = made(arrays[name])

    return change


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            changed("after", (1, 2, 0, 1), 3),
            "action 0 in state 2 of task 1 of the batch leads to state 3, of 3 states",
        ),
        (changed("after", (0, 1, 1, 0), -3), "action 1 in state 1 of task 0 of the batch leads to state -3"),
        (
            changed("probability", (0, 1, 1, 0), np.nan),
            "action 1 in state 1 .* has an outcome of probability nan",
        ),
        (changed("probability", (0, 1, 1, 0), np.inf), "has an outcome of probability inf"),
        (
            changed("probability", (1, 0, 0, 1), -0.5),
            "has an outcome of probability -0.5, which is not within 0 and 1",
        ),
        (
            changed("probability", (1, 0, 0, 1), 0.25),
            "action 0 in state 0 of task 1 .* probabilities sum to 0.75, not 1",
        ),
        (changed("start", (1, 0), 0.0), "where task 1 of the batch starts sum to 0, not 1"),
        (changed("start", (1, 0), np.nan), "task 1 of the batch starts in state 0 with probability nan"),
        (changed("start", (0, 2), -1.0), "task 0 of the batch starts in state 2 with probability -1"),
        (
            changed("open", (1, slice(None)), False),
            "task 1 of the batch has no state in which its episodes go on",
        ),
        (another("start", lambda start: start[:, :2]), "have the shapes"),
        (another("probability", lambda probability: probability[..., :1]), "have the shapes"),
        (another("after", lambda after: after.astype(float)), "are of float64 and bool, not of integers"),
        (another("open", lambda open: open.astype(float)), "are of int32 and float64"),
        (
            lambda arrays: arrays.update({n: arrays[n][..., :0] for n in ("after", "probability")}),
            "probabilities sum to 0, not 1",
        ),
    ],
)
def test_a_faulty_table_is_refused_where_it_is_faulty(change: Any, told: str) -> None:
    arrays = sound()
    Tables(**arrays)
    change(arrays)
    with pytest.raises(NotAllowed, match=told):
        Tables(**arrays)


def test_more_states_than_a_place_has_bits_for_are_refused() -> None:
    shape = (1, 2**24 - 2, 1, 1)  # two places more are the goal's and that of being lost
    with pytest.raises(NotAllowed, match="16777214 states are more than the 16777213 that a table may have"):
        Tables(
            np.broadcast_to(np.int32(0), shape),
            np.broadcast_to(1.0, shape),
            np.broadcast_to(1.0, shape[:2]),
            np.broadcast_to(True, shape[:2]),
        )


def test_no_tasks_and_rows_in_which_nobody_acts_are_no_fault() -> None:
    Tables(**{name: values[:0] for name, values in sound().items()})
    arrays = sound()
    arrays["open"][:, 2] = False
    arrays["probability"][:, 2] = 0
    Tables(**arrays)


def test_tables_of_other_states_than_the_familys_are_refused() -> None:
    class Short(WindyGridworld):
        def tables(self, tasks: Any) -> Tables:
            whole = super().tables(tasks)
            return Tables(whole.after[:1], whole.probability[:1], whole.start[:1], whole.open[:1])

    family = Short(size=4)
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(2))
    with pytest.raises(
        NotAllowed, match=r"tables of \(1, 16, 4\) tasks, states and actions, where there are \(2, 16, 4\)"
    ):
        family.solve(tasks, 0.9)
