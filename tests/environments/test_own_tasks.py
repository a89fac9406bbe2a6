"""Tasks of one's own: exact tables by quantecon and by hand, who is source and who target, and what is refused."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quantecon.markov import DiscreteDP
from running import Ended

import qinit_cli as qinit
from qinit_cli.environments.family import draw_tasks, task_count
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.own_tasks import OwnTasks
from qinit_cli.environments.task_ranges import picked, written
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.seeding import Stream

MAPS = Path(__file__).parent / "maps"
GAMMA = 0.9
TASKS, STATES, ACTIONS = 6, 5, 3
RNG = np.random.default_rng(7)
P = RNG.dirichlet(np.ones(STATES), (TASKS, STATES, ACTIONS))
P[:, :, 0, :] = np.roll(np.eye(STATES), 1, axis=1)  # rows with fewer outcomes than others
R = RNG.normal(size=P.shape)


@pytest.fixture
def archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Writes an archive into a folder of the test's own, which is the current one."""
    monkeypatch.chdir(tmp_path)

    def write(name: str = "mdps.npz", **arrays: Any) -> str:
        np.savez(name, **arrays)
        return name

    return write


def opened(file: str, **settings: Any) -> OwnTasks:
    return OwnTasks(file=file, **settings).opened()


def exact(family: OwnTasks) -> Any:
    """Q* (N, S, A) of all sources."""
    count = task_count(family, "source", None)
    q, _ = family.solve(draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count)), GAMMA)
    return q


def values_of(p: Any, reward: Any) -> Any:
    """V* of one task by quantecon."""
    return DiscreteDP(reward, p, GAMMA).solve(method="policy_iteration").v


def test_exact_tables_are_quantecons(archive: Callable[..., str]) -> None:
    q = exact(opened(archive(P=P, R=R)))
    for task in range(TASKS):
        value = values_of(P[task], (P[task] * R[task]).sum(axis=2))
        np.testing.assert_allclose(q[task].max(axis=1), value, rtol=0, atol=1e-9)


def test_dense_and_listed_transitions_are_the_same_tasks(archive: Callable[..., str]) -> None:
    after = np.broadcast_to(np.arange(STATES), P.shape)
    mean = (P * R).sum(axis=3)
    np.testing.assert_allclose(
        exact(opened(archive(P=P, R=mean))),
        exact(
            opened(archive("listed.npz", after=after, chance=P, R=np.broadcast_to(mean[..., None], P.shape)))
        ),
        rtol=0,
        atol=1e-12,
    )


