"""MushroomRL's own Q-learning, in its own GridWorld: its tables in, a start out, its learning curves back in, and a gain."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from qinit_cli.errors import NotAllowed
from qinit_cli.library import compare, fit, import_runs, import_tables

pytestmark = pytest.mark.soak

AGENT = """
import csv
import sys

import numpy as np
from mushroom_rl.algorithms.value import QLearning
from mushroom_rl.core import Core
from mushroom_rl.environments import GridWorld
from mushroom_rl.policy import EpsGreedy
from mushroom_rl.utils.callbacks import CollectDataset
from mushroom_rl.utils.parameters import Parameter


def learned(number, epsilon, episodes, start=None):
    np.random.seed(number)
    goal = tuple(int(at) for at in np.clip(np.rint(np.random.normal(7, 1.5, 2)), 2, 9))
    world = GridWorld(height=10, width=10, goal=goal, start=(0, 0))
    agent = QLearning(world.info, EpsGreedy(epsilon=Parameter(value=epsilon)), learning_rate=Parameter(value=0.2))
    if start is not None:
        agent.Q.table[:] = start.reshape(agent.Q.table.shape)
    steps = CollectDataset()
    Core(agent, world, [steps]).learn(n_episodes=episodes, n_steps_per_fit=1, quiet=True)
    return agent, steps.get()


if sys.argv[1] == "sources":
    agents = [learned(number, 0.7, 400)[0] for number in range(8)]
    np.savez("tables.npz", q=np.stack([agent.Q.table for agent in agents]))
    agents[0].save("agent.msh")
else:
    with open("curves.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["method", "task", "episode", "return"])
        for method in ("zero", "logqinit-median"):
            start = None if method == "zero" else np.load("start.npy")
            for number in range(10):
                episode, earned, discount = 0, 0.0, 1.0
                for _, _, reward, _, _, last in learned(1000 + number, 0.1, 30, start)[1]:
                    earned, discount = earned + discount * reward, discount * 0.9
                    if last:
                        rows.writerow([method, number, episode, earned])
                        episode, earned, discount = episode + 1, 0.0, 1.0
"""


def test_an_agent_of_mushroomrl_gains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", "mushroom-rl>=1.10,<1.11"], check=True)
    _gains(python)


def _gains(python: Path) -> None:
    import numpy as np

    Path("agent.py").write_text(AGENT)
    subprocess.run([python, "agent.py", "sources"], check=True)
    sources = import_tables("tables.npz", gamma=0.9, returns="0:10", axes="cell=100")
    with np.load("tables.npz") as theirs:
        assert sources["q"].tobytes() == theirs["q"].tobytes()
    with pytest.raises(NotAllowed, match="is a pickle"):
        import_tables("agent.msh", gamma=0.9)
    np.save("start.npy", fit(sources).start("logqinit-median"))
    subprocess.run([python, "agent.py", "targets"], check=True)
    runs = import_runs("curves.csv", gamma=0.9, returns="0:10")
    rows = {row["method"]: row for row in compare(runs).rows}
    with open("curves.csv") as file:
        earned = [float(row["return"]) for row in csv.DictReader(file) if row["method"] == "zero"]
    assert rows["zero"]["return"] == pytest.approx(sum(earned) / len(earned), rel=1e-12)
    assert rows["logqinit-median"]["difference_low"] > 0
