"""`qinit plot`: pictures from stored artefacts, one file each."""

from __future__ import annotations

import typer

from qinit_cli.commands.plot import bars, curves, eopl, heatmaps, histograms, normality


def add_to(app: typer.Typer) -> None:
    """Adds the command, with one subcommand per picture."""
    plots = typer.Typer(no_args_is_help=True)
    app.add_typer(plots, name="plot", help="Draw pictures from stored artefacts: PNG, SVG or PDF.")
    for picture in (heatmaps, histograms, curves, bars, eopl, normality):
        picture.add_to(plots)
