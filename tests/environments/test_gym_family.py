"""Gymnasium environments as families: their tables, their goals, and what is refused."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
import quantecon

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.gym_making import made as made_by_gymnasium
from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learning import Learning
from qinit_cli.seeding import Stream

LAKE = Gym(env_id="FrozenLake-v1", vary=["success_rate=uniform:0.4,0.9"])
POLE = Gym(
    env_id="CartPole-v1",
    vary=["gravity=normal:9.8,2", "force_mag=uniform:7,13"],
    bins="1,3,4,3",
    range=["1=-2:2", "3=-2:2"],
    goal="survived",
)
LEARNING = Learning(alpha=0.1, gamma=0.95, epsilon=0.3, episodes=60, horizon=30, start="fixed")


def tasks_of(family: Gym, count: int) -> np.ndarray:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count))


def made(env_id: str, **arguments: Any) -> Any:
    return gymnasium.make(env_id, **arguments).unwrapped


@pytest.mark.parametrize(
    ("family", "reward"),
    [
        (Gym(env_id="FrozenLake-v1", set=["map_name=8x8"]), 1.0),
        (Gym(env_id="Taxi-v4"), 20.0),
        (Gym(env_id="CliffWalking-v1", set=["is_slippery=True"]), -1.0),
    ],
    ids=lambda each: getattr(each, "env_id", ""),
)
def test_quantecon_finds_the_same_values_in_gymnasiums_own_transitions(family: Gym, reward: float) -> None:
    arguments = dict(family._settings)
    env = made(family.env_id, **arguments)
    states, actions, gamma = int(env.observation_space.n), int(env.action_space.n), 0.9
    flows, rewards = np.zeros((states + 1, actions, states + 1)), np.zeros((states + 1, actions))
    ends = set()
    for state, of in env.P.items():
        for action, outcomes in of.items():
            for odds, there, paid, done in outcomes:
                flows[state, action, states if done else there] += odds
                rewards[state, action] += odds * (done and paid == reward)
                ends |= {int(there)} if done else set()
    flows[states, :, states] = 1
    value = quantecon.markov.DiscreteDP(rewards, flows, gamma).solve(method="policy_iteration").v
    q, _ = family.solve(tasks_of(family, 1), gamma)
    tables = family.tables(tasks_of(family, 1))
    acted = tables.open[0]
    assert set(np.flatnonzero(~acted)) <= ends
    np.testing.assert_allclose(q[0].max(axis=1)[acted], value[:states][acted], atol=1e-9)
    assert (q[0][~acted] == 0).all()


def test_a_greedy_policy_arrives_as_often_in_gymnasium_as_its_table_says() -> None:
    tasks = tasks_of(LAKE, 1)
    q, _ = LAKE.solve(tasks, 0.99)
    tables, share = LAKE.tables(tasks), np.empty(1)
    from qinit_cli.kernels import tables_exact

    tables_exact.arrival(tables.after, tables.probability, tables.start, q, 100, share)
    env = made("FrozenLake-v1", success_rate=float(tasks["success_rate"][0]))
    arrived = 0
    for seed in range(400):
        state, ended, paid, steps = env.reset(seed=seed)[0], False, 0.0, 0
        while not ended and steps < 100:
            state, paid, ended, _, _ = env.step(int(q[0, state].argmax()))
            steps += 1
        arrived += paid > 0
    assert arrived / 400 == pytest.approx(share[0], abs=4 * np.sqrt(share[0] * (1 - share[0]) / 400) + 1e-9)


def test_a_map_is_drawn_by_its_seed_and_varies() -> None:
    family = Gym(env_id="FrozenLake-v1", vary=["desc=map:5,0.8"])
    tasks = tasks_of(family, 4)
    assert family.parameters()[0].dtype == "<i8"
    assert family.shape == (5, 5)
    q, _ = family.solve(tasks, 0.9)
    assert len({table.tobytes() for table in q}) == 4
    assert (family.start_value(q) > 0).all()


def test_grids_have_rows_and_columns_and_the_rest_numbers() -> None:
    assert [axis.name for axis in LAKE.axes()] == ["row", "col"]
    assert Gym(env_id="CliffWalking-v1").shape == (4, 12)
    assert Gym(env_id="Taxi-v4").shape == (500,)
    assert POLE.shape == (1, 3, 4, 3)
    assert LAKE.shown_states()[0] == (0.0, 0.0)
    assert all(len(state) == 4 for state in POLE.shown_states())


def test_paths_of_a_simulated_task_are_those_of_its_greedy_episodes() -> None:
    tasks = tasks_of(POLE, 1)
    q = np.zeros((1, 36, 2))
    assert not POLE.solved(tasks, q, 200).any()
    assert (POLE.path_lengths(tasks, q, 200) == -1).all()
    short = POLE.path_lengths(tasks, q, 2)  # two steps are survived by anything
    assert POLE.solved(tasks, q, 2).all()
    assert short.max() == 2
    assert short[0, :, 1].max() == -1


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"env_id": "CartPoleX-v1"}, "gymnasium cannot make CartPoleX-v1"),
        (
            {"env_id": "CartPole-v1"},
            "sets no bounds to dimensions 1 and 3 of what it observes; give --range 1=LOW:HIGH --range 3=LOW:HIGH",
        ),
        (
            {"env_id": "CartPole-v1", "range": ["3=-2:2"]},
            "no bounds to dimension 1 of what it observes; give --range 1=LOW:HIGH",
        ),
        ({"env_id": "CartPole-v1", "range": ["9=0:1"]}, "DIM from 0 to 3"),
        ({"env_id": "CartPole-v1", "range": ["1=-2:2", "3=-2:2"], "bins": "3,3"}, "has 4 dimensions"),
        ({"env_id": "FrozenLake-v1", "bins": "4"}, "numbers its states; leave out --bins and --range"),
        ({"env_id": "FrozenLake-v1", "vary": ["wind=normal:0,1"]}, "has no wind: its constructor takes"),
        ({"env_id": "FrozenLake-v1", "set": ["nrow=3"]}, "has made its transitions by the time that nrow"),
        ({"env_id": "FrozenLake-v1", "set": ["map_name=9x9"]}, "cannot make FrozenLake-v1: KeyError: '9x9'"),
        (
            {"env_id": "FrozenLake-v1", "vary": ["is_slippery=uniform:0,1"]},
            "is_slippery of FrozenLake-v1 is True or False, no number",
        ),
        (
            {"env_id": "FrozenLake-v1", "vary": ["desc=map:8,0.05"]},  # gymnasium would look for one for ever
            "of 1000 such maps none can be solved; raise FROZEN",
        ),
        ({"env_id": "Pendulum-v1"}, "has actions of the kind Box; numbered ones"),
    ],
)
def test_what_does_not_suit_is_refused_in_a_sentence(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        Gym(**settings).axes()


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"env_id": ""}, "id is missing"),
        ({"vary": ["x=poisson:1,2"]}, "write NAME=normal:MEAN,STD"),
        ({"vary": ["x=normal:1"]}, "write NAME=normal:MEAN,STD"),
        ({"vary": ["x=uniform:2,1"]}, "LOW is above HIGH"),
        ({"vary": ["x=normal:2,-1"]}, "deviation is negative"),
        ({"vary": ["x=map:2.5,1"]}, "SIZE is a whole number"),
        ({"vary": ["x=normal:0,1"], "set": ["x=3"]}, "x is varied or set twice"),
        ({"set": ["x"]}, "write NAME=VALUE"),
    ],
)
def test_what_cannot_be_read_is_refused_in_a_sentence(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Gym(**({"env_id": "FrozenLake-v1"} | settings))


def test_the_goal_must_be_an_end_and_be_told_where_there_is_no_table() -> None:
    with pytest.raises(
        NotAllowed, match=r"no end of FrozenLake-v1 is the goal by --goal reward>1: .* rewards 0, 1"
    ):
        Gym(env_id="FrozenLake-v1", goal="reward>1").refusal(LEARNING)
    with pytest.raises(UsageError, match="it is terminated, survived, or a rule"):
        dataclasses.replace(POLE, goal="bogus").refusal(LEARNING)
    assert "say which end is the goal" in dataclasses.replace(POLE, goal=None).refusal(LEARNING)
    anywhere = dataclasses.replace(LEARNING, start="anywhere")
    assert "leave out --start anywhere" in POLE.refusal(anywhere)
    assert LAKE.refusal(anywhere) == POLE.refusal(LEARNING) == ""


@pytest.mark.parametrize(
    ("slip", "probabilities"),
    [("uniform:1.5,1.5", "-0.25, 1.5, -0.25, 1 in sum"), ("normal:-0.2,0", "0.6, -0.2, 0.6, 1 in sum")],
)
def test_what_is_drawn_beyond_the_chances_there_are_is_refused(slip: str, probabilities: str) -> None:
    lake = Gym(env_id="FrozenLake-v1", vary=[f"success_rate={slip}"])
    with pytest.raises(
        NotAllowed, match=f"success_rate=.* outcomes have the probabilities {probabilities}: they"
    ):
        lake.tables(tasks_of(lake, 1))


def test_the_ends_that_pay_best_are_the_goal_and_holes_are_not() -> None:
    tables = LAKE.tables(tasks_of(LAKE, 1))
    everything = dataclasses.replace(LAKE, goal="terminated").tables(tasks_of(LAKE, 1))
    assert (everything.after == -2).sum() < (tables.after == -2).sum()
    assert (tables.after == -1).any()
    assert list(np.flatnonzero(~tables.open[0])) == [
        5,
        7,
        11,
        12,
        15,
    ]  # the holes and the goal of the 4 x 4 map


class Counting(gymnasium.Env[int, int]):
    """States that are numbered from 5 on, and a `last` that may be none of them."""

    observation_space = gymnasium.spaces.Discrete(3, start=5)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, last: int = 7) -> None:
        self.last = last

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        super().reset(seed=seed)
        return 5, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        return self.last, 0.0, False, False, {}


def test_states_that_are_numbered_from_elsewhere_are_rows_from_0_on(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = gymnasium.envs.registration.EnvSpec("Counting-v0", entry_point=Counting)
    monkeypatch.setitem(gymnasium.registry, "Counting-v0", spec)
    counting = Gym(env_id="Counting-v0", goal="terminated")
    episodes = counting._episodes(tasks_of(counting, 1)[0], 10)
    assert counting.starts().tolist() == [1, 0, 0]
    assert (episodes.start(0), episodes.step(0)) == (0, 2)


def test_a_state_beyond_those_there_are_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = gymnasium.envs.registration.EnvSpec("Counting-v0", entry_point=Counting)
    monkeypatch.setitem(gymnasium.registry, "Counting-v0", spec)
    beyond = Gym(env_id="Counting-v0", goal="terminated", set=["last=8"])
    episodes = beyond._episodes(tasks_of(beyond, 1)[0], 10)
    episodes.start(0)
    with pytest.raises(
        NotAllowed, match=r"observed 8, which is none of the 3 states .* \(step\(0\) of Counting-v0\)"
    ):
        episodes.step(0)


def test_without_gymnasium_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(UsageError, match=r"in your clone of qinit, pip install -e '\.\[gym\]'"):
        made_by_gymnasium(Recipe("FrozenLake-v1"))


class Unmeasured(gymnasium.Env):
    """Observes what it is told to: first at its reset, then at every step."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (2,))
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, first: float = 0.5, then: float = 0.5) -> None:
        self._first, self._then = first, then

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        return np.array([0.5, self._first]), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return np.array([0.5, self._then]), 0.0, False, False, {}


