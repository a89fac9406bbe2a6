"""What the page tells: comparisons, verdicts, settings and origins, from plain data whose answers are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from qinit_cli.artefacts.settings import (
    RunSettings,
    SourceSet,
    SourcesSettings,
    StoredFamily,
    StoredMethod,
)
from qinit_cli.fitted import FitOptions
from qinit_cli.learners.traces import SarsaLambda
from qinit_cli.learning import Learning
from qinit_cli.report import comparison, judged, numbers, origin, settings
from qinit_cli.report.content import Block, Folded, Judgement, Pairs, Points, Subheading, Table
from qinit_cli.schedules import Linear

MINUS = "\N{MINUS SIGN}"


def row(
    method: str, value: float, difference: tuple[float, float, float] | None, **more: Any
) -> dict[str, Any]:
    mean, low, high = difference or (None, None, None)
    return {
        "targets": "gridworld-variance-7",
        "method": method,
        "sets": 1,
        "return": value,
        "return_low": value - 0.01,
        "return_high": value + 0.01,
        "difference": mean,
        "difference_low": low,
        "difference_high": high,
        "p": None if difference is None else 0.00001,
        "regret": None,
        "regret_low": None,
        "regret_high": None,
        "remark": "",
        "negative_transfer": None,
        "iqm": None,
        **more,
    }


COMPARED = {
    "schema": "qinit.compare/1",
    "intervals": [{"targets": "gridworld-variance-7", "over": "over targets", "baseline": "zero"}],
    "rows": [
        row("zero", 0.02, None),
        row("maxqinit", 0.014, (-0.006, -0.008, -0.004)),
        row("mean", 0.021, (0.001, -0.001, 0.003)),
        row("logqinit-median", 0.036, (0.016, 0.014, 0.018)),
        row("optimal", 0.041, (0.021, 0.019, 0.023), remark="privileged"),
    ],
}


def texts(table: Table) -> list[list[str]]:
    return [[f"{cell.text} {cell.beneath}".strip() for cell in line] for line in table.rows]


def test_a_comparison_is_a_table_of_its_targets_with_intervals_beneath() -> None:
    [table] = comparison.tables(COMPARED)
    assert isinstance(table, Table)
    assert table.caption == "gridworld-variance-7"
    assert [column.title for column in table.columns] == ["method", "return", "minus zero", "p"]
    assert texts(table)[:2] == [
        ["zero", "0.0200 [0.0100, 0.0300]", "–", "–"],
        ["maxqinit", "0.0140 [0.0040, 0.0240]", f"{MINUS}0.0060 [{MINUS}0.0080, {MINUS}0.0040]", "< 0.0001"],
    ]
    assert table.notes == ["Over targets. † privileged: reads the target's own parameters."]
    assert texts(table)[-1][0] == "optimal †"


def test_the_best_method_that_knows_no_target_is_told_and_what_is_worse_than_zero() -> None:
    [said] = comparison.findings(COMPARED)
    assert "highest return by logqinit-median, 0.0360 [0.0260, 0.0460]" in said
    assert "worse than zero: maxqinit." in said


def test_a_difference_that_may_be_nothing_is_not_called_worse() -> None:
    rows = [row("zero", 0.02, None), row("mean", 0.019, (-0.001, -0.003, 0.001))]
    [said] = comparison.findings({**COMPARED, "rows": rows})
    assert "none is shown to be worse than zero" in said


def test_of_steps_fewer_are_better() -> None:
    rows = [
        {key.replace("return", "steps"): value for key, value in one.items()}
        for one in (
            row("zero", 90.0, None),
            row("mean", 80.0, (-10.0, -11.0, -9.0)),
            row("ucoi", 99.0, (9.0, 8.0, 10.0)),
        )
    ]
    [said] = comparison.findings({**COMPARED, "rows": rows})
    assert "fewest steps by mean" in said
    assert "worse than zero: ucoi." in said


def test_without_a_baseline_nothing_is_called_worse() -> None:
    rows = [row("mean", 0.02, None), row("ucoi", 0.03, None)]
    told = {"targets": "gridworld-variance-7", "over": "over targets", "baseline": None}
    [said] = comparison.findings({"intervals": [told], "rows": rows})
    assert "worse" not in said
    [table] = comparison.tables({"intervals": [told], "rows": rows})
    assert isinstance(table, Table)
    assert [column.title for column in table.columns] == ["method", "return"]


def test_measures_beyond_the_first_are_folded_away() -> None:
    rows = [row("zero", 0.02, None, iqm=0.5, unheard_of=3)]
    table, folded = comparison.tables({**COMPARED, "rows": rows})
    assert isinstance(table, Table)
    assert isinstance(folded, Folded)
    [more] = folded.blocks
    assert isinstance(more, Table)
    assert [column.title for column in more.columns] == ["method", "IQM", "unheard of"]
    assert texts(more) == [["zero", "0.5000", "3"]]


def verdict(claim: str, answer: str, **more: Any) -> dict[str, Any]:
    return {
        "claim": claim,
        "statement": f"{claim} is so.",
        "source": "section 7",
        "verdict": answer,
        "statistic": "a rank correlation",
        "value": 0.5,
        "low": 0.25,
        "high": 0.75,
        "sets": 10,
        "depends_on": "",
        "sentence": f"{claim} was looked at.",
        "details": [],
        **more,
    }


DETAILS = [
    {"label": "variance 1", "value": 0.5, "low": 0.4, "high": 0.6, "sets": 10, "holds": True},
    {"label": "variance 7", "value": -0.5, "low": None, "high": None, "sets": 1, "holds": False},
    {"label": "beside", "value": None, "low": None, "high": None, "sets": 0, "holds": None},
]
VERDICTS = [
    verdict("C1", "holds", details=DETAILS),
    verdict("C2", "does not hold"),
    verdict("C3", "depends", depends_on="gamma"),
    verdict("C4", "not judged", value=None, low=None, high=None, sets=0, sentence="There are no runs."),
]


def test_a_claim_is_told_with_its_number_interval_and_source_sets() -> None:
    first, second, third, rest = judged.blocks(VERDICTS)
    assert isinstance(first, Judgement)
    assert (first.claim, first.answer.text) == ("C1", "holds")
    assert dict(first.parts) == {
        "The paper": "C1 is so (section 7).",
        "Found": "C1 was looked at.",
        "By": "a rank correlation: 0.5000 [0.2500, 0.7500], 10 source sets",
    }
    assert first.details is not None
    assert texts(first.details) == [
        ["variance 1", "0.5000 [0.4000, 0.6000]", "10", "holds"],
        ["variance 7", f"{MINUS}0.5000", "1", "does not hold"],
        ["beside", "–", "–", "told beside it"],
    ]
    assert isinstance(second, Judgement)
    assert second.details is None
    assert isinstance(third, Judgement)
    assert third.answer.text == "depends on gamma"
    assert isinstance(rest, Folded)
    assert "1 claim that is not judged" in rest.summary
    [lacking] = rest.blocks
    assert isinstance(lacking, Points)
    assert lacking.items == ["C4: C4 is so. There are no runs."]


def test_verdicts_are_counted_in_one_sentence() -> None:
    assert judged.findings(VERDICTS) == [
        "Of the paper's 4 claims 1 holds (C1); 1 does not hold (C2); 1 depends on a setting (C3); "
        "1 is not judged here (C4)."
    ]
    assert "2 hold (C1, C5)" in judged.findings([*VERDICTS, verdict("C5", "holds")])[0]
    assert judged.findings(VERDICTS[3:]) == []


LEARNING = Learning(0.1, 0.95, 0.0, 1, 50, "fixed")


def sources(variance: float, seed: int, tasks: int = 100) -> SourcesSettings:
    family = StoredFamily("gridworld", {"p_low": 0.6, "variance": variance}, None)
    return SourcesSettings(1, family, "exact", LEARNING, seed, tasks)


def told(blocks: list[Block]) -> dict[str, list[Block]]:
    """Blocks by the heading that they stand under."""
    found: dict[str, list[Block]] = {}
    for block in blocks:
        if isinstance(block, Subheading):
            found[block.words] = under = []
        else:
            under.append(block)
    return found


def test_shared_settings_are_listed_once_under_the_names_of_their_options() -> None:
    [pairs] = told(settings.blocks([sources(7, seed) for seed in (0, 1, 2, 5)]))["Source tasks"]
    assert isinstance(pairs, Pairs)
    assert dict(pairs.pairs) == {
        "family": "gridworld",
        "p-low": "0.6",
        "variance": "7",
        "learner": "exact",
        "alpha": "0.1",
        "gamma": "0.95",
        "horizon": "50",
        "tasks": "100",
        "seed": "0 to 2, 5",
    }


def test_a_learner_is_told_once_with_its_options() -> None:
    learning = replace(LEARNING, learner=SarsaLambda(0.5), alpha=Linear(0.5, 0.1, 50))
    exact = sources(7, 0)
    [pairs] = told(settings.blocks([replace(exact, learner="sarsa-lambda", learning=learning)]))[
        "Source tasks"
    ]
    assert isinstance(pairs, Pairs)
    found = dict(pairs.pairs)
    assert [name for name in found if name.endswith("learner")] == ["learner"]
    assert (found["learner"], found["lambda"], found["alpha"]) == ("sarsa-lambda", "0.5", "linear:0.5:0.1:50")


def test_a_single_setting_that_differs_joins_the_list() -> None:
    [pairs] = told(settings.blocks([sources(variance, seed) for variance in (1, 7) for seed in (0, 1)]))[
        "Source tasks"
    ]
    assert isinstance(pairs, Pairs)
    assert dict(pairs.pairs)["variance"] == "1, 7"
    assert dict(pairs.pairs)["seed"] == "0 to 1"


def test_settings_that_differ_together_are_a_table() -> None:
    several = [sources(1, 0), sources(7, 0), sources(7, 1), sources(7, 0, tasks=50)]
    shared, table = told(settings.blocks(several))["Source tasks"]
    assert isinstance(shared, Pairs)
    assert "variance" not in dict(shared.pairs)
    assert isinstance(table, Table)
    assert [column.title for column in table.columns] == ["variance", "tasks", "seed"]
    assert texts(table) == [["1", "100", "0"], ["7", "100", "0 to 1"], ["7", "50", "0"]]


def test_runs_tell_of_sources_and_fits_that_are_not_there_themselves() -> None:
    family = StoredFamily("gridworld", {}, None)
    fitted, given = FitOptions(estimator="shen", library=7), ("estimator",)
    source_set = SourceSet("f" * 64, family, "exact", LEARNING, 100, fitted, given)
    runs = [
        RunSettings(1, StoredMethod(name, name, options, None), family, LEARNING, 0, 20, "0" * 64, source_set)
        for name, options in (("zero", {}), ("ptrs", {"phi": "mean-max", "init": {"name": "mean", "b": 1}}))
    ]
    parts = told(settings.blocks(runs))
    learned = [("alpha", "0.1"), ("gamma", "0.95"), ("horizon", "50")]
    drawn = [("family", "gridworld"), ("learner", "exact"), *learned, ("tasks", "100")]
    assert parts["Source tasks"] == [Pairs(drawn)]
    assert parts["Fits"] == [Pairs([("estimator", "shen")])]
    [targets] = parts["Target tasks"]
    assert isinstance(targets, Pairs)
    assert {("family", "gridworld"), ("seed", "0"), ("tasks", "20"), *learned} < set(targets.pairs)
    [methods] = parts["Methods"]
    assert isinstance(methods, Table)
    assert texts(methods) == [["zero", "", "", ""], ["ptrs", "mean-max", "mean", "1"]]
    assert not any("0" * 64 in str(part) or "f" * 64 in str(part) for part in parts.values())


def artefact(name: str) -> dict[str, Any]:
    return {
        "name": name,
        "kind": "fit",
        "content_sha256": "a" * 64,
        "provenance": {"command": f"qinit fit {name}", "time": "2026-01-02T03:04:05Z", "numpy": "2.4.6"},
        "inputs": [{"role": "sources", "name": "s", "content_sha256": "b" * 64}],
    }


def test_every_artefact_stands_with_its_whole_hash_and_its_command() -> None:
    versions, _, hashes, commands = origin.blocks([artefact("one"), artefact("two")])
    assert isinstance(versions, Pairs)
    assert versions.pairs == [("numpy", "2.4.6")]
    assert isinstance(hashes, Table)
    assert texts(hashes)[0] == ["one", "fit", "a" * 64, f"sources {'b' * 12}"]
    assert isinstance(commands, Table)
    assert texts(commands)[1] == ["two", "2026-01-02 03:04:05", "qinit fit two"]


def test_many_artefacts_are_folded_away_but_there() -> None:
    *_, folded = origin.blocks([artefact(str(number)) for number in range(40)])
    assert isinstance(folded, Folded)
    assert "40 artefacts" in folded.summary
    hashes, commands = folded.blocks
    assert isinstance(hashes, Table)
    assert isinstance(commands, Table)
    assert len(hashes.rows) == len(commands.rows) == 40


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (1234, "1,234"),
        (-3, f"{MINUS}3"),
        (0.03584, "0.0358"),
        (-0.00071, f"{MINUS}0.0007"),
        (84.52, "84.52"),
        (1234.56, "1,234.6"),
        (True, "yes"),
    ],
)
def test_numbers_read_as_in_print(value: Any, text: str) -> None:
    assert numbers.number(value) == text
