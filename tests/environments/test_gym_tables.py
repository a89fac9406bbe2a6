"""Tables of transitions that environments bring: faulty ones are refused with the place, and steps must agree with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.gym_agreement import disagreement
from qinit_cli.environments.gym_recipe import KeywordArguments, Recipe
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.seeding import Stream

STATES, ACTIONS = 3, 2
LAKE = "FrozenLake-v1"


def sound() -> dict[str, Any]:
    """Three cells: action 0 stays; action 1 goes on with a probability of .8, and from the last cell to the end, for 1."""
    table: dict[int, dict[int, Any]] = {}
    for cell in range(STATES):
        last = cell == STATES - 1
        on = (0.8, cell if last else cell + 1, float(last), last)
        table[cell] = {0: [(1.0, cell, 0.0, False)], 1: [on, (0.2, cell, 0.0, False)]}
    return {"P": table, "start": [1.0, 0.0, 0.0]}


Change = Callable[[dict[str, Any]], Any]


@pytest.fixture
def tabled() -> Iterator[Callable[..., Gym]]:
    """A family whose environment has the sound table but for a change, and steps by the sound one but for `acts`."""

    def made(change: Change = lambda given: None, acts: Change = lambda given: None) -> Gym:
        said, does = sound(), sound()
        change(said)
        acts(does)

        class Tabled(gymnasium.Env):
            observation_space = gymnasium.spaces.Discrete(STATES)
            action_space = gymnasium.spaces.Discrete(ACTIONS)

            def __init__(self, slip: float = 0.5, fair: bool = True, name: str = "x") -> None:
                self.P, self.initial_state_distrib = said["P"], said["start"]

            def reset(self, *, seed: Any = None, options: Any = None) -> Any:
                super().reset(seed=seed)
                self.cell = int(self.np_random.choice(STATES, p=does["start"]))
                self.moves = 0
                return self.cell, {}

            def step(self, action: int) -> Any:
                ways = does["P"][self.cell][int(action)]
                if self.moves == 0 and "first" in does:
                    ways = does["first"]
                self.moves += 1
                _, self.cell, reward, end = ways[self.np_random.choice(len(ways), p=[way[0] for way in ways])]
                return self.cell, reward, end, False, {}

        gymnasium.register("Tabled-v0", entry_point=Tabled, disable_env_checker=True)
        return Gym(env_id="Tabled-v0")

    from qinit_cli.environments import gym_episodes, gym_examples, gym_spaces, gym_tables

    yield made
    del gymnasium.registry["Tabled-v0"]
    for cached in (
        disagreement,
        gym_episodes.shortest_cut,
        gym_examples.doubt,
        gym_examples.idle,
        gym_spaces.seen,
        gym_tables.read,
        gym_tables.table,
    ):
        cached.cache_clear()


def tasks_of(family: Gym, count: int = 1) -> np.ndarray:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count))


def outcomes(*ways: Any) -> Change:
    """Of action 1 in state 1."""
    return lambda given: given["P"][1].update({1: list(ways)})


STAYS = (1.0, 1, 0.0, False)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (outcomes((1.0, -1, 0.0, False)), "action 1 in state 1 leads to -1, which is none of the 3 states"),
        (outcomes((1.0, -3, 0.0, False)), "leads to -3, which is none of the 3 states"),
        (outcomes((1.0, 3, 0.0, False)), "leads to 3, which is none of the 3 states"),
        (outcomes((1.0, 1.5, 0.0, False)), "leads to 1.5, which is none"),
        (outcomes((1.0, "x", 0.0, False)), "leads to 'x', which is none"),
        (
            outcomes((float("nan"), 1, 0.0, False)),
            "for action 1 in state 1 the outcomes have the probabilities nan",
        ),
        (outcomes((float("inf"), 1, 0.0, False)), "the outcomes have the probabilities inf"),
        (
            outcomes((-0.5, 1, 0.0, False), (1.5, 1, 0.0, False)),
            "the outcomes have the probabilities -0.5, 1.5, 1 in sum: they must be within 0",
        ),
        (
            outcomes((0.5, 1, 0.0, False)),
            "the outcomes have the probabilities 0.5, 0.5 in sum: they must be within 0 and 1, and sum to 1",
        ),
        (outcomes(("1", 1, 0.0, False)), "an outcome of probability '1', which is no number"),
        (outcomes((1.0, 1, float("nan"), False)), "has the reward nan, which is no finite number"),
        (outcomes((1.0, 1, None, False)), "has the reward None"),
        (outcomes((1.0, 1, 0.0, "no")), "has the end 'no', which is neither True nor False"),
        (
            outcomes((1.0, 1, 0.0)),
            r"has the outcome \(1.0, 1, 0.0\), which is not \(probability, next state, reward, end\)",
        ),
        (outcomes((1.0, 1, 0.0, False, {})), "which is not"),
        (outcomes(1.0), "has the outcome 1.0, which is not"),
        (outcomes(), "action 1 in state 1 has no outcomes"),
        (lambda given: given["P"][1].pop(1), "state 1 has no action 1, of 2 actions"),
        (lambda given: given["P"].pop(2), "it has no state 2, of 3 states"),
        (lambda given: given["P"].update({3: {}}), "it has state 3, which is none of its 3 states"),
        (
            lambda given: given["P"][0].update({2: [STAYS]}),
            "state 0 has action 2, which is none of its 2 actions",
        ),
        (lambda given: given["P"].update({1: None}), "state 1 is a NoneType, which has no actions"),
        (lambda given: given.update(start=[0.0, 0.0, 0.0]), "where episodes start sum to 0, not 1"),
        (
            lambda given: given.update(start=[1.5, -0.5, 0.0]),
            "state 0 is where episodes start with probability 1.5",
        ),
        (
            lambda given: given.update(start=[float("nan")] * 3),
            "state 0 is where episodes start with probability nan",
        ),
        (
            lambda given: given.update(start=[1.0, 0.0]),
            r"initial_state_distrib has the shape \(2,\), of 3 states",
        ),
        (lambda given: given.update(start=["a", 0, 0]), "which are no numbers"),
    ],
)
def test_a_faulty_table_is_refused_with_the_state_and_the_action(
    tabled: Callable[..., Gym], change: Change, told: str
) -> None:
    family = tabled(change, change)  # whose own steps fail by it
    with pytest.raises(
        NotAllowed, match=f"the table P of Tabled-v0 with its defaults cannot be learned: .*{told}"
    ):
        family.tables(tasks_of(family))


@pytest.mark.parametrize(
    "change",
    [
        lambda given: None,
        lambda given: given.update(P=[[given["P"][cell][action] for action in (0, 1)] for cell in range(3)]),
        lambda given: given.update(
            P={np.int64(cell): tuple(row.values()) for cell, row in given["P"].items()}
        ),
        lambda given: given.update(start=np.array([1, 0, 0], np.float32)),
        outcomes(
            (np.float32(0.7), 2, 0.0, False), (np.float32(0.2), 1, 0.0, False), (np.float32(0.1), 1, 0, False)
        ),
        outcomes((np.float32(0.5), np.int64(2), np.float64(0), np.bool_(False)), [0.5, 1, 0, 0]),
    ],
)
def test_what_is_only_written_otherwise_is_read(tabled: Callable[..., Gym], change: Change) -> None:
    family = tabled(change, change)
    tables = family.tables(tasks_of(family))
    assert tables.after.shape[:3] == (1, STATES, ACTIONS)
    np.testing.assert_array_equal(tables.after[0, 1, 1], [2, 1])
    assert family.tabular


@pytest.mark.parametrize(
    ("acts", "told"),
    [
        (
            outcomes((1.0, 0, 0.0, False)),
            "action 1 in state 1 led to state 0 with reward 0, of probability 0 in P",
        ),
        (
            outcomes((0.8, 2, 0.5, False), (0.2, 1, 0.0, False)),
            "led to state 2 with reward 0.5, of probability 0",
        ),
        (
            outcomes((1.0, 2, 0.0, True)),
            "led to state 2 with reward 0 and ended the episode, of probability 0",
        ),
        # probabilities that are far off
        (
            outcomes((1.0, 1, 0.0, False)),
            r"action 1 in state 1 led to state 2 0 times of \d+, whose probability in P is 0.8",
        ),
        (
            outcomes((0.1, 2, 0.0, False), (0.9, 1, 0.0, False)),
            "action 1 in state 1 led to state 2 .* probability in P is 0.8",
        ),
        (
            lambda given: given.update(start=[0.5, 0.0, 0.5]),
            "started in state 2, whose probability to be a start is 0",
        ),
        # the first move alone is another
        (lambda given: given.update(first=[(1.0, 2, 0.0, False)]), "in state 0 led to state 2"),
    ],
)
def test_a_table_that_steps_do_not_follow_is_not_believed(
    tabled: Callable[..., Gym], acts: Change, told: str
) -> None:
    family = tabled(acts=acts)
    assert not family.tabular
    with pytest.raises(NotAllowed, match=f"the table P of Tabled-v0 .* is not all that happens: .*{told}"):
        family.tables(tasks_of(family))


def test_starts_that_come_too_often_are_not_believed(tabled: Callable[..., Gym]) -> None:
    family = tabled(
        lambda given: given.update(start=[0.1, 0.9, 0.0]), lambda given: given.update(start=[0.9, 0.1, 0.0])
    )
    assert "episodes started in state 0, with probability 0.1" in family.untabled


@pytest.mark.parametrize(
    ("env_id", "settings", "agrees"),
    [
        (LAKE, [], True),
        (LAKE, ["map_name=8x8", "success_rate=0.6"], True),
        ("CliffWalking-v1", ["is_slippery=True"], True),
        ("Taxi-v4", [], True),
        ("Taxi-v4", ["is_rainy=True"], True),
        ("Taxi-v4", ["fickle_passenger=True", "fickle_probability=1.0"], False),
        ("Taxi-v4", ["fickle_passenger=True"], False),
        ("Taxi-v4", ["fickle_passenger=True", "is_rainy=True"], False),
    ],
)
def test_gymnasiums_own_tables_are_believed_where_they_are_all_that_happens(
    env_id: str, settings: list[str], agrees: bool
) -> None:
    family = Gym(env_id=env_id, set=settings, goal="reward>-5")
    assert family.tabular == agrees
    assert ("is stepped" in family.warning) == (not agrees)
    assert family.untabled == "" or "led to state" in family.untabled


def test_a_fickle_taxi_is_stepped_or_refused_and_never_learned_from_its_table(
    here: Callable[..., Any],
) -> None:
    fickle = ("--set", "fickle_passenger=True", "--set", "fickle_probability=1.0", "--tasks", 1)
    learn = ("train-sources", "gym", "Taxi-v4", *fickle)
    exact, untold = here(*learn, "--learner", "exact"), here(*learn)
    for ended in (exact, untold):
        assert (ended.code, ended.out) == (2, "")
        assert (
            "the table P of Taxi-v4 with fickle_passenger=True, fickle_probability=1.0 is not all"
            in ended.err
        )
        assert ended.err.count("\n") == 1
    assert "leave out --learner exact" in exact.err
    assert "say which end is the goal" in untold.err
    stepped = here(*learn, "--goal", "reward>0", "--episodes", 3, "--horizon", 20)
    assert stepped.code == 0
    assert "so it is stepped, as an environment without a table is" in stepped.err
    assert "the goal: ends with reward>0; others are lost" in stepped.err


@pytest.mark.parametrize(
    ("settings", "told", "rewards", "states"),
    [
        ([], "ends with reward 1 (state 15); those with reward 0 are lost", [1], [15]),
        (
            ["reward_schedule=(0,1,0)"],
            "ends with reward 1 (states 5, 7, 11, 12); those with reward 0 are lost",
            [1],
            [5, 7, 11, 12],
        ),
        (
            ["reward_schedule=(0,0,0)"],
            "all ends with reward 0 (states 5, 7, 11, 12, 15)",
            [0],
            [5, 7, 11, 12, 15],
        ),
    ],
)
def test_which_ends_are_the_goal_is_always_told(
    here: Callable[..., Any], settings: list[str], told: str, rewards: list[float], states: list[int]
) -> None:

    words = [word for text in settings for word in ("--set", text)]
    learn = ("train-sources", "gym", LAKE, *words, "--tasks", 1, "--learner", "exact", "--json")
    for ended in (here(*learn), here(*learn)):  # the second is complete already
        assert ended.err.count(f"; the goal: {told}\n") == 1
        found = ended.json
        assert (found["goal"], found["goal_rewards"], found["goal_states"]) == (told, rewards, states)


def test_what_is_varied_without_effect_is_told() -> None:
    still = Gym(env_id=LAKE, set=["is_slippery=False"], vary=["success_rate=uniform:0.4,0.9"])
    assert (
        still.warning == f"success_rate of {LAKE} changes nothing from task to task: their tables are equal"
    )
    assert Gym(env_id=LAKE, vary=["success_rate=uniform:0.4,0.9"]).warning == ""
    box = {"env_id": "CartPole-v1", "range": ["1=-2:2", "3=-2:2"], "goal": "terminated"}
    idle = Gym(**box, vary=["x_threshold=uniform:2.4,2.5", "gravity=uniform:8,9"]).warning
    assert (
        idle
        == "x_threshold of CartPole-v1 changes nothing from task to task: 300 steps are the same whatever it is"
    )
    assert Gym(**box, vary=["gravity=uniform:8,9"]).warning == ""


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("slip", "abc", "slip of Tabled-v0 is a number, such as 0.5, and 'abc' is none"),
        ("slip", "True", "slip of Tabled-v0 is a number, such as 0.5, and True is none"),
        ("slip", "[1]", r"slip of Tabled-v0 is a number, such as 0.5, and \[1\] is none"),
        ("fair", "no", "fair of Tabled-v0 is True or False, and 'no' is neither"),
        ("fair", "1", "fair of Tabled-v0 is True or False, no number"),
        ("name", "3", "name of Tabled-v0 is text, such as 'x', and 3 is none"),
    ],
)
def test_a_value_of_another_kind_than_the_argument_is_refused(
    tabled: Callable[..., Gym], name: str, value: str, told: str
) -> None:
    tabled()
    with pytest.raises(UsageError, match=told):
        Gym(env_id="Tabled-v0", set=[f"{name}={value}"]).axes()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"set": ["gravity=abc"]}, "gravity of CartPole-v1 is a number, such as 9.8, and 'abc' is none"),
        (
            {"vary": ["kinematics_integrator=normal:0,1"]},
            "kinematics_integrator of CartPole-v1 is no number",
        ),
        (
            {"vary": ["sutton_barto_reward=uniform:0,1"]},
            "sutton_barto_reward of CartPole-v1 is True or False, no number",
        ),
        ({"vary": ["_sutton_barto_reward=uniform:0,1"]}, "write NAME"),
    ],
)
def test_attributes_and_flags_keep_their_kind(changes: dict[str, Any], told: str) -> None:
    with pytest.raises((UsageError, ValueError), match=told):
        Gym(env_id="CartPole-v1", range=["1=-2:2", "3=-2:2"], goal="survived", **changes).axes()


def test_a_shift_to_a_value_of_another_kind_is_refused(here: Callable[..., Any]) -> None:
    sources = here(
        "train-sources",
        "gym",
        LAKE,
        "--vary",
        "success_rate=uniform:0.4,0.9",
        "--tasks",
        3,
        "--learner",
        "exact",
    )
    fit = here("fit", sources.path).path
    ended = here("transfer", "zero", fit, "--shift", "set=is_slippery=off")
    assert (ended.code, ended.out) == (2, "")
    assert "is_slippery of FrozenLake-v1 is True or False, and 'off' is neither" in ended.err


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ('["SFX","FFG"]', "row 0 of desc of FrozenLake-v1 has 'X'; a map has the letters S"),
        ('["sF","FG"]', "row 0 of desc of FrozenLake-v1 has 's'"),
        ('["SFF","FG"]', "row 1 of desc of FrozenLake-v1 has 2 letters and row 0 3"),
        ('["SFF","FFF"]', "has no G, so the map has no goal"),
        ('["FFF","FFG"]', "has no S, so the map has no start"),
        ("SFG", "is a list of rows"),
        ("[1, 2]", "is a list of rows"),
        ("[]", "is a list of rows"),
    ],
)
def test_what_is_no_map_is_refused(rows: str, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        Gym(env_id=LAKE, set=[f"desc={rows}"]).axes()


def test_a_map_given_as_rows_is_one() -> None:
    family = Gym(env_id=LAKE, set=['desc=["SFF","HFG"]'])
    assert family.shape == (2, 3)
    assert family.ends()["goal_states"] == [5]


@pytest.mark.parametrize("names", [("a", "A"), ("steps", "Steps"), ("x", "X")])
def test_names_that_would_be_one_column_are_refused(names: tuple[str, str]) -> None:
    with pytest.raises(ValueError, match=f"{names[0]} and {names[1]} would be one column"):
        Gym(env_id="Tabled-v0", vary=[f"{name}=uniform:0,1" for name in names])


def test_a_name_longer_than_a_column_can_have_is_refused() -> None:
    assert Gym(env_id="Tabled-v0", vary=[f"{'n' * 64}=uniform:0,1"]).parameters()[0].name == "n" * 64
    with pytest.raises(ValueError, match="has 65 letters; a column of an artefact has 64 at most"):
        Gym(env_id="Tabled-v0", vary=[f"{'n' * 65}=uniform:0,1"])


def test_no_column_of_what_is_varied_has_the_name_of_another(tabled: Callable[..., Gym]) -> None:
    from qinit_cli.artefacts.opening import action_axis
    from qinit_cli.artefacts.run import run_schema
    from qinit_cli.artefacts.sources import sources_schema
    from qinit_cli.environments.variation import Variation

    family = tabled()
    axes = (*family.axes(), action_axis(family))
    named = {"start_per_task": True, "potential_per_task": True, "exact_values": True, "keep_q": True}
    schemas = (
        sources_schema(axes[:-1], axes[-1], (), 5),
        run_schema(axes[:-1], axes[-1], (), 5, evaluations=2, hypotheses=3, updating=True, **named),
    )
    taken = {each.name for schema in schemas for each in (*schema.axes, *schema.columns)} | {
        "task",
        "row",
        "x0",
    }
    columns = {Variation.read(f"{name}=uniform:0,1").column for name in taken}
    assert len(columns) == len(taken)
    assert not columns & taken
    assert Variation.read("Slip=uniform:0,1").column == "slip"


def test_sampling_is_the_same_every_time() -> None:
    fickle = KeywordArguments([("fickle_passenger", True)])
    found = []
    for _ in range(2):
        disagreement.cache_clear()
        found.append(disagreement(Recipe("Taxi-v4", fickle), "reward>0", 1000))
    assert "led to state" in found[0]
    assert found[0] == found[1]
