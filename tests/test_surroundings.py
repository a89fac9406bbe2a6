"""qinit in odd surroundings: no home, closed or narrow streams, wrong variables and settings, shared processors."""

from __future__ import annotations

import os
import pwd
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qinit_cli import configuration, cores

SCRIPT = str(Path(sys.executable).with_name("qinit"))


def ended(line: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[bytes]:
    """A line of shell in which "$Q" is qinit."""
    return subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        capture_output=True,
        timeout=120,
        env=os.environ | {"Q": SCRIPT} | variables,
    )


def test_quotas_of_containers_bound_the_processors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    groups, own = tmp_path / "cgroup", tmp_path / "own"
    inner, outer = groups / "pod" / "job", groups / "pod"
    inner.mkdir(parents=True)
    monkeypatch.setattr(cores, "GROUPS", groups)
    monkeypatch.setattr(cores, "OWN_GROUPS", own)
    monkeypatch.setattr(cores, "_by_affinity", lambda: 16)
    own.write_text("0::/pod/job\n")
    assert cores.usable() == 16  # no file says otherwise
    (inner / "cpu.max").write_text("max 100000\n")
    (outer / "cpu.max").write_text("350000 100000\n")
    assert cores.usable() == 4
    (inner / "cpu.max").write_text("20000 100000\n")
    assert cores.usable() == 1
    (inner / "cpu.max").write_text("no number\n")
    (outer / "cpu.max").unlink()
    assert cores.usable() == 16
    # in a container of its own the group is the top, whatever it is called outside
    (groups / "cpu.max").write_text("200000 100000\n")
    assert cores.usable() == 2


def test_quotas_of_the_first_version_of_control_groups_bound_the_processors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "cgroup" / "cpu,cpuacct"
    folder.mkdir(parents=True)
    (tmp_path / "own").write_text("5:memory:/docker/1\n3:cpu,cpuacct:/docker/1\n1:name=systemd:/x\n")
    monkeypatch.setattr(cores, "GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(cores, "OWN_GROUPS", tmp_path / "own")
    monkeypatch.setattr(cores, "_by_affinity", lambda: 16)
    (folder / "cpu.cfs_period_us").write_text("100000\n")
    (folder / "cpu.cfs_quota_us").write_text("-1\n")
    assert cores.usable() == 16
    (folder / "cpu.cfs_quota_us").write_text("150000\n")
    assert cores.usable() == 2


def test_processors_are_counted_where_there_is_no_affinity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cores, "OWN_GROUPS", tmp_path / "none")
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    assert cores.usable() == 3
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert cores.usable() == 1


