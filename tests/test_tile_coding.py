"""Tiles by hand, and functions on probes as weights."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import qmc

from qinit_cli.errors import NotAllowed
from qinit_cli.projection import Projection
from qinit_cli.tile_coding import TileCoding

UNIT_SQUARE = ((0.0, 0.0), (1.0, 1.0))


def test_tiles_of_two_grids_by_hand() -> None:
    """Two grids of 2 x 2 tiles; the second is shifted by half a tile along x and, 3 halves being one half, along y too."""
    coding = TileCoding(*UNIT_SQUARE, tilings=2, tiles=2)
    assert coding.lengths == (3, 3)
    assert coding.weights == 18
    states = np.array([[0.1, 0.1], [0.3, 0.9], [1.0, 0.0]])
    # of (0.3, 0.9) in tiles (0.6, 1.8), shifted (1.1, 2.3); of (1, 0) just below (2, 0), shifted (2.5, 0.5)
    assert coding.active(states).tolist() == [[0, 9], [1, 9 + 3 + 2], [3, 9 + 6]]


def test_offsets_are_odd_parts_of_a_tile() -> None:
    coding = TileCoding((0.0,) * 3, (1.0,) * 3, tilings=4, tiles=5)
    assert coding.offsets().tolist() == [[0, 0.25, 0.5, 0.75], [0, 0.75, 0.5, 0.25], [0, 0.25, 0.5, 0.75]]


def test_states_beyond_the_box_are_in_its_outermost_tiles() -> None:
    coding = TileCoding(*UNIT_SQUARE, tilings=1, tiles=3)
    assert coding.active(np.array([[-7.0, 0.5], [9.0, np.inf]])).tolist() == [[1], [8]]


@pytest.mark.parametrize(
    ("dimensions", "tiles", "told"),
    [(5, 2, "5 dimensions are 1944 weights"), (4, 30, "4 dimensions are 7388168 weights")],
)
def test_too_many_weights_are_refused_with_their_number(dimensions: int, tiles: int, told: str) -> None:
    with pytest.raises(NotAllowed, match=told):
        TileCoding((0.0,) * dimensions, (1.0,) * dimensions, tilings=8, tiles=tiles)


def probes(count: int = 1024) -> np.ndarray:
    return qmc.Sobol(2, scramble=False).random(count)


def learned_weights(coding: TileCoding, sources: int) -> np.ndarray:
    """As learning from zeros leaves them: sums of amounts for active tiles of the states met, (N, T, 2)."""
    rng = np.random.default_rng(3)
    weights = np.zeros((sources, coding.weights, 2))
    for source in range(sources):
        for active in coding.active(rng.random((300, 2))):
            weights[source, active, rng.integers(2)] += rng.random() / 300
    return weights


def test_the_projection_of_a_mean_is_the_mean_of_the_weights() -> None:
    coding = TileCoding(*UNIT_SQUARE, tilings=4, tiles=5)
    projection, weights = Projection(coding, probes()), learned_weights(coding, 6)
    mean = projection.values(weights).mean(axis=0)
    np.testing.assert_allclose(projection.weights(mean), weights.mean(axis=0), rtol=0, atol=1e-9)


def test_values_at_probes_are_sums_of_active_weights() -> None:
    coding = TileCoding(*UNIT_SQUARE, tilings=3, tiles=4)
    projection, weights = Projection(coding, probes(64)), learned_weights(coding, 2)
    np.testing.assert_allclose(projection.values(weights), [projection.features @ each for each in weights])


def test_a_projection_is_the_shortest_least_squares_solution() -> None:
    """numpy's pseudoinverse, where probes are too few to determine the weights."""
    coding = TileCoding(*UNIT_SQUARE, tilings=3, tiles=4)
    projection = Projection(coding, probes(32))
    values = np.random.default_rng(1).random((32, 2))
    wanted = np.linalg.pinv(projection.features.toarray()) @ values
    np.testing.assert_allclose(projection.weights(values), wanted, atol=1e-9)


def test_one_tiling_takes_the_mean_of_the_probes_in_each_tile() -> None:
    coding = TileCoding(*UNIT_SQUARE, tilings=1, tiles=2)
    projection = Projection(coding, np.array([[0.1, 0.1], [0.2, 0.2], [0.9, 0.1]]))
    values = np.array([[1.0], [3.0], [5.0]])
    np.testing.assert_allclose(projection.weights(values), [[2.0], [0.0], [5.0], [0.0]], atol=1e-9)
    assert (projection.untouched, projection.rank) == (2, 2)


def test_each_task_may_have_a_start_of_its_own() -> None:
    coding = TileCoding(*UNIT_SQUARE, tilings=2, tiles=3)
    projection = Projection(coding, probes(256))
    values = projection.values(learned_weights(coding, 3))
    together = projection.weights(values)
    for task in range(3):
        np.testing.assert_array_equal(together[task], projection.weights(values[task]))
