"""What is known of a task distribution once its sources are fitted: the one thing a method may start from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.options import check, option
from qinit_cli.rewards import UNIT, ReturnBounds

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
    """Statistics of the source tables per state-action; NaN where no source has a positive value.

    Q stands for its share of the attainable return, see rewards.ReturnBounds: with rewards of 1 at the goal, Q itself.
    """

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
    library_weights: Floats | None = None  # (K, T, A), of tiles, whose sums library_q are; None: tables
    bounds: ReturnBounds = UNIT  # of the sources' returns

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

    LEVELS: ClassVar[tuple[str, ...]] = (  # values, in artefacts as returns
        "lognormal_median",
        "lognormal_mean",
        "mean",
        "min",
        "max",
        "value_mean",
        "library_q",
    )
    SPREADS: ClassVar[Mapping[str, int]] = {"std": 1, "library_td_var": 2}  # and powers of them

    @property
    def known(self) -> Flags:
        """Where at least one source has a positive value, (S, A)."""
        return self.n > 0

    @classmethod
    def from_arrays(
        cls, arrays: dict[str, Any], states: int, estimator: str, bounds: ReturnBounds = UNIT
    ) -> FittedTables:
        """The fit in an artefact's arrays of returns within the bounds, their state axes laid out as one."""
        arrays = in_shares(arrays, bounds)
        flat = {name: arrays[name].reshape(states, -1) for name in cls.TABLES}
        actions = flat["mu"].shape[1]  # a library of no tables does not tell
        library = {
            name: arrays[name].reshape(len(arrays[name]), states, actions)
            for name in ("library_q", "library_td_var")
        }
        return cls(
            **flat,
            **library,
            value_mean=arrays["value_mean"].reshape(states),
            library_weights=arrays.get("library_weights"),
            estimator=estimator,
            bounds=bounds,
        )


def in_shares(arrays: Mapping[str, Any], bounds: ReturnBounds) -> dict[str, Any]:
    """The arrays of a fit with shares in the place of returns."""
    return _mapped(arrays, bounds.shares, 1 / bounds.width)


def in_returns(arrays: Mapping[str, Any], bounds: ReturnBounds) -> dict[str, Any]:
    """The inverse of `in_shares`."""
    return _mapped(arrays, bounds.returns, bounds.width)


def _mapped(arrays: Mapping[str, Any], level: Callable[[Any], Any], scale: float) -> dict[str, Any]:
    mapped = dict(arrays)
    mapped |= {name: level(arrays[name]) for name in FittedTables.LEVELS if name in arrays}
    if scale != 1.0:
        powers = FittedTables.SPREADS
        mapped |= {name: arrays[name] * scale ** powers[name] for name in powers if name in arrays}
    return mapped
