"""The contract of the command line, read from the registries: every family, method and option has its help."""

from __future__ import annotations

import re
import resource
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.core import TyperGroup

from qinit_cli.app import EXAMPLES, LATER, app
from qinit_cli.commands.help import Command
from qinit_cli.environments import FAMILIES
from qinit_cli.methods import METHODS
from qinit_cli.options import flag, options

HEAVY = ("numpy", "scipy", "h5py", "numba", "matplotlib", "rich")
README = Path(__file__).parents[2] / "README.md"

Run = Callable[..., Any]


def _commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command and group with its words."""
    yield path, group
    if isinstance(group, TyperGroup):
        for name in group.list_commands(None):
            yield from _commands(group.get_command(None, name), (*path, name))


COMMANDS = dict(_commands(typer.main.get_command(app)))
NAMES = [" ".join(path) for path in COMMANDS]


@pytest.fixture
def helped(here: Run, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], list[str]]:
    """The lines of a command's help, each with those that carry it on."""
    monkeypatch.setenv("COLUMNS", "400")

    def call(command: str, spelled: str = "--help-all") -> list[str]:
        ended = here(*command.split(), spelled)
        assert ended.code == 0, ended.err
        assert ended.err == ""
        lines: list[str] = []
        for line in ended.out.splitlines():
            if line.startswith("   ") and lines[-1]:
                lines[-1] += f" {line.strip()}"
            else:
                lines.append(line)
        return lines

    return call


def _line_of(option: str, lines: list[str]) -> str:
    spelled = (line.strip().split("  ")[0].replace(",", " ").split() for line in lines)
    [line] = [line for line, words in zip(lines, spelled, strict=True) if words and option in words[:2]]
    return line


def test_the_contract_s_commands_are_there() -> None:
    assert {"train-sources gridworld", "fit", "transfer zero", "compare", "list", "plot curves"} <= set(NAMES)


def test_every_family_and_every_method_has_a_subcommand() -> None:
    assert {path[1] for path in COMMANDS if path[:1] == ("train-sources",) and path[1:]} == FAMILIES.keys()
    assert {path[1] for path in COMMANDS if path[:1] == ("transfer",) and path[1:]} == METHODS.keys()


@pytest.mark.parametrize("command", NAMES)
@pytest.mark.parametrize("spelled", ["-h", "--help", "--help-all"])
def test_every_command_has_help(command: str, spelled: str, helped: Callable[..., list[str]]) -> None:
    lines = helped(command, spelled)
    assert f"Usage: {' '.join(['qinit', command]).strip()}" in "\n".join(lines[:2])


@pytest.mark.parametrize("command", NAMES)
def test_every_option_of_every_command_says_what_it_does(
    command: str, helped: Callable[..., list[str]]
) -> None:
    lines = helped(command)
    for parameter in COMMANDS[tuple(command.split())].params:
        if parameter.param_type_name == "option":
            assert parameter.help, parameter.opts
            assert parameter.help in _line_of(parameter.opts[0], lines)


@pytest.mark.parametrize(
    ("command", "owner"),
    [
        *((f"train-sources {name}", family) for name, family in FAMILIES.items()),
        *((f"transfer {name}", method) for name, method in METHODS.items()),
    ],
)
def test_every_field_of_families_and_methods_is_an_option_with_its_help_and_default(
    command: str, owner: type[Any], helped: Callable[..., list[str]]
) -> None:
    lines = helped(command)
    first = (owner.__doc__ or "").splitlines()[0]
    assert first in " ".join(line.strip() for line in lines)
    for field in options(owner):
        told = field.metadata["metavar"] if field.metadata["positional"] else flag(field.name)
        line = _line_of(told, lines)
        assert field.metadata["help"] in line
        if field.metadata["positional"]:
            continue
        if field.metadata["default_text"]:
            assert f"[default: ({field.metadata['default_text']})]" in line
        elif field.default is not None and field.default is not False:
            assert f"[default: {field.default}]" in line


