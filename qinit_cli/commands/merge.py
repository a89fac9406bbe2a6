"""`qinit merge`: shares of a job put together."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import typer

from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, Display
from qinit_cli.commands.rewriting import REWRITING, Rewriting
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_store.wording import counted

SHARE = re.compile(r"-share-\d+-of-\d+")


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "merge",
        merge,
        {"rewriting": REWRITING, "display": DISPLAY},
        references=(
            Reference(
                "artefacts", "Shares of one job: paths, names in the store, or - for stdin.", several=True
            ),
        ),
        help="Join the shares of a job (--shard K/N) into the artefact that one run would have made.",
    )


def merge(artefacts: list[str], rewriting: Rewriting, display: Display) -> None:
    """Joins the shares, and prints the path of the whole."""
    from qinit_cli.artefacts.opening import open_artefact, settings_of
    from qinit_cli.commands import references
    from qinit_cli.commands.rewriting import say_written
    from qinit_cli.pipeline.origin import plug_ins_behind, provenance
    from qinit_store.mend import merge as join
    from qinit_store.reading import describe

    paths = _each_once(references.many(artefacts, rewriting.store), display)
    whole = SHARE.sub("", paths[0].name)
    name = whole if whole != paths[0].name else f"{paths[0].stem}-merged.h5"
    origin = provenance(sys.argv[1:]) | plug_ins_behind(paths[0])
    target = rewriting.target(paths[0], name)
    references.check_not_read(target, paths)
    join(paths, target, origin, force=rewriting.force, opening=open_artefact)
    made = describe(target)
    settings = settings_of(made)
    asked = made.tasks if settings is None else settings.sources.tasks
    sentence = f"{counted(made.tasks, 'task')} of {counted(len(paths), 'share')}"
    if made.tasks < asked:
        sentence += f"; {asked - made.tasks} of {asked} are in none of them"
    say_written(
        target, "qinit.merge/1", {"tasks": made.tasks, "shares": len(paths)}, sentence, rewriting, display
    )


def _each_once(paths: list[Path], display: Display) -> list[Path]:
    """The paths without those of a file that is named already, which are noted."""
    files: dict[Path, Path] = {}
    for path in paths:
        if files.setdefault(path.resolve(), path) is not path:
            note(display, f"{path} is named twice and counts once")
    return list(files.values())
