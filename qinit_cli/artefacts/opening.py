"""Artefacts as commands open them: what they hold fits the settings they were made with.

The store vouches for the bytes. Here the settings are checked by the dataclasses that make them, the axes by the family, and
each number, task parameters included, by the range of its column, before a kernel or a picture sees any of it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from qinit_cli.artefacts import settings
from qinit_cli.artefacts.columns import ROUNDING
from qinit_cli.artefacts.fit import fit_schema
from qinit_cli.artefacts.fit_columns import FitStatistics, fit_statistics
from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.artefacts.run import run_schema
from qinit_cli.artefacts.sources import sources_schema
from qinit_cli.artefacts.tuning import tuning_schema
from qinit_cli.elementary import exp, ln
from qinit_cli.environments import FAMILIES, Family, family_of
from qinit_cli.errors import NotAllowed
from qinit_cli.learning import curve_bins
from qinit_cli.methods import METHODS
from qinit_store import reading
from qinit_store.held import Held
from qinit_store.reading import Artefact, Description
from qinit_store.schema import Axis, Column

TABLE = {"sources": "q", "fit": "mu", "run": "start"}  # a table over states and actions that each kind has
INDICES = ("bin", "library", "episode", "evaluation", "hypothesis", "candidate", "held_out", "byte")
SETTINGS = {  # one of them makes an artefact ours
    "kind",
    "algorithm_version",
    "family",
    "learning",
    "learner",
    "sources",
    "source_set",
    "method",
    "grid",
}
LEAST = 1e-300  # below, numbers lose digits
ESTIMATED = ("lognormal_median", "lognormal_mean")
SLACK = 1e-6  # by which sums in other orders, and rounded logarithms, may differ
COUNTED = {"n": ("mu", "sigma", "mean", "std", "min", "max"), "eopl_n": ("eopl_mean", "eopl_std")}


def open_artefact(source: Path | Held, kind: str | None = None) -> Artefact:
    """The artefact at a path, or in memory, whose content hash holds and whose settings allow what it holds.

    NotFound; Refused if it is not of `kind`; Damaged if it is not as it was written, or holds what cannot be.
    """
    return _fitting(source.of_kind(kind) if isinstance(source, Held) else reading.open_artefact(source, kind))


def open_doubtful(path: Path) -> Artefact:
    """The same, though its content hash need not hold, and settings of another program's are left alone: for verify and salvage.

    Damaged where its settings cannot be.
    """
    artefact = reading.open_doubtful(path)
    return _fitting(artefact) if _ours(artefact.spec) else artefact


def describe(path: Path) -> Description:
    """What the artefact at `path` says of itself, its content not looked into; Damaged where its settings cannot be."""
    from qinit_store import reading
    from qinit_store.errors import Damaged

    found = described(reading.describe(path))
    if found.problem:
        raise Damaged(found.problem)
    return found


def described(entry: Description) -> Description:
    """The entry of a list, without its settings if they cannot be; it is then "damaged" if a command of ours made it."""
    if not entry.spec:
        return entry
    try:
        KINDS[entry.kind].check(entry.spec)
    except ValueError as fault:
        unknown = replace(entry, spec={})
        if entry.state == "done" and _ours(entry.spec):
            return replace(unknown, state="damaged", problem=f"{entry.path} is damaged: {fault}")
        return unknown
    return entry


def family_in(artefact: Artefact) -> Family:
    """The family of its tasks; NotAllowed if that is not installed, or has other states here."""
    family = family_of(_drawn(artefact), artefact.provenance)
    wanted = (*family.shape, len(family.actions))
    column = next(one for one in artefact.schema.columns if one.name == TABLE[artefact.kind])
    if (there := artefact.schema.row_shape(column)) != wanted:
        there_told, here_told = (" x ".join(map(str, shape)) for shape in (there, wanted))
        raise NotAllowed(
            f"the tables of {artefact.path} are over {there_told} states and actions, {family.label} has {here_told}; install "
            "the version of its package that they were made with"
        )
    return family


def action_axis(family: Family) -> Axis:
    """The axis of the family's actions, labelled by their names."""
    return Axis("action", np.array(family.actions, dtype="S"), "", "action")


def _fitting(artefact: Artefact) -> Artefact:
    try:
        _expect(artefact)
    except BaseException:
        artefact.close()
        raise
    return artefact


def _ours(spec: dict[str, Any]) -> bool:
    """Whether a command made it, or could take it for its own: what other programs put into a store has settings of its own."""
    return bool(SETTINGS & spec.keys())


