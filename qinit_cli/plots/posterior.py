"""Weights of the sources while targets are learned, of runs of `posterior`; runs of several source sets are pooled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.comparison.distinctions import distinctions, with_words
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import legible, listed
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.style import COLUMN, TEXT, house_style, line_styles, plain_numbers
from qinit_store.wording import counted

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.artefacts.settings import RunSettings

MOST = 6  # bands that can be told apart
QUANTILES = (0.1, 0.5, 0.9)
BAND = "median and 80 % of targets"
PANEL, KEY = 2.3, 0.17  # inches
NUMBER_LABEL = "effective number of sources"
SHARE_LABEL = "weight of the heaviest source"


@dataclass(frozen=True)
class PosteriorPlot(Plot):
    """Weights of the source tables while targets are learned: the effective number of sources and the weight of
    the heaviest, over episodes.
    """

    name: ClassVar[str] = "posterior"
    takes: ClassVar[Takes] = Takes(("run",), "Runs of posterior", several=True)
    titled: ClassVar[str] = "what is shown"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """A line for each method and distribution, in the order of their runs; those of several source sets are pooled."""
        from qinit_store.spec import canonical_json

        groups: dict[str, list[tuple[Integers, Floats, int]]] = {}
        choices: dict[str, RunSettings] = {}
        for path in paths:
            settings, found = _read(path)
            key = canonical_json(settings.spec())
            choices[key] = settings
            groups.setdefault(key, []).append(found)
        if len(groups) > MOST:
            raise UsageError(f"{len(groups)} methods and distributions do not fit; draw at most {MOST}")
        labels = [
            legible(with_words(f"{told.method.label}, {told.family.label}", words))
            for told, words in zip(choices.values(), distinctions(list(choices.values())), strict=True)
        ]
        shown = [_weighed(label, found) for label, found in zip(labels, groups.values(), strict=True)]
        own = "weights of source tables while targets are learned"
        with house_style():
            figure = posterior(shown, own if frame.title is None else frame.title, BAND, frame.width)
        return Drawn(figure, frame.title or own, _alt(shown, groups))


def _read(path: Path) -> tuple[RunSettings, tuple[Integers, Floats, int]]:
    """What replicates of the run share, its moments (R,) and weights (T, R, K), and how many of its targets never froze."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.artefacts.settings import RunSettings

    with open_artefact(path, "run") as artefact:
        settings = RunSettings.read(artefact.spec)
        if "weight" not in {column.name for column in artefact.schema.columns}:
            raise NotAllowed(
                f"{path} keeps no weights: it is a run of {settings.method.name}, not of posterior"
            )
        moments = artefact.axes["moment"].values
        return settings.choice(), (moments, artefact.read("weight"), int((artefact.read("frozen") < 0).sum()))


def _weighed(label: str, found: list[tuple[Integers, Floats, int]]) -> Weighed:
    import numpy as np

    from qinit_cli.analysis.concentration import effective_number, largest_share

    moments = found[0][0]
    if any(not np.array_equal(moments, other) for other, _, _ in found):
        raise NotAllowed(f"runs of {label} have different numbers of episodes; draw them apart")
    number = np.concatenate([effective_number(weights) for _, weights, _ in found])
    share = np.concatenate([largest_share(weights) for _, weights, _ in found])
    return Weighed(
        label, moments, np.quantile(number, QUANTILES, axis=0), np.quantile(share, QUANTILES, axis=0)
    )


def _alt(shown: list[Weighed], groups: dict[str, list[Any]]) -> str:
    """Where each line begins and ends, and how many targets never froze."""
    parts = []
    for each, found in zip(shown, groups.values(), strict=True):
        targets, never = sum(len(weights) for _, weights, _ in found), sum(count for *_, count in found)
        parts.append(
            f"{each.label}: from {each.number[1, 0]:.0f} to {each.number[1, -1]:.1f} sources, the heaviest at last "
            f"{each.share[1, -1]:.2f} (medians of {counted(targets, 'target')}, {never} of which never froze)"
        )
    return f"Effective number of sources and weight of the heaviest over {shown[0].moments[-1]} episodes. {listed(parts)}."


@dataclass(frozen=True)
class Weighed:
    """One method on one distribution: quantiles over targets (3, R), low, middle and high, after so many episodes."""

    label: str
    moments: Integers  # (R,) episodes that had ended, the first 0
    number: Floats  # (3, R)
    share: Floats  # (3, R)


def posterior(shown: Sequence[Weighed], title: str, band: str, width: float = TEXT) -> Figure:
    """Both panels, beside or beneath each other, over episodes on a logarithmic axis. Call it within `house_style`."""
    from matplotlib.figure import Figure

    beside = width > COLUMN
    keys = KEY * -(-len(shown) // (3 if beside else 1))
    figure = Figure(figsize=(width, (PANEL if beside else 2 * PANEL) + keys + (0.25 if title else 0)))
    panels = figure.subplots(1, 2) if beside else figure.subplots(2, 1)
    for axes, name, label in zip(panels, ("number", "share"), (NUMBER_LABEL, SHARE_LABEL), strict=True):
        for each, look in zip(shown, line_styles(len(shown)), strict=True):
            low, middle, high = getattr(each, name)
            axes.plot(each.moments, middle, label=each.label, **look)
            axes.fill_between(each.moments, low, high, color=look["color"], alpha=0.18, linewidth=0)
        axes.set(xlabel=f"episodes learned ({band})", ylabel=label)
        _over_episodes(axes, max(int(each.moments[-1]) for each in shown))
    panels[0].set_yscale("log")
    panels[0].set_ylim(bottom=0.9)
    plain_numbers(panels[0].yaxis)
    panels[1].set_ylim(0, 1)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if beside else 1)
    if title:
        figure.suptitle(title)
    return figure


def _over_episodes(axes: Axes, last: int) -> None:
    """From 0, before the first episode, and logarithmic from 1: most is decided in the first few."""
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xlim(0, last)
    axes.set_xticks([0, *(10**power for power in range(8) if 10**power <= last)])
    axes.minorticks_off()
    plain_numbers(axes.xaxis)
