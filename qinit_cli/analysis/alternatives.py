"""Which distribution describes Q over the tasks: log-normal, normal, gamma, Weibull, beta, or none of a
formula.

All are densities of Q itself, fitted by maximum likelihood per cell, so that AIC and log scores compare. The
empirical distribution has no density and no parameters: it is smoothed in ln Q (a normal kernel, Silverman's
bandwidth), takes part in the held-out score, and has no AIC.

Below 8 positive tasks or without spread a cell is not testable: NaN. A cell with Q >= 1 has no beta
distribution: its AIC is infinite and it never wins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from qinit_cli.analysis.normality import FEWEST_TASKS
from qinit_cli.arrays import Flags, Floats, Integers
from qinit_cli.elementary import exp, ln, ln1p, power

_STEPS = 30  # of Newton's method, which needs about ten
_SMALLEST_SPREAD = 1e-4  # of the largest value: below, all of them are the normal, and digits run out


class Density(Protocol):
    """A distribution fitted to every cell's training tasks."""

    def __call__(self, train: Floats, counted: Flags, at: Floats) -> Floats:
        """Log density of the distribution fitted to `train` (N, C) where `counted`, at `at` (M, C)."""


@dataclass(frozen=True)
class Alternatives:
    """Scores of each distribution in each cell, (D, STATE, A), in the order of `names`; NaN: not testable."""

    names: tuple[str, ...]
    scores: Floats

    def shares(self, larger_wins: bool) -> dict[str, float]:
        """Share of the testable cells that each distribution wins; 0 for all where there is none."""
        signed = self.scores if larger_wins else -self.scores
        flat = np.where(np.isnan(signed), -np.inf, signed).reshape(len(self.names), -1)
        tested = np.isfinite(flat).any(axis=0)
        wins = np.bincount(flat[:, tested].argmax(axis=0), minlength=len(self.names))
        return {
            name: float(won / max(1, int(tested.sum()))) for name, won in zip(self.names, wins, strict=True)
        }


def akaike(q: Floats) -> Alternatives:
    """AIC, 2k - 2 ln L with k = 2, of the parametric distributions over positive tasks, q (N, STATE, A)."""
    names = tuple(name for name in DENSITIES if name != EMPIRICAL)
    flat, counted = _flat(q)
    usable = _testable(flat, counted)
    scores = np.full((len(names), flat.shape[1]), np.nan)
    some, where = flat[:, usable], counted[:, usable]
    for row, name in enumerate(names):
        log_likelihood = np.sum(DENSITIES[name](some, where, some), axis=0, where=where)
        scores[row, usable] = 4 - 2 * log_likelihood
    return Alternatives(names, scores.reshape(len(names), *q.shape[1:]))


def held_out_scores(q: Floats, folds: Integers) -> Alternatives:
    """Mean log density of held-out positive values of `q` (N, STATE, A), each scored by a fit without its
    fold.

    `folds` (N,) numbers the fold of each task; tasks of a negative number are only learned from.
    A cell counts where it is testable in every fold's training tasks and has a held-out value.
    """
    flat, counted = _flat(q)
    numbers = np.unique(folds[folds >= 0])
    n = counted[folds >= 0].sum(axis=0)
    usable = np.logical_and.reduce(
        [n > 0, *(_testable(flat[folds != fold], counted[folds != fold]) for fold in numbers)]
    )
    scores = np.full((len(DENSITIES), flat.shape[1]), np.nan)
    if usable.any():
        some, where = flat[:, usable], counted[:, usable]
        totals = sum(_fold_totals(some, where, folds == fold) for fold in numbers)
        scores[:, usable] = totals / n[usable]
    return Alternatives(tuple(DENSITIES), scores.reshape(len(DENSITIES), *q.shape[1:]))


def _fold_totals(flat: Floats, counted: Flags, held: Flags) -> Floats:
    """Sum of the log densities of the `held` tasks' counted values under fits to the rest, (D, C)."""
    train, where, at = flat[~held], counted[~held], flat[held]
    return np.stack(
        [np.sum(density(train, where, at), axis=0, where=counted[held]) for density in DENSITIES.values()]
    )


def _flat(q: Floats) -> tuple[Floats, Flags]:
    """The cells in one row, masked entries replaced by a harmless 1/2."""
    flat = q.reshape(len(q), -1)
    counted = flat > 0
    return np.where(counted, flat, 0.5), counted


def _testable(flat: Floats, counted: Flags) -> Flags:
    low = np.min(flat, axis=0, where=counted, initial=np.inf)
    high = np.max(flat, axis=0, where=counted, initial=-np.inf)
    return np.asarray((counted.sum(axis=0) >= FEWEST_TASKS) & (high - low > _SMALLEST_SPREAD * high))


def _mean(values: Floats, counted: Flags) -> Floats:
    mean: Floats = np.sum(values, axis=0, where=counted) / counted.sum(axis=0)
    return mean


def _variance(values: Floats, counted: Flags) -> Floats:
    return _mean((values - _mean(values, counted)) ** 2, counted)


