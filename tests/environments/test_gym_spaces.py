"""Which spaces become numbers, and which one an observation or an action has: by numpy, by hand, and by Blackjack's odds."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import walks
from gymnasium import spaces

import qinit_cli as qinit
from qinit_cli.environments import modules
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.gym_episodes import shortest_cut
from qinit_cli.environments.gym_spaces import seen
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.kernels.worlds import GOAL
from qinit_cli.seeding import Stream

NESTED = spaces.Tuple(
    [
        spaces.MultiDiscrete([[2, 3], [1, 2]]),
        spaces.Dict({"z": spaces.Discrete(3, start=-1), "a": spaces.MultiBinary((2, 1))}),
        spaces.Discrete(2, start=4),
    ]
)
SIZES = (2, 3, 1, 2, 2, 2, 3, 2)  # of its numbers in turn; a Dict's in the order of its keys


def nested(places: tuple[int, ...]) -> Any:
    """The element of NESTED whose numbers, each counted from 0, are these."""
    a, b, c, d, e, f, z, last = places
    inner = {"z": z - 1, "a": np.array([[e], [f]], np.int8)}
    return (np.array([[a, b], [c, d]]), inner, last + 4)


class Echo(gymnasium.Env[Any, Any]):
    """Observes what it did last, after a reset the first element of its space."""

    def __init__(self, space: Any = NESTED, first: Any = None) -> None:
        self.observation_space = self.action_space = space
        self.first = nested((0,) * 8) if first is None else first

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        return self.first, {}

    def step(self, action: Any) -> Any:
        assert action in self.action_space
        return action, 0.0, False, False, {}


class Told(Echo):
    """Observes words beside a number."""

    def __init__(self) -> None:
        super().__init__(spaces.Dict({"number": spaces.Discrete(2), "said": spaces.Text(3)}))
        self.action_space = spaces.Discrete(2)


class Turned(gymnasium.Env[Any, int]):
    """Observes a grid of numbers, and has what no space tells: a place, a name and a load."""

    observation_space = spaces.Box(-1.0, 1.0, (2, 2), np.float64)
    action_space = spaces.Discrete(2)

    def __init__(self) -> None:
        self.place, self.angle, self.name, self.load = np.array([2, -1]), 0.25, "turned", None

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.place = np.array([2, -1])
        return np.array([[-1.0, -0.4], [0.1, 1.0]]), {}

    def step(self, action: int) -> Any:
        self.place = self.place + np.array([0, 1 + action])
        return np.zeros((2, 2)), 0.0, False, False, {}


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(modules, "_NAMED", {})  # what is named here, other tests have not named
    gymnasium.register("Echo-v0", entry_point=Echo, disable_env_checker=True)
    gymnasium.register("Told-v0", entry_point=Told, disable_env_checker=True)
    gymnasium.register("Turned-v0", entry_point=Turned, disable_env_checker=True)
    with walks.registered():
        yield
    for name in ("Echo-v0", "Told-v0", "Turned-v0"):
        del gymnasium.registry[name]
    seen.cache_clear()
    shortest_cut.cache_clear()


def episodes_of(family: Gym) -> Any:
    return family._episodes(draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(1))[0], 10)


def test_nested_spaces_are_numbered_as_numpy_does_and_actions_are_those_numbers() -> None:
    echo = Gym(env_id="Echo-v0", goal="terminated")
    count = int(np.prod(SIZES))
    assert echo.shape == SIZES
    assert len(echo.actions) == count
    names = ["0[0]", "0[1]", "0[2]", "0[3]", "1.a[0]", "1.a[1]", "1.z", "2"]
    assert [axis.long_name for axis in echo.axes()] == [f"observation {name}" for name in names]
    assert [axis.values.tolist() for axis in echo.axes()][-2:] == [[-1, 0, 1], [4, 5]]
    episodes = episodes_of(echo)
    assert episodes.start(0) == 0
    for places in np.ndindex(*SIZES):
        number = int(np.ravel_multi_index(places, SIZES))
        assert echo._seen.state(nested(places)) == number
        assert episodes.step(number) == number  # the environment did it and observed it
    assert echo.actions[-1] == "1,2,0,1,1,1,1,5"


def test_actions_that_are_numbered_from_elsewhere_keep_their_names() -> None:
    gymnasium.register("From3-v0", entry_point=lambda: Echo(spaces.Discrete(2, start=3), 3))
    try:
        from3 = Gym(env_id="From3-v0", goal="terminated")
        assert from3.actions == ("3", "4")
        episodes = episodes_of(from3)
        assert [episodes.start(0), episodes.step(1), episodes.step(0)] == [0, 1, 0]
    finally:
        del gymnasium.registry["From3-v0"]


def test_a_box_of_any_rank_is_binned_number_by_number() -> None:
    turned = Gym(env_id="Turned-v0", goal="terminated", bins="4,5,2,3")
    assert turned.shape == (4, 5, 2, 3)
    observed = np.array([[-1.0, -0.4], [0.1, 1.0]])
    places = [
        min(int(np.digitize(value, np.linspace(-1, 1, bins + 1))) - 1, bins - 1)
        for value, bins in zip(observed.ravel(), turned.shape, strict=True)
    ]
    assert turned._seen.state(observed) == np.ravel_multi_index(places, turned.shape)
    assert turned.starts().nonzero()[0].tolist() == [turned._seen.state(observed)]


def test_attributes_are_the_state_whole_numbers_one_by_one_and_others_in_bins() -> None:
    turned = Gym(
        env_id="Turned-v0",
        goal="terminated",
        state="place,angle",
        range=["0=0:2", "1=-1:2", "2=0:1"],
        bins="2",
    )
    assert turned.shape == (3, 4, 2)
    assert [axis.values.tolist() for axis in turned.axes()] == [[0, 1, 2], [-1, 0, 1, 2], [0.25, 0.75]]
    episodes = episodes_of(turned)
    assert [episodes.start(0), episodes.step(0), episodes.step(1)] == [16, 18, 22]
    with pytest.raises(NotAllowed, match=r"observed 4 in dimension 1 \(place\[1\]\), .* of --range 1=-1:2"):
        episodes.step(1)
    episodes._env.unwrapped.angle = np.zeros(2)
    with pytest.raises(NotAllowed, match="the attributes of --state are 4 numbers, and were 3 at first"):
        episodes.step(1)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"state": "place"},
            r"no bounds to dimensions 0 and 1 .*--range 1=LOW:HIGH, of place\[0\], place\[1\]",
        ),
        ({"state": "place", "range": ["0=0:2.5", "1=0:1"]}, r"--range 0=0:2.5: place\[0\] is a whole number"),
        ({"state": "load"}, "the attribute load is None, which is no number"),
        ({"state": "name"}, "the attribute name is 'turned', which is no number"),
        ({"state": "plase"}, "--state plase: Turned-v0 has no such attribute; its own are angle, load"),
        ({"bins": "2000"}, r"4 dimensions and 10\^13 states; give fewer --bins, or the attributes"),
        ({"bins": "2,2"}, "has 4 dimensions that are no whole numbers; give one number, or one for each"),
        (
            {"env_id": "Told-v0"},
            r"Told-v0 observes a Text \(said\); .*: give --wrap MODULE:FACTORY, or attributes by --state",
        ),
        ({"env_id": "Blackjack-v1", "bins": "3"}, "numbers its states; leave out --bins"),
        (
            {"env_id": "Blackjack-v1", "range": ["1=0:5"]},
            "dimension 1 of Blackjack-v1 is numbered from 0 to 10",
        ),
        ({"wrap": ["walks:MAKERS"]}, "--wrap walks:MAKERS: walks has no MAKERS that could be called"),
        (
            {"wrap": ["gymnasium.wrappers:TimeLimit"]},
            "--wrap gymnasium.wrappers:TimeLimit of Turned-v0 raised TypeError",
        ),
        ({"wrap": ["builtins:repr"]}, "--wrap builtins:repr gives .* which is no environment"),
        ({"wrap": ["Masked"]}, "--wrap Masked: write a module's name and a factory's"),
    ],
)
def test_what_cannot_be_a_state_is_refused_in_a_sentence(settings: dict[str, Any], told: str) -> None:
    with pytest.raises((UsageError, NotAllowed), match=told):
        Gym(**{"env_id": "Turned-v0", "goal": "terminated"} | settings).opened().axes()


def test_what_is_put_around_an_environment_is_outermost_in_the_order_given() -> None:
    walk = {"env_id": "Walk-v0", "goal": "terminated", "set": ["slip=0.0"]}
    paired = Gym(**walk, wrap=["walks:Mirrored", "walks:Pairs"]).opened()
    assert paired.shape == (3,)
    episodes = episodes_of(paired)
    episodes.start(0)
    assert [episodes.step(action) for action in (1, 0, 0, 1, 0)] == [0, 0, 1, 0, 1]
    assert paired.label == "gym-Walk-v0-0.0-wrap-Mirrored-wrap-Pairs-goal-terminated"


def test_a_wrapper_is_imported_where_it_is_named_and_not_because_a_file_does(
    here: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "around.py").write_text("import walks\n\ndef pairs(env):\n    return walks.Pairs(env)\n")
    monkeypatch.syspath_prepend(tmp_path)
    words = ("--wrap", "around:pairs", "--goal", "terminated", "--tasks", 2, "--episodes", 60, "-q")
    sources = here("train-sources", "gym", "Walk-v0", *words).path
    for module in (
        sys.modules.pop("around"),
        None,
    ):  # as another process, and as one that has it for other reasons
        modules._NAMED.clear()
        seen.cache_clear()
        if module is not None:
            sys.modules["around"] = module
        refused = here(
            "transfer", "zero", here("fit", sources, "-q").path, "--tasks", 1, "--episodes", 5, "-q"
        )
        assert (refused.code, refused.out) == (2, "")
        assert (
            "--wrap around:pairs comes from the module around, which is imported only where it is"
            in refused.err
        )
        sys.modules.pop("around", None)
    named = here(
        "transfer",
        "zero",
        here("fit", sources, "-q").path,
        "--tasks",
        1,
        "--episodes",
        5,
        "--import",
        "around",
    )
    assert named.code == 0, named.err


@cache
def dealt(total: int, ace: bool) -> Counter[int]:
    """How likely the dealer, who stands from 17 on, ends with each total; cards are drawn from a deck without end."""
    best = total + 10 if ace and total + 10 <= 21 else total
    if best >= 17:
        return Counter({best: 1.0})  # type: ignore[dict-item]  # shares, not counts
    ends: Counter[int] = Counter()
    for card in [*range(1, 11), 10, 10, 10]:
        for end, odds in dealt(total + card, ace or card == 1).items():
            ends[end] += odds / 13  # type: ignore[assignment]  # as above
    return ends


def blackjack(gamma: float) -> np.ndarray:
    """Q* of Blackjack without a usable ace, player's sums 12 to 21, dealer's cards 1 to 10, (10, 10, 2)."""
    q = np.zeros((22, 11, 2))
    for shown in range(1, 11):
        ends = dealt(shown, shown == 1)
        for total in range(21, 11, -1):
            q[total, shown, 0] = sum(
                odds * (1 if end > 21 else np.sign(total - end)) for end, odds in ends.items()
            )
            after = [
                gamma * q[total + card, shown].max() if total + card <= 21 else -1.0
                for card in [*range(1, 11), 10, 10, 10]
            ]
            q[total, shown, 1] = np.mean(after)
    return q[12:, 1:]


def test_blackjack_is_learned_as_its_odds_have_it() -> None:
    exact = blackjack(0.999)
    hits = exact[..., 1] > exact[..., 0]
    # Sutton & Barto (2018), figure 5.2: without a usable ace sticks at 17, and from 12 or 13 on against a dealer's 4 to 6
    assert hits[5:].sum() == 0
    assert [row.nonzero()[0].tolist() for row in ~hits[:2]] == [[3, 4, 5], [1, 2, 3, 4, 5]]
    family = Gym(env_id="Blackjack-v1", goal="reward>0", reward="native", returns="-1:1")
    sources = qinit.train_sources(family, tasks=1, episodes=20_000, gamma=0.999, alpha=0.05, epsilon=1.0)
    q = sources["q"][0, 12:22, 1:, 0]
    assert np.abs(q - exact).mean() < 0.12
    clear = np.abs(exact[..., 0] - exact[..., 1]) > 0.3
    assert clear.sum() == 46
    assert (q.argmax(axis=2) == exact.argmax(axis=2))[clear].all()


class Contexts(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Takes contexts by its constructor and sets one of them at every reset, as CARL's environments do."""

    def __init__(self, contexts: Any = None) -> None:
        super().__init__(walks.Walk())
        self.contexts = contexts or {0: {"slip": 0.3}}
        self.observation_space = spaces.Dict(
            {"obs": self.env.observation_space, "context": spaces.Dict({"slip": spaces.Box(0.0, 1.0, ())})}
        )

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        [(number, context)] = self.contexts.items()
        for name, value in context.items():
            setattr(self.env.unwrapped, name, value)
        observation, _ = self.env.reset(seed=seed)
        return {"obs": observation, "context": context}, {"context_id": number}


