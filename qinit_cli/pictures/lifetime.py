"""What tasks earn one after another: runs of `qinit lifelong`, or of `qinit transfer`, which are lifetimes without memory."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.comparison.distinctions import distinctions, with_words
from qinit_cli.errors import UsageError
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import legible, listed
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.lifetime import Lived
    from qinit_store.catalog import Store
    from qinit_store.reading import Artefact

MOST = 6  # lines that can be told apart
WINDOW = 20  # tasks of a running mean: single tasks differ by their distance to the goal


def drawn(paths: Sequence[Path], store: Store, *, title: str | None = None, width: float = TEXT) -> Drawn:
    """Return over the tasks' numbers, a line for each run, and sd(ln Q) where finished tasks were added.

    What it was as fitted is that of the fit that the run names, in the store or beside it; a note says where that is missing.
    """
    from qinit_cli.artefacts.opening import describe
    from qinit_cli.figures import lifetime as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    if len(paths) > MOST:
        raise UsageError(f"{len(paths)} runs do not fit; draw at most {MOST}")
    notes: list[str] = []
    words = distinctions([describe(path).spec for path in paths])
    shown = [_lived(path, own, store, notes) for path, own in zip(paths, words, strict=True)]
    own = "returns of tasks that are learned one after another"
    with house_style():
        figure = drawing.lifetime(shown, own if title is None else title, WINDOW, width)
    return Drawn(figure, title or own, _alt(shown), tuple(dict.fromkeys(notes)))


def _lived(path: Path, words: str, store: Store, notes: list[str]) -> Lived:
    from qinit_cli.analysis import returns
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.environments import family_of
    from qinit_cli.figures.lifetime import Lived

    with open_artefact(path, "run") as artefact:
        named = f"{artefact.spec['method']['label']}, {family_of(artefact.spec).label}"
        label = legible(with_words(named, words))
        gamma = float(artefact.spec["learning"]["gamma"])
        reached = artefact.read("reached").astype(bool)
        earned = returns.discounted_returns(artefact.read("steps"), reached, gamma).mean(axis=1)
        updated = "log_std" in {column.name for column in artefact.schema.columns}
        spread = artefact.read("log_std") if updated else np.empty(0)
        fitted = _as_fitted(artefact, store, notes) if updated else float("nan")
        return Lived(label, artefact.tasks + 1, earned, returns.smoothed(earned, WINDOW), spread, fitted)


def _as_fitted(run: Artefact, store: Store, notes: list[str]) -> float:
    """sd(ln Q) of the fit that the run started from; NaN, and a note, where it is not found."""
    from qinit_cli.artefacts.kinds import KINDS
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.lifelong import Known, log_std

    [name] = [f"{one['name']}.h5" for one in run.inputs if one["role"] == "fit"]
    for path in (store.root / KINDS["fit"].folder / name, run.path.with_name(name)):
        if path.exists() and (known := Knowledge.read(path)).content_sha256 == run.spec["inputs"][0]:
            return log_std(Known.of(known.fit).log_q)
    notes.append(
        f"sd(ln Q) as fitted is not drawn: {name}, which {run.path} started from, is neither in {store.root} nor beside it"
    )
    return float("nan")


def _alt(shown: Sequence[Lived]) -> str:
    """What each lifetime earned in all and in its last tasks, and where its spread went."""
    parts = []
    for each in shown:
        mean, last = each.earned.mean(), each.smooth[-1]
        said = f"{each.label}: mean return {mean:.4f} over {counted(len(each.earned), 'task')}, {last:.4f} over the last"
        if len(each.spread):
            said += f", sd(ln Q) from {each.spread[0]:.3f} after the first task to {each.spread[-1]:.3f}"
        if isfinite(each.fitted):
            said += f", as fitted {each.fitted:.3f}"
        parts.append(said)
    return f"Return against the number of the task, running means of {WINDOW}. {listed(parts)}."
