"""How `qinit fit` tells people of its statistics: a line for each test, a small table for what compares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.artefacts.fit_findings import Findings

MINUS = "\N{MINUS SIGN}"


def lines(findings: Findings, quantity: str = "Q") -> Iterator[str]:
    """What was found of a quantity, line by line; nothing for what was not asked for."""
    if "normality" in findings:
        yield _test(f"ln {quantity} normal", findings["normality"])
    if "eopl_normality" in findings:
        yield _test("path lengths normal", findings["eopl_normality"])
    if "alternatives" in findings:
        yield from _alternatives(findings["alternatives"], quantity)
    if "holdout" in findings:
        yield from _held_out(findings["holdout"])
    if "theory" in findings:
        yield from _theory(findings["theory"])


def _test(question: str, found: Findings) -> str:
    least, most = found["n_least"], found["n_most"]
    if not found["tested"]:
        return f"{question}? none of {found['state_actions']} state-actions is testable: that takes 8 tasks that differ"
    shares = ", ".join(
        f"{name} {_percent(found[f'rejected_{key}'])}"
        for name, key in (
            ("raw", "raw"),
            ("Benjamini-Hochberg", "benjamini_hochberg"),
            ("Benjamini-Yekutieli", "benjamini_yekutieli"),
        )
    )
    return (
        f"{question}? {found['test']}, n {least if least == most else f'{least} to {most}'}: rejected at 5 % in {shares} "
        f"of {found['tested']} state-actions, {found['not_testable']} not testable; median statistic "
        f"{_number(found['median_statistic'], 3)}, skewness {_number(found['median_skewness'], 2)}, excess kurtosis "
        f"{_number(found['median_kurtosis'], 2)}"
    )


def _alternatives(found: Findings, quantity: str) -> Iterator[str]:
    yield f"what describes {quantity} best, share of {found['tested']} state-actions that each wins:"
    rows = [
        (
            one["distribution"],
            _percent(one["aic_wins"]),
            _percent(one["log_score_wins"]),
            _number(one["median_log_score"], 3),
            _number(one["median_gain_on_lognormal"], 3),
        )
        for one in found["distributions"]
    ]
    yield from _table(("", "AIC", "held-out log score", "median score", "median less log-normal"), rows)


def _held_out(found: Findings) -> Iterator[str]:
    yield (
        f"starts against the tables of {counted(found['tasks'], 'source')} left out of the fit, mean over these ± standard error:"
    )
    rows = [
        (
            one["initialisation"],
            _with_error(one, "absolute"),
            _with_error(one, "behind"),
            _percent(one["nearest"]),
            _number(one["squared"], 4),
            _number(one["bias"], 4),
            _with_error(one, "logarithmic"),
        )
        for one in found["initialisations"]
    ]
    yield from _table(
        ("", "|error|", "behind the nearest", "nearest to", "rms error", "bias", "|error of ln|"), rows
    )


def _theory(found: Findings) -> Iterator[str]:
    yield f"ln Q as path lengths predict it, medians over {found['compared']} state-actions:"
    names = {"product": "gamma^H times the path's probability", "length": "gamma^(H-1)"}
    rows = [
        (
            names[form["form"]],
            _number(form["median_bias"], 3),
            _number(form["median_spread"], 3),
            _number(form["median_mean_ratio"], 4),
        )
        for form in found["forms"]
    ]
    yield from _table(("", "predicted less actual", "rms error", "ratio of mean Q"), rows)
    yield (
        f"of var(ln Q) over tasks a line in the length explains {_percent(found['explained_pooled'])}, the slope ln gamma "
        f"{_percent(found['explained_by_gamma_pooled'])} (all {found['varying']} state-actions that vary together; medians "
        f"{_percent(found['explained_median'])}, {_percent(found['explained_by_gamma_median'])})"
    )


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The first column to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(heading, *rows, strict=True)]
    for row in (heading, *rows):
        cells = [
            row[0].ljust(widths[0]),
            *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)),
        ]
        yield "  " + "  ".join(cells).rstrip()


def _with_error(one: dict[str, Any], name: str) -> str:
    error = one[f"{name}_error"]
    return _number(one[name], 4) + (f" ± {_number(error, 4)}" if error else "")


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:.1f} %".replace("-", MINUS)


def _number(value: float | None, decimals: int) -> str:
    return "none" if value is None else f"{value:.{decimals}f}".replace("-", MINUS)
