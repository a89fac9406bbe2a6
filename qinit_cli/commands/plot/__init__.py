"""`qinit plot`: pictures from stored artefacts, one file each."""

from __future__ import annotations

import typer

from qinit_cli.commands.plot import (
    bars,
    car,
    curves,
    eopl,
    heatmaps,
    histograms,
    lifetime,
    normality,
    occupancy,
    posterior,
    tuning,
)


def add_to(plots: typer.Typer) -> None:
    """Adds one subcommand per picture."""
    for picture in (
        heatmaps,
        histograms,
        curves,
        bars,
        occupancy,
        eopl,
        car,
        normality,
        posterior,
        lifetime,
        tuning,
    ):
        picture.add_to(plots)
