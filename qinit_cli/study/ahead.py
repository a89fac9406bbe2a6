"""What a study reports: before it starts how much there is to do and how long that takes, in the end where time went."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qinit_cli.pipeline.reporter import Reporter
from qinit_cli.study.foresight import PICTURE_SECONDS, Cost
from qinit_cli.study.manifest import FolderKind, Spent
from qinit_cli.study.planned import STAGES, Artefact
from qinit_store.wording import counted, magnitude, sized


@dataclass(frozen=True)
class Ahead:
    """What there is, and what is still to be done."""

    name: str
    scale: str | None
    artefacts: tuple[Artefact, ...]
    takes: Mapping[Artefact, Cost]  # of those that are missing
    files: tuple[str, ...]  # pictures and tables
    undrawn: int  # of these
    store: Path
    jobs: int
    kind: FolderKind

    @property
    def total(self) -> Cost:
        """All that is missing, and the drawing."""
        return sum(self.takes.values(), Cost(seconds=self.undrawn * PICTURE_SECONDS))

    @property
    def free(self) -> int:
        """Bytes that are free where the store is."""
        there = next(folder for folder in (self.store, *self.store.absolute().parents) if folder.exists())
        return shutil.disk_usage(there).free

    def stages(self) -> dict[str, dict[str, Any]]:
        """Artefacts, those missing, their steps and seconds, by stage."""
        return {kind: self._stage(kind) for kind in STAGES.values()}

    def told(self) -> dict[str, Any]:
        """All of it as plain values."""
        total = self.total
        return {
            "schema": self.kind.ahead,
            self.kind.told[0]: self.name,
            "scale": self.scale,
            "artefacts": len(self.artefacts),
            "missing": len(self.takes),
            "files": list(self.files),
            "undrawn": self.undrawn,
            "stages": self.stages(),
            "steps": round(total.steps),
            "seconds": round(total.seconds, 1),
            "bytes": round(total.bytes),
            "bytes_free": self.free,
        }

    def report(self, reporter: Reporter) -> None:
        """The same in a few lines."""
        reporter.note(
            f"{self.name}{f' at {self.scale} scale' if self.scale else ''}: {counted(len(self.artefacts), 'artefact')}, "
            f"{len(self.takes)} still to be made; {len(self.files)} pictures and tables, {self.undrawn} still to be drawn",
        )
        for kind, stage in self.stages().items():
            if stage["missing"]:
                steps = f"{magnitude(stage['steps'])} steps, " if stage["steps"] else ""
                reporter.note(
                    f"  {kind}: {stage['missing']} of {stage['artefacts']}, {steps}about {duration(stage['seconds'])}",
                )
        if self.takes or self.undrawn:
            total = self.total
            reporter.note(
                f"  in all about {duration(total.seconds)} with {counted(self.jobs, 'job')}, and {sized(total.bytes)} in "
                f"{self.store}, where {sized(self.free)} are free",
            )

    def _stage(self, kind: str) -> dict[str, Any]:
        missing = [each for artefact, each in self.takes.items() if STAGES[type(artefact)] == kind]
        total = sum(missing, Cost())
        return {
            "artefacts": sum(STAGES[type(artefact)] == kind for artefact in self.artefacts),
            "missing": len(missing),
            "steps": round(total.steps),
            "seconds": round(total.seconds, 1),
        }


def report_spent(
    name: str, spent: Mapping[str, Spent], seconds: float, reporter: Reporter, *, complete: bool
) -> None:
    """Where the time went, a line a stage of which something was made."""
    width = max(len(stage) for stage in spent)
    reporter.note(f"{'':{width}}  {'made':>5}  {'seconds':>8}  {'steps':>8}")
    for stage, own in spent.items():
        if own.made:
            steps = magnitude(own.steps) if own.steps else ""
            reporter.note(f"{stage:{width}}  {own.made:5}  {own.seconds:8.1f}  {steps:>8}".rstrip())
    reporter.note(f"{name}: {'complete' if complete else 'not complete'}, {duration(seconds)}")


def duration(seconds: float) -> str:
    """Seconds, minutes where there are more than two, or hours where there are more than two."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:,.1f} h"
