"""What state axes cover, by Gymnasium's own bounds and by hand."""

from __future__ import annotations

import math

import gymnasium
import numpy as np
import pytest

from qinit_cli.environments import FAMILIES
from qinit_cli.environments.imported import ImportedTables


def test_mountain_car_covers_the_space_of_gymnasium() -> None:
    with gymnasium.make("MountainCar-v0") as env:
        low, high = np.array(FAMILIES["mountain-car"](bins=7).covers()).T
        np.testing.assert_array_equal(low.astype("f4"), env.observation_space.low)
        np.testing.assert_array_equal(high.astype("f4"), env.observation_space.high)


def test_bins_of_gymnasium_cover_its_bounds_or_the_ranges_asked_for() -> None:
    ranges = ["1=-2:2", "3=-3:3"]
    family = FAMILIES["gym"](env_id="CartPole-v1", goal="survived", bins="1,6,8,6", range=ranges)
    angle = math.radians(24)  # twice that at which the pole has fallen
    wanted = [(-4.8, 4.8), (-2, 2), (-angle, angle), (-3, 3)]
    np.testing.assert_allclose(family.covers(), wanted, rtol=1e-6)


def test_a_whole_number_is_in_the_middle_of_its_bin() -> None:
    assert FAMILIES["gridworld"](size=5).covers() == ((-0.5, 4.5), (-0.5, 4.5))
    blackjack = FAMILIES["gym"](env_id="Blackjack-v1", goal="reward>0")
    assert blackjack.covers() == ((-0.5, 31.5), (-0.5, 10.5), (-0.5, 1.5))


@pytest.mark.parametrize(
    ("axis", "covered"),
    [
        ("x=6", (-0.5, 5.5)),
        ("x=1", (-0.5, 0.5)),
        ("x=0.25:0.75:1.25", (0.0, 1.5)),
        ("x=0.25:0.75:1.5", (math.nan, math.nan)),
        ("x=0.25", (math.nan, math.nan)),
    ],
)
def test_coordinates_of_imported_tables_are_centres_of_bins_of_one_width(
    axis: str, covered: tuple[float, float]
) -> None:
    family = ImportedTables(states=[axis], moves=["on"])
    np.testing.assert_allclose(family.covers(), [covered], rtol=1e-15)
