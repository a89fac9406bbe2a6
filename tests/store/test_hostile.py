"""Files nobody vouches for: refused in bounded memory and time, and nothing outside them is read."""

from __future__ import annotations

import io
import json
import os
import random
import resource
import shutil
import time
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from fakes import LIGHT, make_fit, make_sources
from fuzz import checksum, headers

from qinit_store.errors import Damaged, NotFound, NotOurs, TooNew
from qinit_store.mend import salvage
from qinit_store.reading import describe, open_artefact
from qinit_store.verify import verify


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return make_sources(tmp_path_factory.mktemp("sound") / "a.h5", schema=LIGHT)


def replaced(file, name, **how):
    """The dataset `name` made again with other settings, its attributes kept."""
    attributes = {
        key: file[name].attrs[key] for key in ("dims", "units", "long_name") if key in file[name].attrs
    }
    del file[name]
    dataset = file.create_dataset(name, **how)
    for key, value in attributes.items():
        dataset.attrs[key] = np.bytes_(value)
    return dataset


def dataset_without_axes(file, other):
    file["notes"] = np.arange(3)


# Each gets an open, sound artefact and the path of an equal one. Were the link followed, every digest would hold.
def external_link(file, other):
    del file["steps"]
    file["steps"] = h5py.ExternalLink(str(other), "steps")


def external_link_in_a_middle_component(file, other):
    file["inner"] = h5py.ExternalLink(str(other), "/")
    del file["steps"]
    file["steps"] = h5py.SoftLink("/inner/steps")


def soft_link(file, other):
    file.move("steps", "moved")
    file["steps"] = h5py.SoftLink("/moved")


def dangling_link(file, other):
    file["more"] = h5py.SoftLink("/nowhere")


def link_loop(file, other):
    file["one"] = h5py.SoftLink("/two")
    file["two"] = h5py.SoftLink("/one")


def root_within_itself(file, other):
    file["again"] = file["/"]


def group(file, other):
    file.create_group("inner")


def named_type(file, other):
    file["kind"] = np.dtype("f8")


def external_storage(file, other):
    raw = other.with_suffix(".raw")
    values = file["steps"][...]
    raw.write_bytes(values.tobytes())
    replaced(file, "steps", shape=values.shape, dtype="<i4", external=[(str(raw), 0, values.nbytes)])


def virtual_dataset(file, other):
    layout = h5py.VirtualLayout(file["steps"].shape, "<i4")
    layout[...] = h5py.VirtualSource(str(other), "steps", file["steps"].shape)
    dims = file["steps"].attrs["dims"]
    del file["steps"]
    file.create_virtual_dataset("steps", layout).attrs["dims"] = np.bytes_(dims)


def growing_virtual_dataset(file, other):
    layout = h5py.VirtualLayout((6, 3), "<i4", maxshape=(None, 3))
    source = h5py.VirtualSource(str(other), "steps", (6, 3), maxshape=(None, 3))
    layout[: h5py.h5s.UNLIMITED] = source[: h5py.h5s.UNLIMITED]
    del file["steps"]
    file.create_virtual_dataset("steps", layout).attrs["dims"] = np.bytes_(b"task episode")


def text_of_variable_length(file, other):
    file.create_dataset("words", (6,), h5py.string_dtype()).attrs["dims"] = np.bytes_(b"task")


def rows_of_variable_length(file, other):
    file.create_dataset("words", (6,), h5py.vlen_dtype(np.int32)).attrs["dims"] = np.bytes_(b"task")


def references(file, other):
    file.create_dataset("pointers", (6,), h5py.ref_dtype).attrs["dims"] = np.bytes_(b"task")


def compound(file, other):
    file.create_dataset("pairs", (6,), np.dtype([("a", "i4"), ("b", "f8")])).attrs["dims"] = np.bytes_(
        b"task"
    )


def settings_of_variable_length(file, other):
    file.attrs["spec_json"] = "{}"


def unit_of_many_values(file, other):
    file["steps"].attrs["units"] = np.arange(100)


def attribute_without_a_value(file, other):
    file["steps"].attrs["units"] = h5py.Empty("S7")


def huge_attribute(file, other):
    file.attrs["provenance_json"] = np.bytes_(b"{" + b" " * 2**23 + b"}")


