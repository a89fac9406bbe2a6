"""Maps of the gridworld, several goals and slips by the cell, against quantecon, ways found by hand, and refusals."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quantecon.markov import DiscreteDP
from running import run_here

from qinit_cli.artefacts.settings import StoredFamily
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.grid_map import open_map, read_map
from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
from qinit_cli.kernels.gridworld import Gridworlds
from qinit_cli.kernels.random_streams import lane_seeds, seeds
from qinit_cli.pipeline.asked import LearningTargets
from qinit_cli.pipeline.sources import learn_sources, sequences
from qinit_cli.plots.heatmaps import HeatmapsPlot
from qinit_cli.plots.normality import NormalityPlot
from qinit_cli.plots.occupancy import OccupancyPlot
from qinit_cli.seeding import Stream
from qinit_cli.tasks import SourceTasks
from qinit_cli.watch import Watch

GAMMA = 0.9
UP, DOWN, LEFT, RIGHT = range(4)
WAYS = ((-1, 0), (1, 0), (0, -1), (0, 1))
# 2 start cells, one drawn three times as often; the hole can be walked around
ROOMS = "S..#...", "...#.H.", ".......", "#.##...", "3..#.G.", "...#..G"
ROOM = Gridworld(map="/".join(ROOMS))
PATCHY = Gridworld(map="/".join(ROOMS).replace("G", "."), goals="uniform", goals_per_task=2, slip_per="cell")
COUNT = 3


def drawn(family: Gridworld, count: int = COUNT) -> Any:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count))


def goals_of(task: Any) -> list[tuple[int, int]]:
    names = [name for name in task.dtype.names if name.startswith("goal_row")]
    return [(int(task[name]), int(task[name.replace("row", "col")])) for name in names]


def p_of(family: Gridworld, task: Any) -> Any:
    """The probability of the intended move in each cell, (rows, columns)."""
    if family.slip_per == "task":
        return np.full(family.shape, task["p"])
    stream = np.random.Generator(np.random.PCG64(int(task["p_seed"])))
    return stream.uniform(family.p_low, family.p_high, family.shape)


def model(family: Gridworld, task: Any) -> tuple[Any, Any]:
    """Rewards (S, 4) and transitions (S, 4, S) as the letters say; goals, walls and holes absorb."""
    rows, columns = family.shape
    p, goals = p_of(family, task), goals_of(task)
    rewards, flows = np.zeros((rows, columns, 4)), np.zeros((rows, columns, 4, rows, columns))
    for row, column, action in np.ndindex(rows, columns, 4):
        if ROOMS[row][column] in "#H" or (row, column) in goals:
            flows[row, column, action, row, column] = 1
            continue
        for way, (down, right) in enumerate(WAYS):
            odds = p[row, column] if way == action else (1 - p[row, column]) / 3
            there = row + down, column + right
            inside = 0 <= there[0] < rows and 0 <= there[1] < columns
            if not inside or ROOMS[there[0]][there[1]] == "#":
                there = row, column
            flows[(row, column, action, *there)] += odds
            rewards[row, column, action] += odds * (there in goals)
    cells = rows * columns
    return rewards.reshape(cells, 4), flows.reshape(cells, 4, cells)


@pytest.mark.parametrize("family", [ROOM, PATCHY], ids=["map", "goals and slips"])
def test_exact_tables_are_those_of_an_independent_solver(family: Gridworld) -> None:
    tasks = drawn(family)
    q, td_var = family.solve(tasks, GAMMA)
    starts = [0] + 3 * [4 * 7]
    learning = replace(family.target_learning, gamma=GAMMA, epsilon=0.2)
    exploring = family.exploring_value(tasks, q, learning)
    for at, task in enumerate(tasks):
        rewards, flows = model(family, task)
        value = DiscreteDP(rewards, flows, GAMMA).solve(method="policy_iteration").v
        np.testing.assert_allclose(q[at], rewards + GAMMA * flows @ value, rtol=0, atol=1e-9)
        assert family.start_value(q)[at] == pytest.approx(value[starts].mean(), abs=1e-9)
        goals = [row * 7 + column for row, column in goals_of(task)]
        worth = GAMMA * value
        worth[goals] = 1
        error = (worth[None, None] - q[at][..., None]) ** 2
        inside = q[at].any(axis=1)
        np.testing.assert_allclose(td_var[at][inside], (flows * error).sum(axis=2)[inside], atol=1e-9)
        best = q[at] == q[at].max(axis=1, keepdims=True)
        policy = 0.2 / 4 + 0.8 * best / best.sum(axis=1, keepdims=True)
        chain = np.einsum("sa,sat->st", policy, flows)
        worth = np.linalg.solve(np.eye(len(chain)) - GAMMA * chain, (policy * rewards).sum(axis=1))
        assert exploring[at] == pytest.approx(worth[starts].mean(), rel=1e-8)


@pytest.mark.parametrize("family", [ROOM, PATCHY], ids=["map", "goals and slips"])
def test_what_is_learned_comes_near_the_exact_tables(family: Gridworld) -> None:
    learning = replace(
        family.source_learning, episodes=60_000, horizon=200, gamma=GAMMA, epsilon=1.0, alpha=0.003
    )
    _, rows = learn_sources(SourceTasks(family, "q-learning", learning, 0), np.arange(COUNT), Watch())
    exact, _ = family.solve(drawn(family), GAMMA)
    found = rows["q"].reshape(exact.shape)
    np.testing.assert_allclose(found, exact, rtol=0, atol=0.05)
    assert np.median(np.abs(found - exact)[exact > 0] / exact[exact > 0]) < 0.02
    visited = rows["visits"].reshape(exact.shape).any(axis=2)
    np.testing.assert_array_equal(visited, exact.any(axis=2))  # every open cell, no wall, hole or goal


def test_a_world_with_a_slip_for_each_cell_that_is_always_the_same_learns_the_same_bits() -> None:
    learning = replace(ROOM.source_learning, episodes=300, horizon=100)
    tasks, moves, starts = drawn(ROOM), ROOM.grid.moves, ROOM.grid.starts
    goal = tasks["goal_row"] * 7 + tasks["goal_col"]
    plain = Gridworlds(moves, goal, tasks["p"], starts)
    patchy = Gridworlds(moves, goal[:, None], np.tile(tasks["p"][:, None], len(moves)), starts)
    dice, begins, plays = (sequences(0, Stream(number), np.arange(COUNT)) for number in (1, 2, 6))
    streams = LaneStreams(lane_seeds(dice), seeds(begins), seeds(plays))
    records = Records(300, evaluate_every=10)
    one, other = (
        learn(worlds, learning, Start(np.zeros((len(moves), 4))), streams, records, Watch())
        for worlds in (plain, patchy)
    )
    for name in ("q", "steps", "reached", "evaluation_steps", "evaluation_reached"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert 0 < other.evaluation_reached.mean() < 1


def test_paths_and_nearness_follow_the_ways_of_a_maze() -> None:
    family = Gridworld(map="S..#/##.#/#..#/#.##/#..G", p_low=1.0, p_high=1.0)
    tasks = drawn(family, 1)
    q, _ = family.solve(tasks, GAMMA)
    ways = {(0, 0): 9, (0, 1): 8, (0, 2): 7, (1, 2): 6, (2, 2): 5, (2, 1): 4, (3, 1): 3, (4, 1): 2, (4, 2): 1}
    cells = [row * 4 + column for row, column in ways]
    lengths = family.path_lengths(tasks, q, 100)[0]
    greedy = lengths[np.arange(20), q[0].argmax(axis=1)]
    assert greedy[cells].tolist() == list(ways.values())
    assert (lengths[[3, 4, 16]] == -1).all()  # in walls
    assert (lengths[19] == 0).all()
    for linear, near in (
        (True, 1 - np.array(list(ways.values())) / 9),
        (False, 0.5 ** np.array([*ways.values()])),
    ):
        found = family.nearness(tasks, 0.5, linear=linear)[0]
        np.testing.assert_allclose(found[cells], near, rtol=1e-15)
        assert (found[19], found[3]) == (1, 0)
    visits = family.visits(tasks, q, 100)[0]
    np.testing.assert_array_equal(np.flatnonzero(visits), sorted([*cells, 19]))
    assert not family.visits(tasks, q, 8).any()
    assert family.solved(tasks, q, 9).all()
    assert not family.solved(tasks, q, 8).any()


def test_a_path_into_a_hole_never_arrives() -> None:
    family = Gridworld(map="SHG/...", p_low=0.9, p_high=0.9)
    into = np.zeros((1, 6, 4))
    into[0, :, RIGHT] = 1
    tasks = drawn(family, 1)
    assert family.path_lengths(tasks, into, 10)[0, 0].tolist() == [-1, -1, -1, -1]
    assert not family.visits(tasks, into, 10).any()
    q, _ = family.solve(tasks, GAMMA)
    assert q[0, 0].argmax() == DOWN


def test_goals_are_drawn_among_the_cells_that_a_map_allows() -> None:
    counts = Counter(place for task in drawn(ROOM, 400) for place in goals_of(task))
    assert set(counts) == {(4, 5), (5, 6)}
    assert abs(counts[4, 5] - 200) < 60  # six deviations
    normal = replace(PATCHY, goals="normal", goals_per_task=1, variance=4.0)
    places = {place for task in drawn(normal, 400) for place in goals_of(task)}
    assert all(ROOMS[row][column] in ".G" for row, column in places)
    chances = normal.goal_chances()
    assert chances.sum() == pytest.approx(1)
    assert {divmod(int(cell), 7) for cell in np.flatnonzero(chances)} >= places
    assert all(len(set(goals_of(task))) == 2 for task in drawn(PATCHY, 50))


def test_an_open_map_is_the_open_grid() -> None:
    square, mapped = Gridworld(size=6), Gridworld(map="/".join(["......"] * 6))
    assert mapped.grid == open_map(6)
    np.testing.assert_array_equal(drawn(square, 50), drawn(mapped, 50))
    square, spread = (
        Gridworld(size=6, slip_per="cell", p_low=0.7, p_high=0.7),
        Gridworld(size=6, p_low=0.7, p_high=0.7),
    )
    tasks = drawn(square)
    as_one = np.array([(*goals_of(task)[0], 0.7) for task in tasks], drawn(spread).dtype)
    np.testing.assert_array_equal(square.solve(tasks, GAMMA)[0], spread.solve(as_one, GAMMA)[0])


def test_an_artefact_holds_the_rows_and_reads_no_file(tmp_path: Path) -> None:
    file = tmp_path / "rooms.txt"
    file.write_text("\r\n".join(ROOMS).replace(".", "F") + "\r\n")
    read = Gridworld(map=file)
    assert read == ROOM
    stored = StoredFamily.of(read).spec()
    assert stored["map"] == "/".join(ROOMS)
    assert StoredFamily.read(stored).here == ROOM
    assert not {"map", "slip_per", "goals_per_task"} & StoredFamily.of(Gridworld()).spec().keys()
    with pytest.raises(ValueError, match="--map has"):
        StoredFamily.read(stored | {"map": str(file)})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"map": "S.x/..."}, "--map has 'x' in row 0, column 2; a cell is # (wall)"),
        ({"map": "S.../..."}, "--map has 4 cells in row 0 and 3 in row 1; give all rows as many"),
        ({"map": "S..."}, "--map has 1 rows of 4 cells; it takes 2 to 1000 of both"),
        ({"map": ""}, "--map has 0 rows of 0 cells"),
        ({"map": "#../..."}, "--map has no start, and its first cell is not free; mark a start by S"),
        ({"map": "SS/S#"}, "--map has no free cell for a goal beside its starts; mark one by . or G"),
        ({"map": "S.#./..#."}, "--map has no way from the start (0, 0) to the cell (0, 3); open one"),
        ({"map": "S.H/.HG"}, "--map has no way from the start (0, 0) to the cell (1, 2)"),
        ({"map": "S./..", "size": 2}, "--size 2: the map has a size of its own; leave out --size or --map"),
        ({"map": "SG/GG", "goals_per_task": 4}, "--goals-per-task 4: there are 3 places for goals; ask for fewer"),
        ({"map": "SG/..", "mean": 1.0}, "--mean belongs to normal goals"),
        ({"map": "SG../....", "goals": "normal", "mean": 3.0, "variance": 0.01}, "less than once in 100 draws"),
        ({"size": 4, "variance": 0.0, "goals_per_task": 2}, "for the last of 2 goals; choose a larger variance or fewer goals"),
    ],
    ids=lambda value: "" if isinstance(value, str) else str(value.get("map", "")),
)  # fmt: skip
def test_what_cannot_be_is_refused_in_a_sentence(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError) as refusal:  # noqa: PT011  # the words are compared below
        Gridworld(**options)
    assert words in str(refusal.value)


def test_a_path_has_no_probability_where_cells_slip_on_their_own() -> None:
    tasks = drawn(PATCHY, 1)
    with pytest.raises(NotAllowed, match="--slip-per cell"):
        PATCHY.log_path(tasks, np.ones((1, 42, 4), np.int32))


def test_targets_may_have_another_map_of_the_same_shape() -> None:
    walled = "/".join(ROOMS).replace("...#.H.", "...#...")
    assert LearningTargets(shift=[f"map={walled}"]).family(ROOM) == Gridworld(map=walled)
    assert LearningTargets(shift=["map=S../..."]).family(Gridworld(map="S.#/...")).grid.shape == (2, 3)
    with pytest.raises(UsageError, match="of a 6 x 7 grid, the map has 2 x 3 cells"):
        LearningTargets(shift=["map=S../..."]).family(ROOM)
    opened = LearningTargets(shift=["map=S#./.../..."]).family(Gridworld(size=3))
    assert opened.grid == read_map("S#./.../...")


def test_the_command_line_reads_a_file_and_pictures_show_what_stands_there(tmp_path: Path) -> None:
    file = tmp_path / "rooms.txt"
    file.write_text("\n".join(ROOMS))
    here = "--store", str(tmp_path / "store")
    made = run_here(
        ["train-sources", "gridworld", "--map", file, "--learner", "exact", "--tasks", "30", *here]
    )
    fit = run_here(["fit", made.path, *here])
    shown = run_here(["show", fit.path, "--format", "table"])
    assert "X wall" in shown.out
    assert "O hole" in shown.out
    assert "? unknown" not in shown.out
    for plot, path in ((HeatmapsPlot, fit.path), (OccupancyPlot, made.path), (NormalityPlot, fit.path)):
        axes = plot().drawn([path]).figure.axes
        labels = " ".join(f"{each.get_xlabel()} {each.get_ylabel()}" for each in axes)
        assert "; brown: wall; pink: hole" in " ".join(labels.split())
        _, walls, hole = axes[0].images
        np.testing.assert_array_equal(
            ~walls.get_array().mask, [[cell == "#" for cell in row] for row in ROOMS]
        )
        np.testing.assert_array_equal(np.argwhere(~hole.get_array().mask), [[1, 5]])
        assert "unknown" not in labels
        assert "no source" not in labels
        assert "not testable" not in labels
    missing = run_here(["train-sources", "gridworld", "--map", tmp_path / "no.txt", *here])
    assert missing.code == 2
    assert missing.err.endswith("no.txt cannot be read: No such file or directory\n")
