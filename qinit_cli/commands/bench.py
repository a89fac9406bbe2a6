"""`qinit bench`: how fast the parts of qinit are here, beside the plain way to do the same."""

from __future__ import annotations

import platform
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from qinit_cli import cores
from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, TABULAR, Display, Group, Tabular
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.options import check, option

if TYPE_CHECKING:
    import ctypes

    from qinit_cli.benchmarks.race import Race, Result


@dataclass(frozen=True)
class Benchmarks:
    """What is timed, and how often."""

    what: Literal["kernels", "learners", "exact", "fit", "compare", "start-up", "pipeline", "all"] = option(
        "all", "The part of qinit that is timed."
    )
    repeat: int = option(
        5, "Turns that count; one before them compiles and warms up.", low=1, metavar="TURNS"
    )
    quick: bool = option(False, "Do little in each turn: quicker, and less sure.")

    def __post_init__(self) -> None:
        check(self)

    def asks(self, what: str) -> bool:
        """Whether this part is timed."""
        return self.what in (what, "all")


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "bench",
        bench,
        {"benchmarks": Group(Benchmarks, "Timing"), "tabular": TABULAR, "display": DISPLAY},
        help="Time kernels, learners, exact tables, fits, comparisons and whole commands against the plain way to do the same.",
    )


def bench(benchmarks: Benchmarks, tabular: Tabular, display: Display) -> None:
    """Prints one row per contest: both figures, and how many times faster qinit is."""
    from qinit_cli.benchmarks.plain_c import compiler
    from qinit_cli.commands.tables import TableColumn, print_table

    rows = [asdict(result) for result in _results(benchmarks, display)]
    columns = [
        TableColumn("what"),
        TableColumn("case"),
        TableColumn("ours_figure", "qinit", digits=1),
        TableColumn("other_figure", "other", digits=1),
        TableColumn("unit"),
        TableColumn("other", "which"),
        TableColumn("ratio", "times faster", digits=2, interval=True),
        TableColumn("turns", dispensable=True),
    ]
    caption = (
        "Seconds of processor, medians; ratios of the same turn, with the lowest and the highest. The pipeline's are wall time: "
        "its ratio is the share of learning."
    )
    machine = _machine() | {"c_compiler": compiler()}
    print_table("qinit.bench/1", columns, rows, tabular, display, caption=caption, extra={"machine": machine})


def _results(benchmarks: Benchmarks, display: Display) -> Iterator[Result]:
    from qinit_cli.benchmarks import process_races
    from qinit_cli.benchmarks.race import results

    with ExitStack() as until_done:
        for race in _races(benchmarks, display, until_done):
            note(display, f"{race.what}: {race.case}")
            yield from results(race, benchmarks.repeat)
    if benchmarks.asks("pipeline"):
        note(display, "pipeline: sources | fit | transfer")
        yield from process_races.pipelines(benchmarks.repeat, quick=benchmarks.quick)


def _races(benchmarks: Benchmarks, display: Display, until_done: ExitStack) -> Iterator[Race]:
    from qinit_cli.benchmarks import learner_races, learning_races, process_races, table_races

    size = learning_races.QUICK if benchmarks.quick else learning_races.FULL
    if benchmarks.asks("kernels"):
        yield from learning_races.races(size, _plain_c(display, until_done))
    if benchmarks.asks("learners"):
        yield from learner_races.races(size)
    if benchmarks.asks("exact"):
        yield table_races.exact(2 if benchmarks.quick else 10)
    if benchmarks.asks("fit"):
        yield table_races.fit()
    if benchmarks.asks("compare"):
        yield table_races.compare()
    if benchmarks.asks("start-up"):
        yield process_races.start_up()


def _plain_c(display: Display, until_done: ExitStack) -> ctypes.CDLL | None:
    """The loops in C, kept until all is done; None where they cannot be compiled, and says so."""
    from qinit_cli.benchmarks.plain_c import compiler, library

    found = compiler()
    if found is None:
        note(display, "no C compiler found (CC, cc, gcc, clang): nothing is compared with C")
        return None
    folder = Path(until_done.enter_context(tempfile.TemporaryDirectory()))
    if (loops := library(found, folder)) is None:
        note(display, f"{found} does not compile the loops in C: nothing is compared with C")
    return loops


def _machine() -> dict[str, Any]:
    """What the figures hold for."""
    import os

    import numba
    import numpy

    return {
        "platform": platform.platform(),
        "processor": _processor(),
        "cores": cores.usable(),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "numba": numba.__version__,
    }


def _processor() -> str:
    """The processor's name, or what the platform knows of it."""
    described = Path("/proc/cpuinfo")
    lines = described.read_text().splitlines() if described.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
