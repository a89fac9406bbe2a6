"""What tasks earn one after another: runs of `qinit lifelong`, or of `qinit transfer`, which are lifetimes without memory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from qinit_cli.errors import UsageError
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import listed

if TYPE_CHECKING:
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.lifetime import Lived

MOST = 6  # lines that can be told apart
WINDOW = 20  # tasks of a running mean: single tasks differ by their distance to the goal


def drawn(paths: Sequence[Path], *, title: str | None = None, width: float = TEXT) -> Drawn:
    """Return over the tasks' numbers, a line for each run, and sd(ln Q) where finished tasks were added."""
    from qinit_cli.figures import lifetime as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    if len(paths) > MOST:
        raise UsageError(f"{len(paths)} runs do not fit; draw at most {MOST}")
    shown = [_lived(path) for path in paths]
    own = "returns of tasks that are learned one after another"
    with house_style():
        figure = drawing.lifetime(shown, own if title is None else title, WINDOW, width)
    return Drawn(figure, title or own, _alt(shown))


def _lived(path: Path) -> Lived:
    import numpy as np

    from qinit_cli.analysis import returns
    from qinit_cli.environments import family_of
    from qinit_cli.figures.lifetime import Lived
    from store.reading import open_artefact

    with open_artefact(path, "run") as artefact:
        label = f"{artefact.spec['method']['label']}, {family_of(artefact.spec).label}"
        gamma = float(artefact.spec["learning"]["gamma"])
        reached = artefact.read("reached").astype(bool)
        earned = returns.discounted_returns(artefact.read("steps"), reached, gamma).mean(axis=1)
        updated = "log_std" in {column.name for column in artefact.schema.columns}
        spread = artefact.read("log_std") if updated else np.empty(0)
        return Lived(label, artefact.tasks + 1, earned, returns.smoothed(earned, WINDOW), spread)


def _alt(shown: Sequence[Lived]) -> str:
    """What each lifetime earned in all and in its last tasks, and where its spread went."""
    parts = []
    for each in shown:
        mean, last = each.earned.mean(), each.smooth[-1]
        said = f"{each.label}: mean return {mean:.4f} over {len(each.earned)} tasks, {last:.4f} over the last"
        if len(each.spread):
            said += f", sd(ln Q) from {each.spread[0]:.3f} after the first task to {each.spread[-1]:.3f}"
        parts.append(said)
    return f"Return against the number of the task, running means of {WINDOW}. {listed(parts)}."
