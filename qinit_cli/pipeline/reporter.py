"""What a stage reports while it works. The library is silent; the command line prints."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.pipeline.pace import Pace
    from qinit_cli.watch import Watch


class Reporter:
    """Receives notes and progress, and is silent; subclasses print or log them."""

    def note(self, text: str) -> None:
        """A sentence for the user."""

    def detail(self, text: str) -> None:
        """A sentence for a user who asked for more."""

    def compiling(self, kind: str) -> AbstractContextManager[None]:
        """Around work that may compile kernels of this kind."""
        return nullcontext()

    def progress(self, what: str, done: int, total: int, watch: Watch) -> Progress:
        """The progress of `total` tasks, `done` of them before; `watch` counts steps and tasks at work."""
        return Progress()

    def storing(self, what: str, total: int) -> Progress:
        """The progress of bringing `total` learned tasks into their artefact."""
        return Progress()

    def whole(self, count: int, pace: Pace, kept: Path) -> Whole:
        """The progress over `count` things to make; where it stands is written into the file `kept` now and then."""
        return Whole(pace)


class Whole(Reporter):
    """Progress over several things to make, as a context; it hears of the tasks of each. Silent."""

    def __init__(self, pace: Pace) -> None:
        self.pace = pace

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Ends what is shown."""

    @contextmanager
    def thing(self, what: str, kind: tuple[str, ...], foreseen: float) -> Iterator[None]:
        """Around the making of one thing of a kind, foreseen to take so many seconds."""
        began = time.monotonic()
        try:
            yield
        finally:
            self.pace.took(kind, foreseen, time.monotonic() - began)


class Progress:
    """Progress of tasks, as a context; silent."""

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        """Ends what is shown."""

    def advance(self, tasks: int) -> None:
        """Counts tasks that ended."""

    def tick(self) -> None:
        """Called about ten times a second while tasks are at work."""

    def counting(self, blocks: Iterable[Mapping[str, Any]]) -> Iterator[Any]:
        """The blocks of tasks, each counted when the next is asked for."""
        for block in blocks:
            yield block
            self.advance(len(block["task"]))


SILENT = Reporter()
