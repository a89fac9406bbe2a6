"""Methods look the same in every picture, and no two alike, with colour or without."""

from __future__ import annotations

import itertools

import pytest

from qinit_cli.figures.looks import KNOWN, looks
from qinit_cli.methods import METHODS
from qinit_cli.methods.plus import Plus

PLUS = [name for name, method in METHODS.items() if issubclass(method, Plus)]
TRANSFER = [label for name in PLUS for label in (name, f"{name}+logqinit-median")]
EVERY = [*METHODS, *(label for label in TRANSFER if "+" in label)]


def test_every_method_has_a_look_of_its_own() -> None:
    assert set(METHODS) <= KNOWN.keys()
    assert len({colour for colour, _, _ in KNOWN.values()}) == len(KNOWN) - 1  # zero and optimal are black


@pytest.mark.parametrize("labels", [EVERY, [*EVERY, "ops-tl rho=1", "ops-tl rho=1 nu=1"]])
def test_no_two_lines_and_no_two_bars_are_alike(labels: list[str]) -> None:
    found = looks(labels)
    assert len({(look.colour, str(look.dashes), look.marker) for look in found}) == len(labels)
    assert len({(look.colour, look.hatch) for look in found}) == len(labels)


def test_a_method_looks_the_same_whatever_it_stands_beside() -> None:
    whole = dict(zip(EVERY, looks(EVERY), strict=True))
    for label in EVERY:
        assert looks([label]) == [whole[label]]
    assert looks(["zero", "ucoi (reconstruction)"])[1] == whole["ucoi"]


def test_a_plus_has_the_colour_of_its_method_and_other_dashes_and_hatching() -> None:
    for name in PLUS:
        plain, plus = looks([name, f"{name}+mean"])
        assert plain.colour == plus.colour
        assert plain.dashes != plus.dashes
        assert plain.hatch != plus.hatch


@pytest.mark.parametrize("labels", [list(METHODS), [*TRANSFER, "zero", "logqinit-median", "optimal"]])
def test_lines_are_told_apart_without_colour(labels: list[str]) -> None:
    assert len({(look.marker, str(look.dashes), look.variant > 0) for look in looks(labels)}) == len(labels)


def test_neighbouring_bars_differ_in_hatching() -> None:
    hatches = [look.hatch for look in looks(list(METHODS))]
    assert all(one != other for one, other in itertools.pairwise(hatches))


def test_plug_ins_take_looks_that_are_free() -> None:
    found = looks(["zero", "mine", "yours", "mine k=3"])
    assert len({(look.colour, look.marker, str(look.dashes)) for look in found}) == 4
    assert found[1].colour not in {colour for colour, _, _ in KNOWN.values()}
    assert found[1].colour == found[3].colour != found[2].colour


def test_marks_of_neighbouring_lines_do_not_coincide() -> None:
    first, second = (look.line(200, at)["markevery"] for at, look in enumerate(looks(["mean", "ucoi"])))
    assert first != second
