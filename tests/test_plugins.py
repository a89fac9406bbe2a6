"""The example plug-in, installed: a family with a compiled step of its own, and a method, in every command."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from ready import Ready, started

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.methods import METHODS
from qinit_cli.pipeline.asked import LearningSources, LearningTargets
from qinit_cli.pipeline.machine import Machine
from qinit_cli.study.foresight import Foresight
from qinit_cli.study.planned import PlannedFit, PlannedRun, PlannedSources

ROOT = Path(__file__).parents[1]
EXAMPLE = Path(__file__).parent / "example_plugin"
SMALL = ("--length", "8", "--tasks", "5", "--episodes", "300")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the plug-in is installed in, and nothing else."""
    folder = tmp_path_factory.mktemp("installed")
    copy = shutil.copytree(EXAMPLE, folder / "source", ignore=shutil.ignore_patterns("__pycache__"))
    offline = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check", "-q")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", *offline, "--target", folder / "site", copy],
        check=True,
        capture_output=True,
        timeout=120,
    )
    return folder / "site"


def run(words: list[str], folder: Path, *paths: Path) -> subprocess.CompletedProcess[str]:
    found = os.pathsep.join([str(ROOT), *map(str, paths)])
    return _ended([sys.executable, *words], folder, PYTHONPATH=found)


def _ended(
    words: Sequence[str | Path], folder: Path, stdin: str = "", **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words,
        env={name: value for name, value in os.environ.items() if not name.startswith("QINIT_")}
        | environment,
        cwd=folder,
        input=stdin,
        capture_output=True,
        text=True,
        timeout=300,
    )


@dataclass(frozen=True)
class Made:
    """What the plug-in's family and method left in a store, and qinit with and without it."""

    folder: Path
    sources: str
    fit: str
    runs: str  # a path a line
    hopeful: str  # a run from one of two source sets
    other: str  # a run of cautious from the other
    said: str
    with_it: Callable[..., subprocess.CompletedProcess[str]]
    without: Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def made(site: Path, ready: Ready, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Made]:
    with started(tmp_path_factory.mktemp("ready"), PYTHONPATH=str(site)) as plugged:
        yield _made(plugged.qinit, ready.qinit, tmp_path_factory.mktemp("plugged"))


def _made(plugged: Path, plain: Path, folder: Path) -> Made:
    said = []

    def with_it(*words: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
        return _ended([plugged, *words], folder, stdin)

    def path(*words: str) -> str:
        ended = with_it(*words)
        assert ended.returncode == 0, ended.stderr
        said.append(ended.stderr)
        return ended.stdout.strip()

    sources = path("train-sources", "corridor", *SMALL)
    fit = path("fit", sources, "--holdout", "2")
    runs = [path("transfer", name, fit, "--tasks", "4", "--episodes", "50") for name in ("zero", "cautious")]
    runs.append(path("transfer", "ptrs", fit, "--tasks", "4", "--episodes", "50", "--init", "cautious"))
    hopeful = path("transfer", "hopeful", fit, "--tasks", "4", "--episodes", "50")
    second = path("fit", path("train-sources", "corridor", *SMALL, "--seed", "1"), "--holdout", "2")
    other = path("transfer", "cautious", second, "--tasks", "4", "--episodes", "50")
    return Made(
        folder,
        sources,
        fit,
        "\n".join(runs),
        hopeful,
        other,
        "".join(said),
        with_it,
        lambda *words, stdin="": _ended([plain, *words], folder, stdin),
    )


def told(ended: subprocess.CompletedProcess[str]) -> Any:
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def test_both_subcommands_have_their_own_help(made: Made) -> None:
    assert "corridor" in made.with_it("train-sources", "-h").stdout
    assert "cautious" in made.with_it("transfer", "-h").stdout
    family, method = (
        made.with_it("train-sources", "corridor", "-h"),
        made.with_it("transfer", "cautious", "-h"),
    )
    assert "Cells of the corridor." in family.stdout
    assert "Standard deviations below the mean." in method.stdout
    assert family.stderr == method.stderr == ""


def test_the_whole_pipeline_runs_and_compares(made: Made) -> None:
    rows = told(made.with_it("compare", "-", "--json", stdin=made.runs))["rows"]
    assert [row["method"] for row in rows] == ["zero", "cautious", "ptrs+cautious"]
    assert "relative error against exact tables" in made.said
    assert "warning" not in made.said


def test_one_run_of_what_reads_no_sources_serves_every_source_set(made: Made) -> None:
    runs = [made.runs.splitlines()[1], made.other, made.hopeful]
    rows = told(made.with_it("compare", *runs, "--baseline", "hopeful", "--json"))["rows"]
    assert {row["method"]: row["sets"] for row in rows} == {"cautious": 2, "hopeful": 1}
    [cautious] = [row for row in rows if row["method"] == "cautious"]
    assert cautious["difference"] is not None
    # where the plug-in is not installed its file does not say so
    unknown = told(made.without("compare", *runs, "--baseline", "hopeful", "--json"))["rows"]
    assert [row["difference"] for row in unknown if row["method"] == "cautious"] == [None]


def test_pictures_draw_it_as_it_says(made: Made) -> None:
    names = [*made.runs.splitlines()[:2], made.hopeful]
    ended = made.with_it("plot", "curves", *names, "-o", "curves.svg")
    assert ended.returncode == 0, ended.stderr
    assert "#123456" in (made.folder / "curves.svg").read_text().lower()


def test_a_plot_of_its_own_is_drawn_as_ours_are(made: Made) -> None:
    ended = made.with_it("plot", "effort", made.sources, "--log", "-o", "effort.svg")
    assert (ended.returncode, ended.stdout) == (0, "effort.svg\n"), ended.stderr
    assert "Steps of 5 sources" in (made.folder / "effort.svg").read_text()
    assert "Draw steps on a logarithmic axis." in made.with_it("plot", "effort", "-h").stdout
    assert made.without("plot", "effort", made.sources).returncode == 2


def test_verdicts_pass_over_what_no_claim_is_about(made: Made) -> None:
    ended = made.with_it("verdicts", *made.runs.splitlines(), made.hopeful, "--json")
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr.count("passed over") >= 1


def test_what_a_run_would_take_is_estimated_as_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLE))
    hopeful = importlib.import_module("qinit_corridor.hopeful").Hopeful()
    sources = PlannedSources(Gridworld(size=6, variance=2), LearningSources(tasks=4, episodes=50))
    run = PlannedRun(PlannedFit(sources), hopeful, LearningTargets(tasks=3, episodes=20))
    usual = replace(run, method=METHODS["zero"]())  # which reads no sources either
    one, other = Foresight(Machine(jobs=1)).expected([run, usual]).values()
    assert one.steps > 0
    assert one == other


