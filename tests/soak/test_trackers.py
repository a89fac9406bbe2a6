"""Runs in MLflow, Weights & Biases and TensorBoard, read back by these themselves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.soak

ROOT = Path(__file__).parents[2]
READ_BACK = """
import json, math, sys
from pathlib import Path

import numpy as np
import qinit_cli as qinit
from qinit_cli.__main__ import main

def logged(*words):
    sys.argv = ["qinit", "log", "run.h5", *words]
    assert main() == 0

family = qinit.families.gridworld(size=4, variance=1)
fit = qinit.fit(qinit.train_sources(family, tasks=5, learner="exact"))
run = qinit.transfer("mean", fit, tasks=3, episodes=1200, evaluate_every=400, output="run.h5")
returns = run.returns().mean(axis=0)
greedy = run["eval_return"].mean(axis=0)
average = run.returns().mean()

def check(curve, evaluations, parameters, content, summary, tolerance):
    np.testing.assert_allclose(curve, returns, rtol=tolerance)
    np.testing.assert_allclose(evaluations, greedy, rtol=tolerance)
    assert float(parameters["learning.gamma"]) == 0.95 and parameters["method.name"] == "mean"
    assert content == run.digest
    assert math.isclose(summary, average, rel_tol=tolerance)
"""
READERS = {
    "tensorboard": """
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.plugin_data_pb2 import HParamsPluginData

for _ in range(2):
    logged("--to", "tensorboard", "-o", "events")
[file] = Path("events").glob("qinit/run-*/*tfevents*")
there = EventAccumulator(str(file), size_guidance={"scalars": 0})
there.Reload()
value = {name: [one.value for one in there.Scalars(name)] for name in there.Tags()["scalars"]}
assert [one.step for one in there.Scalars("greedy_return")] == [0, 400, 800, 1200]
kept = HParamsPluginData.FromString(there.SummaryMetadata("_hparams_/session_start_info").plugin_data.content)
told = kept.session_start_info.hparams
plain = {name: one.string_value or one.number_value for name, one in told.items()}
check(value["return"], value["greedy_return"], plain, plain["content_sha256"], value["average_return"][0], 1e-6)
""",
    "mlflow": """
from mlflow import MlflowClient

for _ in range(2):
    logged("--to", "mlflow", "-o", "sqlite:///runs.db", "--project", "mine")
client = MlflowClient("sqlite:///runs.db")
[there] = client.search_runs([client.get_experiment_by_name("mine").experiment_id])
assert (there.info.status, there.info.run_name) == ("FINISHED", "run")
curve = sorted((one.step, one.value) for one in client.get_metric_history(there.info.run_id, "return"))
evaluated = sorted((one.step, one.value) for one in client.get_metric_history(there.info.run_id, "greedy_return"))
assert [step for step, _ in curve] == list(range(1200)) and [step for step, _ in evaluated] == [0, 400, 800, 1200]
check(
    [value for _, value in curve], [value for _, value in evaluated], there.data.params,
    there.data.tags["qinit.content_sha256"], there.data.metrics["average_return"], 1e-12,
)
""",
    # its file is a log of LevelDB's form: blocks of 32 KiB, records in pieces with a header of 7 bytes
    "wandb": """
from wandb.proto.wandb_internal_pb2 import Record

def records(content):
    at, whole = 7, b""
    while at + 7 <= len(content):
        if (left := 32768 - at % 32768) < 7:
            at += left
            continue
        size, kind = int.from_bytes(content[at + 4 : at + 6], "little"), content[at + 6]
        whole += content[at + 7 : at + 7 + size]
        at += 7 + size
        if kind in (1, 4):
            yield Record.FromString(whole)
            whole = b""

for _ in range(2):
    logged("--to", "wandb", "-o", "kept")
[file] = Path("kept/wandb").glob("offline-run-*/*.wandb")
rows, config, summary = [], {}, {}
for one in records(file.read_bytes()):
    for item in one.run.config.update:
        config[item.key] = json.loads(item.value_json)
    for item in one.summary.update:
        summary[item.key or item.nested_key[0]] = json.loads(item.value_json)
    if one.HasField("history"):
        rows.append({(item.key or item.nested_key[0]): json.loads(item.value_json) for item in one.history.item})
curve = [row["return"] for row in rows if "return" in row]
evaluated = {row["_step"]: row["greedy_return"] for row in rows if "greedy_return" in row}
assert [row["_step"] for row in rows] == list(range(1201)) and list(evaluated) == [0, 400, 800, 1200]
check(curve, list(evaluated.values()), config, config["content_sha256"], summary["average_return"], 1e-12)
""",
}


@pytest.mark.parametrize("tracker", READERS)
def test_a_tracker_reads_back_what_was_logged_once(tracker: str, tmp_path: Path) -> None:
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
    subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--editable", f"{ROOT}[{tracker}]"], check=True
    )
    ended = subprocess.run(
        [python, "-c", READ_BACK + READERS[tracker]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr[-3000:]
