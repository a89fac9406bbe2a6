"""Settings: every one counts, and what is read is what was written, of every family, method and kind."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import pytest

from qinit_cli.artefacts import settings
from qinit_cli.artefacts.settings import (
    FitSettings,
    RunSettings,
    SourceSet,
    SourcesSettings,
    StoredFamily,
    TuningSettings,
)
from qinit_cli.environments import FAMILIES
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.gym import Gym
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions
from qinit_cli.learners import LEARNERS
from qinit_cli.learners.exploration import EXPLORATIONS, Boltzmann
from qinit_cli.learners.traces import QLambda, SarsaLambda
from qinit_cli.learning import Learning
from qinit_cli.methods import METHODS
from qinit_cli.methods.logqinit_median import LogQInitMedian
from qinit_cli.schedules import ByVisits, Exponential, Linear
from qinit_cli.tasks import SourceTasks, TargetTasks

SOURCES = SourceTasks(Gridworld(), "q-learning", Gridworld.source_learning, 0)
HASH = "0" * 64
FITTED = FitSettings.of(SourcesSettings.of(SOURCES, 10), HASH, FitOptions())
TARGETS = TargetTasks(Gridworld(), Gridworld.target_learning, 0, False)


NEEDED: dict[str, dict[str, Any]] = {
    "gym": {"env_id": "FrozenLake-v1", "vary": ["success_rate=uniform:0.4,0.9"]},
    "tasks": {
        "file": "mdps.npz",
        "use": "0:3",
        "axes_": "row=3,col=4",
        "actions_": "left,right",
        "reward": "native",
        "sha256": HASH,
        "count": 6,
        "paid": (-1.0, 0.0, 0.0, 2.0),
        "targets": "3:6",
    },
}


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_survives_being_stored(name: str) -> None:
    family = FAMILIES[name](**NEEDED.get(name, {}))
    made = SourcesSettings.of(SourceTasks(family, "q-learning", family.source_learning, 0), 5)
    read = SourcesSettings.read(json.loads(json.dumps(made.spec())))
    assert read.family.installed() == family
    assert read.spec() == made.spec()


def test_a_family_nobody_knows_is_refused_by_name() -> None:
    with pytest.raises(NotAllowed, match="the family maze is not installed here; known are gridworld"):
        StoredFamily.read({"name": "maze"}).installed()


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
    assert SourcesSettings.of(other, 10).spec() != SourcesSettings.of(SOURCES, 10).spec()


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
    made, usual = (RunSettings.of(method, targets, 10, HASH, FITTED).spec() for targets in (other, TARGETS))
    assert made != usual


def test_a_runs_spec_tells_methods_their_options_and_fits_apart() -> None:
    made = [
        RunSettings.of(METHODS["zero"](), TARGETS, 10, "a", FITTED),
        RunSettings.of(LogQInitMedian(), TARGETS, 10, "a", FITTED),
        RunSettings.of(LogQInitMedian(fallback="largest"), TARGETS, 10, "a", FITTED),
        RunSettings.of(LogQInitMedian(), TARGETS, 10, "b", FITTED),
    ]
    assert len({json.dumps(one.spec(), sort_keys=True) for one in made}) == len(made)


def test_episodes_and_exploration_are_no_settings_of_exact_sources() -> None:
    one = replace(SOURCES, learner="exact")
    other = replace(one, learning=replace(one.learning, episodes=7, epsilon=0.9))
    assert SourcesSettings.of(one, 10) == SourcesSettings.of(other, 10)
    told = SourcesSettings.of(one, 10).spec()["learning"]
    assert set(told) == {"alpha", "gamma", "horizon"}


def test_a_fit_keeps_its_sources_settings_so_that_it_travels_alone() -> None:
    source = SourcesSettings.of(SOURCES, 10)
    spec = FitSettings.of(source, HASH, FitOptions(estimator="umvue", library=3)).spec()
    assert FitSettings.read(spec).sources == source
    assert (spec["inputs"], spec["estimator"], spec["library"]) == ([HASH], "umvue", 3)


def test_a_source_set_is_its_sources_however_they_are_fitted() -> None:
    again = FitSettings.of(SourcesSettings.of(SOURCES, 10), HASH, FitOptions(estimator="umvue"))
    shifted = SourcesSettings.of(replace(SOURCES, family=Gridworld(variance=3)), 10)
    first = SourceSet.of(FITTED).spec()
    assert SourceSet.of(again).spec() == first | {"estimator": "umvue"}
    other = SourceSet.of(FitSettings.of(shifted, "others", FitOptions())).spec()
    assert other == first | {"sources": "others", "family": other["family"]}
    assert other["family"]["variance"] == 3


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("method", METHODS)
def test_a_run_of_each_method_on_each_family_is_read_as_it_was_written(family: str, method: str) -> None:
    own = FAMILIES[family](**NEEDED.get(family, {}))
    sources = SourcesSettings.of(SourceTasks(own, "exact", own.source_learning, 3), 10)
    fit = FitSettings.of(sources, HASH, FitOptions(holdout=2))
    targets = TargetTasks(own, own.target_learning, 5, keep_q=True, evaluate_every=7)
    run = RunSettings.of(METHODS[method](), targets, 20, HASH, fit)
    for made in (fit, replace(run, method=replace(run.method, label="updated", min_visits=50))):
        read = type(made).read(json.loads(json.dumps(made.spec())))
        assert read.spec() == made.spec()
    assert RunSettings.read(run.spec()).method.installed().on(own) == METHODS[method]().on(own)


def test_a_tuning_is_read_as_it_was_written() -> None:
    sources = SourcesSettings.of(SOURCES, 10)
    made = TuningSettings.of(METHODS["ucoi"](), {"kappa": (1.0, 3.0)}, TARGETS, sources, HASH, 10)
    assert TuningSettings.read(json.loads(json.dumps(made.spec()))).spec() == made.spec()


def test_options_that_an_earlier_version_did_not_have_are_read_and_not_written() -> None:
    told = FITTED.spec()
    for name in ("eopl_normality", "exclude_unlearned"):
        del told[name]
    read = FitSettings.read(told)
    assert (read.options, read.spec()) == (FitOptions(), told)
    assert "exclude_unlearned" not in SourceSet.of(read).spec()


def test_a_plug_in_that_is_not_installed_keeps_its_settings() -> None:
    run = RunSettings.of(METHODS["zero"](), TARGETS, 10, HASH, FITTED).spec()
    run["family"] = {"name": "maze", "walls": 3}
    run["method"] = {"name": "hopeful", "label": "hopeful", "hope": 0.5}
    read = RunSettings.read(run)
    assert read.spec() == run
    assert (read.family.here, read.method.here, read.family.label) == (None, None, "maze walls=3")
    assert read.method.reads_sources  # for all that is known
    with pytest.raises(NotAllowed, match="the method hopeful is not installed here"):
        read.method.installed()


def test_packages_that_a_family_depends_on_stand_beside_the_settings_and_not_in_them() -> None:
    from importlib.metadata import version

    family = FAMILIES["gym"](**NEEDED["gym"])
    made = SourcesSettings.of(SourceTasks(family, "q-learning", family.source_learning, 0), 5)
    assert settings.plug_ins(made) == {"gymnasium": version("gymnasium")}
    modules = {"env_id": "quantecon:Anything-v0", "wrap": ["h5netcdf.core:File"]}
    foreign = SourcesSettings.of(SourceTasks(Gym(**modules), "q-learning", family.source_learning, 0), 5)
    assert settings.plug_ins(foreign) == {
        name: version(name) for name in ("gymnasium", "h5netcdf", "quantecon")
    }
    assert version("gymnasium") not in json.dumps(made.spec())
    assert settings.plug_ins(RunSettings.of(METHODS["zero"](), TARGETS, 10, HASH, FITTED)) == {}


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
    versions = {name: settings._algorithm(family) for name, family in FAMILIES.items()}
    assert versions.pop("gym") == 2
    assert set(versions.values()) == {settings.ALGORITHM} == {1}


LEARNED = [
    *(replace(SOURCES.learning, learner=kind()) for kind in LEARNERS.values() if kind.learns),
    *(replace(SOURCES.learning, explore=kind()) for kind in EXPLORATIONS.values()),
    replace(SOURCES.learning, learner=SarsaLambda(0.8, "accumulating", 0.01), explore=Boltzmann(0.2)),
    replace(SOURCES.learning, alpha=ByVisits(0.7), epsilon=Linear(1.0, 0.1, 50)),
    replace(SOURCES.learning, alpha=Exponential(0.5, 0.999, 0.01)),
]


@pytest.mark.parametrize("learning", LEARNED, ids=str)
def test_a_way_of_learning_survives_being_stored_in_every_kind(learning: Learning) -> None:
    sources = SourcesSettings.of(replace(SOURCES, learner=learning.learner.name, learning=learning), 10)
    fit = FitSettings.of(sources, HASH, FitOptions())
    run = RunSettings.of(LogQInitMedian(), replace(TARGETS, learning=learning), 10, HASH, fit)
    tuning = TuningSettings.of(METHODS["ucoi"](), {"kappa": (1.0,)}, TARGETS, sources, HASH, 10)
    for made in (sources, fit, run, tuning):
        read = type(made).read(json.loads(json.dumps(made.spec())))  # type: ignore[attr-defined]  # of each kind
        assert read == made
        assert read.spec() == made.spec()
    assert SourcesSettings.read(sources.spec()).learning == learning


def test_what_is_as_it_always_was_stands_in_no_settings() -> None:
    usual = {"alpha", "gamma", "epsilon", "episodes", "horizon", "start"}
    assert set(SourcesSettings.of(SOURCES, 10).spec()["learning"]) == usual
    other = replace(SOURCES.learning, learner=QLambda(), explore=Boltzmann(), alpha=Linear(0.5, 0.1, 50))
    told = settings.plain_learning(other)
    assert told["learner"] == {
        "name": "q-lambda",
        "lambda": 0.9,
        "traces": "replacing",
        "least": QLambda().least,
    }
    assert told["explore"] == {"name": "boltzmann", "temperature": 0.01}
    assert (told["alpha"], told["epsilon"]) == ("linear:0.5:0.1:50", 0.5)


@pytest.mark.parametrize(
    ("changes", "clause"),
    [
        ({"learner": {"name": "q-lambda", "lambda": 2}}, "q-lambda cannot be so: --lambda is 2"),
        ({"learner": {"name": "q-lambda", "lambda_": 0.5}}, "'lambda_' in q-lambda is no setting of this version"),
        ({"learner": {"name": "sarsa", "lambda": 0.5}}, "'lambda' in sarsa is no setting of this version"),
        ({"learner": {}}, "the learner lacks its name"),
        ({"learner": "sarsa"}, "the learner is 'sarsa', which are no settings"),
        ({"explore": {"name": "softly"}}, "the exploration is 'softly'; it is one of epsilon-greedy, "),
        ({"alpha": "0.1"}, "alpha is '0.1' in learning, no schedule"),
        ({"alpha": "linear:1:0:9"}, "alpha is 'linear:1:0:9' in learning, no schedule"),
        ({"alpha": "visits:2.0"}, "takes a power above 0 and at most 1"),
        ({"epsilon": "visits:1.0"}, "learning cannot be so: epsilon is visits:1.0"),
        ({"learner": {"name": "sarsa"}}, "the learner is 'q-learning', and learning is by sarsa"),
    ],
)  # fmt: skip
def test_a_way_of_learning_that_cannot_be_is_refused_in_one_clause(
    changes: dict[str, Any], clause: str
) -> None:
    told = SourcesSettings.of(SOURCES, 10).spec()
    told["learning"] |= changes
    with pytest.raises(ValueError, match=re.escape(clause)):
        SourcesSettings.read(told)


def test_a_learner_that_is_not_installed_keeps_its_settings_and_learns_nothing() -> None:
    told = RunSettings.of(METHODS["zero"](), TARGETS, 10, HASH, FITTED).spec()
    told["learning"]["learner"] = {"name": "speedy", "speed": 3}
    read = RunSettings.read(json.loads(json.dumps(told)))
    assert read.spec() == told
    assert str(read.learning.learner) == "speedy:speed=3"
    with pytest.raises(NotAllowed, match="the learner speedy is not installed here; known are q-learning, "):
        read.learning.learner.kernel(read.learning, None)