def test_a_user_without_a_home_has_no_settings_and_no_cache(
    here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    from qinit_cli.kernels import compiled
    from qinit_cli.kernels.trusted import Untrusted

    def unknown(_: int) -> None:
        raise KeyError("uid not found")

    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert configuration.files() == []
    assert [here(command).code for command in ("list", "config")] == [0, 0]
    with pytest.raises(Untrusted, match="no home folder"):
        compiled._base()


def test_a_file_of_settings_may_begin_with_a_mark_and_name_the_home_folder(
    here: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "qinit.toml").write_bytes(b'\xef\xbb\xbfstore = "~/experiments"\n')
    told = here("config", "--format", "tsv")
    assert told.code == 0
    assert f"{tmp_path}/home/experiments" in told.out
    (tmp_path / "qinit.toml").write_bytes(b'store = "caf\xe9"\n')
    refused = here("list")
    assert refused.code == 2
    assert "qinit.toml is not UTF-8 (byte 12); save it as UTF-8" in refused.err


def test_references_on_stdin_keep_their_blanks(
    here: Callable[..., Any], pipeline: Any, tmp_path: Path
) -> None:
    for name in (" before.h5", "after.h5 "):
        (tmp_path / name).write_bytes(pipeline.sources.read_bytes())
    told = here("verify", "-", "--format", "json", stdin="./ before.h5\n\n./after.h5 \r\n")
    assert told.code == 0, told.err
    assert here("verify", "-", stdin="./before.h5\n").code == 2


@pytest.mark.parametrize(
    "words",
    [
        ("train-sources", "gridworld", "--learner", "exact", "--tasks", "2", "-o", "a\nb.h5"),
        ("train-sources", "gridworld", "--learner", "exact", "--tasks", "2", "--store", "a\nb"),
        ("fit", "SOURCES", "-o", "a\rb.h5"),
        ("export", "SOURCES", "-o", "a\nb.csv"),
        ("plot", "eopl", "SOURCES", "-o", "a\nb.svg"),
        ("report", "SOURCES", "-o", "a\nb.html"),
    ],
    ids=lambda words: f"{words[0]}-{words[-2]}",
)
def test_a_path_that_takes_two_lines_is_refused_before_anything_is_made(
    here: Callable[..., Any], pipeline: Any, tmp_path: Path, words: tuple[str, ...]
) -> None:
    told = here(*(str(pipeline.sources) if word == "SOURCES" else word for word in words))
    assert told.code == 2
    assert "has a line break in it" in told.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("variable", "value"),
    [("NUMBA_DISABLE_JIT", "1"), ("NUMBA_NUM_THREADS", "0"), ("NUMBA_NUM_THREADS", "abc")],
)
def test_variables_that_numba_cannot_run_with_are_named(
    variable: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from qinit_cli import kernels
    from qinit_cli.errors import UsageError

    monkeypatch.setenv(variable, value)
    with pytest.raises(UsageError, match=f"{variable} is '{value}'.* unset it"):
        kernels._settle_variables()


def test_closed_streams_end_no_command_and_no_file_takes_their_place(tmp_path: Path, pipeline: Any) -> None:
    sources = str(pipeline.sources)
    for line, code in (
        ('"$Q" list <&- >&- 2>&-', 0),
        ('"$Q" fit "$S" -o f.h5 >&- 2>&-', 0),
        ('"$Q" verify f.h5 2>&-', 0),
        ('"$Q" fit - <&-', 4),
        ('"$Q" list --nonsense >&- 2>&-', 2),
        ('"$Q" --help >&-', 0),
    ):
        assert ended(line, tmp_path, S=sources).returncode == code, line


def test_streams_of_few_characters_carry_tables_and_paths(tmp_path: Path, pipeline: Any) -> None:
    told = ended('"$Q" show "$F" --format markdown', tmp_path, F=str(pipeline.fit), PYTHONIOENCODING="ascii")
    assert told.returncode == 0
    assert told.stdout.isascii()
    compared = ended(
        '"$Q" compare "$R" --baseline zero --format table',
        tmp_path,
        R=str(pipeline.runs["zero"]),
        PYTHONIOENCODING="ascii",
    )
    assert re.search(rb"\.\d{4}-\.\d{4}", compared.stdout), compared  # an interval, its dash a hyphen
    line = 'set -o pipefail; "$Q" fit "$S" -q -o "$N" | "$Q" verify - --format json'
    for name in (b"./\xc3\xa9.h5", b"./\xff.h5"):
        piped = subprocess.run(
            ["bash", "-c", line],
            cwd=tmp_path,
            capture_output=True,
            timeout=120,
            env=os.environb
            | {
                b"Q": os.fsencode(SCRIPT),
                b"S": os.fsencode(pipeline.sources),
                b"N": name,
                b"PYTHONIOENCODING": b"ascii",
            },
        )
        assert piped.returncode == 0, (name, piped.stderr)
        assert (tmp_path / os.fsdecode(name)).exists()


def test_pictures_need_none_of_matplotlibs_settings(tmp_path: Path, pipeline: Any) -> None:
    (tmp_path / "matplotlibrc").write_bytes(b"\xff\xfe: nothing\n")
    drawn = ended(
        '"$Q" plot eopl "$S" -o a.svg',
        tmp_path,
        S=str(pipeline.sources),
        MPLBACKEND="module://matplotlib_inline.backend_inline",
        SOURCE_DATE_EPOCH="abc",
        MATPLOTLIBRC=str(tmp_path),
    )
    assert drawn.returncode == 0, drawn.stderr
    assert b"<svg" in (tmp_path / "a.svg").read_bytes()
    plain = ended('"$Q" plot eopl "$S" -o b.svg', tmp_path.parent, S=str(pipeline.sources))
    assert plain.returncode == 0
    assert (tmp_path.parent / "b.svg").read_bytes() == (tmp_path / "a.svg").read_bytes()


def test_a_date_that_is_none_ends_no_command(
    here: Callable[..., Any], pipeline: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "-99999999999999999")
    assert here("plot", "heatmaps", pipeline.fit, "-o", "a.pdf").code == 0


def test_undecodable_names_end_no_command(here: Callable[..., Any], pipeline: Any, tmp_path: Path) -> None:
    odd = os.fsdecode(b"\xff.h5")
    (tmp_path / odd).write_bytes(pipeline.fit.read_bytes())
    for words in (
        ("show", f"./{odd}"),
        ("verify", f"./{odd}"),
        ("report", f"./{odd}", "-o", "r.html"),
        ("export", f"./{odd}", "-o", "t.csv"),
        ("export", f"./{odd}", "-o", "t.json"),
        ("export", f"./{odd}", "-o", "t.npz"),
        ("plot", "heatmaps", f"./{odd}", "-o", "p.svg"),
    ):
        assert here(*words).code == 0, words
    assert here("show", f"./no{odd}").code == 2


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_stderr_leaves_the_exit_code_of_the_error(tmp_path: Path) -> None:
    assert ended('"$Q" show nothing.h5 2>/dev/full', tmp_path).returncode == 2


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
@pytest.mark.parametrize("words", ["list", "--help"])
def test_a_full_standard_output_is_named(words: str, tmp_path: Path) -> None:
    told = ended(f'"$Q" {words} >/dev/full', tmp_path)
    assert told.returncode == 7
    assert told.stderr.decode().splitlines()[-1] == (
        "qinit: standard output cannot be written: No space left on device"
    )
