"""Rows of a file as tasks: what each makes, which are sources and which are targets, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from quantecon.markov import DiscreteDP
from running import Ended

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.own_tasks import OwnTasks
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.seeding import Stream

GAMMA = 0.99
RATES = (0.8, 0.6, 0.7, 0.5, 0.9, 0.8)
LABELS = ("easy", "easy", "hard", "hard", "easy", "hard")
LAKE = ("--env", "FrozenLake-v1")
TWO_FILES = ("--vary", "success_rate=file:ice.jsonl", "--vary", "map_name=file:maps.csv")


@pytest.fixture
def ice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Six lakes in a file of the current folder, the first and the last alike."""
    monkeypatch.chdir(tmp_path)
    lines = [{"success_rate": rate, "split": label} for rate, label in zip(RATES, LABELS, strict=True)]
    Path("ice.jsonl").write_text("\n".join(map(json.dumps, lines)))
    return "ice.jsonl"


def opened(file: str, **settings: Any) -> Gym:
    family = OwnTasks(file=file, env="FrozenLake-v1", **settings).opened()
    assert isinstance(family, Gym)
    return family


def best(rate: float) -> Any:
    """V* of one lake (16,) by quantecon, from gymnasium's own table."""
    env = gymnasium.make("FrozenLake-v1", success_rate=rate).unwrapped
    p, r = np.zeros((17, 4, 17)), np.zeros((17, 4))
    p[16, :, 16] = 1  # behind every end
    for state in range(16):
        for action in range(4):
            for chance, after, reward, done in env.P[state][action]:  # type: ignore[attr-defined]
                p[state, action, 16 if done else after] += chance
                r[state, action] += chance * reward
    return DiscreteDP(r, p.transpose(0, 1, 2), GAMMA).solve(method="policy_iteration").v[:16]


def test_each_row_is_the_lake_that_it_describes(ice: str, here: Callable[..., Ended]) -> None:
    import qinit_cli as qinit

    made = here("train-sources", "tasks", ice, *LAKE, "--use", "3:5,1:2", "--learner", "exact")
    assert made.code == 0, made.err
    sources = qinit.open(made.path)
    assert sources["file_task"].tolist() == [3, 4, 1]
    assert sources["success_rate"].tolist() == [0.5, 0.9, 0.6]
    for q, rate in zip(sources["q"], (0.5, 0.9, 0.6), strict=True):
        live = ~np.isin(np.arange(16), (5, 7, 11, 12, 15))  # gymnasium's holes and goal lead nowhere
        np.testing.assert_allclose(q.reshape(16, 4).max(axis=1)[live], best(rate)[live], rtol=0, atol=1e-9)


def test_rows_are_the_family_gym_with_its_rows_named(ice: str, here: Callable[..., Ended]) -> None:
    vary = ("--vary", f"success_rate=file:./{ice}")
    few = ("--use", "0:4,5:6", "--episodes", 50, "--json")
    thin = here("train-sources", "tasks", ice, *LAKE, *few, "-o", "a.h5")
    same = here("train-sources", "gym", LAKE[1], *vary, *few, "-o", "b.h5")
    assert thin.json["digest"] == same.json["digest"]
    library = opened(ice, use="0:4,5:6")
    assert library == Gym(LAKE[1], vary=[vary[1]], use="0:4,5:6").opened()


def test_a_row_is_learned_as_it_is_by_turns(ice: str, here: Callable[..., Ended]) -> None:
    import qinit_cli as qinit

    Path("plain.jsonl").write_text("\n".join(json.dumps({"success_rate": rate}) for rate in RATES))
    few = ("--episodes", 60, "--seed", 3)
    turns = here("train-sources", "gym", LAKE[1], "--vary", "success_rate=file:plain.jsonl", *few)
    named = here("train-sources", "tasks", "plain.jsonl", *LAKE, "--use", "0:1,2:3,4:5", *few)
    np.testing.assert_array_equal(qinit.open(turns.path)["q"], qinit.open(named.path)["q"])


def test_rows_are_named_by_range_fold_and_label(ice: str) -> None:
    def rows(family: Gym, stream: Stream, count: int) -> list[int]:
        found: list[int] = draw_tasks(family, 0, stream, np.arange(count))["file_task"].tolist()
        return found

    assert opened(ice).use == "0:6"
    fold = opened(ice, use="fold:2/3")
    assert (fold.use, rows(fold, Stream.SOURCE_TASK, 4)) == ("fold:2/3", [0, 2, 3, 5])
    held = fold.holding_out(None, allow_overlap=False)
    assert rows(held, Stream.TARGET_TASK, 2) == [1, 4]
    assert held == fold  # the distribution is the same
    hard = opened(ice, use="hard")
    assert hard.use == "2:4,5:6"
    assert rows(hard.holding_out("1:2,4:5", allow_overlap=False), Stream.TARGET_TASK, 2) == [1, 4]
    assert rows(hard.holding_out("easy", allow_overlap=True), Stream.TARGET_TASK, 3) == [0, 1, 4]


def test_a_row_in_both_halves_is_refused_unless_that_is_allowed(ice: str) -> None:
    family = opened(ice, use="0:3")
    with pytest.raises(UsageError, match=r"task 2 of ice\.jsonl would be source and target"):
        family.holding_out("2:4", allow_overlap=False)
    with pytest.raises(UsageError, match="task 5 and task 0, which are equal"):
        family.holding_out(None, allow_overlap=False)
    assert family.holding_out(None, allow_overlap=True).targets == "3:6"
    with pytest.raises(UsageError, match=r"all 6 tasks of ice\.jsonl are sources"):
        opened(ice).holding_out(None, allow_overlap=False)
    Path(ice).write_text(Path(ice).read_text().replace("0.7", "0.75"))
    with pytest.raises(NotAllowed, match="is not the file any more"):
        family.holding_out("3:5", allow_overlap=False)