def test_large_arrays_are_read_as_small_ones(
    archive: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = exact(opened(archive(P=np.asfortranarray(P), R=R)))
    monkeypatch.setattr("qinit_cli.task_files.reading.MAPPED_BYTES", 1)
    mapped = exact(opened(archive("mapped.npz", P=np.asfortranarray(P), R=R, start=np.eye(STATES)[2])))
    np.testing.assert_array_equal(plain, mapped)


def test_goals_are_worth_1_on_entering_them(archive: Callable[..., str]) -> None:
    goal = np.eye(STATES)[[4, 3, 4, 3, 4, 3]]
    q = exact(opened(archive(P=P, goal=goal)))
    for task in range(TASKS):
        end = int(goal[task].argmax())
        stays, pays = P[task].copy(), P[task][:, :, end].copy()
        stays[end], pays[end] = np.eye(STATES)[end], 0
        there = np.arange(STATES) != end
        np.testing.assert_allclose(
            q[task].max(axis=1)[there], values_of(stays, pays)[there], rtol=0, atol=1e-9
        )
        assert not q[task, end].any()


CHAIN = np.array([[[0, 1], [0, 2], [2, 2], [3, 3]]])  # left and right of 0 1 2; nothing leads to 3


def chain(**more: Any) -> dict[str, Any]:
    return {"after": CHAIN[..., None], **more}


@pytest.mark.parametrize(
    ("arrays", "value"),
    [
        (chain(), [GAMMA, 1, 0, 0]),  # an absorbing state is an end, and without marks the goal
        (chain(terminal=[0, 0, 1, 0]), [GAMMA, 1, 0, 0]),
        (chain(goal=[0, 1, 0, 0]), [1, 0, 0, 0]),
        (chain(goal=[0, 0, 0, 1], R=np.eye(1, 8, 3).reshape(1, 4, 2)), [GAMMA, 1, 0, 0]),
        (chain(R=np.eye(1, 8, 3).reshape(1, 4, 2) * 5), [5 * GAMMA, 5, 0, 0]),
        ({"transitions": [[0, 1], [0, -1]], "rewards": [[0.0, 0], [0, 2]]}, [2 * GAMMA, 2]),
    ],
)
def test_episodes_end_in_goals_terminal_and_absorbing_states(
    archive: Callable[..., str], arrays: dict[str, Any], value: list[float]
) -> None:
    q = exact(opened(archive(**{key: np.asarray(each) for key, each in arrays.items()})))
    np.testing.assert_allclose(q[0].max(axis=1), value, rtol=0, atol=1e-9)


def test_ends_that_pay_nothing_are_no_goals_where_others_pay(archive: Callable[..., str]) -> None:
    reward = np.zeros((2, 3, 2))
    reward[0, 0, 1], reward[1, 0, 1] = 1.0, -1.0
    after = np.broadcast_to(np.array([[0, 2], [1, 1], [2, 2]]), (2, 3, 2))
    family = opened(archive(after=after[..., None], R=reward))
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(2))
    assert family.tables(tasks).after[:, 0, 1, 0].tolist() == [-1, -2]
    assert family.solved(tasks, np.tile([0.0, 1.0], (2, 3, 1)), 10).tolist() == [
        True,
        True,
    ]  # the other has no goal


def test_a_map_is_worth_gamma_to_the_steps_that_are_left() -> None:
    family = opened(str(MAPS), use="0:1")
    value = exact(family)[0].max(axis=1).reshape(3, 4)
    steps = np.array([[5, 4, 3, 4], [4, np.inf, 2, np.inf], [3, 2, 1, np.inf]])
    np.testing.assert_allclose(value, np.where(np.isinf(steps), 0, GAMMA ** (steps - 1)), atol=1e-12)
    assert family.actions == ("up", "down", "left", "right")
    assert [(axis.name, len(axis.values)) for axis in family.axes()] == [("row", 3), ("col", 4)]


def test_each_task_starts_where_it_is_told(archive: Callable[..., str]) -> None:
    start = np.eye(STATES)[[0, 1, 2, 3, 4, 0]]
    start[5] = 1 / STATES
    sources = qinit.train_sources(
        opened(archive(P=P, R=R, start=start), use="0:2"), learner="exact", gamma=GAMMA
    )
    run = qinit.transfer("zero", qinit.fit(sources), targets="2:6", episodes=3)
    best = exact(opened("mdps.npz", use="2:6")).max(axis=2)
    np.testing.assert_allclose(run["v_star"], (best * start[2:]).sum(axis=1), rtol=1e-12)
    assert run["file_task"].tolist() == [2, 3, 4, 5]
    assert sources["file_task"].tolist() == [0, 1]


def test_learned_tables_come_to_the_exact_ones(archive: Callable[..., str]) -> None:
    family = opened(archive(P=P, R=R), use="0:2")
    made = qinit.train_sources(
        family, episodes=4_000, horizon=100, gamma=GAMMA, alpha="visits:0.7", epsilon=0.9
    )
    width = family.payment(GAMMA).bounds.width  # type: ignore[union-attr]
    assert np.abs(made["q"] - exact(family)).max() < 0.01 * width


