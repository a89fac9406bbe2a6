"""What is asked of an import, free of numpy so that help stays fast."""

from __future__ import annotations

from dataclasses import dataclass, fields

from qinit_cli.options import check, flag, option
from qinit_cli.rewards import ReturnBounds

LEAST_VISITS = 1  # below which a pair is unknown, where visits are known


OF_TABLES = ("axes", "actions", "key", "visits", "td_var", "min_visits")  # options that curves have none of


@dataclass(frozen=True)
class ImportedFiles:
    """How the files of other programs are read: arrays or rows of action values, or rows of learning curves."""

    gamma: float | None = option(
        None,
        "The discount that the tables were learned with, or that returns were counted with.",
        above=0,
        high=1,
        default_text="must be given; 1 for --runs with returns",
    )
    axes: str | None = option(
        None,
        "State axes in order, NAME=LENGTH each; a file without a task axis is then one task.",
        metavar="NAME=N[,NAME=N...]",
        default_text="arrays: state, row and col, or x0, x1, ...; rows: their columns",
    )
    actions: str | None = option(
        None, "Names of the actions in order.", metavar="NAME[,NAME...]", default_text="their numbers"
    )
    returns: str | None = option(
        None, "The least and the largest discounted return.", metavar="LOW:HIGH", default_text="0:1"
    )
    key: str = option(
        "q", "Array or column of the action values; an array that stands alone may have any name."
    )
    visits: str = option(
        "visits", "Array or column of the updates of each pair, if there is one.", seldom=True
    )
    td_var: str = option(
        "td_var",
        "Array or column of the mean squared TD error of each pair, which posterior weighs by, if there is one.",
        seldom=True,
    )
    min_visits: int = option(
        LEAST_VISITS, "A pair updated less often is unknown, where visits are known.", low=0, metavar="N"
    )
    name: str | None = option(
        None,
        "What the distribution is called, in names and pictures; curves of one name are of the same tasks.",
        default_text="tables, or runs",
    )
    runs: bool = option(
        False,
        "Import learning curves, a run for each method: rows of task, episode, method, and return or steps and reached.",
        panel="Curves",
    )
    horizon: int | None = option(
        None,
        "Steps after which an episode was cut off; give it where curves of one --name come from several files.",
        low=1,
        default_text="the longest episode",
        panel="Curves",
    )

    def __post_init__(self) -> None:
        check(self)
        usual = {one.name: one.default for one in fields(self)}
        idle = [
            name for name in (OF_TABLES if self.runs else ("horizon",)) if getattr(self, name) != usual[name]
        ]
        if idle:
            of = "curves" if self.runs else "tables"
            raise ValueError(
                f"{flag(idle[0])} is no option of {of}; leave it out{'' if self.runs else ', or give --runs'}"
            )
        if self.gamma is None and not self.runs:
            raise ValueError("--gamma is missing: the discount that the tables were learned with")
        if self.returns is not None:
            ReturnBounds.read(self.returns)
        for name in ("axes", "actions"):
            if (given := getattr(self, name)) is not None and not all(map(str.strip, given.split(","))):
                raise ValueError(f"{flag(name)} {given!r} has an empty name")

    @property
    def discount(self) -> float:
        """The discount; 1 where returns came without one."""
        return 1.0 if self.gamma is None else self.gamma

    @property
    def roles(self) -> dict[str, str]:
        """The names of arrays or columns by what they hold."""
        return {"q": self.key, "visits": self.visits, "td_var": self.td_var}

    @property
    def action_names(self) -> list[str] | None:
        """The actions' names; None where they are unknown."""
        return None if self.actions is None else [name.strip() for name in self.actions.split(",")]

    @property
    def title(self) -> str:
        """What the distribution is called."""
        return self.name or ("runs" if self.runs else "tables")
