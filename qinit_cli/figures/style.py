"""How every picture looks: one column of a paper wide, colour-blind safe, told apart in grey, the same bytes each time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
WIDTH = 3.5  # inches, one column
# Okabe and Ito (2008), but for yellow, which is too light for a line
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":")

SETTINGS: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "savefig.dpi": 300,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "qinit",  # element ids that do not change from run to run
    "pdf.fonttype": 42,
}


def line_styles(count: int) -> list[dict[str, Any]]:
    """Colour and dashes for each of `count` lines, no two alike up to 28."""
    colours, dashes = len(COLOURS), len(DASHES)
    return [
        {"color": COLOURS[i % colours], "linestyle": DASHES[(i + i // colours) % dashes]}
        for i in range(count)
    ]


@contextmanager
def house_style() -> Iterator[None]:
    """Draws within the block as every picture is drawn."""
    import matplotlib

    matplotlib.use("agg")
    with matplotlib.rc_context(SETTINGS):  # type: ignore[arg-type]  # typed as a dict of literals
        yield


def checked_path(output: str) -> Path:
    """The picture's path; UsageError where its ending is none of ours or its folder is missing."""
    path = Path(output)
    if path.suffix.lstrip(".").lower() not in FORMATS:
        raise UsageError(f"{output}: a picture ends in .png, .svg or .pdf")
    if not path.parent.is_dir():
        raise UsageError(f"{output}: there is no folder {path.parent}")
    return path


def save(figure: Figure, path: Path) -> None:
    """Writes the figure whole or not at all; the same figure gives the same bytes."""
    import io

    dates = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None, "ModDate": None}}
    kind = path.suffix.lstrip(".").lower()
    image = io.BytesIO()
    figure.savefig(image, format=kind, metadata=dates[kind])
    beside = path.with_name(f".{path.name}.part")
    beside.write_bytes(image.getvalue())
    beside.replace(path)
