"""What a user reads when something is asked that cannot be: one sentence, what there is, what to do, and the exit code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Here = Callable[..., Any]


def _refused(ended: Any, code: int) -> str:
    """The sentence, which must be alone on stderr; stdout is empty."""
    assert ended.code == code, ended.err
    assert ended.out == ""
    [line] = ended.err.splitlines()
    assert line.startswith("qinit: ")
    return str(line)


def test_a_missing_file_is_a_usage_error_that_says_where_to_look(here: Here) -> None:
    sentence = _refused(here("fit", "nowhere/sources.h5"), 2)
    assert "nowhere/sources.h5" in sentence
    assert "qinit list" in sentence


def test_a_name_with_a_slip_comes_with_the_nearest(here: Here, pipeline: Any) -> None:
    name = pipeline.sources.stem
    sentence = _refused(here("fit", name.replace("variance", "varance"), "--store", pipeline.store), 2)
    assert f"did you mean {name}" in sentence


def test_a_name_in_the_store_leads_to_its_artefact(here: Here, pipeline: Any, tmp_path: Path) -> None:
    for reference in (pipeline.fit.stem, f"fits/{pipeline.fit.stem}", pipeline.fit.name):
        ended = here("transfer", "zero", reference, "--tasks", 2, "--episodes", 5, "--store", pipeline.store,
                     "-o", tmp_path / "run.h5")  # fmt: skip
        assert ended.code == 0, ended.err


@pytest.mark.parametrize(
    ("words", "kind", "wanted"),
    [
        (["fit"], "fit", "sources"),
        (["transfer", "zero"], "sources", "fit"),
        (["compare"], "fit", "run"),
        (["plot", "curves"], "sources", "run"),
    ],
)
def test_the_wrong_kind_of_artefact_is_named_with_the_kind_that_is_wanted(
    words: list[str], kind: str, wanted: str, here: Here, pipeline: Any
) -> None:
    sentence = _refused(here(*words, getattr(pipeline, kind)), 4)
    assert f"is of the kind {kind}" in sentence
    assert wanted in sentence


@pytest.mark.parametrize("words", [["fit"], ["transfer", "zero"], ["compare"], ["plot", "curves"]])
def test_nothing_on_stdin_says_that_the_stage_before_produced_nothing(words: list[str], here: Here) -> None:
    for stdin in ("", "\n  \n"):
        assert "the stage before produced nothing" in _refused(here(*words, "-", stdin=stdin), 4)


@pytest.mark.parametrize(
    ("line", "nearest"),
    [
        ("train-sorces gridworld", "train-sources"),
        ("train-sources gridwrld", "gridworld"),
        ("transfer logqinit-medan fit.h5", "logqinit-median"),
        ("transfer zro fit.h5", "zero"),
        ("train-sources gridworld --varience 3", "--variance"),
        ("compare a.h5 --basline zero", "--baseline"),
        ("train-sources gridworld --goals unifrom", "uniform"),
        ("compare a.h5 --metric retrun", "return"),
    ],
)
def test_a_misspelled_name_is_a_usage_error_that_comes_with_the_nearest(
    line: str, nearest: str, here: Here
) -> None:
    sentence = _refused(here(*line.split()), 2)
    assert nearest in sentence
    assert "--help" in sentence


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("--goals uniform --variance 3", "--variance belongs to normal goals"),
        ("--p-low 0.9 --p-high 0.8", "--p-low 0.9 is above --p-high 0.8"),
        ("--mean 100", "less than once in 100 draws"),
        ("--size 1", "--size is 1; it must be from 2 to 1000"),
        ("--gamma 0", "--gamma is 0.0"),
        ("--alpha 2", "--alpha is 2.0"),
        ("--tasks 0", "--tasks is 0; it must be at least 1"),
        ("--episodes 0", "--episodes is 0"),
        ("--seed -3", "--seed is -3; it must be at least 0"),
        ("--jobs 0", "--jobs is 0; it must be from 1 to 1024"),
        ("--epsilon nan", "--epsilon is nan; it must be a finite number"),
        ("--learner exact --episodes 5", "exact learner has no episodes"),
        ("--learner exact --start fixed", "--start means nothing to it"),
        ("-o sources", "ends in .h5"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused_before_anything_is_written(
    line: str, part: str, here: Here, tmp_path: Path
) -> None:
    assert part in _refused(here("train-sources", "gridworld", *line.split()), 2)
    assert not list(tmp_path.iterdir())


def test_too_few_sources_say_how_to_get_more(here: Here) -> None:
    made = here("train-sources", "gridworld", "--size", 4, "--tasks", 1, "--learner", "exact", "-q")
    sentence = _refused(here("fit", made.path), 4)
    assert "a fit needs at least 2" in sentence
    assert "--tasks" in sentence


@pytest.mark.parametrize(
    ("shift", "code", "part"),
    [
        ("size=4", 2, "size cannot be shifted"),
        ("varianc=4", 2, "did you mean variance?"),
        ("variance", 2, "write KEY=VALUE"),
        ("variance=many", 2, "variance=many"),
        ("variance=-1", 2, "--variance is -1.0"),
    ],
)
def test_a_shift_that_cannot_be_made_is_refused(
    shift: str, code: int, part: str, here: Here, pipeline: Any
) -> None:
    sentence = _refused(here("transfer", "zero", pipeline.fit, "--shift", shift, "--episodes", 5), code)
    assert part in sentence
    assert "--shift" in sentence


def test_an_estimator_without_a_median_is_refused_by_the_median(
    here: Here, pipeline: Any, tmp_path: Path
) -> None:
    fit = here("fit", pipeline.sources, "--estimator", "shen", "-o", tmp_path / "shen.h5", "-q").path
    sentence = _refused(here("transfer", "logqinit-median", fit, "--episodes", 5), 4)
    assert "fit again with --estimator mle" in sentence


def test_other_settings_under_that_name_are_refused_with_the_difference_and_replaced_by_force(
    here: Here, tmp_path: Path
) -> None:
    words = ("train-sources", "gridworld", "--size", 4, "--tasks", 2, "--learner", "exact", "-o", "a.h5")
    here(*words, "-q")
    before = (tmp_path / "a.h5").read_bytes()
    sentence = _refused(here(*words, "--seed", 1), 4)
    assert "seed: asked for 1, there is 0" in sentence
    assert "--force" in sentence
    assert (tmp_path / "a.h5").read_bytes() == before
    assert here(*words, "--seed", 1, "--force").code == 0
    assert (tmp_path / "a.h5").read_bytes() != before
    assert _refused(here(*words), 4)


def test_a_file_that_is_no_artefact_and_one_cut_short_are_damaged(
    here: Here, pipeline: Any, tmp_path: Path
) -> None:
    (tmp_path / "text.h5").write_text("no artefact")
    (tmp_path / "cut.h5").write_bytes(pipeline.sources.read_bytes()[:4_000])
    (tmp_path / "empty.h5").write_bytes(b"")
    for name in ("text.h5", "cut.h5", "empty.h5"):
        assert name in _refused(here("fit", name), 6)


def test_a_flipped_bit_is_never_read_as_numbers(here: Here, pipeline: Any, tmp_path: Path) -> None:
    whole = bytearray(pipeline.sources.read_bytes())
    whole[len(whole) // 2] ^= 1
    (tmp_path / "flipped.h5").write_bytes(whole)
    before = here("fit", pipeline.sources, "--json", "-q", "-o", tmp_path / "before.h5")
    ended = here("fit", "flipped.h5", "--json", "-q", "-o", tmp_path / "after.h5")
    assert ended.code == 6 or ended.out.split('"digest"')[1][:70] == before.out.split('"digest"')[1][:70]


def test_a_baseline_that_could_be_two_runs_is_refused_with_their_names(
    here: Here, pipeline: Any, tmp_path: Path
) -> None:
    for name in ("one", "two"):
        other = ("--alpha", 0.05) if name == "two" else ()
        made = here("transfer", "logqinit-median", pipeline.fit, *other, "--tasks", 4, "--episodes", 60, "-q",
                    "-o", tmp_path / f"{name}.h5")  # fmt: skip
        assert made.code == 0, made.err
    sentence = _refused(here("compare", "one.h5", "two.h5", "--baseline", "logqinit-median"), 4)
    assert "logqinit-median, alpha 0.1; logqinit-median, alpha 0.05" in sentence
    assert here("compare", "one.h5", "two.h5", "--baseline", "one").code == 0


def test_a_picture_of_an_unknown_kind_is_refused(here: Here, pipeline: Any) -> None:
    assert ".png, .svg or .pdf" in _refused(here("plot", "curves", pipeline.runs["zero"], "-o", "a.gif"), 2)


def test_a_folder_that_cannot_be_written_is_the_systems_refusal(here: Here, tmp_path: Path) -> None:
    (tmp_path / "in-the-way").write_text("a file where a folder should be")
    sentence = _refused(
        here("train-sources", "gridworld", "--size", 4, "--learner", "exact", "--store", "in-the-way"), 7
    )
    assert "in-the-way" in sentence


def test_debug_shows_the_traceback_and_keeps_sentence_and_code(here: Here) -> None:
    ended = here("fit", "nowhere.h5", "--debug")
    assert ended.code == 2
    assert "Traceback" in ended.err
    assert ended.err.splitlines()[-1].startswith("qinit: there is no nowhere.h5")


def test_quiet_says_nothing_but_errors(here: Here, pipeline: Any) -> None:
    ended = here("transfer", "zero", pipeline.fit, "--tasks", 2, "--episodes", 5, "--gamma", 0.5, "-q")
    assert (ended.code, ended.err) == (0, "")
    assert _refused(here("fit", "nowhere.h5", "-q"), 2)


def test_what_differs_from_the_sources_is_noted(here: Here, pipeline: Any) -> None:
    ended = here("transfer", "zero", pipeline.fit, "--tasks", 2, "--episodes", 5, "--gamma", 0.5)
    assert "gamma 0.5, where the sources were learned with 0.95" in ended.err
    assert "alpha" not in ended.err


def test_doing_it_again_says_that_it_is_done_and_prints_the_path(here: Here) -> None:
    words = ("train-sources", "gridworld", "--size", 4, "--tasks", 2, "--learner", "exact")
    first, second = here(*words), here(*words)
    assert (second.code, second.out) == (0, first.out)
    assert "already complete" in second.err
    told = here(*words, "--json")
    assert '"skipped": 2' in told.out


def test_pairs_that_no_source_knows_are_counted_for_the_user(here: Here) -> None:
    made = here("train-sources", "gridworld", "--size", 8, "--tasks", 2, "--episodes", 3, "-q").path
    fit = here("fit", made)
    assert "state-actions that no source knows" in fit.err
    run = here("transfer", "logqinit-median", fit.path, "--tasks", 2, "--episodes", 3, "--json")
    assert "that no source knows were filled" in run.err
    assert '"filled": 0' not in run.out


def test_compiling_is_said_once_with_its_kind_and_not_where_the_code_was_kept(
    qinit: Any, tmp_path: Path
) -> None:
    words = ("train-sources", "gridworld", "--size", 4, "--tasks", 2, "--learner", "exact")
    env = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    first = qinit(*words, "-o", "a.h5", env=env)
    assert first.code == 0, first.err
    assert [line for line in first.err.splitlines() if line.startswith("compiling ")] == [
        "compiling gridworld exact tables, once for each kind and version of qinit: some seconds"
    ]
    again = qinit(*words, "--seed", 1, "-o", "b.h5", env=env)
    assert again.code == 0, again.err
    assert "compiling" not in again.err


@pytest.mark.parametrize(
    ("stage", "kind"), [("sources", "gridworld sources"), ("transfer", "gridworld targets")]
)
def test_a_stage_that_learns_names_what_it_compiles_and_not_its_parts(
    stage: str, kind: str, here: Here, pipeline: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from qinit_cli.kernels import batch, compiled

    learn = batch.learn

    def compiles(*given: Any, **named: Any) -> Any:
        for part in ("loop", "lane"):
            compiled._tell(f"qinit_cli.kernels.{part}")
        return learn(*given, **named)

    monkeypatch.setattr(batch, "learn", compiles)
    words = {
        "sources": ("train-sources", "gridworld", "--size", 4, "--tasks", 2),
        "transfer": ("transfer", "mean", pipeline.fit, "--tasks", 2),
    }
    ended = here(*words[stage], "--episodes", 2, "-o", "a.h5")
    assert ended.code == 0, ended.err
    told = [line.partition(",")[0] for line in ended.err.splitlines() if "compiling" in line]
    assert told == [f"compiling {kind}"]


def test_what_a_command_compiles_beside_its_kind_is_not_said_again(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from qinit_cli.commands.console import compiling
    from qinit_cli.commands.option_groups import Display
    from qinit_cli.kernels import compiled

    for _ in range(2):  # commands
        with compiling(Display()):
            for _ in range(2):  # batches
                with compiling(Display(), "gridworld sources"):
                    compiled._tell("qinit_cli.kernels.gridworld")
                    compiled._tell("qinit_cli.kernels.lane")
            compiled._tell("qinit_cli.kernels.gridworld_exact")
    with compiling(Display()):
        compiled._tell("qinit_cli.kernels.gridworld_exact")
    told = [line.partition(",")[0] for line in capsys.readouterr().err.splitlines()]
    assert told == ["compiling gridworld sources"] * 2 + ["compiling gridworld exact"]


@pytest.mark.parametrize("where", ["variable", "file"])
def test_debug_may_be_set_by_a_variable_or_a_file(
    where: str, here: Here, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if where == "variable":
        monkeypatch.setenv("QINIT_DEBUG", "1")
    else:
        (tmp_path / "qinit.toml").write_text("debug = true\n")
    ended = here("fit", "nowhere.h5")
    assert ended.code == 2
    assert ended.err.startswith("Traceback")
    (tmp_path / "qinit.toml").unlink(missing_ok=True)
    monkeypatch.delenv("QINIT_DEBUG", raising=False)
    assert "Traceback" not in here("fit", "nowhere.h5").err
