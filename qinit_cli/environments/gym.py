"""Any Gymnasium environment whose observations are numbered, or can be put into bins, and whose actions are numbered.

A task is worth 1 on reaching the goal, as in every family, unless `reward` asks for costs or for the environment's own rewards;
`goal` says which end the goal is. Where the environment has a table of its transitions (FrozenLake, Taxi, CliffWalking), it is
read, learned in the compiled loop and solved exactly; else it is simulated by gymnasium itself, step by step, in Python.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.bases import EXACT_TOLERANCE, JUDGED, LIKELY, TableFamily
from qinit_cli.environments.chosen_rows import sources_of, targets_of
from qinit_cli.environments.foreign import aside
from qinit_cli.environments.gym_episodes import Episodes, OneAtATime, played, shortest_cut
from qinit_cli.environments.gym_examples import PLAYED, doubt, ends, examples, idle, paid_range, with_values
from qinit_cli.environments.gym_making import made
from qinit_cli.environments.gym_options import BINS, GOAL, RANGE, RETURNS, SET, STATE, WRAP
from qinit_cli.environments.gym_recipe import KeywordArguments, Recipe
from qinit_cli.environments.gym_spaces import Seen, seen
from qinit_cli.environments.gym_tables import SURVIVED, TERMINATED, TransitionTable, named, table, verdict
from qinit_cli.environments.modules import import_factory, packages_of, with_module
from qinit_cli.environments.taken_names import FILE_TASK
from qinit_cli.environments.task_ranges import FORMS, in_name
from qinit_cli.environments.variation import Variation, setting, stored
from qinit_cli.environments.varied_values import FileRows
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learning import Learning
from qinit_cli.options import check, option
from qinit_cli.rewards import NativeReward, Payment, ReturnBounds, check_discount, in_label
from qinit_store.wording import as_name, counted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Tasks
    from qinit_cli.environments.family import Role
    from qinit_cli.kernels.batch import Worlds
    from qinit_cli.kernels.tables import Tables
    from qinit_store.schema import Axis, Column

ATTRIBUTES = re.compile(r"[A-Za-z]\w*(,[A-Za-z]\w*)*")


@dataclass(frozen=True)
class Gym(TableFamily):
    """A Gymnasium environment, some of whose constructor arguments or attributes change from task to task."""

    env_id: str = option(
        "",
        "The environment's id, such as FrozenLake-v1; MODULE:ID for one that another module registers.",
        metavar="ENV_ID",
        positional=True,
    )
    vary: list[str] | None = option(
        None,
        "What changes from task to task, a constructor argument or a number of the environment or its class: "
        "normal:MEAN,STD, uniform:LOW,HIGH, integer:LOW,HIGH, loguniform:LOW,HIGH, truncnorm:MEAN,STD,LOW,HIGH, choice:A|B|..., "
        "file:PATH (a column of a CSV or .jsonl), or map:SIZE,FROZEN for a FrozenLake's desc; may be given several times.",
        metavar="NAME=KIND:WHAT",
        default_text="nothing: all tasks are one",
    )
    use: str | None = option(
        None,
        f"Which rows of the files that tasks are varied by are sources: {FORMS}, or a label of the column split.",
        metavar="A:B",
        default_text="those that split names, else every other one",
    )
    set: list[str] | None = SET
    bins: str | None = BINS
    range: list[str] | None = RANGE
    wrap: list[str] | None = WRAP
    state: str | None = STATE
    goal: str | None = GOAL

    reward: NativeReward = option(
        "goal",
        "Reward: goal, 1 on reaching the goal; step, -1 a step until the goal is reached; native, the environment's own.",
    )
    returns: str | None = RETURNS

    # what a transfer adds; the distribution is the same
    targets: str | None = field(default=None, compare=False)

    name: ClassVar[str] = "gym"
    left_out: ClassVar[tuple[str, ...]] = ("use", "targets")
    algorithm: ClassVar[int] = 2  # 1 left wrappers out, and learned that an episode cut off is an end worth 0
    learned_anew: ClassVar[str] = (
        "its wrappers were left out, and an episode that was cut off counted as an end worth 0; the same commands, from "
        "train-sources on, learn them anew"
    )
    source_tasks: ClassVar[int] = 50
    target_tasks: ClassVar[int] = 50
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.99, epsilon=0.5, episodes=10_000, horizon=200, start="fixed"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.99, epsilon=0.1, episodes=1_000, horizon=200, start="fixed"
    )

    def __post_init__(self) -> None:
        check(self)
        for name in (
            "vary",
            "set",
            "range",
        ):  # a list cannot be kept in a cache, a shift brings a single text
            given = getattr(self, name)
            object.__setattr__(self, name, (given,) if isinstance(given, str) else tuple(given or ()))
        if self.wrap is not None:
            object.__setattr__(
                self, "wrap", (self.wrap,) if isinstance(self.wrap, str) else tuple(self.wrap) or None
            )
        if self.state is not None and not ATTRIBUTES.fullmatch(self.state):
            raise ValueError(
                f"--state is {self.state}; write names of attributes, such as agent_pos,agent_dir"
            )
        if not self.env_id:
            raise ValueError("an environment's id is missing, such as FrozenLake-v1")
        if self.returns is not None:
            if self.reward != "native":
                raise ValueError(
                    f"--returns is given with --reward {self.reward}, whose returns are known; "
                    "leave it out or give --reward native"
                )
            ReturnBounds.read(self.returns)
        if not isinstance(self.targets, str | None):
            raise ValueError(f"targets is {self.targets!r}, no text")
        names = [variation.name for variation in self._variations] + [name for name, _ in self._settings]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"{twice[0]} is varied or set twice")
        columns = [each.column for each in self._variations]
        if alike := [each.name for each in self._variations if columns.count(each.column) > 1]:
            raise ValueError(f"{' and '.join(alike)} would be one column in an artefact; vary one of them")

    def opened(self) -> Self:
        """The family once the modules that it names are imported, as its id was typed; UsageError if an import fails."""
        for wrap in self._texts("wrap"):
            import_factory(wrap)
        family = replace(self, env_id=with_module(self.env_id))._digested()
        if self.use is not None:
            return replace(family, use=sources_of(self.use, family._files))
        family.available("source")  # refuses rows that are neither sources' nor targets'
        return family

    def _digested(self) -> Self:
        """The family as it is stored, with the digests of the files that its tasks are drawn from."""
        return replace(self, vary=[stored(text) for text in self._texts("vary")])

    @property
    def packages(self) -> tuple[str, ...]:
        """Whose versions decide what happens: gymnasium's, and those of the modules that register and wrap the environment."""
        return ("gymnasium", *packages_of(self.env_id, self._texts("wrap")))

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        parts = [self.env_id, *(str(value) for _, value in self._settings)]
        parts += [f"use-{in_name(self.use, 'rows')}"] if self.use else []
        parts += [each.label for each in self._variations]
        parts += [f"wrap-{each.rpartition(':')[2]}" for each in self._texts("wrap")]
        parts += [f"state-{self.state}"] if self.state else []
        parts += [f"bins-{self.bins}"] if self.bins else []
        parts += [f"goal-{self.goal}"] if self.goal else []
        parts += [f"returns-{self.returns}"] if self.returns else []
        told = "-".join([self.name, *parts]) + in_label(self.reward)
        return as_name(told).rstrip("-")

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; empty if nothing."""
        told = (
            [f"{self._doubt}; so it is stepped, as an environment without a table is"] if self._doubt else []
        )
        if not self._variations:
            told.append("without --vary all tasks are the same: there is no distribution to transfer from")
        idle_ones = idle(
            self._recipe,
            self._variations,
            (self.goal or "") if self.tabular else None,
            self._native,
        )
        if idle_ones:
            seen = "their tables are equal" if self.tabular else f"{PLAYED} steps are the same whatever it is"
            told.append(
                f"{' and '.join(idle_ones)} of {self.env_id} changes nothing from task to task: {seen}"
            )
        return "; ".join(told)

    @property
    def in_python(self) -> bool:
        """Whether gymnasium steps it: it is no table."""
        return not self.tabular

    @property
    def beyond_bounds(self) -> Counter[int]:
        """How often this process has observed values beyond the environment's own bounds, by dimension."""
        return self._seen.beyond

    @property
    def beyond(self) -> list[str]:
        """A warning where the environment observed what lies beyond the bounds that it names; none if it did not."""
        return [
            f"{self.env_id} observed values beyond its own bounds in dimension {dimension} ({counted(count, 'time')}); "
            f"they count as at the bound: give --range {dimension}=LOW:HIGH"
            for dimension, count in sorted(self.beyond_bounds.items())
        ]

    @property
    def tabular(self) -> bool:  # type: ignore[override]  # a matter of the environment here
        """Whether the environment has a table of its transitions that its steps agree with, and ends by itself."""
        return self._has_table and not self._doubt

    @property
    def untabled(self) -> str:
        """Why there are no exact tables; empty if there are."""
        if self.tabular:
            return ""
        if self._seen.table and self.goal == SURVIVED:
            return "what --goal survived is worth depends on the time, which no table knows"
        return self._doubt or f"{self.env_id} has no table of its transitions"

    def ends(self) -> dict[str, Any]:
        """Which ends are the goal: in words, and where there are tables their rewards and states."""
        if not self.tabular:
            rule = {TERMINATED: "every end", SURVIVED: "the horizon; every end is lost"}
            return {"goal": rule.get(self.goal or "", f"ends with {self.goal}; others are lost")}
        goals, others = ends(self._recipe, self._variations, self.goal or "")
        rewards, states = sorted({reward for reward, _ in goals}), sorted({state for _, state in goals})
        lost = (
            f"; those with {named('reward', sorted({reward for reward, _ in others}))} are lost"
            if others
            else ""
        )
        said = (
            f"{'' if others else 'all '}ends with {named('reward', rewards)} ({named('state', states)}){lost}"
        )
        return {"goal": said, "goal_rewards": rewards, "goal_states": states}

    @property
    def actions(self) -> tuple[str, ...]:  # type: ignore[override]  # a matter of the environment here
        """Their numbers, as the environment itself has them."""
        return self._seen.actions

    def axes(self) -> tuple[Axis, ...]:
        """The numbered state, its row and column where the environment is a grid, or the dimensions by their bins' centres."""
        import numpy as np

        from qinit_store.schema import Axis

        seen = self._seen
        if seen.dimensions:
            return tuple(
                Axis(f"x{place}", each.values(), "1", f"observation {each.name}")
                for place, each in enumerate(seen.dimensions)
            )
        names = ("row", "col") if len(seen.shape) == 2 else ("state",)
        return tuple(
            Axis(name, np.arange(length, dtype=np.int32), "1", name)
            for name, length in zip(names, seen.shape, strict=True)
        )

    def covers(self) -> tuple[tuple[float, float], ...]:
        """What the bins of each dimension cover, from low to high; of whole numbers from half below to half above."""
        if not self._seen.dimensions:
            return super().covers()
        return tuple(each.covered for each in self._seen.dimensions)

    def box(self) -> tuple[tuple[str, float, float], ...]:
        """Name, low and high of each number of a continuous state; beyond them it counts as at the edge.

        UsageError where states are numbered, or hold whole numbers, and where they are to be put into bins.
        """
        dimensions = self._seen.dimensions
        if not dimensions:
            raise UsageError(
                f"{self.env_id} numbers its states, and --representation tiles is of a Box; leave it out"
            )
        whole = [f"{place} ({each.name})" for place, each in enumerate(dimensions) if each.whole]
        if whole:
            raise UsageError(
                f"dimension {whole[0]} of {self.env_id} is a whole number, and --representation tiles is of a Box alone; name "
                "other attributes by --state, or leave it out"
            )
        if self.bins is not None:
            raise UsageError(
                "--bins is of a table, and --representation tiles has --tiles in its place; leave out one of them"
            )
        return tuple((f"x{place}", each.low, each.high) for place, each in enumerate(dimensions))

    def target_state(self) -> tuple[float, ...]:
        """The mean of the continuous states in which episodes of the environment as it is start."""
        return self._seen.start

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: what is varied."""
        from qinit_store.schema import Column

        row = Column(FILE_TASK, ("task",), "<i4", "1", "number of the task in its file", low=0)
        drawn = [
            Column(
                each.column,
                ("task",),
                each.values.dtype,
                "1",
                each.description,
                low=each.values.bounds[0],
                high=each.values.bounds[1],
            )
            for each in self._variations
        ]
        return (row, *drawn) if self._chosen else tuple(drawn)

    def draw(self, rng: np.random.Generator) -> tuple[float | int, ...]:
        """The first source task: a value for all that is varied."""
        return self.task(0, "source", rng)

    def available(self, role: Role) -> int | None:
        """The rows of the files that tasks are varied by, the fewest; None where there are none."""
        listed = [count for each in self._variations if (count := each.available(role)) is not None]
        return min(listed, default=None)

    def task(self, index: int, role: Role, rng: np.random.Generator) -> tuple[float | int, ...]:
        """The task at that index of sources or targets: a value for all that is varied, behind its row where rows are named."""
        drawn = tuple(each.draw(rng, index, role) for each in self._variations)
        return (self._files[0].of(role)[index], *drawn) if self._chosen else drawn

    @property
    def present(self) -> bool:
        """Whether the files that tasks are varied by are there, unchanged."""
        try:
            return all(each.rows.count for each in self._files)
        except (NotAllowed, UsageError):
            return False

    def holding_out(self, targets: str | None, *, allow_overlap: bool) -> Self:
        """The family with these rows as targets, without any named those that are no sources where sources are named.

        UsageError where they cannot be, or where a target is a source too, by its row or its values, unless that is allowed.
        """
        files = self._files
        if not files or (targets is None and self.use is None):
            return super().holding_out(targets, allow_overlap=allow_overlap)
        return replace(self, targets=targets_of(targets, files, allow_overlap=allow_overlap))

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError where tables of this family would not fit."""
        if "use" in changes:
            raise ValueError("use names the sources; choose other targets by --targets")
        anew = {"use": None} if "vary" in changes else {}  # rows of another file, or of none
        return super().shifted(changes | anew)._digested()

    def tables(self, tasks: Tasks) -> Tables:
        """Where the steps of each task lead; their rewards with `native` alone."""
        import numpy as np

        from qinit_cli.kernels.tables import Tables
        from qinit_cli.kernels.worlds import LOST

        if not self.tabular:
            raise NotAllowed(f"{self.untabled}; learn it by q-learning")
        each = [self._table(task) for task in tasks]
        most = max((one.after.shape[2] for one in each), default=1)
        shape = (len(each), self._seen.states, len(self._seen.actions), most)
        after, probability = np.full(shape, LOST, np.int32), np.zeros(shape)
        for place, one in enumerate(each):
            after[place, :, :, : one.after.shape[2]] = one.after
            probability[place, :, :, : one.after.shape[2]] = one.probability
        reward = np.zeros(shape) if self._native else None
        for place, one in enumerate(each):
            if reward is not None and one.reward is not None:
                reward[place, :, :, : one.reward.shape[2]] = one.reward
        states = (len(each), shape[1])
        start = np.array([one.start for one in each]).reshape(states)
        open = np.array([one.open for one in each], bool).reshape(states)
        return Tables(after, probability, start, open, reward)

    def payment(self, gamma: float) -> Payment | None:
        """What steps pay; of `native` the bounds are those of --returns or of the table. ValueError where there are none."""
        if not self._native:
            return super().payment(gamma)
        check_discount(gamma)
        if self.returns is not None:
            return Payment(ReturnBounds.read(self.returns), None, 0.0)
        if not self.tabular:
            raise ValueError(
                f"--reward native of {self.env_id} has no table to take the bounds of returns from; "
                "give --returns LOW:HIGH"
            )
        paid = paid_range(self._recipe, self._variations, self.goal or "")
        return Payment(paid.bounds(gamma), None, 0.0)

    def starts(self) -> Floats:
        """How often an episode of the environment as it is starts in each state, (S,)."""
        import numpy as np

        seen = self._seen
        if self.tabular:
            return table(self._example, self.goal or "").start
        return np.bincount(seen.resets, minlength=seen.states) / len(seen.resets)

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The three states in which most episodes start; of a table the start, and the states of median and of largest value."""
        import numpy as np

        starts = self.starts()
        shown = [state for state in np.argsort(-starts, kind="stable")[:3] if starts[state] > 0]
        if self.tabular:
            one, value = self._values()
            ranked = [state for state in np.argsort(value, kind="stable") if one.open[state]]
            shown = [shown[0], ranked[len(ranked) // 2], ranked[-1]]
        axes = self.axes()
        places = np.unravel_index(np.array(list(dict.fromkeys(shown)), np.int64), self.shape)
        return tuple(
            tuple(float(axis.values[place]) for axis, place in zip(axes, at, strict=True))
            for at in zip(*places, strict=True)
        )

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> Worlds:
        """The tasks as the compiled loop takes them: their tables, or environments that it calls back."""
        from qinit_cli.kernels.python_steps import PythonWorlds
        from qinit_cli.kernels.random_streams import seeds

        if self.tabular:
            return super().worlds(tasks, own)
        episodes = OneAtATime(lambda place, horizon, *state: self._episodes(tasks[place], horizon, *state))
        return PythonWorlds(
            episodes,
            self._seen.states,
            len(self._seen.actions),
            seeds(own),
            around=episodes,
            pays=self._native,
            dimensions=len(self._seen.dimensions),
        )

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Expected optimal path lengths, (B, S, A), -1 where a path never arrives.

        Without a table the state cannot be chosen: what is known are the greedy episodes by which a task is judged. There a pair
        of a state and its greedy action has the steps that were left when it was first met; all else is -1.
        """
        import numpy as np

        if self.tabular:
            return super().path_lengths(tasks, q, horizon)
        lengths = np.full(q.shape, -1, np.int32)
        for place, task in enumerate(tasks):
            for trail, reached in self._probe(task, q[place], horizon):
                for left, (state, action) in zip(range(len(trail), 0, -1), trail, strict=True):
                    if reached and lengths[place, state, action] < 0:
                        lengths[place, state, action] = left
        return lengths

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether greedy episodes from the target start reach the goal at least every other time, (B,)."""
        import numpy as np

        if self.tabular:
            return super().solved(tasks, q, horizon)
        share = [
            np.mean([reached for _, reached in self._probe(task, values, horizon)])
            for task, values in zip(tasks, q, strict=True)
        ]
        return np.array(share, np.float64) >= LIKELY

    def greedy_episodes(
        self, task: Any, act: Callable[[Floats], int], horizon: int, episodes: int
    ) -> list[tuple[Floats, bool]]:
        """Episodes with seeds from 0 on whose actions are those of the continuous states f8 (D,).

        Of each the states in which it went on, (steps, D), and whether it reached the goal.
        """
        import numpy as np

        state = np.empty(len(self._seen.dimensions))
        with aside(), closing(self._episodes(task, horizon, state)) as world:
            met = played(world, lambda _: (state.copy(), act(state)), horizon, episodes)
        return [(np.array([at for at, _ in trail]), reached) for trail, reached in met]

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """The states on the likeliest way, (B, S), or of the first greedy episode; zeros where that does not arrive."""
        import numpy as np

        if self.tabular:
            return super().visits(tasks, q, horizon)
        visits = np.zeros(q.shape[:2], np.int32)
        for place, task in enumerate(tasks):
            [(trail, reached)] = self._probe(task, q[place], horizon, 1)
            if reached:
                np.add.at(visits[place], [state for state, _ in trail], 1)
        return visits

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task can be solved at all, (B,); without a table that is unknown, and all are taken to be."""
        import numpy as np

        if solved.all() or not self.tabular:  # what was solved needs no environment to be looked at
            return np.ones(len(tasks), np.bool_)
        return super().solvable(tasks, solved, horizon)

    def refusal(self, learning: Learning) -> str:
        """Why its tasks cannot be learned so; empty if they can."""
        if self.tabular:
            table(self._example, self.goal or "")  # says so itself if no end is the goal
            return ""
        if not self.goal:
            lacking = self._doubt or f"{self.env_id} has no table that tells how its episodes end"
            return (
                f"{lacking}; say which end is the goal: "
                "--goal terminated, --goal survived, or a rule such as --goal 'reward>0'"
            )
        verdict(self.goal)
        limit = self._seen.limit
        if self.goal == SURVIVED and 0 < limit < learning.horizon:
            return (
                f"{self.env_id} cuts episodes off after {limit} steps, and --goal survived makes the horizon of "
                f"{learning.horizon} the goal, which is then never reached; give --horizon {limit} or less"
            )
        if learning.start == "anywhere":
            return f"{self.env_id} is simulated, so episodes start where its reset puts them; leave out --start anywhere"
        return ""

    @property
    def _variations(self) -> tuple[Variation, ...]:
        return tuple(Variation.read(text).among(self.use, self.targets) for text in self._texts("vary"))

    @property
    def _files(self) -> list[FileRows]:
        """The columns of files by which tasks are varied."""
        return [each.values for each in self._variations if isinstance(each.values, FileRows)]

    @property
    def _chosen(self) -> bool:
        """Whether sources or targets are rows that are named."""
        return self.use is not None or self.targets is not None

    @property
    def _settings(self) -> KeywordArguments:
        return KeywordArguments(map(setting, self._texts("set")))

    @property
    def _recipe(self) -> Recipe:
        """What all its environments are made with."""
        state = tuple(self.state.split(",")) if self.state else ()
        return Recipe(self.env_id, self._settings, self._texts("wrap"), state)

    def _texts(self, name: str) -> tuple[str, ...]:
        return tuple(getattr(self, name) or ())

    @property
    def _example(self) -> Recipe:
        """What an environment is made with that stands for all: what is varied is drawn with a fixed seed."""
        return examples(self._recipe, self._variations)[0]

    @property
    def _has_table(self) -> bool:
        return self.goal != SURVIVED and self._seen.table

    @property
    def _doubt(self) -> str:
        """Why the environment's table is not believed; empty if it is, or if there is none."""
        if not self._has_table:
            return ""
        return doubt(self._recipe, self._variations, self.goal or "")

    def _of(self, task: Any) -> Recipe:
        """What the task's environment is made with."""
        return with_values(self._recipe, [(each, task[each.column].item()) for each in self._variations])

    def _table(self, task: Any) -> TransitionTable:
        recipe = self._of(task)
        one = table(recipe, self.goal or "", self._native)
        shortest_cut(recipe)  # refuses what no seed brings back
        if one.after.shape[:2] != (self._seen.states, len(self._seen.actions)):
            raise NotAllowed(
                f"a task of {self.env_id} has {len(one.after)} states, another one {self._seen.states}: tasks must "
                "have as many as each other"
            )
        return one

    def _episodes(self, task: Any, horizon: int, state: Floats | None = None) -> Episodes:
        """The task's episodes over the table's states; with a continuous `state` f8 (D,) they write that."""
        recipe = self._of(task)
        shortest_cut(recipe)  # refuses what no seed brings back
        env = made(recipe)
        seen = self._seen.state if state is None else partial(self._seen.write, state)
        return Episodes(self.env_id, env, seen, self.goal or "", horizon, self._native)

    def _probe(
        self, task: Any, q: Floats, horizon: int, episodes: int = JUDGED
    ) -> list[tuple[list[tuple[int, int]], bool]]:
        """Greedy episodes: the pairs met, and whether each reached the goal."""
        greedy = q.argmax(axis=1).tolist()
        with aside(), closing(self._episodes(task, horizon)) as world:
            return played(world, lambda state: (state, greedy[state]), horizon, episodes)

    def _values(self) -> tuple[TransitionTable, Floats]:
        """An example's table, and its exact values, (S,)."""
        import numpy as np

        from qinit_cli.kernels import tables_exact

        one = table(self._example, self.goal or "")
        q = np.empty((1, *one.after.shape[:2]))
        settings = None, self.source_learning.gamma, EXACT_TOLERANCE  # by the goal, whatever is paid
        tables_exact.solve(
            one.after[None], one.probability[None], one.open[None], *settings, q, np.empty_like(q)
        )
        return one, q[0].max(axis=1)

    @property
    def _native(self) -> bool:
        return self.reward == "native"

    @property
    def _seen(self) -> Seen:
        return seen(self._example, self.bins or "", self._texts("range"))
