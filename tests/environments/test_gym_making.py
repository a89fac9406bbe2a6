"""How Gymnasium environments are made, stepped and judged: wrappers, limits, probability, faults, prints, and settings."""

from __future__ import annotations

import json
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import walks

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.foreign import aside
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.gym_episodes import shortest_cut
from qinit_cli.environments.gym_making import has_table, opened
from qinit_cli.environments.gym_recipe import KeywordArguments, Recipe
from qinit_cli.environments.gym_spaces import seen
from qinit_cli.environments.modules import import_named, travelling
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learning import Learning
from qinit_cli.seeding import Stream

LEARNING = Learning(alpha=0.1, gamma=0.95, epsilon=0.3, episodes=60, horizon=50, start="fixed")


@pytest.fixture(autouse=True)
def _walks() -> Iterator[None]:
    with walks.registered():
        yield
    shortest_cut.cache_clear()


def learned(here: Callable[..., Any], env_id: str, *more: object) -> np.ndarray:
    """The table of one task."""
    from qinit_store.reading import open_artefact

    words = ("train-sources", "gym", env_id, "--goal", "terminated", "--tasks", 1, "--gamma", 0.9, *more)
    ended = here(*words, "-q", "-o", "sources.h5", "--force")
    assert ended.code == 0, ended.err
    with open_artefact(ended.path, "sources") as artefact:
        return artefact.read("q")[0]


def test_states_are_those_of_the_outermost_wrapper(here: Callable[..., Any]) -> None:
    assert learned(here, "Paired-v0", "--episodes", 50).shape == (3, 2)
    assert Gym(env_id="Positions-v0", bins="6").shape == (6,)


def test_actions_are_those_of_the_wrapper(here: Callable[..., Any]) -> None:
    sure = ("--episodes", 300, "--set", "slip=0.1")
    plain, mirrored = (learned(here, name, *sure) for name in ("Walk-v0", "Mirrored-v0"))
    assert (plain[:5].argmax(axis=1) == 1).all()
    assert (mirrored[:5].argmax(axis=1) == 0).all()


def test_a_table_is_read_where_nothing_but_gymnasiums_own_stands_around_it() -> None:
    for name, wrapped in (("Lake-v0", False), ("LakeInPairs-v0", True)):
        from gymnasium.envs.toy_text import FrozenLakeEnv

        maker = (lambda: walks.Pairs(FrozenLakeEnv())) if wrapped else FrozenLakeEnv
        gymnasium.register(name, entry_point=maker, max_episode_steps=100)
        try:
            with opened(Recipe(name)) as env:
                assert type(env).__name__ == "TimeLimit"
                assert has_table(env) is not wrapped
        finally:
            del gymnasium.registry[name]


def exact(gamma: float, slip: float) -> np.ndarray:
    """Q* of Walk by value iteration, (6, 2)."""
    value = np.zeros(6)
    for _ in range(1000):
        left, right = value[np.maximum(np.arange(5) - 1, 0)], np.append(value[1:5], 1 / gamma)
        q = gamma * np.stack([(1 - slip) * left + slip * right, slip * left + (1 - slip) * right], axis=1)
        value = np.append(q.max(axis=1), 0.0)
    return np.vstack([q, [0.0, 0.0]])


@pytest.mark.parametrize("own", [("Walk-v0", "--set", "limit=8"), ("Limited-v0",)])
def test_what_an_environment_truncates_is_learned_as_what_the_horizon_cuts_off(
    here: Callable[..., Any], own: tuple[str, ...]
) -> None:
    given = ("--episodes", 1500, "--set", "slip=0.1")
    horizons = learned(here, "Walk-v0", *given, "--horizon", 8)
    truncated = learned(here, *own, *given, "--horizon", 50)
    np.testing.assert_array_equal(truncated, horizons)
    assert truncated[0].max() == pytest.approx(exact(0.9, 0.1)[0].max(), abs=0.05)


