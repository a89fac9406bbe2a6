"""The typer app, and the one place where errors become text and exit codes."""

from __future__ import annotations

import copy
import os
import sys
import traceback
from functools import cache
from typing import Annotated, Any, TextIO

import typer

from qinit_cli import __version__, configuration, signals, streams
from qinit_cli import artefacts as artefacts  # the store learns of our kinds
from qinit_cli.commands import (
    bench,
    compare,
    config,
    doctor,
    export,
    fit,
    import_files,
    list_artefacts,
    log,
    merge,
    report,
    salvage,
    sample_size,
    sensitivity,
    show,
    verdicts,
    verify,
)
from qinit_cli.commands.console import say
from qinit_cli.commands.help import SETTINGS, Commands, HelpAll
from qinit_cli.commands.typer_commands import add_later, debugging, option_names
from qinit_cli.errors import Interrupted, QinitError, UsageError
from qinit_store.errors import StoreError, SystemFailed
from qinit_store.wording import printable

PANELS = {
    "The pipeline": (
        "train-sources",
        "import",
        "fit",
        "start",
        "transfer",
        "lifelong",
        "compare",
        "sensitivity",
        "verdicts",
    ),
    "Artefacts": ("list", "show", "plot", "report", "export", "log", "verify", "salvage", "merge"),
    "Studies": ("study", "reproduce"),
    "Planning and installation": ("tune", "sample-size", "config", "doctor", "bench"),
}
EXAMPLES = (  # the first two work as they stand, in seconds
    "qinit train-sources gridworld --size 10 --tasks 50 | qinit fit - -o fit.h5",
    "for m in zero maxqinit; do qinit transfer $m fit.h5; done | qinit compare -",
    "qinit transfer logqinit-median --help",
)


class Root(Commands):
    """The root command, whose help lists commands in the order in which they are met."""

    examples = EXAMPLES

    def list_commands(self, ctx: Any) -> list[str]:
        """The names, by panel."""
        return [name for names in PANELS.values() for name in names]


app = typer.Typer(
    cls=Root,
    name="qinit",
    pretty_exceptions_enable=False,
    context_settings=SETTINGS,
    help="Initial values for new tasks from solved ones, in tabular reinforcement learning.",
)
LATER = {  # commands with many subcommands, made when they are needed, each with an example
    "train-sources": (
        "Learn source tasks of a family and save their tables; prints the path.",
        "qinit train-sources gridworld --size 10 --tasks 50 -o sources.h5",
    ),
    "transfer": (
        "Learn target tasks from what a method starts them with; prints the path.",
        "qinit transfer logqinit-median fit.h5",
    ),
    "lifelong": (
        "Learn targets one after another; what each learned may be added to what is known; prints the path.",
        "qinit lifelong logqinit-median fit.h5 --tasks 20 --update",
    ),
    "start": (
        "Write the start table of a method as a target would get it; prints the path.",
        "qinit start logqinit-median fit.h5 -o start.npz",
    ),
    "tune": (
        "Choose a method's parameters by its sources alone, no target being seen.",
        "qinit tune ucoi sources.h5",
    ),
    "plot": (
        "Draw pictures from stored artefacts: PNG, SVG or PDF.",
        "qinit plot histograms sources.h5 -o histograms.png",
    ),
    "study": (
        "A whole experiment in one file: write, check, run and export it.",
        "qinit study init -o study.toml",
    ),
    "reproduce": (
        "Reproduce the paper: make what its figures need and draw them; prints the folder.",
        "qinit reproduce fig4 --scale quick",
    ),
}
for name, (purpose, example) in LATER.items():
    add_later(app, name, f"qinit_cli.commands.{name.replace('-', '_')}", purpose, example=example)
for module in (
    import_files,
    fit,
    compare,
    sensitivity,
    verdicts,
    list_artefacts,
    show,
    export,
    log,
    report,
    verify,
    salvage,
    merge,
    sample_size,
    config,
    doctor,
    bench,
):
    module.add_to(app)
