"""Which tasks of a file a text means: A:B, several of those, or all but one fold; free of numpy so that help stays fast."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import groupby, pairwise

RANGE = re.compile(r"(\d{1,9})?:(\d{1,9})?")
FOLD = re.compile(r"fold:(\d{1,9})/(\d{1,9})")
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