def test_a_task_that_is_truncated_is_judged_by_what_it_reaches_before() -> None:
    walk = Gym(env_id="Walk-v0", goal="terminated", set=["limit=8", "slip=0.0"])
    tasks = draw_tasks(walk, 0, Stream.SOURCE_TASK, np.arange(1))
    right = np.tile([0.0, 1.0], (1, 6, 1))
    assert walk.solved(tasks, right, 50).tolist() == [True]
    assert walk.path_lengths(tasks, right, 50)[0, :5, 1].tolist() == [5, 4, 3, 2, 1]
    assert walk.solved(tasks, -right, 50).tolist() == [False]
    assert (walk.path_lengths(tasks, -right, 50) == -1).all()
    assert (walk.visits(tasks, -right, 50) == 0).all()


@pytest.mark.parametrize("settings", [{"env_id": "Walk-v0", "set": ["limit=8"]}, {"env_id": "Limited-v0"}])
def test_survival_beyond_an_environments_own_limit_is_refused(settings: dict[str, Any]) -> None:
    walk = Gym(**settings, goal="survived")
    assert "cuts episodes off after 8 steps" in walk.refusal(LEARNING)
    assert walk.refusal(Learning(0.1, 0.9, 0.1, 10, 8, "fixed")) == ""


@pytest.mark.parametrize(
    ("name", "difference"),
    [
        ("OwnChance-v0", "its slip"),
        ("ByNumpy-v0", "what step"),
        ("ByPython-v0", "what step"),
        ("SeedsForAll-v0", "what step"),
        ("ByTheClock-v0", "what step"),
        ("StartsByChance-v0", "what reset(seed="),
        ("SeededOnce-v0", "after other episodes, what step"),
    ],
)
def test_chance_that_no_seed_reaches_is_refused(here: Callable[..., Any], name: str, difference: str) -> None:
    ended = here("train-sources", "gym", name, "--goal", "terminated", "--tasks", 1, "--episodes", 5)
    assert (ended.code, ended.out) == (4, "")
    assert (
        f"{name} with its defaults is not the same when it is made and played twice: {difference}"
        in ended.err
    )
    assert ended.err.count("\n") == 1


def test_a_map_that_is_drawn_anew_whenever_it_is_made_is_refused_and_one_by_a_seed_is_not() -> None:
    with pytest.raises(NotAllowed, match=r"map_name=None is not the same .*: its table P differs"):
        shortest_cut(Recipe("FrozenLake-v1", KeywordArguments([("map_name", None)])))
    assert shortest_cut(Recipe("FrozenLake-v1", KeywordArguments([("map_name", "8x8")]))) in range(101)


def test_an_observation_that_is_the_same_array_every_time_is_no_chance() -> None:
    assert shortest_cut(Recipe("SameArray-v0", KeywordArguments([("limit", 8)]))) == 8


def test_runs_whose_targets_turned_out_otherwise_are_not_compared(here: Callable[..., Any]) -> None:
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.comparison.source_sets import grouped
    from qinit_store.reading import open_artefact

    lake = ("--tasks", 2, "-q")
    sources = here("train-sources", "gym", "FrozenLake-v1", "--learner", "exact", *lake).path
    fit = here("fit", sources, "-q").path
    runs = []
    for method in ("zero", "mean"):
        with open_artefact(here("transfer", method, fit, "--episodes", 5, *lake).path, "run") as artefact:
            runs.append(ComparedRun.from_artefact(artefact))
    [group] = grouped(runs)
    assert len(group.entries) == 2
    import dataclasses

    assert runs[1].v_star is not None
    otherwise = dataclasses.replace(runs[1], v_star=runs[1].v_star + 0.01)
    with pytest.raises(
        NotAllowed, match=r"met the same targets by their settings, but the best value of target 0"
    ):
        grouped([runs[0], otherwise])


@pytest.mark.parametrize(
    ("where", "code", "told"),
    [
        ("init", 2, "gymnasium cannot make Raises-v0: ValueError: the motor is broken"),
        ("reset", 4, "reset(seed=0) of Raises-v0 raised ValueError: the motor is broken"),
        ("step", 4, "step(1) of Raises-v0 raised ValueError: the motor is broken"),
        ("close", 4, "close() of Raises-v0 raised ValueError: the motor is broken"),
        ("exit", 4, "step(1) of Raises-v0 raised SystemExit: 0"),
        ("panic", 4, "step(1) of Raises-v0 raised Panic: the motor is broken"),
        (
            "tuple",
            4,
            "step(1) of Raises-v0 raised ValueError: not enough values to unpack (expected 5, got 4)",
        ),
    ],
)
def test_a_fault_of_an_environment_names_it_the_call_and_the_error(
    here: Callable[..., Any], where: str, code: int, told: str
) -> None:
    words = ("--goal", "terminated", "--tasks", 1, "--episodes", 5, "--set", f"where={where}")
    ended = here("train-sources", "gym", "Raises-v0", *words)
    assert (ended.code, ended.out) == (code, "")
    assert told in ended.err
    assert ended.err.count("\n") == 1
    assert "fault of qinit" not in ended.err


