"""`qinit fit`: summarise source tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.option_groups import (
    DISPLAY,
    IMPORTS,
    ONE_PASS,
    OUTPUT,
    Display,
    Group,
    OnePass,
    Output,
)
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.fitted import FitOptions
from qinit_store.wording import counted

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.pipeline.fitting import Asked


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "fit",
        fit,
        {"fitting": Group(FitOptions, "Fit"), "output": OUTPUT, "one_pass": ONE_PASS, "display": DISPLAY},
        imports=IMPORTS,
        references=(
            Reference(
                "sources", "Sources: a path, a name in the store, or - for stdin, which may name several."
            ),
        ),
        help="Fit the sources' values per state-action: moments, log-normal parameters, a library; prints the path.",
    )


def fit(sources: str, fitting: FitOptions, output: Output, one_pass: OnePass, display: Display) -> None:
    """Fits the sources, publishes the fit and prints its path; several that stdin brings, each by itself."""
    from qinit_cli.commands import references
    from qinit_cli.commands.results import check_one_output, each

    paths = references.many([sources], output.store, "scipy.special", output=output.output)
    check_one_output(output, paths)
    each(paths, lambda path: _fit(path, fitting, output, display, f"{path.stem}: " if paths[1:] else ""))


def _fit(path: Path, fitting: FitOptions, output: Output, display: Display, told: str) -> None:
    """Makes one fit; what is reported of it begins with what is `told`."""
    from qinit_cli.artefacts.fit_findings import findings
    from qinit_cli.artefacts.settings import outdated
    from qinit_cli.commands.console import Printed
    from qinit_cli.commands.fit_statistics import lines
    from qinit_cli.commands.results import say_expected, say_result, warn
    from qinit_cli.environments.family import bounds_of
    from qinit_cli.pipeline.degenerate import of_fit
    from qinit_cli.pipeline.estimate import Expected
    from qinit_cli.pipeline.fitting import asked_of, bytes_of, make_fit
    from qinit_cli.pipeline.keeping import target_path
    from qinit_cli.rewards import SHARE, UNIT

    if output.dry_run:
        asked = asked_of(path, fitting)
        target = target_path(output.keeping, asked.stem, asked.settings)
        say_expected(Expected(str(target), asked.count, 0, 0, 0.0, bytes_of(asked.schema)), output, display)
        return
    made, arrays, asked = make_fit(path, fitting, output.keeping, Printed(display))
    names = {axis.name: axis.values for axis in asked.schema.axes}
    found = findings(arrays | names, fitting)
    made.tally.extra["statistics"] = found
    gamma = asked.settings.sources.learning.gamma
    bounds = bounds_of(asked.family, gamma)
    quantity = "Q" if bounds == UNIT else SHARE
    sentence = "fit: already complete" if made.complete_before else _summary(arrays, asked, quantity)
    weak = of_fit(gamma, arrays, bounds)
    warn(made, "", [*outdated(asked.settings), *weak], display)
    say_result(made, "qinit.fit/1", told + sentence, output, display, further=lines(found, quantity))


def _summary(arrays: dict[str, Any], asked: Asked, quantity: str) -> str:
    from qinit_cli.pipeline.fitting import unlearned

    selection = asked.selection
    unknown = int((arrays["n"] == 0).sum())
    masked = int(arrays["n_masked"].sum())
    meant = (
        "" if quantity == "Q" else f"; {quantity} = (Q - low) / (high - low), returns being from low to high"
    )
    sentence = (
        f"{counted(int(selection.kept.sum()), 'source')} fitted over {counted(arrays['n'].size, 'state-action')}; "
        f"{counted(masked, 'entry', 'entries')} masked ({quantity} not positive), "
        f"{counted(unknown, 'state-action')} that no source knows"
    )
    if selection.unsolvable:
        sentence += f"; {counted(selection.unsolvable, 'source')} that cannot be solved left out"
    if selection.unlearned:
        sentence += f"; {selection.unlearned} {unlearned(asked.settings.sources)}"
    return sentence + meant
