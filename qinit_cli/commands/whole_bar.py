"""One bar over all artefacts and pictures of a study, by the seconds that they take."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from qinit_cli.commands.console import Lines, Printed, TaskBar, announced, clock, console
from qinit_cli.commands.option_groups import Display
from qinit_cli.pipeline.pace import UnderWay
from qinit_cli.pipeline.reporter import Progress, Whole
from qinit_cli.study.standing import SCHEMA
from qinit_store.wording import counted, printable

if TYPE_CHECKING:
    from qinit_cli.pipeline.pace import Kind, Pace
    from qinit_cli.watch import Watch

WRITTEN_EVERY = 2.0  # seconds: where a study stands, for `qinit study status`


class PrintedWhole(Printed):
    """Reports on stderr, several things to make as one."""

    def whole(self, count: int, pace: Pace, kept: Path) -> Whole:
        """One bar on a terminal, else plain lines."""
        return WholeBar(self._display, count, pace, kept)


class WholeBar(Printed, Whole):
    """The bar on a terminal, else a plain line at most every 30 s. A reporter of each artefact, in the thread that makes it."""

    def __init__(self, display: Display, count: int, pace: Pace, kept: Path) -> None:
        Printed.__init__(self, display)
        Whole.__init__(self, pace)
        self._count, self._kept = count, kept
        self._begun = 0
        self._under_way: dict[int, UnderWay] = {}  # by thread
        self._most = 1  # that were under way at once
        self._lock = threading.RLock()
        self._lines = Lines(display)
        self._started = time.monotonic()
        self._written = -WRITTEN_EVERY
        self._bar: Any = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty() and not self._display.quiet:
            self._bar = _bar(self._display)
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()
        self._kept.unlink(missing_ok=True)

    @contextmanager
    def thing(self, what: str, kind: Kind, foreseen: float) -> Iterator[None]:
        """Around the making of one thing; what it took while kernels were compiled says nothing of the next."""
        thread, before, began = threading.get_ident(), announced(), time.monotonic()
        with self._lock:
            self._begun += 1
            self._under_way[thread] = UnderWay(what, kind, foreseen)
            self._most = max(self._most, len(self._under_way))
        self.show()
        try:
            yield
        finally:
            taken = time.monotonic() - began
            with self._lock:
                if announced() > before:
                    taken = min(taken, foreseen * self.pace.factor(kind))
                del self._under_way[thread]
                self.pace.took(kind, foreseen, taken)

    def show(self, share: float | None = None, rate: str = "") -> None:
        """Shows how far it is, and that this `share` is done of the thing that this thread makes."""
        with self._lock:
            if share is not None and (own := self._under_way.get(threading.get_ident())):
                own.share = min(1.0, share)
            left = self.pace.left(self._under_way.values()) / self._most
            passed = time.monotonic() - self._started
            what = _together([one.what for one in self._under_way.values()])
            self._write(left)
            if self._bar is not None:
                self._bar.update(
                    self._bar.task_ids[0],
                    completed=passed,
                    total=max(passed + left, 1e-9),
                    description=printable(what),
                    at=f"{self._begun}/{self._count}",
                    rate=rate,
                    left=f"{clock(left)} left",
                )
            elif self._lines.due:
                speed = f", {rate}" if rate else ""
                self._lines.say(f"{self._begun} of {self._count}, {what}{speed}, {clock(left)} left")

    def progress(self, what: str, done: int, total: int, watch: Watch) -> Progress:
        """The tasks of one artefact, as part of the whole."""
        return _Part(self, what, done, total, watch)

    def storing(self, what: str, total: int) -> Progress:
        """Shows nothing: what an artefact is expected to take includes it."""
        return Progress()

    def _write(self, left: float) -> None:
        """Keeps where it stands in a file, whole or not at all; a failure to do so ends nothing."""
        now = time.monotonic()
        if now - self._written < WRITTEN_EVERY:
            return
        self._written = now
        told = {
            "schema": SCHEMA,
            "pid": os.getpid(),
            "host": os.uname().nodename,
            "updated": time.time(),
            "running": round(now - self._started, 1),
            "begun": self._begun,
            "of": self._count,
            "under_way": [
                {"what": one.what, "share": round(one.share, 4)} for one in self._under_way.values()
            ],
            "left": round(left, 1),
        }
        beside = self._kept.with_name(f"{self._kept.name}.part")
        try:
            beside.write_text(json.dumps(told), "utf-8")
            beside.replace(self._kept)
        except OSError as error:
            self.detail(f"{self._kept} cannot be written: {error.strerror}")


class _Part(TaskBar):
    """Tasks of one artefact, shown on the bar of the whole."""

    def __init__(self, whole: WholeBar, what: str, done: int, total: int, watch: Watch) -> None:
        super().__init__(Display(quiet=True), what, done, total, watch)
        self._whole = whole

    def tick(self) -> None:
        """Shows where things stand."""
        self._whole.show(self.share, self._rate())


def _together(names: list[str]) -> str:
    """What is under way, in the room of one name."""
    if len(names) < 2:
        return "".join(names)
    return f"{names[0]} and {counted(len(names) - 1, 'other')}"


def _bar(display: Display) -> Any:
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
    bar.add_task("", total=1.0, at="", rate="", left="")
    return bar
