"""What is asked of a stage, made into a way of learning: texts and instances alike, and what cannot go together refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import UsageError
from qinit_cli.fitted import FitOptions
from qinit_cli.learners import LEARNERS, QLearner
from qinit_cli.learners.exploration import Boltzmann, EpsilonGreedy, Ucb
from qinit_cli.learners.one_step import DoubleQ, Sarsa, Still
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learners.traces import QLambda, SarsaLambda
from qinit_cli.learning import Learning
from qinit_cli.methods import METHODS
from qinit_cli.pipeline.asked import CrossValidating, LearningSources, LearningTargets
from qinit_cli.pipeline.transfer import check_together, stem_of, targets_of
from qinit_cli.schedules import ByVisits, Exponential, Linear
from qinit_cli.tasks import SourceTasks

FAMILY = Gridworld()
SOURCES = replace(FAMILY.source_learning, alpha=0.3, gamma=0.9, horizon=70)


def of_sources(**asked: Any) -> Learning:
    return LearningSources(**asked).learning(Gridworld)


def of_targets(sources: Learning = SOURCES, **asked: Any) -> Learning:
    return LearningTargets(**asked).learning(FAMILY, sources)


def test_without_a_word_learning_is_as_the_family_has_it() -> None:
    assert of_sources() == FAMILY.source_learning
    assert of_targets() == replace(FAMILY.target_learning, alpha=0.3, gamma=0.9, horizon=70)
    assert CrossValidating().learning(FAMILY, SOURCES) == of_targets()


@pytest.mark.parametrize(
    ("text", "instance"),
    [
        ({"learner": "sarsa-lambda:lambda=0.8"}, {"learner": SarsaLambda(0.8)}),
        ({"explore": "boltzmann:temperature=0.2"}, {"explore": Boltzmann(0.2)}),
        ({"alpha": "linear:1:0.1:200"}, {"alpha": Linear(np.float64(1), 0.1, 200)}),
        ({"alpha": "visits:1"}, {"alpha": ByVisits(1)}),
        ({"epsilon": "exponential:0.5:0.99:0"}, {"epsilon": Exponential(0.5, 0.99, 0)}),
        ({"alpha": "0.25", "epsilon": "1"}, {"alpha": 0.25, "epsilon": 1}),
    ],
)
def test_a_text_asks_for_what_the_instance_asks_for(text: dict[str, Any], instance: dict[str, Any]) -> None:
    for learning in (of_sources, of_targets):
        assert learning(**text) == learning(**instance)
        assert str(learning(**text)) == str(learning(**instance))  # 1 and 1.0 are equal, and stored apart
        [name] = list(text)[:1]
        assert getattr(learning(**text), name) == instance[name]


@pytest.mark.parametrize("name", LEARNERS)
def test_a_learner_by_name_is_the_setting_that_its_instance_is(name: str) -> None:
    sources = SourcesSettings.of(SourceTasks(FAMILY, "exact", SOURCES, 0), 9)
    fit = FitSettings.of(sources, "0" * 64, FitOptions())
    specs, names = [], set()
    for learner in (name, LEARNERS[name]()):
        targets, count = targets_of(METHODS["mean"](), LearningTargets(learner=learner), sources)
        specs.append(RunSettings.of(METHODS["mean"](), targets, count, "0" * 64, fit).spec())
        names.add(stem_of(METHODS["mean"](), targets, count))
    assert specs[0] == specs[1]
    assert names == {f"gridworld-variance-7-mean-{'' if name == 'q-learning' else f'{name}-'}200-seed-0"}


def test_targets_inherit_a_schedule_and_not_the_learner() -> None:
    sources = replace(SOURCES, alpha=ByVisits(0.7), learner=Sarsa(), explore=Ucb())
    found = of_targets(sources)
    assert (found.alpha, found.learner, found.explore) == (ByVisits(0.7), QLearner(), EpsilonGreedy())


def test_epsilon_is_nought_where_it_means_nothing() -> None:
    usual = FAMILY.target_learning.epsilon
    assert usual > 0
    assert of_targets(explore="ucb").epsilon == 0
    assert of_targets(learner=RMax()).epsilon == of_targets(learner=DelayedQ()).epsilon == 0
    assert of_targets(learner="r-max", explore="epsilon-greedy").epsilon == usual
    assert of_targets(learner="r-max", epsilon=0.2).epsilon == 0.2
    assert of_targets(learner="sarsa").epsilon == usual


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"explore": "ucb:c=2", "epsilon": 0.1}, "--explore ucb:c=2.0 has no epsilon; leave out --epsilon"),
        ({"learner": "r-max", "alpha": 0.1}, "--learner r-max has no step size; leave out --alpha"),
        ({"learner": QLambda(0.5), "alpha": "visits:1"}, "--alpha is visits:1.0; q-lambda updates many state-actions"),
        ({"learner": "r-max", "gamma": 1.0}, "--gamma is 1; r-max plans with a gamma below 1"),
        ({"epsilon": "visits:1"}, "--epsilon is visits:1.0; visits:POWER is a schedule of alpha alone"),
        ({"alpha": "linear:0:1:9"}, "--alpha is linear:0.0:1.0:9; it must be above 0 and at most 1"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_refused_for_sources_and_for_targets(
    asked: dict[str, Any], sentence: str
) -> None:
    for learning in (of_sources, of_targets):
        with pytest.raises(UsageError, match=sentence):
            learning(**asked)


def test_traces_are_refused_where_the_sources_hand_down_a_step_size_by_visits() -> None:
    sources = replace(SOURCES, alpha=ByVisits(0.7))
    with pytest.raises(
        UsageError, match=r"the sources' alpha is visits:0\.7; sarsa-lambda .* give another --alpha"
    ):
        of_targets(sources, learner="sarsa-lambda")
    assert of_targets(sources, learner="sarsa-lambda", alpha=0.2).alpha == 0.2
    assert of_targets(sources, learner="r-max").learner == RMax()  # which has no step size


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"learner": "none"}, "--learner is none, which learns nothing"),
        ({"learner": "exakt"}, "--learner is 'exakt'; did you mean exact?"),
        ({"learner": "exact", "explore": "ucb"}, "the exact learner has no episodes, so --explore means nothing"),
        ({"learner": 5}, "--learner is 5; it must be a text or a Learner"),
        ({"explore": 5}, "--explore is 5; it must be a text or an Exploration or nothing"),
        ({"alpha": "fast"}, "--alpha 'fast' is no number, and no schedule: linear:FROM:TO:EPISODES, "),
        ({"alpha": "linear:1:x:3"}, "--alpha 'x' in 'linear:1:x:3' is no number"),
        ({"alpha": "2"}, "--alpha is 2.0; it must be above 0 and at most 1"),
    ],
)  # fmt: skip
def test_sources_that_cannot_be_asked_for_are_refused_in_a_sentence(
    asked: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        LearningSources(**asked)


@pytest.mark.parametrize(
    ("method", "learner", "sentence"),
    [
        ("posterior", DoubleQ(), "posterior changes its start .* --learner double-q .* q-learning, sarsa, expected-sarsa do"),
        ("posterior", Still(), "posterior changes its start"),
        ("ptrs", RMax(), "ptrs shapes rewards, from which --learner r-max does not learn"),
        ("drs", DelayedQ(), "drs shapes rewards"),
    ],
)  # fmt: skip
def test_a_learner_without_a_place_for_what_a_method_brings_is_refused(
    method: str, learner: Any, sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence):
        check_together(METHODS[method](), learner)


def test_start_tables_and_policies_go_with_every_learner() -> None:
    for method in ("zero", "mean", "logqinit-median", "ops-tl", "optimal"):
        check_together(METHODS[method](), RMax())
    check_together(METHODS["posterior"](), Sarsa())
    check_together(METHODS["ptrs"](), SarsaLambda())


def test_the_command_refuses_before_anything_is_written(
    here: Callable[..., Any], pipeline: Any, tmp_path: Any
) -> None:
    for words in (
        ("transfer", "posterior", pipeline.fit, "--learner", "q-lambda"),
        ("lifelong", "ptrs", pipeline.sources, "--learner", "r-max"),
        ("tune", "posterior", pipeline.sources, "--learner", "double-q"),
    ):
        ended = here(*words)
        assert ended.code == 2, words
        assert f"--learner {words[-1]}" in ended.err
    assert not list(tmp_path.iterdir())
