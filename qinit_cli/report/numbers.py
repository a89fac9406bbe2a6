"""Numbers as people read them in a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

NOTHING = "–"
LEAST_P = 0.0001


def number(value: Any) -> str:
    """Whole numbers in thousands, others with four digits that count at least; a dash where there is none."""
    if value is None or value == "":
        return NOTHING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return minus(f"{value:,}")
    if isinstance(value, float):
        size = abs(value)
        return minus(f"{value:,.1f}" if size >= 100 else f"{value:.2f}" if size >= 10 else f"{value:.4f}")
    return str(value)


def interval(low: Any, high: Any) -> str:
    """Both bounds; nothing where there are none."""
    return "" if low is None or high is None else f"[{number(low)}, {number(high)}]"


def probability(p: Any) -> str:
    """A p-value."""
    return f"< {LEAST_P}" if isinstance(p, float) and p < LEAST_P else number(p)


def setting(value: Any) -> str:
    """A setting as it was typed, but for yes and no."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "none" if value is None else f"{value:.10g}" if isinstance(value, float) else str(value)


def minus(text: str) -> str:
    """The text with a minus sign for each hyphen."""
    return text.replace("-", "\N{MINUS SIGN}")


def listed(words: Sequence[str]) -> str:
    """One, two and three."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
