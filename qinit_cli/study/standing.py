"""How far a study is, for another terminal while it is run: what stands in its store, and what its folder says of the run."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed
from qinit_cli.study.folder import PROGRESS, read_manifest
from qinit_cli.study.planned import STAGES, Artefact, inputs, named
from qinit_store.wording import counted, first_few

if TYPE_CHECKING:
    from qinit_cli.study.making import Place
    from qinit_cli.study.work import StudyWork

SCHEMA = "qinit.study-progress/1"  # of the file that a run keeps
COMPLETE, UNFINISHED, WAITING, MISSING = "complete", "unfinished", "waiting", "missing"


@dataclass(frozen=True)
class Standing:
    """One artefact of a study."""

    stage: str
    name: str
    state: str
    saved: int  # tasks of an unfinished one
    tasks: int | None  # that it has or will have; None: a fit, or unknown before what it waits for is there
    waits_for: str  # name of the first input that is not there
    path: Path | None  # None: unknown yet

    @property
    def words(self) -> str:
        """The state as people read it."""
        if self.state == UNFINISHED:
            return f"{self.saved} of {counted(self.tasks or 0, 'task')}"
        return f"waits for {self.waits_for}" if self.state == WAITING else self.state


@dataclass(frozen=True)
class RunUnderWay:
    """What progress.json says of the run that keeps it."""

    pid: int
    host: str
    age: float  # seconds since it was written
    running: float  # seconds from its start until then
    begun: int
    of: int  # artefacts, pictures and tables
    under_way: tuple[tuple[str, float], ...]  # names, and the share of each that is done
    left: float  # seconds, from now on
    alive: bool | None  # None: a process of another machine

    def told(self) -> dict[str, Any]:
        """All of it as plain values."""
        under_way = [{"what": what, "share": share} for what, share in self.under_way]
        return asdict(self) | {"under_way": under_way, "age": round(self.age, 1), "left": round(self.left, 1)}

    @property
    def words(self) -> str:
        """The same in one line."""
        from qinit_cli.study.ahead import duration

        what = first_few([f"{what} ({share:.0%})" for what, share in self.under_way], 3) or "nothing yet"
        told = f"{self.begun} of {self.of} begun, under way: {what}"
        if self.alive is False:
            return (
                f"no run is at work: process {self.pid} ended, at most {duration(self.age)} ago ({told}); "
                "the same qinit study run goes on"
            )
        where = f"process {self.pid}" if self.alive else f"process {self.pid} on {self.host}"
        return f"{told}; about {duration(self.left)} left; {where}, updated {duration(self.age)} ago"


def standing(work: StudyWork) -> list[Standing]:
    """Each artefact of the study, in the order in which they are made; nothing is learned, and no task is read."""
    places = work.find()
    return [_standing(one, places.get(one), work) for one in work.artefacts]


def _standing(artefact: Artefact, place: Place | None, work: StudyWork) -> Standing:
    stage, name = STAGES[type(artefact)], named(artefact)
    if place is None:
        lacking = next(given for given in inputs(artefact) if given not in work.found)
        return Standing(stage, name, WAITING, 0, None, named(lacking), None)
    if place.there is not None:
        return Standing(stage, name, COMPLETE, 0, place.tasks, "", place.path)
    saved = place.saved
    return Standing(stage, name, UNFINISHED if saved else MISSING, saved, place.tasks, "", place.path)


def by_stage(standings: Sequence[Standing]) -> list[dict[str, Any]]:
    """A row for each stage that has artefacts: how many are complete, unfinished and missing, and the tasks saved."""
    rows = []
    for stage in STAGES.values():
        own = [one for one in standings if one.stage == stage]
        states = [one.state for one in own]
        if own:
            rows.append(
                {
                    "stage": stage,
                    "artefacts": len(own),
                    "complete": states.count(COMPLETE),
                    "unfinished": states.count(UNFINISHED),
                    "missing": states.count(MISSING) + states.count(WAITING),
                    "tasks_saved": sum(one.saved for one in own),
                }
            )
    return rows


def run_under_way(folder: Path) -> RunUnderWay | None:
    """The run that keeps its progress in the folder, even one that was killed; None where there is none.

    NotAllowed where the file is no such progress.
    """
    path = folder / PROGRESS
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        if told["schema"] != SCHEMA:
            raise ValueError(told["schema"])
        age = max(0.0, time.time() - float(told["updated"]))
        here = told["host"] == os.uname().nodename
        pid = int(told["pid"])
        return RunUnderWay(
            pid,
            str(told["host"]),
            age,
            float(told["running"]),
            int(told["begun"]),
            int(told["of"]),
            tuple((str(one["what"]), float(one["share"])) for one in told["under_way"]),
            max(0.0, float(told["left"]) - age),
            _lives(pid) if here else None,
        )
    except FileNotFoundError:
        return None
    except NotADirectoryError as error:
        raise NotAllowed(f"-o {folder} is a file; name a folder") from error
    except (ValueError, KeyError, TypeError) as error:
        raise NotAllowed(f"{path} is no progress of a study that this qinit knows; remove it") from error


def _lives(pid: int) -> bool:
    """Whether a process of this machine has that number."""
    if pid <= 0:  # which stand for groups of processes
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # it is somebody else's
        return True
    return True


def failed(work: StudyWork) -> list[dict[str, str]]:
    """What the last run in the study's folder could not make or draw; NotAllowed where the folder is another study's."""
    before = read_manifest(work.output, work.kind)
    if before is None:
        return []
    if before.get("study") != work.asked["study"]:
        raise NotAllowed(
            f"{work.output} holds the study {before.get('study')}, not {work.asked['study']}; name its folder with -o"
        )
    return [dict(one) for one in before.get("failed", [])]
