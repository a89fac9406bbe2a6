"""`qinit reproduce`: the paper's figures, which are a study of this package (qinit_cli/paper/paper.toml)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import typer

from qinit_cli.commands.option_groups import DISPLAY, Display, Group, store_option
from qinit_cli.commands.study import THREADS, Threads, finish
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.options import check, option

SHOWS = {
    "fig4": "Figure 4: heatmaps of what each initialisation starts from.",
    "fig5": "Figure 5: histograms of Q and ln Q on the gridworld, and where ln Q is normal.",
    "fig6": "Figure 6: the gridworld's learning curves, and bars over distributions of goals.",
    "fig7": "Figure 7: the states on Mountain Car's optimal paths.",
    "fig8": "Figure 8: Mountain Car's path lengths, with the noise floor.",
    "fig9": "Figure 9: Mountain Car's learning curves, and bars over noise levels.",
    "fig10": "Figure 10: histograms of Q and ln Q on Mountain Car.",
    "figA1": "Figure A1: the car, its hills and the push.",
    "figA2": "Figure A2: learning curves on every distribution of the gridworld.",
    "figA3": "Figure A3: learning curves on every noise level of Mountain Car.",
    "gridworld": "Every figure of the gridworld: 4, 5, 6, A2.",
    "mountain-car": "Every figure of Mountain Car: 7 to 10, A1, A3.",
    "all": "Every figure of the paper's experiments.",
}
PAPER = "paper"  # the scale of the file as it stands
FILE = Path(__file__).parents[1] / "paper" / "paper.toml"


@dataclass(frozen=True)
class Reproducing:
    """How large, and from how many source sets."""

    scale: Literal["paper", "quick"] = option(
        "paper", "The paper's sizes, or small ones that take some minutes for everything; pictures say which."
    )
    source_sets: int = option(
        1, "Independent source sets, of seeds 0 to N-1; targets are shared.", low=1, metavar="N"
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class ReproducedInto:
    """Where pictures and artefacts go, and what is told."""

    output: str | None = option(
        None,
        "The folder of pictures, tables and the manifest.",
        short="-o",
        metavar="DIR",
        default_text="reproduction-FIGURE-SCALE",
    )
    store: str = store_option()
    force: bool = option(False, "Replace a reproduction of other settings in that folder.", seldom=True)
    wait: bool = option(False, "Wait while another process writes the same artefact.", seldom=True)
    dry_run: bool = option(False, "Report what it would take, from a short trial; make nothing.")
    json: bool = option(False, "Print one JSON object instead of the folder.")


GROUPS = {
    "asked": Group(Reproducing, "Size"),
    "into": Group(ReproducedInto, "Files"),
    "machine": THREADS,
    "display": DISPLAY,
}


def add_to(targets: typer.Typer, only: str | None = None) -> None:
    """Adds one subcommand per figure, per environment, and for all, or that of the `only` name asked for."""
    for name in [name for name in SHOWS if only in (None, name)]:
        add_command(targets, name, partial(reproduce, name), GROUPS, help=SHOWS[name])


def reproduce(
    target: str, asked: Reproducing, into: ReproducedInto, machine: Threads, display: Display
) -> None:
    """Makes what is missing, draws it, and prints the folder."""
    from qinit_cli.commands.option_groups import Output
    from qinit_cli.pipeline.machine import Machine
    from qinit_cli.study.manifest import REPRODUCTION
    from qinit_cli.study.reading import Study
    from qinit_cli.study.work import StudyWork

    scale = None if asked.scale == PAPER else asked.scale
    study = Study.read(FILE, scale, asked.source_sets).only([target])
    work = StudyWork(
        study,
        target,
        REPRODUCTION,
        {
            "target": target,
            "scale": asked.scale,
            "source_sets": asked.source_sets,
        },
        {"file_sha256": study.digest},
        Path(into.output or f"reproduction-{target}-{asked.scale}"),
        Output(store=into.store, wait=into.wait).keeping,
        Machine(jobs=machine.jobs),
        into.force,
    )
    ahead = work.plan()
    if into.dry_run and into.json:
        print(json.dumps(ahead.told(), allow_nan=False))
        return
    from qinit_cli.commands.whole_bar import PrintedWhole

    reporter = PrintedWhole(display)
    if into.dry_run:
        ahead.report(reporter)
    else:
        finish(work, ahead, reporter, as_json=into.json)
