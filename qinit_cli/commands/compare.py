"""`qinit compare`: runs side by side."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, TABULAR, Display, Reading, Tabular
from qinit_cli.commands.messages import note
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.runs import Run
    from qinit_cli.stages.compare import Comparison, Estimate

SCHEMA = "qinit.compare/1"
MARKS = {"privileged": "†", "reconstruction": "‡"}  # at a method's name, for people


@dataclass(frozen=True)
class Comparing:
    """What is compared, and with what."""

    baseline: str = option("zero", "The method, or the artefact's name, that the others are set against.")
    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )

    greedy: bool = option(
        False, "Compare the greedy evaluations (transfer --evaluate-every) instead of the episodes."
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "compare",
        compare,
        {
            "comparing": Group(Comparing, "Comparison"),
            "tabular": TABULAR,
            "reading": READING,
            "display": DISPLAY,
        },
        references=(Reference("runs", "Runs: paths, names in the store, or - for stdin.", several=True),),
        help="Compare runs: averages, and differences to a baseline on the same targets, with 95 % intervals.",
    )


def compare(
    runs: list[str], comparing: Comparing, tabular: Tabular, reading: Reading, display: Display
) -> None:
    """Prints one table per set of shared targets."""
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_cli.stages import compare as stage

    found = read_runs(runs, reading.store)
    if comparing.greedy:
        found = [run.greedy() for run in found]
    comparisons = stage.compare(found, comparing.baseline, comparing.metric)
    columns = [
        TableColumn("method"),
        TableColumn(comparing.metric, comparing.metric, 4, interval=True),
        TableColumn("difference", f"minus {comparing.baseline}", 4, interval=True),
        TableColumn("p", "p", 4, dispensable=True),
        TableColumn(
            "jumpstart",
            "first" if comparing.greedy else "first 10",
            4,
            interval=True,
            bounds_shown=False,
            dispensable=True,
        ),
        TableColumn("asymptotic", "last 10%", 4, interval=True, bounds_shown=False, dispensable=True),
        TableColumn("regret", "regret", 4, interval=True, bounds_shown=False, dispensable=True),
        TableColumn("success", digits=3, dispensable=True),
        TableColumn("restricted_steps", "steps", 1, dispensable=True),
        TableColumn("remark"),
    ]
    for comparison in comparisons:
        if comparison.baseline is None:
            note(
                display,
                f"{comparison.title}: no run of {comparing.baseline}, so no differences; "
                f"qinit transfer {comparing.baseline} FIT makes one",
            )
        if comparison.rows[0].regret is None:
            note(
                display,
                f"{comparison.title}: regret needs a run of optimal; qinit transfer optimal FIT makes one",
            )
    if tabular.chosen == "table":  # people read one table per set of targets, programs one in all
        for comparison in comparisons:
            plain = _rows(comparison, comparing.metric)
            rows = [_marked(row) for row in plain]
            marks = [
                f"{MARKS[remark]} {remark}"
                for remark in MARKS
                if any(row["remark"] == remark for row in plain)
            ]
            caption = "\n".join([comparison.intervals, *marks])
            print_table(SCHEMA, columns[:-1], rows, tabular, display, title=comparison.title, caption=caption)
        return
    everything = [TableColumn("targets"), TableColumn("sets"), *columns]
    whole = told(comparisons, comparing.metric)
    print_table(SCHEMA, everything, whole["rows"], tabular, display, extra={"intervals": whole["intervals"]})


def told(comparisons: list[Comparison], metric: str) -> dict[str, Any]:
    """All of it as plain values, as --format json prints it: rows, and what the intervals of each set of targets are over."""
    return {
        "schema": SCHEMA,
        "intervals": [
            {"targets": one.title, "over": one.intervals, "baseline": one.baseline} for one in comparisons
        ],
        "rows": [row for one in comparisons for row in _rows(one, metric)],
    }


def read_runs(references: list[str], store: str) -> list[Run]:
    """The runs that the references name, verified; each once, those of one file name told apart by their folders."""
    from qinit_cli.commands import references as named
    from qinit_cli.runs import Run
    from store.reading import open_artefact

    found: dict[str, tuple[Path, Run]] = {}
    for path in named.many(references, store):
        with open_artefact(path, "run") as artefact:
            found.setdefault(artefact.content_sha256, (path, Run.from_artefact(artefact)))
    count = Counter(run.name for _, run in found.values())
    return [
        run if count[run.name] == 1 else replace(run, name=str(path.with_suffix("")))
        for path, run in found.values()
    ]


def _rows(comparison: Comparison, metric: str) -> list[dict[str, Any]]:
    return [
        {
            "targets": comparison.title,
            "method": row.label,
            "sets": row.sets,
            **_bounds(metric, row.average),
            **_bounds("difference", row.difference),
            "p": row.p,
            **_bounds("jumpstart", row.jumpstart),
            **_bounds("asymptotic", row.asymptotic),
            **_bounds("regret", row.regret),
            "success": row.success,
            "restricted_steps": row.steps,
            "remark": row.remark,
        }
        for row in comparison.rows
    ]


def _marked(row: dict[str, Any]) -> dict[str, Any]:
    """The row with its remark as a mark at the method, which the caption explains."""
    return row | {"method": row["method"] + MARKS.get(row["remark"], "")}


def _bounds(key: str, estimate: Estimate | None) -> dict[str, float | None]:
    if estimate is None:
        return {key: None, f"{key}_low": None, f"{key}_high": None}
    return {key: estimate.mean, f"{key}_low": estimate.low, f"{key}_high": estimate.high}
