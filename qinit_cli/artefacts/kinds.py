"""The kinds of artefacts, each registered here once: the store learns of them as qinit_cli is imported."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from qinit_cli.artefacts.fit import FIT
from qinit_cli.artefacts.kind import Kind, Settings
from qinit_cli.artefacts.run import RUN
from qinit_cli.artefacts.sources import SOURCES
from qinit_cli.artefacts.tuning import TUNING
from qinit_store.kinds import register

KINDS: dict[str, Kind] = {kind.name: kind for kind in (SOURCES, FIT, RUN, TUNING)}

if TYPE_CHECKING:
    KindName = str
else:
    KindName = Literal[tuple(KINDS)]  # the choices of an option

for kind in KINDS.values():
    register(kind.name, kind.folder, kind.maker, kind.lack)


def check(name: str, spec: Settings) -> None:
    """ValueError, in one clause, for the first setting of an artefact of this kind that cannot be."""
    if name not in KINDS:
        raise ValueError(f"an artefact of the kind {name!r} is none that this qinit knows")
    KINDS[name].check(spec)
