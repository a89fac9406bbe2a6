"""How every picture looks: as wide as a paper's column or text, safe for the colour-blind and in grey, the same bytes always."""

from __future__ import annotations

import os
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from qinit_cli.errors import UsageError

LETTER = 0.062  # inches, the width of a mean letter at 8 points
FORMATS = ("png", "svg", "pdf")
COLUMN, TEXT = 3.5, 7.0  # inches
TALLEST = 8.8  # inches, of a page
# Okabe and Ito (2008), but for yellow, which is too light for a line
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":")
# both perceptually uniform and of rising lightness: they read the same in grey and to the colour-blind
VALUE_COLOURS = "viridis"
CHANCE_COLOURS = "Greys"
UNKNOWN_COLOUR = "#d9d9d9"
# of cells that no episode is in, by what stands there: neither in the scales above nor a grey
CLOSED_COLOURS = {"wall": ("brown", "#8c510a"), "hole": ("pink", "#f768a1")}

SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same letters on every machine
    "font.size": 8,
    "figure.titlesize": 8,
    "figure.labelsize": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "lines.linewidth": 1.2,
    "hatch.linewidth": 0.6,
    "legend.frameon": False,
    "savefig.dpi": 300,
    "figure.constrained_layout.use": True,
    "text.parse_math": False,  # a label with a $ is no formula
    "svg.hashsalt": "qinit",  # element ids that do not change from run to run
    "pdf.fonttype": 42,
}


def line_styles(count: int) -> list[dict[str, Any]]:
    """Colour and dashes for each of `count` lines, no two alike up to 28."""
    colours, dashes = len(COLOURS), len(DASHES)
    return [
        {"color": COLOURS[i % colours], "linestyle": DASHES[i % dashes]}  # 7 and 4 share no divisor
        for i in range(count)
    ]


def folded(text: str, room: float, least: int = 8) -> str:
    """The text in lines of at most `room` inches, or `least` letters, where its words allow."""
    letters = max(least, int(room / LETTER))
    return "\n".join(textwrap.fill(line, letters, break_long_words=False) for line in text.split("\n"))


def plain_numbers(axis: Any) -> None:
    """Writes the axis' ticks as 0.01 or 100, never as powers, whose exponents are too small to print."""
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.10g}".replace("-", "\N{MINUS SIGN}")))


@contextmanager
def _elsewhere(folder: Path) -> Iterator[None]:
    """Within the block this folder is the current one, and no variable names a backend or settings."""
    kept = {name: os.environ.pop(name) for name in ("MPLBACKEND", "MATPLOTLIBRC") if name in os.environ}
    # a name would not lead back to a folder that was deleted; O_PATH, since not every current folder is ours to read
    here = os.open(".", getattr(os, "O_PATH", os.O_RDONLY) | os.O_DIRECTORY)
    os.chdir(folder)
    try:
        yield
    finally:
        os.fchdir(here)
        os.close(here)
        os.environ.update(kept)


def _import_matplotlib() -> None:
    """Imports matplotlib with its own settings: a user's that are wrong would end the import, and none is used anyway.

    It looks for them in the current folder before it looks where MATPLOTLIBRC says.
    """
    found = find_spec("matplotlib")
    if "matplotlib" in sys.modules or found is None or found.origin is None:
        return
    settings = Path(found.origin).parent / "mpl-data"
    with _elsewhere(settings):
        import_module("matplotlib")


@contextmanager
def house_style() -> Iterator[None]:
    """Draws within the block as every picture is drawn, whatever the user's own settings of matplotlib."""
    _import_matplotlib()
    import matplotlib

    matplotlib.use("agg")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(SETTINGS)  # type: ignore[arg-type]  # typed as a dict of literals
        yield


def checked_path(output: str) -> Path:
    """The picture's path; UsageError where its ending is none of ours or its name is a folder's."""
    path = Path(output)
    if path.suffix.lstrip(".").lower() not in FORMATS:
        raise UsageError(f"{output}: a picture ends in .png, .svg or .pdf")
    if path.is_dir():
        raise UsageError(f"{output}: that is a folder; name a picture in it")
    return path
