"""Help in plain text: `--help` shows what people need most, `--help-all` every option; a group without a command shows its help.

Plain, because importing rich would take longer than all the rest.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup

from qinit_cli.errors import UsageError

WIDTH = 100  # of a line at most; longer ones are hard to read
SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": WIDTH}
FIRST_COLUMN = 34  # characters at most; the help of what is longer begins on a line of its own
LONGEST = 1_000  # characters of a command's help in a list: all of it
GAP = 2  # between a name and its help
EVERYTHING = "qinit.help-all"  # in a context's notes: every option is shown


def _print_everything(context: typer.Context, asked: bool) -> None:
    if asked:
        context.meta[EVERYTHING] = True
        typer.echo(context.get_help())
        raise typer.Exit


HelpAll = Annotated[
    bool,
    typer.Option(
        "--help-all",
        help="Show every option and exit.",
        metavar="",
        callback=_print_everything,
        is_eager=True,
    ),
]


class Command(TyperCommand):
    """A command whose `--help` leaves out the options that are seldom needed."""

    seldom: ClassVar[frozenset[str]] = frozenset()  # names of those options

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Writes usage, help, then arguments and options by panel; the last line says where the others stand."""
        parameters = self.get_params(ctx)
        shown = [one for one in parameters if one.name not in self.seldom or EVERYTHING in ctx.meta]
        _format_opening(self, ctx, formatter)
        for panel, some in _by_panel(shown).items():
            _write(formatter, panel, [_record(one, ctx) for one in some])
        if left_out := len(parameters) - len(shown):
            options = "option" if left_out == 1 else "options"
            _write_verbatim(formatter, "", [f"{left_out} more {options}: {ctx.command_path} --help-all"])

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """What follows the command's name: options, then the arguments, all of which must be given."""
        return ["[OPTIONS]", *(str(one.metavar) for one in self.params if one.param_type_name == "argument")]

    def get_help_option(self, ctx: Any) -> Any:
        """`--help`, a flag: it takes no value, whatever typer would show."""
        return _as_flag(super().get_help_option(ctx))


class Commands(TyperGroup):
    """A group of commands. Without one, its help goes to stderr and the exit code is that of a usage error."""

    examples: ClassVar[tuple[str, ...]] = ()  # to copy: shown as they are, never wrapped

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """What is left of the words after the group's own options."""
        if not args and not ctx.resilient_parsing:
            typer.echo(ctx.get_help(), err=True)
            raise typer.Exit(UsageError.exit_code)
        if args and not args[0].startswith("-"):
            # no option of its own: typer would load pydantic to read none
            ctx._protected_args, ctx.args = args[:1], args[1:]
            return list(ctx.args)
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Writes usage, help, the commands by panel, the options and the examples."""
        _format_opening(self, ctx, formatter)
        names: dict[str, list[str]] = {}
        for name in self.list_commands(ctx):
            names.setdefault(self.commands[name].rich_help_panel or "Commands", []).append(name)  # type: ignore[attr-defined]  # every one is typer's
        for panel, some in names.items():
            _write(formatter, panel, [(one, self.commands[one].get_short_help_str(LONGEST)) for one in some])
        _write(formatter, "Options", [one.get_help_record(ctx) for one in self.get_params(ctx)])
        _write_verbatim(formatter, "To copy", self.examples)

    def get_help_option(self, ctx: Any) -> Any:
        """`--help`, a flag: it takes no value, whatever typer would show."""
        return _as_flag(super().get_help_option(ctx))


def _as_flag(option: Any) -> Any:
    option.metavar = ""
    return option


def _format_opening(command: Any, ctx: Any, formatter: Any) -> None:
    command.format_usage(ctx, formatter)
    for paragraph in inspect.cleandoc(command.help or "").split("\n\n"):
        formatter.write_paragraph()
        for line in _filled(" ".join(paragraph.split()), formatter.width - 2):
            formatter.write(f"  {line}\n")


def _by_panel(parameters: Iterable[Any]) -> dict[str, list[Any]]:
    """The parameters by the heading they stand under: arguments first, those without one (help) last."""
    panels: dict[str, list[Any]] = {"Arguments": []}
    rest: list[Any] = []
    for one in parameters:
        if one.param_type_name == "argument":
            panels["Arguments"].append(one)
        elif one.rich_help_panel is None:
            rest.append(one)
        else:
            panels.setdefault(one.rich_help_panel, []).append(one)
    return panels | {"Help": rest}


def _record(parameter: Any, ctx: Any) -> tuple[str, str] | None:
    """Name and help of a parameter; those of an argument without its type."""
    record = parameter.get_help_record(ctx)
    if record is None or parameter.param_type_name == "option":
        return record  # type: ignore[no-any-return]  # typer's
    return parameter.metavar, record[1].removesuffix("[required]").rstrip()


def _write(formatter: Any, heading: str, records: Iterable[tuple[str, str] | None]) -> None:
    """A heading with a list below it, in which names with a hyphen stay whole; nothing without records."""
    there = [record for record in records if record is not None]
    if not there:
        return
    column = min(max(len(name) for name, _ in there) + GAP, FIRST_COLUMN)
    with formatter.section(heading):
        for name, text in there:
            names = _filled(name.replace("|", "| "), formatter.width - 4, " " * 4)
            lines = _filled(" ".join(text.split()), max(20, formatter.width - 2 - column))
            names = [line.replace("| ", "|") for line in names]
            if len(names[-1]) + GAP <= column and len(names) == 1:
                names[-1] = names[-1].ljust(column) + (lines.pop(0) if lines else "")
            for line in (*names, *(" " * column + line for line in lines)):
                formatter.write(f"  {line.rstrip()}\n")


def _filled(text: str, width: int, indent: str = "") -> list[str]:
    return textwrap.wrap(
        text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def _write_verbatim(formatter: Any, heading: str, lines: Iterable[str]) -> None:
    """Lines that are never wrapped, so that they can be copied."""
    if lines:
        formatter.write_paragraph()
        if heading:
            formatter.write_heading(heading)
        for line in lines:
            formatter.write(f"{'  ' if heading else ''}{line}\n")
