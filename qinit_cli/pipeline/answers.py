"""What a worker of a cluster answers, as plain bytes: nothing in it is run, and the head checks all of it against what it asked.

    b"qinit/1\\n", length of the JSON (8 bytes), JSON, columns

The JSON holds the ids of the tasks that were learned and what failed. Of each column of the schema, in its order, stand as
many rows as there are such ids, in the column's own dtype; so neither side says what the other knows.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.pipeline.workers import Outcome

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_store.schema import Column, Schema

MAGIC = b"qinit/1\n"
LENGTH = 8  # bytes of the number that says how long the JSON is
MOST_WORDS = 2_000  # characters of what a worker says of a failure


class Unfit(Exception):
    """An answer to something that was not asked, or none at all; the message says what is wrong with it."""


class WorkerFailed(Exception):
    """A batch failed on a worker; the message holds the type and the words of its error."""


def packed(outcome: Outcome, schema: Schema) -> bytes:
    """The outcome as bytes. ValueError where its columns are not those of the schema."""
    from qinit_store.encoding import checked

    failures = [[task, words] for task, words in outcome.failures]
    said = json.dumps({"ids": outcome.ids.tolist(), "failures": failures}).encode()
    count = len(outcome.ids)
    rows = checked(schema, schema.task_columns, outcome.rows, count) if count else {}
    content = b"".join(rows[column.name].tobytes() for column in _given(schema)) if count else b""
    return b"".join((MAGIC, len(said).to_bytes(LENGTH, "little"), said, content))


def opened(answer: Any, batch: Integers, schema: Schema, *, whole: bool) -> Outcome:
    """The outcome in an answer to this batch; Unfit unless it is about its tasks, each once, and if `whole` all of them."""
    said, content = _parts(answer)
    ids, failures = _ids(said.get("ids")), _failures(said.get("failures"))
    _check_tasks([*ids, *(task for task, _ in failures)], batch.tolist(), whole=whole)
    return Outcome(_array(ids), _rows(content, len(ids), schema) if ids else _no_rows(content), failures)


def _parts(answer: Any) -> tuple[dict[str, Any], memoryview]:
    begin = len(MAGIC) + LENGTH
    if not isinstance(answer, bytes) or not answer.startswith(MAGIC) or len(answer) < begin:
        raise Unfit(f"it answered {type(answer).__name__}, not in the form of an answer")
    end = begin + int.from_bytes(answer[len(MAGIC) : begin], "little")
    try:
        said = json.loads(answer[begin:end])
    except (ValueError, RecursionError) as error:
        raise Unfit("it answered with JSON that cannot be read") from error
    if not isinstance(said, dict):
        raise Unfit("it answered without saying for which tasks")
    return said, memoryview(answer)[end:]


def _ids(found: Any) -> list[int]:
    if not isinstance(found, list) or not all(type(task) is int for task in found):
        raise Unfit("it answered with ids that are no numbers")
    return found


def _failures(found: Any) -> tuple[tuple[int, str], ...]:
    if not isinstance(found, list):
        raise Unfit("it answered with failures that are no list")
    failures = []
    for failure in found:
        match failure:
            case [int(task), str(words)] if type(task) is int:
                failures.append((task, " ".join(words[:MOST_WORDS].split())))
            case _:
                raise Unfit("it answered with a failure without a task or words")
    return tuple(failures)


def _check_tasks(found: list[int], asked: list[int], *, whole: bool) -> None:
    if strange := sorted(set(found) - set(asked)):
        raise Unfit(f"it answered for task {strange[0]}, which it was not asked for")
    if len(set(found)) < len(found):
        raise Unfit("it answered twice for a task")
    if whole and len(found) < len(asked):
        raise Unfit(f"it answered for {len(found)} of the {len(asked)} tasks that it was asked for")


def _rows(content: memoryview, count: int, schema: Schema) -> dict[str, Any]:
    shapes = {column.name: (count, *schema.row_shape(column)) for column in _given(schema)}
    sizes = {
        column.name: int(np.prod(shapes[column.name], dtype=np.int64)) * column.little_endian.itemsize
        for column in _given(schema)
    }
    if content.nbytes != sum(sizes.values()):
        raise Unfit(f"it answered {content.nbytes} bytes for {count} tasks of {schema.task_bytes} bytes")
    rows, begin = {}, 0
    for column in _given(schema):
        raw = content[begin : begin + sizes[column.name]]
        rows[column.name] = np.frombuffer(raw, column.little_endian).reshape(shapes[column.name])
        begin += sizes[column.name]
    if fault := schema.fault(rows):
        raise Unfit(f"it answered that {fault}")
    return rows


def _no_rows(content: memoryview) -> dict[str, Any]:
    if content.nbytes:
        raise Unfit(f"it answered {content.nbytes} bytes for no task")
    return {}


def _given(schema: Schema) -> list[Column]:
    return [column for column in schema.task_columns if column.given]


def _array(ids: list[int]) -> Integers:
    return np.array(ids, dtype=np.int64)
