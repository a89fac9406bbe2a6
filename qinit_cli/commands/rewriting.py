"""Options and output of the commands that make an artefact out of others: salvage and merge."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import Display, Group, store_option
from qinit_cli.errors import UsageError
from qinit_cli.options import option


@dataclass(frozen=True)
class Rewriting:
    """Where the new artefact goes."""

    output: str | None = option(
        None,
        "Write the artefact here.",
        short="-o",
        metavar="PATH",
        default_text="beside the first, under a new name",
    )
    store: str = store_option()
    force: bool = option(False, "Replace an artefact of that name that has other settings.", seldom=True)
    json: bool = option(False, "Print one JSON object instead of the path.")

    def target(self, beside: Path, name: str) -> Path:
        """The path asked for, else `name` beside an artefact."""
        target = beside.with_name(name) if self.output is None else Path(self.output)
        if target.suffix != ".h5":
            raise UsageError(f"-o {self.output}: an artefact's name ends in .h5")
        return target


REWRITING = Group(Rewriting, "Artefact")


def say_written(
    path: Path, schema: str, told: dict[str, Any], sentence: str, rewriting: Rewriting, display: Display
) -> None:
    """The sentence on stderr, then the path alone on a line, or one JSON object, on stdout."""
    from qinit_store.reading import describe

    note(display, sentence)
    if rewriting.json:
        digest = describe(path).content_sha256
        print(json.dumps({"schema": schema, "path": str(path), "digest": digest, **told}), flush=True)
    else:
        print_path(path)
