"""What a stage made, printed: the summary and the warnings on stderr, the path or one JSON object on stdout."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, TypeVar

from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import Display, Output
from qinit_cli.errors import TasksFailed, UsageError
from qinit_store.wording import counted, magnitude, plain

if TYPE_CHECKING:
    from qinit_cli.pipeline.estimate import Expected
    from qinit_cli.pipeline.job import Made

Each = TypeVar("Each")


def each(several: Sequence[Each], once: Callable[[Each], None], *, fail_fast: bool = False) -> None:
    """Calls `once` with each; TasksFailed, when all had their turn or at the first with `fail_fast`, where tasks failed."""
    failures: list[TasksFailed] = []
    for one in several:
        try:
            once(one)
        except TasksFailed as failed:
            failures.append(failed)
            if fail_fast:
                break
    if failures:
        raise TasksFailed("; ".join(map(str, failures)))


def check_one_output(output: Output, several: Sequence[object]) -> None:
    """UsageError where one file is to hold what is made of each of several."""
    if output.output is not None and len(several) > 1:
        raise UsageError(
            f"-o {output.output} names one artefact, and {len(several)} are to be made; leave it out, or give --store DIR"
        )


def warn(made: Made, before: str, warnings: Iterable[str], display: Display) -> None:
    """Prints the warnings on stderr; --json holds them too, behind one that was printed `before`, if any."""
    told = list(warnings)
    for warning in told:
        note(display, f"warning: {warning}")
    made.tally.extra["warnings"] = [*([before] if before else []), *told]


def say_result(
    made: Made,
    schema: str,
    sentence: str,
    output: Output,
    display: Display,
    *,
    further: Iterable[str] = (),
) -> None:
    """The summary and `further` lines on stderr, then the path alone on a line, or one JSON object, on stdout."""
    for line in (sentence, *further):
        note(display, line)
    tally = made.tally
    told = {
        "schema": schema,
        "path": str(made.path),
        "digest": made.digest,
        "tasks": tally.tasks,
        "skipped": tally.skipped,
        "failed": tally.failed,
        "steps": tally.steps,
        "seconds": round(tally.seconds, 6),
        **tally.extra,
    }
    if output.json:
        print(json.dumps(told, allow_nan=False), flush=True)
    else:
        print_path(made.path)
    if tally.failed:
        raise TasksFailed(
            f"{tally.failed} of {counted(tally.tasks, 'task')} failed; the same command tries them again"
        )


def say_expected(expected: Expected, output: Output, display: Display) -> None:
    """One sentence on stderr, with --json one object on stdout instead."""
    if output.json:
        print(json.dumps({"schema": "qinit.dry-run/1", **asdict(expected)}, allow_nan=False))
        return
    steps, seconds = (float(f"{value:.2g}") for value in (expected.steps, expected.seconds))
    note(
        display,
        f"{expected.path} would hold {counted(expected.tasks, 'task')}, of which {expected.missing} still to be learned: "
        f"about {magnitude(steps)} steps in {plain(seconds)} s, and {expected.bytes / 1e6:.2g} MB",
    )
