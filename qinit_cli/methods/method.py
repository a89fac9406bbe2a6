"""What a transfer method is, seen from the learner: a start table, a potential and policies, each with a neutral element.

A method is a small frozen dataclass: its docstring's first line is the subcommand's help, its fields are the options, and
`asdict` is what is stored. It is a function of the fit and the family alone; the privileged ones, marked so in every table,
also read the target's parameters and return arrays with a leading target axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, Self

from qinit_cli.environments.family import bounds_of
from qinit_cli.errors import NotAllowed
from qinit_cli.methods.targets import Targets
from qinit_cli.options import check, option, options

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.environments.family import Family
    from qinit_cli.fitted import FittedTables
    from qinit_cli.kernels.policies import Policies
    from qinit_cli.kernels.posterior import Hypotheses
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Initial:
    """What learning starts from."""

    start: Floats  # (S, A), or (T, S, A) where it depends on the target
    potential: Floats  # (S,), or (T, S)
    policies: Policies  # (K, S), and how one of them is chosen
    filled: int  # entries of the start that no source knows
    clipped: int  # entries of the start outside the bounds of returns
    hypotheses: Hypotheses | None = (
        None  # (K, S, A) tables whose weights change the start while it learns; None: it stays
    )

    @property
    def start_per_task(self) -> bool:
        """Whether every target has a start of its own."""
        return self.start.ndim == 3

    @property
    def potential_per_task(self) -> bool:
        """Whether every target has a potential of its own."""
        return self.potential.ndim == 2

    @property
    def hypothesis_count(self) -> int:
        """How many tables are weighed while learning; 0 for methods whose start stays."""
        return 0 if self.hypotheses is None else len(self.hypotheses.q)

    def of(self, indices: Integers) -> Initial:
        """What the targets at these indices start from."""
        return replace(
            self,
            start=self.start[indices] if self.start_per_task else self.start,
            potential=self.potential[indices] if self.potential_per_task else self.potential,
        )


class Look(NamedTuple):
    """How a method is drawn in every picture; "" takes what no other method has."""

    colour: str = ""  # #RRGGBB
    marker: str = ""  # on lines, by matplotlib's name
    hatch: str = ""  # of bars, by matplotlib's name
    dashes: str = ""  # of lines, by matplotlib's name; the method's variants have others


class Method:
    """The neutral method; subclasses replace the parts they have."""

    name: ClassVar[str]
    formula: ClassVar[str]
    privileged: ClassVar[bool] = False  # reads the target's parameters
    needs_tables: ClassVar[bool] = False  # reads Q* of the targets, which are then made before it is asked
    reconstructed: ClassVar[bool] = False  # made without its authors' formula
    reference: ClassVar[bool] = False  # what others are measured by: in pictures of either kind of method
    transfers: ClassVar[bool] = (
        True  # whether it takes anything over: worse than what does not is negative transfer
    )
    attains: ClassVar[bool] = (
        False  # its last episodes earn what a target allows: regret is counted from them
    )
    weighs: ClassVar[bool] = False  # whether hypotheses change its start while a task is learned
    look: ClassVar[Look] = Look()

    def __post_init__(self) -> None:
        check(self)  # type: ignore[arg-type]  # every concrete method is a dataclass

    @property
    def shapes(self) -> bool:
        """Whether it has a potential."""
        return type(self).potential is not Method.potential

    @property
    def follows(self) -> bool:
        """Whether it has policies."""
        return type(self).policies is not Method.policies

    def on(self, family: Family) -> Self:
        """With what it leaves to the family filled in; itself."""
        return self

    @property
    def reads_moments(self) -> bool:
        """Whether its start is made of the fit's moments per state-action."""
        return False

    @property
    def reads_sources(self) -> bool:
        """Whether other sources would make it start otherwise; else one run of it serves all source sets."""
        return True

    @property
    def library_wanted(self) -> int:
        """How many tables of the fit's library it asks for; 0 where as many as there are."""
        return 0

    @property
    def label(self) -> str:
        """What it is called in names and tables: with the options that are not at their default."""
        return " ".join([self.name, *self._changed()])

    def _changed(self) -> list[str]:
        """Each such option as KEY=VALUE, a flag by its name alone; what it starts from is no such option."""
        told = []
        for field in options(type(self)):
            value, spelled = getattr(self, field.name), field.name.replace("_", "-")
            if value != field.default and field.name != "init":
                told.append(spelled if value is True else f"{spelled}={value}")
        return told

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """First values, (S, A), NaN where no source knows: shares of the attainable return; of a return of 0."""
        import numpy as np

        return np.full_like(fit.mean, fit.bounds.share(0.0))

    def potential(self, fit: FittedTables, targets: Targets) -> Floats:
        """Shaping potential, (S,), as shares too; zeros."""
        import numpy as np

        return np.zeros(len(fit.value_mean))

    def policies(self, fit: FittedTables, targets: Targets) -> Policies:
        """Source policies to choose among, (K, S); no rows."""
        import numpy as np

        from qinit_cli.kernels.policies import Policies

        return Policies(np.empty((0, len(fit.value_mean)), np.int64))

    def filling(self, fit: FittedTables, start: Floats) -> float:
        """What stands where no source knows a pair."""
        return 0.0

    def potential_of(self, fit: FittedTables, targets: Targets) -> Floats:
        """The potential as returns; zeros where the method has none."""
        potential = self.potential(fit, targets)
        return fit.bounds.returns(potential) if self.shapes else potential

    def initial(self, fit: FittedTables, targets: Targets) -> Initial:
        """The three arrays as returns, every start filled where unknown and clipped to their bounds, with the counts of both."""
        import numpy as np

        start = self.start(fit, targets)
        unknown = np.isnan(start)
        known = fit.bounds.returns(np.where(unknown, self.filling(fit, start), start))
        bounds = bounds_of(targets.family, targets.learning.gamma)
        clipped = np.clip(known, bounds.low, bounds.high)
        return Initial(
            start=clipped,
            potential=self.potential_of(fit, targets),
            policies=self.policies(fit, targets),
            filled=int(unknown.sum()),
            clipped=int((clipped != known).sum()),
        )

    def initial_of_all(self, fit: FittedTables, family: Family, learning: Learning) -> Initial:
        """The same where no target may be looked at; NotAllowed for a privileged method."""
        if self.privileged:
            raise NotAllowed(f"{self.name} starts from the target itself, not from a fit alone")
        return self.initial(fit, Targets.unseen(family, learning))


@dataclass(frozen=True)
class Initialisation(Method):
    """A method that is a start table alone, made from the fit."""

    fallback: Literal["zero", "largest"] = option(
        "zero", "What stands where no source knows a pair: 0, or the largest value of the table."
    )

    @property
    def reads_moments(self) -> bool:
        """Every initialisation's is."""
        return True

    def filling(self, fit: FittedTables, start: Floats) -> float:
        import numpy as np

        if self.fallback == "zero" or np.isnan(start).all():
            return 0.0
        return float(np.nanmax(start))
