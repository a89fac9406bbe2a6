"""The page on deep agents works as it stands, and its reader gives what tables and tiles hold."""

from __future__ import annotations

import importlib
import itertools
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from ready import Ready
from running import Ended

from qinit_cli.environments.gym import Gym
from qinit_cli.tile_coding import TileCoding

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "deep.md").read_text()
READER = ROOT / "examples" / "deep" / "start_function.py"
LONGEST = 40  # lines of the reader
POLE = ("CartPole-v1", "--goal", "survived", "--bins", "2,3,4,5", "--range", "1=-2:2", "--range", "3=-2:2")


@pytest.fixture(scope="module")
def reader() -> Callable[[str], Any]:
    [block] = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {}
    exec(block, names)
    read: Callable[[str], Any] = names["StartFunction"]
    return read


def _started(here: Callable[..., Ended], *sources: object) -> Any:
    for command in (
        ("train-sources", *sources, "--tasks", 2, "--episodes", 60, "-o", "sources.h5"),
        ("fit", "sources.h5", "-o", "fit.h5"),
        ("start", "mean", "fit.h5", "-o", "start.npz"),
    ):
        ended = here(*command)
        assert ended.code == 0, ended.err
    with np.load("start.npz") as file:
        return dict(file)


def test_the_page_shows_the_reader_of_the_example() -> None:
    assert f"```python\n{READER.read_text()}```\n" in PAGE
    assert READER.read_text().count("\n") <= LONGEST


def test_the_commands_of_the_page_work(
    tmp_path: Path, ready: Ready, reader: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    commands = "".join(re.findall(r"^```sh\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL))
    small = commands.replace("--tasks 20 --episodes 100000", "--tasks 2 --episodes 100")
    assert small != commands
    environment = os.environ | {"PATH": f"{ready.folder}{os.pathsep}{os.environ['PATH']}"}
    ended = subprocess.run(
        ["bash", "-e", "-c", small], env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    start = reader("start.npz")
    assert (start.actions, start.gamma) == (["left", "none", "right"], 0.99)
    assert start([-0.5, 0.0]).shape == (1, 3)


def test_bins_of_a_box_are_those_of_their_edges(
    here: Callable[..., Ended], reader: Callable[[str], Any]
) -> None:
    held = _started(here, "mountain-car", "--bins", 6, "--reward", "step")
    table = held["start"] = np.random.default_rng(0).normal(size=(6, 6, 3))
    np.savez("start.npz", **held)
    start = reader("start.npz")
    states = np.array(list(itertools.product(held["position"], held["velocity"])))
    np.testing.assert_array_equal(start(states).reshape(table.shape), table)
    anywhere = np.random.default_rng(1).uniform((-1.5, -0.1), (1.0, 0.1), (500, 2))  # also beyond the box
    inner = [np.linspace(*ends, 7)[1:-1] for ends in ((-1.2, 0.6), (-0.07, 0.07))]
    rows, columns = (np.digitize(anywhere[:, place], inner[place]) for place in (0, 1))
    np.testing.assert_array_equal(start(anywhere), table[rows, columns])


def test_bins_of_gymnasium_are_those_that_were_learned(
    here: Callable[..., Ended], reader: Callable[[str], Any]
) -> None:
    held = _started(here, "gym", *POLE, "--horizon", 20)
    table = held["start"] = np.random.default_rng(0).normal(size=(2, 3, 4, 5, 2))
    np.savez("start.npz", **held)
    family = Gym("CartPole-v1", goal="survived", bins="2,3,4,5", range=["1=-2:2", "3=-2:2"])
    observed = np.random.default_rng(1).uniform(-6, 6, (300, 4)).astype(np.float32)
    wanted = table.reshape(-1, 2)[[family._seen.state(row) for row in observed]]
    np.testing.assert_array_equal(reader("start.npz")(observed), wanted)


def test_numbered_states_are_read_by_their_numbers(
    here: Callable[..., Ended], reader: Callable[[str], Any]
) -> None:
    table = _started(here, "gridworld", "--size", 4, "--variance", 1)["start"]
    cells = np.array(list(itertools.product(range(4), range(4))))
    np.testing.assert_array_equal(reader("start.npz")(cells).reshape(table.shape), table)


@pytest.mark.parametrize("tilings", [1, 3, 8])
@pytest.mark.parametrize("dimensions", [1, 2, 4])
def test_tiles_are_the_sums_of_active_weights(
    tmp_path: Path, reader: Callable[[str], Any], tilings: int, dimensions: int
) -> None:
    rng = np.random.default_rng(0)
    low = rng.normal(size=dimensions)
    high = low + rng.uniform(0.1, 3.0, dimensions)
    coding = TileCoding(tuple(low.tolist()), tuple(high.tolist()), tilings, 5)
    weights = rng.normal(size=(coding.weights, 3))
    box = {"low": low, "high": high, "tilings": np.array(tilings), "tiles": np.array(5)}
    told = {"start": np.zeros((7, 3)), "action": np.array(["a", "b", "c"]), "gamma": np.array(0.9)}
    np.savez(tmp_path / "start.npz", weights=weights, **box, **told)
    states = np.concatenate([rng.uniform(low - 1, high + 1, (400, dimensions)), [low, high]])
    wanted = weights[coding.active(states)].sum(axis=1)
    np.testing.assert_allclose(reader(str(tmp_path / "start.npz"))(states), wanted, rtol=0, atol=1e-12)


def test_a_pushed_car_is_pushed_on_the_right_hill_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(READER.parent))
    pushed_car = importlib.import_module("pushed_car")
    plain: Any = gymnasium.make("MountainCar-v0").unwrapped
    pushed: Any = pushed_car.PushedCar(0.1)
    for position, moved in ((-0.3, 0.0), (0.1, 0.1), (0.45, 0.1)):
        plain.state = pushed.state = (position, 0.03)
        wanted, *_ = plain.step(2)
        found, reward, done, *_ = pushed.step(2)
        np.testing.assert_allclose(found, [min(wanted[0] + moved, 0.6), wanted[1]], rtol=1e-6)
        assert (reward, done) == (-1.0, position == 0.45)


def test_what_has_no_bins_and_what_is_no_number_is_refused(
    here: Callable[..., Ended], reader: Callable[[str], Any]
) -> None:
    held = _started(here, "gridworld", "--size", 4, "--variance", 1)
    with pytest.raises(ValueError, match="not finite"):
        reader("start.npz")([np.nan, 0.0])
    np.savez("start.npz", **held | {"low": np.array([np.nan, -0.5])})
    with pytest.raises(ValueError, match="no bins of one width"):
        reader("start.npz")
