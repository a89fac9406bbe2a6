"""Whether the statistics of a fit can all be of the same sources."""

from __future__ import annotations

import math

import numpy as np

from qinit_cli.artefacts.settings import FitSettings
from qinit_cli.fitted import in_shares
from qinit_store.reading import Artefact

LEAST = 1e-300  # below, numbers lose digits
ESTIMATED = ("lognormal_median", "lognormal_mean")
# by which sums in other orders, and logarithms, may differ: numpy's own serve, and need no import of scipy
SLACK = 1e-6
OF_ALL = ("mean", "std", "min", "max")  # of tiles: over all sources, as estimates may be below 0
COUNTED = {"n": ("mu", "sigma", "mean", "std", "min", "max"), "eopl_n": ("eopl_mean", "eopl_std")}


def check_values(artefact: Artefact) -> None:
    """ValueError where the statistics of a fit contradict one another, or its settings."""
    _check_unknown(artefact)
    _check_moments(artefact)
    _check_sources(artefact)


def _check_unknown(artefact: Artefact) -> None:
    """ValueError if a moment is NaN though tasks were counted, or a number though none were."""
    tiled = FitSettings.read(artefact.spec).sources.family.tiled
    for count, moments in COUNTED.items():
        none = artefact.read(count) == 0
        for name in [one for one in moments if not (tiled and one in OF_ALL)]:
            if not np.array_equal(np.isnan(artefact.read(name)), none):
                raise ValueError(f"{name} must be NaN where {count} is 0, and nowhere else")


def _check_moments(artefact: Artefact) -> None:
    """ValueError where statistics of a fit contradict one another."""
    sources = FitSettings.read(artefact.spec).sources
    bounds = sources.bounds
    if not math.isfinite(bounds.width):  # of a plug-in that is not installed
        return
    tables = {name: artefact.read(name) for name in ("n", *COUNTED["n"], *ESTIMATED)}
    tables = in_shares(tables, bounds)
    known = tables["n"] > 0
    mu, sigma, mean, std, least, most, median, average = (
        tables[name][known] for name in (*COUNTED["n"], *ESTIMATED)
    )
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        low, high = np.log(np.maximum(least, 0.0)), np.log(most)
        slack = SLACK * (1 + np.abs(high))
        within = {
            "mean": (least <= mean + SLACK * np.abs(mean)) & (mean <= most + SLACK * np.abs(most)),
            "std": std <= most - least + SLACK,
            "mu": (low <= mu + SLACK * (1 + np.abs(mu))) & (mu <= high + slack),
            "sigma": sigma <= high - low + slack,
        }
        if FitSettings.read(artefact.spec).options.estimator == "mle":
            within["lognormal_median"] = np.isclose(median, np.exp(mu), rtol=SLACK, atol=LEAST)
            within["lognormal_mean"] = np.isclose(average, np.exp(mu + sigma**2 / 2), rtol=SLACK, atol=LEAST)
    for name, fits in within.items():
        if not fits.all():
            raise ValueError(f"{name} contradicts the other statistics of the fit")


def _check_sources(artefact: Artefact) -> None:
    """ValueError where a fit counts sources otherwise than its settings and its library do."""
    settings, library = FitSettings.read(artefact.spec), artefact.read("library_task")
    counted = artefact.read("n") + artefact.read("n_masked")
    fitted = settings.sources.tasks
    if counted.size and not (counted.min() == counted.max() <= fitted):
        raise ValueError(f"n and n_masked do not count the same sources everywhere, {fitted} at most")
    if (np.diff(library) <= 0).any() or library.size > settings.options.library:
        raise ValueError("library_task is no row of ascending tasks, as many at most as the settings keep")