def very_many_attributes(file, other):
    for number in range(70):
        file["steps"].attrs[f"a{number}"] = np.int64(1)


def very_many_datasets(file, other):
    for number in range(300):
        file.create_dataset(f"d{number}", (6,), "i1")


def more_tasks_than_digests(file, other):
    replaced(file, "task", shape=(2**20,), dtype="<i8", chunks=(2**20,), compression="gzip")[...] = np.arange(
        2**20
    )
    digests = replaced(
        file, "task_digest", shape=(2**20, 32), dtype="u1", chunks=(2**20, 32), compression="gzip"
    )
    digests[...] = 0


def never_written(file, other):
    replaced(file, "start", shape=(4, 1), dtype="<f8", chunks=(2, 1))


def shape_bomb(file, other):
    replaced(file, "start", shape=(2**50, 1), dtype="<f8", chunks=(64, 1))


def shape_bomb_of_tasks(file, other):
    replaced(file, "task", shape=(2**45,), dtype="<i8", chunks=(64,))


def shape_that_overflows(file, other):
    replaced(file, "start", shape=(2**40, 2**23), dtype="<f8", chunks=(64, 1))


def bomb_of_zeros(file, other):
    replaced(file, "start", shape=(2**28, 1), dtype="<f8", chunks=(2**20, 1), compression="gzip")


def giant_chunk(file, other):
    replaced(file, "steps", shape=(6, 2**24), dtype="<i4", chunks=(2, 2**24))