def test_the_exact_learner_and_a_shift_work(made: Made) -> None:
    exact = made.with_it("train-sources", "corridor", "--length", "8", "--tasks", "3", "--learner", "exact")
    assert exact.returncode == 0, exact.stderr
    shifted = made.with_it("transfer", "zero", made.fit, "--tasks", "2", "--shift", "slip=0.4")
    assert shifted.returncode == 0, shifted.stderr
    refused = made.with_it("transfer", "zero", made.fit, "--tasks", "2", "--shift", "length=9")
    assert refused.returncode == 2
    assert "the tables have (8,) states, with another length (9,)" in refused.stderr


def test_without_a_distance_drs_is_one_sentence(made: Made) -> None:
    ended = made.with_it("transfer", "drs", made.fit)
    assert ended.returncode == 4
    assert ended.stderr.splitlines()[-1].startswith("qinit: corridor has no distance to its goal")


def test_the_plug_ins_version_is_in_the_provenance_and_in_no_hash(made: Made) -> None:
    for artefact in (made.sources, made.fit, *made.runs.splitlines()):
        shown = told(made.with_it("show", artefact, "--json"))
        assert shown["provenance"]["plug-in corridor"] == "qinit-corridor 0.1.0"
        assert "0.1.0" not in json.dumps(shown["spec"])
    assert shown["provenance"]["plug-in cautious"] == "qinit-corridor 0.1.0"


def test_without_the_plug_in_what_it_made_can_be_read(made: Made) -> None:
    artefacts = [made.sources, made.fit, *made.runs.splitlines()]
    assert {row["family"] for row in told(made.without("list", "--json"))["rows"]} == {"corridor"}
    assert made.without("verify", *artefacts).returncode == 0
    for artefact in artefacts:
        assert told(made.without("show", artefact, "--json"))["provenance"]["plug-in corridor"]
    rows = told(made.without("compare", "-", "--json", stdin=made.runs))["rows"]
    there = told(made.with_it("compare", "-", "--json", stdin=made.runs))["rows"]
    assert [row["return"] for row in rows] == [row["return"] for row in there]
    assert rows[1]["remark"] == "not installed here"


@pytest.mark.parametrize("words", [("fit", "SOURCES"), ("transfer", "zero", "FIT")])
def test_where_the_family_is_needed_the_missing_plug_in_is_named(words: tuple[str, ...], made: Made) -> None:
    given = {"SOURCES": made.sources, "FIT": made.fit}
    ended = made.without(*(given.get(word, word) for word in words))
    assert (ended.returncode, ended.stdout) == (4, "")
    assert ended.stderr == (
        "qinit: the family corridor is not installed here; it came with qinit-corridor 0.1.0: "
        "pip install qinit-corridor\n"
    )


def test_salvage_and_merge_keep_what_made_the_tasks(made: Made) -> None:
    whole = made.without("salvage", made.sources, "-o", "salvaged.h5").stdout.strip()
    assert told(made.without("show", whole, "--json"))["provenance"]["plug-in corridor"]


