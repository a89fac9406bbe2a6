"""`qinit show`: what it says of each kind, in a pipe, as JSON and on terminals of several sorts."""

from __future__ import annotations

import csv
import fcntl
import io
import json
import math
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest

from qinit_cli.plots.terminal.curve import curve
from qinit_cli.plots.terminal.heatmap import RAMP, MapAxis, heatmap
from qinit_cli.plots.terminal.histogram import histogram
from qinit_cli.plots.terminal.sheet import Sheet, labels, ticks

if TYPE_CHECKING:
    from running import Ended, Pipeline

QINIT = Path(sys.executable).with_name("qinit")
KINDS = ("sources", "fit", "run")
ASCII = Sheet(width=80, colour=False, ascii_only=True)
BLOCKS = Sheet(width=80, colour=False, ascii_only=False)
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def _of(pipeline: Pipeline, kind: str) -> Path:
    return {"sources": pipeline.sources, "fit": pipeline.fit, "run": pipeline.runs["logqinit-median"]}[kind]


def _values(out: str) -> dict[str, str]:
    rows = list(csv.reader(io.StringIO(out), delimiter="\t"))
    assert rows[0] == ["key", "value"]
    return dict(rows[1:])


def _on_terminal(arguments: list[str], columns: int, settings: dict[str, str] | None = None) -> str:
    """What a real process writes to a terminal of so many columns."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 50, columns, 0, 0))
    environment = {**os.environ, "TERM": "xterm-256color", "LC_ALL": "C.UTF-8", **(settings or {})}
    environment.pop("COLORTERM", None)
    process = subprocess.Popen(
        [QINIT, *arguments], stdin=subprocess.DEVNULL, stdout=slave, stderr=subprocess.PIPE, env=environment
    )
    os.close(slave)
    written = b""
    while True:
        try:
            piece = os.read(master, 65536)
        except OSError:  # Linux's way to say that the other side has gone
            break
        if not piece:
            break
        written += piece
    os.close(master)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 0, error.decode()
    return written.decode().replace("\r\n", "\n")


@pytest.mark.parametrize("kind", KINDS)
def test_a_pipe_gets_a_key_and_a_value_on_each_line(
    here: Callable[..., Ended], pipeline: Pipeline, kind: str
) -> None:
    ended = here("show", _of(pipeline, kind))
    values = _values(ended.out)
    with h5py.File(_of(pipeline, kind)) as file:
        assert values["kind"] == kind
        assert values["content_sha256"] == file.attrs["content_sha256"].decode()
        assert json.loads(file.attrs["provenance_json"])["time"] == values["provenance.time"]
        for name, dataset in file.items():
            if f"datasets.{name}.shape" in values:
                assert values[f"datasets.{name}.shape"] == ",".join(map(str, dataset.shape))
                assert np.dtype(values[f"datasets.{name}.dtype"]) == dataset.dtype
            else:
                assert values[f"axes.{name}.length"] == str(dataset.size)


@pytest.mark.parametrize("kind", KINDS)
def test_json_is_one_object_with_the_spec_as_it_is_stored(
    here: Callable[..., Ended], pipeline: Pipeline, kind: str
) -> None:
    told = here("show", _of(pipeline, kind), "--json").json
    with h5py.File(_of(pipeline, kind)) as file:
        assert told["spec"] == json.loads(file.attrs["spec_json"])
        assert told["inputs"] == json.loads(file.attrs["inputs_json"])
    assert told["schema"] == "qinit.show/1"


def test_a_run_is_summed_up_as_its_episodes_say(here: Callable[..., Ended], pipeline: Pipeline) -> None:
    path = _of(pipeline, "run")
    numbers = here("show", path, "--json").json["numbers"]
    with h5py.File(path) as file:
        steps, reached = file["steps"][...], file["reached"][...].astype(bool)
        gamma = json.loads(file.attrs["spec_json"])["learning"]["gamma"]
        v_eps = file["v_eps"][...]
    earned = [
        [gamma ** (int(s) - 1) if r else 0.0 for s, r in zip(*rows, strict=True)]
        for rows in zip(steps, reached, strict=True)
    ]
    assert numbers["average_return"] == pytest.approx(np.mean(earned), rel=1e-12)
    assert numbers["first_10"] == pytest.approx(np.mean([row[:10] for row in earned]), rel=1e-12)
    assert numbers["last_tenth"] == pytest.approx(np.mean([row[-6:] for row in earned]), rel=1e-12)
    assert numbers["success"] == pytest.approx(reached.mean(), rel=1e-12)
    assert numbers["v_eps"] == pytest.approx(v_eps.mean(), rel=1e-12)
    assert (numbers["targets"], numbers["episodes"]) == steps.shape


def test_a_fit_counts_what_no_source_knows_and_what_some_do_not(
    here: Callable[..., Ended], pipeline: Pipeline
) -> None:
    numbers = here("show", pipeline.fit, "--json").json["numbers"]
    with h5py.File(pipeline.fit) as file:
        n = file["n"][...]
    sources = int(n.max())
    assert numbers["unknown"] == int((n == 0).sum())
    assert numbers["masked"] == int(((n > 0) & (n < sources)).sum())
    assert numbers["masked_entries"] == int((sources - n).sum())
    assert (numbers["n_least"], numbers["n_most"]) == (n.min(), n.max())


def test_sources_tell_solved_steps_and_errors_against_exact_tables(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    numbers = here("show", pipeline.sources, "--json").json["numbers"]
    exact = here(
        "train-sources",
        "gridworld",
        "--size",
        "6",
        "--tasks",
        "4",
        "--variance",
        "2",
        "--learner",
        "exact",
        "-o",
        tmp_path / "exact.h5",
    )
    with h5py.File(pipeline.sources) as learned, h5py.File(exact.path) as solved:
        q, best = learned["q"][...], solved["q"][...]
        assert numbers["solved"] == learned["solved"][...].sum()
        assert numbers["steps"] == learned["steps"][...].sum()
        # the target start is cell (0, 0)
        assert numbers["start_value_median"] == np.median(q[:, 0, 0].max(axis=1))
        assert numbers["entries_never_visited"] == (learned["visits"][...] == 0).sum()
    known = best > 0
    assert numbers["median_relative_error"] == pytest.approx(
        np.median((abs(q - best) / best.clip(1e-300))[known])
    )
    assert numbers["error_tasks"] == 4


def test_a_fit_in_which_nothing_is_known_has_no_numbers_that_json_lacks(
    here: Callable[..., Ended], tmp_path: Path
) -> None:
    """shen has no median: every value of it is NaN."""
    sources = here(
        "train-sources",
        "gridworld",
        "--size",
        "4",
        "--tasks",
        "3",
        "--learner",
        "exact",
        "-o",
        tmp_path / "s.h5",
    ).path
    fit = here("fit", sources, "--estimator", "shen", "-o", tmp_path / "f.h5").path
    said = here("show", fit, "--json").out
    assert not re.search(r"NaN|Infinity", said)
    assert "no known value" in here("show", fit, "--format", "table").out


def test_the_name_may_come_from_a_pipe_and_only_one(here: Callable[..., Ended], pipeline: Pipeline) -> None:
    assert here("show", "-", stdin=f"{pipeline.fit}\n").code == 0
    assert here("show", "-", stdin="").code == 4
    assert here("show", "-", stdin=f"{pipeline.fit}\n{pipeline.sources}\n").code == 2
    assert here("show", "nothing-of-that-name", "--store", pipeline.store).code == 2


def test_a_damaged_artefact_is_not_shown(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    content = bytearray(pipeline.fit.read_bytes())
    for place in range(len(content) // 2, len(content) // 2 + 4096):
        content[place] ^= 0xFF
    (tmp_path / "bad.h5").write_bytes(content)
    ended = here("show", tmp_path / "bad.h5")
    assert ended.code == 6
    assert ended.out == ""


@pytest.mark.parametrize(
    ("columns", "settings"),
    [(80, {}), (60, {"NO_COLOR": "1"}), (40, {"TERM": "dumb"})],
    ids=["80 in colour", "60 without", "40 and dumb"],
)
@pytest.mark.parametrize("kind", KINDS)
def test_no_line_is_wider_than_the_terminal_and_colour_is_shown_only_where_wanted(
    pipeline: Pipeline, kind: str, columns: int, settings: dict[str, str]
) -> None:
    out = _on_terminal(["show", str(_of(pipeline, kind))], columns, settings)
    heading, *lines = ESCAPES.sub("", out).splitlines()  # the heading is whole, so that it can be copied
    assert heading == f"{kind} {_of(pipeline, kind).stem}"
    assert max(map(len, lines)) <= columns
    assert bool(re.search(r"\x1b\[[0-9;]*[34]8;5;", out)) == (not settings)
    if "TERM" in settings:
        out.encode("ascii")


def test_without_colour_a_ramp_of_characters_carries_the_map(pipeline: Pipeline) -> None:
    out = _on_terminal(["show", str(pipeline.fit), "--color", "never"], 80)
    assert not re.search(r"\x1b\[[0-9;]*3[0-9]", out)
    assert any(line.count("@") >= 2 for line in out.splitlines())


def _plain(lines: list[object]) -> list[str]:
    return [str(line) for line in lines]


def test_the_map_puts_each_value_where_its_state_is() -> None:
    values = np.zeros((10, 10))
    values[2, 7] = 1.0
    values[9, 0] = np.nan
    axis = MapAxis("row", list(range(10)))
    lines = _plain(heatmap(values, axis, MapAxis("col", list(range(10))), ASCII))
    [line] = [line for line in lines[1:11] if "@" in line]
    assert line == " 2|              @@    |"
    assert lines[10].startswith("  |??")
    assert lines[0].strip() == "row down, col across"
    assert lines[11] == "   0 2 4 6 8"[:3] + "0   2   4   6   8"
    assert lines[-1].strip() == "? unknown"


def test_the_ramp_rises_with_the_value() -> None:
    values = np.linspace(1, 2, 10)[None, :]
    line = _plain(heatmap(values, MapAxis("r", [0]), MapAxis("c", list(range(10))), ASCII))[1]
    assert line.split("|")[1] == "".join(character * 2 for character in RAMP)


def test_values_far_apart_get_a_logarithmic_scale() -> None:
    values = np.array([[1e-6, 1e-3, 1.0]])
    lines = _plain(heatmap(values, MapAxis("r", [0]), MapAxis("c", [0, 1, 2]), ASCII))
    assert lines[1].split("|")[1] == "  ++@@"
    assert lines[-1].strip() == "log scale"


@pytest.mark.parametrize("width", [80, 60, 30])
@pytest.mark.parametrize("shape", [(30, 30), (1, 1), (200, 7), (7, 200), (1000, 1000)])
@pytest.mark.parametrize("colour", [False, True])
def test_maps_of_any_size_fit(shape: tuple[int, int], width: int, colour: bool) -> None:
    values = np.add.outer(np.arange(shape[0], dtype=float), np.arange(shape[1]))
    axes = [
        MapAxis(name, np.linspace(-1.2, 0.6, length).tolist())
        for name, length in zip("rc", shape, strict=True)
    ]
    lines = heatmap(values, *axes, Sheet(width, colour, not colour))
    assert max(line.cell_len for line in lines) <= width
    assert len(lines) <= 40


def test_coarse_maps_show_means_of_what_is_known() -> None:
    """64 x 64 entries in 80 columns: pairs of rows are averaged, and one that is half unknown is what is known of it."""
    values = np.zeros((64, 64))
    values[0, 0], values[1, 0] = 10.0, np.nan
    values[0, 1], values[1, 1] = 10.0, 0.0
    values[2:4, 0] = np.nan
    axes = [MapAxis(name, list(range(64))) for name in "rc"]
    lines = _plain(heatmap(values, *axes, ASCII))
    assert lines[-1].strip() == "a cell: mean of 2 x 1"
    assert lines[1].split("|")[1][:3] == "@+ "
    assert lines[2].split("|")[1][:3] == "?  "


def test_the_curve_climbs_from_one_corner_to_the_other() -> None:
    lines = _plain(curve(np.linspace(0, 1, 1000), ("1", "1000"), "episode", ASCII))
    columns = [line.split("|")[1].find("*") for line in lines[:12]]
    assert columns == sorted(columns, reverse=True)
    assert columns[-1] == 0
    assert lines[0].lstrip().startswith("1.0|") and lines[0].rstrip().endswith("*")  # noqa: PT018
    assert lines[11].lstrip().startswith("0.0|")
    assert re.fullmatch(r" +1 +episode +1000", lines[13])


def test_braille_says_the_same_as_asterisks() -> None:
    values = np.concatenate([np.zeros(500), np.ones(500)])
    lines = _plain(curve(values, ("1", "9"), "episode", BLOCKS))
    dots = {
        line: sum(bin(ord(c) - 0x2800).count("1") for c in text if ord(c) >= 0x2800)
        for line, text in enumerate(lines[:12])
    }
    assert dots[0] > 60
    assert dots[11] > 60
    assert all(0 < dots[line] <= 8 for line in range(1, 11))  # the step joins them


def test_flat_and_short_curves_can_be_drawn() -> None:
    for values in (np.zeros(5), np.ones(1), np.full(3, -2.0)):
        assert len(curve(values, ("1", "9"), "episode", ASCII)) == 14


def test_unknown_values_are_gaps_of_a_curve() -> None:
    values = np.full(60, np.nan)
    values[[20, 40, 41]] = 1.0, 1.0, 0.0
    top, bottom = (_plain(curve(values, ("1", "60"), "place", ASCII))[line].split("|")[1] for line in (0, 11))
    assert (top.count("*"), bottom.count("*")) == (2, 1)
    alone = np.where(np.arange(60) == 30, 1.0, np.nan)  # in the middle between two columns of 79 dots
    for sheet in (ASCII, BLOCKS):
        drawn = "".join(line[5:] for line in _plain(curve(alone, ("1", "60"), "place", sheet))[:12])
        assert len(drawn.replace(" ", "").replace("|", "").replace("│", "")) == 1
    many = np.where(np.arange(1000) == 500, 1.0, np.nan)
    assert "".join(_plain(curve(many, ("1", "1000"), "place", ASCII))[:12]).count("*") == 1
    assert _plain(curve(np.full(5, np.nan), ("1", "5"), "place", ASCII)) == ["no known value"]


def test_every_value_is_in_one_bar_of_the_histogram() -> None:
    values = np.random.default_rng(0).normal(-3, 0.6, size=200)
    lines = _plain(histogram(values, "ln Q", ASCII))
    counted = [
        (float(m[1]), float(m[2]), int(m[3]))
        for line in lines
        if (m := re.match(r" *(\S+) to +(\S+) .*?(\d+)$", line))
    ]
    assert sum(count for _, _, count in counted) == 200
    for low, high, count in counted:
        assert count == ((values >= low) & (values < high)).sum()
    assert lines[-1] == "ln Q; 200 in all"


def test_equal_values_make_one_bar() -> None:
    assert _plain(histogram(np.full(7, 2.0), "x", ASCII))[0].endswith(" 7")


@pytest.mark.parametrize(("low", "high"), [(0, 1), (-3.7, 12.1), (1e-9, 3e-9), (0, 65_000), (5, 5)])
@pytest.mark.parametrize("most", [2, 5, 14])
def test_ticks_are_round_few_and_inside(low: float, high: float, most: int) -> None:
    found = ticks(low, high, most)
    assert 1 <= len(found) <= most
    assert all(low - 1e-9 * abs(high) <= tick <= high + 1e-9 * abs(high) for tick in found)
    assert all(math.isfinite(float(text)) for text in labels(found))
