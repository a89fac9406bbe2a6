"""What claims are judged by: a few arrays of each artefact, one source set beside the other, by what they are of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from qinit_cli.arrays import Flags, Floats
from qinit_cli.claims.scores import Arms
from qinit_cli.claims.setting import Setting


@dataclass(frozen=True)
class Lengths:
    """Path lengths from the target start in one source set, each task along its own greedy path."""

    arrived: Floats  # (n,) whole numbers, ascending
    never: int  # tasks whose path never arrives


@dataclass(frozen=True)
class Values:
    """Values of some states in one source set, each at the action whose mean over the tasks is largest."""

    places: tuple[str, ...]  # "(0, 0)"
    positive: tuple[
        Floats, ...
    ]  # (n,) for each place, ascending; tasks without a positive value are left out


@dataclass(frozen=True)
class LengthTests:
    """Path lengths of one source set tested against the rounded normal, (S, A) each, NaN where not testable."""

    p: Floats
    statistic: Floats  # W
    skewness: Floats
    kurtosis: Floats  # excess
    among_goals: (
        Flags  # (S,) the smallest set of states that holds 95 % of the goals; nowhere where all share one
    )


@dataclass(frozen=True)
class Maps:
    """What initialisations start from in one source set, the largest over actions, over a grid."""

    probabilities: Floats  # (rows, columns) that the goal is there
    starts: Mapping[str, Floats]  # by method, (rows, columns)


@dataclass(frozen=True)
class Evidence:
    """All that was given; a tuple has one element for each source set."""

    lengths: Mapping[Setting, tuple[Lengths, ...]] = field(default_factory=dict)
    values: Mapping[Setting, tuple[Values, ...]] = field(default_factory=dict)
    tested: Mapping[Setting, tuple[LengthTests, ...]] = field(default_factory=dict)
    maps: Mapping[Setting, tuple[Maps, ...]] = field(default_factory=dict)
    scores: Mapping[Setting, Arms] = field(default_factory=dict)
    passed_over: tuple[str, ...] = ()  # names of artefacts that no claim is about
