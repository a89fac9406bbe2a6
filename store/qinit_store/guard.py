"""What may be opened of a file that nobody vouches for; everything else is refused before it is followed.

A file may point outside itself (external and soft links, external and virtual storage), run code (filters are
plug-ins) and ask for any amount of memory (shapes, chunks, compressed streams). Artefacts are flat, so nothing but
hard links from the root to datasets is accepted, and each is looked at before it is opened, or read.
"""

from __future__ import annotations

import math
import zlib
from codecs import getincrementaldecoder
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from qinit_store.errors import Damaged, NotOurs, TooNew
from qinit_store.schema import DIGEST_BYTES, NAME, TASK, TASK_DIGEST
from qinit_store.source import Source
from qinit_store.wording import shell_line, sized

MAGIC = b"\x89HDF\r\n\x1a\n"
HEAD = 16  # bytes; the version follows the magic, and three bytes later the marks of whoever has it open for writing
SUPERBLOCK = 3  # the version that artefacts have, and the last one there is
UNLIKELY_SUPERBLOCK = 16  # a version from here on is damage
OTHERS = {
    b"\x93NUMPY": "an array of numpy's (.npy)",
    b"PK\x03\x04": "a zip archive, as numpy's .npz is",
    b"CDF": "a netCDF file of the classic format",
    b"\x1f\x8b": "compressed with gzip",
    b"PAR1": "a Parquet file",
    b"SQLite format 3\0": "an SQLite database",
    b"\x80": "a pickle",
    b"\x89PNG": "a picture",
}

GIB = 1024**3
LARGEST_FILE = 256 * GIB
LARGEST_DECLARED = 1024 * GIB  # all datasets, as they would be in memory
LARGEST_STATIC = 1 * GIB  # what is read whole: datasets without a task axis, ids and digests
MOST_TASKS = LARGEST_STATIC // (DIGEST_BYTES + 8)  # by their ids and digests alone
LARGEST_TASK = GIB // 2  # one task over all columns
LEAST_DIGEST = 24  # bytes in the file for the 32 of a task's digest: nothing makes SHA-256 shorter
LARGEST_CHUNK = 64 * 1024**2
CHECKSUM_BYTES = 4  # of fletcher32; HDF5 crashes on a chunk that has no more
LARGEST_STREAM = 65 * 1024**2  # a chunk in the file: deflate makes what it cannot shrink a little longer
LARGEST_VALUE = 4 * 1024**2  # a text, of an attribute or a label
MOST_DATASETS = 256
MOST_ATTRIBUTES = 64
DATASET_ATTRIBUTES = ("dims", "units", "long_name", "hashed")  # those that are read

FILTERS = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}
CLASSES = {h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.STRING}

# HDF5 inflates a chunk into a buffer that doubles until the stream ends, whatever the chunk's size; deflate yields at
# most 1032 bytes for one. Streams that could exceed this are measured first.
DEFLATE_RATIO = 1032
LARGEST_INFLATED = 512 * 1024**2


def check_beginning(source: Source) -> None:
    """NotOurs or TooNew where the file does not begin as an artefact does, before HDF5 sees it; SystemFailed."""
    path, head = source.path, source.head[:HEAD]
    if not head:
        raise NotOurs(f"{path} is empty, so it is no artefact; remove it, or name another file")
    if not head.startswith(MAGIC):
        raise NotOurs(f"{path} is no artefact: {_instead(source, head)}")
    if source.size > LARGEST_FILE:
        raise Damaged(f"{path} is larger than the {LARGEST_FILE // GIB} GiB an artefact may have")
    if len(head) < HEAD:
        raise Damaged(f"{path} is damaged: it ends after {len(head)} bytes")
    version, opened = head[len(MAGIC)], head[len(MAGIC) + 3]
    if SUPERBLOCK < version < UNLIKELY_SUPERBLOCK:
        raise TooNew(
            f"{path} begins with version {version} of HDF5's superblock, this reader knows {SUPERBLOCK};"
            " `pip install --upgrade h5py`"
        )
    if version == SUPERBLOCK and opened:
        raise NotOurs(
            f"{path} is open for writing in another program, or was left so by one that was killed; close it"
            f" there, or take the mark away with `{shell_line('h5clear', '--status', path)}`"
        )