def normal(train: Floats, counted: Flags, at: Floats) -> Floats:
    mean, variance = _mean(train, counted), _variance(train, counted)
    return -((at - mean) ** 2) / (2 * variance) - ln(2 * np.pi * variance) / 2


def lognormal(train: Floats, counted: Flags, at: Floats) -> Floats:
    return normal(ln(train), counted, ln(at)) - ln(at)


def gamma(train: Floats, counted: Flags, at: Floats) -> Floats:
    from scipy.special import gammaln, polygamma, psi

    mean = _mean(train, counted)
    excess = -_mean(ln(train / mean), counted)  # of ln(mean) over mean(ln), above 0
    shape = (3 - excess + np.sqrt((excess - 3) ** 2 + 24 * excess)) / (12 * excess)
    for _ in range(_STEPS):  # Newton in 1/shape (Minka, 2002)
        slope = 1 / shape - polygamma(1, shape)
        inverse = 1 / shape + (ln(shape) - psi(shape) - excess) / (shape**2 * slope)
        shape = 1 / inverse
    ratio = at * shape / mean
    density: Floats = shape * ln(ratio) - ratio - ln(at) - gammaln(shape)
    return density


def weibull(train: Floats, counted: Flags, at: Floats) -> Floats:
    logs = ln(train)
    centre = _mean(logs, counted)
    logs = logs - centre
    shape = np.pi / np.sqrt(6 * _variance(logs, counted))  # that of the moments of ln Q
    largest = np.max(logs, axis=0, where=counted, initial=-np.inf)
    for _ in range(_STEPS):
        power = np.where(counted, exp(shape * (logs - largest)), 0.0)
        weight = power / power.sum(axis=0)
        tilted = np.sum(weight * logs, axis=0)
        spread = np.sum(weight * (logs - tilted) ** 2, axis=0)
        # the likelihood equation in 1/shape: tilted(shape) - 1/shape = 0, which increases in the shape
        shape = shape / (1 + (tilted - 1 / shape) * shape / (1 + shape**2 * spread))
    power = np.where(counted, exp(shape * (logs - largest)), 0.0)
    scale = largest + ln(_mean(power, counted)) / shape
    above = ln(at) - centre - scale
    density: Floats = ln(shape) + shape * above - exp(np.minimum(shape * above, 700.0)) - ln(at)
    return density


def beta(train: Floats, counted: Flags, at: Floats) -> Floats:
    from scipy.special import betaln, polygamma, psi

    inside = np.max(train, axis=0, where=counted, initial=0.0) < 1
    safe = np.where(inside, train, 0.5)
    left, right = _mean(ln(safe), counted), _mean(ln1p(-safe), counted)
    mean, variance = _mean(safe, counted), np.where(inside, _variance(safe, counted), 0.05)
    size = np.maximum(mean * (1 - mean) / variance - 1, 1e-3)
    a, b = mean * size, (1 - mean) * size
    for _ in range(_STEPS):  # Newton on the likelihood equations, in ln a and ln b so that both stay positive
        both = psi(a + b)
        first, second = psi(a) - both - left, psi(b) - both - right
        common = -polygamma(1, a + b)
        aa, bb = polygamma(1, a) + common, polygamma(1, b) + common
        determinant = aa * bb - common**2
        step_a = (bb * first - common * second) / determinant
        step_b = (aa * second - common * first) / determinant
        a = a * exp(np.clip(-step_a / a, -2, 2))
        b = b * exp(np.clip(-step_b / b, -2, 2))
    below = at < 1
    known = np.where(below, at, 0.5)
    density = (a - 1) * ln(known) + (b - 1) * ln1p(-known) - betaln(a, b)
    return np.where(below & inside, density, -np.inf)


def empirical(train: Floats, counted: Flags, at: Floats) -> Floats:
    logs, wanted = ln(train), ln(at)
    n = counted.sum(axis=0)
    ordered = np.sort(np.where(counted, logs, np.nan), axis=0)
    quartiles = np.nanquantile(ordered, [0.25, 0.75], axis=0)
    deviation = np.sqrt(_variance(logs, counted) * n / (n - 1))
    robust = (quartiles[1] - quartiles[0]) / 1.349
    width = 0.9 * np.where(robust > 0, np.minimum(deviation, robust), deviation) * power(n, -0.2)
    # task by task: all kernels at once would be N times the table
    totals = np.stack(
        [_log_sum_exp(np.where(counted, -(((w - logs) / width) ** 2) / 2, -np.inf)) for w in wanted]
    )
    density: Floats = totals - ln(n * width * np.sqrt(2 * np.pi)) - wanted
    return density


def _log_sum_exp(values: Floats) -> Floats:
    most = values.max(axis=0)
    return np.asarray(most + ln(exp(values - most).sum(axis=0)))


EMPIRICAL = "empirical"
DENSITIES: dict[str, Density] = {
    "lognormal": lognormal,
    "normal": normal,
    "gamma": gamma,
    "weibull": weibull,
    "beta": beta,
    EMPIRICAL: empirical,
}
