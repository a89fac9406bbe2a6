"""The paper's experiments as data: the sources, fits and runs that each figure needs, the pictures and tables that show them.

Nothing is learned or drawn here. Where the paper is silent, an experiment shows what decides the answer: OPS-TL in three
settings of its decay, "+" variants started by the median (the caption of Figure 6) and by the mean (its text).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import Method
from qinit_cli.methods.drs import Drs
from qinit_cli.methods.logqinit_mean import LogQInitMean
from qinit_cli.methods.logqinit_median import LogQInitMedian
from qinit_cli.methods.logqinit_quantile import LogQInitQuantile
from qinit_cli.methods.maxqinit import MaxQInit
from qinit_cli.methods.mean import Mean
from qinit_cli.methods.ops_tl import OpsTl
from qinit_cli.methods.optimal import Optimal
from qinit_cli.methods.plus import Plus
from qinit_cli.methods.ptrs import Ptrs
from qinit_cli.methods.ucoi import Ucoi
from qinit_cli.methods.zero import Zero

VARIANCES = (1.0, 3.0, 5.0, 7.0, 10.0)
NOISES = (0.0002, 0.005, 0.01, 0.015, 0.02)
SHOWN_VARIANCE, SHOWN_NOISE = 7.0, 0.01  # of the figures that show one distribution

INITIALISATIONS: tuple[Method, ...] = (
    Zero(),
    Mean(),
    MaxQInit(),
    Ucoi(),
    LogQInitMedian(),
    LogQInitMean(),
    LogQInitQuantile(),
)
# each setting of ops-tl's decay gives it another rank; the paper has none
POLICY_TRANSFER: tuple[Plus, ...] = (Ptrs(), Drs(), OpsTl(), OpsTl(rho=1.0))
# always follows and never acts on its own table: a + would be the same run
FOLLOWING = OpsTl(rho=1.0, nu=1.0)
# pays for exploration as the others do
EXPLORING = tuple(
    replace(method, explore_while_following=True) for method in (OpsTl(), OpsTl(rho=1.0), FOLLOWING)
)
PLUS_STARTS = ("logqinit-median", "logqinit-mean")


@dataclass(frozen=True)
class ScaleSizes:
    """How much of one family is learned."""

    sources: int
    source_episodes: int
    targets: int
    target_episodes: int

    @classmethod
    def of(cls, family: type[Family]) -> ScaleSizes:
        """The family's own, which are the paper's."""
        return cls(
            family.source_tasks,
            family.source_learning.episodes,
            family.target_tasks,
            family.target_learning.episodes,
        )


@dataclass(frozen=True)
class Scale:
    """How much of everything is learned."""

    name: str
    sizes: Mapping[str, ScaleSizes]  # by family
    optimal: (
        int  # targets whose own tables are learned where no exact ones exist: each costs what a source does
    )
    floor: int  # tasks without noise, from each of ...
    floor_seeds: int  # ... so many seeds: what spreads by learning alone
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # of the families' own settings

    def family(self, family: type[Family], **settings: Any) -> Family:
        """The family as it is learned at this scale."""
        return family(**{**self.changes.get(family.name, {}), **settings})


SCALES = {
    "paper": Scale(
        "paper",
        {name: ScaleSizes.of(FAMILIES[name]) for name in (Gridworld.name, MountainCar.name)},
        optimal=20,
        floor=20,
        floor_seeds=5,
    ),
    "quick": Scale(
        "quick",
        {
            Gridworld.name: ScaleSizes(40, 30_000, 40, 1_000),
            MountainCar.name: ScaleSizes(30, 50_000, 30, 1_000),
        },
        optimal=10,
        floor=10,
        floor_seeds=3,
    ),
}


@dataclass(frozen=True)
class PlannedSources:
    """Source tasks of one distribution."""

    family: Family
    seed: int
    tasks: int
    episodes: int


@dataclass(frozen=True)
class PlannedFit:
    """The fit of some sources."""

    sources: PlannedSources
    options: FitOptions = field(default_factory=FitOptions)


@dataclass(frozen=True)
class PlannedRun:
    """Targets learned from what a method makes of a fit."""

    fit: PlannedFit
    method: Method
    tasks: int
    episodes: int

    @property
    def family(self) -> Family:
        """What the targets are drawn from."""
        return self.fit.sources.family


Artefact = PlannedSources | PlannedFit | PlannedRun
Kind = Literal["heatmaps", "histograms", "normality", "curves", "bars", "occupancy", "eopl", "car"]


@dataclass(frozen=True)
class PlannedPicture:
    """One picture, made of artefacts."""

    name: str  # of its file, without the ending
    kind: Kind
    artefacts: tuple[Artefact, ...]
    title: str
    caption: str


@dataclass(frozen=True)
class PlannedTable:
    """Runs side by side, as `qinit compare` has them."""

    name: str
    runs: tuple[PlannedRun, ...]
    title: str
    first: int | None = None  # targets that count; None: all

    @property
    def artefacts(self) -> tuple[Artefact, ...]:
        """What it is made of."""
        return self.runs


@dataclass(frozen=True)
class PlannedJudgement:
    """The paper's claims, as `qinit verdicts` judges them from artefacts."""

    artefacts: tuple[Artefact, ...]
    whole: bool  # whether claims that these artefacts say nothing of are told too
    name: str = "verdicts"
    title: str = "The paper's claims"


