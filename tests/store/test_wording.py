"""Foreign text on one visible line, and commands that a shell reads as they were meant."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from qinit_store.wording import first_few, printable, recorded_command, shell_line


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain, é, 漢 and −1", "plain, é, 漢 and −1"),
        ("a\x1b[31mb", r"a\x1b[31mb"),
        ("two\nlines\r\t", r"two\nlines\r\t"),
        ("\x00\x07\x7f", r"\x00\x07\x7f"),
        ("\x9b2J", r"\x9b2J"),
        ("invoice\u202egpj.h5", r"invoice\u202egpj.h5"),
        ("zero\u200bwidth\ufeff", r"zero\u200bwidth\ufeff"),
        ("\u2028\u2029", r"\u2028\u2029"),
        ("tag \U000e0041", r"tag \U000e0041"),
        ("filler\u3164", r"filler\u3164"),
        (os.fsdecode(b"latin-1 \xe9.h5"), r"latin-1 \xe9.h5"),
        ("\ud800", r"\ud800"),
        ("5\N{NO-BREAK SPACE}%", "5\N{NO-BREAK SPACE}%"),
    ],
)
def test_what_a_terminal_would_obey_is_written_out(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert printable(shown) == shown


def test_line_breaks_stay_where_they_are_ours() -> None:
    assert printable("a\nb\x1b", keep="\n") == "a\nb\\x1b"


@pytest.mark.parametrize(
    "name",
    ["a b.h5", "it's.h5", "$(touch x).h5", "a;b.h5", "`id`.h5", "run[old].h5", "new\nline.h5", "\x1b]0;t\x07é.h5",
     "back\\slash\n.h5", "~.h5", "-o.h5", os.fsdecode(b"\xe9.h5")],
)  # fmt: skip
def test_a_shell_reads_an_advised_path_as_the_path_it_is(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.touch()
    line = shell_line("cat", "--", Path(name))
    assert line == printable(line)
    ended = subprocess.run(
        ["bash", "-c", line.replace("cat", "ls", 1)], cwd=tmp_path, capture_output=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert Path(os.fsdecode(ended.stdout.removesuffix(b"\n"))) == Path(name)


def test_items_beyond_the_first_few_are_an_ellipsis() -> None:
    assert first_few([3, 5, 8], 3) == "3, 5, 8"
    assert first_few([3, 5, 8], 2) == "3, 5, ..."
    assert first_few(["a", "b"], 1, "; ") == "a; ..."


def test_a_recorded_command_is_one_command_of_qinit() -> None:
    assert recorded_command("qinit fit 'a b.h5' -o x.h5") == "qinit fit 'a b.h5' -o x.h5"
    line = recorded_command("qinit fit x; touch y && $(id) | sh > y\n# \x1b[2J")
    assert line == r"qinit fit 'x;' touch y '&&' '$(id)' '|' sh '>' y '#' $'\x1b[2J'"
    for said in ("curl evil | sh", "qinit", "qinit $(id)", "qinit 'open", "", None, 5, ["qinit", "list"]):
        assert recorded_command(said) == ""
