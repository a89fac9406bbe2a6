"""`qinit study run`: plain commands make the same, a killed run goes on, a failure ends nothing else."""

from __future__ import annotations

import json
import shlex
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ready import Ready

from qinit_cli.errors import Interrupted
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_cli.study.making import Maker
from qinit_cli.study.planned import PlannedRun
from qinit_cli.study.work import StudyWork

TEXT = """\
[[distribution]]
family = "gridworld"
size = 5
variance = 2
sources = { tasks = 4, episodes = 60 }
targets = { tasks = 3, episodes = 20 }

[[method]]
name = ["zero", "mean", "maxqinit"]

[[plot]]
kind = "curves"
name = "all"

[[plot]]
kind = "curves"
name = "of mean"
methods = ["mean", "zero"]

[[plot]]
kind = "curves"
name = "of max"
methods = ["maxqinit", "zero"]
"""
Here = Callable[..., Any]


def _study(folder: Path, text: str = TEXT) -> Path:
    (folder / "a study.toml").write_text(text)
    return folder / "a study.toml"


def _manifest(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "study.json").read_text()))


def _hashes(folder: Path) -> list[str]:
    return [one["content_sha256"] for one in _manifest(folder)["artefacts"]]


def test_a_run_makes_all_once_and_plain_commands_find_the_same(here: Here, tmp_path: Path) -> None:
    file = _study(tmp_path)
    first = here("study", "run", file, "-o", "out", "-q", "--json").json
    assert (first["artefacts"], first["made"], first["drawn"], first["failed"]) == (5, 5, 3, [])
    again = here("study", "run", file, "-o", "out", "--json")
    assert "already complete" in again.err
    assert (again.json["made"], again.json["drawn"]) == (0, 0)
    for one in _manifest(tmp_path / "out")["artefacts"]:
        plain = here(*shlex.split(one["command"])[1:], "--json")
        assert "already complete" in plain.err
        assert (plain.json["path"], plain.json["digest"]) == (one["path"], one["content_sha256"])

    _study(tmp_path, TEXT[: TEXT.rindex("[[plot]]")] + 'caption = "Another."\n')
    assert here("study", "run", file, "-o", "out", "-q").code == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("*.[sp][vn]g")) == [
        "all.png",
        "all.svg",
        "of mean.png",
        "of mean.svg",
    ]
    assert _manifest(tmp_path / "out")["figures"][1]["caption"] == "Another."
    assert "already complete" in here("study", "run", file, "-o", "out").err


def test_what_fails_is_reported_and_made_by_the_next_run(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, make = _study(tmp_path), Maker.make

    def failing(self: Maker, artefact: Any, *more: Any) -> Any:
        if isinstance(artefact, PlannedRun) and artefact.method.name == "maxqinit":
            raise ZeroDivisionError("on purpose")
        return make(self, artefact, *more)

    with monkeypatch.context() as patch:
        patch.setattr(Maker, "make", failing)
        ended = here("study", "run", file, "-o", "out")
    assert ended.code == 3
    assert ended.out == "out\n"
    assert "ZeroDivisionError: on purpose; alone it is qinit transfer maxqinit" in ended.err
    told = _manifest(tmp_path / "out")
    assert not told["complete"]
    assert [one["file"] for one in told["figures"]] == ["of mean.svg"]
    assert not (tmp_path / "out" / "of max.svg").exists()
    again = here("study", "run", file, "-o", "out", "-q", "--json")
    assert (again.code, again.json["made"], again.json["drawn"]) == (0, 1, 2)
    assert _manifest(tmp_path / "out")["complete"]


def test_quiet_the_first_failure_is_named(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: Any) -> Any:
        raise ZeroDivisionError("on purpose")

    monkeypatch.setattr(Maker, "make", failing)
    ended = here("study", "run", _study(tmp_path), "-o", "out", "-q")
    assert ended.code == 3
    assert ended.err == (
        "qinit: 8 artefacts, pictures and tables failed, first sources gridworld-5-variance-2 seed 0 "
        "(ZeroDivisionError: on purpose); the same command tries again what failed\n"
    )


def test_a_report_that_was_not_written_is_written_by_the_next_run(
    here: Here, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, report = _study(tmp_path), tmp_path / "out" / "report.html"
    assert here("study", "run", file, "-o", "out", "-q").code == 0
    report.unlink()
    assert here("study", "run", file, "-o", "out", "-q").code == 0
    assert report.read_bytes().count(b"<figure") == 3

    def stopped(*_: Any) -> None:
        raise Interrupted("stopped", 130)

    # as if killed between the manifest and the report, of a study that shows something else than before
    _study(tmp_path, TEXT[: TEXT.rindex("[[plot]]")])
    with monkeypatch.context() as patch:
        patch.setattr(StudyWork, "_report", stopped)
        assert here("study", "run", file, "-o", "out", "-q").code == 130
    assert _manifest(tmp_path / "out")["complete"]
    assert here("study", "run", file, "-o", "out", "-q").code == 0
    assert report.read_bytes().count(b"<figure") == 2


def test_a_folder_that_cannot_be_made_is_named(here: Here, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    ended = here("study", "run", _study(tmp_path), "-o", "taken/out", "-q")
    assert ended.code == 7
    assert ended.err == "qinit: cannot make the folder taken/out: Not a directory; name another with -o\n"


def test_a_fit_that_another_thread_reads_meanwhile_is_not_taken_for_the_own(tmp_path: Path) -> None:
    maker = Maker(Keeping(store=tmp_path), Machine())
    own = tmp_path / "own.h5"

    class Replaced:
        """A fit that is replaced by another's while its path is looked at."""

        @property
        def path(self) -> Path:
            maker._read = None
            return own

    maker._read = kept = Replaced()  # type: ignore[assignment]  # stands in for a fit
    assert maker._knowledge(own) is kept


def test_a_folder_with_something_else_is_refused_and_left_alone(here: Here, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.png").write_bytes(b"cat")
    ended = here("study", "run", _study(tmp_path), "-o", "photos", "--force")
    assert (ended.code, ended.out) == (4, "")
    assert "something other than a study" in ended.err
    assert [path.name for path in (tmp_path / "photos").iterdir()] == ["cat.png"]
    assert not (tmp_path / "qinit-store").exists()


def test_killed_it_goes_on_to_the_same_hashes(here: Here, tmp_path: Path, ready: Ready) -> None:
    file = _study(tmp_path)
    with ready.process(tmp_path, "study", "run", str(file), "-o", "out") as process:
        process.wait_until(lambda: bool(list(tmp_path.glob("qinit-store/runs/*.h5"))))
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    assert not _manifest(tmp_path / "out")["complete"]
    assert here("study", "run", file, "-o", "out", "-q").code == 0
    assert here("study", "run", file, "-o", "straight", "--store", "other", "-q").code == 0
    assert _hashes(tmp_path / "out") == _hashes(tmp_path / "straight")
    assert len(_hashes(tmp_path / "out")) == 5
