"""The kinds of artefacts, each registered here once: the store learns of them as qinit_cli is imported."""

from __future__ import annotations

from qinit_cli.artefacts.fit import FIT
from qinit_cli.artefacts.kind import Kind
from qinit_cli.artefacts.run import RUN
from qinit_cli.artefacts.sources import SOURCES
from qinit_cli.artefacts.tuning import TUNING
from qinit_store.kinds import register

KINDS: dict[str, Kind] = {kind.name: kind for kind in (SOURCES, FIT, RUN, TUNING)}

for kind in KINDS.values():
    register(kind.name, kind.folder, kind.maker, kind.lack)
