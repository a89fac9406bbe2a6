"""`qinit salvage`: what a damaged artefact still holds."""

from __future__ import annotations

import sys

import typer

from qinit_cli.commands.option_groups import DISPLAY, Display
from qinit_cli.commands.rewriting import REWRITING, Rewriting
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_store.wording import counted, first_few, shell_line


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "salvage",
        salvage,
        {"rewriting": REWRITING, "display": DISPLAY},
        references=(Reference("artefact", "A damaged artefact: a path, or a name in the store."),),
        help="Write a new artefact of the tasks whose digest holds; the command that made it learns the rest again.",
    )


def salvage(artefact: str, rewriting: Rewriting, display: Display) -> None:
    """Writes what holds, and prints its path."""
    from qinit_cli.artefacts.opening import open_doubtful
    from qinit_cli.commands import references
    from qinit_cli.commands.rewriting import say_written
    from qinit_cli.pipeline.origin import provenance
    from qinit_store.mend import salvage as mend
    from qinit_store.reading import describe

    path = references.one(artefact, rewriting.store, output=rewriting.output)
    target = rewriting.target(path, f"{path.stem}-salvaged.h5")
    lost = mend(
        path, target, provenance(sys.argv[1:], path), force=rewriting.force, opening=open_doubtful
    ).tolist()
    kept = describe(target).tasks
    sentence = f"{counted(kept, 'task')} kept, {len(lost)} lost"
    if lost:
        sentence += f" ({first_few(lost, 10)}); the command that made it, with {shell_line('-o', target)}, learns them again"
    say_written(target, "qinit.salvage/1", {"tasks": kept, "lost": lost}, sentence, rewriting, display)
