"""Evidence from artefacts: what is kept of each, and what it is said to be evidence of."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourceSet, SourcesSettings
from qinit_cli.claims.setting import GRIDWORLD
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.fitted import FitOptions
from qinit_cli.learners.exploration import Ucb
from qinit_cli.learners.traces import SarsaLambda
from qinit_cli.methods import METHODS
from qinit_cli.paper import settings as paper_settings
from qinit_cli.paper.verdicts import evidence, verdicts
from qinit_cli.schedules import Linear
from qinit_cli.tasks import SourceTasks, TargetTasks
from qinit_store.reading import Artefact, open_artefact

Run = Callable[..., Any]
SMALL = ("--size", 8, "--variance", 2, "--tasks", 12, "--learner", "exact")


def _opened(paths: list[Path]) -> Iterator[Artefact]:
    for path in paths:
        with open_artefact(path) as artefact:
            yield artefact


@pytest.fixture(scope="module")
def artefacts(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Two source sets of a small grid, their fits and a run of three methods each; zero once."""
    import contextlib
    import io

    from qinit_cli.app import run

    store = str(tmp_path_factory.mktemp("verdicts"))

    def made(*arguments: object) -> Path:
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            assert run([*map(str, arguments), "--store", store, "-q"]) == 0
        return Path(out.getvalue().strip())

    found = {}
    for seed in (0, 1):
        sources = made("train-sources", "gridworld", *SMALL, "--seed", seed)
        fit = made("fit", sources, "--eopl-normality", "rounded")
        found |= {f"sources {seed}": sources, f"fit {seed}": fit}
        for method in ("zero", "ucoi", "logqinit-median")[0 if seed == 0 else 1 :]:
            found[f"{method} {seed}"] = made("transfer", method, fit, "--tasks", 5, "--episodes", 30)
    return found


def test_runs_become_averages_by_source_set(artefacts: dict[str, Path]) -> None:
    found = evidence(_opened(list(artefacts.values())))
    [(setting, scores)] = found.scores.items()
    assert (setting.family, setting.distribution, setting.full) == (GRIDWORLD, "variance 2", False)
    assert setting.variant == "size 8, exact sources, source tasks 12, target episodes 30, target tasks 5"
    assert {label: arm.averages.shape for label, arm in scores.arms.items()} == {
        "zero": (1, 5),
        "ucoi": (2, 5),
        "logqinit-median": (2, 5),
    }
    with open_artefact(artefacts["ucoi 0"]) as run:
        steps, reached = run.read("steps"), run.read("reached")
    returns = np.where(reached, 0.95 ** (steps - 1.0), 0.0).mean(axis=1)
    places = [place[1] for place in scores.arms["ucoi"].places]
    with open_artefact(artefacts["sources 0"]) as sources:
        row = places.index(sources.content_sha256)
    assert scores.arms["ucoi"].averages[row] == pytest.approx(returns)
    assert scores.shared


def test_sources_leave_the_values_of_the_states_shown_in_order(artefacts: dict[str, Path]) -> None:
    [sets] = evidence(_opened([artefacts["sources 0"], artefacts["sources 1"]])).values.values()
    assert len(sets) == 2
    with open_artefact(artefacts["sources 0"]) as sources:
        q = sources.read("q")[:, 0, 0]
    greedy = q.mean(axis=0).argmax()
    assert sets[0].places == ("(0, 0)", "(5, 5)", "(7, 7)")
    assert sets[0].positive[0] == pytest.approx(np.sort(q[:, greedy]))


def test_fits_leave_their_tests_and_maps(artefacts: dict[str, Path]) -> None:
    found = evidence(_opened([artefacts["fit 0"]]))
    [[tested]], [[maps]] = found.tested.values(), found.maps.values()
    with open_artefact(artefacts["fit 0"]) as fit:
        assert np.array_equal(tested.p.reshape(8, 8, 4), fit.read("eopl_normality_p"), equal_nan=True)
        expected = np.exp(fit.read("mu"))
    assert maps.starts["logqinit-median"] == pytest.approx(np.nan_to_num(expected).max(axis=2))
    probabilities = Gridworld(size=8, variance=2).goal_chances()
    inside = probabilities[tested.among_goals]
    assert inside.sum() >= 0.95 > inside.sum() - inside.min()


def test_the_same_artefact_twice_counts_once(artefacts: dict[str, Path]) -> None:
    once, twice = (evidence(_opened(list(artefacts.values()) * times)) for times in (1, 2))
    assert [len(sets) for sets in once.values.values()] == [len(sets) for sets in twice.values.values()]
    assert verdicts(once) == verdicts(twice)


