"""Random damage, in the byte stream and behind valid checksums: refused or harmless, never a wrong number."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import h5py
import pytest
from fakes import LIGHT, make_fit, make_sources
from fuzz import headers, outcome, values_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

FUZZ = Path(__file__).with_name("fuzz.py")
ROOT = FUZZ.parents[2]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    path = make_sources(tmp_path_factory.mktemp("sound") / "a.h5", schema=LIGHT)
    return path, path.read_bytes(), values_of(path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cuts=st.lists(
        st.tuples(st.floats(0, 1, exclude_max=True), st.binary(max_size=16), st.integers(0, 16)), max_size=4
    )
)
def test_bytes_put_in_the_place_of_others_are_never_read_as_numbers(sound, cuts):
    path, content, expected = sound
    changed = bytearray(content)
    for place, given_instead, length in cuts:
        at = int(place * len(changed))
        changed[at : at + length] = given_instead
    other = path.with_name("changed.h5")
    other.write_bytes(changed)
    assert outcome(other, expected) in ("refused", "harmless")


def test_the_checksums_that_are_repaired_are_those_of_hdf5(sound):
    path, content, _ = sound
    with h5py.File(path) as file:
        datasets = len(file)
    assert len(headers(bytearray(content))) >= datasets, "of the root and most datasets"


def counts(sound, seeds, count):
    """What became of the damaged files, each batch read in a process of its own with limits."""
    found = Counter()
    first = 0
    while first < seeds:
        ended = subprocess.run(
            [sys.executable, FUZZ, sound, str(first), str(min(count, seeds - first))],
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            check=False,
        )
        lines = ended.stdout.splitlines()
        assert lines, ended.stderr
        told = [line.split(" ", 1) for line in lines]
        found.update(what.strip() or f"ended by {ended.returncode}" for _, what in told)
        assert ended.returncode <= 0, ended.stderr
        first = int(told[-1][0]) + 1
    return found


def test_damage_behind_valid_checksums_is_never_read_as_numbers(sound):
    found = counts(sound[0], 300, 300)
    assert set(found) <= {"refused", "harmless"}, found


@pytest.mark.soak
@pytest.mark.parametrize(
    "make",
    [lambda path: make_sources(path, schema=LIGHT), make_sources, make_fit],
    ids=["run", "sources", "fit"],
)
def test_twenty_thousand_damaged_files_are_never_read_as_numbers(tmp_path, make):
    found = counts(make(tmp_path / "a.h5"), 7_000, 500)
    print(dict(found))
    assert set(found) <= {"refused", "harmless"}
    assert sum(found.values()) == 7_000
