"""The library: each stage as a function, artefacts as objects, for scripts and notebooks.

    import qinit_cli as qinit

    sources = qinit.train_sources(qinit.families.gridworld(variance=7), tasks=100)
    fit = qinit.fit(sources)
    table = fit.start("logqinit-median")
    runs = [qinit.transfer(name, fit, tasks=200) for name in ("zero", "logqinit-median")]
    qinit.compare(runs).rows

Nothing is printed: what a stage reports goes to a Reporter, which is silent by default. Without a `store` an artefact is held in
memory, with one it is a file there, the very one that the command makes: the same settings give the same content hash. Every
function raises the exceptions that the command turns into exit codes (qinit_cli.errors, qinit_store.errors).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar

import numpy as np

from qinit_cli.artefacts import named_arrays
from qinit_cli.artefacts.choice import Choice
from qinit_cli.artefacts.fit import FIT
from qinit_cli.artefacts.formats import attributes
from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.artefacts.run import RUN
from qinit_cli.artefacts.sources import SOURCES
from qinit_cli.artefacts.tuning import TUNING
from qinit_cli.comparison import rows as comparing
from qinit_cli.comparison import runs as compared
from qinit_cli.comparison import sensitivity as sensitivities
from qinit_cli.comparison.score_matrices import score_matrices
from qinit_cli.comparison.scores import Metric
from qinit_cli.comparison.table import plain_rows
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.family import task_count
from qinit_cli.environments.folds import each_fold
from qinit_cli.errors import NotAllowed, TasksFailed, UsageError
from qinit_cli.fitted import FitOptions
from qinit_cli.importing import runs as imported_curves
from qinit_cli.importing import tables as importing
from qinit_cli.importing.asked import LEAST_VISITS, ImportedFiles
from qinit_cli.learners import LEARNERS, Learner
from qinit_cli.learners.exploration import Exploration
from qinit_cli.methods import METHODS, Method
from qinit_cli.options import options, tunable
from qinit_cli.pipeline import cross_validation as validation
from qinit_cli.pipeline import fitting, tuning
from qinit_cli.pipeline import lifelong as lifetimes
from qinit_cli.pipeline import sources as source_tasks
from qinit_cli.pipeline import transfer as target_tasks
from qinit_cli.pipeline.asked import CrossValidating, LearningSources, LearningTargets, Living
from qinit_cli.pipeline.job import Made, Plan, make
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.knowledge import Knowledge
from qinit_cli.pipeline.machine import OneProcess
from qinit_cli.pipeline.optimal_tables import beginning_of
from qinit_cli.pipeline.reporter import SILENT, Reporter
from qinit_cli.pipeline.starts import start_table
from qinit_cli.pipeline.words import option_words
from qinit_cli.registry import Registry
from qinit_cli.schedules import Schedule
from qinit_store.catalog import Store

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from qinit_cli.arrays import Floats
    from qinit_store.held import Held
    from qinit_store.reading import Artefact

Where = str | os.PathLike[str] | None
Options = TypeVar("Options")


class Kinds(Mapping[str, type[Any]]):
    """Families, methods or learners by name, also as attributes with `_` for `-`: `families.gridworld(variance=7)`."""

    def __init__(self, registry: Registry[Any]) -> None:
        self._registry = registry

    def __getitem__(self, name: str) -> type[Any]:
        return self._registry[name]

    def __getattr__(self, name: str) -> type[Any]:
        try:
            return self._registry[name.replace("_", "-")]
        except KeyError:
            raise AttributeError(
                f"there is no {self._registry.noun} {name!r}; there are {', '.join(self)}"
            ) from None

    def __dir__(self) -> list[str]:
        return [name.replace("-", "_") for name in self]

    def __iter__(self) -> Iterator[str]:
        return iter(self._registry)

    def __len__(self) -> int:
        return len(self._registry)


families = Kinds(FAMILIES)
methods = Kinds(METHODS)
learners = Kinds(LEARNERS)


@dataclass(frozen=True, repr=False)
class Saved:
    """An artefact: a file, or held in memory. `artefact[name]` is one of its arrays."""

    kind: ClassVar[str]  # whose artefacts are opened as this class
    source: Path | Held

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.path or f'{self.name}, in memory'}>"

    @property
    def path(self) -> Path | None:
        """The file; None in memory."""
        return self.source if isinstance(self.source, Path) else None

    @property
    def name(self) -> str:
        """The name that tables and pictures show."""
        return (self.source if isinstance(self.source, Path) else self.source.path).stem

    @property
    def digest(self) -> str:
        """The content hash, SHA-256 in hexadecimal digits: equal settings give equal hashes."""
        with self._opened() as artefact:
            return artefact.content_sha256

    @property
    def settings(self) -> dict[str, Any]:
        """All that its numbers depend on, as plain values."""
        with self._opened() as artefact:
            return dict(artefact.spec)

    @property
    def arrays(self) -> tuple[str, ...]:
        """The names of its arrays, axes included."""
        with self._opened() as artefact:
            return (*artefact.axes, *(column.name for column in artefact.schema.columns))

    def __getitem__(self, name: str) -> Any:
        """The array of that name, verified; its axes are those of docs/store.md. KeyError where there is none."""
        if name not in self.arrays:
            raise KeyError(f"{self.name} has no array {name!r}; it has {', '.join(self.arrays)}")
        with self._opened() as artefact:
            axes = artefact.axes
            return axes[name].values.copy() if name in axes else artefact.read(name)

    def to_xarray(self) -> xr.Dataset:
        """All arrays as a dataset with named axes, units and long names; its attributes hold hashes, settings and origin.

        `.to_netcdf(path)` of it, and `qinit export -o x.nc`, keep all of this. UsageError where xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError as missing:
            raise UsageError(
                "to_xarray needs xarray, which is not installed: pip install xarray"
            ) from missing
        with self._opened() as artefact:
            variables = {
                array.name: (array.dims, np.concatenate(list(array.pieces)), array.attributes)
                for array in named_arrays.arrays(artefact, None)
            }
            axes = {name: variables.pop(name) for name in artefact.axes if name in variables}
            return xr.Dataset(variables, axes, attributes(artefact))

    def _opened(self) -> Artefact:
        return open_artefact(self.source)


