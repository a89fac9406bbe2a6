# mypy: allow-untyped-defs, allow-untyped-calls
"""Random streams of the compiled loops: xoshiro256++ (Blackman & Vigna, 2021), scalar or eight at once.

A step of learning spends one 64-bit draw, split into slip (upper 32 bits), exploration (20 bits) and pick
(lower 12 bits): slip and exploration are resolved to 2^-32 and 2^-20, and a pick among n tied actions gives
each 4096/n of 4096 values, rounded up or down to a whole. Everything else (where an episode starts,
evaluation, choices of a method) is drawn from scalar streams of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.vectors import LANES, load_words, next_words, store_words

Words = NDArray[np.uint64]

# Typed, because an untyped integer beside a uint64 makes Numba compute in floating point.
ELEVEN, NINETEEN, THIRTY_TWO, FORTY_ONE = np.uint64(11), np.uint64(19), np.uint64(32), np.uint64(41)
TWELVE, SEVENTEEN, TWENTY_THREE, FORTY_FIVE = np.uint64(12), np.uint64(17), np.uint64(23), np.uint64(45)
LOW_12, LOW_20 = np.uint64((1 << 12) - 1), np.uint64((1 << 20) - 1)


def lane_seeds(sequences: Sequence[np.random.SeedSequence]) -> Words:
    """First states of eight-lane streams, (B, 4, 8)."""
    return np.array([each.generate_state(4 * LANES, np.uint64) for each in sequences]).reshape(-1, 4, LANES)


def seeds(sequences: Sequence[np.random.SeedSequence]) -> Words:
    """First states of scalar streams, (B, 4)."""
    return np.array([each.generate_state(4, np.uint64) for each in sequences]).reshape(-1, 4)


def slip_limit(probability: float | NDArray[np.float64]) -> Words:
    """The upper 32 bits of a draw are below this with the given probability."""
    return np.asarray(np.rint(np.asarray(probability) * 2.0**32), np.uint64)


def exploration_limit(epsilon: float) -> np.uint64:
    """The exploration bits of a draw are below this with probability epsilon, to 2^-20."""
    return np.uint64(round(epsilon * 2**20))


@inner
def draw_block(words, block):
    """Writes the next draws of an eight-lane stream into `block` (a multiple of 8) and moves `words` (4, 8) on."""
    state = words.reshape(words.size)
    a, b = load_words(state, 0), load_words(state, LANES)
    c, d = load_words(state, 2 * LANES), load_words(state, 3 * LANES)
    for position in range(0, len(block), LANES):
        draws, a, b, c, d = next_words(a, b, c, d)
        store_words(block, position, draws)
    store_words(state, 0, a)
    store_words(state, LANES, b)
    store_words(state, 2 * LANES, c)
    store_words(state, 3 * LANES, d)


@inlined
def draw(words):
    """The next 64 bits of a scalar stream; moves `words` (4,) on."""
    summed = words[0] + words[3]
    result = ((summed << TWENTY_THREE) | (summed >> FORTY_ONE)) + words[0]
    shifted = words[1] << SEVENTEEN
    words[2] ^= words[0]
    words[3] ^= words[1]
    words[1] ^= words[2]
    words[0] ^= words[3]
    words[2] ^= shifted
    words[3] = (words[3] << FORTY_FIVE) | (words[3] >> NINETEEN)
    return result


@inlined
def below(words, count):
    """A uniform integer below `count` (at most 2^31), resolved to 2^-32; moves `words` on."""
    return np.int64(((draw(words) >> THIRTY_TWO) * np.uint64(count)) >> THIRTY_TWO)


@inlined
def unit(words):
    """A uniform number in [0, 1), resolved to 2^-53; moves `words` on."""
    return np.float64(draw(words) >> ELEVEN) * 2.0**-53


@inlined
def two_normals(deviation, words):
    """Two independent normals around 0 with that standard deviation, by Marsaglia's polar method; moves `words` on."""
    x, y, square = 0.0, 0.0, 0.0
    while square == 0.0 or square >= 1.0:
        x, y = 2 * unit(words) - 1, 2 * unit(words) - 1
        square = x * x + y * y
    scale = deviation * math.sqrt(-2 * math.log(square) / square)
    return scale * x, scale * y
