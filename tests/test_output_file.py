"""Files that are no artefacts: whole under their name or not at all, and never in place of what another command made."""

from __future__ import annotations

import errno
import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qinit_cli.errors import Interrupted, NotAllowed
from qinit_cli.output_file import OutputFile
from qinit_store.errors import SystemFailed

Run = Callable[..., Any]


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


ODD: dict[str, Callable[[Path], object]] = {
    "fifo": os.mkfifo,
    "folder": Path.mkdir,
    "socket": _socket,
    "link to a device": lambda path: path.symlink_to("/dev/null"),
    "link to what a process has open": lambda path: path.symlink_to("/dev/stdout"),
}


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("odd", ODD)
def test_what_is_no_regular_file_is_never_replaced(
    odd: str, force: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # the name of a socket may not be long
    path = Path("o.svg")
    ODD[odd](path)
    before = path.lstat()
    with pytest.raises(NotAllowed, match="no regular file"):
        OutputFile(path, force).write(b"ours")
    assert (path.lstat().st_ino, path.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert [place.name for place in tmp_path.iterdir()] == ["o.svg"]


@pytest.mark.parametrize("path", ["/dev/null", "/dev/stdout", "/proc/self/fd/1", "/dev/fd/1"])
def test_a_device_is_never_replaced(path: str) -> None:
    before = os.lstat("/dev/null"), os.readlink("/dev/stdout")
    with pytest.raises(NotAllowed, match="no regular file"):
        OutputFile(Path(path), force=True).write(b"ours")
    assert (os.lstat("/dev/null"), os.readlink("/dev/stdout")) == before


def test_the_temporary_name_cannot_be_planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "victim").write_text("mine")
    for name in (".o.svg.part", f".o.svg.{os.getpid()}.part"):  # names of earlier versions
        (tmp_path / name).symlink_to("victim")
    OutputFile(tmp_path / "o.svg", force=False).write(b"ours")
    assert (tmp_path / "victim").read_text() == "mine"
    monkeypatch.setattr("qinit_cli.output_file.secrets.token_hex", lambda size: "guessed")
    (tmp_path / ".guessed.part").symlink_to("victim")
    with pytest.raises(SystemFailed):
        OutputFile(tmp_path / "p.svg", force=False).write(b"ours")
    assert (tmp_path / "victim").read_text() == "mine"


def test_a_link_is_replaced_with_force_alone_and_never_followed(tmp_path: Path) -> None:
    (tmp_path / "victim").write_text("mine")
    (tmp_path / "o.svg").symlink_to("victim")
    with pytest.raises(NotAllowed, match="--force"):
        OutputFile(tmp_path / "o.svg", force=False).write(b"ours")
    OutputFile(tmp_path / "o.svg", force=True).write(b"ours")
    assert (tmp_path / "victim").read_text() == "mine"
    assert not (tmp_path / "o.svg").is_symlink()


def test_what_the_same_command_made_is_replaced_and_else_only_the_same_content(tmp_path: Path) -> None:
    path = tmp_path / "o"
    path.write_bytes(b"... by us ...")
    OutputFile(path, force=False, maker="us", mark=b"by us").write(b"new, by us")
    with pytest.raises(NotAllowed, match="was not made by them; --force replaces it"):
        OutputFile(path, force=False, maker="them", mark=b"by them").write(b"by them")
    OutputFile(path, force=False).write(b"new, by us")
    with pytest.raises(NotAllowed, match="with other content; --force replaces it"):
        OutputFile(path, force=False).write(b"another")
    assert path.read_bytes() == b"new, by us"
    OutputFile(path, force=True).write(b"another")
    assert [place.name for place in tmp_path.iterdir()] == ["o"]


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_permissions_follow_the_umask(mask: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        OutputFile(tmp_path / "o", force=False).write(b"ours")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "o").stat().st_mode) == 0o666 & ~mask


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), Interrupted("", 143)])
@pytest.mark.parametrize("operation", ["fsync", "replace"])
def test_nothing_is_left_after_an_error_or_a_signal(
    operation: str, error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*arguments: object) -> None:
        raise error

    (tmp_path / "o").write_bytes(b"before")
    monkeypatch.setattr(os, operation, failing)
    with pytest.raises((SystemFailed, Interrupted)) as raised:
        OutputFile(tmp_path / "o", force=True).write(b"ours")
    assert [place.read_bytes() for place in tmp_path.iterdir()] == [b"before"]
    if isinstance(error, OSError):
        assert str(raised.value) == f"{tmp_path / 'o'} cannot be written: No space left on device"


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_plot_replaces_its_own_pictures_and_no_others(
    kind: str, here: Run, pipeline: Any, tmp_path: Path
) -> None:
    run, path = pipeline.runs["zero"], tmp_path / f"c.{kind}"
    curves = ("plot", "curves", run, "-o", path)
    assert here(*curves).code == 0
    first = path.read_bytes()
    assert here(*curves).code == 0
    assert path.read_bytes() == first
    assert here(*curves, "--title", "Another").code == 0
    refused = here("plot", "bars", run, "-o", path)
    assert (refused.code, refused.out) == (4, "")
    assert refused.err == (
        f"qinit: {path} was not made by qinit plot bars; --force replaces it, or choose another name with -o\n"
    )
    assert here("plot", "bars", run, "-o", path, "--force").code == 0
    assert [place.name for place in tmp_path.iterdir()] == [path.name]


def test_a_picture_of_ones_own_is_left_alone(here: Run, pipeline: Any, tmp_path: Path) -> None:
    (tmp_path / "curves.png").write_bytes(b"a photograph")
    assert here("plot", "curves", pipeline.runs["zero"]).code == 4
    assert (tmp_path / "curves.png").read_bytes() == b"a photograph"


@pytest.mark.parametrize("ending", ["csv", "npz", "json"])
def test_the_same_export_again_is_done_and_another_refused(
    ending: str, here: Run, pipeline: Any, tmp_path: Path
) -> None:
    target = tmp_path / f"e.{ending}"
    for _ in range(2):
        assert here("export", pipeline.runs["zero"], "-o", target).code == 0
    before = {place.name: place.read_bytes() for place in tmp_path.iterdir()}
    refused = here("export", pipeline.runs["mean"], "-o", target)
    assert (refused.code, refused.out) == (4, "")
    assert "with other content; --force replaces it" in refused.err
    assert {place.name: place.read_bytes() for place in tmp_path.iterdir()} == before


def test_what_a_table_says_of_itself_is_not_written_over_a_file_of_ones_own(
    here: Run, pipeline: Any, tmp_path: Path
) -> None:
    (tmp_path / "e.csv.json").write_text("{}")
    assert here("export", pipeline.runs["zero"], "-o", tmp_path / "e.csv").code == 4
    assert [place.name for place in tmp_path.iterdir()] == ["e.csv.json"]


def test_a_planted_link_in_a_reproduction_is_not_followed(tmp_path: Path) -> None:
    from qinit_cli.study.folder import Folder
    from qinit_cli.study.manifest import REPRODUCTION

    (tmp_path / "out").mkdir()
    (tmp_path / "victim").write_text("mine")
    for name in ("verdicts.json", ".verdicts.json.part"):
        (tmp_path / "out" / name).symlink_to(tmp_path / "victim")
    Folder(tmp_path / "out", REPRODUCTION).write("verdicts.json", b"{}")
    assert (tmp_path / "victim").read_text() == "mine"
    assert (tmp_path / "out" / "verdicts.json").read_text() == "{}"
