"""Sources, fits and starts by tiles: what is kept at probes, what becomes of a start, and what is refused."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import qinit_cli as qinit
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.errors import NotAllowed, QinitError, TasksFailed, UsageError
from qinit_cli.projection import Projection

CAR = MountainCar(noise=0.005)
BY_TILES: dict[str, Any] = {
    "representation": "tiles",
    "tilings": 4,
    "tiles": 4,
    "probes": 256,
    "episodes": 400,
    "horizon": 300,
}


@pytest.fixture(scope="module")
def sources() -> qinit.Sources:
    return qinit.train_sources(CAR, tasks=5, **BY_TILES)


@pytest.fixture(scope="module")
def fit(sources: qinit.Sources) -> qinit.Fit:
    return qinit.fit(sources)


@pytest.fixture(scope="module")
def hardly_learned() -> qinit.Sources:
    """Values of 0 where nothing was learned yet."""
    return qinit.train_sources(CAR, tasks=5, **BY_TILES | {"episodes": 5})


@pytest.fixture(scope="module")
def projection(sources: qinit.Sources) -> Projection:
    return Projection(TiledFamily(CAR, Tiles(4, 4, 256)).coding, sources["probes"])


def test_probes_are_the_start_states_on_greedy_paths_and_a_spread_whatever_the_seed(
    sources: qinit.Sources,
) -> None:
    probes = sources["probes"]
    assert probes.shape == (256, 2)
    assert probes[0].tolist() == [-0.5, 0.0]
    other = qinit.train_sources(CAR, tasks=2, seed=8, **BY_TILES)
    np.testing.assert_array_equal(other["probes"], probes)
    # the second half is spread evenly: a quarter of it in each quarter of the box
    left, slow = probes[129:, 0] < -0.3, probes[129:, 1] < 0
    for quarter in (left & slow, left & ~slow, ~left & slow, ~left & ~slow):
        assert 28 <= quarter.sum() <= 36
    # paths end at the flag
    assert (probes[:129, 0] >= 0.5).any()


def test_values_at_probes_are_those_of_the_weights(sources: qinit.Sources, projection: Projection) -> None:
    np.testing.assert_allclose(sources["q"], [projection.features @ each for each in sources["weights"]])
    assert {"visits", "td_var"}.isdisjoint(sources.arrays)


def test_whatever_is_learned_at_once_the_content_is_the_same(sources: qinit.Sources) -> None:
    assert qinit.train_sources(CAR, tasks=5, jobs=1, **BY_TILES).digest == sources.digest


def test_a_fit_is_of_the_values_at_each_probe(hardly_learned: qinit.Sources) -> None:
    q, fit = hardly_learned["q"], qinit.fit(hardly_learned)
    positive = q > 0
    assert (~positive).any()  # of which there is no logarithm
    np.testing.assert_array_equal(fit["n_masked"], (~positive).sum(axis=0))
    logs = np.log(np.where(positive, q, 1.0))
    known = positive.any(axis=0)
    mean_log = logs.sum(axis=0)[known] / positive.sum(axis=0)[known]
    np.testing.assert_allclose(fit["mu"][known], mean_log)
    np.testing.assert_allclose(fit.start("logqinit-median")[known], np.clip(np.exp(mean_log), 0, 1))
    np.testing.assert_allclose(fit["mean"], q.mean(axis=0), atol=1e-12)  # no estimate is left out


def test_the_weights_of_a_mean_have_the_values_of_the_mean_of_the_weights(
    sources: qinit.Sources, fit: qinit.Fit, projection: Projection
) -> None:
    mean = projection.weights(fit["mean"])
    error = np.abs(projection.values(mean) - projection.values(sources["weights"].mean(axis=0)))
    assert error.max() <= 1e-9


@pytest.mark.parametrize(
    "method", ["zero", "mean", "maxqinit", "ucoi", "logqinit-quantile", "ptrs", "ops-tl"]
)
def test_methods_run(fit: qinit.Fit, method: str, projection: Projection) -> None:
    run = qinit.transfer(method, fit, tasks=2, episodes=5, horizon=50)
    assert run["steps"].shape == (2, 5)
    np.testing.assert_array_equal(run["probes"], fit["probes"])
    np.testing.assert_allclose(run["projected"], projection.features @ run["start_weights"])
    assert np.abs(run["projected"] - run["start"]).max() < 0.5


def test_optimal_learns_the_targets_own_weights(fit: qinit.Fit) -> None:
    run = qinit.transfer("optimal", fit, tasks=2, episodes=3, horizon=50)
    assert run["start"].shape == (2, 256, 3)
    assert "start_weights" not in run.arrays


@pytest.mark.parametrize(
    ("method", "told"), [("posterior", "weights that many states share"), ("drs", "distances of tables")]
)
def test_methods_of_tables_are_refused(fit: qinit.Fit, method: str, told: str) -> None:
    with pytest.raises(NotAllowed, match=told):
        qinit.transfer(method, fit, tasks=2, episodes=3)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"learner": "delayed-q"}, "--learner delayed-q.* by tiles learn with q-learning"),
        ({"learner": "exact"}, "no exact tables"),
        ({"explore": "ucb"}, "--explore ucb"),
        ({"alpha": "visits:0.6"}, "--alpha visits:0.6"),
    ],
)
def test_learning_that_counts_by_state_is_refused(given: dict[str, Any], told: str) -> None:
    settings = {name: value for name, value in BY_TILES.items() if name not in ("episodes", *given)}
    with pytest.raises(UsageError, match=told):
        qinit.train_sources(CAR, tasks=2, **settings, **given)


def test_a_lifetime_that_adds_entries_is_refused(fit: qinit.Fit) -> None:
    with pytest.raises(NotAllowed, match="values by tiles have none; leave --update out"):
        qinit.lifelong("mean", fit, tasks=2, episodes=3, update=True)


def test_parameters_are_chosen_by_sources_in_the_place_of_targets() -> None:
    several = qinit.train_sources(CAR, tasks=10, **BY_TILES)
    tuning = qinit.tune("ops-tl", several, grid={"nu": [0.9, 1.0]}, episodes=3)
    assert tuning["average"].shape == (10, 3)
    with pytest.raises(NotAllowed, match="weights that many states share"):
        qinit.tune("posterior", several, episodes=3)


def test_families_of_tables_and_options_without_tiles_are_refused() -> None:
    with pytest.raises(UsageError, match="gridworld has no continuous states"):
        qinit.train_sources(Gridworld(), tasks=2, representation="tiles")
    with pytest.raises(QinitError, match="--tilings is of --representation tiles"):
        qinit.train_sources(CAR, tasks=2, tilings=4)


def test_learning_that_diverges_fails_its_tasks() -> None:
    """Accumulating traces that never fall, at a step size of 1."""
    settings = BY_TILES | {"learner": "sarsa-lambda:lambda=1,traces=accumulating", "alpha": 1.0, "gamma": 1.0}
    with pytest.raises(TasksFailed, match="learning diverged"):
        qinit.train_sources(CAR, tasks=2, **settings)


def test_a_tiled_family_travels() -> None:
    family = TiledFamily(CAR, Tiles()).placed(np.zeros((4096, 2)))
    again = pickle.loads(pickle.dumps(family))
    assert again == family
    np.testing.assert_array_equal(again.at, family.at)
