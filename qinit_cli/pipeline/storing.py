"""Bringing learned tasks into their artefact, and showing how far that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from qinit_cli import cores

if TYPE_CHECKING:
    from qinit_cli.pipeline.reporter import Progress, Reporter
    from qinit_store.work import Work


def store(
    artefact: Work,
    what: str,
    reporter: Reporter,
    threads: int,
    statics: Mapping[str, Any],
    provenance: Mapping[str, Any],
    inputs: Sequence[Mapping[str, str]],
) -> None:
    """Publishes all saved tasks, on at most `threads` threads and no more than there are cores."""
    with ExitStack() as stack:
        writing = stack.enter_context(_Shown(reporter, f"writing {what}"))
        reading = stack.enter_context(_Shown(reporter, f"reading {what} back"))
        artefact.finish(
            artefact.saved,
            statics,
            provenance,
            inputs,
            threads=min(threads, cores.usable()),
            written=writing,
            checked=reading,
        )


class _Shown:
    """Shows how many tasks of how many are done, from when it is first called until all are."""

    def __init__(self, reporter: Reporter, what: str) -> None:
        self._reporter, self._what = reporter, what
        self._shown = ExitStack()
        self._progress: Progress | None = None
        self._done = 0

    def __enter__(self) -> _Shown:
        return self

    def __exit__(self, *error: object) -> None:
        self._shown.close()

    def __call__(self, done: int, tasks: int) -> None:
        if self._progress is None:
            self._progress = self._shown.enter_context(self._reporter.storing(self._what, tasks))
        self._progress.advance(done - self._done)
        self._done = done
        if done == tasks:
            self._shown.close()
