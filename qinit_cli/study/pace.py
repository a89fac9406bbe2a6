"""What takes alike in a study, for the time that is left of it."""

from __future__ import annotations

from qinit_cli.pipeline.pace import Kind
from qinit_cli.study.planned import STAGES, Artefact, PlannedFit, PlannedRun, PlannedSources, PlannedTuning

DRAWING: Kind = ("drawing",)


def kind_of(artefact: Artefact) -> Kind:
    """Those that take the same, for what was foreseen of them."""
    stage = STAGES[type(artefact)]
    match artefact:
        case PlannedSources(family):
            return stage, family.name, family.label
        case PlannedFit(sources):
            return stage, sources.family.name
        case PlannedTuning(sources, method):
            return stage, sources.family.name, method.name
        case PlannedRun(fit, method):
            return stage, fit.sources.family.name, method.name
