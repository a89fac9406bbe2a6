"""The store knows no kind of artefact of its own: kinds are registered from outside; without any it keeps what it is given."""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import sys
import tokenize
from pathlib import Path

import numpy as np
import pytest
from fakes import make_fit, make_sources

import qinit_store
from qinit_store import kinds
from qinit_store.errors import NotOurs
from qinit_store.reading import open_artefact
from qinit_store.schema import Axis, Column, Schema, digest_axis, digest_column
from qinit_store.work import open_work

FILES = sorted(Path(qinit_store.__file__).parent.glob("*.py"))
# of reinforcement learning, or of the program that uses the store
FOREIGN = (
    "episode|epsilon|gamma|alpha|horizon|reward|policy|policies|greedy|learner|td|eopl|visits|potential|hypothes[ei]s|"
    "gridworld|mountain|lognormal|normality|estimator|methods|tuning|tunings|transfer|train|train-sources|state_axes|action"
)
KINDS = {"sources", "fit", "run", "tuning"}

ALONE = """
import json, sys
from pathlib import Path
import numpy as np
from qinit_store.catalog import Store
from qinit_store.mend import salvage
from qinit_store.reading import open_artefact
from qinit_store.schema import Axis, Column, Schema, digest_axis, digest_column
from qinit_store.verify import verify
from qinit_store.work import open_work

store = Store(Path(sys.argv[1]))
schema = Schema("letters", (digest_axis(),), (Column("weight", ("task",), "f8"), digest_column()))
path = store.path_for("letters", "some", {"tasks": 3})
with open_work(path, schema, {"tasks": 3}) as work:
    work.save({"weight": np.arange(3.0)}, np.arange(3))
    work.finish(np.arange(3))
with open_artefact(path, "letters") as artefact:
    weights = artefact.read("weight").tolist()
entries = {f"{entry.path.parent.name}/{entry.path.stem}": (entry.kind, entry.state) for entry in store.entries()}
print(json.dumps([weights, entries, [verify(entry.path).state for entry in store.entries()],
                  any(name.startswith("qinit_cli") for name in sys.modules)]))
"""


def test_a_store_alone_keeps_lists_and_verifies_artefacts_of_any_kind(tmp_path):
    make_sources(tmp_path / "sources" / "a.h5")
    make_fit(tmp_path / "fit" / "b.h5")
    command = [sys.executable, "-c", ALONE, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    weights, entries, states, ours = json.loads(done.stdout)
    [letters] = [name for name in entries if name.startswith("letters/some-")]
    assert weights == [0.0, 1.0, 2.0]
    assert entries == {
        "fit/b": ["fit", "done"],
        letters: ["letters", "done"],
        "sources/a": ["sources", "done"],
    }
    assert states == ["sound"] * 3
    assert not ours


def test_where_kinds_are_registered_another_is_not_ours(tmp_path, monkeypatch):
    schema = Schema(
        "letters", (Axis("byte", digest_axis().values),), (Column("weight", ("task",), "f8"), digest_column())
    )
    path = tmp_path / "a.h5"
    monkeypatch.setattr(kinds, "REGISTERED", {})
    with open_work(path, schema, {"tasks": 1}) as work:
        work.save({"weight": np.ones(1)}, np.arange(1))
        work.finish(np.arange(1))
    monkeypatch.undo()
    with pytest.raises(NotOurs, match="no artefact that this qinit knows: its format is 'qinit/letters'"):
        open_artefact(path)


@pytest.mark.parametrize("name", ["", "Fit", "part/fit", "1", "a" * 65])
def test_a_kind_whose_name_cannot_stand_in_a_file_is_refused(name, monkeypatch):
    monkeypatch.setattr(kinds, "REGISTERED", {})
    with pytest.raises(ValueError, match="no name for a kind"):
        kinds.register(name, "folder", "maker", lambda schema, part: "")
    assert not kinds.REGISTERED


@pytest.mark.parametrize("path", FILES, ids=[path.name for path in FILES])
def test_no_word_of_learning_stands_in_the_store(path):
    text = path.read_text()
    words = " ".join(
        token.string
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type in (tokenize.NAME, tokenize.STRING, tokenize.COMMENT)
    )
    found = set(re.findall(rf"(?<![a-z])(?:{FOREIGN})(?![a-z])", words.lower()))
    literals = {node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)}
    assert (
        not found
        | {one for one in literals if isinstance(one, str)} & KINDS
        | {name for name in (*(f"{kind}_schema" for kind in KINDS), "MAKERS", "FOLDERS") if name in text}
    )
