"""A comparison's rows as files for spreadsheets and data frames."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from qinit_cli.errors import UsageError


def csv_of(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """The rows as CSV in UTF-8, with a line of names; None is empty."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def parquet_of(rows: Sequence[Mapping[str, Any]]) -> bytes | None:
    """The rows as Parquet; None where pyarrow is not installed."""
    from qinit_cli.artefacts.formats import pyarrow

    try:
        arrow, parquet = pyarrow()
    except UsageError:
        return None
    file = io.BytesIO()
    parquet.write_table(arrow.Table.from_pylist(list(rows)), file, compression="zstd")
    return file.getvalue()
