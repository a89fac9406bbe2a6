from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from qinit_cli.artefacts import specs
from qinit_cli.environments import FAMILIES, family_of
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.gym import Gym
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import METHODS
from qinit_cli.methods.logqinit_median import LogQInitMedian
from qinit_cli.tasks import SourceTasks, TargetTasks

SOURCES = SourceTasks(Gridworld(), "q-learning", Gridworld.source_learning, 0)
FITTED = specs.fit(specs.sources(SOURCES, 10), ["sources"], FitOptions())
TARGETS = TargetTasks(Gridworld(), Gridworld.target_learning, 0, False)


NEEDED = {"gym": {"env_id": "FrozenLake-v1", "vary": ["success_rate=uniform:0.4,0.9"]}}


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_survives_being_stored(name: str) -> None:
    family = FAMILIES[name](**NEEDED.get(name, {}))
    spec = specs.sources(SourceTasks(family, "q-learning", family.source_learning, 0), 5)
    assert family_of(json.loads(json.dumps(spec))) == family


def test_a_family_nobody_knows_is_refused_by_name() -> None:
    with pytest.raises(NotAllowed, match="the family maze is not installed here; known are gridworld"):
        family_of({"family": {"name": "maze"}})


@pytest.mark.parametrize(
    "other",
    [
        replace(SOURCES, family=Gridworld(variance=3)),
        replace(SOURCES, family=Gridworld(p_low=0.7)),
        replace(SOURCES, learning=replace(SOURCES.learning, alpha=0.2)),
        replace(SOURCES, learning=replace(SOURCES.learning, start="fixed")),
        replace(SOURCES, learner="exact"),
        replace(SOURCES, seed=1),
    ],
)
def test_every_setting_of_sources_is_in_their_spec(other: SourceTasks) -> None:
    assert specs.sources(other, 10) != specs.sources(SOURCES, 10)


@pytest.mark.parametrize(
    "other",
    [
        replace(TARGETS, family=Gridworld(goals="uniform")),
        replace(TARGETS, learning=replace(TARGETS.learning, epsilon=0.2)),
        replace(TARGETS, seed=1),
        replace(TARGETS, keep_q=True),
    ],
)
def test_every_setting_of_targets_is_in_a_runs_spec(other: TargetTasks) -> None:
    method = LogQInitMedian()
    assert specs.run(method, other, 10, "hash", FITTED) != specs.run(method, TARGETS, 10, "hash", FITTED)


def test_a_runs_spec_tells_methods_their_options_and_fits_apart() -> None:
    made = [
        specs.run(METHODS["zero"](), TARGETS, 10, "a", FITTED),
        specs.run(LogQInitMedian(), TARGETS, 10, "a", FITTED),
        specs.run(LogQInitMedian(fallback="largest"), TARGETS, 10, "a", FITTED),
        specs.run(LogQInitMedian(), TARGETS, 10, "b", FITTED),
    ]
    assert len({json.dumps(spec, sort_keys=True) for spec in made}) == len(made)


def test_episodes_and_exploration_are_no_settings_of_exact_sources() -> None:
    one = replace(SOURCES, learner="exact")
    other = replace(one, learning=replace(one.learning, episodes=7, epsilon=0.9))
    assert specs.sources(one, 10) == specs.sources(other, 10)


def test_a_fit_keeps_its_sources_settings_so_that_it_travels_alone() -> None:
    source = specs.sources(SOURCES, 10)
    spec = specs.fit(source, ["hash"], FitOptions(estimator="umvue", library=3))
    assert family_of(spec["sources"]) == SOURCES.family
    assert spec["sources"]["learning"] == source["learning"]
    assert (spec["inputs"], spec["estimator"], spec["library"]) == (["hash"], "umvue", 3)


def test_a_source_set_is_its_sources_however_they_are_fitted() -> None:
    again = specs.fit(specs.sources(SOURCES, 10), ["sources"], FitOptions(estimator="umvue"))
    other = specs.fit(
        specs.sources(replace(SOURCES, family=Gridworld(variance=3)), 10), ["others"], FitOptions()
    )
    first = specs.source_set(FITTED)
    assert specs.source_set(again) == first | {"estimator": "umvue"}
    assert specs.source_set(other) == first | {
        "sources": "others",
        "family": specs.source_set(other)["family"],
    }
    assert specs.source_set(other)["family"]["variance"] == 3


def test_packages_that_a_family_depends_on_stand_beside_the_settings_and_not_in_them() -> None:
    from importlib.metadata import version

    family = FAMILIES["gym"](**NEEDED["gym"])
    spec = specs.sources(SourceTasks(family, "q-learning", family.source_learning, 0), 5)
    assert specs.plug_ins(spec) == {"gymnasium": version("gymnasium")}
    assert version("gymnasium") not in json.dumps(spec)
    assert specs.plug_ins({"family": {"name": "gridworld"}, "method": {"name": "zero"}}) == {}


def test_gymnasium_tasks_of_an_earlier_version_are_learned_anew_and_told(
    here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("train-sources", "gym", "FrozenLake-v1", "--vary", "success_rate=uniform:0.4,0.9", "--tasks", 3,
             "--learner", "exact")  # fmt: skip
    with monkeypatch.context() as earlier:
        earlier.setattr(Gym, "algorithm", 1)
        old = here(*words)
        assert "warning" not in old.err
        here("fit", old.out.strip(), "-o", "old-fit.h5")
    for read in (("show", old.out.strip()), ("fit", old.out.strip(), "-o", "fit.h5"), ("show", "old-fit.h5"),
                 ("transfer", "mean", "old-fit.h5", "--tasks", 2, "--episodes", 5)):  # fmt: skip
        ended = here(*read)
        assert ended.code == 0, ended.err
        assert "learned by an earlier version: its wrappers were left out" in " ".join(ended.err.split())
    new = here(*words)
    assert new.out != old.out
    assert "3 tasks learned" in new.err
    assert "earlier version" not in here("fit", new.out.strip(), "-o", "new-fit.h5").err


def test_families_but_gymnasium_have_the_version_of_all() -> None:
    versions = {name: specs._algorithm(family) for name, family in FAMILIES.items()}
    assert versions.pop("gym") == 2
    assert set(versions.values()) == {specs.ALGORITHM} == {1}