class Sources(Saved):
    """Learned source tasks: `q` (N, *states, A), `eopl`, `visits` and their parameters."""

    kind = SOURCES.name


class Fit(Saved):
    """A fit of sources: `mu`, `sigma`, `mean` and the like, (*states, A)."""

    kind = FIT.name

    def start(self, method: str | Method, **options: Any) -> Floats:
        """The start table of a method as a target would get it, (*states, A): filled where unknown, clipped to [0, 1].

        `options` are the method's, where it is given by name. NotAllowed for a method that reads the target itself.

        >>> import qinit_cli as qinit
        >>> sources = qinit.train_sources(qinit.families.gridworld(size=4, variance=1), tasks=3, learner="exact")
        >>> qinit.fit(sources).start("mean").shape
        (4, 4, 4)
        """
        return start_table(Knowledge.read(self.source), _method(method, options)).start


class Run(Saved):
    """Target tasks learned from what a method starts them with: `steps` and `reached` (T, E)."""

    kind = RUN.name

    def returns(self) -> Floats:
        """The discounted return of every episode, (T, E)."""
        with self._opened() as artefact:
            return compared.ComparedRun.from_artefact(artefact).returns()


class Tuning(Saved):
    """How candidates of a method's parameters fare on the sources: `average` (N, C)."""

    kind = TUNING.name

    @property
    def choice(self) -> dict[str, float]:
        """The parameters that fare best."""
        with self._opened() as artefact:
            return dict(Choice.of(artefact).chosen.parameters)


@dataclass(frozen=True)
class Comparison:
    """Methods on the same targets, set against a baseline, with 95 % intervals."""

    rows: list[dict[str, Any]]  # as `qinit compare --format json` prints them
    _runs: Sequence[compared.ComparedRun] = field(repr=False, compare=False)
    _metric: Metric = field(repr=False, compare=False)

    def to_rliable(self) -> dict[str, Floats]:
        """The scores by method, (source sets, targets), as rliable takes them: the metric's mean over all episodes.

        rliable resamples source sets, so that its intervals want several. NotAllowed where the runs did not all meet the same
        targets.
        """
        return score_matrices(self._runs, self._metric)

    def to_pandas(self) -> pd.DataFrame:
        """The rows as a table; UsageError where pandas is not installed."""
        return _frame(self.rows)


