"""A fit as methods and pictures read it from its artefact."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from qinit_cli.artefacts.opening import family_in, open_artefact
from qinit_cli.artefacts.settings import FitSettings
from qinit_cli.environments import Family
from qinit_cli.environments.family import bounds_of
from qinit_cli.fitted import FittedTables
from qinit_cli.learning import EXACT, IMPORTED, Learning
from qinit_store.held import Held


@dataclass(frozen=True)
class Knowledge:
    """A fit as it was read: what a method may use, and where it came from."""

    source: Path | Held
    fit: FittedTables
    family: Family  # of the sources
    content_sha256: str
    settings: FitSettings

    @classmethod
    def read(cls, source: Path | Held) -> Knowledge:
        """The fit in a file or in memory, verified."""
        with open_artefact(source, "fit") as artefact:
            settings = FitSettings.read(artefact.spec)
            family = family_in(artefact)
            names = (*FittedTables.TABLES, "value_mean", "library_q", "library_td_var")
            if settings.sources.family.tiled:
                names = (*names, "library_weights")
            arrays = {name: artefact.read(name) for name in names}
            bounds = bounds_of(family, settings.sources.learning.gamma)
            states = math.prod(family.shape)
            fit = FittedTables.from_arrays(arrays, states, settings.options.estimator, bounds)
            return cls(source, fit, family, artefact.content_sha256, settings)

    @property
    def learning(self) -> Learning:
        """How the sources were learned; of exact and imported tables how targets are, with the sources' discount."""
        sources = self.settings.sources
        if sources.learner not in (EXACT, IMPORTED):
            return sources.learning
        return replace(self.family.target_learning, gamma=sources.learning.gamma)

    @property
    def path(self) -> Path:
        """The file; in memory the name that it would have."""
        return self.source if isinstance(self.source, Path) else self.source.path

    @property
    def given(self) -> dict[str, str]:
        """The fit as an input of the run."""
        return {"role": "fit", "name": self.path.stem, "content_sha256": self.content_sha256}