BAD_ROW, NOT_A_NUMBER, ENDLESS = P.copy(), P.copy(), R.copy()
BAD_ROW[3, 2, 1] *= 0.5
NOT_A_NUMBER[1, 4, 2, 0] = np.nan
ENDLESS[0, 0, 1, 1] = np.inf


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        (
            {"P": BAD_ROW, "R": R},
            "action 1 in state 2 of task 3 of bad.npz has probabilities that sum to 0.5, not 1",
        ),
        (
            {"P": NOT_A_NUMBER, "R": R},
            "action 2 in state 4 of task 1 of bad.npz leads to state 0 with probability nan",
        ),
        ({"P": -P, "R": R}, "which is none"),
        ({"P": P, "R": ENDLESS}, "action 1 in state 0 of task 0 of bad.npz pays inf"),
        ({"P": P[:, :, :, :4]}, r"P of shape \(6, 5, 3, 4\), not \(N, S, A, S\)"),
        ({"P": P, "R": R[:3]}, r"R of shape \(3, 5, 3, 5\); beside P of shape \(6, 5, 3, 5\)"),
        ({"P": P, "R": R, "Q": R}, "'Q', which is no array of tasks"),
        ({"R": R}, "transitions are P, after and chance, or transitions and rewards"),
        ({"P": P, "after": P}, "one of the three"),
        ({"P": P, "R": R, "start": np.full(STATES, 0.1)}, "no distribution: its probabilities sum to 0.5"),
        ({"P": P, "goal": np.eye(STATES)[0]}, "starts in state 0, where an episode ends"),
        ({"P": P, "goal": np.full(STATES, 2)}, "other values than true and false"),
        ({"after": CHAIN[..., None] + 7}, "leads to state 7, and there are 4"),
        ({"P": P.astype("U8")}, "not of numbers"),
        ({"P": P.astype(object)}, "no archive of numpy's arrays that can be read"),
        ({"P": P}, "no task of bad.npz has a goal"),
    ],
)
def test_what_cannot_be_learned_is_refused_by_its_place(
    archive: Callable[..., str], arrays: dict[str, Any], told: str
) -> None:
    with pytest.raises((NotAllowed, UsageError), match=told):
        opened(archive("bad.npz", **arrays))


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"use": "0:7"}, "there are 6 tasks, 0:6"),
        ({"use": "4:4"}, "4:4 holds no task"),
        ({"use": "0:2,1:3"}, "names task 1 twice"),
        ({"use": "fold:3/2"}, "K from 1 to N"),
        ({"use": "late"}, "or a label of its split: early, target"),
        ({"axes_": "a=2,b=3"}, "are 6 states, and the tasks of mdps.npz have 5"),
        ({"actions_": "a,b"}, "are 2, and the tasks of mdps.npz have 3"),
    ],
)
def test_tasks_and_names_that_are_not_there_are_refused(
    archive: Callable[..., str], settings: dict[str, str], told: str
) -> None:
    file = archive(P=P, R=R, split=["early"] * 4 + ["target"] * 2)
    with pytest.raises(UsageError, match=told):
        opened(file, **settings)


STORED: dict[str, Any] = {
    "file": "mdps.npz",
    "use": "0:2",
    "axes_": "state=5",
    "actions_": "a,b",
    "reward": "native",
    "sha256": "0" * 64,
    "count": 3,
    "paid": [-1.0, 0.0, 0.0, 1.0],
}


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"sha256": "no digest"}, "no SHA-256"),
        ({"count": 10**9}, "a file holds 1 to 1000000 tasks"),
        ({"use": "0:4"}, "there are 3 tasks"),
        ({"targets": "2:9"}, "there are 3 tasks"),
        ({"axes_": "state=99999999"}, "more states than"),
        ({"actions_": "a,a"}, "write distinct names in ASCII"),
        ({"paid": [1.0, 0.0, 0.0, 1.0]}, "the least reward stands before the largest"),
        ({"paid": [0.0, float("nan"), 0.0, 1.0]}, "these are four numbers"),
        ({"reward": None}, "are set once a file was opened"),
    ],
)
def test_stored_settings_that_no_file_can_have_are_refused(changed: dict[str, Any], told: str) -> None:
    OwnTasks(**STORED)
    with pytest.raises(ValueError, match=told):
        OwnTasks(**STORED | changed)


