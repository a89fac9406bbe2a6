"""The settings of an artefact as canonical JSON: what changes the numbers, and nothing else."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

Spec = Mapping[str, Any]

DEEPEST = 32  # of lists and objects in one another; ours have five
LARGEST_WHOLE = 2**128  # of a seed, as numpy draws one


def canonical_json(value: object) -> str:
    """The one JSON text of `value`: sorted keys, no blanks, ASCII; NaN and infinities raise ValueError."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def read_json(text: str) -> Any:
    """What a JSON text of a file holds.

    ValueError for what `canonical_json` never writes: NaN, infinities, whole numbers beyond 128 bits, a key that stands twice,
    text that is no Unicode (names of files may be none), or nesting beyond DEEPEST.
    """
    try:
        value = json.loads(
            text,
            parse_int=_whole,
            parse_float=_finite,
            parse_constant=_refused,
            object_pairs_hook=_object,
        )
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if _depth(value) > DEEPEST:
        raise ValueError("it is nested too deeply")
    # half of a surrogate pair is a UnicodeEncodeError, but for those that stand for bytes in names of files
    json.dumps(value, ensure_ascii=False).encode("utf-8", "surrogateescape")
    return value


def settings(value: Any) -> dict[str, Any]:
    """The value, settings by name; ValueError if it is anything else, or if its number of tasks is none."""
    if not isinstance(value, dict):
        raise ValueError("the settings are no object")
    tasks = value.get("tasks", 0)
    if not isinstance(tasks, int) or isinstance(tasks, bool) or tasks < 0:
        raise ValueError("the number of tasks in its settings is no whole number")
    return value


def texts(value: Any) -> dict[str, str]:
    """The value, texts by name; ValueError if it is anything else."""
    if not isinstance(value, dict) or not all(isinstance(one, str) for one in value.values()):
        raise ValueError("its provenance, or one of its inputs, is no object of texts")
    return value


def _whole(digits: str) -> int:
    if len(digits) > len(str(LARGEST_WHOLE)) or abs(number := int(digits)) >= LARGEST_WHOLE:
        raise ValueError(f"{digits[:20]}... is too large a number")
    return number


def _finite(digits: str) -> float:
    number = float(digits)
    if not math.isfinite(number):
        raise ValueError(f"{digits[:20]} is no finite number")
    return number


def _refused(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number that JSON has")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key stands twice in it")
    return found


def _depth(value: Any) -> int:
    depth, level = 0, [value]
    while level:
        inner = [
            list(one.values()) if isinstance(one, dict) else one
            for one in level
            if isinstance(one, dict | list)
        ]
        depth, level = depth + bool(inner), [part for one in inner for part in one]
    return depth


def spec_sha256(spec: Spec) -> str:
    """Hexadecimal SHA-256 of the canonical JSON of `spec`."""
    return hashlib.sha256(canonical_json(spec).encode("ascii")).hexdigest()


def without_tasks(spec: Spec) -> dict[str, Any]:
    """`spec` but for the number of tasks, on which no single task's result depends."""
    return {name: value for name, value in spec.items() if name != "tasks"}


def difference(asked: Spec, there: Spec) -> str:
    """The first setting that differs, as "group.name: asked for 0.2, there is 0.1"; "" if none does."""
    one, other = json.loads(canonical_json(asked)), json.loads(canonical_json(there))
    return next(_differences(one, other, ""), "")


def _differences(asked: Any, there: Any, name: str) -> Iterator[str]:
    if isinstance(asked, dict) and isinstance(there, dict):
        for key in sorted(asked.keys() | there.keys()):
            yield from _differences(asked.get(key), there.get(key), f"{name}.{key}" if name else key)
    elif canonical_json(asked) != canonical_json(there):
        yield f"{name}: asked for {canonical_json(asked)}, there is {canonical_json(there)}"
