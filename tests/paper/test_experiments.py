"""The paper's experiments as data: every figure has one, at the paper's sizes, and nothing is asked for twice."""

from __future__ import annotations

import pytest

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.paper.experiments import (
    FIGURES,
    SCALES,
    TARGETS,
    PlannedFit,
    PlannedRun,
    PlannedSources,
    Study,
    experiment,
    judgement,
)
from qinit_cli.paper.making import ordered

CONTRACT = ("fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "figA1", "figA2", "figA3")
PAPER = Study(SCALES["paper"])


def _needed(target: str, study: Study = PAPER) -> tuple[PlannedSources | PlannedFit | PlannedRun, ...]:
    return ordered(artefact for name in TARGETS[target] for artefact in experiment(name, study).artefacts)


def _labels(target: str, family: object) -> set[str]:
    return {
        one.method.label for one in _needed(target) if isinstance(one, PlannedRun) and one.family == family
    }


def test_every_figure_of_the_contract_an_environment_and_all_can_be_asked_for() -> None:
    assert tuple(FIGURES) == CONTRACT
    assert set(TARGETS) == {*CONTRACT, "gridworld", "mountain-car", "all"}
    assert (
        sorted(TARGETS["gridworld"] + TARGETS["mountain-car"]) == sorted(TARGETS["all"]) == sorted(CONTRACT)
    )


@pytest.mark.parametrize("name", CONTRACT)
def test_every_figure_has_pictures_with_titles_and_captions_of_their_own(name: str) -> None:
    pictures = experiment(name, PAPER).pictures
    assert pictures
    assert all(picture.name.startswith(name) and picture.title and picture.caption for picture in pictures)


def test_no_two_files_of_everything_share_a_name() -> None:
    shown = [
        each.name
        for name in TARGETS["all"]
        for each in (*experiment(name, PAPER).pictures, *experiment(name, PAPER).tables)
    ]
    pictures = [each.name for name in TARGETS["all"] for each in experiment(name, PAPER).pictures]
    assert len(set(pictures)) == len(pictures)
    assert len(set(shown)) >= len(pictures)


def test_the_paper_s_sources_are_its_hundred_tasks_of_its_episodes_on_its_eleven_distributions() -> None:
    sources = [
        one
        for one in _needed("all")
        if isinstance(one, PlannedSources) and one.family != PAPER.floor[0].family
    ]
    grids = [one for one in sources if one.family.name == "gridworld"]
    cars = [one for one in sources if one.family.name == "mountain-car"]
    assert {(one.tasks, one.episodes, one.seed) for one in grids} == {(100, 100_000, 0)}
    assert {(one.tasks, one.episodes, one.seed) for one in cars} == {(100, 500_000, 0)}
    assert [one.family for one in grids if one.family != Gridworld(goals="uniform")] == [
        Gridworld(variance=variance) for variance in (1, 3, 5, 7, 10)
    ]
    assert Gridworld(goals="uniform") in [one.family for one in grids]
    assert {one.family for one in cars} == {
        MountainCar(noise=noise) for noise in (0.0002, 0.005, 0.01, 0.015, 0.02)
    }


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
    for family in (*(Gridworld(variance=each) for each in (1, 3, 5, 10)), Gridworld(goals="uniform")):
        assert _labels("fig6", family) == initialisations
    runs = [one for one in _needed("fig6") if isinstance(one, PlannedRun)]
    assert {(one.tasks, one.episodes) for one in runs} == {(200, 1_000)}


def test_mountain_car_s_optimal_learns_tables_of_its_first_twenty_targets_and_the_others_meet_a_hundred() -> (
    None
):
    runs = [one for one in _needed("mountain-car") if isinstance(one, PlannedRun)]
    assert {one.tasks for one in runs if one.method.name == "optimal"} == {20}
    assert {one.tasks for one in runs if one.method.name != "optimal"} == {100}
    for name in ("fig9", "figA3"):
        everything, first = experiment(name, PAPER).tables
        assert everything.first is None
        assert "optimal" not in {run.method.name for run in everything.runs}
        assert first.first == 20
        assert "optimal" in {run.method.name for run in first.runs}


def test_figure_8_has_a_noise_floor_of_several_seeds() -> None:
    [picture] = experiment("fig8", PAPER).pictures
    floor = [one for one in picture.artefacts if one.family.noise == 0]  # type: ignore[union-attr]
    assert len({one.seed for one in floor}) == 5  # type: ignore[union-attr]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("target", TARGETS)
def test_nothing_is_made_twice_and_everything_after_what_it_is_made_of(target: str, scale: str) -> None:
    needed = _needed(target, Study(SCALES[scale], sets=2))
    assert len(set(needed)) == len(needed)
    before: set[PlannedSources | PlannedFit | PlannedRun] = set()
    for one in needed:
        match one:
            case PlannedFit():
                assert one.sources in before
            case PlannedRun():
                assert one.fit in before
            case PlannedSources():
                pass
        before.add(one)


def test_everything_is_judged_from_all_artefacts_and_fits_that_test_path_lengths_on_every_grid() -> None:
    judged = judgement("all", PAPER)
    assert set(_needed("all")) - {
        one for one in _needed("all") if isinstance(one, PlannedSources | PlannedFit)
    } <= set(judged.artefacts)
    tested = [
        one
        for one in judged.artefacts
        if isinstance(one, PlannedFit) and one.options.eopl_normality == "rounded"
    ]
    assert [one.sources.family for one in tested] == list(PAPER.gridworlds)
    assert judged.whole
    assert not judgement("fig9", PAPER).whole


def test_source_sets_have_seeds_of_their_own_and_share_their_targets() -> None:
    needed = _needed("fig6", Study(SCALES["paper"], sets=3))
    medians = [one for one in needed if isinstance(one, PlannedRun) and one.method.label == "logqinit-median"]
    assert sorted({one.fit.sources.seed for one in medians}) == [0, 1, 2]
    assert {one.tasks for one in medians} == {200}
    reading_none = [
        one
        for one in needed
        if isinstance(one, PlannedRun) and one.method.label in ("zero", "optimal", "drs")
    ]
    assert {one.fit.sources.seed for one in reading_none} == {0}


def test_the_quick_scale_is_smaller_everywhere_and_captions_tell_its_sizes() -> None:
    for family in ("gridworld", "mountain-car"):
        quick, paper = SCALES["quick"].sizes[family], SCALES["paper"].sizes[family]
        assert quick.sources < paper.sources
        assert quick.source_episodes < paper.source_episodes
        assert quick.targets < paper.targets
    told = experiment("fig6", Study(SCALES["quick"])).pictures[0].caption
    sizes = SCALES["quick"].sizes["gridworld"]
    assert f"{sizes.sources} source tasks of {sizes.source_episodes:,} episodes" in told
    assert f"{sizes.targets} targets" in told
