"""Artefacts as NetCDF-4, for xarray, netCDF4 and whatever else reads it: arrays and axes by name, as plain variables."""

from __future__ import annotations

from typing import TYPE_CHECKING

import h5py
import numpy as np

from qinit_cli.artefacts.formats import Opened, attributes
from qinit_cli.artefacts.named_arrays import NamedArray, arrays
from qinit_store.encoding import LIBVER, create, text
from qinit_store.interrupts import held_back

if TYPE_CHECKING:
    from qinit_store.interrupts import HeldBack
    from qinit_store.publish import Growing


def write_netcdf(file: Growing, opened: Opened, table: str | None) -> None:
    """The arrays of an artefact, or of one of its tables, in the root group; those of several in a group for each name.

    The attributes of a group are those of `Saved.to_xarray`. Memory is that of a block of tasks.
    """
    several = len(list(opened())) > 1
    # everything in order of creation: the NetCDF library changes no file that is otherwise
    with held_back() as signals, h5py.File(file, "w", libver=LIBVER, track_order=True) as root:
        for artefact in opened():
            group = root.create_group(artefact.path.stem, track_order=True) if several else root
            for name, value in attributes(artefact).items():
                group.attrs[name] = text(value)
            scales: dict[str, h5py.Dataset] = {}
            for array in arrays(artefact, table):
                dataset = _created(group, array, scales)
                _fill(dataset, array, file, signals)


def _created(group: h5py.Group, array: NamedArray, scales: dict[str, h5py.Dataset]) -> h5py.Dataset:
    """The empty variable with its attributes; an axis is then one of the scales."""
    if array.dtype.startswith("<U"):
        dataset = group.create_dataset(array.name, array.shape, h5py.string_dtype("utf-8"), track_order=True)
    else:
        dataset = create(group, array.name, array.shape, np.dtype(array.dtype), ordered=True)
    if array.dims == (array.name,):
        dataset.make_scale(array.name)
        scales[array.name] = dataset
    else:
        for position, name in enumerate(array.dims):
            dataset.dims[position].attach_scale(scales[name])
    for name, value in array.attributes.items():
        dataset.attrs[name] = text(value)
    return dataset


def _fill(dataset: h5py.Dataset, array: NamedArray, file: Growing, signals: HeldBack) -> None:
    first = 0
    for piece in array.pieces:
        file.check()
        signals.deliver()
        dataset[first : first + len(piece)] = piece.astype(object) if piece.dtype.kind == "U" else piece
        first += len(piece)
