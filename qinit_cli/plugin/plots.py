"""What a plug-in's plot imports: the base class at the top of its module, the rest inside its functions. These names stay."""

from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.plot import PLAIN, Frame, Plot, RunsPlot, Takes
from qinit_cli.plots.style import house_style

__all__ = ["PLAIN", "Drawn", "Frame", "Plot", "RunsPlot", "Takes", "house_style"]