@dataclass(frozen=True)
class Sensitivity:
    """How an average changes over a setting, or what decides it."""

    rows: list[dict[str, Any]]  # as `qinit sensitivity --format json` prints them
    about: str  # what the intervals are over, or the shares are of

    def to_pandas(self) -> pd.DataFrame:
        """The rows as a table; UsageError where pandas is not installed."""
        return _frame(self.rows)


def _frame(rows: list[dict[str, Any]]) -> pd.DataFrame:
    try:
        import pandas as pd
    except ImportError as missing:
        raise UsageError("to_pandas needs pandas, which is not installed: pip install pandas") from missing
    return pd.DataFrame(rows)


SAVED = {each.kind: each for each in (Sources, Fit, Run, Tuning)}


def open(reference: str | os.PathLike[str], *, store: Where = "qinit-store") -> Saved:
    """The artefact at a path, or of that name in the store, verified: Sources, Fit, Run or Tuning; Saved for another kind.

    NotFound where there is none; Damaged where it is not as it was written.
    """
    source = _source(os.fspath(reference), store)
    with open_artefact(source) as artefact:
        return SAVED.get(artefact.kind, Saved)(source)


def folds(family: Family, count: int) -> list[Family]:
    """The family with all tasks of its file but one fold's as sources, for each of `count` folds (`--folds`).

    Targets of `transfer` are then the tasks of the fold, unless others are named. UsageError for a family that draws its tasks.

    >>> import qinit_cli as qinit
    >>> [one.use for one in qinit.folds(qinit.families.tasks(file="mdps.npz"), 2)]
    ['fold:1/2', 'fold:2/2']
    """
    return list(each_fold(family, count))


def train_sources(
    family: Family,
    *,
    tasks: int | None = None,
    seed: int = 0,
    learner: str | Learner = "q-learning",
    episodes: int | None = None,
    horizon: int | None = None,
    alpha: float | str | Schedule | None = None,
    gamma: float | None = None,
    epsilon: float | str | Schedule | None = None,
    explore: str | Exploration | None = None,
    start: Literal["anywhere", "fixed"] | None = None,
    representation: Literal["table", "tiles"] = "table",
    tilings: int | None = None,
    tiles: int | None = None,
    probes: int | None = None,
    store: Where = None,
    output: Where = None,
    jobs: int | None = None,
    reporter: Reporter = SILENT,
) -> Sources:
    """Source tasks of a family, learned, or solved (`learner="exact"`); None: as the family has it (`qinit train-sources`).

    Tasks are drawn by `seed`, each with streams of its own, so that more tasks leave the first ones as they are. `store` is a
    folder, `output` a file of its own; without both the sources are held in memory. Learners, explorations and schedules are
    given as texts, as on the command line, or as instances: `learners.sarsa_lambda(lambda_=0.8)`. With `representation="tiles"`
    values are sums of weights over `tilings` grids of `tiles` tiles a dimension, and `q` is (N, P, A) at P `probes`
    (docs/continuous.md). UsageError for settings that cannot be.

    >>> import qinit_cli as qinit
    >>> sources = qinit.train_sources(qinit.families.gridworld(size=4, variance=1), tasks=3, learner="exact")
    >>> sources["q"].shape
    (3, 4, 4, 4)
    """
    asked = _asked(
        LearningSources,
        tasks=tasks,
        seed=seed,
        learner=learner,
        episodes=episodes,
        horizon=horizon,
        alpha=alpha,
        gamma=gamma,
        epsilon=epsilon,
        explore=explore,
        start=start,
        representation=representation,
        tilings=tilings,
        tiles=tiles,
        probes=probes,
    )
    words = ("train-sources", family.name, *option_words(family), *option_words(asked))
    family = family.opened()
    wanted = source_tasks.tasks_of(family, asked)
    plan = source_tasks.plan_of(wanted, task_count(family, "source", asked.tasks))
    return Sources(_made(plan, _keeping(store, output, words), jobs, reporter).source)


