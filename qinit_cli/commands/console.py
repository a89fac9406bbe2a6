"""What a command says on stderr while it works: notes, and one line of progress."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import TYPE_CHECKING

from qinit_cli.commands.option_groups import Display
from qinit_cli.pipeline.reporter import Progress, Reporter
from qinit_cli.streams import in_encoding_of
from qinit_cli.wrapping import columns, wrapped
from qinit_store.wording import counted, printable

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from qinit_cli.watch import Watch

FIRST_LINE = 5.0  # seconds after which the first line of progress comes where there is no terminal ...
PLAIN_INTERVAL = 30.0  # ... and between one and the next
ETA_AFTER = 1.0  # seconds of learning before which the time left is a guess


def console(display: Display, *, stderr: bool = False) -> Console:
    """A rich console for stdout or stderr that obeys --color, NO_COLOR and TERM; without markup, as names hold brackets."""
    from rich.console import Console

    terminal = Console(
        stderr=stderr,
        markup=False,
        emoji=False,
        highlight=False,
        force_terminal=True if display.color == "always" else None,
        no_color={"always": False, "never": True, "auto": None}[display.color],
    )
    fallback = shutil.get_terminal_size()
    stream = sys.stderr if stderr else sys.stdout  # the other one may be a pipe
    # rich believes that a dumb terminal has 80 columns
    terminal.size = (columns(stream) or fallback.columns, fallback.lines)
    return terminal


def note(display: Display, text: str) -> None:
    """One line on stderr, unless --quiet."""
    if not display.quiet:
        say(text)


def say(text: str) -> None:
    """A line on stderr; on a terminal it is broken between words."""
    print(wrapped(printable(text), sys.stderr), file=sys.stderr, flush=True)


_compiled: set[str] = set()  # kinds whose compiling this command has announced


def announced() -> int:
    """How often this command has announced that kernels are compiled."""
    return len(_compiled)


@contextmanager
def compiling(display: Display, kind: str = "") -> Iterator[None]:
    """Announces once that kernels of this kind are compiled, if that happens within the block; kept code is silent.

    Without a kind, around a whole command: announces any compiling, unless something was announced before.
    """
    from qinit_cli.kernels.compiled import heard

    if not kind:
        _compiled.clear()

    def tell(module: str) -> None:
        if kind in _compiled or (_compiled and not kind):
            return
        _compiled.add(kind or module)
        what = kind or module.removeprefix("qinit_cli.kernels.").replace("_", " ")
        note(display, f"compiling {what}, once for each kind and version of qinit: some seconds")

    with heard(tell):
        yield


def print_path(path: Path) -> None:
    """The path alone on a line of stdout: unchanged in a pipe, with control characters written out on a terminal."""
    print(printable(path) if sys.stdout.isatty() else in_encoding_of(sys.stdout, str(path)), flush=True)


class Printed(Reporter):
    """Reports on stderr, as the display has it."""

    def __init__(self, display: Display) -> None:
        self._display = display

    def note(self, text: str) -> None:
        """One line, unless --quiet."""
        note(self._display, text)

    def detail(self, text: str) -> None:
        """One line with --verbose."""
        if self._display.verbose:
            note(self._display, text)

    def compiling(self, kind: str) -> AbstractContextManager[None]:
        """Announces once that kernels of this kind are compiled."""
        return compiling(self._display, kind)

    def progress(self, what: str, done: int, total: int, watch: Watch) -> Progress:
        """A bar on a terminal, else plain lines."""
        return TaskBar(self._display, what, done, total, watch)

    def storing(self, what: str, total: int) -> Progress:
        """The same."""
        from qinit_cli.watch import Watch

        return TaskBar(self._display, what, 0, total, Watch())


class TaskBar(Progress):
    """Tasks finished, speed and the time left: a bar on a terminal, else plain lines."""

    def __init__(self, display: Display, what: str, done: int, total: int, watch: Watch) -> None:
        self._what, self._done, self._total, self._watch = what, done, total, watch
        self._before = done
        self._started = time.monotonic()
        self._lines = Lines(display)
        self._bar = _bar(display, what, done, total) if sys.stderr.isatty() and not display.quiet else None

    def __enter__(self) -> TaskBar:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self.tick()
            self._bar.stop()

    def advance(self, tasks: int) -> None:
        """Counts tasks that were handed in."""
        self.reach(self._done + tasks)

    def reach(self, tasks: int) -> None:
        """Shows that so many tasks in all were handed in."""
        self._done = tasks
        self.tick()

    def tick(self) -> None:
        """Shows where things stand."""
        if self._bar is not None:
            self._bar.update(
                self._bar.task_ids[0],
                completed=self._before + self.share * (self._total - self._before),
                done=f"{self._finished}/{self._total}",
                rate=self._rate(),
                left=self._left(),
            )
        elif self._lines.due:
            parts = (f"{self._finished} of {counted(self._total, 'task')}", self._rate(), self._left())
            self._lines.say(f"{self._what}: {', '.join(part for part in parts if part)}")

    @property
    def share(self) -> float:
        """The share of the missing tasks that is learned, from 0 to 1; a task at work counts by its ended episodes."""
        missing = self._total - self._before
        return min(1.0, max(self._done - self._before, self._watch.tasks) / missing) if missing else 1.0

    @property
    def _finished(self) -> int:
        return min(self._total, max(self._done, self._before + self._watch.finished))

    def _rate(self) -> str:
        seconds = max(time.monotonic() - self._started, 1e-9)
        rate = self._watch.steps / seconds
        if rate:
            return f"{rate / 1e6:.1f} M steps/s" if rate >= 1e5 else f"{rate:,.0f} steps/s"
        tasks = self.share * (self._total - self._before) / seconds  # exact tables take no steps
        return f"{tasks:,.3g} tasks/s" if tasks else ""

    def _left(self) -> str:
        seconds, share = time.monotonic() - self._started, self.share
        return f"{clock(seconds * (1.0 - share) / share)} left" if share and seconds >= ETA_AFTER else ""


@contextmanager
def reading(display: Display, what: str) -> Iterator[Callable[[int, int], None]]:
    """Within the block, what shows how many tasks of how many are read; nothing is shown before it is first called."""
    from qinit_cli.watch import Watch

    with ExitStack() as stack:
        shown: list[TaskBar] = []

        def tell(read: int, tasks: int) -> None:
            if not shown:
                shown.append(stack.enter_context(TaskBar(display, what, 0, tasks, Watch())))
            shown[0].reach(read)

        yield tell


class Lines:
    """Plain lines of progress, where there is no terminal: the first after some seconds, for short work none at all."""

    def __init__(self, display: Display) -> None:
        self._quiet = display.quiet
        self._next = time.monotonic() + FIRST_LINE
        self._said = ""

    @property
    def due(self) -> bool:
        """Whether the next line may be printed."""
        return not self._quiet and time.monotonic() >= self._next

    def say(self, text: str) -> None:
        """Prints a line on stderr, unless it is the same as the one before."""
        self._next = time.monotonic() + PLAIN_INTERVAL
        if text != self._said:
            say(text)
        self._said = text


def clock(seconds: float) -> str:
    """The seconds as 0:07, 12:34 or 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _bar(display: Display, what: str, done: int, total: int):  # type: ignore[no-untyped-def]  # rich is imported late
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    bar = Bar(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        *(TextColumn(f"{{task.fields[{name}]}}") for name in ("done", "rate", "left")),
        console=console(display, stderr=True),
        transient=True,
        expand=True,
    )
    bar.add_task(printable(what), total=total, completed=done, done=f"{done}/{total}", rate="", left="")
    return bar
