"""Forged artefacts: small sound ones with one thing changed, and every digest made to hold again.

What is changed is drawn from a seed: a setting, what tells the origin, an input, an attribute, an axis or a number of a column.
"""

from __future__ import annotations

import hashlib
import json
import math
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from qinit_store.digest import content_sha256, task_digests
from qinit_store.reading import open_doubtful
from qinit_store.schema import TASK_DIGEST
from qinit_store.spec import canonical_json

LIBVER = ("v110", "v110")
NUMBERS = (0, -1, -5, 1, 2, 7, 36, 0.5, -0.5, 1_000_000, 2**31, 2**63 - 1, 1e-300, 1e308, 10**30)
OTHERS = (None, True, "", "x", [], [1], {}, {"name": 1}, "é" * 200, "\ud800", "1e999", "NaN")
RAW = ("NaN", "Infinity", "-Infinity", "1e999", "[" * 2000 + "]" * 2000, '{"a":1,"a":2}', "1" * 5000)
REALS = (math.nan, math.inf, -math.inf, 1e308, -1e308, -3.0, -1e-3, 7.0, 1e6)
WHOLE = (-(2**31), -5, -2, 7, 36, 1_000_000, 2**31 - 1)


def forge(sound: Path, path: Path, seed: int) -> str:
    """Writes at `path` the artefact at `sound` with what the seed draws changed, its digests made to hold; what was changed."""
    probability = random.Random(seed)
    shutil.copy(sound, path)
    change = probability.choices(
        (_setting, _column, _provenance, _inputs, _attribute, _axis, _removed), (8, 8, 1, 1, 1, 2, 1)
    )[0]
    with h5py.File(path, "r+", libver=LIBVER) as file:
        told = change(file, probability)
    mend(path)
    return told


def put(sound: Path, path: Path, name: str, where: Any, value: Any) -> Path:
    """Writes at `path` the artefact at `sound` with another value in a dataset, its digests made to hold."""
    shutil.copy(sound, path)
    with h5py.File(path, "r+", libver=LIBVER) as file:
        values = file[name][...]
        values[where] = value
        file[name][...] = values
    mend(path)
    return path