@pytest.fixture
def unmeasured() -> Iterator[str]:
    """The id of that environment."""
    gymnasium.register("Unmeasured-v0", entry_point=Unmeasured, disable_env_checker=True)
    yield "Unmeasured-v0"
    del gymnasium.registry["Unmeasured-v0"]


@pytest.mark.parametrize("number", ["inf", "-inf", "nan"])
def test_an_observation_that_is_no_number_is_refused_in_a_sentence(
    here: Callable[..., Any], unmeasured: str, number: str
) -> None:
    words = f"the environment observed {number} in dimension 1; its observations must be finite"
    learn = ("train-sources", "gym", unmeasured, "--goal", "survived", "--tasks", 1, "--episodes", 2)
    reset = here(*learn, "-q", "--set", f"first={number}")
    assert (reset.code, reset.out) == (4, "")
    assert words in reset.err
    assert reset.err.count("\n") == 1
    stepped = here(*learn, "--set", f"then={number}")
    assert (stepped.code, stepped.out) == (3, "")  # it is the task that failed
    assert f"task 0 failed, NotAllowed: {words}" in stepped.err


def test_a_number_however_large_is_in_the_last_bin() -> None:
    pole = POLE._seen
    assert pole.state([0.0, 1.7e308, 0.0, 0.0]) == pole.state([0.0, 2.0, 0.0, 0.0])
    assert pole.state([0.0, -1.7e308, 0.0, 0.0]) == pole.state([0.0, -2.0, 0.0, 0.0])


