"""Which rows of the files that tasks are varied by are sources and which are targets, where a text names them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from qinit_cli.environments.task_ranges import held_out, kept, picked
from qinit_cli.environments.varied_values import FileRows
from qinit_cli.errors import UsageError


def sources_of(use: str, files: Sequence[FileRows]) -> str:
    """The text by which the rows that it names are stored; UsageError where there are none, or files of unequal length."""
    if not files:
        raise UsageError(
            f"--use {use} names rows of a file, and nothing is varied by one; give --vary NAME=file:PATH too, or leave it out"
        )
    first, *others = files
    for other in others:
        if other.rows.count != first.rows.count:
            raise UsageError(
                f"--use {use} names rows, and {first.path} has {first.rows.count} of them, {other.path} {other.rows.count}; "
                "give files of as many rows as each other"
            )
    try:
        return kept(use, picked(use, first.rows.count, _labels(files)))
    except ValueError as error:
        raise UsageError(f"--use {error}") from error


def targets_of(targets: str | None, files: Sequence[FileRows], *, allow_overlap: bool) -> str:
    """The rows of targets that a text names, without one those of no source.

    UsageError where they cannot be, or where a target is a source too, by its number or by equal values, unless that is allowed.
    """

    def content(row: int) -> Hashable:
        return repr([(one.name, one.value(one.at(row))) for one in files])  # a list is no key

    first = files[0]
    return held_out(
        targets,
        first.of("source"),
        first.rows.count,
        _labels(files),
        first.path,
        None if allow_overlap else content,
    )


def _labels(files: Sequence[FileRows]) -> tuple[str, ...]:
    """The labels of the rows in the first file that has some."""
    return next((one.rows.labels for one in files if one.rows.labels), ())