def test_a_fold_keeps_its_name_and_many_ranges_have_a_short_one(archive: Callable[..., str]) -> None:
    many = 60
    file = archive(after=np.tile(CHAIN[..., None], (many, 1, 1, 1)), split=["in", "out"] * (many // 2))
    fold, labelled = opened(file, use="fold:2/5"), opened(file, use="in")
    assert (fold.use, fold.label, fold.available("target")) == ("fold:2/5", "tasks-mdps-fold-2-5", 12)
    assert labelled.use is not None
    assert labelled.use.startswith("0:1,2:3,4:5,")
    assert re.fullmatch("tasks-mdps-30-of-60-[0-9a-f]{8}", labelled.label)


@pytest.mark.parametrize(
    ("text", "tasks"),
    [
        ("2:4", [2, 3]),
        (":2", [0, 1]),
        ("4:", [4, 5]),
        ("4:6,0:1", [4, 5, 0]),
        ("fold:2/3", [0, 2, 3, 5]),
        ("b", [1, 5]),
    ],
)
def test_a_text_means_tasks_and_they_are_written_again(text: str, tasks: list[int]) -> None:
    assert picked(text, 6, ("a", "b", "a", "a", "a", "b")) == tasks
    assert picked(written(tasks), 6) == tasks


def test_targets_are_those_that_are_no_sources_or_those_named(archive: Callable[..., str]) -> None:
    family = opened(archive(P=P, R=R, split=["train", "test"] * 3), use="train")
    assert family.use == "0:1,2:3,4:5"
    for targets, held in ((None, [1, 3, 5]), ("test", [1, 3, 5]), ("5:6,1:2", [5, 1])):
        chosen = family.holding_out(targets, allow_overlap=False)
        drawn = draw_tasks(chosen, 0, Stream.TARGET_TASK, np.arange(task_count(chosen, "target", None)))
        assert drawn["file_task"].tolist() == held
        assert chosen == family  # the distribution is the same
    with pytest.raises(
        UsageError, match="--tasks is 4, and tasks-mdps-0-1-2-3-4-5-reward-native has 3 sources"
    ):
        task_count(family, "source", 4)


def test_a_task_in_both_halves_is_refused_unless_that_is_allowed(archive: Callable[..., str]) -> None:
    twins = P.copy()
    twins[4] = twins[1]
    family = opened(archive(P=twins, R=R[:, :, :, 0] * 0 + np.arange(STATES)[:, None]), use="0:3")
    with pytest.raises(UsageError, match=r"task 2 of mdps\.npz would be source and target"):
        family.holding_out("2:4", allow_overlap=False)
    with pytest.raises(UsageError, match="task 4 and task 1, which are equal"):
        family.holding_out(None, allow_overlap=False)
    assert family.holding_out("2:5", allow_overlap=True).targets == "2:5"
    assert family.holding_out("3:4", allow_overlap=False).targets == "3:4"
    with pytest.raises(UsageError, match=r"all 6 tasks of mdps\.npz are sources"):
        replace(family, use="0:6").holding_out(None, allow_overlap=False)
    with pytest.raises(UsageError, match="gridworld draws its tasks, and --targets"):
        Gridworld().holding_out("0:2", allow_overlap=False)


def test_an_artefact_is_shown_without_its_file_and_nothing_is_learned_from_another(
    here: Callable[..., Ended],
) -> None:
    np.savez("mdps.npz", P=P, R=R)
    assert (
        here("train-sources", "tasks", "./mdps.npz", "--use", "0:3", "--episodes", 5, "-o", "s.h5").code == 0
    )
    assert here("fit", "s.h5", "-o", "f.h5").code == 0
    before = here("show", "s.h5", "--json").json["numbers"]
    Path("mdps.npz").rename("elsewhere.npz")
    without = here("show", "s.h5", "--json").json["numbers"]
    assert set(before) - set(without) >= {"start_value_median", "median_relative_error"}
    assert without == {key: before[key] for key in without}
    missing = here("transfer", "mean", "f.h5", "--targets", "3:6")
    assert (missing.code, "the tasks stand in mdps.npz, and there is no such file here" in missing.err) == (
        4,
        True,
    )
    np.savez("mdps.npz", P=P, R=-R)
    changed = here("transfer", "mean", "f.h5", "--targets", "3:6")
    assert (changed.code, "mdps.npz has changed since" in changed.err) == (4, True)
    shutil.copy("elsewhere.npz", "mdps.npz")
    assert here("transfer", "mean", "f.h5", "--targets", "3:6", "--episodes", 5).code == 0
    refused = here("transfer", "mean", "f.h5", "--shift", "use=1:2")
    assert (refused.code, "nothing can be shifted" in refused.err) == (2, True)


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("g.txt", "S.G\n..\n", "has 3 cells in row 0 and 2 in row 1"),
        ("g.txt", "S.G\n.x.\n", "'x' in row 1, column 1"),
        ("g.txt", "#.G\n...\n", "has no start, and its first cell is not free"),
        ("g.txt", "S..\n...\n", "has no goal; mark one by G"),
        ("g.txt", "S.G\n...\n", "has 2 x 3 rows and columns, and a.txt 3 x 4"),
        ("g.npz", "", "holds both .npz and .txt files"),
    ],
)
def test_a_folder_holds_maps_of_one_size(tmp_path: Path, name: str, text: str, told: str) -> None:
    shutil.copytree(MAPS, tmp_path / "maps")
    (tmp_path / "maps" / name).write_text(text)
    with pytest.raises((NotAllowed, UsageError), match=told):
        opened(str(tmp_path / "maps"))


