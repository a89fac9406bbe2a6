"""The files that `qinit export` writes: csv, parquet, npz and json, piece by piece; NetCDF stands in `netcdf`."""

from __future__ import annotations

import csv
import json
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.kind import Field
from qinit_cli.artefacts.long_tables import rows
from qinit_cli.artefacts.named_arrays import NamedArray, arrays
from qinit_cli.cells import separated
from qinit_cli.errors import UsageError

if TYPE_CHECKING:
    from qinit_store.reading import Artefact

SCHEMA = "qinit.export/1"
EARLIEST = (1980, 1, 1, 0, 0, 0)  # what zip can say; the same arrays give the same bytes

Opened = Callable[[], Iterator["Artefact"]]  # the artefacts, one open at a time


def about(opened: Opened, table: str | None, fields: Sequence[Field]) -> dict[str, Any]:
    """What a table of numbers cannot say of itself: the artefacts it comes from, and what its columns mean."""
    columns = {
        field.name: {"dtype": field.dtype, "unit": field.unit, "long_name": field.long_name}
        for field in fields
    }
    return {
        "schema": SCHEMA,
        "table": table,
        "columns": columns,
        "artefacts": [metadata(artefact) for artefact in opened()],
    }


def metadata(artefact: Artefact) -> dict[str, Any]:
    """What must not be lost of an artefact: its name, hashes, settings and origin."""
    return {
        "kind": artefact.kind,
        "name": artefact.path.stem,
        "content_sha256": artefact.content_sha256,
        "spec_sha256": artefact.spec_sha256,
        "spec": artefact.spec,
        "inputs": list(artefact.inputs),
        "provenance": artefact.provenance,
    }


def attributes(artefact: Artefact) -> dict[str, str]:
    """The same as texts, what has parts in JSON: the attributes of a dataset."""
    told = metadata(artefact)
    texts = {name: value for name, value in told.items() if isinstance(value, str)}
    parts = {f"{name}_json": json.dumps(told[name], allow_nan=False) for name in told if name not in texts}
    return texts | parts


def write_csv(file: IO[str], opened: Opened, table: str, fields: Sequence[Field]) -> None:
    """A header and a line for each row; a value that is not there is empty, numbers read back exactly, text stays text."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([separated(field.name) for field in fields])
    text = {field.name for field in fields if field.dtype == "str"}
    for artefact in opened():
        for piece in rows(artefact, table):
            columns = (
                map(separated, values.tolist()) if name in text else _plain(values, "")
                for name, values in piece.items()
            )
            writer.writerows(zip(*columns, strict=True))


def write_parquet(file: IO[bytes], opened: Opened, table: str, fields: Sequence[Field]) -> None:
    """A parquet file whose metadata holds, under "qinit", what `about` says; a value that is not there is null."""
    arrow, parquet = pyarrow()
    types = {
        field.name: arrow.string() if field.dtype == "str" else _arrow(arrow, field.dtype) for field in fields
    }
    said = {"qinit": json.dumps(about(opened, table, fields), allow_nan=False)}
    schema = arrow.schema(list(types.items()), metadata=said)
    with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
        for artefact in opened():
            for piece in rows(artefact, table):
                columns = [
                    arrow.array(values, types[name], from_pandas=True) for name, values in piece.items()
                ]
                writer.write_batch(arrow.record_batch(columns, schema=schema))


def write_npz(file: IO[bytes], opened: Opened, table: str | None) -> None:
    """A zip of arrays as numpy.load reads it, with `metadata_json`; those of several artefacts stand under NAME/."""
    several = len(list(opened())) > 1
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for artefact in opened():
            above = f"{artefact.path.stem}/" if several else ""
            said = np.array(json.dumps({"schema": SCHEMA, **metadata(artefact)}, allow_nan=False))
            _add(archive, f"{above}metadata_json", said.shape, said.dtype.str, [said])
            for array in arrays(artefact, table):
                _add(archive, above + array.name, array.shape, array.dtype, array.pieces)


def write_json(file: IO[str], opened: Opened, table: str | None) -> None:
    """One object: every artefact with its settings, and its arrays as nested lists; null where a value is not there."""
    file.write(f'{{"schema": {json.dumps(SCHEMA)}, "artefacts": [')
    for place, artefact in enumerate(opened()):
        said = json.dumps(metadata(artefact), allow_nan=False)
        file.write(f'{", " if place else ""}{said[:-1]}, "arrays": {{')
        for number, array in enumerate(arrays(artefact, table)):
            file.write(", " if number else "")
            _write_array(file, array)
        file.write("}}")
    file.write("]}\n")


def pyarrow() -> tuple[Any, Any]:
    """pyarrow and its parquet part; UsageError where they are not installed."""
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as missing:
        raise UsageError(
            "Parquet needs pyarrow, which is not installed: in your clone of qinit, pip install -e '.[parquet]'"
        ) from missing


def _arrow(arrow: Any, dtype: str) -> Any:
    return arrow.from_numpy_dtype(np.dtype(dtype))


def _add(archive: Any, name: str, shape: tuple[int, ...], dtype: str, pieces: Iterable[Any]) -> None:
    """One array of an npz file, written as its pieces come."""
    entry = zipfile.ZipInfo(f"{name}.npy", date_time=EARLIEST)
    entry.compress_type = zipfile.ZIP_DEFLATED
    with archive.open(entry, "w", force_zip64=True) as out:
        header = {"descr": dtype, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_2_0(out, header)
        for piece in pieces:
            out.write(np.ascontiguousarray(piece, dtype=dtype).tobytes())


def _write_array(file: IO[str], array: NamedArray) -> None:
    said = {"dims": array.dims, "dtype": array.dtype, "unit": array.unit, "long_name": array.long_name}
    file.write(f'{json.dumps(array.name)}: {json.dumps(said)[:-1]}, "values": [')
    begun = False
    for piece in array.pieces:
        for row in piece:
            file.write((", " if begun else "") + json.dumps(_plain(row, None), allow_nan=False))
            begun = True
    file.write("]}")


def _plain(values: Any, absent: str | None) -> Any:
    """A numpy array or number as plain Python, with `absent` for what is no finite number."""
    values = np.asarray(values)
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return values.tolist()
    plain = values.astype(object)
    plain[~np.isfinite(values)] = absent
    return plain.tolist()
