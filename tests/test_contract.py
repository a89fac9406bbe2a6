"""What every method promises in every family, asked of the registries: whoever registers one more is asked the same."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.artefacts.run import run_schema
from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.family import draw_tasks
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions, FittedTables
from qinit_cli.methods import METHODS, Method
from qinit_cli.methods.plus import Plus, initialisations
from qinit_cli.pipeline.fit import Selection, fit
from qinit_cli.pipeline.sources import learn_sources
from qinit_cli.pipeline.transfer import learn_targets, statics
from qinit_cli.seeding import Stream
from qinit_cli.tasks import SourceTasks, TargetTasks
from qinit_cli.watch import Watch
from qinit_store.reading import open_artefact
from qinit_store.schema import Axis
from qinit_store.work import open_work

LAKE = {"env_id": "FrozenLake-v1", "vary": ["success_rate=uniform:0.4,0.9"]}
POLE = {
    "env_id": "CartPole-v1",
    "vary": ["gravity=normal:9.8,2"],
    "bins": "1,3,4,3",
    "range": ["1=-2:2", "3=-2:2"],
    "goal": "survived",
}
SMALL: dict[str, dict[str, Any]] = {
    "gridworld": {"size": 5},
    "mountain-car": {"bins": 8, "noise": 0.002},
    "gym": LAKE,
    "windy-gridworld": {"size": 5},
    "mixture-gridworld": {"size": 5},
    "puddle-world": {"bins": "4", "radius": 0.2},
    "tasks": {"file": str(Path(__file__).parent / "environments" / "maps"), "use": "0:3"},
}
SOURCES, TARGETS, EPISODES = 3, 3, 30
DISTANT = {"drs"}  # methods that need a distance to the goal


SIMULATED = "gym, simulated"
# they learn as puddle-world does, in all but their step; compiling the loop takes half a minute for each
ALIKE = ("continuous-gridworld", "cart-pole", "acrobot")
CASES = (*(name for name in FAMILIES if name not in ALIKE), SIMULATED)


def small(name: str) -> Family:
    return FAMILIES["gym"](**POLE) if name == SIMULATED else FAMILIES[name](**SMALL.get(name, {})).opened()


def has_distance(name: str) -> bool:
    family = small(name)
    try:
        family.nearness(draw_tasks(family, 0, Stream.TARGET_TASK, np.arange(1)), 0.9, linear=False)
    except NotAllowed:
        return False
    return True


EVERY = [
    (family, method)
    for family in CASES
    for method in METHODS
    if method not in DISTANT or has_distance(family)
]


@pytest.fixture(scope="module")
def known() -> dict[str, FittedTables]:
    """A fit of a few short sources of each family."""
    fits = {}
    for name in CASES:
        family = small(name)
        learning = replace(family.source_learning, episodes=200, horizon=300)
        _, rows = learn_sources(SourceTasks(family, "q-learning", learning, 0), np.arange(SOURCES), Watch())
        blocks = [{"task": np.arange(SOURCES), **{key: rows[key] for key in ("q", "td_var", "eopl")}}]
        arrays = fit(blocks, Selection(np.ones(SOURCES, bool), 0, 0), FitOptions())
        fits[name] = FittedTables.from_arrays(arrays, math.prod(family.shape), "mle")
    return fits


def targets_of(name: str, seed: int = 1) -> TargetTasks:
    family = small(name)
    learning = replace(family.target_learning, episodes=EPISODES, horizon=200)
    return TargetTasks(family, learning, seed, keep_q=True, evaluate_every=10)


def transferred(name: str, method: Method, fit: FittedTables, seed: int = 1) -> tuple[Any, dict[str, Any]]:
    """What the method starts targets from, and the rows that they leave."""
    targets = targets_of(name, seed)
    shape = (TARGETS, math.prod(targets.family.shape), len(targets.family.actions))
    initial = method.initial(fit, targets.targets(TARGETS, np.full(shape, 0.5)))
    return initial, learn_targets(targets, initial, np.arange(TARGETS), Watch())[1]


@pytest.mark.parametrize(("family", "method"), EVERY)
def test_a_method_trains_and_its_seed_decides_all(
    family: str, method: str, known: dict[str, FittedTables]
) -> None:
    initial, rows = transferred(family, METHODS[method](), known[family])
    _, again = transferred(family, METHODS[method](), known[family])
    _, other = transferred(family, METHODS[method](), known[family], seed=2)
    assert rows["steps"].shape == (TARGETS, EPISODES)
    assert ((rows["steps"] >= 1) & (rows["steps"] <= 200)).all()
    for name in rows.keys() - {"seconds"}:
        np.testing.assert_array_equal(rows[name], again[name])
    drawn = small(family).available("target") is None
    changed = [column.name for column in small(family).parameters()] if drawn else ["steps"]
    assert any(not np.array_equal(rows[name], other[name]) for name in changed)
    assert ((initial.start >= 0) & (initial.start <= 1)).all()


@pytest.mark.parametrize(("family", "method"), EVERY)
def test_a_run_is_whole_in_its_file(
    family: str, method: str, known: dict[str, FittedTables], tmp_path: Path
) -> None:
    made = METHODS[method]()
    initial, rows = transferred(family, made, known[family])
    targets = targets_of(family)
    schema = run_schema(
        targets.family.axes(),
        Axis("action", np.array(targets.family.actions, "S")),
        targets.family.parameters(),
        EPISODES,
        start_per_task=initial.start_per_task,
        potential_per_task=initial.potential_per_task,
        exact_values=targets.family.tabular,
        evaluations=targets.evaluations,
        keep_q=True,
        hypotheses=initial.hypothesis_count,
        moments=targets.moments,
    )
    source = SourcesSettings.of(
        SourceTasks(targets.family, "q-learning", targets.family.source_learning, 0), SOURCES
    )
    fitted = FitSettings.of(source, "1" * 64, FitOptions())
    spec = RunSettings.of(made, targets, TARGETS, "0" * 64, fitted).spec()
    path = tmp_path / "run.h5"
    with open_work(path, schema, spec) as work:
        work.save(rows, np.arange(TARGETS))
        work.finish(range(TARGETS), statics(initial, targets.family))
    with open_artefact(path, "run") as artefact:
        assert artefact.spec["method"]["name"] == method
        for name, values in (rows | statics(initial, targets.family)).items():
            np.testing.assert_array_equal(artefact.read(name), values)


NEUTRAL: dict[str, dict[str, Any]] = {
    "ops-tl": {"library": 0},
    "posterior": {"library": 0},
}  # options at which a method adds nothing
ALWAYS_SHAPES = {"drs"}  # by a distance that no knowledge takes away


@pytest.mark.parametrize("family", CASES)
@pytest.mark.parametrize("method", [name for name in METHODS if name not in ALWAYS_SHAPES])
def test_knowing_nothing_a_method_is_zero(family: str, method: str, known: dict[str, FittedTables]) -> None:
    """From sources that are worth nothing every method starts, shapes and follows as plain learning does, bit for bit."""
    blank = known[family]
    tables = {name: np.zeros_like(getattr(blank, name)) for name in FittedTables.TABLES}
    tables |= {"mu": np.full_like(blank.mu, -np.inf), "n": np.full_like(blank.n, SOURCES)}
    nothing = replace(blank, **tables, value_mean=np.zeros_like(blank.value_mean))
    targets, made = targets_of(family), METHODS[method](**NEUTRAL.get(method, {}))
    shape = (TARGETS, *blank.mean.shape)
    initial = made.initial(nothing, targets.targets(TARGETS, np.zeros(shape)))
    _, rows = learn_targets(targets, initial, np.arange(TARGETS), Watch())
    _, plain = transferred(family, METHODS["zero"](), known[family])
    for name in plain.keys() - {"seconds"}:
        np.testing.assert_array_equal(rows[name], plain[name])


@pytest.mark.parametrize("init", initialisations())
@pytest.mark.parametrize(
    ("family", "method"), [(family, method) for family, method in EVERY if issubclass(METHODS[method], Plus)]
)
def test_every_initialisation_starts_every_plus(
    family: str, method: str, init: str, known: dict[str, FittedTables]
) -> None:
    initial, rows = transferred(family, METHODS[method](init=init), known[family])  # type: ignore[call-arg]
    start, _ = transferred(family, METHODS[init](), known[family])
    np.testing.assert_array_equal(initial.start, start.start)
    assert rows["steps"].shape == (TARGETS, EPISODES)


@pytest.mark.parametrize("family", [family for family in CASES if (family, "drs") not in EVERY])
def test_without_a_distance_drs_is_refused_in_a_sentence(family: str, known: dict[str, FittedTables]) -> None:
    with pytest.raises(NotAllowed, match=f"^{small(family).name} has no distance to its goal"):
        transferred(family, METHODS["drs"](), known[family])


@pytest.mark.parametrize("family", CASES)
def test_ops_tl_without_a_library_is_zero(family: str, known: dict[str, FittedTables]) -> None:
    _, plain = transferred(family, METHODS["zero"](), known[family])
    _, rows = transferred(family, METHODS["ops-tl"](library=0), known[family])  # type: ignore[call-arg]
    for name in plain.keys() - {"seconds"}:
        np.testing.assert_array_equal(rows[name], plain[name])


def test_the_readme_has_an_executed_example_of_every_family_and_method() -> None:
    readme = (Path(__file__).parents[1] / "README.md").read_text()
    executed = "\n".join(re.findall(r"^```sh\n(.*?)^```", readme, re.MULTILINE | re.DOTALL))
    words = set(re.findall(r"[\w-]+", executed))
    own = [name for registry in (FAMILIES, METHODS) for name in registry if registry.is_own(name)]
    assert [name for name in own if name not in words] == []