def import_tables(
    tables: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | Floats | Mapping[str, Any],
    *,
    gamma: float,
    axes: str | None = None,
    actions: str | None = None,
    returns: str | None = None,
    key: str = "q",
    visits: str = "visits",
    td_var: str = "td_var",
    min_visits: int = LEAST_VISITS,
    name: str | None = None,
    store: Where = None,
    output: Where = None,
    reporter: Reporter = SILENT,
) -> Sources:
    """Tables that another program learned, as sources (`qinit import`): files, an array (N, *states, A), or arrays by name.

    Arrays are given as `q`, `visits` and `td_var`, of one shape; NaN is a pair that is unknown. UsageError for a layout that
    does not fit `axes` ("row=30,col=30") and `actions`; NotAllowed for values outside `returns` ("-100:0"; None: 0 to 1).

    >>> import numpy as np, qinit_cli as qinit
    >>> sources = qinit.import_tables(np.random.default_rng(0).random((3, 5, 5, 4)), gamma=0.95)
    >>> qinit.fit(sources).start("mean").shape
    (5, 5, 4)
    """
    asked = _asked(
        ImportedFiles,
        gamma=gamma,
        axes=axes,
        actions=actions,
        returns=returns,
        key=key,
        visits=visits,
        td_var=td_var,
        min_visits=min_visits,
        name=name,
    )
    given = list(tables) if isinstance(tables, Sequence) and not isinstance(tables, str) else [tables]
    words = ("import", *(str(one) if isinstance(one, str | os.PathLike) else "ARRAY" for one in given))
    keeping = _keeping(store, output, (*words, *option_words(asked)))
    return Sources(importing.make_import(given, asked, keeping, reporter).source)


def import_runs(
    file: str | os.PathLike[str],
    *,
    gamma: float | None = None,
    returns: str | None = None,
    name: str | None = None,
    horizon: int | None = None,
    store: Where = None,
    output: Where = None,
) -> list[Run]:
    """The learning curves of other agents, a run for each method in the file (`qinit import --runs`).

    Rows of task, episode, method (one is left out), and return, or steps and reached with the discount `gamma`. UsageError where
    a column is missing, NotAllowed where a task lacks an episode.
    """
    asked = _asked(ImportedFiles, gamma=gamma, returns=returns, name=name, runs=True, horizon=horizon)
    words = ("import", os.fspath(file), *option_words(asked))
    made = imported_curves.import_runs(Path(file), asked, _keeping(store, output, words))
    return [Run(one.source) for _, one in made]


def fit(
    sources: Sources | str | os.PathLike[str],
    *,
    estimator: Literal["mle", "umvue", "zellner", "shen"] = "mle",
    library: int = 100,
    exclude_unlearned: bool = False,
    normality: Literal["shapiro", "anderson", "lilliefors", "none"] = "shapiro",
    eopl_normality: Literal["rounded", "dither", "none"] = "none",
    alternatives: bool = False,
    holdout: int = 0,
    check_theory: bool = False,
    store: Where = None,
    output: Where = None,
    reporter: Reporter = SILENT,
) -> Fit:
    """The fit of sources per state-action: moments, log-normal parameters and a library of tables (`qinit fit`).

    The settings are FitOptions'. NotAllowed for fewer than two sources.

    >>> import qinit_cli as qinit
    >>> sources = qinit.train_sources(qinit.families.gridworld(size=4, variance=1), tasks=3, learner="exact")
    >>> qinit.fit(sources)["mu"].shape
    (4, 4, 4)
    """
    asked = _asked(
        FitOptions,
        estimator=estimator,
        library=library,
        exclude_unlearned=exclude_unlearned,
        normality=normality,
        eopl_normality=eopl_normality,
        alternatives=alternatives,
        holdout=holdout,
        check_theory=check_theory,
    )
    source = _source(sources, store)
    words = ("fit", _told(source), *option_words(asked))
    made, _, _ = fitting.make_fit(source, asked, _keeping(store, output, words), reporter)
    return Fit(made.source)


