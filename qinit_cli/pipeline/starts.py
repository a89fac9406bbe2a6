"""The start table of a method as a target would get it, and the files that hold one."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from qinit_cli.environments import Family
from qinit_cli.environments.tiled import PROBES, WEIGHTS, TiledFamily
from qinit_cli.errors import NotAllowed
from qinit_cli.methods import Method
from qinit_cli.pipeline.knowledge import Knowledge

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats


@dataclass(frozen=True)
class StartTable:
    """First values of a target: filled where no source knows them, clipped to [0, 1]."""

    start: Floats  # (*states, A)
    axes: Mapping[str, Any]  # the labels of each axis, texts or numbers, in order
    low: Floats  # (D,) where the first bin of each state axis begins, NaN where that is unknown
    high: Floats  # (D,) where the last one ends
    about: Mapping[str, str | float]  # method, fit, family and discount, as a file tells them
    filled: int
    clipped: int
    tiles: Mapping[
        str, Any
    ]  # by tiles `weights` (T, A), `probes` (P, D), `tilings` and `tiles`; else nothing


def start_table(known: Knowledge, method: Method) -> StartTable:
    """The table of a method for the family of the fit; NotAllowed for a method that reads the target itself."""
    family = known.family
    initial = method.initial_of_all(known.fit, family, known.learning)
    axes = {axis.name: _labels(axis.values) for axis in family.axes()}
    low, high = np.array(family.covers(), np.float64).T.copy()
    return StartTable(
        start=initial.start.reshape(*family.shape, -1),
        axes=axes | {"action": np.array(family.actions)},
        low=low,
        high=high,
        about={
            "method": method.label,
            "fit": known.content_sha256,
            "family": family.label,
            "gamma": known.learning.gamma,
        },
        filled=initial.filled,
        clipped=initial.clipped,
        tiles=_tiles(family, initial.start),
    )


def _tiles(family: Family, start: Floats) -> dict[str, Any]:
    """What makes values at probes a function of continuous states; nothing for tables."""
    if not isinstance(family, TiledFamily):
        return {}
    return {
        WEIGHTS: family.to_weights(start),
        PROBES: family.projection.probes,
        "tilings": np.array(family.cut.tilings),
        "tiles": np.array(family.cut.tiles),
    }


def encoded(table: StartTable, ending: str) -> bytes:
    """The bytes of a file with this ending; the same table gives the same bytes.

    .npy: `start` alone. .npz: `start`, its axes by name, `low`, `high`, method, fit (content hash), family and gamma; by tiles
    `weights`, `probes`, `tilings` and `tiles` too. .csv: a row for each entry, the labels of its axes first. .h5: `start` with
    its axes as dimension scales, the arrays of tiles as datasets, and the rest as attributes.
    NotAllowed for .npz where a state axis has the name of another array.
    """
    if ending == ".csv":
        return _csv(table)
    buffer = io.BytesIO()
    if ending == ".npy":
        np.save(buffer, table.start)
    elif ending == ".npz":
        others = {"start": table.start, **_beside(table)}
        if taken := sorted(others.keys() & table.axes.keys()):
            raise NotAllowed(
                f"the state axis {taken[0]} has the name of another array of the .npz; write .h5 or .csv instead"
            )
        arrays = {"start": others.pop("start"), **table.axes, **others}
        np.savez_compressed(buffer, allow_pickle=False, **arrays)
    else:
        _write_h5(buffer, table)
    return buffer.getvalue()


def _beside(table: StartTable) -> dict[str, Any]:
    """What stands beside the table and its axes, as arrays."""
    about = {name: np.array(told) for name, told in table.about.items()}
    return {"low": table.low, "high": table.high, **table.tiles, **about}


def _csv(table: StartTable) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*table.axes, "start"])
    labels = itertools.product(*(values.tolist() for values in table.axes.values()))
    writer.writerows(
        (*label, value) for label, value in zip(labels, table.start.ravel().tolist(), strict=True)
    )
    return text.getvalue().encode()


def _write_h5(buffer: io.BytesIO, table: StartTable) -> None:
    with h5py.File(buffer, "w") as file:
        start = file.create_dataset("start", data=table.start, track_times=False)
        for place, (name, values) in enumerate(table.axes.items()):
            labels = np.char.encode(values, "utf-8") if values.dtype.kind == "U" else values
            scale = file.create_dataset(name, data=labels, track_times=False)
            scale.make_scale(name)
            start.dims[place].attach_scale(scale)
        file.attrs.update(table.about)
        file.attrs.update({"low": table.low, "high": table.high})
        for name, values in table.tiles.items():
            file.create_dataset(name, data=values, track_times=False)


def _labels(values: Any) -> Any:
    return np.char.decode(values, "utf-8") if values.dtype.kind == "S" else values
