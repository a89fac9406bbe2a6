from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qinit_cli.pipeline.workers import BATCH, batches, results


@given(st.integers(0, 300), st.integers(1, 9))
def test_batches_hold_every_task_once_in_order(tasks: int, jobs: int) -> None:
    found = batches(np.arange(tasks) * 3, jobs)
    np.testing.assert_array_equal(np.concatenate([np.empty(0, np.int64), *found]), np.arange(tasks) * 3)


@given(st.integers(1, 300), st.integers(1, 9))
def test_batches_are_small_and_as_many_for_one_worker_as_for_another(tasks: int, jobs: int) -> None:
    sizes = [len(batch) for batch in batches(np.arange(tasks), jobs)]
    assert max(sizes) <= BATCH
    assert max(sizes) - min(sizes) <= 1
    assert len(sizes) % jobs == 0 or len(sizes) == tasks


def _double(batch: int) -> int:
    return 2 * batch


def test_every_result_comes_once() -> None:
    with ThreadPoolExecutor(3) as threads:
        found = list(results(threads, lambda: 3, _double, range(50), lambda: False, lambda: None))
    assert sorted(found) == [2 * batch for batch in range(50)]


def test_no_more_than_two_batches_a_worker_are_taken_ahead() -> None:
    gate, taken = threading.Event(), []

    def endless():  # type: ignore[no-untyped-def]
        for batch in range(1_000):
            taken.append(batch)
            yield batch

    def wait_first(batch: int) -> int:
        gate.wait(10)
        return batch

    with ThreadPoolExecutor(2) as threads:
        stop = threading.Event()
        found = results(threads, lambda: 2, wait_first, endless(), stop.is_set, gate.set)
        next(found)
        assert len(taken) <= 2 * 2 + 1
        stop.set()
        list(found)


def test_once_stopped_nothing_new_begins_and_what_runs_is_still_given() -> None:
    stop = threading.Event()
    begun: list[int] = []

    def learn(batch: int) -> int:
        begun.append(batch)
        return batch

    with ThreadPoolExecutor(1) as threads:
        found = []
        for result in results(threads, lambda: 1, learn, range(100), stop.is_set, lambda: None):
            found.append(result)
            stop.set()
    assert sorted(found) == sorted(begun)
    assert len(begun) <= 3


def test_an_exception_of_a_batch_is_raised_and_the_rest_is_cancelled() -> None:
    begun = []

    def learn(batch: int) -> int:
        begun.append(batch)
        raise ArithmeticError(f"batch {batch}")

    with ThreadPoolExecutor(1) as threads, pytest.raises(ArithmeticError, match="batch 0"):
        list(results(threads, lambda: 1, learn, range(100), lambda: False, lambda: None))
    assert len(begun) <= 2


def test_progress_is_looked_at_while_a_batch_runs() -> None:
    gate = threading.Event()

    def learn(batch: int) -> int:
        assert gate.wait(10), "nobody looked"
        return batch

    with ThreadPoolExecutor(1) as threads:
        assert list(results(threads, lambda: 1, learn, [7], lambda: False, gate.set)) == [7]


def test_a_billion_jobs_make_as_many_batches_as_there_are_tasks() -> None:
    assert [batch.tolist() for batch in batches(np.arange(3), 10**9)] == [[0], [1], [2]]