def test_an_interruption_is_the_environments_own_where_ctrl_c_raises_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import signal

    from qinit_cli.environments.foreign import fault

    given = KeyboardInterrupt("window closed")
    for handler, ours in ((signal.default_int_handler, True), (signal.SIG_IGN, False)):
        monkeypatch.setattr(signal, "getsignal", lambda number, handler=handler: handler)
        assert (fault("Walk-v0", "step(1)", given) is given) == ours
    assert str(fault("Walk-v0", "step(1)", given)).startswith(
        "step(1) of Walk-v0 raised KeyboardInterrupt: window"
    )


def test_every_environment_that_is_made_is_closed(here: Callable[..., Any]) -> None:
    walks.Walk.counts.update(made=0, closed=0)
    words = ("--goal", "terminated", "--vary", "slip=uniform:0.1,0.3", "--episodes", 20, "-q")
    fit = here("fit", here("train-sources", "gym", "Walk-v0", "--tasks", 3, *words).path, "-q").path
    assert here("transfer", "optimal", fit, "--tasks", 2, "--episodes", 5, "-q").code == 0
    assert walks.Walk.counts["made"] == walks.Walk.counts["closed"] > 20


def test_numbers_of_the_class_are_set_on_the_environment_alone() -> None:
    with opened(Recipe("Walk-v0", KeywordArguments([("PULL", 0.5)]))) as env:
        assert (env.unwrapped.PULL, walks.Walk.PULL) == (0.5, 0.0)
    assert Gym(env_id="Acrobot-v1", vary=["LINK_LENGTH_1=uniform:0.9,1.1"], goal="terminated", bins="2").shape


@pytest.mark.parametrize(
    ("env_id", "name", "told"),
    [
        ("Walk-v0", "speed", "speed of Walk-v0 is computed and cannot be set"),
        ("Paired-v0", "width", "width belongs to Pairs, which stands around Paired-v0"),
        (
            "Walk-v0",
            "counts",
            "counts of Walk-v0 is no number, and of its attributes only numbers can be set",
        ),
        (
            "Walk-v0",
            "wind",
            "Walk-v0 has no wind: its constructor takes slip, limit, path; its numbers are PULL, slip",
        ),
    ],
)
def test_what_cannot_be_set_is_refused_in_words(env_id: str, name: str, told: str) -> None:
    with pytest.raises(UsageError, match=told), opened(Recipe(env_id, KeywordArguments([(name, 1)]))):
        pass


def test_arguments_that_a_constructor_hands_on_are_given_to_it() -> None:
    for env_id in ("Handed-v0", "Paired-v0"):
        with opened(Recipe(env_id, KeywordArguments([("path", [1, 2]), ("slip", 0.1)]))) as env:
            assert (env.unwrapped.path, env.unwrapped.slip) == ([1, 2], 0.1)


@pytest.mark.parametrize("value", ["[1, [2]]", "{'a': [1]}", "{1, 2}", "(1, 2)", "None", "word"])
def test_settings_of_any_kind_arrive_as_they_were_written(value: str) -> None:
    import ast

    walk = Gym(env_id="Walk-v0", set=[f"path={value}"], goal="terminated")
    assert walk.shape == (6,)
    with opened(walk._example) as env:
        assert env.unwrapped.path == (value if value == "word" else ast.literal_eval(value))


def test_a_map_can_be_set_as_a_list() -> None:
    lake = Gym(env_id="FrozenLake-v1", set=['desc=["SFF","FHF","FFG"]'])
    assert lake.shape == (3, 3)
    assert lake.label == "gym-FrozenLake-v1-SFF-FHF-FFG"


def test_one_and_true_are_two_settings() -> None:
    alike = [KeywordArguments([("x", value)]) for value in (1, 1.0, True, [1])]
    assert len(set(alike)) == 4
    assert KeywordArguments([("x", [1])]) == alike[3]


