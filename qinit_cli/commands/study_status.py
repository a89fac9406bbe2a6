"""`qinit study status`: how far a study is, for another terminal while `qinit study run` is at work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, TABULAR, Display, Group, Tabular
from qinit_cli.commands.study import FILE, PLACING, SELECTION, Placing, StudySelection, work_of
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.options import option
from qinit_cli.pipeline.machine import Machine

if TYPE_CHECKING:
    from qinit_cli.study.standing import Standing

SCHEMA, OF_ARTEFACTS = "qinit.study-status/1", "qinit.study-status-artefacts/1"


@dataclass(frozen=True)
class StatusDetail:
    """How much is printed."""

    artefacts: bool = option(
        False, "A row for each artefact, with its state and path, instead of each stage."
    )


def add_to(actions: typer.Typer) -> None:
    """Adds the subcommand."""
    add_command(
        actions,
        "status",
        study_status,
        {
            "selection": SELECTION,
            "placing": PLACING,
            "detail": Group(StatusDetail, "Table"),
            "tabular": TABULAR,
            "display": DISPLAY,
        },
        references=(FILE,),
        help="Print how far a study is: artefacts by stage, what is under way, and what failed; make nothing.",
    )


def study_status(
    file: str,
    selection: StudySelection,
    placing: Placing,
    detail: StatusDetail,
    tabular: Tabular,
    display: Display,
) -> None:
    """Prints the table on stdout, and on stderr what is under way and what failed; in JSON all of it is one object."""
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_cli.study.standing import by_stage, failed, run_under_way, standing

    study = selection.study(file)
    work = work_of(study, placing, Machine())
    # before the store is looked at: a run that ends meanwhile leaves more there, not less
    run, problems = run_under_way(work.output), failed(work)
    standings = standing(work)
    if detail.artefacts:
        schema, rows = OF_ARTEFACTS, [_row(one) for one in standings]
        if tabular.chosen == "table":
            columns = [TableColumn(key) for key in ("stage", "name", "state")]
            columns.append(TableColumn("path", dispensable=True))
        else:
            columns = [TableColumn(key) for key in ("stage", "name", "state", "tasks_saved", "tasks", "path")]
    else:
        schema, rows = SCHEMA, by_stage(standings)
        keys = ("stage", "artefacts", "complete", "unfinished", "missing", "tasks_saved")
        columns = [TableColumn(key) for key in keys]
    extra = {
        "name": study.file.name,
        "scale": study.scale,
        "folder": str(work.output),
        "complete": len(work.found) == len(standings),
        "run": None if run is None else run.told(),
        "failed": problems,
    }
    print_table(schema, columns, rows, tabular, display, extra=extra)
    if tabular.chosen in ("json", "jsonl"):
        return
    note(display, "no run is at work" if run is None else run.words)
    for one in problems:
        alone = f"; alone it is {one['command']}" if one.get("command") else ""
        note(display, f"failed in the last run: {one['name']}: {one['problem']}{alone}")


def _row(one: Standing) -> dict[str, Any]:
    return {
        "stage": one.stage,
        "name": one.name,
        "state": one.words,
        "tasks_saved": one.saved,
        "tasks": one.tasks,
        "path": None if one.path is None else str(one.path),
    }