def transfer(
    method: str | Method,
    fit: Fit | str | os.PathLike[str],
    *,
    tasks: int | None = None,
    seed: int = 0,
    learner: str | Learner = "q-learning",
    episodes: int | None = None,
    horizon: int | None = None,
    alpha: float | str | Schedule | None = None,
    gamma: float | None = None,
    epsilon: float | str | Schedule | None = None,
    explore: str | Exploration | None = None,
    start: Literal["anywhere", "fixed"] | None = None,
    shift: Mapping[str, Any] | None = None,
    targets: str | None = None,
    allow_overlap: bool = False,
    evaluate_every: int = 0,
    keep_q: bool = False,
    blend: Literal["none", "knownness"] = "none",
    known_at: int | None = None,
    tuned: Tuning | None = None,
    store: Where = None,
    output: Where = None,
    jobs: int | None = None,
    reporter: Reporter = SILENT,
) -> Run:
    """Target tasks of the fit's family, learned from what a method starts them with (`qinit transfer`).

    Targets and their chance depend on `seed` alone, so that every method meets the same. `shift` changes fields of the family;
    `targets` names tasks of the sources' file, see `qinit train-sources tasks`. With `blend="knownness"` the start gives way to
    values learned from a return of 0, wholly after `known_at` updates (None: 10).

    >>> import qinit_cli as qinit
    >>> sources = qinit.train_sources(qinit.families.gridworld(size=4, variance=1), tasks=3, learner="exact")
    >>> qinit.transfer("zero", qinit.fit(sources), tasks=2, episodes=5)["steps"].shape
    (2, 5)
    """
    asked = _asked(
        LearningTargets,
        tasks=tasks,
        seed=seed,
        learner=learner,
        episodes=episodes,
        horizon=horizon,
        alpha=alpha,
        gamma=gamma,
        epsilon=epsilon,
        explore=explore,
        start=start,
        shift=_texts_of(shift),
        targets=targets,
        allow_overlap=allow_overlap,
        evaluate_every=evaluate_every,
        keep_q=keep_q,
        blend=blend,
        known_at=known_at,
    )
    source, chosen = _source(fit, store), _method(method, {})
    known = Knowledge.read(source)
    given: list[dict[str, str]] = []
    if tuned is not None:
        chosen, given = tuning.chosen(tuned.source, chosen, known.family)
    words = ("transfer", chosen.name, _told(source), *option_words(chosen), *option_words(asked))
    keeping = _keeping(store, output, words)
    learned, count = target_tasks.targets_of(chosen, asked, known.settings.sources)
    machine = _asked(OneProcess, jobs=jobs)
    beginning = beginning_of(chosen, known, learned, count, keeping, machine, reporter)
    plan = target_tasks.plan_of(chosen, learned, beginning, count, known, given)
    return Run(_made(plan, keeping, jobs, reporter).source)


