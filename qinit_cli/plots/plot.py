"""What a plot is: a picture of artefacts, its options as fields, drawn from files or from what was read of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.options import check
from qinit_cli.plots.style import COLUMN, TEXT

if TYPE_CHECKING:
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.plots.drawn import Drawn
    from qinit_cli.plots.reported import Contents, Planned

# of every command that draws maps
SLICE = "Fix an axis of the states, or a dimension of continuous ones; may be given several times."
UNSLICED = "of tiles the first two dimensions vary, the others are at the target start"
Width = Literal["column", "text"]


@dataclass(frozen=True)
class Takes:
    """The artefacts that a plot is drawn from."""

    kinds: tuple[str, ...]
    words: str  # for the help: "Runs of posterior"
    several: bool = False

    @property
    def argument(self) -> str:
        """What they are called on the command line."""
        [kind, *others] = self.kinds
        if others:
            return "artefacts"
        return f"{kind}s" if self.several and not kind.endswith("s") else kind

    @property
    def help(self) -> str:
        """The help of that argument."""
        form = "paths, names" if self.several else "a path, a name"
        return f"{self.words}: {form} in the store, or - for stdin."


@dataclass(frozen=True)
class Frame:
    """What is the same for every plot."""

    title: str | None = None  # None: the plot's own; "" for none
    width: float = TEXT  # inches
    store: Path = Path("qinit-store")  # where the inputs of artefacts are looked for


PLAIN = Frame()


@dataclass(frozen=True)
class Plot:
    """A picture of artefacts. The first paragraph of its docstring is the command's help, its fields are the options."""

    name: ClassVar[str]
    takes: ClassVar[Takes]
    titled: ClassVar[str]  # its own title in words, for the help
    wide: ClassVar[Width] = "text"  # unless another width is asked for
    heading: ClassVar[str] = "Plot"  # above its options in the help

    def __post_init__(self) -> None:
        check(self)

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """The picture of these artefacts. NotAllowed where one does not hold what is drawn, UsageError where they do not fit."""
        raise NotImplementedError

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """The pictures of this kind in a report of these artefacts; none unless a plot has its place there."""
        return iter(())

    @classmethod
    def inches(cls, width: Width | None) -> float:
        """The width that was asked for, else the plot's usual one."""
        return COLUMN if (width or cls.wide) == "column" else TEXT


@dataclass(frozen=True)
class RunsPlot(Plot):
    """A picture of runs, which may have been read before."""

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """The picture of the runs in these files, each once."""
        from qinit_cli.comparison.runs import read_runs

        return self.of_runs(read_runs(paths), frame)

    def of_runs(self, runs: Sequence[ComparedRun], frame: Frame = PLAIN) -> Drawn:
        """The picture of these runs."""
        raise NotImplementedError
