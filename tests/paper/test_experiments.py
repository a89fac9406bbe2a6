"""The paper's experiments as a study: every figure has one, at the paper's sizes, and nothing is asked for twice."""

from __future__ import annotations

from functools import cache

import pytest

from qinit_cli.commands.reproduce import FILE, SHOWS
from qinit_cli.environments.family import task_count
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.study.planned import (
    Artefact,
    PlannedFit,
    PlannedJudgement,
    PlannedPicture,
    PlannedRun,
    PlannedSources,
    PlannedTable,
    inputs,
    ordered,
)
from qinit_cli.study.reading import Study
from qinit_cli.study.showing import family_of, sources_of

CONTRACT = ("fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "figA1", "figA2", "figA3")
GRIDS = (*(Gridworld(variance=variance) for variance in (1, 3, 5, 7, 10)), Gridworld(goals="uniform"))
CARS = tuple(MountainCar(noise=noise) for noise in (0.0002, 0.005, 0.01, 0.015, 0.02))


@cache
def _study(scale: str | None = None, sets: int | None = None) -> Study:
    return Study.read(FILE, scale, sets)


def _needed(target: str, scale: str | None = None, sets: int | None = None) -> tuple[Artefact, ...]:
    return ordered(_study(scale, sets).only([target]).artefacts)


def _runs(target: str) -> list[PlannedRun]:
    return [one for one in _needed(target) if isinstance(one, PlannedRun)]


def _pictures(name: str, scale: str | None = None) -> list[PlannedPicture]:
    return [one for one in _study(scale).only([name]).shown if isinstance(one, PlannedPicture)]


def _tables(name: str) -> list[PlannedTable]:
    return [one for one in _study().only([name]).shown if isinstance(one, PlannedTable)]


def _labels(target: str, family: object) -> set[str]:
    return {one.method.label for one in _runs(target) if one.family == family}


def _source_sizes(one: PlannedSources) -> tuple[int, int]:
    """Tasks and episodes."""
    learning = one.learning.learning(type(one.family))
    return task_count(one.family, "source", one.learning.tasks), learning.episodes


def _target_sizes(one: PlannedRun) -> tuple[int, int]:
    """Tasks and episodes."""
    episodes = one.learning.episodes or one.family.target_learning.episodes
    return task_count(one.family, "target", one.learning.tasks), episodes


def _judged(name: str) -> PlannedJudgement:
    [judged] = [one for one in _study().only([name]).shown if isinstance(one, PlannedJudgement)]
    return judged


def test_every_figure_of_the_contract_an_environment_and_all_can_be_asked_for() -> None:
    study = _study()
    figures = list(dict.fromkeys(one.figure for one in study.shown if not isinstance(one, PlannedJudgement)))
    assert sorted(figures) == sorted(CONTRACT)
    assert set(SHOWS) == {*CONTRACT, "gridworld", "mountain-car", "all"}
    assert set(study.parts) == {"gridworld", "mountain-car", "all"}
    assert (
        sorted(study.parts["gridworld"] + study.parts["mountain-car"])
        == sorted(study.parts["all"])
        == sorted(CONTRACT)
    )


@pytest.mark.parametrize("name", CONTRACT)
def test_every_figure_has_pictures_with_titles_and_captions_of_their_own(name: str) -> None:
    pictures = _pictures(name)
    assert pictures
    assert all(picture.name.startswith(name) and picture.title and picture.caption for picture in pictures)
    assert not any(mark in f"{picture.title}{picture.caption}" for picture in pictures for mark in "{}")


def test_no_two_files_of_everything_share_a_name() -> None:
    pictures = [picture.name for name in CONTRACT for picture in _pictures(name)]
    tables = [table.name for name in CONTRACT for table in _tables(name)]
    assert len(set(pictures)) == len(pictures)
    assert len(set(tables)) == len(tables)


def test_the_paper_s_sources_are_its_hundred_tasks_of_its_episodes_on_its_eleven_distributions() -> None:
    sources = [
        one
        for one in _needed("all")
        if isinstance(one, PlannedSources) and one.family != MountainCar(noise=0)
    ]
    grids = [one for one in sources if one.family.name == "gridworld"]
    cars = [one for one in sources if one.family.name == "mountain-car"]
    assert {_source_sizes(one) for one in grids} == {(100, 100_000)}
    assert {_source_sizes(one) for one in cars} == {(100, 500_000)}
    assert {one.learning.seed for one in sources} == {0}
    assert len(sources) == 11
    assert {one.family for one in grids} == set(GRIDS)
    assert {one.family for one in cars} == set(CARS)


def test_figure_6_needs_every_initialisation_on_every_distribution_and_every_transfer_method_on_variance_7() -> (
    None
):
    initialisations = {
        "zero",
        "mean",
        "maxqinit",
        "ucoi",
        "logqinit-median",
        "logqinit-mean",
        "logqinit-quantile",
        "optimal",
    }
    plus = {
        f"{method}+{init}{setting}"
        for init in ("logqinit-median", "logqinit-mean")
        for method, setting in (("ptrs", ""), ("drs", ""), ("ops-tl", ""), ("ops-tl", " rho=1.0"))
    }
    alone = {"ptrs", "drs", "ops-tl", "ops-tl rho=1.0", "ops-tl rho=1.0 nu=1.0"}
    exploring = {f"ops-tl{decay} explore-while-following" for decay in ("", " rho=1.0", " rho=1.0 nu=1.0")}
    assert _labels("fig6", Gridworld(variance=7)) == initialisations | alone | plus | exploring
    for family in GRIDS:
        if family != Gridworld(variance=7):
            assert _labels("fig6", family) == initialisations
    assert {_target_sizes(one) for one in _runs("fig6")} == {(200, 1_000)}


def test_mountain_car_s_optimal_learns_tables_of_its_first_twenty_targets_and_the_others_meet_a_hundred() -> (
    None
):
    runs = _runs("mountain-car")
    assert {_target_sizes(one)[0] for one in runs if one.method.name == "optimal"} == {20}
    assert {_target_sizes(one)[0] for one in runs if one.method.name != "optimal"} == {100}
    for name in ("fig9", "figA3"):
        everything, first = _tables(name)
        assert everything.first is None
        assert "optimal" not in {run.method.name for run in everything.runs}
        assert first.first == 20
        assert "20" in first.title
        assert "optimal" in {run.method.name for run in first.runs}


def test_figure_8_has_a_noise_floor_of_several_seeds() -> None:
    [picture] = _pictures("fig8")
    floor = [sources_of(one) for one in picture.artefacts if family_of(one) == MountainCar(noise=0)]
    assert [one.learning.seed for one in floor] == [0, 1, 2, 3, 4]
    assert {_source_sizes(one) for one in floor} == {(20, 500_000)}
    rest = [family_of(one) for one in picture.artefacts if family_of(one) != MountainCar(noise=0)]
    assert rest == list(CARS)


@pytest.mark.parametrize("scale", [None, "quick"])
@pytest.mark.parametrize("target", SHOWS)
def test_nothing_is_made_twice_and_everything_after_what_it_is_made_of(
    target: str, scale: str | None
) -> None:
    needed = _needed(target, scale, 2)
    assert len(set(needed)) == len(needed)
    before: set[Artefact] = set()
    for one in needed:
        assert before.issuperset(inputs(one))
        before.add(one)


def test_everything_is_judged_from_all_artefacts_and_fits_that_test_path_lengths_on_every_grid() -> None:
    judged = _judged("all")
    assert set(_runs("all")) <= set(judged.artefacts)
    tested = [
        one
        for one in judged.artefacts
        if isinstance(one, PlannedFit) and one.options.eopl_normality == "rounded"
    ]
    assert [one.sources.family for one in tested] == list(GRIDS)
    assert judged.whole
    assert not _judged("fig9").whole


def test_source_sets_have_seeds_of_their_own_and_share_their_targets() -> None:
    needed = [one for one in _needed("fig6", None, 3) if isinstance(one, PlannedRun)]
    medians = [one for one in needed if one.method.label == "logqinit-median"]
    assert sorted({one.fit.sources.learning.seed for one in medians}) == [0, 1, 2]
    assert {(_target_sizes(one)[0], one.learning.seed) for one in medians} == {(200, 0)}
    reading_none = [one for one in needed if one.method.label in ("zero", "optimal", "drs")]
    assert {one.fit.sources.learning.seed for one in reading_none} == {0}
    # of the noise floor, seeds are what is shown: more source sets change nothing about it
    assert _needed("fig8", None, 3)[-5:] == _needed("fig8")[-5:]


def test_the_quick_scale_is_smaller_everywhere_and_captions_tell_its_sizes() -> None:
    for kind, sizes in ((PlannedSources, _source_sizes), (PlannedRun, _target_sizes)):
        quick = [sizes(one) for one in _needed("all", "quick") if isinstance(one, kind)]  # type: ignore[operator]
        paper = [sizes(one) for one in _needed("all") if isinstance(one, kind)]  # type: ignore[operator]
        assert len(quick) == len(paper) - (2 if kind is PlannedSources else 0)  # two seeds of the floor fewer
        assert max(tasks for tasks, _ in quick) < max(tasks for tasks, _ in paper)
    told = _pictures("fig6", "quick")[0].caption
    assert "one source set of 40 source tasks of 30,000 episodes; 40 targets of 1,000 episodes" in told
    for name in ("fig9", "figA3"):
        firsts = [one.first for one in _study("quick").only([name]).shown if isinstance(one, PlannedTable)]
        assert firsts == [None, 10]