def lifelong(
    method: str | Method,
    fit: Fit | str | os.PathLike[str],
    *,
    update: bool = False,
    min_visits: int | None = None,
    tasks: int | None = None,
    seed: int = 0,
    learner: str | Learner = "q-learning",
    episodes: int | None = None,
    horizon: int | None = None,
    alpha: float | str | Schedule | None = None,
    gamma: float | None = None,
    epsilon: float | str | Schedule | None = None,
    explore: str | Exploration | None = None,
    start: Literal["anywhere", "fixed"] | None = None,
    shift: Mapping[str, Any] | None = None,
    targets: str | None = None,
    allow_overlap: bool = False,
    evaluate_every: int = 0,
    keep_q: bool = False,
    blend: Literal["none", "knownness"] = "none",
    known_at: int | None = None,
    store: Where = None,
    output: Where = None,
    jobs: int | None = None,
    reporter: Reporter = SILENT,
) -> Run:
    """Target tasks one after another; with `update` each adds what it learned to what later ones start from.

    Without `update` no task depends on another, and the run is that of `transfer` (`qinit lifelong`).
    """
    asked = _asked(
        LearningTargets,
        tasks=tasks,
        seed=seed,
        learner=learner,
        episodes=episodes,
        horizon=horizon,
        alpha=alpha,
        gamma=gamma,
        epsilon=epsilon,
        explore=explore,
        start=start,
        shift=_texts_of(shift),
        targets=targets,
        allow_overlap=allow_overlap,
        evaluate_every=evaluate_every,
        keep_q=keep_q,
        blend=blend,
        known_at=known_at,
    )
    living = _asked(Living, update=update, min_visits=min_visits)
    source, chosen = _source(fit, store), _method(method, {})
    if not living.update:
        return transfer(
            chosen,
            Fit(source),
            tasks=tasks,
            seed=seed,
            learner=learner,
            episodes=episodes,
            horizon=horizon,
            alpha=alpha,
            gamma=gamma,
            epsilon=epsilon,
            explore=explore,
            start=start,
            shift=shift,
            targets=targets,
            allow_overlap=allow_overlap,
            evaluate_every=evaluate_every,
            keep_q=keep_q,
            blend=blend,
            known_at=known_at,
            store=store,
            output=output,
            jobs=jobs,
            reporter=reporter,
        )
    lifetimes.check_updates(chosen)
    known = Knowledge.read(source)
    words = (
        *("lifelong", chosen.name, _told(source)),
        *option_words(chosen),
        *option_words(living),
        *option_words(asked),
    )
    learned, count = target_tasks.targets_of(chosen, replace(asked, keep_q=True), known.settings.sources)
    plan = lifetimes.lifetime_plan(chosen, living, replace(learned, keep_visits=True), count, known)
    return Run(_made(plan, _keeping(store, output, words), 1, reporter, fail_fast=True).source)


def tune(
    method: str | Method,
    sources: Sources | str | os.PathLike[str],
    *,
    grid: Mapping[str, Sequence[float]] | None = None,
    learner: str | Learner = "q-learning",
    episodes: int | None = None,
    alpha: float | str | Schedule | None = None,
    epsilon: float | str | Schedule | None = None,
    explore: str | Exploration | None = None,
    store: Where = None,
    output: Where = None,
    jobs: int | None = None,
    reporter: Reporter = SILENT,
) -> Tuning:
    """How a method's parameters fare on the sources, each in the place of a target (`qinit tune`).

    `grid` maps parameters to the values to try, all combinations of them; by default those that the method declares.
    """
    source, chosen = _source(sources, store), _method(method, {})
    values = {
        name: tuple(float(value) for value in several)
        for name, several in (tunable(type(chosen)) if grid is None else grid).items()
    }
    known = [one.name for one in options(type(chosen))]
    if unknown := sorted(values.keys() - set(known)):
        raise UsageError(f"{chosen.name} has no parameter {unknown[0]}; it has {', '.join(known) or 'none'}")
    values = {name: values[name] for name in known if name in values}
    if not values:
        raise UsageError(f"{chosen.name} has no parameters to choose; give a grid")
    asked = _asked(
        CrossValidating,
        learner=learner,
        episodes=episodes,
        alpha=alpha,
        epsilon=epsilon,
        explore=explore,
        jobs=jobs,
    )
    with open_artefact(source, "sources") as artefact:
        plan = validation.plan_for(artefact, chosen, values, asked)
        words = ["tune", chosen.name, _told(source), *option_words(replace(asked, jobs=None))]
        for name, several in values.items():
            words += [f"--{name.replace('_', '-')}", ",".join(f"{value:g}" for value in several)]
        made = _made(plan, _keeping(store, output, words), jobs, reporter)
    return Tuning(made.source)


def compare(
    runs: Iterable[Run | str | os.PathLike[str]],
    *,
    metric: Metric = "return",
    baseline: str = "zero",
    greedy: bool = False,
    store: Where = "qinit-store",
) -> Comparison:
    """Runs that met the same targets, set against a baseline's with 95 % intervals (`qinit compare`).

    `baseline` is a method or a run's name; `greedy` compares greedy evaluations in the place of learning episodes. NotAllowed for
    runs that cannot stand beside each other.
    """
    shown = _compared(runs, store, greedy=greedy)
    if not shown:
        raise NotAllowed("compare was given no runs; give at least one")
    return Comparison(plain_rows(comparing.compare(shown, baseline, metric), metric), shown, metric)


