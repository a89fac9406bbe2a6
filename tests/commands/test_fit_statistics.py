"""What `qinit fit` tells of its statistics: text on stderr, one object with --json, datasets in the file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy import stats

Run = Callable[..., Any]
ALL = ("--eopl-normality", "dither", "--alternatives", "--check-theory", "--holdout", 5)


@pytest.fixture
def sources(here: Run) -> Path:
    """Thirty exact tables of a small grid."""
    family = ("gridworld", "--size", 6, "--variance", 2, "--tasks", 30, "--learner", "exact")
    path: Path = here("train-sources", *family, "-o", "sources.h5", "-q").path
    return path


def _told(ended: Any) -> dict[str, Any]:
    assert ended.code == 0, ended.err
    told: dict[str, Any] = json.loads(ended.out, parse_constant=pytest.fail)
    return told


def test_the_path_alone_is_on_stdout_and_the_test_is_told_on_stderr(here: Run, sources: Path) -> None:
    ended = here("fit", sources)
    assert ended.path.is_file()
    first, second = ended.err.splitlines()
    assert first.startswith("30 sources fitted")
    assert second.startswith("ln Q normal? Shapiro-Wilk, n ")
    for words in ("raw ", "Benjamini-Hochberg ", "Benjamini-Yekutieli ", "skewness", "not testable"):
        assert words in second


def test_the_file_holds_scipys_values_of_the_sources_in_it(here: Run, sources: Path) -> None:
    with h5py.File(here("fit", sources, "-q").path) as fit, h5py.File(sources) as source:
        q = source["q"][...]
        for cell in ((0, 0, 1), (3, 4, 2), (5, 5, 0)):
            values = q[(slice(None), *cell)]
            known = stats.shapiro(np.log(values[values > 0]))
            assert fit["normality_w"][cell] == pytest.approx(known.statistic, abs=1e-8)
            assert fit["normality_p"][cell] == pytest.approx(known.pvalue, rel=1e-5)
        assert fit["normality_p"].attrs["long_name"] == b"raw p of Shapiro-Wilk"


def test_what_is_not_asked_for_is_not_in_the_file(here: Run, sources: Path) -> None:
    ended = here("fit", sources, "--normality", "none")
    assert len(ended.err.splitlines()) == 1
    with h5py.File(ended.path) as fit:
        assert not [name for name in fit if name.partition("_")[0] in ("normality", "eopl_normality")]
        assert "theory_n" not in fit
        assert json.loads(fit.attrs["spec_json"])["normality"] == "none"


def test_all_statistics_are_told_to_people_and_to_programs(here: Run, sources: Path) -> None:
    ended = here("fit", sources, *ALL)
    assert ended.path.is_file()
    for words in (
        "25 sources fitted",
        "ln Q normal?",
        "path lengths normal? Shapiro-Wilk with U(-.5, .5) added",
        "what describes Q best",
        "weibull",
        "tables of 5 sources left out of the fit",
        "logqinit-median",
        "gamma^(H-1)",
        "of var(ln Q) over tasks a line in the length explains",
    ):
        assert words in ended.err
    told = _told(here("fit", sources, *ALL, "--json", "-q"))
    assert told["schema"] == "qinit.fit/1"
    assert (told["tasks"], told["held_out"]) == (25, 5)
    assert list(told["statistics"]) == ["normality", "eopl_normality", "alternatives", "holdout", "theory"]


def test_a_finished_fit_tells_the_same_statistics_again(here: Run, sources: Path) -> None:
    first, again = (_told(here("fit", sources, *ALL, "--json")) for _ in range(2))
    assert again["skipped"] == 25
    assert again["statistics"] == first["statistics"]
    assert again["digest"] == first["digest"]


def test_quiet_is_quiet(here: Run, sources: Path) -> None:
    assert here("fit", sources, *ALL, "-q").err == ""


def test_every_choice_is_another_fit(here: Run, sources: Path) -> None:
    choices = (
        (),
        ("--normality", "anderson"),
        ("--normality", "lilliefors"),
        ALL[:2],
        ALL[2:3],
        ALL[3:4],
        ALL[4:],
    )
    digests = {_told(here("fit", sources, *choice, "--json", "-q"))["digest"] for choice in choices}
    assert len(digests) == len(choices)


def test_transfer_starts_the_same_from_a_fit_with_statistics(here: Run, sources: Path) -> None:
    runs = []
    for options in (("--normality", "none"), ("--check-theory", "--alternatives")):
        fit = here("fit", sources, *options, "-q").path
        ended = here("transfer", "logqinit-median", fit, "--tasks", 2, "--episodes", 20, "-q")
        assert ended.code == 0, ended.err
        runs.append(ended.path)
    with h5py.File(runs[0]) as first, h5py.File(runs[1]) as second:
        np.testing.assert_array_equal(first["start"][...], second["start"][...])
        np.testing.assert_array_equal(first["steps"][...], second["steps"][...])


def test_too_many_sources_left_out_are_refused_in_one_sentence(here: Run, sources: Path) -> None:
    ended = here("fit", sources, "--holdout", 29)
    assert (ended.code, ended.out) == (4, "")
    assert len(ended.err.splitlines()) == 1
    assert "has 30 sources to fit and --holdout 29" in ended.err


@pytest.mark.parametrize(
    "option", [("--normality", "normal"), ("--holdout", -1), ("--eopl-normality", "yes")]
)
def test_what_is_no_choice_is_a_usage_error(here: Run, sources: Path, option: tuple[Any, ...]) -> None:
    assert here("fit", sources, *option).code == 2


def test_too_few_sources_to_test_are_fitted_and_said_so(here: Run, pipeline: Any) -> None:
    ended = here("fit", pipeline.sources, *ALL[:4])
    assert ended.code == 0
    assert "none of 144 state-actions is testable" in ended.err
    told = _told(here("fit", pipeline.sources, *ALL[:4], "--json"))
    assert told["statistics"]["normality"]["rejected_raw"] is None


def test_a_dry_run_counts_the_statistics(here: Run, sources: Path) -> None:
    bytes_ = [_told(here("fit", sources, *options, "--dry-run", "--json"))["bytes"] for options in ((), ALL)]
    assert bytes_[0] < bytes_[1]


def test_the_car_has_a_theory_too(here: Run) -> None:
    family = ("mountain-car", "--bins", 6, "--tasks", 9, "--episodes", 200, "-q")
    ended = here("fit", here("train-sources", *family).path, "--check-theory", "--json")
    if ended.code == 4:
        pytest.fail(ended.err)
    assert _told(ended)["statistics"]["theory"]["state_actions"] == 108
