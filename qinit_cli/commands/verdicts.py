"""`qinit verdicts`: the paper's claims, judged from artefacts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Group, Reading, Tabular
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import check, option

if TYPE_CHECKING:
    from qinit_cli.claims.verdict import Verdict
    from qinit_cli.commands.tables import TableColumn

DIGITS = 4
PEOPLE = ("table", "markdown")  # forms that are read, not parsed
HOLDS = {True: "yes", False: "no", None: ""}


@dataclass(frozen=True)
class Judging:
    """What is shown of the verdicts."""

    claim: list[str] | None = option(
        None, "Only this claim, such as C4; may be given several times.", metavar="CLAIM", default_text="all"
    )
    details: bool = option(False, "A row for each setting that was looked at, not one for each claim.")

    def __post_init__(self) -> None:
        check(self)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "verdicts",
        verdicts,
        {
            "judging": Group(Judging, "Verdicts"),
            "tabular": TABULAR,
            "reading": READING,
            "display": DISPLAY,
        },
        references=(
            Reference(
                "artefacts",
                "Sources, fits and runs of any number of source sets: paths, names in the store, or - for stdin.",
                several=True,
            ),
        ),
        help="Judge the paper's claims C1 to C13: holds, does not hold, depends on what, or what is lacking to tell.",
    )


def verdicts(
    artefacts: list[str], judging: Judging, tabular: Tabular, reading: Reading, display: Display
) -> None:
    """Prints a row for each claim, or for each setting that it was looked at in."""
    from qinit_cli.claims.verdict import SCHEMA
    from qinit_cli.commands import references
    from qinit_cli.commands.tables import print_table
    from qinit_cli.paper import verdicts as stage

    evidence = stage.evidence(stage.opened(references.many(artefacts, reading.store)))
    if evidence.passed_over:
        note(display, f"no claim is about {', '.join(dict.fromkeys(evidence.passed_over))}: passed over")
    found = _chosen(stage.verdicts(evidence), judging.claim)
    if judging.details:
        rows = [_with_bounds(row) for row in _detail_rows(found)]
        print_table(SCHEMA, _detail_columns(tabular.chosen), rows, tabular, display)
        return
    rows = [_with_bounds(verdict.told()) for verdict in found]
    if tabular.chosen in PEOPLE:
        rows = [_spoken(row) for row in rows]
    print_table(SCHEMA, _columns(tabular.chosen), rows, tabular, display, title="The paper's claims")


def _chosen(found: tuple[Verdict, ...], names: list[str] | None) -> list[Verdict]:
    known = [verdict.claim for verdict in found]
    for name in names or ():
        if name not in known:
            raise UsageError(f"--claim {name} is none of the paper's claims, which are {', '.join(known)}")
    return [verdict for verdict in found if not names or verdict.claim in names]


def _columns(form: str) -> list[TableColumn]:
    """What people read of a verdict, and all of it for programs; details stand in JSON alone, where rows may hold rows."""
    from qinit_cli.commands.tables import TableColumn

    number = _number(form)
    match form:
        case "table":
            names = [
                TableColumn("claim"),
                TableColumn("verdict"),
                *number,
                TableColumn("sets"),
                TableColumn("sentence"),
            ]
        case "markdown":
            names = [
                TableColumn("claim"),
                TableColumn("statement", "the paper's claim"),
                TableColumn("verdict"),
                *number,
                TableColumn("sets", "source sets"),
                TableColumn("sentence", "what was found"),
            ]
        case _:
            names = [
                *map(TableColumn, ("claim", "statement", "source", "verdict", "depends_on", "statistic")),
                *number,
                *map(TableColumn, ("sets", "sentence")),
                *map(TableColumn, ("details",) if form in ("json", "jsonl") else ()),
            ]
    return names


def _spoken(row: dict[str, Any]) -> dict[str, Any]:
    """The row with what its verdict depends on in the same words."""
    on = row["depends_on"]
    return row | {"verdict": f"{row['verdict']} on {on}"} if on else row


def _detail_columns(form: str) -> list[TableColumn]:
    from qinit_cli.commands.tables import TableColumn

    return [
        TableColumn("claim"),
        TableColumn("label", "looked at"),
        *_number(form),
        TableColumn("sets"),
        TableColumn("holds"),
    ]


def _number(form: str) -> list[TableColumn]:
    """The number and its interval: together for people, a column each for programs."""
    from qinit_cli.commands.tables import TableColumn

    if form in PEOPLE:
        return [TableColumn("value", "number", DIGITS, interval=True)]
    return [TableColumn(name) for name in ("value", "low", "high")]


def _with_bounds(row: dict[str, Any]) -> dict[str, Any]:
    """The row with its bounds where a column with an interval looks for them."""
    return row | {"value_low": row["low"], "value_high": row["high"]}


def _detail_rows(found: list[Verdict]) -> Iterator[dict[str, Any]]:
    for verdict in found:
        for row in verdict.told()["details"]:
            yield {"claim": verdict.claim, **row, "holds": HOLDS[row["holds"]]}