Shown = PlannedPicture | PlannedTable | PlannedJudgement


@dataclass(frozen=True)
class Experiment:
    """What stands behind one figure of the paper."""

    name: str
    pictures: tuple[PlannedPicture, ...]
    tables: tuple[PlannedTable, ...] = ()

    @property
    def artefacts(self) -> tuple[Artefact, ...]:
        """All that its pictures and tables are made of, each once."""
        shown: tuple[PlannedPicture | PlannedTable, ...] = (*self.pictures, *self.tables)
        return tuple(dict.fromkeys(artefact for each in shown for artefact in each.artefacts))


@dataclass(frozen=True)
class Study:
    """How large, and from how many independent source sets; targets are the same for all."""

    scale: Scale
    sets: int = 1

    @property
    def gridworlds(self) -> tuple[Family, ...]:
        """The distributions of Figures 4 and 6."""
        normal = [self.scale.family(Gridworld, variance=variance) for variance in VARIANCES]
        return (*normal, self.scale.family(Gridworld, goals="uniform"))

    @property
    def gridworld(self) -> Family:
        """The distribution of Figures 5 and 6, left and middle."""
        return self.scale.family(Gridworld, variance=SHOWN_VARIANCE)

    @property
    def cars(self) -> tuple[Family, ...]:
        """The distributions of Figures 7 and 8."""
        return tuple(self.scale.family(MountainCar, noise=noise) for noise in NOISES)

    @property
    def car(self) -> Family:
        """The distribution of Figure 9, left."""
        return self.scale.family(MountainCar, noise=SHOWN_NOISE)

    @property
    def floor(self) -> tuple[PlannedSources, ...]:
        """Tasks that are all alike, learned apart."""
        alike = self.scale.family(MountainCar, noise=0.0)
        episodes = self.scale.sizes[alike.name].source_episodes
        return tuple(
            PlannedSources(alike, seed, self.scale.floor, episodes) for seed in range(self.scale.floor_seeds)
        )

    def sources(self, family: Family, seed: int = 0) -> PlannedSources:
        """The sources of one source set."""
        sizes = self.scale.sizes[family.name]
        return PlannedSources(family, seed, sizes.sources, sizes.source_episodes)

    def fit(self, family: Family, seed: int = 0) -> PlannedFit:
        """The fit of one source set."""
        return PlannedFit(self.sources(family, seed))

    def runs(self, family: Family, methods: Iterable[Method]) -> tuple[PlannedRun, ...]:
        """The runs of each method from every source set; what reads no sources runs from the first alone."""
        sizes = self.scale.sizes[family.name]
        return tuple(
            PlannedRun(self.fit(family, seed), method, sizes.targets, sizes.target_episodes)
            for method in methods
            for seed in range(self.sets if method.reads_sources else 1)
        )

    def optimal(self, family: Family) -> PlannedRun:
        """The reference: all targets where exact tables exist, else the first few."""
        [run] = self.runs(family, [Optimal()])
        return run if family.tabular else replace(run, tasks=min(run.tasks, self.scale.optimal))

    def sources_told(self, family: Family) -> str:
        """The sources in words, for captions."""
        sizes = self.scale.sizes[family.name]
        return f"{sizes.sources} source tasks of {sizes.source_episodes:,} episodes"

    def told(self, family: Family) -> str:
        """All sizes in words, for captions."""
        sizes = self.scale.sizes[family.name]
        sets = "one source set" if self.sets == 1 else f"{self.sets} source sets"
        optimal = "" if family.tabular else f", optimal on the first {self.optimal(family).tasks} of them"
        return (
            f"{sets} of {self.sources_told(family)}; {sizes.targets} targets of {sizes.target_episodes:,} "
            f"episodes{optimal}"
        )


def experiment(name: str, study: Study) -> Experiment:
    """The experiment behind the figure of that name."""
    return FIGURES[name](study)


