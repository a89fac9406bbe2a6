"""Counts in words: one task, two tasks, and large numbers without exponents."""

from __future__ import annotations

import pytest

from qinit_store.wording import counted, magnitude, plain


@pytest.mark.parametrize(
    ("count", "told"),
    [
        (0, "0"),
        (950, "950"),
        (12_345, "12,345"),
        (999_999, "999,999"),
        (999_999.6, "1 M"),
        (1_234_567, "1.23 M"),
        (6.36e8, "636 M"),
        (999_960_000, "1 G"),
        (1.2e12, "1200 G"),
    ],
)
def test_large_counts_are_told_with_three_digits_and_no_exponent(count: float, told: str) -> None:
    assert magnitude(count) == told


def test_measures_have_no_exponent_from_a_thousand_on() -> None:
    assert [plain(value) for value in (0.2104, 12.34, 999.6, 12_345.6)] == ["0.21", "12.3", "1,000", "12,346"]


def test_one_thing_is_told_in_the_singular() -> None:
    assert [counted(count, "entry", "entries") for count in (0, 1, 2_000)] == [
        "0 entries",
        "1 entry",
        "2,000 entries",
    ]


def test_one_task_of_one_target_is_told_in_the_singular_all_along(here) -> None:  # type: ignore[no-untyped-def]
    small = ("--size", "4", "--variance", "1", "--learner", "exact", "--tasks")
    one = here("train-sources", "gridworld", *small, 1, "-o", "one.h5")
    assert one.err.splitlines()[-1].startswith("1 task learned, 0 steps in ")
    assert here("train-sources", "gridworld", *small, 1, "-o", "one.h5").err == "1 task: already complete\n"
    here("train-sources", "gridworld", *small, 3, "-o", "sources.h5")
    here("fit", "sources.h5", "-o", "fit.h5")
    for method in ("zero", "mean"):
        run = here("transfer", method, "fit.h5", "--tasks", 1, "--episodes", 1, "-o", f"{method}.h5")
        assert "1 target learned" in run.err
    compared = here("compare", "zero.h5", "mean.h5", "--format", "tsv")
    assert compared.code == 0, compared.err
    assert "1 target of seed 0, 1 episode" in compared.out
    assert "1 targets" not in compared.out + compared.err
    assert "1 episodes" not in compared.out + compared.err