def sensitivity(
    runs: Iterable[Run | str | os.PathLike[str]],
    over: str | None = None,
    *,
    metric: Metric = "return",
    greedy: bool = False,
    store: Where = "qinit-store",
) -> Sensitivity:
    """How the average of runs changes `over` a setting that varies among them, such as "variance", with 95 % intervals.

    Without `over`: the share of each setting in the variance of the average (`qinit sensitivity`). UsageError for a setting that
    does not vary, NotAllowed where none does.

    >>> import qinit_cli as qinit
    >>> fits = [
    ...     qinit.fit(qinit.train_sources(qinit.families.gridworld(size=4, variance=v), tasks=3, learner="exact"))
    ...     for v in (1, 2)
    ... ]
    >>> runs = [qinit.transfer("zero", fit, tasks=2, episodes=5) for fit in fits]
    >>> [row["value"] for row in qinit.sensitivity(runs, "variance").rows]
    [1.0, 2.0]
    """
    shown = _compared(runs, store, greedy=greedy)
    told = (
        sensitivities.shares_told(shown, metric)
        if over is None
        else sensitivities.points_told(shown, over, metric)
    )
    return Sensitivity(told.rows, told.about)


def start(method: str | Method, fit: Fit | str | os.PathLike[str], **options: Any) -> Floats:
    """The start table of a method as a target would get it, (*states, A); see Fit.start (`qinit start`)."""
    return Fit(_source(fit, "qinit-store")).start(method, **options)


def _compared(
    runs: Iterable[Run | str | os.PathLike[str]], store: Where, *, greedy: bool
) -> list[compared.ComparedRun]:
    """The runs as they are compared, each once."""
    found: dict[str, compared.ComparedRun] = {}
    for run in runs:
        with open_artefact(_source(run, store), "run") as artefact:
            found.setdefault(artefact.content_sha256, compared.ComparedRun.from_artefact(artefact))
    return [run.greedy() if greedy else run for run in found.values()]


def _texts_of(shift: Mapping[str, Any] | None) -> list[str] | None:
    return [f"{name}={value}" for name, value in shift.items()] if shift else None


def _asked(kind: type[Options], **given: Any) -> Options:
    """The settings; UsageError where they cannot be."""
    try:
        return kind(**given)
    except ValueError as error:
        raise UsageError(str(error)) from error


def _method(method: str | Method, given: Mapping[str, Any]) -> Method:
    if isinstance(method, str):
        if method not in METHODS:
            raise UsageError(f"there is no method {method!r}; there are {', '.join(METHODS)}")
        return _asked(METHODS[method], **given)
    if given:
        raise UsageError("options are given with a method's name; a method has its own already")
    return method


def _source(saved: Saved | str | os.PathLike[str], store: Where) -> Path | Held:
    """What an artefact is opened by: a file, or itself in memory."""
    if isinstance(saved, Saved):
        return saved.source
    return Store(Path(store or "qinit-store")).resolve(os.fspath(saved))


def _told(source: Path | Held) -> str:
    return str(source if isinstance(source, Path) else source.path)


def _keeping(store: Where, output: Where, words: Sequence[str]) -> Keeping:
    folder = None if store is None else Path(store)
    file = None if output is None else Path(output)
    more = [] if store is None else ["--store", str(folder)]
    return Keeping(folder, file, command=(*words, *more, *(["-o", str(file)] if file else [])))


def _made(
    plan: Plan, keeping: Keeping, jobs: int | None, reporter: Reporter, *, fail_fast: bool = False
) -> Made:
    """What was made; TasksFailed where a task failed, UsageError for jobs that cannot be."""
    made = make(plan, keeping, _asked(OneProcess, jobs=jobs, fail_fast=fail_fast), reporter)
    if made.tally.failed:
        raise TasksFailed(
            f"{made.tally.failed} of {made.tally.tasks} tasks failed; the reporter was given why"
        )
    return made
