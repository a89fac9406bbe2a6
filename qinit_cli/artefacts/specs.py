"""What changes the numbers, as the plain dictionaries that the store keeps, and back: family, learning, method.

An artefact's spec contains all that transfer and compare need of the stage before, so that files can travel alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from qinit_cli.environments import FAMILIES, Family
from qinit_cli.learning import QLearning
from qinit_cli.methods import METHODS, Method
from qinit_cli.methods.plus import Plus, initialisations
from qinit_cli.registry import PLUG_IN

if TYPE_CHECKING:
    from qinit_cli.fitted import FitOptions
    from qinit_cli.tasks import SourceTasks, TargetTasks

ALGORITHM = (
    1  # raised whenever the same settings would give other numbers; a family may have a higher one of its own
)

Spec = dict[str, Any]


def sources(tasks: SourceTasks, count: int) -> Spec:
    """The spec of source tasks. The exact learner has neither episodes nor exploration."""
    return {
        "kind": "sources",
        "algorithm_version": _algorithm(tasks.family),
        "role": tasks.role,
        "family": _family(tasks.family),
        "learner": tasks.learner,
        "learning": exact_learning(tasks.learning) if tasks.learner == "exact" else asdict(tasks.learning),
        "seed": tasks.seed,
        "tasks": count,
    }


def exact_learning(learning: QLearning) -> Spec:
    """The settings that mean something to the exact learner; alpha is kept for the transfer that follows."""
    return {name: value for name, value in asdict(learning).items() if name in ("alpha", "gamma", "horizon")}


def fit(sources: Spec, inputs: list[str], options: FitOptions) -> Spec:
    """The spec of a fit: its own settings, its inputs' content hashes and what they were learned with."""
    return {
        "kind": "fit",
        "algorithm_version": ALGORITHM,
        "inputs": inputs,
        "sources": {name: value for name, value in sources.items() if name != "kind"},
        **asdict(options),
    }


def run(method: Method, targets: TargetTasks, tasks: int, fit: str, fitted: Spec) -> Spec:
    """The spec of a run: the method, the target distribution, how targets are learned, the fit and what it was made of.

    Tables that `optimal` learned are not named: these settings decide them, and their content hash changes with their count,
    on which no single target depends.
    """
    return {
        "kind": "run",
        "algorithm_version": _algorithm(targets.family),
        "method": _method(method, targets.family),
        "family": _family(targets.family),
        "learning": asdict(targets.learning),
        "seed": targets.seed,
        "tasks": tasks,
        "inputs": [fit],
        "source_set": source_set(fitted),
        "keep_q": targets.keep_q,
        "evaluate_every": targets.evaluate_every,
    }


def tuning(
    method: Method,
    grid: Mapping[str, Sequence[float]],
    targets: TargetTasks,
    sources: Spec,
    content: str,
    tasks: int,
) -> Spec:
    """The spec of a choice of parameters: the method as it is by default, the values tried, and how the sources were learned."""
    return {
        "kind": "tuning",
        "algorithm_version": _algorithm(targets.family),
        "method": _method(method, targets.family),
        "grid": {name: list(values) for name, values in grid.items()},
        "family": _family(targets.family),
        "learning": asdict(targets.learning),
        "seed": targets.seed,
        "tasks": tasks,
        "inputs": [content],
        "sources": {name: value for name, value in sources.items() if name != "kind"},
    }


def plug_ins(spec: Mapping[str, Any]) -> dict[str, str]:
    """The plug-ins whose families and methods a spec names: "plug-in NAME", and the distribution with its version.

    Also the packages that a family's numbers depend on (its `packages`), with their versions.
    """
    from importlib.metadata import version

    families = [each["family"]["name"] for each in (spec, spec.get("sources", {})) if "family" in each]
    method = spec.get("method", {})
    methods = [
        *(each["name"] for each in (method, method.get("init", {})) if "name" in each),
        *spec.get("initialisations", []),
    ]
    packages = [(name, FAMILIES.package(name)) for name in families]
    packages += [(name, METHODS.package(name)) for name in methods]
    needed = {each for name in families for each in getattr(FAMILIES.get(name), "packages", ())}
    return {f"{PLUG_IN} {name}": package for name, package in packages if package} | {
        each: version(each) for each in sorted(needed)
    }


def outdated(spec: Mapping[str, Any]) -> list[str]:
    """A warning where an earlier version learned these tasks, or the sources behind them, otherwise; else none."""
    told = spec.get("sources", spec)
    family = FAMILIES.get(told["family"]["name"])
    if family is None or int(told["algorithm_version"]) >= _algorithm(family):
        return []
    return [
        f"these tasks of {family.name} were learned by an earlier version: {getattr(family, 'learned_anew', '')}"
    ]


def source_set(fitted: Spec) -> Spec:
    """What tells one source set from its replicates (the sources' content hash), and what all replicates must share."""
    sources = fitted["sources"]
    return {
        "sources": fitted["inputs"][0],
        "family": sources["family"],
        "learner": sources["learner"],
        "learning": sources["learning"],
        "tasks": sources["tasks"],
        **{
            name: fitted[name]
            for name in ("estimator", "library", "holdout", "exclude_unlearned")
            if name in fitted
        },
    }


def _method(method: Method, family: Family) -> Spec:
    """The method's name, label and options; a method that it starts from stands with its own options."""
    settings = asdict(method.on(family))  # type: ignore[call-overload]  # a dataclass
    if isinstance(method, Plus):
        start = initialisations()[method.init]()
        settings["init"] = {"name": start.name, **asdict(start)}  # type: ignore[call-overload]  # a dataclass
    return {"name": method.name, "label": method.label, **settings}


def _algorithm(family: Family | type[Family]) -> int:
    return int(getattr(family, "algorithm", ALGORITHM))


def _family(family: Family) -> Spec:
    return {"name": family.name, **asdict(family)}  # type: ignore[call-overload]  # a dataclass