def judgement(target: str, study: Study) -> PlannedJudgement:
    """The claims that the figures of a target bear on; for whole environments with fits that test the path lengths."""
    shown = [artefact for name in TARGETS[target] for artefact in experiment(name, study).artefacts]
    whole = target not in FIGURES
    if "fig4" in TARGETS[target] and whole:
        tested = FitOptions(eopl_normality="rounded")
        shown += [
            PlannedFit(study.sources(family, seed), tested)
            for family in study.gridworlds
            for seed in range(study.sets)
        ]
    return PlannedJudgement(tuple(dict.fromkeys(shown)), whole)


def transfer(init: str) -> tuple[Method, ...]:
    """LogQInit beside policy transfer and shaping, without and with a start of that name."""
    logqinit = {method.name: method for method in INITIALISATIONS}[init]
    plus = [pair for method in POLICY_TRANSFER for pair in (method, replace(method, init=init))]
    return (Zero(), logqinit, *plus, FOLLOWING)


def distribution(family: Family) -> str:
    """The distribution in a title's words."""
    return family.label.removeprefix(f"{family.name}-").replace("-", " ")


def _fig4(study: Study) -> Experiment:
    fits = tuple(study.fit(family) for family in study.gridworlds)
    caption = (
        "Top: the probability that a task's goal is in a cell. Below: what each method starts from, largest over actions; one "
        f"column for each distribution of goals. Each from {study.sources_told(study.gridworld)}."
    )
    return Experiment(
        "fig4", (PlannedPicture("fig4", "heatmaps", fits, "Gridworld: initial values by method", caption),)
    )


def _fig5(study: Study) -> Experiment:
    family, told = study.gridworld, study.sources_told(study.gridworld)
    title = f"Gridworld, {distribution(family)}"
    values = PlannedPicture(
        "fig5",
        "histograms",
        (study.sources(family),),
        f"{title}: values over source tasks",
        f"Histograms of Q and of ln Q with the fitted curves, and quantiles against the normal's; {told}.",
    )
    normality = PlannedPicture(
        "fig5-normality",
        "normality",
        (study.fit(family),),
        f"{title}: is ln Q normal?",
        "Shapiro-Wilk's W and raw p of ln Q in every state, with their corrections side by side: not in the paper, which "
        f"shows three states. {told[0].upper()}{told[1:]}.",
    )
    return Experiment("fig5", (values, normality))


def _fig6(study: Study) -> Experiment:
    family = study.gridworld
    bars = tuple(run for each in study.gridworlds for run in _initialisations(study, each))
    pictures = (
        _curves(study, "fig6-a", (family,), "initialisations"),
        *(
            _curves(study, f"fig6-b-{init.removeprefix('logqinit-')}", (family,), "transfer", init)
            for init in PLUS_STARTS
        ),
        PlannedPicture(
            "fig6-c",
            "bars",
            bars,
            "Gridworld: average return by distribution of goals",
            f"Mean over all episodes with 95 % intervals; {study.told(family)}.",
        ),
    )
    tables = (
        PlannedTable(
            "fig6",
            tuple(dict.fromkeys((*_everything(study, family), *bars))),
            "Gridworld: methods on the same targets",
        ),
    )
    return Experiment("fig6", pictures, tables)


def _fig7(study: Study) -> Experiment:
    sources = tuple(study.sources(family) for family in study.cars)
    caption = (
        "How often each state is visited on the tasks' own greedy paths from the start, and the outlines of what is visited "
        f"at all; {study.sources_told(study.car)} for each noise."
    )
    return Experiment(
        "fig7",
        (PlannedPicture("fig7", "occupancy", sources, "Mountain Car: states on the optimal paths", caption),),
    )


def _fig8(study: Study) -> Experiment:
    floor = study.floor
    sources = (*(study.sources(family) for family in study.cars), *floor)
    caption = (
        f"Path lengths from (−0.5, 0) over {study.sources_told(study.car)} for each noise; beside them what learning alone "
        f"spreads: {len(floor)} x {floor[0].tasks} tasks without noise."
    )
    return Experiment(
        "fig8",
        (
            PlannedPicture(
                "fig8", "eopl", sources, "Mountain Car: expected optimal path lengths at the start", caption
            ),
        ),
    )


def _fig9(study: Study) -> Experiment:
    family = study.car
    # optimal met fewer targets: it is no bar beside the others
    bars = tuple(run for each in study.cars for run in study.runs(each, INITIALISATIONS))
    pictures = (
        _curves(study, "fig9-a", (family,), "initialisations"),
        PlannedPicture(
            "fig9-b",
            "bars",
            bars,
            "Mountain Car: average return by noise",
            f"Mean over all episodes with 95 % intervals; {study.told(family)}.",
        ),
        _curves(study, "fig9-c", (family,), "transfer", PLUS_STARTS[0]),
    )
    shown = tuple(dict.fromkeys((*_everything(study, family), *bars)))
    return Experiment("fig9", pictures, _tables(study, "fig9", "Mountain Car", study.cars, shown))


