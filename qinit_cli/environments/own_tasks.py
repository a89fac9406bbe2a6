"""Tasks of one's own, from a file: which of them are sources and which are targets is typed, and nothing is drawn."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.bases import TableFamily
from qinit_cli.environments.family import Family, Role
from qinit_cli.environments.file_rows import CONTEXTS, CONTEXTS_FILE, OF_ROWS, SPLIT, read_rows
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.gym_making import takes
from qinit_cli.environments.gym_options import BINS, GOAL, NAMES, PANEL, RANGE, RETURNS, SET, STATE, WRAP
from qinit_cli.environments.modules import with_module
from qinit_cli.environments.taken_names import FILE_TASK, OF_STATES
from qinit_cli.environments.task_ranges import (
    FORMS,
    LONGEST_NAMED,
    held_out,
    in_name,
    kept,
    named,
    others,
    picked,
)
from qinit_cli.environments.variation import NAME
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.learning import Learning
from qinit_cli.options import check, flag, option
from qinit_cli.rewards import NativeReward, PaidRange, Payment, in_label
from qinit_store.wording import as_name, counted

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Flags, Floats, Tasks
    from qinit_cli.kernels.tables import Tables
    from qinit_cli.task_files.tables import OwnTask, OwnTaskSet
    from qinit_store.schema import Axis, Column

AXIS = re.compile(r"([a-z][a-z0-9_]{0,63})=([1-9]\d{0,7})")
SHA256 = re.compile("[0-9a-f]{64}")
ARCHIVE = ".npz"  # of tables
MOST_STATES = 1 << 24  # of a table of transitions
MOST_TASKS = 1_000_000  # of a file: what is stored of more would be a list too long to check


@dataclass(frozen=True)
class OwnTasks(TableFamily):
    """Tasks of one's own: tables of transitions, maps, or with --env rows of what an environment is made with."""

    file: str = option(
        "",
        "An .npz archive of P, or after and chance, or transitions and rewards; or a folder with an archive or a map (.txt) "
        "for each task; with --env rows, as a CSV, .jsonl or .json (docs/tasks.md).",
        metavar="FILE",
        positional=True,
    )
    use: str | None = option(
        None,
        f"Which tasks are sources: {FORMS} (all but the K-th of N folds), or a label of the file's split.",
        metavar="A:B",
        default_text="all",
    )
    axes_: str | None = option(
        None,
        "State axes in order; states are numbered along the last one first.",
        metavar="NAME=N[,NAME=N...]",
        default_text="state; row and col of maps",
    )
    actions_: str | None = option(
        None,
        "Names of the actions in order.",
        metavar="NAME[,NAME...]",
        default_text="their numbers; up, down, left and right of maps",
    )
    reward: NativeReward | None = option(
        None,
        "Reward: goal, 1 on reaching the goal; step, -1 a step until the goal is reached; native, the file's or the "
        "environment's own.",
        default_text="native where the file has rewards, else goal",
    )
    env: str | None = option(
        None,
        "The Gymnasium environment that each row of the file makes, as its arguments or numbers: an id, or MODULE:ID.",
        metavar="ENV_ID",
        default_text="none: the file holds tables or maps",
        panel=PANEL,
    )
    set: list[str] | None = SET
    bins: str | None = BINS
    range: list[str] | None = RANGE
    wrap: list[str] | None = WRAP
    state: str | None = STATE
    goal: str | None = GOAL
    returns: str | None = RETURNS
    # what the file tells, once it was opened
    sha256: str = ""
    count: int = 0
    paid: tuple[float, ...] = ()  # least and largest reward on the way, then of ends
    # what a transfer adds; the distribution is the same
    targets: str | None = field(default=None, compare=False)

    name: ClassVar[str] = "tasks"
    left_out: ClassVar[tuple[str, ...]] = ("env", *NAMES)  # what is stored of rows is the family gym
    source_tasks: ClassVar[int] = 0  # all that are named
    target_tasks: ClassVar[int] = 0
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.5, episodes=10_000, horizon=200, start="anywhere"
    )

    def __post_init__(self) -> None:
        check(self)
        object.__setattr__(self, "paid", tuple(self.paid))
        if not self.file:
            raise ValueError("a file of tasks is missing, such as mdps.npz")
        object.__setattr__(self, "file", PurePath(os.path.normpath(self.file)).as_posix())
        self._check_environment()
        if self.axes_ is not None and math.prod(axis_lengths(self.axes_).values()) > MOST_STATES:
            raise ValueError(
                f"--axes {self.axes_} are more states than the {MOST_STATES} that a table may have"
            )
        if self.actions_ is not None:
            names = [name.strip() for name in self.actions_.split(",")]
            if len(set(names)) < len(names) or not all(name and name.isascii() for name in names):
                raise ValueError(
                    f"--actions is {self.actions_!r}; write distinct names in ASCII, such as up,down"
                )
            object.__setattr__(self, "actions_", ",".join(names))
        if self.sha256:
            self._check_opened()

    def _check_environment(self) -> None:
        """ValueError where options of an environment stand without one, or those of tables beside one."""
        if self.env is None:
            if idle := [name for name in NAMES if getattr(self, name)]:
                raise ValueError(f"{flag(idle[0])} is of an environment; give --env ID too, or leave it out")
        elif idle := [name for name in ("axes_", "actions_") if getattr(self, name) is not None]:
            raise ValueError(f"{flag(idle[0])} is of tables, and {self.env} has its own; leave it out")

    def _check_opened(self) -> None:
        """ValueError where what was stored of an opened file cannot be."""
        if not (isinstance(self.sha256, str) and SHA256.fullmatch(self.sha256)):
            raise ValueError(f"sha256 is {self.sha256!r}, no SHA-256")
        if type(self.count) is not int or not 1 <= self.count <= MOST_TASKS:
            raise ValueError(f"count is {self.count!r}; a file holds 1 to {MOST_TASKS} tasks")
        if None in (self.use, self.axes_, self.actions_, self.reward):
            raise ValueError("use, axes, actions and reward are set once a file was opened")
        if len(self.paid) != 4 or not all(isinstance(one, float) and math.isfinite(one) for one in self.paid):
            raise ValueError(f"paid is {list(self.paid)!r}; these are four numbers")
        if self.paid[0] > self.paid[1] or self.paid[2] > self.paid[3]:
            raise ValueError(f"paid is {list(self.paid)!r}; the least reward stands before the largest")
        for name in ("use", "targets"):
            if (text := getattr(self, name)) is not None:
                if not isinstance(text, str):
                    raise ValueError(f"{name} is {text!r}, no text")
                named(f"--{name}", text, self.count)

    def opened(self) -> Family:  # type: ignore[override]  # rows are of another family
        """The family with what its file tells; with `env` the family gym, varied by the rows of the file.

        UsageError or NotAllowed where the file is missing, cannot be read or was changed.
        """
        from qinit_cli.task_files.reading import digest_of, tasks_in

        if self.env is not None:
            return self._varied(with_module(self.env)).opened()
        if self.sha256:
            return self
        if PurePath(self.file).suffix in OF_ROWS:
            raise UsageError(
                f"{self.file} holds rows; give --env ID, the environment that each of them makes"
            )
        digest = digest_of(Path(self.file))
        there = tasks_in(Path(self.file), digest)
        count, paid = len(there.tasks), there.paid
        axes, actions = self.axes_ or there.axes, self.actions_ or ",".join(there.actions)
        given, states = (math.prod(axis_lengths(one).values()) for one in (axes, there.axes))
        if given != states:
            raise UsageError(f"--axes {axes} are {given} states, and the tasks of {self.file} have {states}")
        if len(actions.split(",")) != len(there.actions):
            raise UsageError(
                f"--actions {actions} are {len(actions.split(','))}, and the tasks of {self.file} have {len(there.actions)}"
            )
        try:
            use = picked(":" if self.use is None else self.use, count, there.splits)
        except ValueError as error:
            raise UsageError(f"--use {error}") from error
        return replace(
            self,
            use=kept(self.use or "", use),
            axes_=axes,
            actions_=actions,
            reward=_reward(self.reward, there, self.file),
            sha256=digest,
            count=count,
            paid=(*paid.going_on, *paid.ending),
        )

    def _varied(self, env_id: str) -> Gym:
        """The environment varied by all columns of the file; contexts as a whole where it takes those. UsageError."""
        if PurePath(self.file).suffix == ARCHIVE or os.path.isdir(self.file):
            raise UsageError(
                f"--env {env_id} takes rows, and {self.file} has tables or maps; name a CSV, .jsonl or .json, or leave --env out"
            )
        names = [name for name in read_rows(self.file).columns if name != SPLIT]
        if not names:
            raise UsageError(f"{self.file} has the column {SPLIT} alone; give one of what varies")
        if PurePath(self.file).suffix == CONTEXTS_FILE:
            whole = takes(env_id, CONTEXTS)
            names = [name for name in names if (name == CONTEXTS) == whole]
        if odd := [name for name in names if not NAME.fullmatch(name)]:
            raise UsageError(
                f"{self.file} has a column {odd[0]!r}, which is no argument's name; take it out, or vary the others alone by "
                f"qinit train-sources gym {env_id} --vary NAME=file:{self.file}"
            )
        try:
            return Gym(
                env_id,
                vary=[f"{name}=file:{self.file}" for name in names],
                use=":" if self.use is None else self.use,
                reward=self.reward or "goal",
                **{name: getattr(self, name) for name in NAMES},
            )
        except ValueError as error:
            raise UsageError(str(error)) from error

    def holding_out(self, targets: str | None, *, allow_overlap: bool) -> Self:
        """The family with these tasks as targets, without any named those that are no sources.

        UsageError where they cannot be, or where a target is a source too, by its number or its table, unless that is allowed.
        """
        there, rewards = self._there(), self.reward == "native"
        content = None if allow_overlap else lambda task: there.tasks[task].digest(rewards=rewards)
        held = held_out(targets, self._use, self.count, there.splits, self.file, content)
        return replace(self, targets=held)

    @property
    def label(self) -> str:
        """The file's name and the sources' numbers."""
        use = in_name(self.use, f"{len(self._use)}-of-{self.count}") if self.use else "all"
        told = as_name(f"{PurePath(self.file).stem[:LONGEST_NAMED]}-{use}")
        return f"{self.name}-{told.strip('-.')}{in_label(self.reward or 'goal')}"

    @property
    def actions(self) -> tuple[str, ...]:  # type: ignore[override]  # of the file
        """The actions' names."""
        self._check_known()
        return tuple((self.actions_ or "").split(","))

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: places counted from 0."""
        import numpy as np

        from qinit_store.schema import Axis

        self._check_known()
        sizes = axis_lengths(self.axes_ or "")
        return tuple(Axis(name, np.arange(size, dtype=np.int32), "1", name) for name, size in sizes.items())

    def parameters(self) -> tuple[Column, ...]:
        """The task's number in the file."""
        from qinit_store.schema import Column

        self._check_known()
        told = "number of the task in its file"
        return (Column(FILE_TASK, ("task",), "<i4", "1", told, low=0, high=self.count - 1),)

    def available(self, role: Role) -> int:
        """How many tasks are sources, or targets."""
        return len(self._use if role == "source" else self._held)

    def draw(self, rng: np.random.Generator) -> tuple[int]:
        """NotAllowed: nothing is drawn, see `task`."""
        raise NotAllowed(f"the tasks of {self.file} are not drawn; each has its number")

    def task(self, index: int, role: Role, rng: np.random.Generator) -> tuple[int]:
        """The number in the file of the index-th source or target; NotAllowed where there are fewer."""
        several = self._use if role == "source" else self._held
        if index >= len(several):
            raise NotAllowed(
                f"{self.label} has {counted(len(several), role)}, and task {index + 1} was asked for; ask for fewer --tasks"
            )
        return (several[index],)

    def tables(self, tasks: Tasks) -> Tables:
        """Where the steps of each task lead; their rewards with `native` alone."""
        import numpy as np

        from qinit_cli.kernels.tables import Tables
        from qinit_cli.kernels.worlds import LOST

        each = self._of(tasks)
        most = max((one.after.shape[2] for one in each), default=1)
        shape = (len(each), math.prod(self.shape), len(self.actions), most)
        after, probability = np.full(shape, LOST, np.int32), np.zeros(shape)
        reward = np.zeros(shape) if self.reward == "native" else None
        for place, one in enumerate(each):
            outcomes = one.after.shape[2]
            after[place, :, :, :outcomes], probability[place, :, :, :outcomes] = one.after, one.probability
            if reward is not None and one.reward is not None:
                reward[place, :, :, :outcomes] = one.reward
        start = np.array([one.start for one in each]).reshape(shape[:2])
        open = np.array([one.open for one in each], bool).reshape(shape[:2])
        return Tables(after, probability, start, open, reward)

    def payment(self, gamma: float) -> Payment | None:
        """What steps pay; the bounds of `native` are those of all tasks of the file."""
        if self.reward != "native":
            return super().payment(gamma)
        low, high, end_low, end_high = self.paid
        return Payment(PaidRange((low, high), (end_low, end_high)).bounds(gamma), None, 0.0)

    def starts(self) -> Floats:
        """Where the tasks of the file start, their mean, (S,)."""
        import numpy as np

        mean: Floats = np.mean([one.start for one in self._there().tasks], axis=0)
        return mean

    def start_values(self, tasks: Tasks, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at each task's own start, (B,); its mean where that is drawn."""
        import numpy as np

        start = np.array([one.start for one in self._of(tasks)]).reshape(q.shape[:2])
        values: Floats = (q.max(axis=2) * start).sum(axis=1)
        return values

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether greedy episodes from its start reach the goal at least every other time, (B,); True where a task has none."""
        return super().solved(tasks, q, horizon) | self._without_goal(tasks)

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a way leads from its start to the goal within the horizon, (B,); True where a task has none.

        What was solved can be: then the file is not read.
        """
        import numpy as np

        if solved.all():
            return np.ones(len(tasks), np.bool_)
        return super().solvable(tasks, solved, horizon) | self._without_goal(tasks)

    def shifted(self, changes: dict[str, Any]) -> Self:
        """ValueError: tasks of a file are as they are."""
        raise ValueError(
            f"the tasks of {self.file} are not drawn, so that nothing can be shifted; choose others by --targets"
        )

    @property
    def present(self) -> bool:
        """Whether the file is there, unchanged."""
        try:
            self._there()
        except (NotAllowed, UsageError):
            return False
        return True

    @property
    def _use(self) -> tuple[int, ...]:
        return named("--use", self.use or "", self.count)

    @property
    def _held(self) -> tuple[int, ...]:
        if self.targets is None:
            return others(self._use, self.count)
        return named("--targets", self.targets, self.count)

    def _of(self, tasks: Tasks) -> list[OwnTask]:
        there = self._there().tasks
        return [there[int(row)] for row in tasks[FILE_TASK]]

    def _without_goal(self, tasks: Tasks) -> Flags:
        import numpy as np

        return np.array([not one.has_goal for one in self._of(tasks)], np.bool_)

    def _there(self) -> OwnTaskSet:
        from qinit_cli.task_files.reading import tasks_in

        self._check_known()
        return tasks_in(Path(self.file), self.sha256)

    def _check_known(self) -> None:
        if not self.sha256:
            raise NotAllowed(f"what {self.file} holds is not known before it is opened; call opened()")


def axis_lengths(text: str) -> dict[str, int]:
    """The lengths of the state axes by name; ValueError where a text is no NAME=N,..."""
    found = [AXIS.fullmatch(part.strip()) for part in text.split(",")]
    sizes = {one[1]: int(one[2]) for one in found if one}
    if len(sizes) < len(found):
        raise ValueError(
            f"--axes is {text!r}; write NAME=N,NAME=N, names distinct and of lower-case letters, N from 1"
        )
    if taken := [name for name in sizes if name in OF_STATES]:
        raise ValueError(
            f"--axes has the name {taken[0]}, which artefacts use for something else; give that axis another name"
        )
    return sizes


def _reward(asked: NativeReward | None, there: OwnTaskSet, file: str) -> NativeReward:
    """What steps pay; UsageError where the file does not tell it."""
    told = any(task.reward is not None for task in there.tasks)
    reward: NativeReward = asked or ("native" if told else "goal")
    if reward == "native" and not told:
        raise UsageError(
            f"{file} has no rewards, which --reward native asks for; add R to it, or leave the option out"
        )
    if reward != "native" and not any(task.has_goal for task in there.tasks):
        raise UsageError(
            f"no task of {file} has a goal, which --reward {reward} pays for; mark it by `goal`, or add R"
        )
    return reward