def _expect(artefact: Artefact) -> None:
    try:
        KINDS[artefact.kind].check(artefact.spec)
        family = settings.family(_drawn(artefact)["family"])
        axes, columns = _layout(artefact, family)
        artefact.expect(axes, columns)
        if artefact.kind == "fit" and not artefact.trouble:  # which is told as what it is
            _check_unknown(artefact)
            _check_moments(artefact)
            _check_sources(artefact)
    except ValueError as fault:
        raise artefact.damage(str(fault)) from fault


def _drawn(artefact: Artefact) -> dict[str, Any]:
    """The settings by which its tasks were drawn; of a fit, those of its sources."""
    drawn: dict[str, Any] = artefact.spec["sources"] if artefact.kind == "fit" else artefact.spec
    return drawn


def _layout(artefact: Artefact, family: Family | None) -> tuple[list[Axis], list[Column]]:
    """The axes and columns that the settings make, but for the axes of a family that depend on another package."""
    lengths = _lengths(artefact)
    for name, length in lengths.items():
        if (there := artefact.schema.sizes.get(name, 0)) != length:
            raise ValueError(f"its axis {name} has {there} entries; its settings make {length}")
    axes = [_index(name, artefact.schema.sizes[name]) for name in INDICES if name in artefact.schema.sizes]
    if family is not None and artefact.kind != "tuning" and not getattr(family, "packages", ()):
        axes += [*family.axes(), action_axis(family)]
    _check_scales(artefact)
    parameters = () if family is None or artefact.kind not in ("sources", "run") else family.parameters()
    names = {*(column.name for column in parameters), *artefact.spec.get("grid", ())}
    if lacking := names - {column.name for column in artefact.schema.columns}:
        raise ValueError(f"it lacks {min(lacking)}")
    if artefact.tasks.size and artefact.kind != "fit" and artefact.tasks[-1] >= artefact.spec["tasks"]:
        raise ValueError(f"it holds task {artefact.tasks[-1]} of {artefact.spec['tasks']}, counted from 0")
    return axes, [_within(one, artefact) for one in (*_columns(artefact), *parameters)]


def _lengths(artefact: Artefact) -> dict[str, int]:
    """The length of each index, as the settings make it."""
    spec = artefact.spec
    match artefact.kind:
        case "sources":
            learning = settings.learning(spec["learning"], spec["learner"])
            return {"bin": curve_bins(spec["learner"], learning)}
        case "run":
            learning = settings.learning(spec["learning"])
            every = spec.get("evaluate_every", 0)
            return {
                "episode": learning.episodes,
                "evaluation": 1 + learning.episodes // every if every else 0,
            }
        case "tuning":
            combinations = math.prod(len(values) for values in spec["grid"].values())
            tried = artefact.schema.sizes.get("candidate", 0)  # among them the method as it is
            return {"candidate": min(max(1, tried), combinations + 1)}
        case _:
            return {}


def _within(column: Column, artefact: Artefact) -> Column:
    """The column with the least and the largest value that these settings allow, where they say more than it does."""
    high = _highest(artefact).get(column.name, column.high)
    if artefact.kind == "run" and METHODS.is_own(artefact.spec["method"]["name"]):
        # potentials of our methods are from 0 to 1, and a shaped value is a plain one less its potential
        if column.name == "potential":
            return replace(column, low=0, high=1 + ROUNDING)
        if column.name == "q":
            return replace(column, low=-1 - ROUNDING, high=2 + ROUNDING)
    return replace(column, high=high)


def _highest(artefact: Artefact) -> dict[str, float]:
    """The largest value of each column that these settings bound."""
    spec, kind = artefact.spec, artefact.kind
    if kind == "fit":
        tasks = spec["sources"]["tasks"]
        longest = {f"{name}_mean": steps for name, steps in _longest_path(artefact).items()}
        return {"n": tasks, "n_masked": tasks, "eopl_n": tasks, "library_task": tasks - 1, **longest}
    if kind == "tuning":
        return {}
    if spec.get("learner") == "exact":
        return {"steps": 0, "visits": 0, **_longest_path(artefact)}
    learning = settings.learning(spec["learning"])
    if kind == "run":
        return {"steps": learning.horizon, "eval_steps": learning.horizon, "frozen": learning.episodes}
    most = learning.episodes * learning.horizon
    return {"steps": most, "visits": most, "curve_steps": learning.horizon, **_longest_path(artefact)}


def _longest_path(artefact: Artefact) -> dict[str, float]:
    """The most steps of a path of sources: it meets no state twice, or ends at the horizon; none for a plug-in's family."""
    drawn = artefact.spec.get("sources", artefact.spec)
    if not FAMILIES.is_own(drawn["family"]["name"]):
        return {}
    column = next(one for one in artefact.schema.columns if one.name == TABLE[artefact.kind])
    states = math.prod(artefact.schema.row_shape(column)[:-1])
    return {"eopl": 1.0 + max(states, drawn["learning"]["horizon"])}


