"""`qinit compare`: runs side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Group, Reading, Tabular
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.learning import IMPORTED
from qinit_cli.options import check, option
from qinit_store.wording import shell_line

if TYPE_CHECKING:
    from qinit_cli.comparison.rows import GroupComparison
    from qinit_cli.comparison.runs import ComparedRun


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

    columns: str | None = option(
        None,
        "Only these, by their names in TSV, separated by commas: iqm,censored.",
        metavar="NAMES",
        default_text="all; on a terminal those that fit",
    )

    scores: str | None = option(
        None,
        "Also write the scores by method, (source sets, targets), as rliable takes them.",
        metavar="FILE.npz",
        default_text="none",
    )

    force: bool = option(False, "Replace a file of --scores with other content.", seldom=True)

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
    from qinit_cli.artefacts.settings import outdated
    from qinit_cli.commands import comparison_tables as tables
    from qinit_cli.commands import references
    from qinit_cli.commands.tables import print_table
    from qinit_cli.comparison import rows as stage
    from qinit_cli.comparison.runs import read_runs
    from qinit_cli.comparison.table import SCHEMA, plain_rows, told

    metric, baseline = comparing.metric, comparing.baseline
    if comparing.force and comparing.scores is None:
        raise UsageError("--force replaces the file of --scores, which is not given; leave it out")
    every = tables.columns(metric, baseline, greedy=comparing.greedy)
    columns = tables.chosen(every, comparing.columns)
    found = read_runs(references.many(runs, reading.store, output=comparing.scores))
    for warning in dict.fromkeys(warning for run in found for warning in outdated(run.settings)):
        note(display, f"warning: {warning}")
    if comparing.greedy:
        found = [run.greedy() for run in found]
    comparisons = stage.compare(found, baseline, metric)
    if comparing.scores is not None:
        _write_scores(Path(comparing.scores), found, comparing, display)
    for comparison in comparisons:
        _say_what_is_missing(comparison, comparing, display)
    if tabular.chosen == "table":  # people read one table per set of targets, programs one in all
        for comparison in comparisons:
            rows = [tables.marked(row) for row in plain_rows([comparison], metric)]
            print_table(
                SCHEMA,
                tables.for_people(columns),
                rows,
                tabular,
                display,
                title=comparison.title,
                caption=tables.caption(comparison, metric),
            )
        return
    for comparison in comparisons:
        if comparison.untested:
            note(display, f"{comparison.title}: {comparison.untested}")
    whole = told(comparisons, metric)
    print_table(SCHEMA, columns, whole["rows"], tabular, display, extra={"intervals": whole["intervals"]})


def _write_scores(path: Path, runs: list[ComparedRun], comparing: Comparing, display: Display) -> None:
    import io

    import numpy as np

    from qinit_cli.comparison.score_matrices import score_matrices
    from qinit_cli.output_file import OutputFile

    packed = io.BytesIO()
    np.savez(packed, allow_pickle=False, **score_matrices(runs, comparing.metric))
    file = OutputFile(path, comparing.force, remedy="--force replaces it, or give --scores another name")
    file.check_content(packed.getvalue())
    if not file.settle(packed.getvalue()):
        file.write(packed.getvalue())
    note(display, f"{path} holds the scores of each method, source sets by targets")


def _say_what_is_missing(comparison: GroupComparison, comparing: Comparing, display: Display) -> None:
    """The commands that make the runs which differences and regret are counted from."""
    baseline, imported = comparing.baseline, comparison.rows[0].remark == IMPORTED
    if comparison.baseline is None:
        line = shell_line("qinit", "transfer", baseline, "FIT")
        remedy = "name another with --baseline" if imported else f"{line} makes one"
        note(display, f"{comparison.title}: no run of {baseline}, so no differences; {remedy}")
    if comparison.rows[0].regret is None and not imported:
        needing = "regret needs" if comparing.greedy else "regret and time to threshold need"
        note(
            display,
            f"{comparison.title}: {needing} a run of optimal; qinit transfer optimal FIT makes one",
        )