def _instead(source: Source, head: bytes) -> str:
    """What a file is that does not begin as HDF5 does."""
    for magic, kind in OTHERS.items():
        if head.startswith(magic):
            return f"it is {kind}"
    offset = 512
    while offset < source.size:  # where HDF5 looks for a file behind a user block
        if source.peek(offset, len(MAGIC)) == MAGIC:
            return (
                f"it is an HDF5 file behind a user block of {offset} bytes, which qinit does not write;"
                " `h5unjam` takes the block off"
            )
        offset *= 2
    if _is_text(head):
        return "it is no HDF5 file, but a text"
    return "it is no HDF5 file, or its first bytes were written over"


def _is_text(head: bytes) -> bool:
    try:
        text = getincrementaldecoder("utf-8")().decode(head)  # the last letter may be cut
    except UnicodeDecodeError:
        return False
    return all(letter.isprintable() or letter.isspace() for letter in text)


@dataclass(frozen=True)
class Checked:
    """A dataset that may be read, and its attributes."""

    dataset: h5py.Dataset
    attributes: dict[str, Any]

    @property
    def nbytes(self) -> int:
        """What it takes in memory, as declared."""
        return math.prod((int(self.dataset.dtype.itemsize), *self.dataset.shape))

    @property
    def stored(self) -> int:
        """What it takes in the file."""
        return int(self.dataset.id.get_storage_size())

    @property
    def written(self) -> bool:
        """Whether all of it is in the file, as it is in ours."""
        if not self.dataset.size:
            return True
        if self.dataset.chunks is None:
            return self.stored > 0
        parts = zip(self.dataset.shape, self.dataset.chunks, strict=True)
        chunks = int(self.dataset.id.get_num_chunks())
        return bool(chunks == math.prod(-(-length // part) for length, part in parts))


def attributes(owner: Any, wanted: Collection[str]) -> dict[str, Any]:
    """Those attributes of this low-level group or dataset that are `wanted`, each one number or fixed-length bytes.

    No other is opened: programs that people use on their files leave notes of their own. ValueError where one is of a
    type or size we never write.
    """
    if h5py.h5a.get_num_attrs(owner) > MOST_ATTRIBUTES:
        raise ValueError("too many attributes")
    names: list[bytes] = []
    h5py.h5a.iterate(owner, names.append)  # no Python in there: no exception may pass through the iteration
    return {name: _value(owner, name.encode()) for name in wanted if name.encode() in names}


def _value(owner: Any, name: bytes) -> Any:
    attribute = h5py.h5a.open(owner, name)
    kind = attribute.get_type()
    _check_type(kind, f"attribute {name.decode()}")
    if attribute.get_space().get_simple_extent_type() != h5py.h5s.SCALAR:
        raise ValueError(f"attribute {name.decode()} is no single value")
    value = np.empty((), kind.dtype)
    attribute.read(value, kind)
    return value[()]


def checked_datasets(file: h5py.File) -> tuple[dict[str, Checked], list[str]]:
    """Every dataset of ours by name, in order; and in words what else there is, which is left unread.

    Ours has the attribute `dims`. ValueError where such a one is as we never write it.
    """
    names, strange = _names(file.id)
    found = {}
    for name in names:
        if reason := _stranger(file.id, name.encode()):
            strange.append(f"{name} {reason}")
        else:
            found[name] = _checked_dataset(file.id, name)
    _check_size("the datasets declare", sum(one.nbytes for one in found.values()), LARGEST_DECLARED)
    return found, strange


def check_shares(datasets: dict[str, Checked], per_task: set[str]) -> None:
    """ValueError where what must be in memory at once is too much, or is declared and not there."""
    whole = [one for name, one in datasets.items() if name not in per_task or name in (TASK, TASK_DIGEST)]
    _check_size("the datasets without a task axis declare", sum(one.nbytes for one in whole), LARGEST_STATIC)
    task = (datasets[name].dataset for name in per_task)
    _check_size(
        "one task declares",
        sum(one.dtype.itemsize * math.prod(one.shape[1:]) for one in task),
        LARGEST_TASK,
    )
    if {TASK, TASK_DIGEST} <= datasets.keys():
        tasks = datasets[TASK].dataset.size
        if datasets[TASK_DIGEST].stored < LEAST_DIGEST * tasks:
            raise ValueError(f"it declares {tasks} tasks and holds digests of fewer")
    for name, one in datasets.items():
        if not one.written:
            raise ValueError(f"{name} is not all there: what was never written would be read as zeros")


def _check_size(what: str, size: int, most: int) -> None:
    if size > most:
        raise ValueError(f"{what} {sized(size)}; {sized(most)} are allowed")


def _names(root: Any) -> tuple[list[str], list[str]]:
    """The names that a dataset of ours could have, sorted; and in words the others."""
    if root.get_num_objs() > MOST_DATASETS:
        raise ValueError("too many datasets")
    raw: list[bytes] = []
    root.links.iterate(raw.append)
    texts = [name.decode(errors="backslashreplace") for name in raw]
    strange = [f"{name!r} is no name of a dataset" for name in texts if not NAME.fullmatch(name)]
    return sorted(name for name in texts if NAME.fullmatch(name)), strange


def _stranger(root: Any, name: bytes) -> str:
    """Why this is no dataset of ours, found without following it; "" where it may be one."""
    if root.links.get_info(name).type != h5py.h5l.TYPE_HARD:
        return "is a link that leads elsewhere"
    if h5py.h5o.get_info(root, name).type != h5py.h5o.TYPE_DATASET:
        return "is no dataset"
    return "" if h5py.h5a.exists(h5py.h5d.open(root, name), b"dims") else "has no dims"


def _checked_dataset(root: Any, name: str) -> Checked:
    dataset = h5py.h5d.open(root, name.encode())
    settings = dataset.get_create_plist()
    # Before the shape is asked for: that alone makes HDF5 open the sources of a virtual dataset.
    if settings.get_layout() not in (h5py.h5d.CHUNKED, h5py.h5d.CONTIGUOUS, h5py.h5d.COMPACT):
        raise ValueError(f"{name} keeps its data elsewhere")
    if settings.get_layout() == h5py.h5d.CONTIGUOUS and settings.get_external_count():
        raise ValueError(f"{name} keeps its data in another file")
    filters = {settings.get_filter(number)[0] for number in range(settings.get_nfilters())}
    if filters - FILTERS:
        raise ValueError(f"{name} needs a filter that is not ours")
    _check_type(dataset.get_type(), name)
    space = dataset.get_space()
    if not space.is_simple() or not 1 <= dataset.rank <= 16:
        raise ValueError(f"{name} has no dimensions, or too many")
    if space.get_simple_extent_dims() != space.get_simple_extent_dims(True):
        raise ValueError(f"{name} could grow, as none of ours can")
    if settings.get_layout() == h5py.h5d.CHUNKED:
        _check_chunks(dataset, settings.get_chunk(), filters, name)
    return Checked(h5py.Dataset(dataset), attributes(dataset, DATASET_ATTRIBUTES))


def _check_type(kind: Any, name: str) -> None:
    if kind.get_class() not in CLASSES:
        raise ValueError(f"{name} is of a type that is not ours")
    if kind.get_class() == h5py.h5t.STRING and kind.is_variable_str():
        raise ValueError(f"{name} is of variable length")
    if kind.get_size() > LARGEST_VALUE:
        raise ValueError(f"{name} has values of more than {LARGEST_VALUE // 1024**2} MiB")


def _check_chunks(dataset: Any, chunk: tuple[int, ...], filters: set[int], name: str) -> None:
    size = dataset.get_type().get_size() * math.prod(chunk)
    if size > LARGEST_CHUNK:
        raise ValueError(f"{name} has chunks of more than {LARGEST_CHUNK // 1024**2} MiB")
    if h5py.h5z.FILTER_DEFLATE in filters:
        _check_streams(dataset, name)
        return
    stored = size + CHECKSUM_BYTES * (h5py.h5z.FILTER_FLETCHER32 in filters)
    odd: list[Any] = []
    dataset.chunk_iter(lambda info: odd.append(info) if info.size != stored else None)
    if odd:
        raise ValueError(f"{name} has a chunk of {odd[0].size} bytes in the file, not {stored}")


def _check_streams(dataset: Any, name: str) -> None:
    suspects: list[Any] = []
    dataset.chunk_iter(
        lambda info: (
            suspects.append(info)
            if info.size <= CHECKSUM_BYTES or info.size * DEFLATE_RATIO > LARGEST_INFLATED
            else None
        )
    )
    for info in suspects:
        if not CHECKSUM_BYTES < info.size <= LARGEST_STREAM:
            raise ValueError(f"{name} has a chunk of {info.size} bytes in the file")
        _, raw = dataset.read_direct_chunk(info.chunk_offset)
        if len(zlib.decompressobj().decompress(raw, LARGEST_CHUNK + 1)) > LARGEST_CHUNK:
            raise ValueError(f"{name} has a chunk that inflates beyond its size")