def _columns(artefact: Artefact) -> tuple[Column, ...]:
    """The columns that an artefact of this kind may have, over the file's own axes."""
    there = {column.name: column for column in artefact.schema.columns}
    sizes, axes = artefact.schema.sizes, {axis.name: axis for axis in artefact.schema.axes}
    if artefact.kind == "tuning":
        return tuning_schema(tuple(artefact.spec["grid"]), sizes.get("candidate", 0)).columns
    table = there[TABLE[artefact.kind]]
    *states, action = (axes[name] for name in table.dims if name != "task")
    if artefact.kind == "sources":
        return sources_schema(tuple(states), action, (), sizes.get("bin", 0)).columns
    if artefact.kind == "fit":
        names = (*(axis.name for axis in states), action.name)
        everything = FitStatistics("a test", "a test", ("a distribution",), ("a start",), 1, theory=True)
        return fit_schema(tuple(states), action, sizes["library"], *fit_statistics(everything, names)).columns
    return run_schema(
        tuple(states),
        action,
        (),
        sizes["episode"],
        start_per_task=table.per_task,
        potential_per_task=there["potential"].per_task,
        exact_values="v_star" in there or "v_eps" in there,
        evaluations=sizes.get("evaluation", 0),
        keep_q="q" in there,
        updating="visits" in there,
        hypotheses=sizes.get("hypothesis", 0),
        moments=axes["moment"].values if "moment" in axes else None,
    ).columns


def _check_unknown(artefact: Artefact) -> None:
    """ValueError if a moment is NaN though tasks were counted, or a number though none were."""
    for count, moments in COUNTED.items():
        none = artefact.read(count) == 0
        for name in moments:
            if not np.array_equal(np.isnan(artefact.read(name)), none):
                raise ValueError(f"{name} must be NaN where {count} is 0, and nowhere else")


def _check_moments(artefact: Artefact) -> None:
    """ValueError where statistics of a fit contradict one another."""
    tables = {name: artefact.read(name) for name in ("n", *COUNTED["n"], *ESTIMATED)}
    known = tables["n"] > 0
    mu, sigma, mean, std, least, most, median, average = (
        tables[name][known] for name in (*COUNTED["n"], *ESTIMATED)
    )
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        low, high = ln(least), ln(most)
        slack = SLACK * (1 + np.abs(high))
        within = {
            "mean": (least <= mean * (1 + SLACK)) & (mean <= most * (1 + SLACK)),
            "std": std <= most - least + SLACK,
            "mu": (low <= mu + SLACK * (1 + np.abs(mu))) & (mu <= high + slack),
            "sigma": sigma <= high - low + slack,
        }
        if artefact.spec["estimator"] == "mle":
            within["lognormal_median"] = np.isclose(median, exp(mu), rtol=SLACK, atol=LEAST)
            within["lognormal_mean"] = np.isclose(average, exp(mu + sigma**2 / 2), rtol=SLACK, atol=LEAST)
    for name, fits in within.items():
        if not fits.all():
            raise ValueError(f"{name} contradicts the other statistics of the fit")


def _check_sources(artefact: Artefact) -> None:
    """ValueError where a fit counts sources otherwise than its settings and its library do."""
    spec, library = artefact.spec, artefact.read("library_task")
    counted = artefact.read("n") + artefact.read("n_masked")
    fitted = spec["sources"]["tasks"]
    if counted.size and not (counted.min() == counted.max() <= fitted):
        raise ValueError(f"n and n_masked do not count the same sources everywhere, {fitted} at most")
    if (np.diff(library) <= 0).any() or library.size > spec.get("library", library.size):
        raise ValueError("library_task is no row of ascending tasks, as many at most as the settings keep")


def _check_scales(artefact: Artefact) -> None:
    """ValueError where the axes of a table, or the moments of a run, are no scales whatever the family."""
    axes = {axis.name: axis.values for axis in artefact.schema.axes}
    if artefact.kind != "tuning":
        table = next(one for one in artefact.schema.columns if one.name == TABLE[artefact.kind])
        *states, action = (name for name in table.dims if name != "task")
        if axes[action].dtype.kind != "S":
            raise ValueError(f"its axis {action} has no names")
        for name in states:
            if axes[name].dtype.kind != "S" and not (np.diff(axes[name]) > 0).all():
                raise ValueError(f"its axis {name} does not ascend")
    if "moment" in axes:
        moments, episodes = axes["moment"], artefact.spec["learning"]["episodes"]
        whole = moments.dtype.kind == "i" and moments.size > 0
        if not (whole and (np.diff(moments) > 0).all() and moments[0] >= 0 and moments[-1] <= episodes):
            raise ValueError("its axis moment is no row of ascending numbers of episodes")


def _index(name: str, length: int) -> Axis:
    return Axis(name, np.arange(length))
