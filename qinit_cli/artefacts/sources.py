"""Sources: tasks that were learned to the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qinit_cli.artefacts.kind import Kind

if TYPE_CHECKING:
    from qinit_cli.artefacts.kind import Settings
    from qinit_store.reading import Artefact
    from qinit_store.schema import Axis, Column, Schema


class SourcesKind(Kind):
    """Tasks that were learned to the end."""

    name = "sources"
    folder = "sources"
    maker = "train-sources"
    table = "q"
    has_parameters = True

    def check_settings(self, spec: Settings) -> None:
        from qinit_cli.artefacts import settings

        told = settings.of(
            spec,
            "the settings",
            {
                "algorithm_version": int,
                "family": dict,
                "learner": str,
                "learning": dict,
                "seed": int,
                "tasks": int,
            },
            {"role": str},
        )
        settings.among("role", told.get("role", "source"), settings.ROLES)
        settings.drawn(told)

    def least(self, states: tuple[Axis, ...], action: Axis) -> tuple[Column, ...]:
        return sources_schema(states, action, (), 0).columns

    def lengths(self, artefact: Artefact) -> dict[str, int]:
        from qinit_cli.artefacts import settings
        from qinit_cli.learning import curve_bins

        learner = artefact.spec["learner"]
        return {"bin": curve_bins(learner, settings.learning(artefact.spec["learning"], learner))}

    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        return sources_schema(*self.axes(artefact), (), artefact.schema.sizes.get("bin", 0)).columns

    def highest(self, artefact: Artefact) -> dict[str, float]:
        from qinit_cli.artefacts import settings

        if artefact.spec.get("learner") == "exact":
            return {"steps": 0, "visits": 0, **self.longest_path(artefact)}
        learning = settings.learning(artefact.spec["learning"])
        most = learning.episodes * learning.horizon
        return {
            "steps": most,
            "visits": most,
            "curve_steps": learning.horizon,
            **self.longest_path(artefact),
        }


SOURCES = SourcesKind()


def sources_schema(
    state_axes: tuple[Axis, ...], action: Axis, parameters: tuple[Column, ...], bins: int
) -> Schema:
    """What source tasks leave behind; `bins` 0 for the exact learner, which has no learning curve."""
    from qinit_cli.artefacts.columns import ROUNDING, index, kept
    from qinit_store.schema import TASK, Column, Schema, digest_axis

    state_action = (*(axis.name for axis in state_axes), action.name)
    tables = (
        Column("q", (TASK, *state_action), "f8", long_name="action values", low=0, high=1 + ROUNDING),
        Column(
            "td_var",
            (TASK, *state_action),
            "f8",
            long_name="mean squared TD error of the task's own table",
            low=0,
            high=1 + ROUNDING,
        ),
        Column(
            "eopl",
            (TASK, *state_action),
            "i4",
            "step",
            "expected optimal path length, -1: never arrives",
            low=-1,
        ),
        Column("visits", (TASK, *state_action), "i8", long_name="updates of the pair", low=0),
    )
    curve = (
        Column("curve_steps", (TASK, "bin"), "f4", "step", "mean steps over equal bins of episodes", low=0),
        Column(
            "curve_reached",
            (TASK, "bin"),
            "f4",
            long_name="share of episodes that reach the goal",
            low=0,
            high=1 + ROUNDING,
        ),
    )
    totals = (
        Column(
            "solved", (TASK,), "u1", long_name="greedy policy reaches the goal from the target start", high=1
        ),
        Column("steps", (TASK,), "i8", "step", "environment steps simulated", low=0),
        *kept(),
    )
    axes = (*state_axes, action, *([index("bin", bins)] if bins else []), digest_axis())
    return Schema("sources", axes, (*tables, *(curve if bins else ()), *parameters, *totals))
