"""What things are called in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from qinit_cli.comparison.distinctions import above_words, joined

if TYPE_CHECKING:
    from qinit_cli.comparison.source_sets import RunGroup
    from qinit_cli.environments import Family

METRIC_LABELS = {
    "return": "discounted return",
    "success": "share of episodes at the goal",
    "steps": "steps, at most the horizon",
}
MINUS = "\N{MINUS SIGN}"


def marked(label: str, method: str, *, imported: bool = False, blended: bool = False) -> str:
    """The label of a method's line, bar or panel, with what a reader must know of it."""
    from qinit_cli.comparison.rows import remark

    known = remark(method, imported=imported, blended=blended)
    return legible(f"{label} ({known})" if known else label)


def legible(label: str) -> str:
    """The label with a blank before an underscore, which keeps a line out of a legend."""
    return f"\N{NO-BREAK SPACE}{label}" if label.startswith("_") or not label else label


def distribution(family: Family) -> str:
    """The distribution as a picture names it: the family's label without the family's name."""
    return shortened(family.label, family.name)


def shortened(label: str, family: str) -> str:
    """A distribution's label without its family's name."""
    return label.removeprefix(f"{family}-").replace("-", " ")


def distinct(names: Sequence[str], *additions: Sequence[str]) -> list[str]:
    """The names; those that stand there twice with the first addition, on a line of its own, that tells all of them apart."""
    for addition in ((), *additions):
        longer = list(names)
        if addition:
            longer = [
                f"{name}\n{more}" if names.count(name) > 1 else name
                for name, more in zip(names, addition, strict=True)
            ]
        if len(set(longer)) == len(longer):
            return longer
    return longer


def place(coordinates: Sequence[float]) -> str:
    """A state by its coordinates, such as (0, 0)."""
    return "(" + ", ".join(f"{each:g}" for each in coordinates).replace("-", MINUS) + ")"


def number(value: float) -> str:
    """Four decimals, or one beyond 10: as it is read out, never as a power."""
    return f"{value:.4f}" if abs(value) < 10 else f"{value:.1f}"


def listed(parts: Sequence[str], most: int = 12) -> str:
    """The parts as one stretch of a sentence; beyond `most` the rest is counted."""
    shown = list(parts[:most])
    return "; ".join(shown + ([f"and {len(parts) - most} more"] if len(parts) > most else []))


def group_names(groups: Sequence[RunGroup]) -> list[str]:
    """The distribution of each, above the settings that distinguish it from the others."""
    from qinit_cli.comparison.source_sets import told_of_groups

    runs = [group.any_run for group in groups]
    labels = [shortened(group.label, group.any_run.settings.family.name) for group in groups]
    words = map(joined, told_of_groups(groups))
    names = [above_words(label, own) for label, own in zip(labels, words, strict=True)]
    return distinct(names, [f"targets {run.target_digest[:8]}" for run in runs])


def families(groups: Sequence[RunGroup]) -> str:
    """The distribution where there is one, else the families."""

    families = [group.any_run.settings.family for group in groups]
    labels = dict.fromkeys(group.label for group in groups)
    return (
        next(iter(labels))
        if len(labels) == 1
        else ", ".join(dict.fromkeys(family.name for family in families))
    )