def test_targets_named_by_their_rows_go_with_sources_by_turns(ice: str) -> None:
    Path("turns.csv").write_text("success_rate\n0.5\n0.6\n0.7\n0.8\n")
    family = Gym(LAKE[1], vary=["success_rate=file:turns.csv"]).opened()
    assert family.holding_out(None, allow_overlap=False) is family
    assert family.holding_out("3:4", allow_overlap=False).targets == "3:4"
    with pytest.raises(UsageError, match=r"task 2 of turns\.csv would be source and target"):
        family.holding_out("2:4", allow_overlap=False)


def test_shifted_targets_are_no_rows_of_the_sources_file(ice: str) -> None:
    family = opened(ice, use="0:3").shifted({"vary": "success_rate=uniform:0.3,0.4"})
    assert family.use is None
    assert family.holding_out(None, allow_overlap=False) is family
    with pytest.raises(ValueError, match="choose other targets by --targets"):
        opened(ice, use="0:3").shifted({"use": "3:4"})


def test_an_artefact_is_shown_and_fitted_without_its_file_and_nothing_is_learned(
    ice: str, here: Callable[..., Ended]
) -> None:
    made = here("train-sources", "tasks", ice, *LAKE, "--use", "0:3", "--learner", "exact", "-o", "s.h5")
    assert made.code == 0, made.err
    before = here("show", "s.h5", "--json").json["numbers"]
    Path(ice).unlink()
    without = here("show", "s.h5", "--json").json["numbers"]
    assert without == {key: before[key] for key in without}
    assert here("fit", "s.h5", "-o", "f.h5").code == 0
    refused = here("transfer", "mean", "f.h5", "--targets", "3:5")
    assert (refused.code, "ice.jsonl cannot be read" in refused.err) == (2, True)


class Contexts(gymnasium.Env[int, int]):
    """An environment that takes contexts as CARL's do."""

    observation_space, action_space = gymnasium.spaces.Discrete(2), gymnasium.spaces.Discrete(2)

    def __init__(self, contexts: Any = None) -> None:
        self.contexts = contexts


def test_contexts_are_handed_whole_to_what_takes_them_and_by_feature_to_others(
    ice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = gymnasium.envs.registration.EnvSpec("qinit-contexts-v0", Contexts)
    monkeypatch.setitem(gymnasium.registry, spec.id, spec)
    Path("all.json").write_text(json.dumps({"a": {"success_rate": 0.5}, "b": {"success_rate": 0.6}}))
    whole = OwnTasks(file="all.json", env="qinit-contexts-v0", goal="terminated").opened()
    assert [each.partition("@")[0] for each in whole.vary] == ["contexts=file:all.json"]  # type: ignore[attr-defined]
    features = [each.partition("@")[0] for each in opened("all.json").vary or ()]
    assert features == ["success_rate=file:all.json"]


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("tasks", "ice.jsonl"), 2, "ice.jsonl holds rows; give --env ID"),
        (("tasks", "ice.jsonl", "--bins", 3), 2, "--bins is of an environment; give --env ID too"),
        (("tasks", "ice.jsonl", *LAKE, "--axes", "row=4,col=4"), 2, "--axes is of tables, and FrozenLake-v1"),
        (("tasks", "ice.jsonl", *LAKE, "--use", "3:9"), 2, "--use is '3:9', and there are 6 tasks"),
        (("tasks", "ice.jsonl", *LAKE, "--use", "soft"), 2, "or a label of its split: easy, hard"),
        (("tasks", "ice.jsonl", "--env", "Lake-v1"), 2, "gymnasium cannot make Lake-v1"),
        (("tasks", "ice.jsonl", *LAKE, "--set", "success_rate=1"), 2, "success_rate is varied or set twice"),
        (("tasks", "gone.jsonl", *LAKE), 2, "gone.jsonl cannot be read"),
        (("tasks", "colours.csv", *LAKE), 2, "FrozenLake-v1 has no colour"),
        (("tasks", "odd.csv", *LAKE), 2, "odd.csv has a column 'bad name', which is no argument's name"),
        (("tasks", "mdps.npz", *LAKE), 2, "takes rows, and mdps.npz has tables or maps"),
        (("tasks", ".", *LAKE), 2, "takes rows, and . has tables or maps"),
        (("gym", LAKE[1], "--use", "0:2"), 2, "nothing is varied by one"),
        (
            ("gym", LAKE[1], "--vary", "success_rate=file:ice.jsonl"),
            2,
            "has the split 'easy'; write source or target, or choose rows by --use",
        ),
        (
            ("gym", LAKE[1], *TWO_FILES, "--use", "0:2"),
            2,
            "ice.jsonl has 6 of them, maps.csv 2",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused_in_a_sentence(
    ice: str, here: Callable[..., Ended], words: tuple[Any, ...], code: int, told: str
) -> None:
    Path("colours.csv").write_text("colour\nred\nblue\n")
    Path("odd.csv").write_text("success_rate,bad name\n0.5,1\n")
    Path("maps.csv").write_text("map_name\n4x4\n8x8\n")
    ended = here("train-sources", *words)
    assert ended.code == code
    assert told in " ".join(ended.err.split())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("success_rate,success_rate\n0.5,0.6\n", "two columns have the same name"),
        ("split\nsmooth\nrough\n", "has the column split alone; give one of what varies"),
    ],
)
def test_headers_that_tell_no_values_are_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "rows.csv"
    path.write_text(text)
    with pytest.raises(UsageError, match=words):
        OwnTasks(file=str(path), env="FrozenLake-v1").opened()
