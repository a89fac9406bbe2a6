"""The plain command that makes a planned artefact."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from qinit_cli.environments.folds import OF_FILES
from qinit_cli.options import flag, options, tunable
from qinit_cli.pipeline.words import option_words
from qinit_cli.study.planned import PlannedFit, PlannedRun, PlannedSources, PlannedTuning

if TYPE_CHECKING:
    from qinit_cli.study.planned import Artefact

Names = dict["Artefact", str]  # of artefacts in commands: paths


def command(
    artefact: Artefact, given: Names, output: tuple[str, ...], imports: tuple[str, ...] = ()
) -> list[str]:
    """The words behind `qinit`: what it is made of by the names `given`, and where it goes, such as ("--store", DIR)."""
    imported = [word for module in imports for word in ("--import", module)]
    match artefact:
        case PlannedSources(family, learning):
            words = ["train-sources", family.name, *option_words(family), *option_words(learning)]
            imported = imported if isinstance(family, OF_FILES) else []  # others have no such option
            # told even where it is the default: source sets differ by it
            words += [] if learning.seed else ["--seed", "0"]
        case PlannedFit(sources, options):
            words = ["fit", given[sources], *option_words(options)]
        case PlannedTuning(sources):
            words = ["tune", artefact.method.name, given[sources], *_tuned(artefact)]
        case PlannedRun(fit, method, learning, tuning):
            words = ["transfer", method.name, given[fit], *option_words(method)]
            words += [] if tuning is None else ["--tuned", given[tuning]]
            words += option_words(learning)
    return [*words, *imported, *output]


def _tuned(tuning: PlannedTuning) -> list[str]:
    """The options of `qinit tune`: what is tried by list, the others as they are."""
    tried, usual = dict(tuning.values), tunable(type(tuning.method))
    plain = {one.name: one.default for one in options(type(tuning.method)) if one.name in tried}
    words = option_words(replace(tuning.method, **plain))  # type: ignore[type-var]  # every concrete method is a dataclass
    for name, values in tried.items():
        if values != usual.get(name):
            words += [flag(name), ",".join(f"{value!r}" for value in values)]
    return words + option_words(tuning.learning)