def test_a_folder_of_archives_is_the_archive_of_their_tasks(
    archive: Callable[..., str], tmp_path: Path
) -> None:
    (tmp_path / "mdps").mkdir()
    for task in range(3):
        archive(f"mdps/{task}.npz", P=P[task], R=R[task])
    np.testing.assert_array_equal(exact(opened("mdps")), exact(opened(archive(P=P[:3], R=R[:3]))))


def test_no_axis_has_a_name_of_a_column_or_dimension() -> None:
    for name in ("q", "mean", "file_task"):
        with pytest.raises(ValueError, match=f"--axes has the name {name}, which artefacts use"):
            OwnTasks(file="mdps.npz", axes_=f"{name}=5")


def test_solved_sources_are_fitted_without_the_file(here: Callable[..., Ended]) -> None:
    np.savez("mdps.npz", P=P, R=R)
    sources = here("train-sources", "tasks", "mdps.npz", "--use", "0:4", "--learner", "exact").path
    Path("mdps.npz").unlink()
    fit = here("fit", sources)
    assert fit.code == 0, fit.err
    refused = here("transfer", "zero", fit.path)
    assert refused.code in (2, 4)
    assert "mdps.npz" in refused.err


def test_tasks_that_differ_in_rewards_alone_are_equal_where_these_do_not_count(
    archive: Callable[..., str],
) -> None:
    goal = np.eye(STATES)[[4] * TASKS]
    path = archive(P=np.broadcast_to(P[:1], P.shape), R=R, goal=goal)
    assert opened(path, use="0:3").holding_out("3:5", allow_overlap=False).targets == "3:5"
    with pytest.raises(UsageError, match="which are equal"):
        opened(path, use="0:3", reward="goal").holding_out("3:5", allow_overlap=False)
