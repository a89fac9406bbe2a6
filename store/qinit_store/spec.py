"""The settings of an artefact as canonical JSON: what changes the numbers, and nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

Spec = Mapping[str, Any]


def canonical_json(value: object) -> str:
    """The one JSON text of `value`: sorted keys, no blanks, ASCII; NaN and infinities raise ValueError."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def spec_sha256(spec: Spec) -> str:
    """Hexadecimal SHA-256 of the canonical JSON of `spec`."""
    return hashlib.sha256(canonical_json(spec).encode("ascii")).hexdigest()


def without_tasks(spec: Spec) -> dict[str, Any]:
    """`spec` but for the number of tasks, on which no single task's result depends."""
    return {name: value for name, value in spec.items() if name != "tasks"}


def difference(asked: Spec, there: Spec) -> str:
    """The first setting that differs, as "learning.alpha: asked for 0.2, there is 0.1"; "" if none does."""
    one, other = json.loads(canonical_json(asked)), json.loads(canonical_json(there))
    return next(_differences(one, other, ""), "")


def _differences(asked: Any, there: Any, name: str) -> Iterator[str]:
    if isinstance(asked, dict) and isinstance(there, dict):
        for key in sorted(asked.keys() | there.keys()):
            yield from _differences(asked.get(key), there.get(key), f"{name}.{key}" if name else key)
    elif canonical_json(asked) != canonical_json(there):
        yield f"{name}: asked for {canonical_json(asked)}, there is {canonical_json(there)}"
