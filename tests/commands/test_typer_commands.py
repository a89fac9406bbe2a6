"""Options made from a made-up dataclass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import pytest
import typer

from qinit_cli.commands.option_groups import Group
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import check, option


@dataclass(frozen=True)
class Soup:
    """A made-up dish."""

    table_salt: float = option(0.5, "Grams of salt.", low=0, high=2)
    spoons: int = option(0, "Spoons at the table.", low=0)
    kind: Literal["leek", "pea"] = option("pea", "What is in it.", short="-k")
    guests: int | None = option(None, "Who come.", default_text="whoever is hungry")
    herbs: list[str] | None = option(None, "On top; may be given several times.", metavar="HERB")
    hot: bool = option(False, "Warm it up.")

    def __post_init__(self) -> None:
        check(self)


def _app(seen: dict[str, Any]) -> typer.Typer:
    app = typer.Typer(pretty_exceptions_enable=False)

    def cook(pots: list[str], soup: Soup) -> None:
        seen.update(pots=pots, soup=soup)

    add_command(
        app,
        "cook",
        cook,
        {"soup": Group(Soup, "Dish")},
        references=(Reference("pots", "Where to.", several=True),),
        help="Cooks.",
    )
    return app


def _cook(*arguments: str) -> dict[str, Any]:
    seen: dict[str, Any] = {}
    _app(seen)(args=list(arguments), standalone_mode=False)
    return seen


def test_without_options_the_command_receives_the_dataclass_as_it_is_by_default() -> None:
    assert _cook("large") == {"pots": ["large"], "soup": Soup()}


def test_every_option_reaches_its_field() -> None:
    typed = "a b --table-salt 1.5 --spoons 4 -k leek --guests 3 --herbs dill --herbs mint --hot"
    expected = Soup(1.5, 4, "leek", 3, ["dill", "mint"], True)
    assert _cook(*typed.split()) == {"pots": ["a", "b"], "soup": expected}


def test_what_the_dataclass_refuses_is_a_usage_error_in_its_own_words() -> None:
    with pytest.raises(UsageError, match=r"--table-salt is 3\.0; it must be from 0 to 2"):
        _cook("large", "--table-salt", "3")


def test_what_is_none_of_the_choices_is_refused() -> None:
    with pytest.raises(typer.TyperException, match="fish"):
        _cook("large", "--kind", "fish")


def test_a_flag_has_no_opposite() -> None:
    with pytest.raises(typer.TyperException, match="--no-hot"):
        _cook("large", "--no-hot")


def test_an_option_may_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QINIT_TABLE_SALT", "0.25")
    assert _cook("large")["soup"].table_salt == 0.25
    assert _cook("large", "--table-salt", "1")["soup"].table_salt == 1


def test_help_shows_every_option_with_its_help_and_default(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    _cook("--help")
    lines = capsys.readouterr().out.splitlines()
    assert "Dish:" in lines
    for each, text, default in (
        ("--table-salt", "Grams of salt. [0 to 2]", "[default: 0.5]"),
        ("--spoons", "Spoons at the table. [at least 0]", "[default: 0]"),
        ("--kind", "What is in it.", "[default: pea]"),
        ("--guests", "Who come.", "[default: (whoever is hungry)]"),
        ("--herbs", "On top; may be given several times.", ""),
        ("--hot", "Warm it up.", ""),
    ):
        [line] = [line for line in lines if each in line]
        assert text in line
        assert default in line
        assert default or "default" not in line


def test_a_default_from_elsewhere_is_told_by_the_group(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    app = typer.Typer(pretty_exceptions_enable=False)
    add_command(
        app, "cook", lambda soup: None, {"soup": Group(Soup, "Dish", {"guests": "from the diary"})}, help=""
    )
    app(args=["--help"], standalone_mode=False)
    assert "[default: (from the diary)]" in capsys.readouterr().out
