"""A tuning: how the candidates for a method's parameters fared on sources in the place of targets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.artefacts.kind import Kind, Reported, Shown
from qinit_cli.artefacts.run import method_reported
from qinit_cli.rewards import UNIT, ReturnBounds

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import Spec, TuningSettings
    from qinit_store.reading import Artefact
    from qinit_store.schema import Column, Schema

CANDIDATE = "candidate"


class TuningKind(Kind["TuningSettings"]):
    """How the candidates for a method's parameters fared."""

    name = "tuning"
    folder = "tunings"
    maker = "tune"
    one, several, counted = "tuning", "tunings", "sources"
    tables: ClassVar[Mapping[str, str]] = {"averages": "average"}
    indices = (CANDIDATE,)
    results = ("steps", "seconds")
    described = ("task", CANDIDATE)

    def read(self, spec: Spec) -> TuningSettings:
        from qinit_cli.artefacts.settings import TuningSettings

        return TuningSettings.read(spec)

    def lack(self, schema: Schema, *, part: bool) -> str:
        from qinit_store.schema import serves

        there = {column.name: column for column in schema.columns}
        for wanted in tuning_schema((), 1).columns:
            if wanted.name not in there or not serves(there[wanted.name], wanted):
                return f"{wanted.name} over {', '.join(wanted.dims)}"
        return ""

    def lengths(self, artefact: Artefact) -> dict[str, int]:
        import math

        combinations = math.prod(len(values) for values in self.read(artefact.spec).grid.values())
        tried = artefact.schema.sizes.get(CANDIDATE, 0)  # among them the method as it is
        return {CANDIDATE: min(max(1, tried), combinations + 1)}

    def asked(self, spec: Spec) -> tuple[str, ...]:
        return tuple(self.read(spec).grid)

    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        settings, tried = self.read(artefact.spec), artefact.schema.sizes.get(CANDIDATE, 0)
        bounds = settings.bounds
        return tuning_schema(self.asked(artefact.spec), tried, bounds).columns

    def reported(self, told: TuningSettings) -> Iterator[Reported]:
        yield Reported("Source tasks", told.sources.spec(), 1)
        own = {name: value for name, value in told.spec().items() if name not in ("method", "sources")}
        yield Reported("Tunings", method_reported(told.method) | own)

    def shown(self, artefact: Artefact) -> Shown:
        import numpy as np

        from qinit_cli.artefacts.choice import Choice

        choice = Choice.of(artefact)
        best = choice.chosen
        numbers: dict[str, int | float | str] = {
            "sources": choice.sources,
            "candidates": len(choice.candidates),
            **best.parameters,
            "average_return": best.average.value,
            "difference": best.difference.value,
            "difference_low": best.difference.low,
            "difference_high": best.difference.high,
            "worth": choice.worth.value,
            "worth_low": choice.worth.low,
            "worth_high": choice.worth.high,
        }
        return Shown(numbers, np.empty(0))


TUNING = TuningKind()


def tuning_schema(parameters: tuple[str, ...], candidates: int, bounds: ReturnBounds = UNIT) -> Schema:
    """What choosing a method's parameters leaves behind: how each source fared as a target under each candidate."""
    from qinit_cli.artefacts.columns import index, kept, within_bounds
    from qinit_store.schema import TASK, Column, Schema, digest_axis

    columns = (
        Column(
            "average",
            (TASK, CANDIDATE),
            "f8",
            long_name="mean return over the episodes; NaN where it was not tried",
            low=0,
            high=1,
            nan=True,
        ),
        Column("steps", (TASK,), "i8", "step", "environment steps simulated", low=0),
        *kept(),
        *(Column(name, (CANDIDATE,), "f8", long_name="parameter of the candidate") for name in parameters),
    )
    return Schema("tuning", (index(CANDIDATE, candidates), digest_axis()), within_bounds(columns, bounds))
