"""What is known of a task distribution once its sources are fitted: the one thing a method may start from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.options import check, option

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers

UNKNOWN = 1  # a flag: no source has a positive value there
MASKED = 2  # a flag: some sources have none, and are left out

# of normality, in words, by the names of the options
TESTS = {"shapiro": "Shapiro-Wilk", "anderson": "Anderson-Darling", "lilliefors": "Lilliefors", "none": ""}
EOPL_TESTS = {
    "rounded": "Shapiro-Wilk against the rounded normal",
    "dither": "Shapiro-Wilk with U(-.5, .5) added",
    "none": "",
}


@dataclass(frozen=True)
class FitOptions:
    """How the sources are summarised."""

    estimator: Literal["mle", "umvue", "zellner", "shen"] = option(
        "mle", "Estimator of the log-normal mean and median; the paper's is mle. shen has no median."
    )
    library: int = option(
        100, "Source tables kept whole for methods that choose among them.", low=0, metavar="K"
    )

    exclude_unlearned: bool = option(
        False,
        "Leave out sources that could be solved but whose greedy path fails; unsolvable ones always are.",
    )

    normality: Literal["shapiro", "anderson", "lilliefors", "none"] = option(
        "shapiro",
        "Test ln Q for normality per state-action: Shapiro-Wilk, Anderson-Darling or Lilliefors.",
        panel="Statistics",
    )
    eopl_normality: Literal["rounded", "dither", "none"] = option(
        "none",
        "Test the path lengths, which are whole numbers: against the rounded normal (a bootstrap, 3 s at the paper's "
        "size), or by Shapiro-Wilk with U(-.5, .5) added.",
        panel="Statistics",
    )
    alternatives: bool = option(
        False,
        "Set the log-normal against normal, gamma, Weibull, beta and the empirical distribution, by AIC and held-out "
        "log score (5 s).",
        panel="Statistics",
    )
    # tasks are independent draws, so the last are as good as any; the library stays that of the first
    holdout: int = option(
        0,
        "Leave the last N usable sources out of the fit, and tell how far each initialisation's start is from their "
        "tables.",
        low=0,
        metavar="N",
        panel="Statistics",
    )
    check_theory: bool = option(
        False,
        "Set ln Q beside what the path lengths predict (propositions 1 to 5).",
        panel="Statistics",
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class FittedTables:
    """Statistics of the source tables per state-action; NaN where no source has a positive value."""

    mu: Floats  # (S, A) mean of ln Q
    sigma: Floats  # (S, A) standard deviation of ln Q, ddof 0
    lognormal_median: Floats  # (S, A) by the fit's estimator
    lognormal_mean: Floats  # (S, A) by the fit's estimator
    mean: Floats  # (S, A)
    std: Floats  # (S, A), ddof 0
    min: Floats  # (S, A)
    max: Floats  # (S, A)
    n: Integers  # (S, A) sources with a positive value
    value_mean: Floats  # (S,) mean over sources of max_a Q
    library_q: Floats  # (K, S, A)
    library_td_var: Floats  # (K, S, A)
    estimator: str

    TABLES: ClassVar[tuple[str, ...]] = (
        "mu",
        "sigma",
        "lognormal_median",
        "lognormal_mean",
        "mean",
        "std",
        "min",
        "max",
        "n",
    )

    @property
    def known(self) -> Flags:
        """Where at least one source has a positive value, (S, A)."""
        return self.n > 0

    @classmethod
    def from_arrays(cls, arrays: dict[str, Any], states: int, estimator: str) -> FittedTables:
        """The fit in an artefact's arrays, whose state axes are laid out as one."""
        flat = {name: arrays[name].reshape(states, -1) for name in cls.TABLES}
        library = {
            name: arrays[name].reshape(len(arrays[name]), states, -1)
            for name in ("library_q", "library_td_var")
        }
        return cls(**flat, **library, value_mean=arrays["value_mean"].reshape(states), estimator=estimator)
