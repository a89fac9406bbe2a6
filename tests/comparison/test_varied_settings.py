"""Which settings vary among runs, by which names, and how averages change over them."""

from __future__ import annotations

import numpy as np
import pytest
from varying import METHODS, balanced, compared, fitted, ran

import qinit_cli as qinit
from qinit_cli.comparison.sensitivity import Averages, ranked
from qinit_cli.comparison.varied import VariedRuns
from qinit_cli.errors import NotAllowed, UsageError


def test_what_varies_has_the_names_that_a_user_types() -> None:
    varied = VariedRuns.of(compared(balanced()))
    assert [(one.name, one.values) for one in varied.varied] == [
        ("variance", (1.0, 2.0, 4.0)),
        ("epsilon", (0.1, 0.3)),
    ]
    assert varied.method.values == METHODS
    assert all(one.numeric for one in varied.varied)
    assert not varied.method.numeric


def test_settings_that_differ_together_are_one_and_the_given_one_names_it() -> None:
    runs = [ran("mean", fitted(size=size)) for size in (4, 5)]
    varied = VariedRuns.of(compared(runs))
    assert [(one.name, one.alike) for one in varied.varied] == [("size", ("mean",))]
    assert varied.named("mean", "--over").name == "size"


def test_a_setting_of_sources_and_targets_is_the_targets_which_every_method_has() -> None:
    family = qinit.families.gridworld(size=4, variance=1)
    fits = [
        qinit.fit(qinit.train_sources(family, tasks=3, learner="exact", gamma=gamma)) for gamma in (0.9, 0.95)
    ]
    runs = [ran(method, fit) for method in ("mean", "zero") for fit in fits]
    varied = VariedRuns.of(compared(runs))
    assert [(one.name, one.alike) for one in varied.varied] == [("gamma", ("sources.gamma",))]
    rows = [row for row in qinit.sensitivity(runs, "gamma").rows if row["method"] == "zero"]
    assert [row["return"] for row in rows] == pytest.approx([run.returns().mean() for run in runs[2:]])


def test_a_setting_that_some_runs_lack_is_not_taken_for_one_that_they_differ_in() -> None:
    runs = [ran("zero", fitted(), explore=f"boltzmann:temperature={own}") for own in (0.1, 0.5)]
    runs += [ran("zero", fitted(), epsilon=own) for own in (0.1, 0.3)]
    varied = VariedRuns.of(compared(runs))
    assert {one.name: one.alike for one in varied.varied} == {"explore": (), "temperature": (), "epsilon": ()}
    rows = qinit.sensitivity(runs, "temperature").rows
    assert [(row["value"], row["where"]) for row in rows] == [
        (0.1, "explore boltzmann"),
        (0.5, "explore boltzmann"),
    ]


def test_a_short_name_is_enough_where_it_is_one_setting_s() -> None:
    runs = [ran("mean", fitted(tasks=tasks)) for tasks in (3, 4)]
    assert VariedRuns.of(compared(runs)).named("tasks", "--over").name == "sources.tasks"
    both = [ran("mean", fitted(tasks=tasks), tasks=count) for tasks in (3, 4) for count in (2, 3)]
    assert VariedRuns.of(compared(both)).named("tasks", "--over").name == "tasks"


def test_shifted_targets_have_a_setting_of_their_own() -> None:
    runs = [ran("mean", fitted(), shift={"variance": shift}) for shift in (2, 3)]
    runs += [ran("zero", fitted(), shift={"variance": shift}) for shift in (2, 3)]
    varied = VariedRuns.of(compared(runs))
    assert [(one.name, one.values) for one in varied.varied] == [("target.variance", (2.0, 3.0))]
    rows = qinit.sensitivity(runs, "variance").rows
    assert [(row["method"], row["value"]) for row in rows] == [
        ("mean", 2.0), ("mean", 3.0), ("zero", 2.0), ("zero", 3.0),
    ]  # fmt: skip


def test_options_of_exploration_learner_and_method_are_settings_and_schedules_categories() -> None:
    fit = fitted()
    runs = [
        ran("zero", fit, explore=f"boltzmann:temperature={temperature}") for temperature in (0.1, 0.5)
    ] + [ran("zero", fit), ran("zero", fit, alpha="linear:0.5:0.1:10")]
    varied = VariedRuns.of(compared(runs))
    assert varied.named("temperature", "--over").values == (0.1, 0.5)
    assert varied.named("explore", "--over").values == ("boltzmann", "epsilon-greedy")
    assert varied.named("alpha", "--over").values == (0.1, "linear:0.5:0.1:10")
    assert not varied.named("alpha", "--over").numeric
    quantiles = [ran(qinit.methods["logqinit-quantile"](quantile=quantile), fit) for quantile in (0.3, 0.5)]
    methods = VariedRuns.of(compared(quantiles))
    assert methods.method.values == tuple(one.label for one in methods.runs)
    assert [one.name for one in methods.varied] == ["logqinit-quantile.quantile"]
    assert methods.others() == []


def test_an_unknown_setting_is_refused_with_the_nearest_and_what_varies() -> None:
    varied = VariedRuns.of(compared(balanced()))
    with pytest.raises(UsageError, match=r"--over varianc does not vary.*did you mean variance\?.*epsilon"):
        varied.named("varianc", "--over")
    with pytest.raises(UsageError, match="what intervals are over"):
        varied.named("seed", "--over")
    alone = VariedRuns.of(compared(balanced()[:1]))
    with pytest.raises(UsageError, match="no setting varies"):
        alone.named("variance", "--over")


