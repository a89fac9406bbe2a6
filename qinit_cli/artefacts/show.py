"""What an artefact amounts to: a few numbers, and the one array that a picture of it shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.opening import family_in
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.family import relative_error
from qinit_cli.fitted import MASKED, UNKNOWN

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Tasks
    from qinit_store.reading import Artefact

ERROR_TASKS = 100  # sources whose tables are set against exact ones
SMOOTH = 20  # episodes averaged into each point of a run's curve, as plot does unless told otherwise


@dataclass(frozen=True)
class Shown:
    """An artefact in brief; numbers may be NaN where there is nothing to count."""

    numbers: dict[str, int | float | str]
    picture: Floats  # sources: (n,) ln of the start's value; fit: the state axes; run: (E,) return; () long where there is none


def show(artefact: Artefact) -> Shown:
    """Numbers and picture of an artefact of any kind, every task verified; memory is that of a block of tasks."""
    match artefact.kind:
        case "sources":
            return _sources(artefact)
        case "fit":
            return _fit(artefact)
        case "tuning":
            return _tuning(artefact)
        case _:
            return _run(artefact)


def _sources(artefact: Artefact) -> Shown:
    from qinit_cli.elementary import ln

    spec = artefact.spec
    family = family_in(artefact) if spec["family"]["name"] in FAMILIES else None
    compared = family is not None and family.tabular and spec["learner"] != "exact"
    solved = steps = unvisited = not_positive = entries = 0
    seconds = 0.0
    start_values: list[Floats] = []
    errors: list[Floats] = []
    parameters = [] if family is None else [column.name for column in family.parameters()]
    columns = ("q", "visits", "solved", "steps", "seconds", *parameters)
    for block in artefact.blocks(columns, artefact.schema.block_size):
        solved += int(block["solved"].sum())
        steps += int(block["steps"].sum())
        seconds += float(block["seconds"].sum())
        unvisited += int((block["visits"] == 0).sum())
        not_positive += int((block["q"] <= 0).sum())
        entries += block["q"].size
        if family is not None:
            q = block["q"].reshape(len(block["q"]), -1, len(family.actions))
            start_values.append(family.start_value(q))
            room = ERROR_TASKS - len(errors)
            if compared and room > 0:
                tasks = _tasks(family, block)[:room]
                errors += list(relative_error(family, spec["learning"]["gamma"], tasks, q[:room]))
    numbers: dict[str, Any] = {
        "tasks": artefact.task_count,
        "solved": solved,
        "steps": steps,
        "seconds": seconds,
    }
    numbers |= {"entries": entries, "entries_not_positive": not_positive}
    if spec["learner"] != "exact":
        numbers["entries_never_visited"] = unvisited
    if errors:
        numbers |= _error_numbers(np.array(errors).reshape(len(errors), -1), artefact.tasks)
    values = np.concatenate([np.empty(0), *start_values])
    if len(values):
        numbers |= {
            "start_value_median": float(np.median(values)),
            "start_value_zero": int((values <= 0).sum()),
        }
    return Shown(numbers, ln(values[values > 0]))


def _tasks(family: Family, block: dict[str, Any]) -> Tasks:
    columns = family.parameters()
    tasks = np.empty(len(block["task"]), dtype=np.dtype([(column.name, column.dtype) for column in columns]))
    for column in columns:
        tasks[column.name] = block[column.name]
    return tasks


def _error_numbers(errors: Floats, tasks: np.ndarray[Any, Any]) -> dict[str, int | float]:
    """Relative errors against exact tables, (n, S * A), NaN where the exact value is 0."""
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


def _fit(artefact: Artefact) -> Shown:
    n, flags, median = (artefact.read(name) for name in ("n", "flags", "lognormal_median"))
    numbers: dict[str, Any] = {
        "sources": int(artefact.spec["sources"]["tasks"]),
        "estimator": artefact.spec["estimator"],
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
    return Shown(numbers, np.where(np.isfinite(best), best, np.nan))


def _tuning(artefact: Artefact) -> Shown:
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


def _run(artefact: Artefact) -> Shown:
    from qinit_cli.analysis import returns

    gamma, horizon = float(artefact.spec["learning"]["gamma"]), int(artefact.spec["learning"]["horizon"])
    values = [
        name
        for name in ("v_star", "v_eps")
        if name in {column.name for column in artefact.schema.task_columns}
    ]
    totals = dict.fromkeys(values, 0.0)
    earned, reached, restricted = (np.zeros(artefact.schema.sizes["episode"]) for _ in range(3))
    for block in artefact.blocks(("steps", "reached", *values), artefact.schema.block_size):
        arrived = block["reached"].astype(bool)
        earned += returns.discounted_returns(block["steps"], arrived, gamma).sum(axis=0)
        reached += arrived.sum(axis=0)
        restricted += returns.restricted_steps(block["steps"], horizon).sum(axis=0)
        for name in values:
            totals[name] += float(block[name].sum())
    targets = artefact.task_count
    if not targets:
        return Shown({"targets": 0, "episodes": len(earned)}, np.empty(0))
    curve = earned / targets
    numbers: dict[str, int | float | str] = {
        "targets": targets,
        "episodes": len(curve),
        "average_return": float(curve.mean()),
        "first_10": float(returns.jumpstart(curve)),
        "last_tenth": float(returns.asymptotic(curve)),
        "success": float(reached.mean() / targets),
        "restricted_steps": float(restricted.mean() / targets),
        **{name: total / targets for name, total in totals.items()},
    }
    return Shown(numbers, returns.smoothed(curve, SMOOTH))
