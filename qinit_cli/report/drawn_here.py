"""A page of artefacts: what their kinds allow is compared, judged and drawn here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.methods import METHODS
from qinit_cli.methods.zero import Zero
from qinit_cli.report.numbers import listed

if TYPE_CHECKING:
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.report.document import Material

Described = dict[Path, dict[str, Any]]

NAMED = 4  # distributions and methods that a sentence names; more are counted


def material(
    paths: Sequence[Path],
    title: str | None,
    question: str | None,
    baseline: str | None,
    slices: tuple[str, ...] = (),
) -> Material:
    """What the page is made of, in the order sources, fits, runs, tunings; maps of continuous states with these `slices`.

    Without a `baseline` runs are set against zero, unless several of one table are, which the page then tells.

    UsageError where there are slices and no fit is over continuous states, or its dimensions cannot be fixed so.
    """
    from qinit_cli.comparison.runs import read_runs
    from qinit_cli.plots.reported import Contents
    from qinit_cli.report.described import described
    from qinit_cli.report.document import Material
    from qinit_cli.report.judged import UNJUDGED
    from qinit_cli.report.pictures import figures
    from qinit_cli.report.verdicts import judged

    artefacts = described(paths)
    kinds = {kind: {path: told for path, told in artefacts.items() if told["kind"] == kind} for kind in KINDS}
    runs = read_runs(kinds["run"])
    contents = Contents(kinds, runs, slices)
    _check_slices(slices, kinds["fit"])
    drawn, undrawn = figures(contents)
    return Material(
        title=title or _title(artefacts),
        question=question or _question(runs, baseline or Zero.name, tuned=bool(kinds["tuning"])),
        made=[],
        artefacts=[told for kind in kinds.values() for told in kind.values()],
        compared=[("", _compared(runs, baseline))] if runs else [],
        tuned=[_tuned(path) for path in kinds["tuning"]],
        verdicts=[one for one in judged(artefacts) if one["verdict"] != UNJUDGED],
        figures=drawn,
        undrawn=undrawn,
        absent=[],
        shares=_shares(runs),
        of_claims=False,
    )


def _check_slices(slices: tuple[str, ...], fits: Described) -> None:
    from qinit_cli.artefacts.slices import state_of
    from qinit_cli.environments.tiled import TiledFamily

    families = [told["settings"].sources.family.installed() for told in fits.values()] if slices else []
    tiled = [family for family in families if isinstance(family, TiledFamily)]
    if slices and not tiled:
        raise UsageError(
            f"--slice {slices[0]}: no fit of these artefacts is over continuous states; add one, or leave it out"
        )
    for family in tiled:
        state_of(family, slices)


def _tuned(path: Path) -> dict[str, Any]:
    """What choosing parameters found."""
    from qinit_cli.artefacts.choice import Choice, row, sentences
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.options import flag

    with open_artefact(path, "tuning") as artefact:
        choice = Choice.of(artefact)
    return {
        "title": choice.label,
        "sentences": sentences(choice, path),
        "parameters": {name: flag(name) for name in choice.names},
        "rows": [row(one) for one in choice.candidates],
    }


def _compared(runs: list[ComparedRun], baseline: str | None) -> dict[str, Any]:
    from qinit_cli.comparison.rows import SeveralBaselines, compare
    from qinit_cli.comparison.table import told

    try:
        return told(compare(runs, baseline or Zero.name, "return"), "return")
    except SeveralBaselines as refusal:
        if baseline is not None:
            raise
        found = told(compare(runs, "", "return"), "return")
        alone = f"No differences: {refusal}"
        return found | {"intervals": [one | {"untested": alone} for one in found["intervals"]]}


def _shares(runs: list[ComparedRun]) -> dict[str, Any] | None:
    """What decides the average return; None where methods alone differ, or no shares can be taken."""
    from qinit_cli.comparison.sensitivity import shares_told
    from qinit_cli.comparison.varied import VariedRuns

    if not runs or not VariedRuns.of(runs).varied:
        return None
    try:
        return vars(shares_told(runs, "return"))
    except NotAllowed:
        return None


def _title(artefacts: Described) -> str:
    """What the artefacts are of: families with their distributions, or how many of these there are."""
    from qinit_cli.plots.names import distribution

    found: dict[str, dict[str, None]] = {}
    for told in artefacts.values():
        family = told["settings"].sources.family.installed()
        found.setdefault(family.name, {})[distribution(family)] = None
    named = [
        f"{name}, {listed(list(own)) if len(own) <= NAMED else f'{len(own)} distributions'}"
        for name, own in found.items()
    ]
    return f"Initial values from solved tasks: {'; '.join(named)}"


def _question(runs: list[ComparedRun], baseline: str, *, tuned: bool) -> str:
    if not runs and tuned:
        return "Which parameters are best, as far as the sources tell?"
    methods = list(dict.fromkeys(run.label for run in runs if run.label != baseline))
    if not methods:
        return "What do source tasks know of new ones: how long are their paths, and are their values log-normal?"
    named = listed(methods) if len(methods) <= NAMED else f"{len(methods)} methods"
    do, worse = ("does", "is it") if len(methods) == 1 else ("do", "is any of them")
    against = METHODS.get(baseline)
    learning = "" if against is None or against.transfers else "learning from "
    return f"How {do} {named} fare on new tasks, and {worse} worse than {learning}{baseline}?"