def test_what_an_environment_prints_goes_to_stderr(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from qinit_cli.app import run

    words = ["--goal", "terminated", "--tasks", "4", "--episodes", "5", "--jobs", "2", "-q", "--json"]
    assert run(["train-sources", "gym", "Noisy-v0", *words, "-o", str(tmp_path / "sources.h5")]) == 0
    said = capfd.readouterr()
    assert json.loads(said.out)["tasks"] == 4
    assert {"said", "written", "printed by C"} <= set(said.err.splitlines())


def test_standard_output_comes_back_however_deep_it_was_turned_away(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with aside():
        with pytest.raises(ZeroDivisionError), aside():
            _ = 1 / 0
        print("away")
        os.write(1, b"far\n")
    print("back", flush=True)
    os.write(1, b"here\n")
    said = capfd.readouterr()
    assert said.out == "back\nhere\n"
    assert set(said.err.splitlines()) == {"away", "far"}


SHOUTS = """
print("importing")
import gymnasium, walks
gymnasium.register("Shouts-v0", entry_point=walks.Walk)
"""


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Modules that can be imported, one registers Shouts-v0; what is yielded makes this process forget it, as another would."""
    (tmp_path / "shouts.py").write_text(SHOUTS)
    (tmp_path / "broken.py").write_text("raise RuntimeError('not today')")
    monkeypatch.syspath_prepend(tmp_path)

    def forget() -> None:
        sys.modules.pop("shouts", None)
        gymnasium.registry.pop("Shouts-v0", None)
        seen.cache_clear()
        shortest_cut.cache_clear()

    yield forget
    forget()


def test_a_module_is_imported_where_it_is_named_and_not_because_a_file_does(
    here: Callable[..., Any], modules: Callable[[], None]
) -> None:
    words = ("--goal", "terminated", "--vary", "slip=uniform:0,0.2", "--tasks", 3, "--episodes", 100)
    sources = here("train-sources", "gym", "shouts:Shouts-v0", *words).path
    assert sources.name.startswith("gym-shouts-Shouts-v0-slip-U0-0.2-goal-terminated-3-seed-0-")
    modules()
    fit = here("fit", sources).path
    transfer = ("transfer", "zero", fit, "--tasks", 1, "--episodes", 5)
    refused = here(*transfer)
    assert (refused.code, refused.out) == (2, "")
    assert refused.err == (
        "qinit: shouts:Shouts-v0 comes from the module shouts, which is imported only where it is named: "
        "give --import shouts\n"
    )
    assert "shouts" not in sys.modules
    named = here(*transfer, "--import", "shouts")
    assert (named.code, named.err.splitlines()[0]) == (0, "importing")
    modules()
    bare = here("train-sources", "gym", "Shouts-v0", "--import", "shouts", *words)
    assert (bare.path, "already complete" in bare.err) == (sources, True)


def test_what_travels_to_another_process_takes_the_names_of_modules_along(
    modules: Callable[[], None],
) -> None:
    import_named(["shouts"])
    modules()
    learn = pickle.loads(pickle.dumps(travelling(_nothing, {"env_id": "shouts:Shouts-v0"})))
    assert "shouts" not in sys.modules
    assert learn(np.arange(2), None) == (2, {})
    assert "shouts" in sys.modules
    assert (
        travelling(_nothing, {"name": "gridworld"}) is _nothing
    )  # workers may lack what another run has named


def _nothing(indices: Any, watch: Any) -> Any:
    return len(indices), {}


@pytest.mark.parametrize(
    ("named", "told"),
    [
        ("no_such_module", "there is no module no_such_module; put the folder that holds it on PYTHONPATH"),
        ("broken", "importing broken raised RuntimeError: not today"),
        (".walks", "write a module's name"),
    ],
)
def test_a_module_that_cannot_be_imported_is_told_in_a_sentence(
    here: Callable[..., Any], modules: Callable[[], None], named: str, told: str
) -> None:
    for words in (["gym", f"{named}:Walk-v0"], ["gym", "Walk-v0", "--import", named]):
        ended = here("train-sources", *words, "--goal", "terminated")
        assert (ended.code, ended.out) == (2, "")
        assert told in ended.err
        assert ended.err.count("\n") == 1
