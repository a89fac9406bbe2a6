"""Arrays in numpy's own format, in files and in archives of them."""

from __future__ import annotations

import zipfile
import zlib
from typing import IO, Any

import numpy as np

# of an archive: no zip, damaged, encrypted or of an unknown compression
UNREADABLE = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)


def header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether in Fortran's order, and dtype of the array that begins here; ValueError where none does."""
    formats = np.lib.format
    version = formats.read_magic(file)
    read = formats.read_array_header_1_0 if version == (1, 0) else formats.read_array_header_2_0
    return read(file)