LEARNED = """
import numpy as np
from qinit_cli.environments import FAMILIES
from qinit_cli.environments.family import draw_tasks
from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
from qinit_cli.watch import Watch
from qinit_cli.kernels.random_streams import lane_seeds, seeds
from qinit_cli.learning import Learning
from qinit_cli.seeding import Stream
from qinit_cli.pipeline.sources import sequences

family, some = FAMILIES["corridor"](length=9), np.arange(3)
tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, some)
own = sequences(0, Stream.SOURCE_WORLD, some)
streams = LaneStreams(lane_seeds(sequences(0, Stream.SOURCE_DICE, some)), seeds(sequences(0, Stream.SOURCE_START, some)))
learning = Learning(alpha=0.1, gamma=0.9, epsilon=0.3, episodes=200, horizon=50, start="anywhere")
by_step, by_table = (
    learn(worlds, learning, Start(np.zeros((9, 2))), streams, Records(1), Watch())
    for worlds in (family.worlds(tasks, own), family.tables(tasks).worlds(seeds(own)))
)
print(np.array_equal(by_step.q, by_table.q), int(by_step.step_count.sum()))
"""


def test_a_step_of_ones_own_learns_what_its_table_learns_and_is_compiled_anew_when_any_of_its_files_changes(
    site: Path, tmp_path: Path
) -> None:
    same, steps = run(["-c", LEARNED], tmp_path, site).stdout.split()
    assert same == "True"
    other = shutil.copytree(site, tmp_path / "site")
    walking = other / "qinit_corridor" / "walking.py"
    walking.write_text(walking.read_text().replace("cell + steps", "cell + 2 * steps"))
    changed, fewer = run(["-c", LEARNED], tmp_path, other).stdout.split()
    assert changed == "False"
    assert int(fewer) < int(steps)
    walking.write_text(walking.read_text().replace("cell + 2 * steps", "cell + steps"))
    assert run(["-c", LEARNED], tmp_path, other).stdout.split() == [same, steps]


def test_our_own_kernels_are_found_compiled_whatever_is_plugged_in(site: Path, tmp_path: Path) -> None:
    folder = "from qinit_cli.kernels.compiled import cache_folder; print(cache_folder())"
    inside = "import qinit_corridor; from qinit_cli.kernels.compiled import cache_folder as c; print(c('qinit_corridor.kernel'))"
    assert run(["-c", folder], tmp_path, site).stdout == run(["-c", folder], tmp_path).stdout
    assert run(["-c", inside], tmp_path, site).stdout != run(["-c", folder], tmp_path).stdout


def test_the_contract_tests_ask_whoever_is_installed(site: Path, tmp_path: Path) -> None:
    wanted = "corridor-cautious or gridworld-cautious or (corridor and a_method_is_zero and ptrs)"
    ended = run(
        ["-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", wanted, str(ROOT / "tests/test_contract.py")],
        ROOT,
        site,
    )
    assert ended.returncode == 0, ended.stdout
    assert (
        "corridor"
        in run(
            ["-m", "pytest", "--collect-only", "-q", str(ROOT / "tests/test_contract.py")], ROOT, site
        ).stdout
    )


def test_a_learner_of_a_plug_in_learns_in_our_worlds_as_in_its_own(made: Made) -> None:
    def learned(fit: str, learner: str) -> list[str]:
        few = ("--tasks", "3", "--episodes", "40", "--learner", learner)
        ended = made.with_it("transfer", "zero", fit, *few)
        assert ended.returncode == 0, ended.stderr
        rows = made.with_it("export", ended.stdout.strip(), "--to", "csv", "--what", "episodes").stdout
        return [row.partition(",")[2] for row in rows.splitlines()]  # without the run's name

    exact = ("--size", "4", "--tasks", "3", "--learner", "exact")
    grid = made.with_it("fit", made.with_it("train-sources", "gridworld", *exact).stdout.strip())
    for fit in (made.fit, grid.stdout.strip()):
        usual = learned(fit, "q-learning")
        assert learned(fit, "mellow:share=0") == usual
        assert learned(fit, "mellow:share=1") != usual
    # the machine code that is kept knows nothing of a plug-in that is gone
    ended = made.without("transfer", "mean", grid.stdout.strip(), "--tasks", "3", "--episodes", "41")
    assert ended.returncode == 0, ended.stderr


def test_the_page_about_plug_ins_shows_the_example_as_it_is() -> None:
    page = (ROOT / "docs" / "plugins.md").read_text()
    shown = re.findall(r"^```(?:python|toml)\n(.*?)\n```$", page, re.MULTILINE | re.DOTALL)
    files = [
        path.read_text().rstrip()
        for path in (EXAMPLE / "pyproject.toml", *EXAMPLE.rglob("qinit_corridor/*.py"))
    ]
    assert len(shown) == 8
    assert [block for block in shown if block not in files] == []
