"""`qinit plot eopl`: how long the paths from the target start are, over the tasks of each distribution.

Each task's path is its own greedy one: the length that its table has for its best action there. It is that of the table's
state, on Mountain Car of the bin's centre.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, distinct, distribution, publish
from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.environments import Family
    from qinit_cli.figures.eopl import Lengths
    from store.reading import Artefact

USUAL = Usual("eopl", "text", "the state")
MOST = 7  # distributions that are legible below each other


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "eopl",
        eopl,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        references=(
            Reference("sources", "Sources: paths, names in the store, or - for stdin.", several=True),
        ),
        help="Path lengths at the target start: histograms of each distribution, all densities together; sources whose "
        "tasks are all alike (such as --noise 0) are the noise floor.",
    )


@dataclass
class Distribution:
    """All tasks of one distribution learned in one way, over the artefacts that hold them; each task once."""

    family: Family
    seed: int  # of the first artefact
    mark: str  # what tells it from another of the same name
    eopl: list[Any]
    tasks: list[Any]  # their parameters
    seen: set[bytes]

    @property
    def floor(self) -> bool:
        """Whether all tasks are alike."""
        first = self.tasks[0][:1]
        return len(first) > 0 and all((part == first).all() for part in self.tasks)


def eopl(sources: list[str], picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; distributions in the order of their sources, the noise floor last."""
    from qinit_cli.commands import references
    from qinit_cli.figures import eopl as drawing
    from qinit_cli.figures.style import house_style

    path = USUAL.path(picture)
    found = _distributions(references.many(sources, reading.store))
    families = {(one.family.name, one.family.shape) for one in found}
    if len(families) > 1:
        raise NotAllowed(
            f"path lengths of one picture start in the same state; those of {_labels(found)} do not"
        )
    if len(found) > MOST:
        raise UsageError(f"{len(found)} distributions do not fit below each other; draw at most {MOST}")
    names = distinct(
        [distribution(one.family.name, one.family.label) for one in found], [one.mark for one in found]
    )
    shown = sorted(
        (_shown(name, one) for name, one in zip(names, found, strict=True)), key=lambda each: each.floor
    )
    title = _title(found[0].family) if picture.title is None else picture.title
    with house_style():
        publish(drawing.eopl(shown, title, USUAL.inches(picture)), path)


def _labels(found: list[Distribution]) -> str:
    return ", ".join(dict.fromkeys(one.family.label for one in found))


def _distributions(paths: list[Path]) -> list[Distribution]:
    """The tasks of the artefacts by what they are drawn from and how they were learned."""
    from qinit_cli.environments import family_of
    from store.reading import open_artefact
    from store.spec import canonical_json

    found: dict[str, Distribution] = {}
    for path in paths:
        with open_artefact(path, "sources") as artefact:
            spec = artefact.spec
            key = canonical_json({name: spec[name] for name in ("family", "learner", "learning")})
            fresh = Distribution(family_of(spec), int(spec["seed"]), path.stem[-8:], [], [], set())
            one = found.setdefault(key, fresh)
            for eopl, tasks in _at_start(artefact, one.family, one.seen):
                one.eopl.append(eopl)
                one.tasks.append(tasks)
    return list(found.values())


def _at_start(artefact: Artefact, family: Family, seen: set[bytes]) -> Iterator[tuple[Any, Any]]:
    """Lengths (B,) of the greedy paths from the target start and the tasks' parameters (B, P), of tasks not seen before."""
    import numpy as np

    start: tuple[Any, ...] = (slice(None), *_place(family))
    parameters = [column.name for column in family.parameters()]
    first = 0
    for block in artefact.blocks(("q", "eopl", *parameters), artefact.schema.block_size):
        digests = [row.tobytes() for row in artefact.digests[first : first + len(block["task"])]]
        first += len(digests)
        new = np.array([digest not in seen for digest in digests], np.bool_)
        seen.update(digests)
        greedy = block["q"][start].argmax(axis=-1)
        lengths = np.take_along_axis(block["eopl"][start], greedy[:, None], axis=-1)[:, 0]
        yield lengths[new], np.stack([block[name] for name in parameters], axis=1)[new]


def _place(family: Family) -> tuple[int, ...]:
    """The target start on the state axes."""
    import numpy as np

    return tuple(
        int(np.abs(axis.values - place).argmin())
        for axis, place in zip(family.axes(), family.shown_states()[0], strict=True)
    )


def _title(family: Family) -> str:
    places = ", ".join(f"{place:g}" for place in family.shown_states()[0]).replace("-", "\N{MINUS SIGN}")
    return f"{family.name}, expected optimal path lengths at ({places})"


def _shown(name: str, one: Distribution) -> Lengths:
    """The lengths as they are drawn."""
    import numpy as np

    from qinit_cli.analysis.length_sample import LengthSample
    from qinit_cli.analysis.rounded_normal import RESAMPLES
    from qinit_cli.figures.eopl import Lengths
    from qinit_cli.seeding import Stream, generator

    sample = LengthSample.of(np.concatenate(one.eopl))
    statistic, p = sample.rounded_normal(generator(one.seed, Stream.BOOTSTRAP, 0))
    counted = f"n = {sample.lengths.size}" + (f", {sample.never} never arrive" if sample.never else "")
    moments = f"\nmean {sample.mean:.1f}, sd {sample.deviation:.1f}, " if sample.lengths.size else ", "
    least = 1 / (RESAMPLES + 1)
    verdict = f"W = {statistic:.3f}, p {'≤' if p <= least else '='} {p:.2g}"
    words = counted + moments + ("not testable" if np.isnan(p) else verdict)
    return Lengths(f"{name}, noise floor" if one.floor else name, words, sample, one.floor)