def test_contexts_are_tasks_one_of_each_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    slips = (0.0, 0.25, 1.0)
    Path("contexts.jsonl").write_text(
        "\n".join(json.dumps({"contexts": {str(line): {"slip": slip}}}) for line, slip in enumerate(slips))
    )
    gymnasium.register("Contexts-v0", entry_point=Contexts, disable_env_checker=True)
    try:
        family = Gym(
            env_id="Contexts-v0",
            goal="terminated",
            vary=["contexts=file:contexts.jsonl"],
            state="cell",
            range=["0=0:5"],
        )
        tasks = [
            draw_tasks(family, 0, stream, np.arange(1))[0]
            for stream in (Stream.SOURCE_TASK, Stream.TARGET_TASK)
        ]
        surely = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(2))[1]
        for task, slip in zip((*tasks, surely), slips, strict=True):
            episodes = family._episodes(task, 10)
            assert episodes.start(0) == 0
            assert episodes._env.unwrapped.slip == slip
        assert [episodes.step(action) for action in (0, 0, 1)] == [1, 2, 1]  # slips every time
        assert family.shape == (6,)
    finally:
        del gymnasium.registry["Contexts-v0"]


def test_minigrid_is_learned_by_where_the_agent_stands_and_looks() -> None:
    pytest.importorskip("minigrid")
    place = {"state": "agent_pos,agent_dir", "range": ["0=0:4", "1=0:4", "2=0:3"]}
    grid = Gym(env_id="minigrid:MiniGrid-Empty-5x5-v0", goal="reward>0", **place).opened()
    assert grid.shape == (5, 5, 4)
    assert grid.packages == ("gymnasium", "minigrid")
    episodes = episodes_of(grid)
    left, right, forward = 0, 1, 2
    way = [episodes.start(0), *map(episodes.step, (forward, left, right, right, forward, forward))]
    # from (1, 1) looking right to (2, 1), north, east, south, and down a column of the room
    states = [(1, 1, 0), (2, 1, 0), (2, 1, 3), (2, 1, 0), (2, 1, 1), (2, 2, 1), (2, 3, 1)]
    assert way == [np.ravel_multi_index(state, grid.shape) for state in states]
    assert [episodes.step(action) for action in (left, forward)][-1] == GOAL
