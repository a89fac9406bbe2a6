"""Chunks made outside HDF5: what it reads of them, and that threads change no byte of a file."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from breakable import Breakable, Killed, moments, operations_of
from fakes import DISK, narrow_schema, rows_for, spec_for, statics_for

from qinit_store import schema as schema_module
from qinit_store.errors import Damaged
from qinit_store.folder import part_paths
from qinit_store.in_order import in_order
from qinit_store.packing import Chunks, fletcher32
from qinit_store.reading import open_artefact
from qinit_store.work import open_work

FILTERS = {"shuffle": True, "compression": "gzip", "compression_opts": 1}
TASKS = 23
LARGE = narrow_schema(12_000, keep_q=True)  # 96 kB a task: two in a chunk


@pytest.mark.parametrize("dtype", ["<f8", "<f4", "<i4", "u1"])
@pytest.mark.parametrize(
    ("shape", "chunk"), [((1,), (1,)), ((7, 3), (7, 3)), ((100, 3, 5), (9, 3, 5)), ((400, 900), (36, 900))]
)
def test_hdf5_reads_what_was_packed(tmp_path, dtype, shape, chunk):
    values = (np.random.default_rng(0).random(shape) * 200).astype(dtype)
    with h5py.File(tmp_path / "a.h5", "w", libver=("v110", "v110")) as file:
        dataset = file.create_dataset("a", shape, dtype, chunks=chunk, fletcher32=True, **FILTERS)
        chunks = Chunks(dataset)
        for first in range(0, len(values), 4):
            for call in chunks.add(values[first : first + 4]):
                call().write()
        for call in chunks.end():
            call().write()
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["a"].id.get_num_chunks() == -(-shape[0] // chunk[0])
        assert np.array_equal(file["a"][...], values)


@pytest.mark.parametrize("size", [1, 2, 3, 511, 512, 513, 4096, 262_144])
@pytest.mark.parametrize("byte", [None, 0, 255])
def test_fletcher32_is_the_checksum_that_hdf5_writes(size, byte):
    noise = np.random.default_rng(size).integers(0, 256, size, np.uint8)
    content = noise if byte is None else np.full(size, byte, np.uint8)
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("a", data=content, chunks=(size,), fletcher32=True)
        _, raw = dataset.id.read_direct_chunk((0,))
    assert raw[size:] == fletcher32(content.tobytes()).to_bytes(4, "little")


def test_noise_takes_no_more_room_than_it_has_bytes_and_the_rest_is_deflated():
    noise = (
        np.random.default_rng(0).random((4, 8192)) + 1.0
    )  # one sign and exponent, so 52 of 64 bits are noise
    with h5py.File("a", "w", driver="core", backing_store=False) as file:
        dataset = file.create_dataset("a", noise.shape, "f8", chunks=noise.shape, fletcher32=True, **FILTERS)
        (call,) = Chunks(dataset).add(noise)
        assert noise.nbytes * 52 / 64 < len(call().content) < noise.nbytes * 57 / 64


def test_results_come_in_the_order_of_the_calls_and_the_first_failure_ends_them():
    assert list(in_order((lambda n=n: n for n in range(100)), 4, 5)) == list(range(100))

    def failing(number):
        if number == 7:
            raise ValueError("seven")
        return number

    results = in_order((lambda n=n: failing(n) for n in range(100)), 4, 5)
    assert [next(results) for _ in range(7)] == list(range(7))
    with pytest.raises(ValueError, match="seven"):
        next(results)


@pytest.fixture
def many_blocks(monkeypatch):
    """Four tasks a block, so that few tasks are many blocks."""
    monkeypatch.setattr(schema_module, "BLOCK_BYTES", 4 * LARGE.task_bytes)


def make(path, disk=DISK, **how):
    """Parts whose tasks lie across one another, put together."""
    with open_work(path, LARGE, spec_for(TASKS), disk=disk) as work:
        if work.complete:
            return path
        for first in range(5):
            ids = np.setdiff1d(np.arange(first, TASKS, 5), work.saved)
            if ids.size:
                work.save(rows_for(ids, LARGE), ids)
        return work.finish(np.arange(TASKS), statics_for(LARGE), **how)


def test_threads_change_no_byte_of_the_file(tmp_path, many_blocks):
    alone = make(tmp_path / "a.h5", threads=1)
    assert make(tmp_path / "b.h5", threads=4).read_bytes() == alone.read_bytes()
    with open_artefact(alone) as artefact:
        rows = artefact.columns(["q", "steps"])
    assert all(np.array_equal(rows[name], rows_for(range(TASKS), LARGE)[name]) for name in rows)


def test_progress_is_told_of_what_is_written_and_then_of_what_is_read_back(tmp_path, many_blocks):
    told = []
    make(
        tmp_path / "a.h5",
        threads=3,
        written=lambda done, tasks: told.append(("written", done, tasks)),
        checked=lambda done, tasks: told.append(("checked", done, tasks)),
    )
    steps = [4, 8, 12, 16, 20, 23]
    assert told == [(what, done, TASKS) for what in ("written", "checked") for done in steps]


def test_killed_while_threads_put_it_together_the_same_command_ends_with_the_same_bytes(
    tmp_path, many_blocks
):
    straight = make(tmp_path / "straight.h5").read_bytes()
    operations = operations_of(lambda disk: make(tmp_path / "count.h5", disk, threads=3))
    last_part = max(at for at, (what, *_) in enumerate(operations) if what == "reserve room for")
    later = [at for at in moments(operations) if at >= last_part]
    assert len(later) > 8
    for at in later[::2]:
        path = tmp_path / str(at) / "a.h5"
        with pytest.raises(Killed):
            make(path, Breakable(at, "before"), threads=3)
        assert not path.exists() or path.read_bytes() == straight, operations[at]
        assert make(path, threads=3).read_bytes() == straight, operations[at]
        assert [one.name for one in path.parent.iterdir()] == ["a.h5"], operations[at]


def test_a_part_that_was_changed_while_it_is_put_together_is_noticed_on_any_thread(tmp_path, many_blocks):
    path = tmp_path / "a.h5"
    with open_work(path, LARGE, spec_for(TASKS), disk=DISK) as work:
        work.save(rows_for(range(TASKS), LARGE), np.arange(TASKS))
        (part,) = part_paths(work.folder)
        with h5py.File(part, "r+", libver=("v110", "v110")) as file:
            file["q"][3, 0, 0] += 1.0
        with pytest.raises(Damaged, match="task 3"):
            work.finish(np.arange(TASKS), statics_for(LARGE), threads=3)
    assert not path.exists()
