"""What a command says on stderr while it works: notes, and one line of progress."""

from __future__ import annotations

import shutil
import sys
import time
from typing import TYPE_CHECKING

from qinit_cli.commands.groups import Display

if TYPE_CHECKING:
    from rich.console import Console

    from qinit_cli.kernels.batch import Watch

PLAIN_INTERVAL = 30.0  # seconds between lines where there is no terminal


def console(display: Display, *, stderr: bool = False) -> Console:
    """A rich console for stdout or stderr that obeys --color, NO_COLOR and TERM."""
    from rich.console import Console

    terminal = Console(
        stderr=stderr,
        force_terminal=True if display.color == "always" else None,
        no_color={"always": False, "never": True, "auto": None}[display.color],
    )
    terminal.size = shutil.get_terminal_size()  # rich believes that a dumb terminal has 80 columns
    return terminal


def note(display: Display, text: str) -> None:
    """One line on stderr, unless --quiet."""
    if not display.quiet:
        print(text, file=sys.stderr, flush=True)


def detail(display: Display, text: str) -> None:
    """One line on stderr with --verbose."""
    if display.verbose:
        note(display, text)


class Progress:
    """Tasks done, steps a second and the time left: a bar on a terminal, else a plain line at most every 30 s."""

    def __init__(self, display: Display, what: str, done: int, total: int, watch: Watch) -> None:
        self._what, self._done, self._total, self._watch = what, done, total, watch
        self._before = done
        self._started = self._said = time.monotonic()
        self._quiet = display.quiet
        self._bar = _bar(display, what, done, total) if sys.stderr.isatty() and not display.quiet else None

    def __enter__(self) -> Progress:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self.tick()
            self._bar.stop()

    def advance(self, tasks: int) -> None:
        """Counts finished tasks."""
        self._done += tasks
        self.tick()

    def tick(self) -> None:
        """Shows where things stand."""
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=self._done, rate=self._rate())
        elif not self._quiet and time.monotonic() - self._said >= PLAIN_INTERVAL:
            self._said = time.monotonic()
            left = self._left()
            ending = f", about {left:.0f} s left" if left is not None else ""
            print(
                f"{self._what}: {self._done} of {self._total} tasks, {self._rate()}{ending}",
                file=sys.stderr,
                flush=True,
            )

    def _rate(self) -> str:
        seconds = max(time.monotonic() - self._started, 1e-9)
        rate = self._watch.steps / seconds
        return f"{rate / 1e6:.1f} M steps/s" if rate >= 1e5 else f"{rate:,.0f} steps/s"

    def _left(self) -> float | None:
        done = self._done - self._before
        seconds = time.monotonic() - self._started
        return seconds * (self._total - self._done) / done if done else None


def _bar(display: Display, what: str, done: int, total: int):  # type: ignore[no-untyped-def]  # rich is imported late
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        console=console(display, stderr=True),
        transient=True,
        expand=True,
    )
    bar.add_task(what, total=total, completed=done, rate="")
    return bar
