"""Slices of functions of states: entries of tables, sums of tiles on a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from qinit_cli.artefacts.slices import CELLS, GridSlice, slice_of, slice_of_axes
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.errors import NotAllowed, UsageError
from qinit_store.schema import Axis

EACH = 10  # cells of the grid along a tile, of 6


@dataclass(frozen=True)
class Room:
    """Three dimensions, as far as a slice asks."""

    name = "room"

    def box(self) -> tuple[tuple[str, float, float], ...]:
        return ("east", 0.0, 6.0), ("north", 0.0, 6.0), ("up", 0.0, 3.0)

    def target_state(self) -> tuple[float, ...]:
        return 1.0, 1.0, 2.5

    def axes(self) -> tuple[Axis, ...]:
        return (Axis("up", np.arange(3.0), "m", "height"),)


def _over(family: Any, tilings: int, probes: Any) -> TiledFamily:
    tiled = TiledFamily(family, Tiles(tilings, 6, probes=max(16, len(probes))))
    return tiled.placed(np.asarray(probes, dtype=np.float64))


def _spread(family: Any, count: int) -> Any:
    """States all over a box."""
    box = family.box()
    low, high = (np.array([one[place] for one in box]) for place in (1, 2))
    return low + np.random.default_rng(0).random((count, len(box))) * (high - low)


def test_the_slice_of_a_fit_of_one_tiling_is_its_table_entry_by_entry() -> None:
    car = MountainCar(bins=6)
    probes = _spread(car, 600)
    family = _over(car, 1, probes)
    table = np.random.default_rng(1).random((6, 6, 3))  # position, velocity, action
    position, velocity = ((probes - [-1.2, -0.07]) / [1.8, 0.14] * 6).astype(int).T
    drawn = slice_of(family).values(table[position, velocity])
    assert drawn.shape == (CELLS, CELLS, 3)
    np.testing.assert_allclose(drawn, table.repeat(EACH, axis=0).repeat(EACH, axis=1), atol=1e-9)
    assert [axis.name for axis in slice_of(family).axes] == [axis.name for axis in car.axes()]


def test_weights_are_summed_at_the_centres_of_the_grid() -> None:
    family = _over(MountainCar(), 2, _spread(MountainCar(), 16))
    along = np.arange(7.0)  # a grid's tiles along the position; the shifted grid has them half a tile earlier
    weights = np.tile(along.repeat(7), 2)[:, None]  # grid, position, velocity
    sliced = slice_of(family)
    assert isinstance(sliced, GridSlice)
    inside = (np.arange(CELLS) + 0.5) / EACH
    expected = np.floor(inside) + np.floor(inside + 0.5)
    np.testing.assert_array_equal(sliced.of_weights(weights)[..., 0], np.tile(expected[:, None], CELLS))
    alone = slice_of(family, ["velocity=0.01"])
    assert isinstance(alone, GridSlice)
    assert alone.told.startswith(", at velocity 0.01, ")
    np.testing.assert_array_equal(alone.of_weights(weights)[:, 0], expected)
    across = slice_of(family, ["position=-0.31"])  # 2.97 tiles from the left
    assert isinstance(across, GridSlice)
    np.testing.assert_array_equal(across.of_weights(weights)[:, 0], np.full(CELLS, 2.0 + 3.0))


def test_dimensions_that_are_neither_drawn_nor_fixed_are_where_targets_start() -> None:
    family = _over(Room(), 1, _spread(Room(), 16))
    weights = np.arange(6.0)[None, None, :].repeat(6, 0).repeat(6, 1).reshape(-1, 1)  # the tile's height
    usual, fixed, beside = (slice_of(family, asked) for asked in ([], ["up=0.2"], ["north=4"]))
    for sliced, axes, height in ((usual, ["east", "north"], 5.0), (fixed, ["east", "north"], 0.0)):
        assert isinstance(sliced, GridSlice)
        assert [axis.name for axis in sliced.axes] == axes
        np.testing.assert_array_equal(sliced.of_weights(weights), np.full((CELLS, CELLS, 1), height))
    assert dict(usual.at) == {"up": "2.5"}
    assert isinstance(beside, GridSlice)
    assert [(axis.name, axis.unit) for axis in beside.axes] == [("east", "1"), ("up", "m")]
    np.testing.assert_array_equal(
        beside.of_weights(weights)[..., 0], np.tile(np.arange(6.0).repeat(EACH), (CELLS, 1))
    )
    assert [axis.name for axis in slice_of(family, ["up=1", "east=2"]).axes] == ["north"]


def test_what_no_probe_tells_is_unknown() -> None:
    car = MountainCar()
    probes = _spread(car, 400)
    left = probes[:, 0] < -0.3  # the three tiles on the left
    family = _over(car, 1, probes)
    values = np.where(left, 7.0, np.nan)[:, None]
    drawn = slice_of(family).known_values(values)[..., 0]
    np.testing.assert_allclose(drawn[: CELLS // 2], 7.0)
    assert np.isnan(drawn[CELLS // 2 :]).all()


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["velocty=0"], "--slice velocty=0: mountain-car has no dimension velocty; did you mean velocity?"),
        (["velocity=1"], "--slice velocity=1: velocity is from -0.07 to 0.07"),
        (["velocity=nan"], "--slice velocity=nan: velocity is from -0.07 to 0.07"),
        (["velocity=fast"], "--slice velocity=fast: fast is no number"),
        (["velocity"], "--slice velocity: write NAME=VALUE, such as velocity=0"),
        (["velocity=0", "velocity=0.01"], "--slice velocity=0.01: velocity is 0 already"),
        (["velocity=0", "position=0"], "--slice fixes position, velocity, which leaves nothing to draw"),
    ],
)
def test_what_cannot_be_fixed_is_refused_in_a_sentence(asked: list[str], words: str) -> None:
    with pytest.raises(UsageError) as refused:
        slice_of(_over(MountainCar(), 1, _spread(MountainCar(), 16)), asked)
    assert str(refused.value).startswith(words)


def test_a_table_is_cut_at_an_entry_of_an_axis() -> None:
    world = Gridworld(size=4)
    table = np.arange(4 * 4 * 4.0).reshape(16, 4)  # row, column, action
    whole, row = slice_of(world), slice_of(world, ["row=2"])
    np.testing.assert_array_equal(whole.values(table), table.reshape(4, 4, 4))
    assert (whole.told, row.told) == ("", ", at row 2")
    np.testing.assert_array_equal(row.values(table), table.reshape(4, 4, 4)[2])
    np.testing.assert_array_equal(row.of_states(np.arange(16)), [8, 9, 10, 11])
    with pytest.raises(UsageError, match="row is a whole number from 0 to 3"):
        slice_of(world, ["row=1.5"])
    with pytest.raises(UsageError, match="gridworld has no axis rwo; did you mean row"):
        slice_of(world, ["rwo=1"])


def test_a_table_of_three_axes_needs_one_fixed() -> None:
    axes = (
        Axis("floor", np.array([b"ground", b"top"])),
        Axis("x", np.array([0.5, 1.5, 2.5])),
        Axis("y", np.arange(2)),
    )
    table = np.arange(12.0)[:, None]
    with pytest.raises(NotAllowed, match="has floor, x, y; fix the others with --slice NAME=VALUE"):
        slice_of_axes("house", axes, [])
    top = slice_of_axes("house", axes, ["floor=top"])
    np.testing.assert_array_equal(top.values(table)[..., 0], [[6, 7], [8, 9], [10, 11]])
    middle = slice_of_axes("house", axes, ["x=1.9"])  # the bin from 1 to 2
    assert middle.told == ", at x 1.5"
    np.testing.assert_array_equal(middle.values(table)[..., 0], [[2, 3], [8, 9]])
    with pytest.raises(UsageError, match="--slice floor=tpo: did you mean top"):
        slice_of_axes("house", axes, ["floor=tpo"])
    with pytest.raises(UsageError, match=r"--slice x=3.2: x is from 0.5 to 2.5"):
        slice_of_axes("house", axes, ["x=3.2"])


def test_a_row_of_a_map_is_drawn_with_its_walls(here: Any) -> None:
    from qinit_cli.plots import PLOTS

    heatmaps: Any = PLOTS["heatmaps"]
    words = ("--map", "S..#/.#.G/...G", "--learner", "exact", "--tasks", 4)
    fit = here("fit", here("train-sources", "gridworld", *words, "-q").path, "-q").path
    drawn = heatmaps(slice_=["row=1"], method=["mean"], bare=True).drawn([fit])
    values, walls = (np.ma.getmaskarray(image.get_array()) for image in drawn.figure.axes[0].images)
    assert values.tolist() == [[False, True, False, False]]
    assert walls.tolist() == [[True, False, True, True]]  # drawn in its second cell alone
