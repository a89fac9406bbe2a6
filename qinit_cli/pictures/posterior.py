"""Weights of the sources while targets are learned, of runs of `posterior`; runs of several source sets are pooled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.comparison.distinctions import distinctions, with_words
from qinit_cli.environments import label_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import legible, listed
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.posterior import Weighed

MOST = 6  # bands that can be told apart
QUANTILES = (0.1, 0.5, 0.9)
BAND = "median and 80 % of targets"


def drawn(paths: Sequence[Path], *, title: str | None = None, width: float = TEXT) -> Drawn:
    """Effective number of sources and weight of the heaviest over episodes, a line for each method and distribution."""
    from qinit_cli.figures import posterior as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style
    from qinit_store.spec import canonical_json

    groups: dict[str, list[tuple[Integers, Floats, int]]] = {}
    specs: dict[str, dict[str, Any]] = {}
    for path in paths:
        spec, found = _read(path)
        key = canonical_json(spec)
        specs[key] = spec
        groups.setdefault(key, []).append(found)
    if len(groups) > MOST:
        raise UsageError(f"{len(groups)} methods and distributions do not fit; draw at most {MOST}")
    labels = [
        legible(with_words(f"{spec['method']['label']}, {label_of(spec)}", words))
        for spec, words in zip(specs.values(), distinctions(list(specs.values())), strict=True)
    ]
    shown = [_weighed(label, found) for label, found in zip(labels, groups.values(), strict=True)]
    own = "weights of source tables while targets are learned"
    with house_style():
        figure = drawing.posterior(shown, own if title is None else title, BAND, width)
    return Drawn(figure, title or own, _alt(shown, groups))


def _read(path: Path) -> tuple[dict[str, Any], tuple[Integers, Floats, int]]:
    """What replicates of the run share, its moments (R,) and weights (T, R, K), and how many of its targets never froze."""
    from qinit_cli.artefacts.opening import open_artefact

    with open_artefact(path, "run") as artefact:
        if "weight" not in {column.name for column in artefact.schema.columns}:
            raise NotAllowed(
                f"{path} keeps no weights: it is a run of {artefact.spec['method']['name']}, not of posterior"
            )
        shared = {
            name: value for name, value in artefact.spec.items() if name not in ("seed", "inputs", "tasks")
        }
        shared["source_set"] = {
            name: value for name, value in artefact.spec["source_set"].items() if name != "sources"
        }
        moments = artefact.axes["moment"].values
        return shared, (moments, artefact.read("weight"), int((artefact.read("frozen") < 0).sum()))


def _weighed(label: str, found: list[tuple[Integers, Floats, int]]) -> Weighed:
    from qinit_cli.analysis.concentration import effective_number, largest_share
    from qinit_cli.figures.posterior import Weighed

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
