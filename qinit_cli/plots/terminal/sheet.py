"""What a picture in the terminal may be made of: how many columns, which characters, whether colours."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

LEAST_WIDTH = 30  # columns; a picture in fewer would be all margin

# matplotlib's viridis at 0, 1/8, ..., 1: even steps of lightness, and told apart by colour-blind readers
VIRIDIS = (
    (68, 1, 84),
    (71, 45, 123),
    (59, 82, 139),
    (44, 114, 142),
    (33, 145, 140),
    (40, 174, 128),
    (94, 201, 98),
    (173, 220, 48),
    (253, 231, 37),
)


@dataclass(frozen=True)
class Sheet:
    """Where a picture is drawn."""

    width: int
    colour: bool  # 256 colours or more: fewer cannot show a scale
    ascii_only: bool

    @classmethod
    def of(cls, console: Console) -> Sheet:
        """What the console can show; a terminal that calls itself dumb, or Linux's text console, gets ASCII."""
        plain = os.environ.get("TERM") in ("dumb", "linux")
        return cls(
            width=max(LEAST_WIDTH, console.width),
            colour=not console.no_color and console.color_system in ("256", "truecolor"),
            ascii_only=plain or console.options.ascii_only,
        )


def shade(share: float) -> str:
    """The colour of a value at `share`, 0 to 1, of the scale, as rich writes it."""
    place = min(max(share, 0.0), 1.0) * (len(VIRIDIS) - 1)
    below = min(int(place), len(VIRIDIS) - 2)
    red, green, blue = (
        round(low + (high - low) * (place - below))
        for low, high in zip(VIRIDIS[below], VIRIDIS[below + 1], strict=True)
    )
    return f"rgb({red},{green},{blue})"


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from `low` to `high`, both included, at most `most` of them; multiples of 1, 2 or 5 times ten to a power."""
    span = high - low
    if not span > 0 or most < 2:
        return [low]
    step = 10.0 ** math.floor(math.log10(span / most))
    for factor in (1, 2, 5, 10, 20):
        first = math.ceil(low / (step * factor) - 1e-9)
        last = math.floor(high / (step * factor) + 1e-9)
        if last - first < most:
            return [number * step * factor for number in range(first, last + 1)]
    return [low]


def label(value: float) -> str:
    """A number on an axis, three digits of it."""
    return f"{value:.3g}" if value else "0"


def labels(values: Sequence[float]) -> list[str]:
    """Numbers on one axis with as many decimals as tell them apart."""
    for decimals in range(7):
        texts = [f"{value:.{decimals}f}" for value in values]
        if all(
            math.isclose(float(text), value, abs_tol=1e-12) for text, value in zip(texts, values, strict=True)
        ):
            return texts
    return [label(value) for value in values]
