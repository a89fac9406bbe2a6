"""All claims, in the order of their numbers."""

from __future__ import annotations

from qinit_cli.claims import (
    heatmaps,
    initialisations,
    log_normality,
    path_lengths,
    sample_bound,
    transfer_methods,
)

CLAIMS = (
    path_lengths.GRIDWORLD_CLAIM,
    log_normality.GRIDWORLD_CLAIM,
    heatmaps.CLAIM,
    initialisations.BEST,
    initialisations.THIRD_CLAIM,
    initialisations.LAST,
    transfer_methods.BEATEN,
    path_lengths.START_CLAIM,
    path_lengths.NOISE_CLAIM,
    log_normality.MOUNTAIN_CAR_CLAIM,
    initialisations.BY_NOISE,
    transfer_methods.NOTHING_GAINED,
    sample_bound.CLAIM,
)

__all__ = ["CLAIMS"]