def endless_stream(file, other):
    stream = zlib.compressobj(9)
    head, again = (stream.compress(bytes(2**24)) + stream.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    content = head + 255 * again  # 4 GiB
    dataset = replaced(file, "start", shape=(4, 1), dtype="<f8", chunks=(4, 1), compression="gzip")
    dataset.id.write_direct_chunk((0, 0), content)


def chunk_that_says_it_is_huge(file, other):
    chunk_that_says(3_758_096_384, file)


def chunk_that_says_it_is_empty(file, other):
    chunk_that_says(0, file)


def chunk_without_room_for_its_checksum(file, other):
    chunk_that_says(3, file)


def chunk_shorter_than_its_values(file, other):
    chunk_that_says(20, file, compression=None)  # 16 bytes of 32, and the checksum


def chunk_longer_than_its_values(file, other):
    chunk_that_says(2**20, file, compression=None)


def chunk_that_says(size, file, compression="gzip"):
    """Change what the header of "start" says of its one chunk's bytes in the file, and make its checksum hold."""
    start = replaced(
        file, "start", data=file["start"][...], chunks=(4, 1), compression=compression, fletcher32=True
    )
    there, path = start.id.get_chunk_info(0).size, Path(file.filename)
    begin = h5py.h5o.get_info(start.id).addr  # a chunk of another dataset may be as long
    file.close()
    content = bytearray(path.read_bytes())
    for first, length in headers(content):
        # in the layout message the size is followed by the mask of filters that were left out
        at = content.find(there.to_bytes(8, "little") + bytes(4), first, first + length)
        if first == begin and at >= 0:
            content[at : at + 8] = size.to_bytes(8, "little")
            content[first + length : first + length + 4] = checksum(content[first : first + length])
    path.write_bytes(content)


def filter_of_a_plug_in(file, other):
    replaced(file, "steps", data=file["steps"][...], chunks=(6, 3), compression="lzf")


def filter_that_loses(file, other):
    replaced(file, "steps", data=file["steps"][...], chunks=(6, 3), scaleoffset=0)


def room_to_grow(file, other):
    replaced(file, "steps", data=file["steps"][...], chunks=(6, 3), maxshape=(None, 3))


def name_with_a_blank(file, other):
    file.create_dataset("a b", (6,), "i1")


def axes_unknown(file, other):
    file["steps"].attrs["dims"] = np.bytes_(b"task nowhere")


def axes_too_many(file, other):
    file["steps"].attrs["dims"] = np.bytes_(b"task episode place")


def deep_settings(file, other):
    file.attrs["spec_json"] = np.bytes_(b"[" * 100_000 + b"]" * 100_000)


def settings_without_names(file, other):
    file.attrs["spec_json"] = np.bytes_(b"[1]")


def settings_with_infinity(file, other):
    file.attrs["spec_json"] = np.bytes_(b'{"alpha": Infinity}')


def no_settings(file, other):
    del file.attrs["spec_json"]


def unknown_format(file, other):
    file.attrs["qinit_format"] = np.bytes_(b"qinit/novel")


def column_missing(file, other):
    del file["reached"]


def column_of_another_type(file, other):
    replaced(file, "reached", data=file["reached"][...].astype("f8"))


def digest_not_covering(file, other):
    file["steps"].attrs["hashed"] = np.int64(0)


def ids_twice(file, other):
    file["task"][1] = 0


def bomb_within_a_task(file, other):
    replaced(file, "steps", shape=(6, 2**28), dtype="<i4", chunks=(1, 2**20))


def single_value(file, other):
    file.create_dataset("alone", data=1.0).attrs["dims"] = np.bytes_(b"task")


HOSTILE = {
    external_link: "steps is a link that leads elsewhere",
    external_link_in_a_middle_component: "inner is a link that leads elsewhere",
    soft_link: "steps is a link that leads elsewhere",
    dangling_link: "more is a link that leads elsewhere",
    link_loop: "is a link that leads elsewhere",
    root_within_itself: "again is no dataset",
    group: "inner is no dataset",
    named_type: "kind is no dataset",
    external_storage: "steps keeps its data in another file",
    virtual_dataset: "steps keeps its data elsewhere",
    growing_virtual_dataset: "steps keeps its data elsewhere",
    text_of_variable_length: "words is of variable length",
    rows_of_variable_length: "words is of a type that is not ours",
    references: "pointers is of a type that is not ours",
    compound: "pairs is of a type that is not ours",
    settings_of_variable_length: "attribute spec_json is of variable length",
    unit_of_many_values: "attribute units is no single value",
    attribute_without_a_value: "attribute units is no single value",
    huge_attribute: "attribute provenance_json has values of more than 4 MiB",
    very_many_attributes: "too many attributes",
    very_many_datasets: "too many datasets",
    more_tasks_than_digests: "it declares 1048576 tasks and holds digests of fewer",
    never_written: "start is not all there",
    shape_bomb: "the datasets declare 9,007.2 TB; 1.1 TB are allowed",
    shape_bomb_of_tasks: "the datasets declare 281.5 TB; 1.1 TB are allowed",
    shape_that_overflows: "the datasets declare 73,786,976.3 TB; 1.1 TB are allowed",
    bomb_of_zeros: "the datasets without a task axis declare 2.1 GB; 1.1 GB are allowed",
    bomb_within_a_task: "one task declares 1.1 GB; 536.9 MB are allowed",
    giant_chunk: "steps has chunks of more than 64 MiB",
    endless_stream: "start has a chunk that inflates beyond its size",
    chunk_that_says_it_is_huge: "start has a chunk of 3758096384 bytes in the file",
    chunk_that_says_it_is_empty: "has a chunk of 0 bytes in the file",
    chunk_without_room_for_its_checksum: "start has a chunk of 3 bytes in the file",
    chunk_shorter_than_its_values: "start has a chunk of 20 bytes in the file, not 36",
    chunk_longer_than_its_values: "start has a chunk of 1048576 bytes in the file, not 36",
    filter_of_a_plug_in: "steps needs a filter that is not ours",
    filter_that_loses: "steps needs a filter that is not ours",
    room_to_grow: "steps could grow",
    single_value: "alone has no dimensions",
    dataset_without_axes: "notes has no dims; `qinit salvage",
    name_with_a_blank: "is no name of a dataset",
    axes_unknown: "no axis nowhere",
    axes_too_many: "steps does not fit its axes",
    deep_settings: "nested too deeply",
    settings_without_names: "is damaged",
    settings_with_infinity: "is damaged",
    no_settings: "it has no spec_json",
    unknown_format: "its format is 'qinit/novel'",
    column_missing: "it lacks reached",
    column_of_another_type: "it lacks reached",
    digest_not_covering: "it lacks steps",
    ids_twice: "the task ids do not ascend",
}


@pytest.mark.parametrize(("hostile", "reason"), HOSTILE.items(), ids=[one.__name__ for one in HOSTILE])
def test_a_hostile_file_is_refused_in_bounded_memory_and_time(sound, tmp_path, hostile, reason):
    path, other = tmp_path / "a.h5", tmp_path / "other.h5"
    shutil.copy(sound, path)
    shutil.copy(sound, other)
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        hostile(file, other)
    memory, begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(Damaged, match=reason):
        open_artefact(path)
    assert time.process_time() - begin < 2
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < 200 * 1024


def test_a_stream_that_inflates_a_little_too_much_is_not_read_as_numbers(sound, tmp_path):
    path = tmp_path / "a.h5"
    shutil.copy(sound, path)
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        start = file["start"][...]
        dataset = replaced(file, "start", shape=(4, 1), dtype="<f8", chunks=(4, 1), compression="gzip")
        dataset.id.write_direct_chunk((0, 0), zlib.compress(start.tobytes()[:8] + bytes(2**20)))
    with pytest.raises(Damaged):
        open_artefact(path)


def in_numpy(save, **arrays):
    content = io.BytesIO()
    save(content, **arrays)
    return content.getvalue()


# What stands in a file, and what is printed of it; of none is it known that it was ever whole.
FOREIGN = {
    "nothing": (b"", "is empty"),
    "text": ("wärme,1\n2".encode(), "no HDF5 file, but a text"),
    "zip": (b"PK\x03\x04 a zip", "a zip archive, as numpy's .npz is"),
    "npz": (in_numpy(np.savez, q=np.ones(3)), "a zip archive, as numpy's .npz is"),
    "npy": (in_numpy(np.save, arr=np.ones(3)), "an array of numpy's"),
    "zeros": (b"\0" * 4096, "no HDF5 file, or its first bytes were written over"),
    "half the magic": (b"\x89HDF", "no HDF5 file, or its first bytes were written over"),
    "user block": (b"\0" * 1024 + b"\x89HDF\r\n\x1a\n" + b"\0" * 90, "behind a user block of 1024 bytes"),
    "newer HDF5": (b"\x89HDF\r\n\x1a\n\4\x08\x08" + b"\0" * 90, "version 4 of HDF5's superblock"),
}


@pytest.mark.parametrize(("content", "reason"), FOREIGN.values(), ids=FOREIGN)
def test_what_is_not_ours_is_named_and_not_called_damaged(tmp_path, content, reason):
    path = tmp_path / "a.h5"
    path.write_bytes(content)
    for reader in (open_artefact, describe):
        with pytest.raises((NotOurs, TooNew), match=reason) as error:
            reader(path)
        assert "damaged" not in str(error.value)


@pytest.mark.parametrize("libver", ["earliest", "latest"])
def test_an_hdf5_file_of_others_is_not_called_damaged(tmp_path, libver):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w", libver=libver, userblock_size=0) as file:
        file["x"] = np.arange(3)
    with pytest.raises(NotOurs, match="is an HDF5 file, but no artefact of qinit's"):
        open_artefact(path)


def test_an_artefact_open_elsewhere_for_writing_is_not_called_damaged(sound, tmp_path):
    path = tmp_path / "a.h5"
    shutil.copy(sound, path)
    with h5py.File(path, "r+"), pytest.raises(NotOurs, match="is open for writing in another program"):
        open_artefact(path)
    assert values_of(path) == values_of(sound)


def test_attributes_that_others_add_are_let_be(sound, tmp_path):
    path = tmp_path / "a.h5"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "of variable length"
        file.attrs["marks"] = [1.0, 2.0]
        file["steps"].attrs["list"] = np.arange(100)
        file["steps"].attrs["author"] = h5py.Empty("S7")
    assert values_of(path) == values_of(sound)
    assert verify(path).sound


def test_what_others_add_is_named_and_salvage_leaves_it_out(sound, tmp_path):
    path, mended = tmp_path / "a.h5", tmp_path / "mended.h5"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        file["notes"] = np.arange(3)
        file.create_group("my analysis")
    verdict = verify(path)
    assert (verdict.damaged, verdict.state) == ((), "foreign")
    assert "'my analysis' is no name of a dataset; notes has no dims; `qinit salvage" in verdict.problem
    with pytest.raises(NotOurs, match="was changed by another program after qinit wrote it"):
        open_artefact(path)
    assert salvage(path, mended, {}).tolist() == []
    assert describe(mended).content_sha256 == describe(sound).content_sha256


@pytest.mark.parametrize("rest", [b"", b"\0" * 4096, b"\xff" * 4096])
def test_nothing_but_the_signature_of_hdf5_is_refused(tmp_path, rest):
    path = tmp_path / "a.h5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + rest)
    with pytest.raises(Damaged, match="is damaged"):
        open_artefact(path)


def test_a_file_of_unlikely_size_is_refused(sound, tmp_path):
    path = tmp_path / "a.h5"
    shutil.copy(sound, path)
    os.truncate(path, 2**39)  # sparse
    with pytest.raises(Damaged, match="larger than the 256 GiB"):
        open_artefact(path)


def test_a_pipe_a_directory_and_a_device_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "directory.h5").mkdir()
    for name in ("pipe.h5", "directory.h5", "/dev/zero"):
        with pytest.raises(Damaged, match="is no regular file"):
            open_artefact(tmp_path / name)


