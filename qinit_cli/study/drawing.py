"""Pictures, tables and verdicts of a study, made of artefacts that stand in the store."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from qinit_cli import __version__
from qinit_cli.plots import Frame
from qinit_cli.plots.plot import RunsPlot
from qinit_cli.study.planned import (
    Artefact,
    PlannedJudgement,
    PlannedPicture,
    PlannedRun,
    PlannedShares,
    PlannedTable,
    Shown,
)

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.plots.drawn import Drawn

NOT_JUDGED = "not judged"
KEPT = 200  # runs: a megabyte each at the paper's size


@dataclass
class Drawing:
    """Draws what stands in the store."""

    paths: Mapping[Artefact, Path]
    _runs: dict[PlannedRun, ComparedRun] = field(default_factory=dict)  # those read last

    def picture(self, picture: PlannedPicture) -> Drawn:
        """The picture, at text width."""
        plot, frame = picture.plot, Frame(picture.title)
        if isinstance(plot, RunsPlot):
            return plot.of_runs(self.runs(picture.artefacts), frame)
        return plot.drawn([self.paths[artefact] for artefact in picture.artefacts], frame)

    def table(self, table: PlannedTable) -> dict[str, Any]:
        """What `qinit compare --format json` prints of these runs."""
        from qinit_cli.comparison import rows as stage
        from qinit_cli.comparison.table import told

        runs = self.runs(table.runs)
        if table.first is not None:
            runs = [run.first(table.first) for run in runs]
        return told(stage.compare(runs, table.baseline, table.metric), table.metric)

    def shares(self, shares: PlannedShares) -> dict[str, Any]:
        """What `qinit sensitivity --format json` prints of these runs."""
        from qinit_cli.comparison.sensitivity import SCHEMA, shares_told

        return {"schema": SCHEMA, **vars(shares_told(self.runs(shares.runs), shares.metric))}

    def verdicts(self, judgement: PlannedJudgement) -> dict[str, Any]:
        """What `qinit verdicts --format json` prints of these artefacts; of a single figure, what it bears on alone."""
        from qinit_cli.paper import verdicts as stage

        paths = [self.paths[artefact] for artefact in judgement.artefacts if artefact in self.paths]
        found = stage.verdicts(stage.evidence(stage.opened(paths)))
        return stage.told([one for one in found if judgement.whole or one.verdict != NOT_JUDGED])

    def runs(self, artefacts: Sequence[Artefact]) -> list[ComparedRun]:
        """The runs, verified; pictures of the same are drawn one after the other, so what was read is kept for a while."""
        from qinit_cli.artefacts.opening import open_artefact
        from qinit_cli.comparison.runs import ComparedRun

        for artefact in artefacts:
            if isinstance(artefact, PlannedRun) and artefact not in self._runs:
                with open_artefact(self.paths[artefact], "run") as opened:
                    run = ComparedRun.from_artefact(opened)
                self._runs[artefact] = run if artefact.tuning is None else run.by_tuning()
        wanted = [artefact for artefact in artefacts if isinstance(artefact, PlannedRun)]
        found = [self._runs[artefact] for artefact in wanted]
        while len(self._runs) > max(KEPT, len(wanted)):
            del self._runs[next(iter(self._runs))]
        return found


def file_of(shown: Shown) -> str:
    """The name of its file; a picture has a PNG beside it, a table a CSV."""
    return f"{shown.name}.svg" if isinstance(shown, PlannedPicture) else f"{shown.name}.json"


def made_of(shown: Shown, digests: Mapping[Artefact, str]) -> str:
    """SHA-256 of all that decides what it shows: its settings, its artefacts' content and this version."""
    from qinit_store.spec import canonical_json

    told: list[Any] = [__version__, shown.name, shown.title]
    told += [digests[artefact] for artefact in shown.artefacts if artefact in digests]
    match shown:
        case PlannedPicture(plot=plot):
            told += [plot.name, asdict(plot)]
        case PlannedTable(first=first, baseline=baseline, metric=metric, columns=columns):
            told += [str(first), baseline, metric, list(columns)]
        case PlannedShares(metric=metric):
            told.append(metric)
        case PlannedJudgement(whole=whole):
            told.append(str(whole))
    return hashlib.sha256(canonical_json(told).encode()).hexdigest()
