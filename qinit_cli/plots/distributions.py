"""Source tasks of several artefacts by the distribution they are drawn from, each task once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.comparison.distinctions import above_words, distinctions
from qinit_cli.errors import NotAllowed
from qinit_cli.plots.names import distribution

if TYPE_CHECKING:
    from qinit_cli.arrays import Tasks
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.environments import Family
    from qinit_store.reading import Artefact


@dataclass
class Distribution:
    """All tasks of one distribution learned in one way, over the artefacts that hold them."""

    family: Family
    settings: SourcesSettings  # of the first artefact
    tasks: list[Tasks]  # their parameters, block by block
    found: list[Any]  # what was read of them, block by block
    sets: int  # artefacts that brought tasks

    @property
    def alike(self) -> bool:
        """Whether all tasks are alike, so that what differs between their tables is learning."""
        tasks = np.concatenate(self.tasks)
        return len(tasks) > 0 and bool((tasks == tasks[0]).all())


Read = Callable[["Family", "SourcesSettings", "Tasks", "dict[str, Any]"], Any]


def distributions(paths: Sequence[Path], columns: Sequence[str], read: Read) -> list[Distribution]:
    """The tasks of sources by what they are drawn from and how they were learned, in order of appearance.

    `read` is given the family, the settings, the tasks of a block and its `columns`, and gives back what to keep of them.
    """
    from qinit_cli.artefacts.opening import family_in, open_artefact
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_store.spec import canonical_json

    found: dict[str, Distribution] = {}
    seen: dict[str, set[bytes]] = {}
    for path in paths:
        with open_artefact(path, "sources") as artefact:
            settings = SourcesSettings.read(artefact.spec)
            if settings.imported and "eopl" in columns:
                raise NotAllowed(f"path lengths of the imported tables in {artefact.path} are unknown")
            key = canonical_json(settings.choice().spec())
            one = found.setdefault(key, Distribution(family_in(artefact), settings, [], [], 0))
            before = sum(map(len, one.tasks))
            # equal rows of two seeds are two tasks: those of an exact learner can be
            known = seen.setdefault(f"{key} {settings.seed}", set())
            for tasks, block in _unseen(artefact, one.family, columns, known):
                one.tasks.append(tasks)
                one.found.append(read(one.family, settings, tasks, block))
            one.sets += sum(map(len, one.tasks)) > before
    return list(found.values())


def named(found: Sequence[Distribution]) -> list[str]:
    """The name of each, above the settings that distinguish it from the others."""
    words = distinctions([one.settings.choice() for one in found])
    return [above_words(distribution(one.family), own) for one, own in zip(found, words, strict=True)]


def learned_otherwise(found: Sequence[Distribution], names: Sequence[str]) -> list[str]:
    """What is to be said of those that were learned in another way than the first: it shows in their paths too."""
    usual = _learned(found[0].settings)
    said = []
    for one, name in zip(found, names, strict=True):
        other = [
            f"{key} {value}, not {usual.get(key)}"
            for key, value in _learned(one.settings).items()
            if value != usual.get(key)
        ]
        if other:
            said.append(
                f"{name.splitlines()[0]} was learned otherwise than {names[0].splitlines()[0]}: {'; '.join(other)}"
            )
    return said


def _learned(settings: SourcesSettings) -> dict[str, Any]:
    from qinit_cli.artefacts.settings import NOT_LEARNED

    of_learning = [one.name for one in fields(settings.learning)]
    told = NOT_LEARNED.get(settings.learner, of_learning)
    return {"learner": settings.learner} | {name: getattr(settings.learning, name) for name in told}


def _unseen(
    artefact: Artefact, family: Family, columns: Sequence[str], seen: set[bytes]
) -> Iterator[tuple[Tasks, dict[str, Any]]]:
    """The tasks that were not seen before and their columns, a block at a time."""
    parameters = [(column.name, column.dtype) for column in family.parameters()]
    first = 0
    for block in artefact.blocks((*columns, *(name for name, _ in parameters)), artefact.schema.block_size):
        digests = [row.tobytes() for row in artefact.digests[first : first + len(block["task"])]]
        first += len(digests)
        new = np.array([digest not in seen for digest in digests], np.bool_)
        seen.update(digests)
        if not new.any():
            continue
        tasks = np.empty(int(new.sum()), np.dtype(parameters))
        for name, _ in parameters:
            tasks[name] = block[name][new]
        yield tasks, {name: block[name][new] for name in columns}