def test_nothing_is_not_found(tmp_path):
    with pytest.raises(NotFound, match="`qinit list`"):
        open_artefact(tmp_path / "a.h5")


def test_verification_ends_a_reader_that_takes_too_much_memory(sound):
    verdict = verify(sound, memory=64 * 1024**2)  # not enough to import numpy
    assert verdict.state == "unread"
    assert "within 0.1 GB of memory" in verdict.problem


def test_verification_ends_a_reader_that_takes_too_long(sound):
    verdict = verify(sound, seconds=0)
    assert verdict.state == "unread"
    assert "within 0 s of processor time" in verdict.problem


def values_of(path):
    """Everything a reader can get from an artefact."""
    with open_artefact(path) as artefact:
        names = [column.name for column in artefact.schema.columns]
        arrays = {name: artefact.read(name) for name in (*names, "task")}
        return {
            **{name: (values.dtype.str, values.shape, values.tobytes()) for name, values in arrays.items()},
            "said": json.dumps([artefact.spec, artefact.provenance, artefact.inputs, artefact.kind]),
            "axes": {name: axis.values.tobytes() for name, axis in artefact.axes.items()},
        }


def noticed(path, content, expected):
    """Whether reading the changed file fails; where it does not, every value is what it was."""
    path.write_bytes(content)
    try:
        found = values_of(path)
    except Damaged:
        return True
    assert found == expected
    return False


