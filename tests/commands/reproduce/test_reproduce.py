"""`qinit reproduce`: finds what is there, makes the rest as the plain commands do, draws it, and goes on after a kill."""

from __future__ import annotations

import json
import shlex
import shutil
import signal
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import cache, partial
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from ready import Ready
from tiny import small

from qinit_cli.app import run
from qinit_cli.commands import reproduce

TINY_QINIT = Path(__file__).with_name("tiny.py")


@pytest.fixture(scope="module")
def small_study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's study with a quick scale of seconds, on fewer distributions."""
    file = tmp_path_factory.mktemp("small") / "paper.toml"
    file.write_text(small(), encoding="utf-8")
    return file


@pytest.fixture(autouse=True)
def tiny(monkeypatch: pytest.MonkeyPatch, small_study: Path) -> None:
    """The quick scale is small in this process."""
    monkeypatch.setattr(reproduce, "FILE", small_study)


def _manifest(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "reproduction.json").read_text()))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, small_study: Path) -> Callable[[str], tuple[Path, Path]]:
    """The folder and the store of a figure that was reproduced from nothing; made once, look, do not touch."""

    @cache
    def call(figure: str) -> tuple[Path, Path]:
        top = tmp_path_factory.mktemp(figure)
        words = ["--scale", "quick", "-o", str(top / "out"), "--store", str(top / "store"), "-q"]
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as printed:
            patch.setattr(reproduce, "FILE", small_study)
            assert run(["reproduce", figure, *words]) == 0
        assert printed.getvalue() == f"{top / 'out'}\n"
        return top / "out", top / "store"

    return call


def test_a_figure_has_a_manifest_and_its_pictures_in_two_formats_with_words(
    made: Callable[[str], tuple[Path, Path]],
) -> None:
    folder, _ = made("fig9")
    manifest = _manifest(folder)
    assert (manifest["schema"], manifest["target"], manifest["scale"]) == (
        "qinit.reproduction/1",
        "fig9",
        "quick",
    )
    assert manifest["complete"]
    for figure in manifest["figures"]:
        assert figure["name"] == "fig9"
        assert (folder / figure["file"]).read_text().startswith("<?xml")
        assert (folder / figure["png"]).read_bytes().startswith(b"\x89PNG")
        assert all(len(figure[words]) > 10 for words in ("title", "caption", "alt"))
        assert "10 source tasks of 300 episodes" in figure["caption"]
    stages = {stage["stage"]: stage for stage in manifest["stages"]}
    roles = [artefact["role"] for artefact in manifest["artefacts"]]
    assert stages["sources"]["made"] == roles.count("sources") == 1
    assert roles.count("optimal tables") == 1
    assert stages["runs"]["made"] == roles.count("run")
    judged = json.loads((folder / manifest["verdicts"]).read_text())
    assert judged["schema"] == "qinit.verdicts/1"
    assert all(row["verdict"] != "not judged" for row in judged["rows"])


def test_the_same_command_again_finds_it_complete_and_draws_only_what_is_gone(
    made: Callable[[str], tuple[Path, Path]], here: Callable[..., Any], tmp_path: Path
) -> None:
    folder, store = made("fig9")
    shutil.copytree(folder, tmp_path / "out")
    words = ("reproduce", "fig9", "--scale", "quick", "-o", "out", "--store", store)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()}
    again = here(*words)
    assert again.code == 0
    assert "already complete" in again.err
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "out").iterdir()} == before

    (tmp_path / "out" / "fig9-b.png").unlink()
    third = here(*words, "--json").json
    assert (third["made"], third["drawn"]) == (0, 1)
    assert (tmp_path / "out" / "fig9-b.png").read_bytes() == (folder / "fig9-b.png").read_bytes()


def test_its_tables_are_what_compare_prints_and_optimal_stands_beside_its_own_targets_alone(
    made: Callable[[str], tuple[Path, Path]], here: Callable[..., Any]
) -> None:
    folder, _ = made("fig9")
    paths = [one["path"] for one in _manifest(folder)["artefacts"] if one["role"] == "run"]
    whole = json.loads((folder / "fig9.json").read_text())
    compared = here("compare", *(path for path in paths if "optimal-2" not in path), "--json")
    by_method = {row["method"]: row for row in compared.json["rows"]}
    assert {row["method"]: row for row in whole["rows"]} == by_method
    assert "optimal" not in by_method
    first = json.loads((folder / "fig9-optimal.json").read_text())
    assert {"optimal", "logqinit-median"} <= {row["method"] for row in first["rows"]}
    assert all(" 2 targets " in row["targets"] and row["regret"] is not None for row in first["rows"])


