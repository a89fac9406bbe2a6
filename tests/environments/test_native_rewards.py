"""Rewards of the environments themselves: exact tables by quantecon, returns by gymnasium's own steps, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from quantecon.markov import DiscreteDP

import qinit_cli as qinit
from qinit_cli.artefacts.long_tables import fields
from qinit_cli.artefacts.long_tables import rows as rows_of
from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.environments.bases import TableFamily
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.gym_episodes import Episodes
from qinit_cli.errors import NotAllowed, TasksFailed, UsageError
from qinit_cli.kernels.batch import LaneStreams, Learned, Records, Start, learn
from qinit_cli.kernels.random_streams import lane_seeds, seeds
from qinit_cli.learning import Learning
from qinit_cli.pipeline.asked import LearningTargets
from qinit_cli.pipeline.sources import check_learned
from qinit_cli.schedules import ByVisits
from qinit_cli.seeding import Stream
from qinit_cli.watch import Watch

GAMMA = 0.9
POLE = Gym(env_id="CartPole-v1", bins="1,1,3,3", range=["1=-2:2", "3=-2:2"], goal="terminated")


class Cards(gymnasium.Env[int, int]):
    """Ends in state 3 with -1, 0, 1 or 1.5, as in Blackjack, two of them from one state; 0 on the way."""

    observation_space = gymnasium.spaces.Discrete(4)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self) -> None:
        ways: Any = {
            0: {
                0: [(0.5, 1, 0.0, False), (0.5, 2, 0.0, False)],
                1: [(0.6, 3, -1.0, True), (0.4, 3, 1.5, True)],
            },
            1: {
                0: [(0.7, 2, 0.0, False), (0.3, 3, -1.0, True)],
                1: [(0.5, 3, 0.0, True), (0.5, 3, 1.0, True)],
            },
            2: {0: [(1.0, 3, -1.0, True)], 1: [(0.8, 3, 1.0, True), (0.2, 3, -1.0, True)]},
            3: {action: [(1.0, 3, 0.0, True)] for action in (0, 1)},
        }
        self.P, self.initial_state_distrib = ways, np.array([1.0, 0, 0, 0])

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.state = 0
        return self.state, {}

    def step(self, action: int) -> Any:
        ways = self.P[self.state][int(action)]
        _, self.state, reward, end = ways[self.np_random.choice(len(ways), p=[way[0] for way in ways])]
        return self.state, reward, end, False, {}


@pytest.fixture(autouse=True)
def cards() -> Iterator[None]:
    """Registered."""
    gymnasium.register("Cards-v0", entry_point=Cards, disable_env_checker=True)
    yield
    del gymnasium.registry["Cards-v0"]


def tasks_of(family: Gym) -> np.ndarray:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(1))


def by_quantecon(env_id: str) -> np.ndarray:
    """Q* (S, A) of gymnasium's own table, one more state holding those that have ended."""
    env: Any = gymnasium.make(env_id).unwrapped
    states, actions = int(env.observation_space.n), int(env.action_space.n)
    flows, rewards = np.zeros((states + 1, actions, states + 1)), np.zeros((states + 1, actions))
    for state in range(states):
        for action in range(actions):
            for odds, there, paid, done in env.P[state][action]:
                flows[state, action, states if done else there] += odds
                rewards[state, action] += odds * paid
    flows[states, :, states] = 1
    problem = DiscreteDP(rewards, flows, GAMMA)
    value = problem.solve(method="policy_iteration").v
    found: np.ndarray = (rewards + GAMMA * flows @ value)[:states]
    return found


@pytest.mark.parametrize("env_id", ["Taxi-v4", "CliffWalking-v1", "FrozenLake-v1", "Cards-v0"])
def test_quantecon_finds_the_same_values_with_the_environments_own_rewards(env_id: str) -> None:
    family = Gym(env_id=env_id, reward="native")
    tasks = tasks_of(family)
    assert family.tabular
    q, _ = family.solve(tasks, GAMMA)
    open = family.tables(tasks).open[0]
    np.testing.assert_allclose(q[0][open], by_quantecon(env_id)[open], rtol=0, atol=1e-9)


def learned(family: Gym, learning: Learning) -> Learned:
    """What one task learns, each episode kept."""
    own = [np.random.SeedSequence(1)]
    worlds = family.worlds(tasks_of(family), own)
    return learn(
        worlds,
        learning,
        Start(np.zeros((worlds.states, worlds.actions))),
        LaneStreams(rng=lane_seeds(own), starts=seeds(own)),
        Records(learning.episodes, visits=True, td_var=False),
        Watch(),
        payment=family.payment(learning.gamma),
    )


@pytest.mark.parametrize(("env_id", "tolerance"), [("CliffWalking-v1", 0.05), ("Cards-v0", 0.1)])
def test_what_is_learned_comes_close_to_quantecons_values(env_id: str, tolerance: float) -> None:
    learning = Learning(
        alpha=ByVisits(0.7), gamma=GAMMA, epsilon=1.0, episodes=50_000, horizon=20, start="anywhere"
    )
    family = Gym(env_id=env_id, reward="native")
    q, wanted = learned(family, learning).q[0], by_quantecon(env_id)
    open = family.tables(tasks_of(family)).open[0]
    np.testing.assert_allclose(q[open], wanted[open], rtol=0, atol=tolerance * np.abs(wanted[open]).max())


