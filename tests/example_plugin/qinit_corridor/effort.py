"""How many steps each source task took to be learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from qinit_cli.plugin import option
from qinit_cli.plugin.plots import PLAIN, Drawn, Frame, Plot, Takes, house_style


@dataclass(frozen=True)
class Effort(Plot):
    """Steps that each source task took to be learned."""

    log: bool = option(False, "Draw steps on a logarithmic axis.")

    name: ClassVar[str] = "effort"
    takes: ClassVar[Takes] = Takes(("sources",), "Sources")
    titled: ClassVar[str] = "steps of each source"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """A bar for each task of the sources."""
        from matplotlib.figure import Figure

        import qinit_cli as qinit

        [path] = paths
        sources = qinit.open(path)
        tasks, steps = sources["task"], sources["steps"]
        title = "Steps of each source" if frame.title is None else frame.title
        with house_style():
            figure = Figure(figsize=(frame.width, 2.4))
            axes = figure.subplots()
            axes.bar(tasks, steps)
            axes.set(xlabel="task", ylabel="steps", title=title, yscale="log" if self.log else "linear")
        return Drawn(figure, title, f"Steps of {len(tasks)} sources, {steps.mean():.0f} in the mean.")