@pytest.mark.parametrize(
    "make", [lambda path: make_sources(path, schema=LIGHT), make_fit], ids=["run", "fit"]
)
def test_flipped_bits_are_noticed_or_harmless(tmp_path, make):
    path = make(tmp_path / "a.h5")
    content, expected = path.read_bytes(), values_of(path)
    probability = random.Random(7)
    found = 0
    for _ in range(150):
        changed = bytearray(content)
        changed[probability.randrange(len(content))] ^= 1 << probability.randrange(8)
        found += noticed(path, changed, expected)
    assert found > 50  # the rest fell into padding


def test_truncated_files_are_noticed(sound, tmp_path):
    path = tmp_path / "a.h5"
    content, expected = sound.read_bytes(), values_of(sound)
    probability = random.Random(8)
    cuts = sorted({0, 1, 8, 48, len(content) - 1, *(probability.randrange(len(content)) for _ in range(70))})
    assert all(noticed(path, content[:cut], expected) for cut in cuts)


@pytest.mark.soak
def test_very_many_flipped_bits_and_blocks_are_noticed_or_harmless(tmp_path):
    path = make_sources(tmp_path / "a.h5", tasks=40)
    content, expected = path.read_bytes(), values_of(path)
    probability = random.Random(9)
    for _ in range(4000):
        changed = bytearray(content)
        at = probability.randrange(len(content))
        if probability.random() < 0.5:
            changed[at] ^= 1 << probability.randrange(8)
        else:
            changed[at : at + probability.choice((2, 8, 512))] = probability.randbytes(
                probability.choice((2, 8, 512))
            )
        noticed(path, changed, expected)
