"""Typer commands made from dataclasses: each group of options is a dataclass, and the command receives one instance of each.

Families, methods and the shared groups declare their options once (qinit_cli.options.option); this file spells them for typer.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer

from qinit_cli.commands.console import compiling
from qinit_cli.commands.help import SETTINGS, Command, Commands, HelpAll
from qinit_cli.commands.option_groups import Group
from qinit_cli.registry import Registry

# whether the command that runs has --debug, QINIT_DEBUG or debug = true in a file
debugging: ContextVar[bool] = ContextVar("debugging", default=False)


@dataclass(frozen=True)
class Reference:
    """A positional argument that names artefacts."""

    name: str
    help: str
    several: bool = False

    def parameter(self) -> inspect.Parameter:
        """The argument as a parameter that typer reads."""
        info = typer.Argument(
            help=self.help,
            metavar=self.name.upper() + ("..." if self.several else ""),
            autocompletion=_artefact_names,
        )
        hint = list[str] if self.several else str
        return inspect.Parameter(
            self.name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=Annotated[hint, info]
        )


def add_command(
    app: typer.Typer,
    name: str,
    run: Callable[..., None],
    groups: Mapping[str, Group],
    *,
    references: tuple[Reference, ...] = (),
    help: str,
    panel: str | None = None,
    in_context: bool = False,
    imports: Group | None = None,
) -> None:
    """Adds to `app` the command `name`, which calls `run` with one instance per group and the references as they were typed.

    `panel` is the group of commands it stands in; with `in_context` it also receives typer's context; with
    `imports` (groups.IMPORTS) the modules that are named are imported first.
    """

    def command(**values: Any) -> None:
        debugging.set(bool(values.get("debug")))
        if imports is not None:
            from qinit_cli.environments.modules import import_named

            import_named(imports.instance(values).import_ or ())
        typed = {reference.name: values[reference.name] for reference in references}
        if in_context:
            typed["context"] = values["context"]
        given = {key: group.instance(values) for key, group in groups.items()}
        if "display" not in given:
            run(**typed, **given)
            return
        with compiling(given["display"]):
            run(**typed, **given)

    parameters = [reference.parameter() for reference in references]
    if in_context:
        keyword = inspect.Parameter.POSITIONAL_OR_KEYWORD
        parameters.insert(0, inspect.Parameter("context", keyword, annotation=typer.Context))
    shown = [*groups.values(), *([imports] if imports else [])]
    for group in shown:
        parameters += group.parameters
    parameters.append(
        inspect.Parameter("help_all", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=HelpAll)
    )
    seldom = frozenset(name for group in shown for name in group.seldom)
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    kind = type("Command", (Command,), {"seldom": seldom})
    app.command(name, cls=kind, context_settings=SETTINGS, help=help, rich_help_panel=panel)(command)


def add_each(
    app: typer.Typer,
    registry: Registry[Any],
    add: Callable[[typer.Typer, str, type[Any]], None],
    only: str | None = None,
) -> None:
    """Adds a command for each family, method or plot, or the `only` one that is asked for, if `add` makes one.

    A plug-in whose options make none is left out with a warning; for one of ours alone no plug-in is looked for.
    """
    names = list(registry) if only is None else [only] if only in registry else []
    for name in names:
        kind = registry[name]
        if registry.is_own(name):
            add(app, name, kind)
            continue
        alone = typer.Typer()
        try:
            add(alone, name, kind)
            if alone.registered_commands:
                typer.main.get_command(alone)
        except Exception as error:  # of any kind: the options are somebody else's
            registry.refuse(name, f"its options make no command: {error}")
        else:
            app.registered_commands += alone.registered_commands


def _artefact_names(context: typer.Context, arguments: list[str], incomplete: str) -> list[str]:
    """Names in the store that begin so, for the shell's completion."""
    from qinit_store.catalog import Store
    from qinit_store.errors import SystemFailed

    root = context.params.get("store") or os.environ.get("QINIT_STORE", "qinit-store")
    try:
        return [name for name in Store(Path(root)).names() if name.startswith(incomplete)]
    except SystemFailed:
        return []  # a shell that completes has no place for a message


class Later(Commands):
    """A command whose subcommands are made when they are asked for, one alone or all: help of the others stays fast."""

    module: ClassVar[str]  # whose `add_to` makes them
    whole = False  # whether all are made

    def list_commands(self, ctx: Any) -> list[str]:
        """The subcommands' names."""
        if not self.whole:
            self.commands = self._made(None)
            self.whole = True
        return super().list_commands(ctx)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The subcommand of that name, or None."""
        if cmd_name not in self.commands and not self.whole:
            self.commands = {**self.commands, **self._made(cmd_name)}  # its copies have their own
        if cmd_name not in self.commands:
            self.list_commands(ctx)  # whose names typer's error looks for the nearest among
        return super().get_command(ctx, cmd_name)

    def _made(self, only: str | None) -> Any:
        made = typer.Typer()
        import_module(self.module).add_to(made, only)
        return typer.main.get_group(made).commands


def add_later(app: typer.Typer, name: str, module: str, help: str, *, example: str) -> None:
    """Adds to `app` the command `name`, whose subcommands that module's `add_to` adds once they are needed."""
    kind = type("Later", (Later,), {"module": module, "examples": (example,)})
    app.add_typer(typer.Typer(cls=kind, callback=_group), name=name, help=help)


def _group(help_all: HelpAll = False) -> None:
    """The options of a command that has subcommands."""


def walk(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], list[Any]]]:
    """Every command below a built one with the options that a configuration may set, in order."""
    if not isinstance(command, Commands):
        yield path, [parameter for parameter in command.params if _is_setting(parameter)]
        return
    context: Any = None  # neither needs one
    for name in command.list_commands(context):
        yield from walk(command.get_command(context, name), (*path, name))


def option_names(command: Any) -> dict[tuple[str, ...], frozenset[str]]:
    """The names of the options of every command below a built one."""
    return {path: frozenset(parameter.name for parameter in parameters) for path, parameters in walk(command)}


def _is_setting(parameter: Any) -> bool:
    return parameter.param_type_name == "option" and parameter.envvar is not None
