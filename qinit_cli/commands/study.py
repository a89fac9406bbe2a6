"""`qinit study init|check|run|status|export FILE`: a whole experiment in one file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from qinit_cli import cores
from qinit_cli.commands.console import print_path
from qinit_cli.commands.option_groups import DISPLAY, Display, Group, store_option
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import TasksFailed
from qinit_cli.options import check, option
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.study.reading import Study
    from qinit_cli.study.work import StudyWork

FILE = Reference("file", "The study, such as study.toml.")


@dataclass(frozen=True)
class Selection:
    """How much of the study."""

    scale: str | None = option(
        None, "One of the scales that the file describes.", metavar="NAME", default_text="as it stands"
    )
    source_sets: int | None = option(
        None, "Source sets, of seeds 0 to N-1.", low=1, metavar="N", default_text="as the file has it"
    )
    only: list[str] | None = option(
        None,
        "A picture, a table or a part of the file, with what it needs; may be given several times.",
        metavar="NAME",
        default_text="all of it",
    )

    def __post_init__(self) -> None:
        check(self)

    def study(self, file: str) -> Study:
        """The study of that file, as far as it is asked for."""
        from qinit_cli.study.reading import Study

        return Study.read(Path(file), self.scale, self.source_sets).only(self.only or ())


@dataclass(frozen=True)
class Placing:
    """Where it stands."""

    output: str | None = option(
        None,
        "The folder of the report, tables and pictures.",
        short="-o",
        metavar="DIR",
        default_text="the file's name, with -results",
    )
    store: str = store_option()

    def folder(self, study: Study) -> Path:
        """The folder asked for, else one beside no other study's."""
        scale = f"-{study.scale}" if study.scale else ""
        return Path(self.output or f"{study.file.stem}{scale}-results")


@dataclass(frozen=True)
class Running:
    """How it is run."""

    force: bool = option(False, "Replace a study of other settings in that folder.", seldom=True)
    wait: bool = option(False, "Wait while another process writes the same artefact.", seldom=True)
    json: bool = option(False, "Print one JSON object instead of the folder.")


@dataclass(frozen=True)
class Threads:
    """How much of the machine is used; no number depends on it."""

    jobs: int | None = option(
        None, "Tasks learned at once.", low=1, high=cores.MOST_JOBS, default_text="all cores", metavar="N"
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class AsJson:
    """How it is printed."""

    json: bool = option(False, "Print one JSON object.")


SELECTION, PLACING, THREADS = Group(Selection, "Study"), Group(Placing, "Files"), Group(Threads, "Machine")


def add_to(actions: typer.Typer, only: str | None = None) -> None:
    """Adds the subcommands."""
    from qinit_cli.commands import study_export  # reads the options of this file

    add_command(
        actions,
        "check",
        check_study,
        {
            "selection": SELECTION,
            "placing": PLACING,
            "machine": THREADS,
            "as_json": Group(AsJson, "Output"),
            "display": DISPLAY,
        },
        references=(FILE,),
        help="Validate a study and report what it would take, from short trials; make nothing.",
    )
    add_command(
        actions,
        "run",
        run_study,
        {
            "selection": SELECTION,
            "placing": PLACING,
            "running": Group(Running, "Files"),
            "machine": THREADS,
            "display": DISPLAY,
        },
        references=(FILE,),
        help="Make what is missing of a study, then its tables, pictures and report; prints the folder.",
    )
    study_export.add_to(actions)


def work_of(
    study: Study, placing: Placing, machine: Threads, *, force: bool = False, wait: bool = False
) -> StudyWork:
    """The study in its store and its folder."""
    from qinit_cli.commands.option_groups import Output
    from qinit_cli.pipeline.machine import Machine
    from qinit_cli.study.manifest import STUDY
    from qinit_cli.study.work import StudyWork

    asked = {
        "study": study.title,
        "question": study.question,
        "file": str(study.file),
        "scale": study.scale,
        "source_sets": study.sets,
        "only": list(study.selected),
    }
    return StudyWork(
        study,
        study.file.name,
        STUDY,
        asked,
        placing.folder(study),
        Output(store=placing.store, wait=wait).keeping,
        Machine(jobs=machine.jobs),
        force,
    )


def check_study(
    file: str,
    selection: Selection,
    placing: Placing,
    machine: Threads,
    as_json: AsJson,
    display: Display,
) -> None:
    """Prints what there is and what is still to be made."""
    from qinit_cli.commands.console import Printed

    ahead = work_of(selection.study(file), placing, machine).plan()
    if as_json.json:
        print(json.dumps(ahead.told(), allow_nan=False))
    else:
        ahead.report(Printed(display))


def run_study(
    file: str,
    selection: Selection,
    placing: Placing,
    running: Running,
    machine: Threads,
    display: Display,
) -> None:
    """Makes what is missing and prints the folder; TasksFailed where an artefact could not be made."""
    from qinit_cli.commands.whole_bar import PrintedWhole

    work = work_of(selection.study(file), placing, machine, force=running.force, wait=running.wait)
    reporter = PrintedWhole(display)
    ahead = work.plan()
    ahead.report(reporter)
    done = work.make(ahead, reporter)
    if running.json:
        print(json.dumps(done, allow_nan=False), flush=True)
    else:
        print_path(Path(done["path"]))
    if work.failed:
        raise TasksFailed(
            f"{counted(len(work.failed), 'artefact, picture or table', 'artefacts, pictures and tables')} failed; the same "
            "command tries them again"
        )
