"""`qinit study init`: a commented study to begin with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, Display, Group
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.options import check, option
from qinit_cli.study.questions import Question


@dataclass(frozen=True)
class ExampleAsked:
    """What is asked, and of which tasks."""

    question: Question = option(
        "methods",
        "What is asked: which method fits (methods), how many source tasks are needed (sources), or which setting decides "
        "(settings).",
        metavar="[QUESTION]",
        positional=True,
    )
    family: str = option(
        "gridworld", "The family that tasks are drawn from, as of qinit train-sources.", metavar="NAME"
    )
    of: str | None = option(
        None,
        "What the family needs first: the id of gym, the file of tasks.",
        metavar="TEXT",
        default_text="a line to fill in",
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Written:
    """Where it goes."""

    output: str = option("study.toml", "Write it here.", short="-o", metavar="FILE")
    force: bool = option(False, "Replace a file of that name with other content.", seldom=True)


def add_to(actions: typer.Typer) -> None:
    """Adds the subcommand."""
    add_command(
        actions,
        "init",
        init_study,
        {"beginning": Group(ExampleAsked, "Study"), "written": Group(Written, "Files"), "display": DISPLAY},
        help="Write a commented study to begin with, for a question; prints its path.",
    )


def init_study(beginning: ExampleAsked, written: Written, display: Display) -> None:
    """Writes the study and prints its path."""
    from qinit_cli.output_file import OutputFile, check_one_line
    from qinit_cli.study.example import FILL_IN, example

    path = Path(written.output)
    check_one_line(path)
    text = example(beginning.question, beginning.family, beginning.of, written.output)
    target, content = OutputFile(path, written.force), text.encode()
    target.check_content(content)
    if not target.settle(content):
        target.write(content)
    for number, line in enumerate(text.splitlines(), 1):
        if FILL_IN in line:
            note(display, f"{path}, line {number} is to be filled in")
    print_path(path)