def settle(sound: Path, path: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    """Writes at `path` the artefact at `sound` with settings that were changed in place, its digests made to hold."""
    shutil.copy(sound, path)
    with h5py.File(path, "r+", libver=LIBVER) as file:
        spec = json.loads(file.attrs["spec_json"])
        change(spec)
        give(file, "spec_json", json.dumps(spec, sort_keys=True, separators=(",", ":")))
    mend(path)
    return path


def mend(path: Path) -> None:
    """Makes every digest hold for what now stands in the file, as far as it can be read."""
    try:
        with open_doubtful(path) as artefact:
            kind, schema, ids, spec = artefact.kind, artefact.schema, artefact.tasks, artefact.spec
            with h5py.File(path, "r") as file:
                values = {column.name: file[column.name][...] for column in schema.columns}
    except Exception:  # damaged beyond what digests say: it stays so
        return
    spec_json = canonical_json(spec)
    statics = {axis.name: axis.values for axis in schema.axes}
    statics |= {column.name: values[column.name] for column in schema.static_columns}
    digests = np.empty((0, 32), np.uint8)
    if schema.task_columns:
        digests = task_digests(schema.task_columns, ids, values)
    with h5py.File(path, "r+", libver=LIBVER) as file:
        if schema.task_columns:
            file[TASK_DIGEST][...] = digests
        give(file, "spec_sha256", _sha(spec_json))
        give(file, "content_sha256", content_sha256(kind, spec_json, ids, digests, statics))
        file.attrs["tasks"] = np.int64(ids.size)


def give(file: Any, name: str, text: str | bytes) -> None:
    """An attribute of fixed-length text."""
    raw = text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")
    file.attrs[name] = np.array(raw, dtype=h5py.string_dtype("utf-8", max(1, len(raw))))


def _sha(text: str) -> str:
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _setting(file: Any, probability: random.Random) -> str:
    spec = json.loads(file.attrs["spec_json"])
    places = list(_places(spec))
    above, key, path = probability.choice(places)
    return _changed(file, "spec_json", spec, above, key, path, probability)


def _changed(
    file: Any, name: str, whole: Any, above: Any, key: Any, path: str, probability: random.Random
) -> str:
    match probability.randrange(6):
        case 0:
            del above[key]
            told = f"{path} removed"
        case 1 if isinstance(above, dict):
            above[probability.choice(("extra", "name", "kind", "size"))] = probability.choice(
                (*NUMBERS, *OTHERS)
            )
            told = f"something added beside {path}"
        case 2:
            above[key] = probability.choice(NUMBERS)
            told = f"{path} = {above[key]!r}"
        case 3:
            raw = probability.choice(RAW)
            above[key] = "@raw@"
            give(file, name, json.dumps(whole).replace('"@raw@"', raw))
            return f"{path} = {raw[:20]}"
        case _:
            above[key] = probability.choice((*NUMBERS, *OTHERS))
            told = f"{path} = {above[key]!r}"
    give(file, name, json.dumps(whole, sort_keys=True, separators=(",", ":")))
    return f"{name}: {told}"


def _places(value: Any, path: str = "") -> Iterator[tuple[Any, Any, str]]:
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in list(parts):
        yield value, key, f"{path}.{key}"
        yield from _places(inner, f"{path}.{key}")


def _column(file: Any, probability: random.Random) -> str:
    names = [
        name for name in file if name != TASK_DIGEST and file[name].size and not _is_axis(file[name], name)
    ]
    dataset = file[probability.choice(names)]
    values = dataset[...]
    value = probability.choice(REALS if values.dtype.kind == "f" else WHOLE)
    with np.errstate(all="ignore"):
        cast = np.array(value).astype(values.dtype)
    where = tuple(probability.randrange(length) for length in values.shape)
    values[... if probability.random() < 0.3 else where] = cast
    dataset[...] = values
    return f"{dataset.name}{list(where)} = {cast}"


def _is_axis(dataset: Any, name: str) -> bool:
    return dataset.attrs.get("dims") == name.encode()


def _axis(file: Any, probability: random.Random) -> str:
    names = [name for name in file if _is_axis(file[name], name) and file[name].size]
    dataset = file[probability.choice(names)]
    values = dataset[...]
    if values.dtype.kind == "S":
        values[0] = probability.choice((b"\xff", b"", b"up"))
    else:
        value = probability.choice(REALS if values.dtype.kind == "f" else WHOLE)
        with np.errstate(all="ignore"):
            values[probability.randrange(values.size)] = np.array(value).astype(values.dtype)
    dataset[...] = values
    return f"axis {dataset.name} = {values[:6]}"


def _provenance(file: Any, probability: random.Random) -> str:
    whole = json.loads(file.attrs["provenance_json"])
    key = probability.choice(list(whole))
    return _changed(file, "provenance_json", whole, whole, key, f".{key}", probability)


def _inputs(file: Any, probability: random.Random) -> str:
    raw = probability.choice(
        ("[]", "{}", "[1]", '[{"role":1}]', '[{"role":"fit","name":"x"}]', "null", "NaN")
    )
    give(file, "inputs_json", raw)
    return f"inputs = {raw}"


def _attribute(file: Any, probability: random.Random) -> str:
    name = probability.choice(list(file.attrs))
    value = probability.choice(
        (np.int64(-1), np.int64(2**62), np.float64(math.nan), np.float64(math.inf), "", "x")
    )
    if isinstance(value, str):
        give(file, name, value)
    else:
        file.attrs[name] = value
    return f"attribute {name} = {value!r}"


def _removed(file: Any, probability: random.Random) -> str:
    name = probability.choice([name for name in file if not _is_axis(file[name], name)])
    del file[name]
    return f"{name} removed"