def _fig10(study: Study) -> Experiment:
    pictures = (
        PlannedPicture(
            f"fig10-{_in_a_name(family)}",
            "histograms",
            (study.sources(family),),
            f"Mountain Car, {distribution(family)}: values over source tasks",
            "Histograms of Q and of ln Q with the fitted curves, and quantiles against the normal's; "
            f"{study.sources_told(family)}. The paper does not say which noise it shows: here is each.",
        )
        for family in study.cars
    )
    return Experiment("fig10", tuple(pictures))


def _fig_a1(study: Study) -> Experiment:
    caption = (
        "Hill, start and goal; where the noise acts, its density, and the pushes of the "
        f"{study.scale.sizes[study.car.name].sources} source tasks."
    )
    title = f"Mountain Car with a push on the right hill, {distribution(study.car)}"
    return Experiment("figA1", (PlannedPicture("figA1", "car", (study.sources(study.car),), title, caption),))


def _fig_a2(study: Study) -> Experiment:
    shown = tuple(run for family in study.gridworlds for run in _everything(study, family))
    table = PlannedTable(
        "figA2", shown, "Gridworld: methods on the same targets, every distribution of goals"
    )
    return Experiment("figA2", _both_curves(study, "figA2", study.gridworlds), (table,))


def _fig_a3(study: Study) -> Experiment:
    shown = tuple(run for family in study.cars for run in _everything(study, family))
    return Experiment(
        "figA3",
        _both_curves(study, "figA3", study.cars),
        _tables(study, "figA3", "Mountain Car", study.cars, shown),
    )


def _both_curves(study: Study, name: str, families: tuple[Family, ...]) -> tuple[PlannedPicture, ...]:
    return tuple(_curves(study, f"{name}-{kind}", families, kind) for kind in ("initialisations", "transfer"))


def _curves(
    study: Study, name: str, families: tuple[Family, ...], kind: str, init: str = PLUS_STARTS[0]
) -> PlannedPicture:
    """Learning curves of one kind of methods, a panel for each distribution."""
    of = {"initialisations": "initialisation methods", "transfer": f"transfer methods, + started by {init}"}
    shown = [
        run
        for family in families
        for run in (
            _initialisations(study, family)
            if kind == "initialisations"
            else (*study.runs(family, transfer(init)), study.optimal(family))
        )
    ]
    where = "Gridworld" if families[0].tabular else "Mountain Car"
    one = f", {distribution(families[0])}" if len(families) == 1 else ""
    caption = f"Mean over targets, smoothed over 20 episodes, with 95 % bands; {study.told(families[0])}."
    return PlannedPicture(name, "curves", tuple(shown), f"{where}{one}: {of[kind]}", caption)


def _tables(
    study: Study, name: str, title: str, families: tuple[Family, ...], shown: tuple[PlannedRun, ...]
) -> tuple[PlannedTable, ...]:
    """One of all targets, and one of those few that `optimal` met too, with regret."""
    references = tuple(study.optimal(family) for family in families)
    few = max(run.tasks for run in references)
    methods = tuple(run for run in shown if run not in references)
    met = {run.family for run in methods}
    beside = (*methods, *(run for run in references if run.family in met))
    return (
        PlannedTable(name, methods, f"{title}: methods on the same targets"),
        PlannedTable(
            f"{name}-optimal", beside, f"{title}: on the first {few} targets, which optimal met too", few
        ),
    )


def _initialisations(study: Study, family: Family) -> tuple[PlannedRun, ...]:
    return (*study.runs(family, INITIALISATIONS), study.optimal(family))


def _everything(study: Study, family: Family) -> tuple[PlannedRun, ...]:
    """Every method on one distribution."""
    more = [run for init in PLUS_STARTS for run in study.runs(family, transfer(init))]
    return tuple(dict.fromkeys((*_initialisations(study, family), *more, *study.runs(family, EXPLORING))))


def _in_a_name(family: Family) -> str:
    return distribution(family).replace(" ", "-")


FIGURES: dict[str, Callable[[Study], Experiment]] = {
    "fig4": _fig4,
    "fig5": _fig5,
    "fig6": _fig6,
    "fig7": _fig7,
    "fig8": _fig8,
    "fig9": _fig9,
    "fig10": _fig10,
    "figA1": _fig_a1,
    "figA2": _fig_a2,
    "figA3": _fig_a3,
}
TARGETS: dict[str, tuple[str, ...]] = {
    **{name: (name,) for name in FIGURES},
    Gridworld.name: ("fig4", "fig5", "fig6", "figA2"),
    MountainCar.name: ("fig7", "fig8", "fig9", "fig10", "figA1", "figA3"),
    "all": tuple(FIGURES),
}