def test_what_is_observed_beyond_the_environments_own_bounds_is_counted() -> None:
    pole = POLE._seen
    pole.beyond.clear()
    assert pole.state([9.0, 99.0, 0.0, 0.0]) == pole.state([4.8, 99.0, 0.0, 0.0])
    [warning] = POLE.beyond  # not of dimension 1, whose range was given
    assert "beyond its own bounds in dimension 0 (1 time)" in warning
    pole.beyond.clear()
    assert POLE.beyond == []


class Given(gymnasium.Env):
    """Observes and pays what it is told to, and ends at once."""

    def __init__(self, seen: Any = None, reward: float = 0.0, box: bool = False) -> None:
        self._seen, self._reward = seen, reward
        self.observation_space = (
            gymnasium.spaces.Box(0.0, 1.0, (1,)) if box else gymnasium.spaces.Discrete(3)  # type: ignore[assignment]  # either
        )
        self.action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        return np.array(self._seen) if isinstance(self._seen, list) else self._seen, {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return self._seen, self._reward, True, False, {}


@pytest.mark.parametrize(
    ("settings", "code", "told"),
    [
        (["seen='1'"], 4, "the environment observed '1', which is none of the 3 states"),
        (["seen=1.0"], 4, "the environment observed 1.0, which is none of the 3 states"),
        (["seen=3"], 4, "the environment observed 3, which is none of the 3 states"),
        (["seen=['0.5']", "box=True"], 4, "which is no row of 1 numbers"),
        (["seen=[0.5j]", "box=True"], 4, "which is no row of 1 numbers"),
        (["seen=0", "reward=nan"], 3, "the environment ended an episode with the reward nan, which no rule"),
    ],
)
def test_what_an_environment_gives_that_cannot_be_learned_is_refused_in_a_sentence(
    here: Callable[..., Any], settings: list[str], code: int, told: str
) -> None:
    gymnasium.register("Given-v0", entry_point=Given, disable_env_checker=True)
    try:
        words = [word for each in settings for word in ("--set", each)]
        learn = ("train-sources", "gym", "Given-v0", "--goal", "reward>0", "--tasks", 1, "--episodes", 2)
        ended = here(*learn, *words)
    finally:
        del gymnasium.registry["Given-v0"]
    assert (ended.code, ended.out) == (code, "")
    assert told in ended.err