def test_points_are_the_means_of_runs_with_the_intervals_of_compare() -> None:
    runs = [run for run in balanced() if run.settings["learning"]["epsilon"] == 0.1]
    rows = {(row["method"], row["value"]): row for row in qinit.sensitivity(runs, "variance").rows}
    assert len(rows) == 9
    own = [run for run in runs if run.settings["method"]["name"] == "mean"]
    for variance in (1, 2, 4):
        same = [run for run in own if run.settings["family"]["variance"] == variance]
        row = rows["mean", variance]
        assert row["return"] == pytest.approx(np.mean([run.returns().mean() for run in same]))
        [told] = qinit.compare(same, baseline="").rows
        assert [row[f"return{end}"] for end in ("_low", "_high")] == pytest.approx(
            [told[f"return{end}"] for end in ("_low", "_high")]
        )
        assert (row["sets"], row["targets"]) == (2, 3)


def test_a_method_that_reads_no_sources_counts_at_every_number_of_sources() -> None:
    runs = [ran("mean", fitted(tasks=tasks)) for tasks in (3, 4)] + [ran("zero", fitted())]
    rows = qinit.sensitivity(runs, "sources.tasks").rows
    assert [(row["method"], row["value"]) for row in rows] == [
        ("mean", 3), ("mean", 4), ("zero", 3), ("zero", 4),
    ]  # fmt: skip
    assert rows[2]["return"] == rows[3]["return"] == pytest.approx(runs[2].returns().mean())


def test_over_several_families_the_distribution_stands_for_their_options() -> None:
    mixture = qinit.families.mixture_gridworld(size=4)
    other = qinit.fit(qinit.train_sources(mixture, tasks=3, learner="exact"))
    fits = [fitted(1), fitted(2), other]
    runs = [ran(method, fit, epsilon=e) for fit in fits for method in ("zero", "mean") for e in (0.1, 0.3)]
    varied = VariedRuns.of(compared(runs))
    assert [one.name for one in varied.factors()] == [
        "method", "distribution", *[one.name for one in varied.others() if one.name != "distribution"],
    ]  # fmt: skip
    names = {row["setting"] for row in qinit.sensitivity(runs).rows}
    assert {"method", "distribution", "epsilon"} <= names
    assert not {"variance", "family", "means"} & names
    assert len({row["where"] for row in qinit.sensitivity(runs, "epsilon").rows}) == 3


def test_shares_are_one_together_and_those_of_the_sums_of_squares() -> None:
    runs = balanced()
    rows = {row["setting"]: row["share"] for row in qinit.sensitivity(runs).rows}
    assert sum(rows.values()) == pytest.approx(1)
    assert set(rows) == {"method", "variance", "epsilon", "interactions", "source sets and targets"}
    means = np.array([run.returns().mean() for run in runs]).reshape(
        3, 3, 2, 2
    )  # method, variance, set, epsilon
    total = np.sum((means - means.mean()) ** 2)
    for name, axes in (("method", (1, 2, 3)), ("variance", (0, 2, 3)), ("epsilon", (0, 1, 2))):
        of_levels = means.mean(axis=axes)
        between = np.sum((of_levels - means.mean()) ** 2) * means.size / of_levels.size
        assert rows[name] == pytest.approx(between / total)
    within = np.sum((means - means.mean(axis=2, keepdims=True)) ** 2)
    assert rows["source sets and targets"] == pytest.approx(within / total)


def test_the_share_of_an_only_setting_without_replicates_is_reported_to_hold_the_noise() -> None:
    runs = [ran("zero", fitted(), epsilon=epsilon) for epsilon in (0.1, 0.3)]
    told = qinit.sensitivity(runs)
    assert [(row["setting"], row["share"]) for row in told.rows] == [("epsilon", pytest.approx(1))]
    assert "its share holds the noise" in told.about
    assert "interactions" not in told.about


def test_of_sets_with_unequally_many_targets_each_counts_by_its_mean_and_the_fewest_are_told() -> None:
    runs = [ran("mean", fitted(seed=seed), tasks=tasks) for seed, tasks in ((0, 3), (1, 2))]
    varied = VariedRuns.of(compared(runs))
    found, sets, targets = Averages(varied, "return").estimate(varied.runs)
    assert (sets, targets) == (2, 2)
    assert found.value == pytest.approx(np.mean([run.returns().mean() for run in runs]))


def test_runs_that_do_not_differ_have_no_shares() -> None:
    with pytest.raises(NotAllowed, match="no setting varies"):
        qinit.sensitivity(balanced()[:1])


def test_ranks_average_source_sets_and_leave_out_what_not_every_method_met() -> None:
    runs = compared([run for run in balanced() if run.settings["learning"]["epsilon"] == 0.1][:-2])
    methods, distributions, found = ranked(Averages(VariedRuns.of(runs), "return"))
    assert methods == list(METHODS)
    assert distributions == ["gridworld-4-variance-1", "gridworld-4-variance-2"]
    values = np.array(
        [
            [
                np.mean(
                    [
                        run.returns().mean()
                        for run in runs
                        if (run.label, run.settings.family.label) == (method, one)
                    ]
                )
                for method in methods
            ]
            for one in distributions
        ]
    )
    places = (-values).argsort(axis=1).argsort(axis=1) + 1.0
    assert found.mean_ranks == pytest.approx(places.mean(axis=0))


def test_rows_are_a_data_frame() -> None:
    pytest.importorskip("pandas")
    frame = qinit.sensitivity(balanced(), "variance").to_pandas()
    assert list(frame.columns)[:4] == ["setting", "value", "method", "where"]
    assert len(frame) == 18
