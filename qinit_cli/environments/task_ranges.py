"""Which tasks of a file a text means: A:B, several of those, or all but one fold; free of numpy so that help stays fast."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import lru_cache
from hashlib import sha256
from itertools import groupby, pairwise

from qinit_cli.errors import UsageError

RANGE = re.compile(r"(\d{1,9})?:(\d{1,9})?")
FOLD = re.compile(r"fold:(\d{1,9})/(\d{1,9})")
LONGEST_NAMED = 60  # characters of what is used of a file, in an artefact's name
FORMS = "A:B (from task A up to, not including, B, counted from 0), several as A:B,C:D, or fold:K/N"


def picked(text: str, count: int, splits: Sequence[str] = ()) -> list[int]:
    """The tasks out of `count` that a text means, in its order; `splits` are the tasks' own labels, which it may name.

    `fold:K/N` means all but those that the K-th of N folds holds out: every N-th task, so that a sorted file is cut evenly.
    ValueError, the end of a sentence, for any other text, a task that is not there, one that is named twice, or none at all.
    """
    if text in splits:
        return [task for task, split in enumerate(splits) if split == text]
    if fold := FOLD.fullmatch(text):
        left_out, folds = (int(part) for part in fold.groups())
        if not 2 <= folds <= count or not 1 <= left_out <= folds:
            raise ValueError(
                f"is {text!r}; of {count} tasks write fold:K/N with K from 1 to N and N from 2 to {count}"
            )
        return [task for task in range(count) if task % folds != left_out - 1]
    named = [task for part in text.split(",") for task in _range(part.strip(), text, count, splits)]
    ordered = sorted(named)
    if twice := [task for task, next_one in pairwise(ordered) if task == next_one]:
        raise ValueError(f"is {text!r}, which names task {twice[0]} twice")
    return named


def written(tasks: Iterable[int]) -> str:
    """The inverse of `picked`: runs of consecutive tasks as A:B, with commas between them."""
    runs = groupby(enumerate(tasks), key=lambda at: at[1] - at[0])
    several = [[task for _, task in run] for _, run in runs]
    return ",".join(f"{run[0]}:{run[-1] + 1}" for run in several)


def kept(use: str, tasks: Sequence[int]) -> str:
    """How tasks that were picked are stored: a fold by its name, others by their numbers."""
    return use if FOLD.fullmatch(use) else written(tasks)


def folds_of(use: str) -> str:
    """The folds of which one is left out, whichever it is: "5 folds" of "fold:2/5"."""
    return f"{use.rpartition('/')[2]} folds"


def in_name(use: str, told: str) -> str:
    """What is used of a file, in an artefact's name; where that is long, what is `told` of it and a hash."""
    return use if len(use) <= LONGEST_NAMED else f"{told}-{sha256(use.encode()).hexdigest()[:8]}"


@lru_cache(maxsize=64)  # each task asks
def named(option: str, text: str, count: int) -> tuple[int, ...]:
    """The tasks out of `count` that a stored text means; ValueError, a sentence about the option, where it means none."""
    try:
        return tuple(picked(text, count))
    except ValueError as error:
        raise ValueError(f"{option} {error}") from error


@lru_cache(maxsize=64)
def others(tasks: tuple[int, ...], count: int) -> tuple[int, ...]:
    """The tasks out of `count` that are none of these."""
    there = set(tasks)
    return tuple(task for task in range(count) if task not in there)


def held_out(
    targets: str | None,
    sources: Sequence[int],
    count: int,
    splits: Sequence[str],
    file: str,
    content: Callable[[int], Hashable] | None,
) -> str:
    """The numbers of the targets that are named out of `count` tasks of a file, without a text those that are no sources.

    UsageError where they cannot be, or where a target is a source too, by its number or its `content`; None allows that.
    """
    try:
        held = others(tuple(sources), count) if targets is None else picked(targets, count, splits)
    except ValueError as error:
        raise UsageError(f"--targets {error}") from error
    if not held:
        raise UsageError(
            f"all {count} tasks of {file} are sources; give --targets A:B with --allow-overlap, or fewer to --use"
        )
    if content is not None:
        _check_apart(held, {content(task): task for task in sources}, file, content)
    return written(held)


def _check_apart(
    held: Sequence[int], sources: dict[Hashable, int], file: str, content: Callable[[int], Hashable]
) -> None:
    for task in held:
        if (source := sources.get(content(task))) is not None:
            same = f"task {task}" if task == source else f"task {task} and task {source}, which are equal,"
            raise UsageError(
                f"{same} of {file} would be source and target; leave it out of one of them, or give --allow-overlap"
            )


def _range(part: str, text: str, count: int, splits: Sequence[str]) -> range:
    found = RANGE.fullmatch(part)
    if not found:
        labels = f", or a label of its split: {', '.join(sorted(set(splits)))}" if splits else ""
        raise ValueError(f"is {text!r}; write {FORMS}{labels}")
    first, last = int(found[1] or 0), int(found[2]) if found[2] else count
    if last > count:
        raise ValueError(f"is {text!r}, and there are {count} tasks, 0:{count}")
    if first >= last:
        raise ValueError(f"is {text!r}, and {part} holds no task")
    return range(first, last)
