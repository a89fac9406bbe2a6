"""Which tasks are saved, and where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from qinit_store.saved import PLACE, SavedTasks


def digests_of(ids):
    return np.repeat(np.asarray(ids, dtype=np.uint8)[:, np.newaxis], 32, axis=1)


@pytest.fixture
def three_parts():
    saved = SavedTasks()
    for name, ids in (("a", [7, 3]), ("b", [0]), ("c", [5, 1, 4])):
        saved.add(Path(name), np.array(ids), digests_of(ids))
    return saved


def test_ids_ascend_whatever_the_order_of_parts(three_parts):
    assert three_parts.ids.tolist() == [0, 1, 3, 4, 5, 7]
    assert len(three_parts) == 6


def test_tasks_are_known_by_their_ids(three_parts):
    assert three_parts.known(np.array([-1, 0, 2, 7, 8])).tolist() == [False, True, False, True, False]
    assert three_parts.known(np.empty(0, np.int64)).tolist() == []
    assert SavedTasks().known(np.array([0])).tolist() == [False]


def test_each_task_is_found_in_its_file_and_row(three_parts):
    found = {
        str(path): (at.tolist(), rows.tolist())
        for path, at, rows in three_parts.by_path(np.array([1, 3, 4, 7]))
    }
    assert found == {"a": ([1, 3], [1, 0]), "c": ([0, 2], [1, 2])}
    assert three_parts.paths(np.array([0, 3])) == [Path("a"), Path("b")]


def test_digests_come_in_the_order_asked_for(three_parts):
    assert np.array_equal(three_parts.digests(np.array([5, 0, 7])), digests_of([5, 0, 7]))
    assert three_parts.digests(np.empty(0, np.int64)).shape == (0, 32)
    assert SavedTasks().ids.size == 0
    assert SavedTasks().digests(np.empty(0, np.int64)).shape == (0, 32)


def test_tasks_are_counted_by_the_files_that_are_there(three_parts):
    assert three_parts.count({Path("a"), Path("c"), Path("elsewhere")}) == 5


def test_many_small_parts_in_any_order_are_as_one_and_few_runs():
    order = np.random.default_rng(0).permutation(3000)
    saved = SavedTasks()
    for number in order.tolist():
        assert not saved.known(np.array([number])).any()
        saved.add(Path(str(number)), np.array([number]), digests_of([number % 251]))
    assert len(saved._runs) <= 12  # each more than twice as long as the next
    assert saved.known(np.arange(3001)).tolist() == [True] * 3000 + [False]
    assert saved.ids.tolist() == list(range(3000))
    assert np.array_equal(saved.digests(order), digests_of(order % 251))


def test_a_task_takes_48_bytes():
    assert PLACE.itemsize == 48
