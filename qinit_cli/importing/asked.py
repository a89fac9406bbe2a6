"""What is asked of an import, free of numpy so that help stays fast."""

from __future__ import annotations

from dataclasses import dataclass

from qinit_cli.options import check, option
from qinit_cli.rewards import ReturnBounds

LEAST_VISITS = 1  # below which a pair is unknown, where visits are known


@dataclass(frozen=True)
class ImportedFiles:
    """How the arrays or rows of other programs' files are read as tables of action values."""

    gamma: float | None = option(
        None, "Discount that the tables were learned with.", above=0, high=1, default_text="must be given"
    )
    axes: str | None = option(
        None,
        "State axes in order, NAME=LENGTH each; a file without a task axis is then one task.",
        metavar="NAME=N[,NAME=N...]",
        default_text="state; row and col; or x0, x1, ... of arrays; the columns of rows",
    )
    actions: str | None = option(
        None, "Names of the actions in order.", metavar="NAME[,NAME...]", default_text="their numbers"
    )
    returns: str | None = option(
        None, "The least and the largest discounted return.", metavar="LOW:HIGH", default_text="0:1"
    )
    key: str = option("q", "Array or column of the action values; the only array may have any name.")
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
    name: str = option("tables", "What the distribution is called, in names and pictures.")

    def __post_init__(self) -> None:
        check(self)
        if self.gamma is None:
            raise ValueError("--gamma is missing: the discount that the tables were learned with")
        if self.returns is not None:
            ReturnBounds.read(self.returns)
        for name in ("axes", "actions"):
            if (given := getattr(self, name)) is not None and not all(map(str.strip, given.split(","))):
                raise ValueError(f"--{name} {given!r} has an empty name")

    @property
    def discount(self) -> float:
        """gamma, which is there."""
        if self.gamma is None:
            raise ValueError("gamma is missing")
        return self.gamma
