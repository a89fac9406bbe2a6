"""One bar over all artefacts and pictures of a reproduction, by the seconds that each was expected to take."""

from __future__ import annotations

import sys
import time
from collections import deque
from typing import TYPE_CHECKING, Any, Self

from qinit_cli.commands.console import Lines, Printed, TaskBar, clock, console
from qinit_cli.commands.option_groups import Display
from qinit_cli.pipeline.reporter import Progress, Whole
from qinit_store.wording import printable

if TYPE_CHECKING:
    from qinit_cli.watch import Watch

TRUSTED_AFTER = 5.0  # expected seconds: from then on the time left is judged by how long that really took ...
WINDOW = 20  # ... of so many things: the first ones wait for the compiler


class PrintedWhole(Printed):
    """Reports on stderr, several things to make as one."""

    def whole(self, count: int, expected: float) -> Whole:
        """One bar on a terminal, else plain lines."""
        return WholeBar(self._display, count, expected)


class WholeBar(Printed, Whole):
    """The bar on a terminal, else a plain line at most every 30 s. A reporter of each artefact."""

    def __init__(self, display: Display, count: int, expected: float) -> None:
        super().__init__(display)
        self._count, self._expected = count, max(expected, 1e-9)
        self._at = 0
        self._before = 0.0  # expected seconds of what is done
        self._own = 0.0  # of what is being made
        self._lines = Lines(display)
        self._begun = deque(
            [(time.monotonic(), 0.0)], WINDOW
        )  # when each of the last began, and what was done by then
        self._bar: Any = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty() and not self._display.quiet:
            self._bar = _bar(self._display, self._expected)
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begin(self, what: str, expected: float) -> None:
        """The next of the things to make, and what it is expected to take."""
        self._before, self._own = self._before + self._own, expected
        self._at += 1
        self._begun.append((time.monotonic(), self._before))
        self.show(what, 0.0)

    def show(self, what: str, share: float, rate: str = "") -> None:
        """Shows how far it is, and that `share` of the thing that is being made is done."""
        done = self._before + self._own * min(1.0, share)
        left = f"{clock(self._left(done))} left"
        if self._bar is not None:
            self._bar.update(
                self._bar.task_ids[0],
                completed=done,
                description=printable(what),
                at=f"{self._at}/{self._count}",
                rate=rate,
                left=left,
            )
        elif self._lines.due:
            speed = f", {rate}" if rate else ""
            self._lines.say(f"{self._at} of {self._count}, {what}{speed}, {left}")

    def progress(self, what: str, done: int, total: int, watch: Watch) -> Progress:
        """The tasks of one artefact, as part of the whole."""
        return _Part(self, what, done, total, watch)

    def storing(self, what: str, total: int) -> Progress:
        """Shows nothing: what an artefact is expected to take includes it."""
        return Progress()

    def _left(self, done: float) -> float:
        since, before = self._begun[0]
        lately = done - before
        pace = (time.monotonic() - since) / lately if lately >= TRUSTED_AFTER else 1.0
        return max(0.0, self._expected - done) * pace


class _Part(TaskBar):
    """Tasks of one artefact, shown on the bar of the whole."""

    def __init__(self, whole: WholeBar, what: str, done: int, total: int, watch: Watch) -> None:
        super().__init__(Display(quiet=True), what, done, total, watch)
        self._whole = whole

    def tick(self) -> None:
        """Shows where things stand."""
        self._whole.show(self._what, self.share, self._rate())


def _bar(display: Display, expected: float) -> Any:
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        TextColumn("{task.fields[at]}"),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[left]}"),
        console=console(display, stderr=True),
        transient=True,
        expand=True,
    )
    bar.add_task("", total=expected, at="", rate="", left="")
    return bar
