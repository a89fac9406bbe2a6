"""Sources: tasks that were learned to the end."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.artefacts.kind import DIGEST_FIELD, Field, Kind, Reported, Shown
from qinit_cli.environments.tiled import PROBES, WEIGHTS
from qinit_cli.learning import EXACT
from qinit_cli.rewards import SHARE, UNIT, ReturnBounds

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats, Tasks
    from qinit_cli.artefacts.settings import SourcesSettings, Spec
    from qinit_cli.environments import Family
    from qinit_store.reading import Artefact
    from qinit_store.schema import Axis, Column, Schema

ERROR_TASKS = 100  # whose tables are set against exact ones
OF_LEARNING = ("eopl", "solved", "steps", "seconds")  # columns of tasks that were learned or solved here
OF_IMPORTED = ("q", "visits", "td_var")  # columns that tables learned elsewhere may have
NEVER_ARRIVES = -1  # a path length that no statistic counts


class SourcesKind(Kind["SourcesSettings"]):
    """Tasks that were learned to the end."""

    name = "sources"
    folder = "sources"
    maker = "train-sources"
    one, several, counted = "set of sources", "sets of sources", "sources"
    tables: ClassVar[Mapping[str, str]] = {
        "tables": "q",
        "tasks": "solved",
        "curves": "curve_steps",
        "weights": WEIGHTS,
        "probes": PROBES,
    }
    table = "q"
    has_parameters = True
    indices = ("bin",)
    results = ("solved", "steps", "seconds")

    def read(self, spec: Spec) -> SourcesSettings:
        from qinit_cli.artefacts.settings import SourcesSettings

        return SourcesSettings.read(spec)

    def least(self, states: tuple[Axis, ...], action: Axis, there: Container[str]) -> tuple[Column, ...]:
        return sources_schema(states, action, (), 0, tiled=WEIGHTS in there).columns

    def lack(self, schema: Schema, *, part: bool) -> str:
        found = super().lack(schema, part=part)
        names = {column.name for column in schema.columns}
        # imported tables lack all of what learning leaves; `asked` refuses others without it
        return "" if found and "q" in names and not names & set(OF_LEARNING) else found

    def asked(self, spec: Spec) -> tuple[str, ...]:
        settings = self.read(spec)
        if settings.imported:
            return () if settings.min_visits is None else ("visits",)
        if settings.learner == EXACT:
            return OF_LEARNING
        tiled = (WEIGHTS, PROBES) if settings.family.tiled else ()
        return (*OF_LEARNING, *tiled, "curve_steps", "curve_reached")

    def lengths(self, artefact: Artefact) -> dict[str, int]:
        from qinit_cli.learning import curve_bins

        settings = self.read(artefact.spec)
        return {"bin": curve_bins(settings.learner, settings.learning)}

    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        settings, bins = self.read(artefact.spec), artefact.schema.sizes.get("bin", 0)
        bounds = settings.bounds
        if settings.imported:
            return imported_schema(*self.axes(artefact), bounds).columns
        tiled = settings.family.tiled
        return sources_schema(*self.axes(artefact), (), bins, bounds, tiled=tiled).columns

    def highest(self, artefact: Artefact) -> dict[str, float]:
        settings = self.read(artefact.spec)
        if settings.imported:
            return {}
        if settings.learner == EXACT:
            return {"steps": 0, "visits": 0, **self.longest_path(artefact, settings)}
        learning = settings.learning
        most = learning.episodes * learning.horizon
        return {
            "steps": most,
            "visits": most,
            "curve_steps": learning.horizon,
            **self.longest_path(artefact, settings),
        }

    def shown(self, artefact: Artefact) -> Shown:
        import numpy as np

        from qinit_cli.elementary import ln
        from qinit_cli.environments.family import relative_error

        settings = self.read(artefact.spec)
        if settings.imported:
            return _imported_shown(artefact, settings)
        family = None if settings.family.here is None else self.family(artefact)
        present = (
            family is not None and family.present
        )  # else tasks cannot be made, and what takes them is unknown
        compared = present and family is not None and family.tabular and settings.learner != EXACT
        solved = steps = unvisited = not_positive = entries = 0
        seconds = 0.0
        start_values: list[Floats] = []
        errors: list[Floats] = []
        parameters = [] if family is None else [column.name for column in family.parameters()]
        counted = ("visits",) * (not settings.family.tiled)
        columns = ("q", *counted, "solved", "steps", "seconds", *parameters)
        bounds = settings.bounds
        for block in blocks_in_shares(artefact, columns):
            solved += int(block["solved"].sum())
            steps += int(block["steps"].sum())
            seconds += float(block["seconds"].sum())
            unvisited += int((block["visits"] == 0).sum()) if counted else 0
            not_positive += int((block["q"] <= 0).sum())
            entries += block["q"].size
            if family is not None and present:
                q = block["q"].reshape(len(block["q"]), -1, len(family.actions))
                start_values.append(family.start_values(_tasks(family, block), q))
                room = ERROR_TASKS - len(errors)
                if compared and room > 0:
                    tasks = _tasks(family, block)[:room]
                    errors += list(relative_error(family, settings.learning.gamma, tasks, q[:room]))
        numbers: dict[str, Any] = {
            "tasks": artefact.task_count,
            "solved": solved,
            "steps": steps,
            "seconds": seconds,
        }
        numbers |= {"entries": entries, "entries_not_positive": not_positive}
        if settings.learner != EXACT and counted:
            numbers["entries_never_visited"] = unvisited
        if errors:
            numbers |= _error_numbers(np.array(errors).reshape(len(errors), -1), artefact.tasks)
        values = np.concatenate([np.empty(0), *start_values])
        if len(values):
            numbers |= {
                "start_value_median": float(np.median(bounds.returns(values))),
                "start_value_zero": int((values <= 0).sum()),
            }
        quantity = "Q" if bounds == UNIT else SHARE
        title = "ln of the greedy value at the target start, over tasks"
        return Shown(numbers, ln(values[values > 0]), "histogram", title, f"ln {quantity}")

    def reported(self, told: SourcesSettings) -> Iterator[Reported]:
        yield Reported("Source tasks", told.spec())

    def derived_fields(self, table: str) -> list[Field]:
        return [DIGEST_FIELD] if table == "tasks" else []


SOURCES = SourcesKind()


def sources_schema(
    state_axes: tuple[Axis, ...],
    action: Axis,
    parameters: tuple[Column, ...],
    bins: int,
    bounds: ReturnBounds = UNIT,
    more_axes: tuple[Axis, ...] = (),
    more: tuple[Column, ...] = (),
    *,
    tiled: bool = False,
) -> Schema:
    """What source tasks leave behind; `bins` 0 for the exact learner, which has no learning curve.

    Of `tiled` values neither visits nor errors are counted; `more` are the columns that they have besides.
    """
    from qinit_cli.artefacts.columns import ROUNDING, index, kept, within_bounds
    from qinit_store.schema import TASK, Column, Schema, digest_axis

    columns = [
        one for one in table_columns(state_axes, action) if not (tiled and one.name in ("td_var", "visits"))
    ]
    tables = within_bounds(columns, bounds, tiled=tiled)
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
    axes = (*state_axes, action, *more_axes, *([index("bin", bins)] if bins else []), digest_axis())
    return Schema("sources", axes, (*tables, *more, *(curve if bins else ()), *parameters, *totals))


def table_columns(state_axes: tuple[Axis, ...], action: Axis) -> tuple[Column, ...]:
    """The columns over states and actions, of returns from 0 to 1."""
    from qinit_cli.artefacts.columns import ROUNDING
    from qinit_store.schema import TASK, Column

    state_action = (*(axis.name for axis in state_axes), action.name)
    return (
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


def imported_schema(
    state_axes: tuple[Axis, ...], action: Axis, bounds: ReturnBounds, given: Sequence[str] = OF_IMPORTED
) -> Schema:
    """What imported tables hold: the columns `given`, of q, visits and td_var, and no others."""
    from qinit_cli.artefacts.columns import within_bounds
    from qinit_store.schema import Schema, digest_axis, digest_column

    tables = [one for one in table_columns(state_axes, action) if one.name in given]
    axes = (*state_axes, action, digest_axis())
    return Schema("sources", axes, (*within_bounds(tables, bounds), digest_column()))


def blocks_in_shares(
    artefact: Artefact, names: Sequence[str], size: int | None = None
) -> Iterator[dict[str, Any]]:
    """The columns in blocks of tasks, `q` and `td_var` as shares of the attainable return, see rewards.ReturnBounds."""
    shares = Shares.of(artefact)
    there = {column.name for column in artefact.schema.columns}
    read = [name for name in (*names, *shares.needed) if name in there]
    for block in artefact.blocks(read, size or artefact.schema.block_size):
        yield shares.block(block, names)


@dataclass(frozen=True)
class Shares:
    """How the returns in sources become shares of the attainable return."""

    bounds: ReturnBounds
    least_visits: int | None  # of a pair that is known; None: none is left out

    @classmethod
    def of(cls, artefact: Artefact) -> Self:
        """Those of the sources in an artefact."""
        settings = SOURCES.read(artefact.spec)
        bounds = settings.bounds
        if settings.imported:
            return cls(bounds, settings.min_visits)
        # a learned table holds its start where it was never visited, which may be any return
        uncounted = settings.learner == EXACT or settings.family.tiled
        return cls(bounds, None if uncounted or bounds == UNIT else 1)

    @property
    def needed(self) -> tuple[str, ...]:
        """The columns that say which pairs are known, beside the values."""
        return () if self.least_visits is None else ("visits",)

    def block(self, block: Mapping[str, Any], names: Sequence[str] = ()) -> dict[str, Any]:
        """The block with shares: 0, which a fit leaves out, for a pair that is unknown.

        Of imported tables also the columns `names` that were not given: variances of NaN, path lengths that never arrive.
        """
        import numpy as np

        found = dict(block)
        if "q" in found:
            found["q"] = self.bounds.shares(found["q"])
            if self.least_visits is not None:
                found["q"] = np.where(found["visits"] >= self.least_visits, found["q"], 0.0)
        if "td_var" in found and self.bounds != UNIT:
            found["td_var"] = found["td_var"] / self.bounds.width**2
        for name, unknown in (("td_var", np.nan), ("eopl", NEVER_ARRIVES)):
            if name in names and name not in found:
                found[name] = np.full(found["q"].shape, unknown)
        return found


def _imported_shown(artefact: Artefact, settings: SourcesSettings) -> Shown:
    """Tables that were learned elsewhere in brief: steps, solved tasks and target starts are unknown."""
    import numpy as np

    total: Any = 0.0
    known = entries = 0
    for block in blocks_in_shares(artefact, ("q",)):
        total = total + block["q"].max(axis=-1).sum(axis=0)
        known += int((block["q"] > 0).sum())
        entries += block["q"].size
    numbers: dict[str, Any] = {"tasks": artefact.task_count, "files": len(settings.files)}
    numbers |= {"entries": entries, "entries_unknown": entries - known}
    mean = np.asarray(total) / max(1, artefact.task_count)
    quantity = "Q" if settings.bounds == UNIT else SHARE
    return Shown(numbers, mean, "heatmap", f"largest {quantity} over actions, mean over tasks")


def _tasks(family: Family, block: dict[str, Any]) -> Tasks:
    import numpy as np

    columns = family.parameters()
    tasks = np.empty(len(block["task"]), dtype=np.dtype([(column.name, column.dtype) for column in columns]))
    for column in columns:
        tasks[column.name] = block[column.name]
    return tasks


def _error_numbers(errors: Floats, tasks: np.ndarray[Any, Any]) -> dict[str, int | float]:
    """Relative errors against exact tables, (n, S * A), NaN where the exact value is 0."""
    import numpy as np

    medians = np.array([np.median(known) for row in errors if (known := row[np.isfinite(row)]).size])
    if not medians.size:
        return {}
    worst = int(medians.argmax())
    return {
        "error_tasks": len(medians),
        "median_relative_error": float(np.median(errors[np.isfinite(errors)])),
        "worst_task": int(tasks[worst]),
        "worst_median_relative_error": float(medians[worst]),
    }