def test_small_evidence_judges_nothing_but_the_arithmetic(artefacts: dict[str, Path]) -> None:
    found = verdicts(evidence(_opened(list(artefacts.values()))))
    assert [verdict.claim for verdict in found] == [f"C{number}" for number in range(1, 14)]
    assert {verdict.verdict for verdict in found[:-1]} == {"not judged"}
    assert "variance 2, size 8" in found[3].details[0].label


def _sources(family: Any, learner: str = "q-learning", count: int = 100, **changes: Any) -> SourcesSettings:
    learning = replace(family.source_learning, **changes)
    return SourcesSettings.of(SourceTasks(family, learner, learning, 0), count)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("family", "distribution"),
    [
        (Gridworld(), "variance 7"),
        (Gridworld(variance=10), "variance 10"),
        (Gridworld(goals="uniform"), "uniform goals"),
        (MountainCar(noise=0.0002), "noise 0.0002"),
    ],
)
def test_the_papers_settings_differ_in_nothing(family: Any, distribution: str) -> None:
    setting = paper_settings.of_sources(_sources(family))
    assert (setting.distribution, setting.variant, setting.full) == (distribution, "", True)
    fitted = FitSettings.of(_sources(family), "hash", FitOptions())
    assert paper_settings.of_fit(fitted) == setting


@pytest.mark.parametrize(
    ("told", "variant", "full"),
    [
        (_sources(Gridworld(), "exact"), "exact sources", True),
        (_sources(Gridworld(), gamma=0.9, horizon=500), "gamma 0.9, horizon 500", True),
        (_sources(Gridworld(), episodes=10), "episodes 10", False),
        (
            _sources(Gridworld(), alpha=Linear(1.0, 0.1, 9), explore=Ucb(0.2)),
            "alpha linear:1.0:0.1:9, explore ucb:c=0.2",
            True,
        ),
        (_sources(Gridworld(), count=30), "source tasks 30", False),
        (_sources(Gridworld(), count=300), "source tasks 300", True),
        (_sources(Gridworld(size=10)), "size 10", False),
        (_sources(Gridworld(mean=10)), "mean 10", True),
        (_sources(MountainCar(noise_is="variance")), "noise is variance", True),
    ],
)
def test_what_differs_from_the_paper_is_told_and_whether_it_is_smaller(
    told: SourcesSettings, variant: str, full: bool
) -> None:
    setting = paper_settings.of_sources(told)
    assert (setting.variant, setting.full) == (variant, full)


def _run(family: Gridworld, source: SourcesSettings, **changes: Any) -> tuple[RunSettings, SourceSet]:
    targets = TargetTasks(family, replace(family.target_learning, **changes), 0, keep_q=False)
    fitted = FitSettings.of(source, "hash", FitOptions(estimator="umvue"))
    run = RunSettings.of(METHODS["zero"](), targets, 200, "hash", fitted)
    return run, run.source_set


def test_a_run_tells_what_differs_in_its_sources_its_fit_and_its_targets() -> None:
    run, sources = _run(Gridworld(), _sources(Gridworld(), gamma=0.9), gamma=0.9, epsilon=0.2)
    assert paper_settings.of_run(run, sources).variant == "gamma 0.9, estimator umvue, target epsilon 0.2"
    assert paper_settings.of_run(run, None).variant == "target gamma 0.9, target epsilon 0.2"
    run, sources = _run(Gridworld(), _sources(Gridworld()), learner=SarsaLambda(0.5))
    assert paper_settings.of_run(run, None).variant == "target learner sarsa-lambda:lambda=0.5"


def test_a_shifted_run_tells_where_its_sources_come_from() -> None:
    run, sources = _run(Gridworld(variance=10), _sources(Gridworld()))
    setting = paper_settings.of_run(run, sources)
    assert (setting.distribution, setting.variant) == (
        "variance 10",
        "estimator umvue, sources of gridworld-variance-7",
    )


@pytest.mark.parametrize("variance", [1.0, 7.0])
def test_chances_of_far_goals_keep_their_tails(variance: float) -> None:
    probabilities = Gridworld(variance=variance).goal_chances().reshape(30, 30)
    edges = (np.arange(31) - 0.5 - 20) / np.sqrt(variance)
    line = stats.norm.cdf(edges[1:]) - stats.norm.cdf(edges[:-1])
    line[21:] = (stats.norm.sf(edges[:-1]) - stats.norm.sf(edges[1:]))[21:]
    assert probabilities[5] / probabilities[20] == pytest.approx(np.full(30, line[5] / line[20]), rel=1e-9)
