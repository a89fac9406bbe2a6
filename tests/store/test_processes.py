"""Real processes: killed at random times, two at once, and one with a memory to be measured."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from fakes import LIGHT, make_sources, spec_for

from qinit_store.errors import Busy, SystemFailed
from qinit_store.folder import work_folder
from qinit_store.reading import describe, open_artefact
from qinit_store.work import open_work

CHILD = Path(__file__).with_name("child.py")
ROOT = CHILD.parents[2]


def start(*arguments):
    return subprocess.Popen(
        [sys.executable, str(CHILD), *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


def kill_at_random_times(path, tasks, kills, how, seed):
    """Start the child again and again, `how` it each time; everything it ever said it saved."""
    probability = random.Random(seed)
    said = set()
    for _ in range(kills):
        with start("make", path, tasks) as child:
            assert child.stdout.readline() == "ready\n"
            time.sleep(probability.random() * 0.25)
            child.send_signal(how)
            said |= {int(line) for line in child.stdout}
        if path.exists():
            break
        with open_work(path, LIGHT, spec_for(tasks)) as work:
            assert said <= set(work.saved.tolist())
            assert work.set_aside == 0
    return said


@pytest.mark.parametrize(("how", "kills"), [(signal.SIGKILL, 3), (signal.SIGTERM, 1), (signal.SIGINT, 1)])
def test_saved_stays_saved_through_kills_at_random_times(tmp_path, how, kills):
    path = tmp_path / "a.h5"
    kill_at_random_times(path, 60, kills=kills, how=how, seed=int(how))
    make_sources(path, tasks=60, schema=LIGHT)
    straight = make_sources(tmp_path / "straight.h5", tasks=60, schema=LIGHT)
    assert describe(path).content_sha256 == describe(straight).content_sha256
    assert not work_folder(path).exists()


@pytest.mark.soak
def test_saved_stays_saved_through_very_many_kills(tmp_path):
    straight = make_sources(tmp_path / "straight.h5", tasks=60, schema=LIGHT)
    for seed in range(40):
        path = tmp_path / f"{seed}.h5"
        kill_at_random_times(path, 60, kills=20, how=signal.SIGKILL, seed=seed)
        make_sources(path, tasks=60, schema=LIGHT)
        assert describe(path).content_sha256 == describe(straight).content_sha256


def test_a_second_process_is_told_that_it_is_busy_and_the_first_one_finishes(tmp_path):
    path = tmp_path / "a.h5"
    with start("make", path, 6, 1) as first:
        assert first.stdout.readline() == "ready\n"
        with start("make", path, 6) as second:
            _, said = second.communicate()
            assert second.returncode == Busy.exit_code
            assert "another process is writing" in said
        first.communicate("")
        assert first.returncode == 0
    assert describe(path).tasks == 6


def test_a_killed_holder_frees_the_lock(tmp_path):
    path = tmp_path / "a.h5"
    with start("make", path, 6, 1) as first:
        assert first.stdout.readline() == "ready\n"
        first.kill()
    make_sources(path, schema=LIGHT)
    assert describe(path).tasks == 6


@pytest.mark.parametrize("megabytes", [100, pytest.param(1000, marks=pytest.mark.soak)])
def test_publishing_and_reading_takes_the_memory_of_a_few_blocks(tmp_path, megabytes):
    with start("finish_large", tmp_path / "a.h5", megabytes * 10, 100) as child:
        out, said = child.communicate()
        assert child.returncode == 0, said
    begin, after_parts, end = map(int, out.split())
    assert end - after_parts < 64, (begin, after_parts, end)
    assert end - begin < 90, (begin, after_parts, end)


@pytest.mark.parametrize("force", [0, 1], ids=["grown", "forced"])
def test_a_reader_meets_the_old_or_the_new_artefact_while_it_is_replaced(tmp_path, force):
    path = tmp_path / "a.h5"
    make_sources(path, tasks=12 if force else 2, schema=LIGHT)
    seen = set()

    def read():
        with open_artefact(path) as artefact:
            artefact.check_tasks()
            seen.add(artefact.task_count)

    with start("make", path, 8, 0, force) as child:
        while child.poll() is None:
            read()
            time.sleep(0.002)
        child.communicate()
    read()
    assert seen == {12 if force else 2, 8}


def test_a_reader_that_has_it_open_reads_on_while_it_is_replaced(tmp_path):
    path = make_sources(tmp_path / "a.h5", tasks=3, schema=LIGHT)
    with open_artefact(path) as artefact:
        make_sources(path, tasks=5, schema=LIGHT)
        artefact.check_tasks()
        assert artefact.task_count == 3
    assert describe(path).tasks == 5


@pytest.fixture
def small_disk(tmp_path):
    """A real file system of 256 KiB, where the test may mount one."""
    place = tmp_path / "small"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "none", str(place)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("a file system can be mounted by root alone")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_directory_that_is_really_read_only_is_reported(small_disk):
    subprocess.run(["mount", "-o", "remount,size=4m", str(small_disk)], check=True)
    make_sources(small_disk / "there.h5", tasks=2, schema=LIGHT)
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    with start("make", small_disk / "a.h5", 6) as child:
        _, said = child.communicate()
    assert child.returncode == SystemFailed.exit_code, said
    assert "Read-only file system" in said
    make_sources(small_disk / "there.h5", tasks=2, schema=LIGHT)  # found complete, which writes nothing


def test_a_really_full_disk_ends_with_its_exit_code_and_goes_on_with_more_room(small_disk, tmp_path):
    path = small_disk / "a.h5"
    with start("make", path, 60) as child:
        _, said = child.communicate()
    assert child.returncode == SystemFailed.exit_code, said
    assert "No space left on device" in said
    assert "tasks are kept in" in said
    subprocess.run(["mount", "-o", "remount,size=16m", str(small_disk)], check=True)
    with open_work(path, LIGHT, spec_for(60)) as work:
        assert work.saved.size > 5
        assert work.set_aside == 0
    make_sources(path, tasks=60, schema=LIGHT)
    straight = make_sources(tmp_path / "straight.h5", tasks=60, schema=LIGHT)
    assert describe(path).content_sha256 == describe(straight).content_sha256
