"""A run: how a method fared on target tasks."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.artefacts.kind import DIGEST_FIELD, Field, Kind, Reported, Shown
from qinit_cli.environments.tiled import PROBES, PROJECTED
from qinit_cli.learners.exploration import EpsilonGreedy
from qinit_cli.rewards import UNIT, ReturnBounds

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.artefacts.settings import RunSettings, Spec, StoredMethod
    from qinit_store.reading import Artefact
    from qinit_store.schema import Array, Axis, Column, Schema

OF_TRANSFER = (
    "start",
    "potential",
    "steps",
    "reached",
    "seconds",
)  # columns of targets that were learned here
CURVES = ("steps", "reached", "return")  # columns of imported runs, some of them
EVALUATED = ("eval_return", "eval_reached", "eval_steps")
SMOOTH = 20  # episodes averaged into each point of a curve, as plot does unless told otherwise


class RunKind(Kind["RunSettings"]):
    """How a method fared on target tasks."""

    name = "run"
    folder = "runs"
    maker = "transfer"
    one, several, counted = "run", "runs", "targets"
    tables: ClassVar[Mapping[str, str]] = {
        "episodes": "steps",
        "targets": "seconds",
        "start": "start",
        "potential": "potential",
        "evaluations": "eval_return",
        "final": "q",
        "start-weights": "start_weights",
        "probes": PROBES,
    }
    table = "start"
    has_parameters = True
    free = ("start", "potential")
    indices = ("episode", "evaluation", "hypothesis")
    results = ("seconds", "v_star", "v_eps", "added", "log_std", "moves", "frozen")

    def read(self, spec: Spec) -> RunSettings:
        from qinit_cli.artefacts.settings import RunSettings

        return RunSettings.read(spec)

    def least(self, states: tuple[Axis, ...], action: Axis, there: Container[str]) -> tuple[Column, ...]:
        return run_schema(
            states,
            action,
            (),
            1,
            start_per_task=False,
            potential_per_task=False,
            exact_values=False,
            evaluations=0,
            keep_q=False,
        ).columns

    def lack(self, schema: Schema, *, part: bool) -> str:
        names = {column.name for column in schema.columns}
        # imported curves lack all of what a transfer leaves; `asked` refuses others without it
        if names & set(CURVES) and not names & {"start", "potential", "seconds"}:
            return ""
        if part:
            return "" if names >= {"steps", "reached", "task_digest"} else "steps, reached or task_digest"
        return super().lack(schema, part=part)

    def table_dims(self, schema: Schema, table: str) -> tuple[str, ...]:
        if self.has_table(schema):
            return super().table_dims(schema, table)
        # of imported curves nothing but episodes is there
        return {"episodes": ("task", "episode"), "targets": ("task",)}.get(table, ())

    def asked(self, spec: Spec) -> tuple[str, ...]:
        settings = self.read(spec)
        if settings.imported:
            return ()
        tables = ("q",) if settings.keep_q else ()
        # an earlier version kept no steps of evaluations
        evaluated = ("eval_return", "eval_reached") if settings.evaluate_every else ()
        tiled = (PROBES,) if settings.family.tiled else ()
        return (*OF_TRANSFER, *tables, *evaluated, *tiled)

    def lengths(self, artefact: Artefact) -> dict[str, int]:
        settings = self.read(artefact.spec)
        episodes, every = settings.learning.episodes, settings.evaluate_every
        return {"episode": episodes, "evaluation": 1 + episodes // every if every else 0}

    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        there = {column.name: column for column in artefact.schema.columns}
        if self.read(artefact.spec).imported:
            if not ("return" in there or {"steps", "reached"} <= there.keys()):
                raise ValueError("it has neither returns nor steps and goals")
            return imported_run_schema(artefact.schema.sizes["episode"], CURVES).columns
        axes, sizes = {axis.name: axis for axis in artefact.schema.axes}, artefact.schema.sizes
        return run_schema(
            *self.axes(artefact),
            (),
            sizes["episode"],
            start_per_task=there["start"].per_task,
            potential_per_task=there["potential"].per_task,
            exact_values="v_star" in there or "v_eps" in there,
            attainable=isinstance(self.read(artefact.spec).learning.explore, EpsilonGreedy),
            evaluations=sizes.get("evaluation", 0),
            keep_q="q" in there,
            updating="visits" in there,
            hypotheses=sizes.get("hypothesis", 0),
            moments=axes["moment"].values if "moment" in axes else None,
            bounds=self.read(artefact.spec).bounds,
            told_returns="return" in there,
            tiled=self.read(artefact.spec).family.tiled,
        ).columns

    def highest(self, artefact: Artefact) -> dict[str, float]:
        learning = self.read(artefact.spec).learning
        return {"steps": learning.horizon, "eval_steps": learning.horizon, "frozen": learning.episodes}

    def within(self, columns: Iterable[Column], artefact: Artefact) -> list[Column]:
        from dataclasses import replace

        from qinit_cli.artefacts.columns import ROUNDING
        from qinit_cli.methods import METHODS

        settings = self.read(artefact.spec)
        own, bounds = METHODS.is_own(settings.method.name), settings.bounds
        slack, width = ROUNDING * bounds.width, bounds.width
        # potentials of our methods are within the bounds, or 0, and a shaped value is a plain one less its potential
        ours = {
            "potential": (min(0.0, bounds.low - (bounds != UNIT) * slack), max(0.0, bounds.high) + slack),
            "q": (bounds.low - width - slack, bounds.high + width + slack),
        }
        ours = ours if own and not settings.family.tiled else {}
        found = super().within(columns, artefact)
        return [
            replace(one, low=ours[one.name][0], high=ours[one.name][1]) if one.name in ours else one
            for one in found
        ]

    def shown(self, artefact: Artefact) -> Shown:
        import numpy as np

        from qinit_cli.analysis import returns

        curves = mean_curves(artefact)
        targets = artefact.task_count
        if not targets:
            return Shown({"targets": 0, "episodes": artefact.schema.sizes["episode"]}, np.empty(0))
        curve = curves["return"]
        numbers: dict[str, int | float | str] = {
            "targets": targets,
            "episodes": len(curve),
            "average_return": float(curve.mean()),
            "first_10": float(returns.jumpstart(curve)),
            "last_tenth": float(returns.asymptotic(curve)),
            **({"success": float(curves["success"].mean())} if "success" in curves else {}),
            **({"restricted_steps": float(curves["steps"].mean())} if "steps" in curves else {}),
            **{name: float(curves[name]) for name in ("v_star", "v_eps") if name in curves},
        }
        if PROJECTED in {column.name for column in artefact.schema.columns}:
            numbers |= projection_errors(artefact.read("start"), artefact.read(PROJECTED))
        title = f"discounted return, mean over targets and the last {SMOOTH} episodes"
        return Shown(numbers, returns.smoothed(curve, SMOOTH), "curve", title, "episode")

    def reported(self, told: RunSettings) -> Iterator[Reported]:
        if told.imported:
            yield Reported(
                "Imported curves", {name: own for name, own in told.spec().items() if name != "method"}
            )
            yield Reported("Methods", method_reported(told.method))
            return
        known, given = told.source_set.shared(), told.source_set.given
        yield Reported("Source tasks", {name: known[name] for name in known if name not in given}, 2)
        yield Reported("Fits", {name: known[name] for name in given}, 1)
        apart = ("method", "source_set")
        yield Reported("Target tasks", {name: own for name, own in told.spec().items() if name not in apart})
        yield Reported("Methods", method_reported(told.method))

    def labels(self, spec: Spec) -> dict[str, str]:
        return {"method": self.read(spec).method.name}

    def derived_fields(self, table: str) -> list[Field]:
        earned = Field("return", "<f8", "1", "discounted return of the episode")
        totals = [
            Field("average_return", "<f8", "1", "mean discounted return over all episodes"),
            Field("first_10", "<f8", "1", "the same over the first 10 episodes"),
            Field("last_tenth", "<f8", "1", "the same over the last tenth of the episodes"),
            Field("success", "<f8", "1", "share of episodes that reach the goal"),
            Field("restricted_steps", "<f8", "step", "mean of the episodes' steps, at most the horizon"),
        ]
        return {"episodes": [earned], "targets": [*totals, DIGEST_FIELD]}.get(table, [])

    def needed(self, table: str) -> tuple[str, ...]:
        return ("steps", "reached", "return") if table in ("episodes", "targets") else ()

    def derived(self, artefact: Artefact, table: str, block: Mapping[str, Array]) -> dict[str, Array]:
        import numpy as np

        from qinit_cli.analysis import returns

        if not self.needed(table):
            return {}
        settings = self.read(artefact.spec)
        learning = settings.learning
        earned = returns.earned(block, settings.family.payment(learning.gamma), learning.gamma)
        unknown = np.full(len(earned), np.nan)
        return {
            "return": earned,
            "average_return": returns.average(earned),
            "first_10": returns.jumpstart(earned),
            "last_tenth": returns.asymptotic(earned),
            "success": block["reached"].astype(bool).mean(axis=1) if "reached" in block else unknown,
            "restricted_steps": returns.restricted_steps(block["steps"], learning.horizon).mean(axis=1)
            if "steps" in block
            else unknown,
        }


RUN = RunKind()


def projection_errors(start: Floats, projected: Floats) -> dict[str, float]:
    """How far the values (P, A) of the weights that stand for a start are from the start itself, at the probes."""
    import numpy as np

    error = projected - start
    return {
        "projection_rms": float(np.sqrt(np.mean(error**2))),
        "projection_largest": float(np.abs(error).max()),
    }


def mean_curves(artefact: Artefact) -> dict[str, Floats]:
    """Means over the targets of a run, every task verified; memory is that of a block of tasks. Empty without targets.

    "return" of every episode, (E,), and where they are there "success" and "steps", at most the horizon, likewise, "eval_return",
    "eval_reached" and "eval_steps" of greedy evaluations, (V,), and the values "v_star" and "v_eps", ().
    """

    from qinit_cli.analysis import returns

    settings = RUN.read(artefact.spec)
    gamma, horizon = settings.learning.gamma, settings.learning.horizon
    paid = settings.family.payment(gamma)
    there = {column.name for column in artefact.schema.task_columns}
    known = [name for name in CURVES if name in there]
    more = [name for name in (*EVALUATED, "v_star", "v_eps") if name in there]
    sums: dict[str, Any] = {}
    for block in artefact.blocks((*known, *more), artefact.schema.block_size):
        numbers = {"return": returns.earned(block, paid, gamma), **{name: block[name] for name in more}}
        if "reached" in known:
            numbers["success"] = block["reached"].astype(bool)
        if "steps" in known:
            numbers["steps"] = returns.restricted_steps(block["steps"], horizon)
        sums = {name: sums.get(name, 0.0) + values.sum(axis=0) for name, values in numbers.items()}
    return {name: total / artefact.task_count for name, total in sums.items()}


def method_reported(method: StoredMethod) -> dict[str, Any]:
    """The method as tables call it, then its options."""
    told = method.spec()
    return {"method": method.label, **{name: told[name] for name in told if name not in ("name", "label")}}


def run_schema(
    state_axes: tuple[Axis, ...],
    action: Axis,
    parameters: tuple[Column, ...],
    episodes: int,
    *,
    start_per_task: bool,
    potential_per_task: bool,
    exact_values: bool,
    evaluations: int,
    keep_q: bool,
    updating: bool = False,
    hypotheses: int = 0,
    moments: Array | None = None,
    attainable: bool = True,
    bounds: ReturnBounds = UNIT,
    told_returns: bool = False,
    more_axes: tuple[Axis, ...] = (),
    more: tuple[Column, ...] = (),
    tiled: bool = False,
) -> Schema:
    """What target tasks leave behind; start and potential have a task axis where they depend on it.

    What is `attainable` while exploring is known of epsilon-greedy alone; of others v_eps is NaN. `told_returns`: the world tells
    its rewards, so that returns do not follow from steps. `more` are the columns of `tiled` values.
    `updating`: each task adds to what those after it start from. Where `hypotheses` tables were weighed, their weights after so
    many episodes as `moments` says stand there too.
    """
    import numpy as np

    from qinit_cli.artefacts.columns import ROUNDING, index, kept, within_bounds
    from qinit_store.schema import TASK, Axis, Column, Schema, digest_axis

    state = tuple(axis.name for axis in state_axes)
    state_action = (*state, action.name)
    steps, reached, told = curve_columns()
    columns = [
        steps,
        reached,
        Column(
            "start",
            _led(start_per_task, state_action),
            "f8",
            long_name="initial action values",
            low=0,
            high=1,
        ),
        Column("potential", _led(potential_per_task, state), "f8", long_name="shaping potential"),
        *parameters,
        *kept(),
    ]
    if told_returns:
        columns.append(told)
    if exact_values:
        columns += [
            Column("v_star", (TASK,), "f8", long_name="optimal value of the start", low=0, high=1 + ROUNDING),
            Column(
                "v_eps",
                (TASK,),
                "f8",
                long_name="value of the start under epsilon-greedy on the optimum",
                low=0,
                high=1 + ROUNDING,
                nan=not attainable,
            ),
        ]
    if evaluations:
        columns += [
            Column(
                "eval_return",
                (TASK, "evaluation"),
                "f8",
                long_name="discounted return of the greedy policy",
                low=None if told_returns else 0,
                high=None if told_returns else 1,
            ),
            Column(
                "eval_reached",
                (TASK, "evaluation"),
                "f8",
                long_name="share of evaluations that arrive",
                low=0,
                high=1,
            ),
            Column("eval_steps", (TASK, "evaluation"), "i4", "step", "steps of the greedy policy", low=1),
        ]
    if keep_q:
        columns.append(Column("q", (TASK, *state_action), "f8", long_name="final action values"))
    if updating:
        columns += [
            Column("visits", (TASK, *state_action), "i8", long_name="updates of the pair", low=0),
            Column("added", (TASK,), "i8", long_name="pairs whose value was added to what is known", low=0),
            Column(
                "log_std",
                (TASK,),
                "f8",
                long_name="median over pairs of the standard deviation of ln Q after the task",
                low=0,
                nan=True,
            ),
        ]
    indices = [index("episode", episodes), *([index("evaluation", evaluations)] if evaluations else [])]
    if hypotheses:
        columns += _weighing()
        after = Axis(
            "moment", np.empty(0, np.int64) if moments is None else moments, "1", "episodes that had ended"
        )
        indices += [after, index("hypothesis", hypotheses)]
    axes = (*state_axes, action, *more_axes, *indices, digest_axis())
    return Schema("run", axes, (*within_bounds(columns, bounds, tiled=tiled), *more))


def imported_run_schema(episodes: int, given: Container[str]) -> Schema:
    """What imported curves hold: of steps, goals and returns those that are `given`."""
    from qinit_cli.artefacts.columns import index
    from qinit_store.schema import Schema, digest_axis, digest_column

    columns = [column for column in curve_columns() if column.name in given]
    return Schema("run", (index("episode", episodes), digest_axis()), (*columns, digest_column()))


def curve_columns() -> tuple[Column, ...]:
    """Steps, goals and returns of each episode."""
    from qinit_store.schema import TASK, Column

    return (
        Column("steps", (TASK, "episode"), "i4", "step", "steps of the episode", low=1),
        Column("reached", (TASK, "episode"), "u1", long_name="the episode reached the goal", high=1),
        # an episode may leave bounds that are only told
        Column("return", (TASK, "episode"), "f8", long_name="discounted return of the episode"),
    )


def _weighing() -> tuple[Column, ...]:
    from qinit_cli.artefacts.columns import ROUNDING
    from qinit_store.schema import TASK, Column

    return (
        Column(
            "weight",
            (TASK, "moment", "hypothesis"),
            "f4",
            long_name="weight of a library table",
            low=0,
            high=1 + ROUNDING,
        ),
        Column("moves", (TASK,), "i4", long_name="times that the start table followed the weights", low=0),
        Column(
            "frozen", (TASK,), "i4", long_name="episodes after which the weights froze, -1: never", low=-1
        ),
    )


def _led(per_task: bool, dims: tuple[str, ...]) -> tuple[str, ...]:
    from qinit_store.schema import TASK

    return (TASK, *dims) if per_task else dims