for added in (*app.registered_commands, *app.registered_groups):
    [added.rich_help_panel] = [panel for panel, names in PANELS.items() if added.name in names]  # type: ignore[attr-defined]  # of two classes alike


FAST = {"-h", "--help", "--help-all", "-V", "--version"}  # what needs no settings


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"qinit {__version__}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", help="Print the version and exit.", callback=_print_version, is_eager=True
        ),
    ] = False,
    help_all: HelpAll = False,
) -> None:
    """Initial values for new tasks from solved ones, in tabular reinforcement learning."""


def run(arguments: list[str]) -> int:
    """Runs one command line and returns its exit code; every error is one sentence on stderr."""
    os.environ.pop(
        "SOURCE_DATE_EPOCH", None
    )  # dates nothing of ours; matplotlib and f2py fail on what is no time
    debugging.set("--debug" in arguments)
    try:
        command = _command()
        code = command.main(
            args=arguments,
            prog_name="qinit",
            standalone_mode=False,
            default_map=_configured(command, arguments),
        )
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except Interrupted as interrupted:
        return _say(str(interrupted), interrupted.exit_code)
    except BrokenPipeError:
        return _closed_pipe()
    except SystemExit as end:
        if isinstance(end.__context__, BrokenPipeError):  # typer turns a broken pipe into exit code 1
            return _closed_pipe()
        raise
    except typer.TyperException as error:
        return _say(_usage(error), UsageError.exit_code)
    except Exception as error:
        code = signals.exit_code()
        if code is not None:  # whatever caught the signal's exception made this error of it
            return code
        if debugging.get():
            sys.stderr.write(printable("".join(traceback.format_exception(error)), keep="\n"))
        return _say(*_sentence(error))


def _command() -> Any:
    """The root command, whose parts that are made when they are asked for are made anew: plug-ins may have come."""
    root = copy.copy(_read())
    root.commands = {name: copy.copy(command) for name, command in root.commands.items()}
    return root


@cache
def _read() -> Any:
    return typer.main.get_command(app)


def _configured(command: object, arguments: list[str]) -> dict[str, object] | None:
    """Defaults from configuration files, with every QINIT_* variable known; None where there are neither, or help is asked."""
    if not arguments or FAST.intersection(arguments):
        return None
    if not configuration.files() and not any(name.startswith(configuration.PREFIX) for name in os.environ):
        return None
    commands = option_names(command)
    configuration.check_variables(commands)
    return configuration.defaults(commands, configuration.settings(commands))


def _sentence(error: Exception) -> tuple[str, int]:
    match error:
        case QinitError() | StoreError():
            return str(error), error.exit_code
        case MemoryError():
            return "out of memory; fewer --jobs or smaller tasks need less", SystemFailed.exit_code
        case OSError(filename=streams.STDOUT):
            _discard(sys.stdout)
            return f"{streams.STDOUT} cannot be written: {error.strerror}", SystemFailed.exit_code
        case OSError():
            return f"the system refused: {error}", SystemFailed.exit_code
        case _:
            return (
                f"unexpected {type(error).__name__}: {error} (this is a fault of qinit; --debug shows where)",
                QinitError.exit_code,
            )


def _usage(error: typer.TyperException) -> str:
    """typer's message as one sentence, with the nearest names and where to read on."""
    message = " ".join(error.format_message().replace("Value error, ", "").split()).rstrip(".")
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    return f"{message}{' See' if message.endswith('?') else '; see'} {context.command_path} --help"


def _say(message: str, code: int) -> int:
    """The exit code, which stays what it is where stderr takes nothing: a full disk, or a reader that has gone."""
    try:
        if message:
            say(f"qinit: {message}")
    except OSError:
        _discard(sys.stderr)
    return code


def _closed_pipe() -> int:
    """Ends silently: whoever read our output has gone."""
    _discard(sys.stdout)
    return 141


def _discard(stream: TextIO) -> None:
    """Leads the stream to the null device: Python flushes it once more at exit, and would fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
