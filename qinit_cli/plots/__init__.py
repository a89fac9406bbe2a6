"""The registry of plots: one line each, and the plot is a subcommand of `qinit plot`, and stands in reports.

Those of installed plug-ins (entry points `qinit.plots`) are in it too. A report shows them in this order.

    from qinit_cli.plots import PLOTS

    drawn = PLOTS["heatmaps"](method=["mean"]).drawn([path of a fit])
    drawn.title, drawn.alt      # the alternative text has the main numbers
    drawn.svg()                 # or drawn.figure, of matplotlib

No module here imports what draws before something is drawn: help loads all of them.
"""

from __future__ import annotations

from typing import Any

from qinit_cli.plots.bars import BarsPlot
from qinit_cli.plots.car import CarPlot
from qinit_cli.plots.curves import CurvesPlot
from qinit_cli.plots.eopl import EoplPlot
from qinit_cli.plots.grid import GridPlot
from qinit_cli.plots.heatmaps import HeatmapsPlot
from qinit_cli.plots.histograms import HistogramsPlot
from qinit_cli.plots.lifetime import LifetimePlot
from qinit_cli.plots.normality import NormalityPlot
from qinit_cli.plots.occupancy import OccupancyPlot
from qinit_cli.plots.plot import Frame, Plot, Takes
from qinit_cli.plots.posterior import PosteriorPlot
from qinit_cli.plots.ranks import RanksPlot
from qinit_cli.plots.sensitivity import SensitivityPlot
from qinit_cli.plots.tuning import TuningPlot
from qinit_cli.registry import Registry

PLOTS: Registry[Plot] = Registry(
    "qinit.plots",
    "plot",
    (
        CurvesPlot,
        BarsPlot,
        SensitivityPlot,
        GridPlot,
        RanksPlot,
        EoplPlot,
        HistogramsPlot,
        HeatmapsPlot,
        NormalityPlot,
        TuningPlot,
        OccupancyPlot,
        CarPlot,
        PosteriorPlot,
        LifetimePlot,
    ),
    lambda found: _fault(found),
)

__all__ = ["PLOTS", "Frame", "Plot", "Takes"]


def _fault(found: type[Any]) -> str:
    """What a class lacks to be a plot."""
    if not issubclass(found, Plot):
        return "its class is no Plot"
    if not isinstance(getattr(found, "takes", None), Takes):
        return "it lacks the artefacts that it takes"
    return "" if isinstance(getattr(found, "titled", None), str) else "it lacks its title in words"
