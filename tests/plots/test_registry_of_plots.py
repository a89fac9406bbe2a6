"""Every plot in the registry is a command and is drawn by whoever asks the registry."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
import typer

from qinit_cli.commands import plot as command
from qinit_cli.plots import PLOTS, Plot, Takes
from qinit_cli.plots.plot import Frame
from qinit_cli.study.planned import PlannedPicture


def test_each_plot_is_a_subcommand_with_its_options() -> None:
    app = typer.Typer()
    command.add_to(app)
    made = typer.main.get_group(app).commands
    assert set(made) == set(PLOTS)
    assert "smooth" in {parameter.name for parameter in made["curves"].params}


def test_a_class_that_does_not_say_what_it_takes_is_no_plot() -> None:
    @dataclass(frozen=True)
    class Blank(Plot):
        """Nothing."""

        name: ClassVar[str] = "blank"

    assert PLOTS._fault(Blank) == "it lacks the artefacts that it takes"
    assert PLOTS._fault(Takes) == "its class is no Plot"


@pytest.mark.parametrize(
    ("takes", "argument"),
    [
        (Takes(("run",), "Runs", several=True), "runs"),
        (Takes(("sources",), "Sources", several=True), "sources"),
        (Takes(("fit",), "A fit"), "fit"),
        (Takes(("fit", "run"), "Fits and runs", several=True), "artefacts"),
    ],
)
def test_artefacts_are_called_by_their_kind(takes: Takes, argument: str) -> None:
    assert takes.argument == argument


def test_a_reproduction_draws_by_the_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    from qinit_cli.plots.car import CarPlot
    from qinit_cli.study.drawing import Drawing

    asked: list[tuple[list[Path], Frame]] = []
    monkeypatch.setattr(CarPlot, "drawn", lambda self, paths, frame: asked.append((list(paths), frame)))
    Drawing({}).picture(PlannedPicture("figA1", "figA1", CarPlot(), (), "The car", ""))
    assert asked == [([], Frame("The car"))]
