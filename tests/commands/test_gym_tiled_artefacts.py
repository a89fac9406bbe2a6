"""Environments by tiles from the command line: what is kept, what is refused, and what needs the environment no more."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from qinit_cli.artefacts.opening import family_in, open_artefact
from qinit_cli.environments import gym, gym_making, gym_spaces
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.seeding import Stream

RANGES = ("--range", "1=-2:2", "--range", "3=-2:2")
POLE = ("train-sources", "gym", "CartPole-v1", "--goal", "survived", "--horizon", 40)
SMALL = ("--tilings", 2, "--tiles", 3, "--probes", 32)
TILES = ("--representation", "tiles")


class Failing(gymnasium.Env):
    """Stays where it is; after 300 steps it raises, or observes what it is told to."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, then: float | None = None) -> None:
        self._then, self._left = then, 300  # more than a first look takes

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        return np.array([0.5]), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._left -= 1
        if self._left < 0 and self._then is None:
            raise RuntimeError("out of steps")
        return np.array([0.5 if self._left >= 0 else self._then]), 0.0, False, False, {}


@pytest.fixture
def failing() -> Iterator[str]:
    """The id of that environment."""
    gymnasium.register("Failing-v0", entry_point=Failing, disable_env_checker=True)
    yield "Failing-v0"
    del gymnasium.registry["Failing-v0"]


def test_what_is_kept_needs_no_environment_to_be_fitted_and_compared(
    here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    varied = ("--vary", "gravity=uniform:8,11", "--tasks", 3, "--episodes", 60, "-o", "poles.h5")
    made = here(*POLE, *RANGES, *TILES, *SMALL, *varied)
    assert (made.code, made.out) == (0, "poles.h5\n"), made.err
    run = ("--tasks", 2, "--episodes", 10, "-o")
    assert here("fit", "poles.h5", "-o", "fit.h5").code == 0
    for method in ("zero", "logqinit-median"):
        assert here("transfer", method, "fit.h5", *run, f"{method}.h5").code == 0
    with open_artefact(Path("poles.h5")) as sources:
        probes, lengths = sources.read("probes"), sources.read("eopl")
        q, weights, family = sources.read("q"), sources.read("weights"), family_in(sources)
    pole = gymnasium.make("CartPole-v1")
    starts = np.mean([pole.reset(seed=seed)[0].tolist() for seed in range(200)], axis=0)
    np.testing.assert_allclose(probes[0], starts, rtol=1e-12)
    assert len(probes) == 32
    assert (lengths == -1).all()  # the environment cannot be put into a state
    summed = weights[:, family.coding.active(probes)].sum(axis=2)
    np.testing.assert_allclose(q, summed, rtol=1e-12)

    def never(*asked: object) -> None:
        raise AssertionError(f"{asked} was made")

    gym_spaces.seen.cache_clear()
    monkeypatch.setattr(gym_making, "made", never)
    monkeypatch.setattr(gym, "made", never)
    again = here("fit", "poles.h5", "-o", "again.h5")
    assert again.code == 0, again.err
    assert Path("again.h5").exists()
    assert here("verify", "poles.h5", "fit.h5", "zero.h5").code == 0
    compared = here("compare", "zero.h5", "logqinit-median.h5", "--format", "csv")
    assert compared.code == 0, compared.err
    assert "tiles-2x3, 2 targets of seed 0, 10 episodes" in compared.out


def test_values_beyond_the_bounds_of_native_rewards_are_an_approximation(here: Callable[..., Any]) -> None:
    paid = ("--reward", "native", "--returns", "0:40", "--vary", "gravity=uniform:8,11", "--tasks", 3)
    made = here(*POLE, *RANGES, *TILES, *SMALL, *paid, "--episodes", 60, "-o", "paid.h5")
    assert made.code == 0, made.err
    with open_artefact(Path("paid.h5")) as sources:
        assert sources.read("q").min() < 0  # no return of a pole is
    assert here("fit", "paid.h5", "-o", "fit.h5").code == 0
    run = here("transfer", "logqinit-median", "fit.h5", "--tasks", 2, "--episodes", 10, "-o", "run.h5")
    assert run.code == 0, run.err
    with open_artefact(Path("run.h5")) as learned:
        # a step pays 1: an episode of n steps returns (1 - gamma^n) / (1 - gamma)
        expected = (1 - 0.99 ** learned.read("steps")) / (1 - 0.99)
        np.testing.assert_allclose(learned.read("return"), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (POLE, "give --range 1=LOW:HIGH --range 3=LOW:HIGH"),
        ((*POLE, *RANGES, "--bins", 4), "--bins is of a table, and --representation tiles has --tiles"),
        (("train-sources", "gym", "FrozenLake-v1"), "FrozenLake-v1 numbers its states, and --representation"),
        (
            ("train-sources", "gym", "Blackjack-v1", "--goal", "terminated"),
            "dimension 0 (0) of Blackjack-v1 is a whole number, and --representation tiles is of a Box alone",
        ),
        (("train-sources", "gym", "Acrobot-v1", "--goal", "terminated"), "tiles are for up to 4 dimensions"),
        ((*POLE, *RANGES, "--start", "anywhere"), "leave out --start anywhere"),
        ((*POLE, *RANGES, "--learner", "double-q"), "by tiles learn with q-learning"),
    ],
)
def test_what_cannot_be_tiled_is_refused_in_a_sentence(
    here: Callable[..., Any], asked: tuple[object, ...], words: str
) -> None:
    refused = here(*asked, *TILES)
    assert refused.code in (2, 4)
    assert refused.out == ""
    assert words in refused.err
    assert refused.err.count("\n") == 1


@pytest.mark.parametrize(
    ("varied", "words"),
    [
        (
            (),
            r"step\(.\) of Failing-v0 raised RuntimeError: out of steps; that is a fault of the environment",
        ),
        (
            ("--set", "then=nan"),
            r"the environment observed nan in dimension 0; its observations must be finite \(step\(.\) of",
        ),
    ],
)
def test_a_failing_environment_is_told(
    here: Callable[..., Any], failing: str, varied: tuple[str, ...], words: str
) -> None:
    learn = ("train-sources", "gym", failing, "--goal", "terminated", "--tasks", 1, "--episodes", 20)
    failed = here(*learn, *TILES, *SMALL, "-q", *varied)
    assert (failed.code, failed.out) == (4, "")
    assert re.search(words, failed.err)
    assert failed.err.count("\n") == 1


def test_greedy_episodes_of_weights_are_those_of_the_policy() -> None:
    """Push to where the pole leans, by weights of two tiles along its angle."""
    family: Any = TiledFamily(
        Gym("CartPole-v1", goal="survived", range=["1=-2:2", "3=-2:2"]), Tiles(1, 2, 16)
    )
    family = pickle.loads(pickle.dumps(family))
    leaning = np.arange(family.coding.weights) // 2 % 2
    weights = np.stack([1.0 - leaning, leaning], axis=-1)[None]
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(1))
    states = []
    for seed in range(3):
        pole = gymnasium.make("CartPole-v1").unwrapped
        observed, fallen = pole.reset(seed=seed)[0], False
        while not fallen:
            states.append(observed)
            observed, _, fallen, _, _ = pole.step(int(observed[2] >= 0))
    np.testing.assert_array_equal(family.visited(tasks, weights, 500, 3), states)
    assert not family.solved(tasks, weights, 500)[0]  # it falls after 40 steps or so
    assert family.solved(tasks, weights, 10)[0]
