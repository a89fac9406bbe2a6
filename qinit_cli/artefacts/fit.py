"""A fit: what is known of the sources' tables, and what was asked of them besides."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.artefacts.kind import Kind, Reported, Shown
from qinit_cli.environments.tiled import PROBES
from qinit_cli.rewards import SHARE, UNIT, ReturnBounds

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import FitSettings, Spec
    from qinit_store.reading import Artefact
    from qinit_store.schema import Axis, Column, Schema


class FitKind(Kind["FitSettings"]):
    """What is known of the sources."""

    name = "fit"
    folder = "fits"
    maker = "fit"
    one, several, counted = "fit", "fits", "sources"
    tables: ClassVar[Mapping[str, str]] = {
        "state-actions": "mu",
        "states": "value_mean",
        "library": "library_q",
        "probes": PROBES,
    }
    table = "mu"
    by_task = False
    indices = ("library", "held_out")
    described = ("library",)

    def asked(self, spec: Spec) -> tuple[str, ...]:
        return (PROBES, "library_weights") if self.read(spec).sources.family.tiled else ()

    def read(self, spec: Spec) -> FitSettings:
        from qinit_cli.artefacts.settings import FitSettings

        return FitSettings.read(spec)

    def least(self, states: tuple[Axis, ...], action: Axis, there: Container[str]) -> tuple[Column, ...]:
        return fit_schema(states, action, 1).columns

    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        from qinit_cli.artefacts.fit_columns import FitStatistics, fit_statistics

        states, action = self.axes(artefact)
        names = (*(axis.name for axis in states), action.name)
        everything = FitStatistics("a test", "a test", ("a distribution",), ("a start",), 1, theory=True)
        library = artefact.schema.sizes["library"]
        sources = self.read(artefact.spec).sources
        bounds = sources.bounds
        return fit_schema(
            states,
            action,
            library,
            *fit_statistics(everything, names),
            bounds=bounds,
            variances=sources.varied,
            tiled=sources.family.tiled,
        ).columns

    def highest(self, artefact: Artefact) -> dict[str, float]:
        sources = self.read(artefact.spec).sources
        tasks = sources.tasks
        longest = {f"{name}_mean": steps for name, steps in self.longest_path(artefact, sources).items()}
        return {"n": tasks, "n_masked": tasks, "eopl_n": tasks, "library_task": tasks - 1, **longest}

    def check_values(self, artefact: Artefact) -> None:
        from qinit_cli.artefacts.fit_values import check_values

        check_values(artefact)

    def reported(self, told: FitSettings) -> Iterator[Reported]:
        yield Reported("Source tasks", told.sources.spec(), 1)
        yield Reported("Fits", {name: own for name, own in told.spec().items() if name != "sources"})

    def shown(self, artefact: Artefact) -> Shown:
        import numpy as np

        from qinit_cli.fitted import MASKED, UNKNOWN

        settings = self.read(artefact.spec)
        n, flags, median = (artefact.read(name) for name in ("n", "flags", "lognormal_median"))
        numbers: dict[str, Any] = {
            "sources": settings.sources.tasks,
            "estimator": settings.options.estimator,
            "state_actions": n.size,
            "unknown": int((flags & UNKNOWN > 0).sum()),
            "masked": int((flags & MASKED > 0).sum()),
            "masked_entries": int(artefact.read("n_masked").sum()),
            "n_least": int(n.min()),
            "n_most": int(n.max()),
            "library_tables": len(artefact.read("library_task")),
        }
        known = median[np.isfinite(median)]
        if known.size:
            numbers |= {"median_least": float(known.min()), "median_most": float(known.max())}
        best = np.where(np.isfinite(median), median, -np.inf).max(axis=-1)
        title = "log-normal median of Q, its largest over actions"
        return Shown(numbers, np.where(np.isfinite(best), best, np.nan), "heatmap", title)


FIT = FitKind()


def fit_schema(
    state_axes: tuple[Axis, ...],
    action: Axis,
    library: int,
    more_axes: tuple[Axis, ...] = (),
    more: tuple[Column, ...] = (),
    bounds: ReturnBounds = UNIT,
    variances: bool = True,
    *,
    tiled: bool = False,
) -> Schema:
    """What a fit holds of its sources, with the tables of the first `library` of them, and what was asked on top.

    Of sources whose `variances` of TD errors may be unknown these are NaN.
    """
    import math

    from qinit_cli.artefacts.columns import ROUNDING, index, within_bounds
    from qinit_store.schema import Column, Schema

    state = tuple(axis.name for axis in state_axes)
    state_action = (*state, action.name)
    q = "Q" if bounds == UNIT else SHARE
    moments = (
        Column("mu", state_action, "f8", long_name=f"mean of ln {q}", nan=True),
        Column("sigma", state_action, "f8", long_name=f"standard deviation of ln {q}", low=0, nan=True),
        Column(
            "lognormal_median",
            state_action,
            "f8",
            long_name="median of the fitted log-normal",
            low=-math.inf,  # the unbiased estimator may be below 0
            high=math.inf,
            nan=True,
        ),
        Column(
            "lognormal_mean",
            state_action,
            "f8",
            long_name="mean of the fitted log-normal",
            low=-math.inf,
            high=math.inf,
            nan=True,
        ),
        Column("mean", state_action, "f8", long_name="mean of Q", low=0, high=1 + ROUNDING, nan=True),
        Column(
            "std", state_action, "f8", long_name="standard deviation of Q", low=0, high=1 + ROUNDING, nan=True
        ),
        Column("min", state_action, "f8", long_name="least Q", low=0, high=1 + ROUNDING, nan=True),
        Column("max", state_action, "f8", long_name="largest Q", low=0, high=1 + ROUNDING, nan=True),
        Column(
            "eopl_mean",
            state_action,
            "f8",
            "step",
            "mean of the expected optimal path lengths",
            low=0,
            nan=True,
        ),
        Column("eopl_std", state_action, "f8", "step", "their standard deviation", low=0, nan=True),
    )
    counts = (
        Column("n", state_action, "i4", long_name=f"sources with {q} > 0", low=0),
        Column("n_masked", state_action, "i4", long_name=f"sources left out: {q} not positive", low=0),
        Column("eopl_n", state_action, "i4", long_name="sources whose path arrives", low=0),
        Column("flags", state_action, "u1", long_name="how the pair was treated"),
    )
    tables = (
        Column(
            "value_mean",
            state,
            "f8",
            long_name="mean over sources of the largest action value",
            low=0,
            high=1 + ROUNDING,
        ),
        Column(
            "library_q",
            ("library", *state_action),
            "f8",
            long_name="action values of a source",
            low=0,
            high=1 + ROUNDING,
        ),
        Column(
            "library_td_var",
            ("library", *state_action),
            "f8",
            long_name="its mean squared TD error",
            low=0,
            high=1 + ROUNDING,
            nan=not variances,
        ),
        Column("library_task", ("library",), "i8", long_name="task id of the source", low=0),
    )
    axes = (*state_axes, action, index("library", library), *more_axes)
    return Schema(
        "fit",
        axes,
        (
            *within_bounds(moments, bounds, tiled=tiled),
            *counts,
            *within_bounds(tables, bounds, tiled=tiled),
            *more,
        ),
    )
