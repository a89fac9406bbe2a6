"""`qinit study init|check|run|status|export FILE`: a whole experiment in one file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli import cores
from qinit_cli.commands.console import print_path
from qinit_cli.commands.option_groups import DISPLAY, Display, Group, store_option
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import TasksFailed
from qinit_cli.nearest import nearest
from qinit_cli.options import check, option
from qinit_cli.pipeline.machine import Machine
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.pipeline.reporter import Reporter
    from qinit_cli.pipeline.slurm import SlurmJobs
    from qinit_cli.study.ahead import Ahead
    from qinit_cli.study.reading import Study
    from qinit_cli.study.work import StudyWork

ON_A_CLUSTER = 8  # artefacts at once: those that have few tasks left do not leave workers idle
OF_SLURM = ("cores", "memory", "walltime", "partition", "account", "interface", "logs")
FILE = Reference("file", "The study, such as study.toml.")


@dataclass(frozen=True)
class StudySelection:
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
        default_text="the file's name, the scale's if there is one, and results",
    )
    store: str = store_option()

    def folder(self, study: Study) -> Path:
        """The folder asked for, else one of the file's name, and the scale's, in the working directory."""
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
class Spread(Threads):
    """Where it is made."""

    dask: str | None = option(
        None,
        "Learn on the Dask cluster of this scheduler, several artefacts at once.",
        metavar="ADDRESS|SCHEDULER-FILE",
        default_text="this machine",
    )
    slurm: str | None = option(
        None,
        f"Learn by so many jobs of Slurm, submitted for the time of the study; KEY is one of {', '.join(OF_SLURM)}.",
        metavar="JOBS[:KEY=VALUE,...]",
        default_text="this machine",
        seldom=True,
    )
    at_once: int | None = option(
        None, "Artefacts made at once.", low=1, high=64, metavar="N", default_text="1; on a cluster 8"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.slurm is not None and self.dask is not None:
            raise ValueError(
                "--slurm submits workers, and --dask names a cluster that has them; leave one of them out"
            )
        self._machine(self.dask)
        self.submitted()

    @property
    def artefacts(self) -> int:
        """How many artefacts are made at once."""
        here = self.dask is None and self.slurm is None
        return self.at_once or (1 if here else ON_A_CLUSTER)

    @contextmanager
    def machine(self, tell: Callable[[str], None]) -> Iterator[Machine]:
        """Where tasks are learned, for the time of a block; `tell` hears what is waited for."""
        jobs = self.submitted()
        if jobs is None:
            yield self._machine(self.dask)
            return
        from qinit_cli.pipeline.slurm import slurm_cluster

        with slurm_cluster(jobs, tell) as address:
            yield self._machine(address)

    def submitted(self) -> SlurmJobs | None:
        """What Slurm is asked for; ValueError where --slurm is no such thing."""
        if self.slurm is None:
            return None
        from qinit_cli.pipeline.slurm import SlurmJobs

        count, _, rest = self.slurm.partition(":")
        if not count.isdigit():
            raise ValueError(
                f"--slurm is {self.slurm!r}; write JOBS[:KEY=VALUE,...], such as 20:cores=16,walltime=04:00:00"
            )
        given: dict[str, Any] = {}
        # times have colons of their own, and only the first divides
        for part in rest.split(",") if rest else ():
            key, _, value = part.partition("=")
            if key in OF_SLURM and not value:
                raise ValueError(f"--slurm is {self.slurm!r}, with no value of {key}; write {key}=VALUE")
            if key not in OF_SLURM:
                raise ValueError(
                    f"--slurm is {self.slurm!r}: {key!r} is no KEY of it; {nearest(key, OF_SLURM)}"
                )
            if key in given:
                raise ValueError(f"--slurm is {self.slurm!r}, with {key} given twice; leave one of them out")
            if key == "cores" and not value.isdigit():
                raise ValueError(f"--slurm is {self.slurm!r}: cores is a whole number")
            given[key] = int(value) if key == "cores" else value
        return SlurmJobs(int(count), **given)

    def _machine(self, dask: str | None) -> Machine:
        return Machine(jobs=self.jobs, dask=dask)


@dataclass(frozen=True)
class AsJson:
    """How it is printed."""

    json: bool = option(False, "Print one JSON object.")


SELECTION, PLACING = Group(StudySelection, "Study"), Group(Placing, "Files")
THREADS, SPREAD = Group(Threads, "Machine"), Group(Spread, "Machine")


def add_to(actions: typer.Typer, only: str | None = None) -> None:
    """Adds the subcommands."""
    # here, as they read the options of this file
    from qinit_cli.commands import study_export, study_init, study_status

    study_init.add_to(actions)
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
            "machine": SPREAD,
            "display": DISPLAY,
        },
        references=(FILE,),
        help="Make what is missing of a study, then its tables, pictures and report; prints the folder.",
    )
    study_status.add_to(actions)
    study_export.add_to(actions)


def work_of(
    study: Study,
    placing: Placing,
    machine: Machine,
    *,
    force: bool = False,
    wait: bool = False,
    at_once: int = 1,
) -> StudyWork:
    """The study in its store and its folder."""
    from qinit_cli.commands.option_groups import Output
    from qinit_cli.study.manifest import STUDY
    from qinit_cli.study.work import StudyWork

    asked = {
        "study": study.file.name,
        "scale": study.scale,
        "source_sets": study.sets,
        "only": list(study.selected),
    }
    told = {"title": study.title, "question": study.question, "file_sha256": study.digest}
    keeping = Output(store=placing.store, wait=wait).keeping
    return StudyWork(
        study,
        study.file.name,
        STUDY,
        asked,
        told,
        placing.folder(study),
        keeping,
        machine,
        force,
        at_once,
    )


def check_study(
    file: str,
    selection: StudySelection,
    placing: Placing,
    machine: Threads,
    as_json: AsJson,
    display: Display,
) -> None:
    """Prints what there is and what is still to be made."""
    from qinit_cli.commands.console import Printed

    ahead = work_of(selection.study(file), placing, Machine(jobs=machine.jobs)).plan()
    if as_json.json:
        print(json.dumps(ahead.told(), allow_nan=False))
    else:
        ahead.report(Printed(display))


def run_study(
    file: str,
    selection: StudySelection,
    placing: Placing,
    running: Running,
    machine: Spread,
    display: Display,
) -> None:
    """Makes what is missing and prints the folder; TasksFailed where an artefact could not be made."""
    from qinit_cli.commands.whole_bar import PrintedWhole

    study, reporter = selection.study(file), PrintedWhole(display)
    with machine.machine(reporter.note) as there:
        work = work_of(
            study, placing, there, force=running.force, wait=running.wait, at_once=machine.artefacts
        )
        finish(work, work.plan(), reporter, as_json=running.json)


def finish(work: StudyWork, ahead: Ahead, reporter: Reporter, *, as_json: bool) -> None:
    """Makes what is missing, and prints the folder or one JSON object; TasksFailed where something failed."""
    ahead.report(reporter)
    done = work.make(ahead, reporter)
    if as_json:
        print(json.dumps(done, allow_nan=False), flush=True)
    else:
        print_path(Path(done["path"]))
    if work.failed:
        failed = counted(len(work.failed), "artefact, picture or table", "artefacts, pictures and tables")
        first = work.failed[0]  # named here too, as --quiet has no notes
        raise TasksFailed(
            f"{failed} failed, first {first.name} ({first.problem}); the same command tries again what failed"
        )
