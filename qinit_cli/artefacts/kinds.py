"""The kinds of artefacts, each registered here once: the store learns of them as qinit_cli is imported."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from qinit_cli.artefacts.fit import FIT
from qinit_cli.artefacts.kind import Kind
from qinit_cli.artefacts.run import RUN
from qinit_cli.artefacts.sources import SOURCES
from qinit_cli.artefacts.tuning import TUNING
from qinit_store.kinds import register

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import Settings, Spec

KINDS: dict[str, Kind[Any]] = {kind.name: kind for kind in (SOURCES, FIT, RUN, TUNING)}

if TYPE_CHECKING:
    KindName = str
else:
    KindName = Literal[tuple(KINDS)]  # the choices of an option

for kind in KINDS.values():
    register(kind.name, kind.folder, kind.maker, kind.lack)


def read(name: str, spec: Spec) -> Settings:
    """The settings of an artefact of this kind; ValueError, in one clause, for the first that cannot be."""
    if name not in KINDS:
        raise ValueError(f"an artefact of the kind {name!r} is none that this qinit knows")
    settings: Settings = KINDS[name].read(spec)
    return settings
