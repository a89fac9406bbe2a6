"""The power fails after any operation; and the model notices each step of the protocol that is left out."""

from __future__ import annotations

import random

import numpy as np
import pytest
from fakes import LIGHT, make_sources, rows_for, spec_for, statics_for
from power import Recorder, survive

from qinit_store import publish
from qinit_store.disk import Disk, write_all
from qinit_store.errors import StoreError
from qinit_store.folder import work_folder
from qinit_store.reading import open_artefact
from qinit_store.work import open_work

BATCHES = ([0, 1], [2, 3])


def record(root, recorder):
    """Make four tasks, noting each as reported once it is saved, and the whole once it is published."""
    path = root / "store" / "a.h5"
    with open_work(path, LIGHT, spec_for(4), disk=recorder) as work:
        for some in BATCHES:
            work.save(rows_for(some, LIGHT), np.array(some))
            recorder.reported += some
            recorder.note()
        work.finish(np.arange(4), statics_for(LIGHT))
        recorder.reported.append("published")
        recorder.note()
    recorder.note()
    return path


def lost(path, reported):
    """What was reported and is not there, or what is there and not whole; "" where all is well."""
    try:
        if path.exists():
            with open_artefact(path) as artefact:
                artefact.check_tasks()
                return "" if artefact.task_count == 4 else "tasks are missing from the artefact"
        if "published" in reported:
            return "the artefact was published and is not there"
        with open_work(path, LIGHT, spec_for(4)) as work:
            return "" if set(reported) <= set(work.saved.tolist()) else "a saved task is lost"
    except StoreError as error:
        return str(error)


def losses(tmp_path, recorder_class, rounds=2):
    """Yields what is lost at every moment of the recording: where the least survives, and in drawn mixtures."""
    root = tmp_path / "recorded"
    root.mkdir()
    recorder = recorder_class(root)
    record(root, recorder)
    probability = random.Random(3)
    for number, moment in enumerate(recorder.moments):
        for turn in range(rounds):
            target = tmp_path / f"{number}-{turn}"
            survive(moment, root, target, probability, least=turn == 0)
            loss = lost(target / "store" / "a.h5", moment[1])
            if loss:
                yield loss


@pytest.mark.parametrize("rounds", [2, pytest.param(20, marks=pytest.mark.soak)])
def test_a_power_cut_at_any_moment_loses_nothing_that_was_reported(tmp_path, rounds):
    assert list(losses(tmp_path, Recorder, rounds)) == []


def test_the_same_command_ends_with_the_same_content_after_a_power_cut(tmp_path):
    root = tmp_path / "recorded"
    root.mkdir()
    recorder = Recorder(root)
    whole = record(root, recorder).read_bytes()
    probability = random.Random(4)
    for number, moment in enumerate(recorder.moments[::4]):
        target = tmp_path / str(number)
        survive(moment, root, target, probability, least=number % 2 == 0)
        path = target / "store" / "a.h5"
        make_sources(path, tasks=4, schema=LIGHT)
        with open_artefact(path) as artefact, open_artefact(root / "store" / "a.h5") as straight:
            assert artefact.content_sha256 == straight.content_sha256
        assert not work_folder(path).exists()
    assert (root / "store" / "a.h5").read_bytes() == whole


class NeverFlushed(Recorder):
    def sync(self, descriptor, path):
        pass


class FinalFileNotFlushed(Recorder):
    def sync(self, descriptor, path):
        if not path.name.startswith("whole"):
            super().sync(descriptor, path)


class DirectoriesNotFlushed(Recorder):
    def sync_directory(self, path):
        pass


class WorkFolderNotFlushed(Recorder):
    def sync_directory(self, path):
        if not path.name.endswith(".work"):
            super().sync_directory(path)


class ParentNotFlushed(Recorder):
    """Neither where the work folder was made nor where the artefact appears."""

    def sync_directory(self, path):
        if path.name != "store":
            super().sync_directory(path)


class NewFoldersNotFlushed(Recorder):
    def sync_directory(self, path):
        if path != self.root:
            super().sync_directory(path)


class NameNotFlushed(Recorder):
    """The artefact's name is not flushed before the work folder goes."""

    linked = False

    def link(self, path, name):
        super().link(path, name)
        self.linked = True

    def sync_directory(self, path):
        if not self.linked:
            super().sync_directory(path)


MUTANTS = [
    NeverFlushed,
    FinalFileNotFlushed,
    DirectoriesNotFlushed,
    WorkFolderNotFlushed,
    ParentNotFlushed,
    NewFoldersNotFlushed,
    NameNotFlushed,
]


@pytest.mark.parametrize("mutant", MUTANTS)
def test_a_protocol_that_leaves_out_a_flush_is_noticed(tmp_path, mutant):
    assert any(losses(tmp_path, mutant))


def place_by_renaming_first(disk, path, content):
    temporary = path.with_name(path.name + ".tmp")
    descriptor = disk.create(temporary)
    write_all(disk, descriptor, temporary, content)
    disk.replace(temporary, path)
    disk.sync_directory(path.parent)
    Disk().close(descriptor, path)


def place_at_the_final_name(disk, path, content):
    descriptor = disk.create(path)
    write_all(disk, descriptor, path, content)
    Disk().close(descriptor, path)
    disk.sync_directory(path.parent)


@pytest.mark.parametrize("mutant", [place_by_renaming_first, place_at_the_final_name])
def test_a_part_that_gets_its_name_before_its_content_is_noticed(tmp_path, mutant, monkeypatch):
    monkeypatch.setattr(publish, "place", mutant)
    assert any(losses(tmp_path, Recorder))
