"""A page of artefacts: what their kinds allow is compared, judged and drawn here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.report.numbers import listed

if TYPE_CHECKING:
    from qinit_cli.report.document import Material
    from qinit_cli.runs import Run

Described = dict[Path, dict[str, Any]]

NAMED = 4  # distributions and methods that a sentence names; more are counted


def material(paths: Sequence[Path], title: str | None, question: str | None, baseline: str) -> Material:
    """What the page is made of, in the order sources, fits, runs."""
    from qinit_cli.commands.compare import read_runs
    from qinit_cli.commands.report.described import described
    from qinit_cli.commands.report.pictures import figures
    from qinit_cli.commands.report.verdicts import judged
    from qinit_cli.report.document import Material

    artefacts = described(paths)
    kinds = {
        kind: {path: told for path, told in artefacts.items() if told["kind"] == kind}
        for kind in ("sources", "fit", "run")
    }
    runs = read_runs([str(path) for path in kinds["run"]], "") if kinds["run"] else []
    drawn, undrawn = figures(kinds["sources"], kinds["fit"], runs)
    return Material(
        title=title or _title(artefacts),
        question=question or _question(runs, baseline),
        made=[],
        artefacts=[told for kind in kinds.values() for told in kind.values()],
        compared=[("", _compared(runs, baseline))] if runs else [],
        verdicts=judged(artefacts),
        figures=drawn,
        undrawn=undrawn,
        absent=[],
    )


def _compared(runs: list[Run], baseline: str) -> dict[str, Any]:
    from qinit_cli.commands.compare import told
    from qinit_cli.stages.compare import compare

    return told(compare(runs, baseline, "return"), "return")


def _title(artefacts: Described) -> str:
    """What the artefacts are of: families with their distributions, or how many of these there are."""
    from qinit_cli.environments import family_of
    from qinit_cli.pictures.names import distribution

    found: dict[str, dict[str, None]] = {}
    for told in artefacts.values():
        family = family_of(told["spec"].get("sources", told["spec"]))
        found.setdefault(family.name, {})[distribution(family)] = None
    named = [
        f"{name}, {listed(list(own)) if len(own) <= NAMED else f'{len(own)} distributions'}"
        for name, own in found.items()
    ]
    return f"Initial values from solved tasks: {'; '.join(named)}"


def _question(runs: list[Run], baseline: str) -> str:
    methods = list(dict.fromkeys(run.label for run in runs if run.label != baseline))
    if not methods:
        return "What do source tasks know of new ones: how long are their paths, and are their values log-normal?"
    named = listed(methods) if len(methods) <= NAMED else f"{len(methods)} methods"
    do, worse = ("does", "is it") if len(methods) == 1 else ("do", "is any of them")
    against = "learning from zero" if baseline == "zero" else baseline
    return f"How {do} {named} fare on new tasks, and {worse} worse than {against}?"
