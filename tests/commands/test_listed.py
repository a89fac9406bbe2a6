"""What `qinit list` remembers is never shown once it is no longer so, and nothing depends on it."""

from __future__ import annotations

import json
import os
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from qinit_cli.artefacts.settings import SourcesSettings
from qinit_cli.artefacts.sources import sources_schema
from qinit_cli.commands import listed
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.tasks import SourceTasks
from qinit_store.catalog import Store
from qinit_store.schema import Axis
from qinit_store.work import open_work

if TYPE_CHECKING:
    from running import Ended

    Here = Callable[..., Ended]


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Four sources whose seeds differ, each of which is remembered at once."""
    monkeypatch.setattr(listed, "WORTH", 1)
    monkeypatch.setattr(listed, "SETTLED", -60.0)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for seed in range(4):
        _write(tmp_path / "store" / "sources" / f"seed-{seed}.h5", seed)
    return tmp_path / "store"


def _write(target: Path, seed: int) -> None:
    """Two tasks whose numbers are the least that may be."""
    family = Gridworld(size=2)
    tasks = SourceTasks(family, "exact", family.source_learning, seed=seed)
    action = Axis("action", np.array(family.actions, dtype="S"), "", "action")
    schema = sources_schema(family.axes(), action, family.parameters(), 0)
    rows = {
        column.name: np.full((2, *schema.row_shape(column)), column.low or 0, column.little_endian)
        for column in schema.task_columns
        if column.given
    }
    with open_work(target, schema, SourcesSettings.of(tasks, 2).spec(), provenance={}) as work:
        work.save(rows, np.arange(2))
        work.finish(np.arange(2))


def _place(store: Path) -> Path:
    place = listed._place(store)
    assert place is not None
    return place


def _shown(here: Here, store: Path) -> str:
    ended = here("list", "--store", store)
    assert ended.code == 0, ended.err
    return ended.out


def _read_anew(here: Here, store: Path) -> str:
    """The same where nothing is remembered."""
    _place(store).unlink(missing_ok=True)
    return _shown(here, store)


def _sources(store: Path) -> Path:
    return min((store / "sources").glob("*.h5"))


def test_a_second_listing_opens_no_file_and_shows_the_same(
    here: Here, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = _shown(here, store)
    opened: list[Path] = []
    monkeypatch.setattr(Store, "entry", lambda store, path: opened.append(path) or iter(()))
    assert _shown(here, store) == first
    assert len(first.splitlines()) > 3
    assert opened == []


def _removed(path: Path) -> None:
    path.unlink()


def _renamed(path: Path) -> None:
    path.rename(path.with_name("another.h5"))


def _overwritten(path: Path) -> None:
    """In place, with the same size and the times of its content as they were."""
    before = path.stat()
    path.write_bytes(bytes(before.st_size))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def _replaced(path: Path) -> None:
    shutil.copy2(path.with_name("seed-3.h5"), path)


def _moved_to_another_kind(path: Path) -> None:
    (path.parents[1] / "runs").mkdir()
    path.rename(path.parents[1] / "runs" / path.name)


def _made_a_link(path: Path) -> None:
    path.rename(path.parents[2] / "elsewhere.h5")
    path.symlink_to(path.parents[2] / "elsewhere.h5")


@pytest.mark.parametrize(
    "change", [_removed, _renamed, _overwritten, _replaced, _moved_to_another_kind, _made_a_link]
)
def test_what_has_changed_is_shown_as_it_is(change: Callable[[Path], None], here: Here, store: Path) -> None:
    before = _shown(here, store)
    change(_sources(store))
    after = _shown(here, store)
    assert after == _read_anew(here, store)
    assert change is _made_a_link or after != before


BROKEN = {
    "empty": "",
    "torn": '{"form": "',
    "deep": "[" * 100_000,
    "another version's": json.dumps({"form": "qinit.listed/1 0.0.0", "artefacts": {}}),
    "of other things": json.dumps({"form": listed.FORM, "artefacts": [1, 2]}),
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
def test_a_broken_file_is_ignored_and_written_anew(text: str, here: Here, store: Path) -> None:
    shown = _shown(here, store)
    _place(store).write_text(text)
    assert _shown(here, store) == shown
    assert json.loads(_place(store).read_text())["form"] == listed.FORM


@pytest.mark.parametrize("value", [None, 7, ["x"], {"x": 1}])
def test_a_line_of_other_types_is_ignored(value: object, here: Here, store: Path) -> None:
    shown = _shown(here, store)
    told = json.loads(_place(store).read_text())
    assert told["artefacts"]
    for at in range(len(listed.NAMES)):
        changed = json.loads(json.dumps(told))
        for _, line in changed["artefacts"].values():
            if listed.NAMES[at] not in ("wanted", "seed", "tasks", "size"):
                line[at] = value
        if listed.NAMES[at] == "words" and value == {}:
            continue
        _place(store).write_text(json.dumps(changed))
        assert _shown(here, store) == shown, listed.NAMES[at]


def test_a_file_that_others_may_write_is_ignored(here: Here, store: Path) -> None:
    shown = _shown(here, store)
    _place(store).write_text(_place(store).read_text().replace("gridworld", "elsewhere"))
    assert _shown(here, store) != shown  # this user's own is believed
    _place(store).chmod(0o666)
    assert _shown(here, store) == shown


@pytest.mark.parametrize("base", ["/dev/null", "relative"])
def test_without_a_folder_for_it_the_list_is_the_same(
    base: str, here: Here, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = _shown(here, store)
    monkeypatch.setenv("XDG_CACHE_HOME", base)
    assert _shown(here, store) == shown
    assert not Path(base).is_dir()


def test_what_changed_a_moment_ago_is_not_remembered(
    here: Here, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listed, "SETTLED", 3600.0)
    _shown(here, store)
    assert not _place(store).exists()


def test_several_that_list_at_once_show_the_same(store: Path) -> None:
    there = Store(store)
    expected = listed.lines(there)
    differing: list[object] = []

    def again(number: int) -> None:
        for _ in range(5):
            if number % 2:
                listed._remember(_place(store), {})
            if (found := listed.lines(there)) != expected:
                differing.append(found)

    threads = [threading.Thread(target=again, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not differing
    assert [file.name for file in _place(store).parent.iterdir()] == [_place(store).name]
