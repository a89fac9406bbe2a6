"""What becomes of plug-ins that are sound, broken, or in each other's way."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent
from typing import Any, ClassVar

import pytest
import typer
from running import run_here

from qinit_cli.artefacts.settings import StoredFamily
from qinit_cli.commands.option_groups import Group
from qinit_cli.commands.typer_commands import add_command, add_each
from qinit_cli.environments import FAMILIES
from qinit_cli.errors import NotAllowed
from qinit_cli.options import option
from qinit_cli.registry import COMPLETING, Registry

Install = Callable[..., None]
SOUND = """
    from dataclasses import dataclass

    @dataclass(frozen=True)
    class Shoe:
        "A shoe."
        name = "boot"
"""


@dataclass(frozen=True)
class Own:
    """Ours."""

    size: int = option(3, "How large.")
    name: ClassVar[str] = "own"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a distribution with one module and one entry point of the group `shoes` where Python finds it."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def call(package: str, code: str, name: str = "boot", group: str = "shoes", what: str = "Shoe") -> None:
        monkeypatch.delitem(sys.modules, f"{package}_code", raising=False)
        (tmp_path / f"{package}_code.py").write_text(dedent(code))
        about = tmp_path / f"{package}-1.5.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.5\n")
        (about / "entry_points.txt").write_text(f"[{group}]\n{name} = {package}_code:{what}\n")

    return call


@pytest.mark.parametrize("words", ["plot curves", "train-sources gridworld", "start zero", "tune ucoi"])
def test_for_a_subcommand_of_ours_no_plug_in_is_looked_for(
    words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Registry, "_plugins", lambda self: pytest.fail(f"looked for {self.group}"))
    ended = run_here([*words.split(), "-h"])
    assert (ended.code, ended.err) == (0, "")
    assert f"qinit {words}" in ended.out


def test_a_subcommand_that_is_not_there_is_told_with_those_that_are() -> None:
    ended = run_here(["plot", "curve", "-h"])
    assert ended.code == 2
    assert "curves" in ended.err


def shoes(fault: str = "") -> Registry[Any]:
    return Registry("shoes", "shoe", [Own], lambda found: fault)


def test_a_sound_plug_in_is_there_and_says_where_it_comes_from(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("leather", SOUND)
    registry = shoes()
    assert list(registry) == ["own", "boot"]
    assert registry["boot"].__doc__ == "A shoe."
    assert registry.package("boot") == "leather 1.5"
    assert registry.package("own") == ""
    assert capsys.readouterr().err == ""


def test_looking_up_one_of_our_own_or_another_name_loads_no_plug_in(install: Install) -> None:
    install("lazy", "raise AssertionError('loaded')")
    registry = shoes()
    assert registry["own"] is Own
    assert "sandal" not in registry
    assert "lazy_code" not in sys.modules


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("import nothing_of_that_name", "ModuleNotFoundError: No module named 'nothing_of_that_name'"),
        ("raise SystemExit(3)", "SystemExit: 3"),
        ("def Shoe(:", "SyntaxError"),
        ("", "AttributeError"),
        ("Shoe = 3", "it is no dataclass"),
        (SOUND.replace("(frozen=True)", ""), "it is no frozen dataclass"),
        (SOUND.replace('"boot"', '"clog"'), "its class calls itself 'clog'"),
    ],
)
def test_a_broken_plug_in_is_one_warning_and_the_rest_works(
    code: str, told: str, install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("torn", code)
    registry = shoes()
    assert list(registry) == ["own"]
    assert "boot" not in registry
    assert list(registry) == ["own"]
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("qinit: warning: the shoe boot of torn 1.5 is left out: ")
    assert told in line


def test_a_plug_in_that_lacks_what_all_have_is_told(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("soleless", SOUND)
    assert list(shoes("it has no sole")) == ["own"]
    assert "is left out: it has no sole" in capsys.readouterr().err


def test_a_name_of_our_own_is_refused_with_one_warning(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("copy", SOUND.replace("boot", "own"), name="own")
    registry = shoes()
    assert list(registry) == ["own"]
    assert registry["own"] is Own
    [line] = capsys.readouterr().err.splitlines()
    assert line.endswith("the shoe own of copy 1.5 is left out: qinit has a shoe of that name itself")


def test_two_plug_ins_of_one_name_keep_the_first(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("early", SOUND)
    install("later", SOUND)
    assert list(shoes()) == ["own", "boot"]
    [line] = capsys.readouterr().err.splitlines()
    assert "has a shoe of that name too" in line


def test_while_the_shell_completes_a_line_nothing_is_said(
    install: Install, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(COMPLETING, "complete_bash")
    install("mute", "raise OSError")
    assert list(shoes()) == ["own"]
    assert capsys.readouterr().err == ""


@dataclass(frozen=True)
class Twice:
    """Has an option that the command has already."""

    seed: int = option(3, "A seed.")


@dataclass(frozen=True)
class Odd:
    """Has an option of a type that no command line has."""

    of: complex | int | None = option(None, "Odd.")


@pytest.mark.parametrize("options", [Twice, Odd])
def test_options_that_make_no_command_leave_a_plug_in_out(
    options: type[Any], install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install("odd", SOUND)
    registry, app = shoes(), typer.Typer()

    def add(there: typer.Typer, name: str, kind: type[Any]) -> None:
        groups = {"seed": Group(Seed, "Chance"), "own": Group(Own if kind is Own else options, "Shoe")}
        add_command(there, name, lambda **given: None, groups, help="")

    add_each(app, registry, add)
    assert [command.name for command in app.registered_commands] == ["own"]
    assert list(registry) == ["own"]
    assert "its options make no command" in capsys.readouterr().err


@dataclass(frozen=True)
class Seed:
    """An option that every command has."""

    seed: int = option(0, "A seed.")


def test_the_missing_plug_in_of_an_artefact_is_named() -> None:
    with pytest.raises(NotAllowed, match=r"it came with mazes 2\.0: pip install mazes$"):
        StoredFamily.read({"name": "maze"}).installed({"plug-in maze": "mazes 2.0"})
    with pytest.raises(NotAllowed, match="known are gridworld"):
        StoredFamily.read({"name": "maze"}).installed()


def test_the_help_of_the_root_and_our_own_families_load_no_plug_in(install: Install, tmp_path: Path) -> None:
    install("eager", "raise AssertionError('loaded')", name="eager", group="qinit.families")
    script = (
        "import sys\n"
        "from qinit_cli.app import run\n"
        "from qinit_cli.environments import FAMILIES\n"
        "FAMILIES['gridworld']\n"
        "assert run(['--help']) == 0 and run(['list']) == 0\n"
        "print('eager_code' in sys.modules)\n"
        "list(FAMILIES)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{script}"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=60,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.endswith("False\n")
    assert "the family eager of eager 1.5 is left out: loading it raised AssertionError" in ended.stderr


def test_our_own_families_lack_nothing() -> None:
    for name in FAMILIES:
        assert FAMILIES._fault(FAMILIES[name]) == ""
