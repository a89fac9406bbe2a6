"""`qinit` with a quick scale of seconds instead of minutes, on fewer distributions; nothing else is changed.

python tiny.py reproduce fig6 --scale quick -o DIR
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from qinit_cli.__main__ import main
from qinit_cli.commands import reproduce

EDITS = (  # what stands in the paper's study -> what stands in the small one
    ("variance = [1, 3, 5, 7, 10]\n", "variance = 7\nsize = 6\n"),
    ('goals = "uniform"\n', 'goals = "uniform"\nsize = 6\n'),
    ("noise = [0.0002, 0.005, 0.01, 0.015, 0.02]\n", "noise = 0.01\nbins = 10\n"),
    ("noise = 0\n", "noise = 0\nbins = 10\n"),
    ("sources = { tasks = 40, episodes = 30_000 }\n", "sources = { tasks = 12, episodes = 300 }\n"),
    ("targets = { tasks = 40 }\n", "targets = { tasks = 4, episodes = 40 }\n"),
    ("sources = { tasks = 30, episodes = 50_000 }\n", "sources = { tasks = 10, episodes = 300 }\n"),
    ("targets = { tasks = 30 }\n", "targets = { tasks = 4, episodes = 30 }\n"),
    (
        "sources = { tasks = 10, episodes = 50_000, seed = [0, 1, 2] }\n",
        "sources = { tasks = 3, episodes = 300, seed = [0, 1] }\n",
    ),
    ("targets = { tasks = 10 }\n", "targets = { tasks = 2, episodes = 30 }\n"),
    ("first = 10\n", "first = 2\n"),
)


def small() -> str:
    """The paper's study with these edits, each of which must find something to change."""
    text = reproduce.FILE.read_text(encoding="utf-8")
    for there, instead in EDITS:
        assert there in text, there
        text = text.replace(there, instead)
    return text


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "paper.toml"
        file.write_text(small(), encoding="utf-8")
        reproduce.FILE = file
        main()
