"""What sets of targets are called in pictures of runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from qinit_cli.comparison.distinctions import above_words, joined
from qinit_cli.environments import label_of
from qinit_cli.pictures.names import distinct, shortened

if TYPE_CHECKING:
    from qinit_cli.comparison.source_sets import RunGroup


def group_names(groups: Sequence[RunGroup]) -> list[str]:
    """The distribution of each, above the settings that distinguish it from the others."""
    from qinit_cli.comparison.source_sets import told_of_groups

    runs = [group.any_run for group in groups]
    labels = [shortened(label_of(run.spec), run.spec["family"]["name"]) for run in runs]
    words = map(joined, told_of_groups(groups))
    names = [above_words(label, own) for label, own in zip(labels, words, strict=True)]
    return distinct(names, [f"targets {run.target_digest[:8]}" for run in runs])


def families(groups: Sequence[RunGroup]) -> str:
    """The distribution where there is one, else the families."""
    specs = [group.any_run.spec for group in groups]
    labels = dict.fromkeys(label_of(spec) for spec in specs)
    return (
        next(iter(labels))
        if len(labels) == 1
        else ", ".join(dict.fromkeys(spec["family"]["name"] for spec in specs))
    )