def test_defaults_from_the_family_are_told(helped: Callable[..., list[str]]) -> None:
    for name, family in FAMILIES.items():
        lines = helped(f"train-sources {name}")
        learning = family.source_learning
        for setting in ("episodes", "alpha", "gamma", "epsilon", "start", "horizon"):
            told = re.search(r"default: \(([^),]*)", _line_of(flag(setting), lines))
            assert told is not None
            assert told[1] == str(getattr(learning, setting))
        assert f"default: ({family.source_tasks or 'all there are'})" in _line_of("--tasks", lines)
    lines = helped("transfer zero")
    assert f"gridworld {FAMILIES['gridworld'].target_tasks}" in _line_of("--tasks", lines)
    assert "[default: (from the fit)]" in _line_of("--gamma", lines)


@pytest.mark.parametrize(
    "command",
    [*(f"train-sources {name}" for name in FAMILIES), "fit", *(f"transfer {name}" for name in METHODS)],
)
def test_every_stage_has_the_options_of_the_contract(command: str) -> None:
    given = {each for parameter in COMMANDS[tuple(command.split())].params for each in parameter.opts}
    assert {
        "-o",
        "--store",
        "--json",
        "--force",
        "--wait",
        "-q",
        "-v",
        "--color",
        "--debug",
        "-h",
    } <= given | {
        "-h"  # typer's own
    }
    if command != "fit":
        assert {"--jobs", "--tasks", "--seed", "--episodes", "--horizon", "--alpha", "--gamma"} <= given


def test_sources_have_the_options_of_the_contract() -> None:
    given = {each for parameter in COMMANDS["train-sources", "gridworld"].params for each in parameter.opts}
    names = ("size", "goals", "mean", "variance", "p-low", "p-high", "learner", "epsilon", "start")
    assert {f"--{name}" for name in names} <= given


def test_transfer_and_compare_have_the_options_of_the_contract() -> None:
    given = {each for parameter in COMMANDS["transfer", "zero"].params for each in parameter.opts}
    assert {"--shift", "--keep-q"} <= given
    given = {each for parameter in COMMANDS["compare",].params for each in parameter.opts}
    assert {"--baseline", "--metric", "--format"} <= given


