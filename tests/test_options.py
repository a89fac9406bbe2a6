from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Literal

import pytest

from qinit_cli.options import check, flag, option, options


@dataclass(frozen=True)
class Soup:
    """A made-up dish."""

    salt: float = option(0.5, "Grams of it.", low=0, high=2)
    spoons: int = option(1, "At the table.", low=1)
    heat: float = option(20.0, "Of the plate.", high=90)
    kind: Literal["leek", "pea"] = option("pea", "What is in it.")
    herb: Literal["mint", "dill"] | None = option(None, "On top.")
    guests: int | None = option(None, "Who come.", low=1)
    hot: bool = option(False, "Warm it up.")
    secret: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        check(self)


def test_options_are_the_fields_declared_as_such_in_order() -> None:
    assert [each.name for each in options(Soup)] == [
        "salt",
        "spoons",
        "heat",
        "kind",
        "herb",
        "guests",
        "hot",
    ]


def test_an_option_keeps_its_default_and_its_help() -> None:
    salt = options(Soup)[0]
    assert (salt.default, salt.metadata["help"]) == (0.5, "Grams of it.")
    assert asdict(Soup())["salt"] == 0.5


def test_underscores_are_dashes_on_the_command_line() -> None:
    assert flag("p_low") == "--p-low"


def test_bounds_are_part_of_the_range() -> None:
    assert Soup(salt=0).salt == 0
    assert Soup(salt=2).salt == 2


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"salt": -0.1}, "--salt is -0.1; it must be from 0 to 2"),
        ({"salt": 2.1}, "--salt is 2.1; it must be from 0 to 2"),
        ({"spoons": 0}, "--spoons is 0; it must be at least 1"),
        ({"heat": 91.0}, "--heat is 91.0; it must be at most 90"),
        ({"guests": 0}, "--guests is 0; it must be at least 1"),
        ({"salt": math.nan}, "--salt is nan; it must be a finite number"),
        ({"heat": -math.inf}, "--heat is -inf; it must be a finite number"),
        ({"kind": None}, "--kind is None; it is one of leek, pea"),
        ({"kind": "fish"}, "--kind is 'fish'; it is one of leek, pea"),
    ],
)
def test_what_is_out_of_range_is_refused_with_a_sentence(wrong: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match="^" + sentence.replace(".", r"\.") + "$"):
        Soup(**wrong)  # type: ignore[arg-type]


def test_a_choice_that_may_be_left_out_is_checked_too() -> None:
    assert Soup(herb="dill").herb == "dill"
    with pytest.raises(ValueError, match="--herb is 'basil'; it is one of mint, dill"):
        Soup(herb="basil")  # type: ignore[arg-type]


def test_a_flag_is_no_number() -> None:
    assert Soup(hot=True).hot is True
