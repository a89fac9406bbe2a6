"""What a fit may hold beyond its moments: tests of normality, competing distributions, held-out errors, theory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qinit_store.schema import ANYTHING, Axis, Column


@dataclass(frozen=True)
class FitStatistics:
    """What a fit holds beyond its moments; neutral: nothing."""

    normality: str = ""  # the test of ln Q, in words
    eopl_normality: str = ""  # the test of the path lengths, in words
    distributions: tuple[str, ...] = ()  # that compete with the log-normal
    initialisations: tuple[str, ...] = ()  # whose start is set against ...
    held_out: int = 0  # ... the tables of so many sources
    theory: bool = False


def fit_statistics(
    asked: FitStatistics, state_action: tuple[str, ...]
) -> tuple[tuple[Axis, ...], tuple[Column, ...]]:
    """The axes and columns of what was asked for, beside those of every fit; see `fit.fit_schema`."""
    axes: list[Axis] = []
    columns: list[Column] = []
    if asked.normality:
        columns += _normality("normality", "ln Q", asked.normality, state_action)
    if asked.eopl_normality:
        columns += _normality("eopl_normality", "the path length", asked.eopl_normality, state_action)
    if asked.distributions:
        axes.append(_names("distribution", asked.distributions))
        dims = ("distribution", *state_action)
        columns += [
            Column(
                "alternative_aic",
                dims,
                "f8",
                long_name="AIC of the distribution of Q; the least is best",
                **ANYTHING,
            ),
            Column(
                "alternative_log_score",
                dims,
                "f8",
                long_name="mean log density of held-out values of Q; the largest is best",
                **ANYTHING,
            ),
        ]
    if asked.held_out:
        axes += [_names("initialisation", asked.initialisations), _index("held_out", asked.held_out)]
        columns += _held_out()
    if asked.theory:
        columns += _theory(state_action)
    return tuple(axes), tuple(columns)


def _normality(prefix: str, quantity: str, test: str, dims: tuple[str, ...]) -> list[Column]:
    named = (
        ("n", "i4", "tasks tested", {"low": 0}),
        ("w", "f8", f"{_statistic(test)} of {test}", ANYTHING),
        ("p", "f8", f"raw p of {test}", {"low": 0, "high": 1, "nan": True}),
        ("skewness", "f8", f"skewness of {quantity}", ANYTHING),
        ("kurtosis", "f8", f"excess kurtosis of {quantity}", ANYTHING),
    )
    return [
        Column(f"{prefix}_{name}", dims, dtype, long_name=text, **values)
        for name, dtype, text, values in named
    ]


def _statistic(test: str) -> str:
    return {"Anderson-Darling": "A squared", "Lilliefors": "D"}.get(test, "W")


def _held_out() -> list[Column]:
    named = (
        ("absolute", "mean |start - Q|"),
        ("squared", "root mean square of start - Q"),
        ("bias", "mean start - Q"),
        ("logarithmic", "mean |ln start - ln Q| where both are positive"),
        ("log_share", "share of state-actions where both are positive"),
    )
    return [
        Column(
            "held_out_task", ("held_out",), "i8", long_name="task id of the source left out of the fit", low=0
        ),
        *(
            Column(f"held_out_{name}", ("initialisation", "held_out"), "f8", long_name=text, **ANYTHING)
            for name, text in named
        ),
    ]


def _theory(dims: tuple[str, ...]) -> list[Column]:
    forms = (("product", "gamma^H times the path's probability"), ("length", "gamma^(H-1)"))
    predictions = [
        Column(f"theory_{form}_{name}", dims, "f8", long_name=f"{text}, {words}", **ANYTHING)
        for form, words in forms
        for name, text in (
            ("bias", "mean of predicted less actual ln Q"),
            ("spread", "root mean square of predicted less actual ln Q"),
            ("mean_ratio", "mean predicted over mean actual Q"),
        )
    ]
    return [
        Column("theory_n", dims, "i4", long_name="tasks with Q > 0 and a path of a step or more", low=0),
        Column("theory_variance", dims, "f8", long_name="variance of ln Q over these tasks", low=0, nan=True),
        *predictions,
        Column(
            "theory_explained",
            dims,
            "f8",
            long_name="share of var(ln Q) that a line in the length explains",
            **ANYTHING,
        ),
        Column(
            "theory_explained_by_gamma",
            dims,
            "f8",
            long_name="share of var(ln Q) that the length times ln gamma explains",
            **ANYTHING,
        ),
    ]


def _names(name: str, names: tuple[str, ...]) -> Axis:
    return Axis(name, np.array(names, dtype="S"), "", f"name of the {name}")


def _index(name: str, length: int) -> Axis:
    return Axis(name, np.arange(length, dtype=np.int64), "1", "index of the source left out of the fit")
