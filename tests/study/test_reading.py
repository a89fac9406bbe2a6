"""What a study's file plans, and the sentence about each fault of one."""

from __future__ import annotations

from pathlib import Path

import pytest

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import UsageError
from qinit_cli.study.planned import (
    PlannedPicture,
    PlannedRun,
    PlannedSources,
    PlannedTable,
    PlannedTuning,
    ordered,
)
from qinit_cli.study.reading import Study

ONE = '[[distribution]]\nfamily = "gridworld"\nvariance = 1\n'  # three lines
ZERO = '[[method]]\nname = "zero"\n'  # two lines
UCOI = '[[method]]\nname = "ucoi"\n'


def read(text: str, scale: str | None = None, sets: int | None = None) -> Study:
    return Study.of(text, Path("s.toml"), scale, sets)


def runs(study: Study) -> list[PlannedRun]:
    return [one for one in study.artefacts if isinstance(one, PlannedRun)]


def sources(study: Study) -> list[PlannedSources]:
    return [one for one in ordered(study.artefacts) if isinstance(one, PlannedSources)]


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("", None, "no [[distribution]] stands here"),
        ("[[distribution]]\n", 1, "family is missing"),
        ('[[distribution]]\nfamily = "gridwrld"\n', 2, "did you mean gridworld?"),
        ("[[distribution]]\nfamily = 3\n", 2, "family is 3; it must be a text"),
        ('[distribution]\nfamily = "gridworld"\n', 1, "distribution must be a list of tables"),
        (ONE + "varianc = 2\n", 4, "gridworld has no varianc; did you mean variance?"),
        (ONE.replace("1", '[1, "two"]'), 3, "variance is 'two'; it must be a number"),
        (ONE.replace("1", "[]"), 3, "variance is an empty list"),
        (ONE.replace("1", "nan"), 3, "variance is nan; it must be a finite number"),
        (ONE.replace("1", "inf"), 3, "variance is inf; it must be a finite number"),
        (ONE.replace("1", "2026-01-01"), 3, "variance is datetime.date"),
        (ONE.replace("1", "-1"), 3, "variance is -1; it must be at least 0"),
        (ONE + '"größe" = 3\n', 4, "gridworld has no größe"),
        (ONE + "group = 3\n", 4, "group is 3; it must be a text"),
        (ONE + 'map = "no such map.txt"\n', 4, "map no such map.txt cannot be read"),
        (ONE + 'sources = "many"\n', 4, "sources is 'many'; it must be a table"),
        (ONE + "[sources]\ntasks = 2.5\n", 5, "tasks is 2.5; it must be a whole number"),
        (ONE + "[sources]\ntasks = true\n", 5, "tasks is True; it must be a whole number"),
        (ONE + "[sources]\nseed = 1\nsets = 2\n", 6, "sets and seed both say"),
        (ONE + "[sources]\nsets = 0\n", 5, "sets is 0; it must be from 1 to 100,000"),
        (ONE + '[sources]\nlearner = "q-lerning"\n', 5, "did you mean q-learning?"),
        (ONE + '[[method]]\nname = "zeor"\n', 5, "there is no method zeor; did you mean zero?"),
        (ONE + "[[method]]\n", 4, "name is missing"),
        (ONE + ZERO + "kappa = 1\n", 6, "zero has no kappa"),
        (ONE + ZERO + 'distributions = ["goal"]\n', 6, "'goal', which nothing is called"),
        (ONE + ZERO + "tuned = true\n", 6, "zero has no parameters to choose"),
        (ONE + UCOI + "tune = { kappa = [1, 2] }\n", 6, "give tuned = true too"),
        (ONE + UCOI + "tuned = true\ntune = { kappa = [-1] }\n", 7, "kappa is -1.0; it must be at least 0"),
        (ONE + UCOI + "tuned = true\ntune = { kappa = [] }\n", 7, "kappa is []; it must be numbers"),
        (ONE + UCOI + "tuned = true\ntune = { episodes = [1, 2] }\n", 7, "chosen in one way"),
        (ONE + '[[fit]]\nestimatr = "mle"\n', 5, "[[fit]] has no estimatr; did you mean estimator?"),
        (ONE + ZERO + '[[plot]]\nkind = "curve"\n', 7, "there is no plot curve; did you mean curves?"),
        (ONE + ZERO + '[[plot]]\nkind = "curves"\neach = "sett"\n', 8, "did you mean set?"),
        (ONE + ZERO + "[[table]]\nfirst = -1\n", 7, "first is -1; it must be at least 1"),
        (ONE + ZERO + "[[table]]\nfirst = 9\n[targets]\ntasks = 8\n", 7, "first is 9, and zero"),
        (ONE + ZERO + '[study]\nimport = "no_such_module"\n', 7, "there is no module no_such_module"),
        (ONE + ZERO + '[study]\nimport = ["json", "a-b"]\n', 7, "import a-b: write a module's name"),
        (ONE + ZERO + '[targets]\nshift = "varianc=9"\n', 7, "shift varianc=9: "),
        (ONE + ZERO + 'targets = { shift = ["variance=-9"] }\n', 6, "shift: variance is -9"),
        (ONE + ZERO + '[targets]\ntargets = "0:5"\n', 7, "targets"),
        (ONE + ZERO + "[[table]]\nwhere = { targets.seed = false }\n", 6, "no artefact of the study"),
        (ONE + ZERO + '[[table]]\nbaseline = "zeor"\n', 7, "did you mean zero?"),
        (ONE + ZERO + '[study]\nbaseline = "zeor"\n', 7, "did you mean zero?"),
        (ONE + ZERO + '[[table]]\nmetric = "retrn"\n', 7, "did you mean return?"),
        (
            ONE + ZERO + "[[table]]\nwhere = { varianc = 7 }\n",
            7,
            "where names varianc; did you mean variance?",
        ),
        (ONE + ZERO + "[[table]]\nwhere = { variance = 7.5 }\n", 6, "no artefact of the study is selected"),
        (ONE + ZERO + "[[table]]\nselect = [{ method = 1 }]\n", 7, "did you mean methods?"),
        (ONE + ZERO + "[[table]]\n[[table]]\n", None, "two tables are called compare"),
        (ONE + ZERO + '[[table]]\nname = "../up"\n', None, "cannot name a file"),
        (ONE + ZERO + '[[table]]\nname = "study"\n', None, "two tables are called study"),
        (ONE + ZERO + '[part]\na = ["nope"]\n', 7, "the study shows no nope"),
        (ONE + "[scale.quick]\ngridwold = {}\n", 5, "did you mean gridworld?"),
        (ONE + "[verdicts]\na = 1\n", 5, "nothing stands in it"),
        (ONE + "[foo]\n", 4, "the top of the file has no foo"),
        (
            ONE + f"[sources]\nseed = {list(range(1000))}\nalpha = {[0.1 + i / 2000 for i in range(1000)]}\n",
            4,
            "1,000,000 combinations",
        ),
        ("[[distribution]\n", None, "is no TOML"),
        ("a = " + "[" * 3000 + "]" * 3000, None, "nests its lists or tables too deeply"),
    ],
)
def test_a_fault_is_told_with_its_file_and_line(text: str, line: int | None, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        read(text)
    told = str(caught.value)
    assert said in told
    assert told.startswith("s.toml" if line is None else f"s.toml, line {line}: ")
    assert "\n" not in told


def test_lists_vary_the_last_key_fastest() -> None:
    study = read('[[distribution]]\nfamily = "gridworld"\nsize = [5, 6]\nvariance = [1, 2.5]\n')
    assert [one.family for one in sources(study)] == [
        Gridworld(size=size, variance=variance) for size in (5, 6) for variance in (1, 2.5)
    ]


def test_an_option_that_takes_a_list_varies_over_lists_of_lists() -> None:
    one = read(ONE + ZERO + '[targets]\nshift = ["variance=9"]\n')
    assert [run.learning.shift for run in runs(one)] == [("variance=9",)]
    two = read(ONE + ZERO + '[targets]\nshift = [[], ["variance=9", "p-low=0.3"]]\n')
    assert [run.learning.shift for run in runs(two)] == [None, ("variance=9", "p-low=0.3")]


@pytest.mark.parametrize(
    ("text", "asked", "seeds"),
    [
        ("", None, [0]),
        ("[sources]\nsets = 3\n", None, [0, 1, 2]),
        ("[sources]\nseed = [4, 7]\n", None, [4, 7]),
        ("[sources]\nsets = 3\n", 2, [0, 1]),
        ("sources = { seed = 5 }\n[sources]\nsets = 3\n", 2, [5]),  # of its own, which is what it is about
    ],
)
def test_source_sets_are_counted_or_named(text: str, asked: int | None, seeds: list[int]) -> None:
    assert [one.learning.seed for one in sources(read(ONE + text, sets=asked))] == seeds


def test_a_method_that_reads_no_sources_runs_once_over_source_sets() -> None:
    study = read(ONE + '[sources]\nsets = 3\n[[method]]\nname = ["zero", "mean"]\n')
    labels = [(one.method.label, one.fit.sources.learning.seed) for one in runs(study)]
    assert sorted(labels) == [("mean", 0), ("mean", 1), ("mean", 2), ("zero", 0)]


def test_a_shift_need_fit_only_the_families_of_its_method() -> None:
    car = '[[distribution]]\nfamily = "mountain-car"\nmethods = ["mean"]\n[[method]]\nname = "mean"\n'
    only = ZERO + 'distributions = ["gridworld"]\ntargets = { shift = "variance=9" }\n'
    assert {run.learning.shift for run in runs(read(ONE + car + only))} == {None, ("variance=9",)}
    with pytest.raises(UsageError, match="line 8: shift variance=9: "):
        read(
            ONE
            + '[[distribution]]\nfamily = "mountain-car"\n'
            + ZERO
            + only.removeprefix(ZERO).split("\n")[1]
        )


def test_where_takes_true_and_false_for_no_number() -> None:
    text = ONE + ZERO + "[[table]]\nwhere = { targets.keep-q = VALUE }\n"
    assert len(read(text.replace("VALUE", "false")).shown) == 1
    with pytest.raises(UsageError, match="no artefact of the study is selected"):
        read(text.replace("VALUE", "0"))


def test_groups_say_what_goes_with_what() -> None:
    other = '[[distribution]]\ngroup = "wide"\nfamily = "gridworld"\nvariance = 9\nmethods = ["slow"]\n'
    slow = '[[method]]\ngroup = "slow"\nname = "mean"\n'
    study = read(ONE + other + slow + ZERO + 'distributions = ["gridworld"]\n')
    assert {(one.family, one.method.name) for one in runs(study)} == {
        (Gridworld(variance=1), "mean"),
        (Gridworld(variance=1), "zero"),
        (Gridworld(variance=9), "mean"),
    }


def test_tables_and_pictures_select_by_where_select_and_each() -> None:
    text = ONE.replace("1", "[1.0, 2.5]") + ZERO + UCOI
    text += '[[table]]\nname = "t"\nwhere = { variance = 2.5 }\n'
    text += (
        '[[plot]]\nkind = "curves"\nname = "p"\neach = "distribution"\nselect = [{ methods = ["ucoi"] }]\n'
    )
    study = read(text)
    [table] = [one for one in study.shown if isinstance(one, PlannedTable)]
    assert {(one.family.variance, one.method.name) for one in table.runs} == {(2.5, "zero"), (2.5, "ucoi")}  # type: ignore[attr-defined]
    pictures = [one for one in study.shown if isinstance(one, PlannedPicture)]
    assert len(pictures) == 2
    assert len({one.name for one in pictures}) == 2
    assert all([one.method.name for one in picture.artefacts] == ["ucoi"] for picture in pictures)  # type: ignore[union-attr]


def test_what_two_entries_plan_alike_is_made_and_shown_once() -> None:
    study = read(ONE + ONE + ZERO + ZERO)
    assert len(study.artefacts) == 3
    assert {len(one.artefacts) for one in study.shown} == {1}


def test_a_scale_changes_groups_and_nothing_else() -> None:
    text = ONE + 'group = "g"\n' + ZERO + "[scale.quick.g]\nvariance = 3\nsources = { tasks = 7 }\n"
    assert sources(read(text))[0].family == Gridworld(variance=1)
    [quick] = sources(read(text, "quick"))
    assert (quick.family, quick.learning.tasks) == (Gridworld(variance=3), 7)
    with pytest.raises(UsageError, match="has no scale quik; did you mean quick"):
        read(text, "quik")


def test_only_what_is_named_is_made() -> None:
    text = ONE.replace("1", "[1.0, 2.5]") + ZERO
    text += '[[table]]\nname = "one"\nwhere = { variance = 1 }\n[[table]]\nname = "two"\nwhere = { variance = 2.5 }\n'
    study = read(text)
    assert {one.family for one in sources(study.only(["two"]))} == {Gridworld(variance=2.5)}
    assert len(sources(study.only(["one", "two"]))) == 2
    with pytest.raises(UsageError, match="shows no tow; did you mean two"):
        study.only(["tow"])


def test_a_tuned_method_plans_its_tuning_over_the_values_that_are_tried() -> None:
    study = read(ONE + UCOI + "tuned = true\ntune = { kappa = [1, 3], episodes = 20 }\n")
    [tuning] = [one for one in ordered(study.artefacts) if isinstance(one, PlannedTuning)]
    assert dict(tuning.values)["kappa"] == (1.0, 3.0)
    assert tuning.learning.episodes == 20
    assert [one.tuning for one in runs(study)] == [tuning]


def test_a_picture_that_is_already_one_of_each_is_not_told_to_be() -> None:
    text = """\
[[distribution]]
family = "gridworld"
size = 5
sources = { seed = [0, 1] }

[[plot]]
kind = "histograms"
"""
    advice = 'narrow it by where, or give each = "distribution"'
    with pytest.raises(UsageError, match=f"2 are selected; {advice}$"):
        Study.of(text, Path("study.toml"))
    with pytest.raises(UsageError, match=r"2 are selected; narrow it by where$"):
        Study.of(text + 'each = "distribution"\n', Path("study.toml"))
