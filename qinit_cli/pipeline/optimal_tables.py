"""Q* of target tasks: exact where the family has exact tables, else learned as sources are, once, and kept in the store."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.errors import TasksFailed
from qinit_cli.methods.targets import no_tables, zero_tables
from qinit_cli.pipeline.beginning import Beginning
from qinit_cli.pipeline.job import make
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.reporter import SILENT, Reporter
from qinit_cli.pipeline.room import Footprint, check_memory
from qinit_cli.pipeline.sources import plan_of
from qinit_cli.tasks import SourceTasks
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.methods import Initial, Method
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.tasks import TargetTasks


def beginning_of(
    method: Method,
    known: Knowledge,
    targets: TargetTasks,
    count: int,
    keeping: Keeping,
    machine: Machine,
    reporter: Reporter = SILENT,
    *,
    trial: bool = False,
) -> Beginning:
    """What a method starts so many targets from, with the artefact of their own tables, if it needed one, as an input.

    `keeping` is that of the run. In a `trial` tables that would have to be learned are zeros. Of a privileged method the arrays
    are made late: there may be many, and tables to learn first. SystemFailed where they do not fit into memory.
    """
    if not method.privileged:
        return Beginning.known(method.initial(known.fit, targets.targets(count, no_tables(targets.family))))

    # its arrays have a leading target axis
    check_memory(Footprint(count, math.prod(targets.family.shape) * 8), count, count)

    def make() -> tuple[Initial, list[dict[str, str]]]:
        tables = OptimalTables(targets, count, known.settings.sources, keeping, machine, reporter, trial)
        initial = method.initial(known.fit, targets.targets(count, tables.needed_by(method)))
        return initial, tables.inputs

    unlearned = zero_tables(targets.family, 1) if method.needs_tables else no_tables(targets.family)
    return Beginning(method.initial(known.fit, targets.targets(1, unlearned)), make)


@dataclass
class OptimalTables:
    """The tables, made for a method that needs them; `inputs` then names the artefact they came from."""

    targets: TargetTasks
    count: int
    sources: SourcesSettings  # tables that must be learned are learned as these were
    keeping: Keeping  # of the run
    machine: Machine
    reporter: Reporter = SILENT
    trial: bool = False  # whether tables that must be learned are left at zero
    inputs: list[dict[str, str]] = field(default_factory=list)

    def needed_by(self, method: Method) -> Floats:
        """Q* of each target, (T, S, A); no rows where the method does not need them."""
        return self._made() if method.needs_tables else no_tables(self.targets.family)

    def _made(self) -> Floats:
        family = self.targets.family
        check_memory(
            Footprint(self.count, math.prod(family.shape) * len(family.actions) * 8), self.count, self.count
        )
        if not family.tabular:
            return self._not_learned() if self.trial else self._learned()
        q, _ = self.targets.family.solve(
            self.targets.draw(np.arange(self.count)), self.targets.learning.gamma
        )
        return q

    def _learned(self) -> Floats:
        settings = replace(self.sources.learning, gamma=self.targets.learning.gamma)
        tasks = SourceTasks(
            self.targets.family, settings.learner.name, settings, self.targets.seed, role="target"
        )
        self.reporter.note(
            f"optimal starts from tables of the targets themselves ({self.count}), learned as sources are",
        )
        # all of them, whatever share of the run is learned here
        plan = plan_of(tasks, self.count)
        made = make(plan, self._in_store(), replace(self.machine, shard=None), self.reporter)
        if made.tally.failed:
            raise TasksFailed(
                f"{made.tally.failed} of {counted(self.count, 'optimal table')} failed; the same command tries again"
            )
        self.inputs.append({"role": "optimal", "name": made.path.stem, "content_sha256": made.digest})
        with open_artefact(made.source, "sources") as artefact:
            q: Floats = artefact.read("q")
        return q.reshape(self.count, -1, len(self.targets.family.actions))

    def _not_learned(self) -> Floats:
        self.reporter.note(
            f"optimal would first learn the tables of {counted(self.count, 'target')}, which takes what as many sources take",
        )
        return zero_tables(self.targets.family, self.count)

    def _in_store(self) -> Keeping:
        """The tables go to the store under their own name, whatever was asked of the run."""
        return replace(self.keeping, output=None, force=False, wait=True)
