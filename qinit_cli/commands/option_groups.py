"""The option groups that commands share."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field
from functools import cached_property
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer

from qinit_cli import cores
from qinit_cli.errors import UsageError
from qinit_cli.options import UNIONS, check, flag, help_of, option, options
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine

OF_ONE_CALL = {
    "output",
    "force",
    "dry_run",
    "import_",
    "json",
    "shard",
    "folds",
    "to",
    "what",
    "title",
    "of",
    "family",
}  # no variable or file sets them


@dataclass(frozen=True)
class Group:
    """One dataclass of options: the panel they stand under in the help, and texts for defaults that come from elsewhere."""

    owner: type[Any]
    panel: str
    default_texts: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def parameters(self) -> tuple[inspect.Parameter, ...]:
        """The options as keyword parameters that typer reads; made once, as many commands share a group."""
        return tuple(
            self._parameter(option, _typed(self._hints[option.name])) for option in options(self.owner)
        )

    @cached_property
    def seldom(self) -> tuple[str, ...]:
        """Names of the options that only --help-all shows."""
        return tuple(option.name for option in options(self.owner) if option.metadata["seldom"])

    def instance(self, values: Mapping[str, Any]) -> Any:
        """The dataclass made from parsed options; UsageError, one sentence, where they cannot be meant so."""
        try:
            return self.owner(**{name: self._given(name, values[name]) for name in self._hints})
        except ValueError as error:
            raise UsageError(str(error)) from error

    @cached_property
    def _hints(self) -> dict[str, Any]:
        hints = get_type_hints(self.owner)
        return {option.name: hints[option.name] for option in options(self.owner)}

    def _given(self, name: str, value: Any) -> Any:
        """The value, a path where the option may be one."""
        return Path(value) if isinstance(value, str) and Path in get_args(self._hints[name]) else value

    def _parameter(self, option: Field[Any], hint: Any) -> inspect.Parameter:
        meta = option.metadata
        if meta["positional"]:
            argument = typer.Argument(help=meta["help"], metavar=meta["metavar"])
            return inspect.Parameter(
                option.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=option.default or inspect.Parameter.empty,
                annotation=Annotated[hint, argument],
            )
        default_text = self.default_texts.get(option.name, meta["default_text"])
        spelled = [flag(option.name)] + ([meta["short"]] if meta["short"] else [])
        info = typer.Option(
            *spelled,
            help=help_of(option),
            metavar=_metavar(meta["metavar"], hint),
            envvar=None if option.name in OF_ONE_CALL else "QINIT_" + option.name.rstrip("_").upper(),
            show_envvar=False,
            # by identity: 0 equals False, and is a default worth showing
            show_default=default_text or (option.default is not None and option.default is not False),
            rich_help_panel=meta["panel"] or self.panel,
        )
        default = option.default if option.default is not MISSING else inspect.Parameter.empty
        return inspect.Parameter(
            option.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[hint, info]
        )


def _typed(hint: Any) -> Any:
    """The type that typer reads: what may be a text is typed as one, whatever else it may be."""
    if get_origin(hint) not in UNIONS or str not in get_args(hint):
        return hint
    return str | None if NoneType in get_args(hint) else str


def _metavar(given: str | None, hint: Any) -> str | None:
    """What stands for the value in the help; None: what typer makes of the type."""
    if hint is bool:
        return ""  # a flag takes no value, whatever typer would show
    lists = [one for one in (hint, *get_args(hint)) if get_origin(one) is list]
    return given or (f"<{get_args(lists[0])[0].__name__}>" if lists else None)


def store_option() -> Any:
    """The option that says where artefacts are kept and looked up."""
    return option(
        "qinit-store",
        "The folder of artefacts, also QINIT_STORE.",
        default_text="./qinit-store",
        metavar="DIR",
    )


@dataclass(frozen=True)
class Output:
    """Where the artefact goes."""

    output: str | None = option(
        None,
        "Write the artefact here.",
        short="-o",
        metavar="PATH",
        default_text="a name made of what it is, in the store",
    )
    store: str = store_option()
    force: bool = option(False, "Replace an artefact of that name that has other settings.", seldom=True)
    wait: bool = option(False, "Wait while another process writes the same artefact.", seldom=True)
    dry_run: bool = option(False, "Report what it would take, from a short trial; make nothing.")
    json: bool = option(False, "Print one JSON object instead of the path.")

    @property
    def keeping(self) -> Keeping:
        """The place, for the artefact that the words on the command line make."""
        output = None if self.output is None else Path(self.output)
        return Keeping(Path(self.store), output, self.force, self.wait, tuple(sys.argv[1:]))


@dataclass(frozen=True)
class OnePass:
    """What every stage takes on its command line, for scripts that give all of them the same options."""

    jobs: int | None = option(
        None,
        "Without effect: a fit is one pass over its sources.",
        low=1,
        high=cores.MOST_JOBS,
        metavar="N",
        seldom=True,
    )
    fail_fast: bool = option(
        False,
        "Without effect: no task of a fit fails alone.",
        seldom=True,
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Reading:
    """Where names of artefacts are looked up."""

    store: str = store_option()


@dataclass(frozen=True)
class Tabular:
    """How a table is printed."""

    format: Literal["table", "tsv", "csv", "json", "jsonl", "markdown"] | None = option(
        None, "How the table is printed.", default_text="table on a terminal, else tsv"
    )
    json: bool = option(False, "The same as --format json.")

    @property
    def chosen(self) -> str:
        """The format asked for, or what suits where it goes."""
        return "json" if self.json else self.format or ("table" if sys.stdout.isatty() else "tsv")


@dataclass(frozen=True)
class Imports:
    """Modules that register environments: imported because they are named on the command line, and no others."""

    import_: list[str] | None = option(
        None,
        "Import a module that registers environments; may be given several times.",
        metavar="MODULE",
        default_text="none",
        seldom=True,
    )


@dataclass(frozen=True)
class Display:
    """What is said on the way."""

    quiet: bool = option(False, "Print nothing but errors.", short="-q")
    verbose: bool = option(False, "Print more about the work.", short="-v")
    color: Literal["auto", "always", "never"] = option(
        "auto", "Colour: on a terminal unless NO_COLOR or TERM=dumb, always or never.", seldom=True
    )
    debug: bool = option(False, "Show the traceback of an error.", seldom=True)


OUTPUT = Group(Output, "Artefact")
MACHINE = Group(Machine, "Machine")
ONE_PASS = Group(OnePass, "Machine")
READING = Group(Reading, "Artefacts")
TABULAR = Group(Tabular, "Table")
IMPORTS = Group(Imports, "Environment")
DISPLAY = Group(Display, "Messages")