def test_an_episode_of_a_pole_returns_a_discounted_one_for_each_step() -> None:
    family = Gym(**{**vars(POLE), "reward": "native", "returns": "0:10"})
    learning = Learning(alpha=0.1, gamma=GAMMA, epsilon=0.5, episodes=30, horizon=25, start="fixed")
    found = learned(family, learning)
    assert found.returns is not None
    np.testing.assert_allclose(found.returns, (1 - GAMMA**found.steps) / (1 - GAMMA), rtol=1e-12)
    assert found.steps.max() == 25


def test_values_beyond_the_bounds_given_are_refused() -> None:
    family = Gym(**{**vars(POLE), "reward": "native", "returns": "0:2"})
    with pytest.raises(TasksFailed, match="failed"):
        qinit.train_sources(family, tasks=1, episodes=20, horizon=25, gamma=GAMMA)


def test_hands_are_dealt_learned_and_compared_by_what_they_pay(tmp_path: Path) -> None:
    family = Gym(env_id="Cards-v0", reward="native")
    fit = qinit.fit(qinit.train_sources(family, tasks=3, learner="exact", gamma=GAMMA))
    best = by_quantecon("Cards-v0").max(axis=1)
    np.testing.assert_allclose(fit.start("mean")[:3].max(axis=1), best[:3], rtol=0, atol=1e-9)
    runs = [
        qinit.transfer(
            name, fit, tasks=4, episodes=60, epsilon=0.5, evaluate_every=30, output=tmp_path / f"{name}.h5"
        )
        for name in ("zero", "optimal")
    ]
    paid = np.array([-1.0, 0.0, 1.0, 1.5])
    for run in runs:
        ends = run["return"] / GAMMA ** (run["steps"] - 1.0)  # nothing is paid on the way
        assert np.isclose(ends[..., None], paid, rtol=0, atol=1e-12).any(axis=2).all()
        assert len(np.unique(np.round(ends, 9))) >= 3
        np.testing.assert_array_equal(run.returns(), run["return"])
        np.testing.assert_array_equal(run["reached"], np.isclose(ends, 1.5))  # the ends that pay best
        np.testing.assert_allclose(run["v_star"], best[0], rtol=0, atol=1e-9)
        assert (run["v_eps"] < run["v_star"]).all()
        assert np.isin(np.round(run["eval_return"] / GAMMA ** (run["eval_steps"] - 1.0), 9), paid).all()
    rows = {row["method"]: row["return"] for row in qinit.compare(runs).rows}
    assert rows["optimal"] == pytest.approx(runs[1]["return"].mean(), abs=1e-12)
    with open_artefact(tmp_path / "zero.h5", "run") as artefact:
        names = [field.name for field in fields(artefact, "episodes")]
        [table] = rows_of(artefact, "episodes")
    assert names.count("return") == 1
    np.testing.assert_array_equal(table["return"], runs[0]["return"].ravel())


def test_a_cost_of_each_step_is_an_affine_image_of_the_goals_values() -> None:
    goal, step = Gym(env_id="FrozenLake-v1"), Gym(env_id="FrozenLake-v1", reward="step")
    (plain, _), (costs, _) = (family.solve(tasks_of(family), GAMMA) for family in (goal, step))
    open = goal.tables(tasks_of(goal)).open
    np.testing.assert_allclose(costs[open], (GAMMA * plain[open] - 1) / (1 - GAMMA), rtol=0, atol=1e-12)


@pytest.mark.parametrize("reward", ["nan", "inf", None])
def test_a_reward_that_is_no_finite_number_is_refused(reward: Any) -> None:
    class Paying:
        def step(self, action: int) -> Any:
            return 0, None if reward is None else float(reward), False, False, {}

    episodes = Episodes("Paying-v0", Paying(), int, "terminated", 5, native=True)
    with pytest.raises(NotAllowed, match="which is no finite number"):
        episodes.step(0)


def test_bounds_of_returns_must_be_given_where_there_is_no_table() -> None:
    family = Gym(**{**vars(POLE), "reward": "native"})
    with pytest.raises(UsageError, match="no table to take the bounds of returns from; give --returns LOW"):
        check_learned(family, Gym.source_learning)


@pytest.mark.parametrize("returns", ["1", "3:2", "1:2", "0:0", "nan:1", "0:inf", "a:b", ""])
def test_bounds_that_are_none_are_refused(returns: str) -> None:
    with pytest.raises(ValueError, match="must be LOW:HIGH with 0 within them"):
        Gym(env_id="CartPole-v1", reward="native", returns=returns)


def test_bounds_are_refused_without_rewards_to_bound() -> None:
    with pytest.raises(ValueError, match="--returns is given with --reward goal"):
        Gym(env_id="CartPole-v1", returns="0:1")


def test_rewards_cannot_be_shifted() -> None:
    with pytest.raises(UsageError, match="--shift reward: what sources learned is in the units"):
        LearningTargets(shift=["reward=step"]).family(Gym(env_id="FrozenLake-v1"))


def test_a_family_with_rewards_of_its_own_must_tell_their_bounds() -> None:
    class Plain(TableFamily):
        name = "plain"
        reward = "native"

        def __post_init__(self) -> None: ...

    with pytest.raises(ValueError, match="plain gives native rewards and no bounds of their returns"):
        Plain().payment(GAMMA)