def test_its_artefacts_are_the_very_ones_of_the_plain_commands(
    made: Callable[[str], tuple[Path, Path]], here: Callable[..., Any]
) -> None:
    artefacts = [one for figure in ("fig6", "fig9") for one in _manifest(made(figure)[0])["artefacts"]]
    labels = ("sources/", "fits/", "-zero-", "ops-tl-plus-logqinit-mean-rho", "-optimal-")
    chosen = [one for one in artefacts if any(label in one["path"] for label in labels)]
    assert all(any(label in one["path"] for one in chosen) for label in labels)
    for one in chosen:
        ended = here(*shlex.split(one["command"])[1:], "--json")
        told = ended.json
        assert "already complete" in ended.err
        if one["role"] != "optimal tables":  # their command is that of the run which they are made for
            assert (told["path"], told["digest"]) == (one["path"], one["content_sha256"])


def test_what_plain_commands_made_is_found(here: Callable[..., Any], tmp_path: Path) -> None:
    plain = ("train-sources", "gridworld", "--size", 6, "--variance", 7, "--episodes", 300)
    here(*plain, "--tasks", 12, "-q")
    here(
        "train-sources", "gridworld", "--size", 6, "--goals", "uniform", "--episodes", 300, "--tasks", 5, "-q"
    )
    told = here("reproduce", "fig4", "--scale", "quick", "--dry-run", "--json").json
    assert (told["stages"]["sources"]["artefacts"], told["stages"]["sources"]["missing"]) == (2, 1)
    made = here("reproduce", "fig4", "--scale", "quick", "-o", "out")
    assert "5 tasks are taken over" in made.err
    commands = [one["command"] for one in _manifest(tmp_path / "out")["artefacts"]]
    assert commands[0] != commands[2]


def test_a_dry_run_makes_nothing_and_tells_steps_seconds_and_bytes(
    here: Callable[..., Any], tmp_path: Path
) -> None:
    ended = here("reproduce", "all", "--scale", "quick", "--dry-run", "--json")
    told = ended.json
    assert ended.code == 0
    assert told["missing"] == told["artefacts"] > 50
    assert min(told["steps"], told["seconds"], told["bytes"], told["bytes_free"]) > 0
    assert (
        told["stages"]["sources"]["missing"] == 3 + 2 - 0
    )  # two grids, a car, and two seeds of its noise floor
    assert not list(tmp_path.iterdir())


def test_a_folder_that_holds_something_else_is_refused_and_left_alone(
    here: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.png").write_bytes(b"cat")
    ended = here("reproduce", "figA1", "--scale", "quick", "-o", "photos", "--force")
    assert ended.code == 4
    assert "something other than a reproduction" in ended.err
    assert [path.name for path in (tmp_path / "photos").iterdir()] == ["cat.png"]


def test_a_reproduction_of_other_settings_is_replaced_with_force_alone_and_foreign_files_stay(
    made: Callable[[str], tuple[Path, Path]], here: Callable[..., Any], tmp_path: Path
) -> None:
    out = shutil.copytree(made("fig9")[0], tmp_path / "out")  # of three pictures and two tables
    (out / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    refused = here("reproduce", "figA1", "--scale", "quick", "-o", "out")
    assert refused.code == 4
    assert "--force" in refused.err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert here("reproduce", "figA1", "--scale", "quick", "-o", "out", "--force").code == 0
    names = {"notes.txt", "reproduction.json", "report.html", "verdicts.json", "figA1.svg", "figA1.png"}
    assert {path.name for path in out.iterdir()} == names


@pytest.mark.parametrize(("option", "value"), [("--scale", "papr"), ("--source-sets", "0"), ("--jobs", "0")])
def test_what_cannot_be_meant_is_refused(option: str, value: str, here: Callable[..., Any]) -> None:
    assert here("reproduce", "fig4", option, value).code == 2


def test_killed_and_interrupted_it_goes_on_and_ends_with_the_same_content(
    made: Callable[[str], tuple[Path, Path]], tmp_path: Path, ready: Ready
) -> None:
    words = ("reproduce", "fig9", "--scale", "quick", "-o", "out")
    tiny_qinit = partial(ready.process, tmp_path, *words, command=str(TINY_QINIT))
    for number, code in ((signal.SIGKILL, -9), (signal.SIGINT, 130)):
        before = len(list(tmp_path.glob("qinit-store/runs/*.h5")))
        with tiny_qinit() as process:
            process.wait_until(
                lambda before=before: len(list(tmp_path.glob("qinit-store/runs/*.h5"))) > before + 2
            )
            process.send_signal(number)
            assert (process.wait(), process.out) == (code, "")
        assert not _manifest(tmp_path / "out")["complete"]
    assert "the same command goes on with the rest" in process.err.splitlines()[-1]
    assert "Traceback" not in process.err

    with tiny_qinit("-q") as process:
        assert process.wait(300) == 0, process.err
    straight, _ = made("fig9")
    told = [_manifest(folder) for folder in (tmp_path / "out", straight)]
    for kind, what in (("artefacts", "content_sha256"), ("figures", "made_of"), ("tables", "made_of")):
        assert [one[what] for one in told[0][kind]] == [one[what] for one in told[1][kind]]
    for figure in told[0]["figures"]:
        same = [(folder / figure["png"]).read_bytes() for folder in (tmp_path / "out", straight)]
        assert same[0] == same[1]
