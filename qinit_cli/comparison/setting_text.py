"""The value of a setting in words, free of numpy so that help stays fast."""

from __future__ import annotations


def setting_text(value: float | str) -> str:
    """A value as it is typed, numbers with six digits at most."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
