"""`qinit study export`: a study as plain commands for make, Snakemake, a shell or Slurm."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import typer

from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, Display, Group
from qinit_cli.commands.study import FILE, SELECTION, StudySelection
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import check, option
from qinit_cli.study.exporting import OMITTED
from qinit_cli.study.forms import BY_NAME, ENDINGS, Form

# of names in a Makefile and a Snakefile, which cannot be quoted
FOLDER = re.compile(r"[A-Za-z0-9_./][A-Za-z0-9_./-]*")
TIME = re.compile(r"[0-9]+(-[0-9]+)?(:[0-9]+){0,2}")


@dataclass(frozen=True)
class Script:
    """What is written, and where."""

    to: Form | None = option(
        None, "What runs the script.", default_text="by the name of -o: Makefile, Snakefile, .sh, .sbatch"
    )
    output: str | None = option(
        None, "The file of the script.", short="-o", metavar="FILE", default_text="standard output"
    )
    folder: str = option("results", "The folder that its commands write into.", metavar="DIR")
    force: bool = option(False, "Replace a file of that name with other content.", seldom=True)

    def __post_init__(self) -> None:
        check(self)
        if not FOLDER.fullmatch(self.folder):
            raise UsageError(
                f"--folder {self.folder!r} has characters that make and Snakemake read as something else; use letters, "
                "digits, _ . / and -"
            )

    @property
    def form(self) -> Form:
        """The form asked for, or that of the file's name; UsageError where neither tells."""
        if self.to is not None:
            return self.to
        path = Path(self.output or "")
        found = BY_NAME.get(path.name) or ENDINGS.get(path.suffix)
        if found is None:
            raise UsageError(
                "neither --to nor the name of -o tells what reads the script; give --to make, snakemake, sh or sbatch"
            )
        return found


@dataclass(frozen=True)
class Submitting:
    """How jobs are submitted (sbatch)."""

    shards: int | None = option(
        None, "Jobs that share the tasks of each sources artefact.", low=1, metavar="N", default_text="1"
    )
    cpus_per_task: int | None = option(None, "Cores of each job.", low=1, metavar="N", default_text="1")
    time: str | None = option(
        None, "Time that each job may take, such as 2:00:00.", metavar="TIME", default_text="the cluster's"
    )

    def __post_init__(self) -> None:
        check(self)
        if self.time is not None and not TIME.fullmatch(self.time):
            raise UsageError(f"--time is {self.time!r}; it must be minutes, H:M:S or D-H:M:S")

    def check_form(self, form: Form) -> None:
        """UsageError where an option is given that the form has no use for."""
        given = [name for name in ("shards", "cpus_per_task", "time") if getattr(self, name) is not None]
        if given and form != "sbatch":
            raise UsageError(
                f"--{given[0].replace('_', '-')} is for jobs of Slurm, and this is for {form}; leave it out, or give --to sbatch"
            )


def add_to(actions: typer.Typer) -> None:
    """Adds the subcommand."""
    add_command(
        actions,
        "export",
        export_study,
        {
            "selection": SELECTION,
            "written": Group(Script, "Script"),
            "submitting": Group(Submitting, "Slurm"),
            "display": DISPLAY,
        },
        references=(FILE,),
        help="Write a study as plain commands for make, Snakemake, a shell or Slurm; make nothing.",
    )


def export_study(
    file: str, selection: StudySelection, written: Script, submitting: Submitting, display: Display
) -> None:
    """Writes the script and prints its path, or prints the script."""
    form = written.form
    submitting.check_form(form)
    from qinit_cli.output_file import OutputFile
    from qinit_cli.study.exporting import exported
    from qinit_cli.study.scripts import Slurm, script

    commands = exported(selection.study(file), written.folder.rstrip("/") or "/")
    slurm = Slurm(submitting.shards or 1, submitting.cpus_per_task or 1, submitting.time or "")
    text = script(commands, form, slurm)
    for name in commands.omitted:
        note(display, f"{name} is left out: {OMITTED}")
    if written.output is None:
        print(text, end="", flush=True)
        return
    path, content = Path(written.output), text.encode()
    target = OutputFile(path, written.force)
    target.check_content(content)
    if not target.settle(content):
        target.write(content)
    print_path(path)
