"""The pictures of a report: those that each plot in the registry has for these artefacts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from qinit_cli.comparison.distinctions import with_words
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.plots import PLOTS

if TYPE_CHECKING:
    from qinit_cli.plots.reported import Contents
    from qinit_cli.report.content import Figure


def figures(contents: Contents) -> tuple[list[Figure], list[str]]:
    """The pictures in the order of the registry, and what is not in them and why."""
    from qinit_cli.report.content import Figure

    drawn, undrawn = list[tuple[Figure, str]](), list[str]()
    for planned in (one for plot in PLOTS.values() for one in plot.in_report(contents)):
        try:
            picture = planned.draw()
        except (NotAllowed, UsageError) as refusal:
            undrawn.append(str(refusal))
        else:
            undrawn += picture.notes
            drawn.append((Figure(picture.title, planned.caption, picture.alt, picture.svg()), planned.words))
    titles = [figure.title for figure, _ in drawn]
    return [
        replace(figure, title=with_words(figure.title, words)) if titles.count(figure.title) > 1 else figure
        for figure, words in drawn
    ], undrawn
