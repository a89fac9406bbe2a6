"""Methods look the same in every picture, and no two alike, with colour or without."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import pytest

from qinit_cli.methods import METHODS
from qinit_cli.methods.method import Initialisation, Look
from qinit_cli.methods.plus import Plus
from qinit_cli.plots.looks import Appearance, appearances


@dataclass(frozen=True)
class Shown:
    """A line of a method."""

    label: str
    method: str
    plus: bool = False


def started(name: str, init: str = "logqinit-median") -> Shown:
    return Shown(f"{name}+{init}", name, True)


def looks(lines: Sequence[Shown]) -> list[Appearance]:
    found = appearances(lines)
    return [found[line.label] for line in lines]


PLAIN = [Shown(name, name) for name in METHODS]
PLUS = [name for name, method in METHODS.items() if issubclass(method, Plus)]
TRANSFER = [line for name in PLUS for line in (Shown(name, name), started(name))]
EVERY = [*PLAIN, *(started(name) for name in PLUS)]
VARIANTS = [Shown("ops-tl rho=1", "ops-tl"), Shown("ops-tl rho=1 nu=1", "ops-tl")]
REFERENCES = [Shown(name, name) for name in ("zero", "logqinit-median", "optimal")]


def test_every_method_has_a_look_of_its_own() -> None:
    colours = [method.look.colour for method in METHODS.values()]
    assert all(colours)
    assert len(set(colours)) == len(colours) - 1  # zero and optimal are black


@pytest.mark.parametrize("lines", [EVERY, [*EVERY, *VARIANTS]])
def test_no_two_lines_and_no_two_bars_are_alike(lines: list[Shown]) -> None:
    found = looks(lines)
    assert len({(look.colour, str(look.dashes), look.marker) for look in found}) == len(lines)
    assert len({(look.colour, look.hatch) for look in found}) == len(lines)


def test_a_method_looks_the_same_whatever_it_stands_beside() -> None:
    whole = appearances(EVERY)
    for line in EVERY:
        assert looks([line]) == [whole[line.label]]
    assert looks([PLAIN[0], Shown("ucoi (reconstruction)", "ucoi")])[1] == whole["ucoi"]


def test_a_plus_has_the_colour_of_its_method_and_other_dashes_and_hatching() -> None:
    for name in PLUS:
        plain, plus = looks([Shown(name, name), started(name, "mean")])
        assert plain.colour == plus.colour
        assert plain.dashes != plus.dashes
        assert plain.hatch != plus.hatch


@pytest.mark.parametrize("lines", [PLAIN, [*TRANSFER, *REFERENCES]])
def test_lines_are_told_apart_without_colour(lines: list[Shown]) -> None:
    found = looks(lines)
    assert len({(look.marker, str(look.dashes), look.variant > 0) for look in found}) == len(lines)


def test_neighbouring_bars_differ_in_hatching() -> None:
    hatches = [look.hatch for look in looks(PLAIN)]
    assert all(one != other for one, other in itertools.pairwise(hatches))


def test_methods_without_a_look_take_what_is_free() -> None:
    mine, yours = Shown("mine", "mine"), Shown("yours", "yours")
    found = looks([PLAIN[0], mine, yours, Shown("mine k=3", "mine")])
    assert len({(look.colour, look.marker, str(look.dashes)) for look in found}) == 4
    assert found[1].colour not in {method.look.colour for method in METHODS.values()}
    assert found[1].colour == found[3].colour != found[2].colour


def test_a_plug_ins_method_looks_as_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Mine(Initialisation):
        """Mine."""

        name: ClassVar[str] = "mine"
        formula: ClassVar[str] = "0"
        look: ClassVar[Look] = Look("#123456", "h", "xx")

    monkeypatch.setitem(METHODS._loaded, "mine", Mine)  # as an entry point would
    plain, other = looks([Shown("mine", "mine"), Shown("mine k=3", "mine")])
    assert (plain.colour, plain.marker, plain.hatch) == ("#123456", "h", "xx")
    assert (other.colour, other.marker) == ("#123456", "h")
    assert other.hatch != plain.hatch


def test_marks_of_neighbouring_lines_do_not_coincide() -> None:
    pair = [Shown("mean", "mean"), Shown("ucoi", "ucoi")]
    first, second = (look.line(200, at)["markevery"] for at, look in enumerate(looks(pair)))
    assert first != second


def test_a_method_has_a_whole_line_and_its_variant_a_broken_one() -> None:
    found = looks([Shown("ucoi", "ucoi"), Shown("ucoi kappa=3.0", "ucoi")])
    assert [one.dashes for one in found] == ["-", "--"]
