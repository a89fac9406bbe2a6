"""Tasks that other artefacts of the store hold already: what is asked for later learns only what is new."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.artefacts.settings import Settings, SourcesSettings, without_range
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.own_tasks import OwnTasks
from qinit_cli.environments.taken_names import FILE_TASK
from qinit_cli.learning import EXACT
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.reporter import Reporter
from qinit_cli.seeding import Stream
from qinit_store.catalog import Store
from qinit_store.errors import Damaged, Refused
from qinit_store.wording import counted, noun

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.arrays import Integers
    from qinit_store.reading import Artefact
    from qinit_store.work import Work


def take_over(
    artefact: Work, asked: Integers, settings: Settings, keeping: Keeping, reporter: Reporter
) -> None:
    """Takes tasks from artefacts whose settings differ in the number of tasks alone, or in the range of a file."""
    if keeping.store is None:
        return
    for path, ranges in _relatives(Store(keeping.store), settings):
        before = len(artefact.saved)
        if np.isin(asked, artefact.saved).all():
            return
        try:
            with open_artefact(path, settings.kind) as there:
                artefact.adopt(there, _places(there, ranges, asked) if ranges else None)
        except Damaged as damage:
            reporter.note(f"nothing is taken over: {damage}")
        except Refused as lack:
            reporter.note(f"nothing is taken over from an earlier version: {lack}")
        if taken := len(artefact.saved) - before:
            reporter.note(f"{counted(taken, 'task')} {noun(taken, 'is', 'are')} taken over from {path}")


def _relatives(store: Store, settings: Settings) -> Iterator[tuple[Path, SourcesSettings | None]]:
    """The artefacts from which tasks may be taken; with the settings asked for if an artefact has another range of the file."""
    same = [one.path for one in store.relatives(settings.kind, settings.spec())]
    yield from ((path, None) for path in same)
    if _of_file(settings):
        for one in store.relatives(settings.kind, settings.spec(), without_range):
            if one.path not in same:
                yield one.path, settings


def _of_file(settings: Settings) -> TypeGuard[SourcesSettings]:
    """Whether these are sources of a file of tables or maps: each depends on its place in the file and its streams alone.

    A row of an environment does not: the rows that are used decide the states and the bounds of returns together.
    """
    return (
        isinstance(settings, SourcesSettings)
        and settings.role == "source"
        and isinstance(settings.family.here, OwnTasks)
    )


def _places(there: Artefact, settings: SourcesSettings, asked: Integers) -> dict[int, int]:
    """The ids that tasks of an artefact have among those `asked` for, by the ids that they have there.

    What is learned has the streams of its id, which must therefore be the same; what is solved has none.
    """
    own = draw_tasks(settings.family.installed(), settings.seed, Stream.SOURCE_TASK, asked)[FILE_TASK]
    here = dict(zip(own.tolist(), asked.tolist(), strict=True))
    rows = zip(there.tasks.tolist(), there.read(FILE_TASK).tolist(), strict=True)
    found = {task: here[row] for task, row in rows if row in here}
    return {task: place for task, place in found.items() if settings.learner == EXACT or task == place}