def test_help_fits_eighty_columns(here: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for command in NAMES:
        lines = here(*command.split(), "--help-all").out.splitlines()
        assert max(map(len, lines)) <= 80, command


@pytest.mark.parametrize("spelled", ["-V", "--version"])
def test_the_version_is_told(spelled: str, here: Run) -> None:
    from qinit_cli import __version__

    ended = here(spelled)
    assert (ended.code, ended.out, ended.err) == (0, f"qinit {__version__}\n", "")


def test_the_version_is_the_packages() -> None:
    from importlib.metadata import version

    from qinit_cli import __version__

    assert version("qinit") == __version__


def test_help_and_version_import_nothing_heavy() -> None:
    script = (
        "import contextlib, io, sys\n"
        "from qinit_cli.__main__ import main\n"
        "from qinit_cli.app import run\n"
        "for line in sys.argv[2:]:\n"
        "    with contextlib.redirect_stdout(io.StringIO()):\n"
        "        assert run(line.split()) == 0, line\n"
        "print([name for name in sys.argv[1].split() if name in sys.modules])\n"
    )
    lines = ["--version", *(f"{name} {spelled}" for name in NAMES for spelled in ("--help", "--help-all"))]
    ended = subprocess.run(
        [sys.executable, "-c", script, " ".join(HEAVY), *lines], capture_output=True, text=True, timeout=60
    )
    assert (ended.stdout, ended.stderr, ended.returncode) == ("[]\n", "", 0)


@pytest.mark.parametrize("command", ["", *LATER])
def test_without_a_subcommand_the_help_stands_on_stderr_and_ends_with_two(command: str, here: Run) -> None:
    helped, bare = here(*command.split(), "--help"), here(*command.split())
    assert (bare.code, bare.out, bare.err) == (2, "", helped.out)
    assert bare.err.count("\n") > 15


def test_the_examples_work_as_they_stand(shell: Run) -> None:
    first, second, read_on = EXAMPLES
    made = shell(first)
    assert made.code == 0, made.err
    compared = shell(second)
    assert compared.code == 0, compared.err
    assert "maxqinit" in compared.out
    assert shell(read_on).code == 0


@pytest.mark.parametrize("command", LATER)
def test_a_group_s_example_works_as_it_stands(command: str, here: Run, pipeline: Any, tmp_path: Path) -> None:
    _, example = LATER[command]
    shutil.copy(pipeline.sources, tmp_path / "sources.h5")
    shutil.copy(pipeline.fit, tmp_path / "fit.h5")
    words = shlex.split(example)
    trial = () if command in ("plot", "start", "study", "tune") else ("--dry-run",)
    ended = here(*words[1:], *trial)
    assert words[:2] == ["qinit", command]
    assert ended.code == (4 if command == "tune" else 0), ended.err  # four sources are too few to choose by


SHOWN = {
    "--output",
    "--tasks",
    "--seed",
    "--episodes",
    "--jobs",
    "--store",
    "--json",
    "--dry-run",
    "--quiet",
    "--verbose",
}


@pytest.mark.parametrize(
    ("command", "owner"),
    [
        *((f"train-sources {name}", family) for name, family in FAMILIES.items()),
        *((f"transfer {name}", method) for name, method in METHODS.items()),
    ],
)
def test_the_short_help_shows_a_stage_s_own_and_common_options_and_says_where_the_others_are(
    command: str, owner: type[Any], helped: Callable[..., list[str]]
) -> None:
    lines = helped(command, "--help")
    for spelled in SHOWN | {flag(one.name) for one in options(owner) if not one.metadata["positional"]}:
        _line_of(spelled, lines)
    seldom = {"--alpha", "--gamma", "--horizon", "--dask", "--shard", "--debug", "--color", "--wait"}
    assert not [line for line in lines if seldom.intersection(line.split())]
    *_, last = lines
    assert last.endswith(f"more options: qinit {command} --help-all")
    left_out = len(COMMANDS[tuple(command.split())].seldom)
    assert last.startswith(f"{left_out} more")
    for spelled in seldom:
        _line_of(spelled, helped(command))


def test_every_number_with_a_range_shows_it(helped: Callable[..., list[str]]) -> None:
    lines = helped("train-sources gridworld")
    for spelled, told in (
        ("--epsilon", "[0 to 1]"),
        ("--gamma", "[above 0 and at most 1]"),
        ("--size", "[2 to 1000]"),
        ("--jobs", "[1 to 1024]"),
        ("--variance", "[at least 0]"),
    ):
        assert told in _line_of(spelled, lines)
    assert "[above 0 and below 1]" in _line_of("--quantile", helped("transfer logqinit-quantile"))
    assert "[above 0 and below 1]" in _line_of("--quantile", helped("tune logqinit-quantile"))


def test_completion_knows_every_option(qinit: Run) -> None:
    completed = {"_QINIT_COMPLETE": "complete_bash", "COMP_WORDS": "qinit fit --", "COMP_CWORD": "2"}
    words = qinit(env=completed).out.split()
    assert {"--help-all", "--help", "--force", "--debug"} <= set(words)


def test_nothing_that_typer_makes_up_stands_in_a_help(helped: Callable[..., list[str]]) -> None:
    for command in NAMES:
        text = "\n".join(helped(command))
        assert not [odd for odd in ("list[", "{", "}", "<bool>") if odd in text], command


def test_every_leaf_is_a_command_with_both_helps() -> None:
    leaves = [command for command in COMMANDS.values() if not isinstance(command, TyperGroup)]
    assert all(isinstance(leaf, Command) for leaf in leaves)


@pytest.mark.parametrize("command", ["fit", "compare", "plot curves", "transfer zero"])
def test_without_its_artefact_a_command_says_so_and_feeds_no_pipe(command: str, here: Run) -> None:
    ended = here(*command.split())
    assert (ended.code, ended.out) == (2, "")
    assert "Missing argument" in ended.err
    assert f"see qinit {command} --help" in ended.err


@pytest.mark.parametrize(
    "command", [name for name in NAMES if not isinstance(COMMANDS[tuple(name.split())], TyperGroup)]
)
def test_every_command_stands_in_the_readme(command: str) -> None:
    text = README.read_text()
    words = command.split()
    if words[0] in ("start", "transfer", "lifelong", "tune", "reproduce"):
        assert f"`{words[1]}`" in text
    else:
        assert f"qinit {command}" in text


@pytest.mark.soak
def test_help_takes_less_than_a_fifth_of_a_second() -> None:
    def once() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([Path(sys.executable).with_name("qinit"), "--help"], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    assert min(once() for _ in range(5)) < 0.2
