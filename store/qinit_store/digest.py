"""SHA-256 of a task and of a whole artefact, independent of HDF5, chunking, compression and batching.

A column's record is its name, a zero byte, its dtype as numpy writes it ("<f8", "|u1"), a zero byte, its
shape as decimal numbers joined by commas (without the task axis; "" for a scalar), a zero byte, its
little-endian bytes in C order. Then

    task digest  = SHA-256 of "qinit task 1", a zero byte, the id as <i8, and the records of the task's
                   hashed columns in the order of their names;
    content hash = SHA-256 of "qinit content 1", a zero byte, the kind, a zero byte, the canonical JSON of the
                   spec, a zero byte, the number of tasks as <i8, for every task in the order of ids its id
                   as <i8 and its 32-byte digest, and the records of every dataset without a task axis, scales
                   included, in the order of their names.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping

import numpy as np

from qinit_store.schema import DIGEST_BYTES, Array, Column

TASK_TAG = b"qinit task 1\0"
CONTENT_TAG = b"qinit content 1\0"
AT_ONCE = 4096  # tasks whose ids and digests are hashed in one piece


def task_digests(columns: Iterable[Column], ids: Array, rows: Mapping[str, Array]) -> Array:
    """(tasks, 32) u1: the digest of every task over its hashed columns; `rows` have a leading task axis."""
    hashed = sorted((column for column in columns if column.hashed), key=lambda column: column.name)
    values = [np.ascontiguousarray(rows[column.name], dtype=column.little_endian) for column in hashed]
    heads = [
        _head(column.name, column.little_endian, value.shape[1:])
        for column, value in zip(hashed, values, strict=True)
    ]
    digests = np.empty((ids.size, DIGEST_BYTES), dtype=np.uint8)
    for position, number in enumerate(ids):
        digest = hashlib.sha256(TASK_TAG + int(number).to_bytes(8, "little", signed=True))
        for head, value in zip(heads, values, strict=True):
            digest.update(head)
            digest.update(value[position].tobytes())
        digests[position] = np.frombuffer(digest.digest(), dtype=np.uint8)
    return digests


def content_sha256(
    kind: str, spec_json: str, ids: Array, digests: Array, datasets: Mapping[str, Array]
) -> str:
    """Hexadecimal content hash; `ids` and `digests` in any order, `datasets` those without a task axis."""
    digest = hashlib.sha256(CONTENT_TAG + f"{kind}\0{spec_json}\0".encode() + ids.size.to_bytes(8, "little"))
    order = np.argsort(ids, kind="stable")
    for first in range(0, ids.size, AT_ONCE):
        some = order[first : first + AT_ONCE]
        numbers = ids[some].astype("<i8").view(np.uint8).reshape(-1, 8)
        digest.update(np.hstack([numbers, digests[some]]).tobytes())
    for name in sorted(datasets):
        values = np.ascontiguousarray(datasets[name], dtype=datasets[name].dtype.newbyteorder("<"))
        digest.update(_head(name, values.dtype, values.shape))
        digest.update(values.tobytes())
    return digest.hexdigest()


def _head(name: str, dtype: np.dtype[np.generic], shape: tuple[int, ...]) -> bytes:
    return f"{name}\0{dtype.str}\0{','.join(map(str, shape))}\0".encode()
