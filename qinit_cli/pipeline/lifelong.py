"""A lifetime: target tasks one after another, each started from all that is known by then (the paper's algorithm 1).

The paper keeps mu and sigma as they were fitted. Here each finished task may add to them, as one more source of the pairs that
were visited often enough: an entry that still holds its start would feed the method on itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.analysis.moments import Moments, merged, moments
from qinit_cli.artefacts.settings import RunSettings
from qinit_cli.elementary import ln
from qinit_cli.environments.family import bounds_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.fitted import FittedTables
from qinit_cli.methods import Initial, Method
from qinit_cli.pipeline.asked import Living
from qinit_cli.pipeline.beginning import Beginning
from qinit_cli.pipeline.fit import pair_statistics
from qinit_cli.pipeline.job import Plan
from qinit_cli.pipeline.transfer import learn_targets, plan_of
from qinit_cli.tasks import TargetTasks

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.sources import Rows
    from qinit_cli.watch import Watch
    from qinit_store.held import HeldWork
    from qinit_store.work import Work

Lived = Callable[
    [int], "Rows"
]  # the saved row of a task that was lived before, "q" and "visits" at least; KeyError


def _nothing(index: int) -> Rows:
    """Nothing was lived before."""
    raise KeyError(index)


@dataclass(frozen=True)
class Known:
    """What is known of Q per state-action, over the sources and the tasks lived since; cells are (S, A)."""

    log_q: Moments
    q: Moments

    @classmethod
    def of(cls, fit: FittedTables) -> Known:
        """What the fit knows."""
        return cls(
            log_q=_moments(fit.n, fit.mu, fit.sigma, ln(fit.min), ln(fit.max)),
            q=_moments(fit.n, fit.mean, fit.std, fit.min, fit.max),
        )

    def with_task(self, q: Floats, visits: Integers, min_visits: int) -> Known:
        """With one more task's positive values (S, A), of the pairs that it visited at least so often."""
        counted = ((visits >= min_visits) & (q > 0))[None]
        logs = ln(np.where(counted, q[None], 1.0))
        return Known(
            log_q=merged(self.log_q, moments(logs, counted)), q=merged(self.q, moments(q[None], counted))
        )

    def fit(self, before: FittedTables) -> FittedTables:
        """The fit that this makes of `before`, by its estimator; the library and the mean value stay."""
        return replace(before, **pair_statistics(self.log_q, self.q, before.estimator))


@dataclass
class Lifetime:
    """Learns the targets in order, each from what the method makes of the sources and the targets before it.

    Called as any learner is, with the ids of tasks to learn; `lived` must give the tasks before them.
    """

    method: Method
    targets: TargetTasks  # with tables and visits kept
    fit: FittedTables  # of the sources
    min_visits: int
    lived: Lived = _nothing
    known: Known = field(init=False)
    age: int = field(default=0, init=False)  # tasks that `known` holds besides the sources
    initial: Initial = field(init=False)  # of the first task; the others differ in their start alone

    def __post_init__(self) -> None:
        self.known = Known.of(self.fit)
        first = self._initial()
        self.initial = replace(
            first, start=first.start[None]
        )  # it has a task axis: it depends on the task's number

    def __call__(self, indices: Integers, watch: Watch) -> tuple[Integers, Rows]:
        """The ids of the tasks that were finished, and a row for each column of the artefact; fewer once `watch` was stopped."""
        each: list[Rows] = []
        for index in indices.tolist():
            if watch.stopped:
                break
            while self.age < index:
                self._absorb(self._remembered(self.age))
            rows = self._learn(index, watch)
            if not rows:
                break
            each.append(rows)
        names = each[0] if each else {}
        return indices[: len(each)], {name: np.concatenate([rows[name] for rows in each]) for name in names}

    def _learn(self, index: int, watch: Watch) -> Rows:
        """The row of the task at `index`, the next to be lived; none once `watch` was stopped."""
        start = self._initial().start
        initial = replace(self.initial, start=np.broadcast_to(start, (index + 1, *start.shape)))
        ids, rows = learn_targets(self.targets, initial, np.array([index]), watch)
        if not len(ids):
            return {}
        before = self.known.log_q.n
        self._absorb({name: rows[name][0] for name in ("q", "visits")})
        rows["added"] = np.array([(self.known.log_q.n > before).sum()], np.int64)
        rows["log_std"] = np.array([log_std(self.known.log_q)])
        return rows

    def _remembered(self, index: int) -> Rows:
        try:
            return self.lived(index)
        except KeyError as missing:
            raise NotAllowed(
                f"task {index} was not learned, and those after it start from what it learned"
            ) from missing

    def _initial(self) -> Initial:
        """What the method makes of all that is known."""
        return self.method.initial_of_all(
            self.known.fit(self.fit), self.targets.family, self.targets.learning
        )

    def _absorb(self, row: Rows) -> None:
        shape, targets = self.fit.mu.shape, self.targets
        shares = bounds_of(targets.family, targets.learning.gamma).shares(row["q"].reshape(shape))
        self.known = self.known.with_task(shares, row["visits"].reshape(shape), self.min_visits)
        self.age += 1


def log_std(log_q: Moments) -> float:
    """Median over the pairs that somebody knows of the standard deviation of ln Q; NaN where nobody knows any."""
    known = log_q.n > 0
    return float(np.median(log_q.std[known])) if known.any() else float("nan")


def _moments(n: Integers, mean: Floats, std: Floats, smallest: Floats, largest: Floats) -> Moments:
    known = n > 0
    return Moments(
        n=n.astype(np.int64),
        running_mean=np.where(known, mean, 0.0),
        squares=np.where(known, std**2 * n, 0.0),
        smallest=np.where(known, smallest, np.inf),
        largest=np.where(known, largest, -np.inf),
    )


def check_updates(method: Method) -> None:
    """UsageError where what tasks leave behind cannot change what this method starts from."""
    if method.privileged or not method.reads_moments:
        raise UsageError(
            f"{method.label} does not start from mu, sigma or means alone, which are all that --update changes; leave it out"
        )


def lifetime_plan(method: Method, living: Living, targets: TargetTasks, count: int, known: Knowledge) -> Plan:
    """The run of so many targets, each started from what is known by then; UsageError where a blend has not given way by then.

    NotAllowed where visits of entries are not counted.
    """
    if not targets.family.counted:
        raise NotAllowed(
            "--update adds the entries of a table that a task visited, and values by tiles have none; leave --update out"
        )
    if targets.known_at is not None and targets.known_at > living.visits:
        raise UsageError(
            f"--update adds entries after {living.visits} visits, and with --known-at {targets.known_at} a part of their start "
            f"is left in them; give --min-visits {targets.known_at} too"
        )
    lifetime = Lifetime(method, targets, known.fit, living.visits)
    plain = plan_of(method, targets, Beginning.known(lifetime.initial), count, known)
    label = f"{targets.label_of(method)} updated"
    settings = RunSettings.of(method, targets, count, known.content_sha256, known.settings)
    stored = replace(settings.method, label=label, min_visits=living.visits)

    def begin(work: Work | HeldWork) -> None:
        lifetime.lived = work.row

    return replace(
        plain,
        stem=f"{plain.stem}-updated",
        settings=replace(settings, method=stored),
        prepare=lambda: replace(plain.prepared, learn=lifetime),
        what=label,
        begin=begin,
    )
