"""What changes from task to task, or is set for all of them, in an environment that somebody else has written."""

from __future__ import annotations

import ast
import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.foreign import aside
from qinit_cli.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
NUMBERS = {"normal": "MEAN,STD", "uniform": "LOW,HIGH", "map": "SIZE,FROZEN"}
# what sources, runs and their exported tables have under these names already, beside axes of states
TAKEN = frozenset(
    [
        "action",
        "added",
        "artefact",
        "bin",
        "byte",
        "curve_reached",
        "curve_steps",
        "eopl",
        "episode",
        "eval_reached",
        "eval_return",
        "eval_steps",
        "evaluation",
        "frozen",
        "hypothesis",
        "log_std",
        "method",
        "moment",
        "moves",
        "potential",
        "q",
        "reached",
        "return",
        "seconds",
        "solved",
        "start",
        "steps",
        "task",
        "task_digest",
        "td_var",
        "v_eps",
        "v_star",
        "visits",
        "weight",
    ]
)
AXIS = re.compile(r"state|row|col|x\d+")
LONGEST = 64  # letters of a column's name
MAP_SEEDS = 2**31
MAP_TRIES = 1000


@dataclass(frozen=True)
class Variation:
    """A constructor argument or an attribute that each task draws: normal, uniform, or a FrozenLake map."""

    name: str
    kind: str
    numbers: tuple[float, float]

    @classmethod
    def read(cls, text: str) -> Variation:
        """The variation in NAME=normal:MEAN,STD, NAME=uniform:LOW,HIGH or NAME=map:SIZE,FROZEN; ValueError for any other."""
        name, equals, told = text.partition("=")
        kind, colon, numbers = told.partition(":")
        try:
            first, second = (float(number) for number in numbers.split(","))
        except ValueError:
            colon = ""
        if not (equals and colon and NAME.fullmatch(name) and kind in NUMBERS):
            raise ValueError(
                f"--vary {text}: write {' or '.join(f'NAME={k}:{v}' for k, v in NUMBERS.items())}"
            )
        if len(name) > LONGEST:
            raise ValueError(
                f"--vary {text}: {name} has {len(name)} letters; a column of an artefact has {LONGEST} at most"
            )
        if not (math.isfinite(first) and math.isfinite(second)):
            raise ValueError(f"--vary {text}: the numbers must be finite")
        if fault := _fault(kind, first, second):
            raise ValueError(f"--vary {text}: {fault}")
        return cls(name, kind, (first, second))

    @property
    def column(self) -> str:
        """What the drawn value is called in an artefact, where each name stands for one thing."""
        name = self.name.lower()
        return f"{name}_drawn" if name in TAKEN or AXIS.fullmatch(name) else name

    @property
    def dtype(self) -> str:
        """Of the drawn value; a map is told by its seed."""
        return "<i8" if self.kind == "map" else "<f8"

    @property
    def bounds(self) -> tuple[float | None, float | None]:
        """The least and the largest value that is drawn; None where there is none."""
        match self.kind:
            case "map":
                return 0, MAP_SEEDS - 1
            case "uniform":
                return self.numbers
            case _:
                return None, None

    def draw(self, rng: np.random.Generator) -> float | int:
        """One value, or the seed of a map."""
        if self.kind == "map":
            return int(rng.integers(MAP_SEEDS))
        return float(rng.normal(*self.numbers) if self.kind == "normal" else rng.uniform(*self.numbers))

    def value(self, drawn: float | int) -> Any:
        """What the environment is given."""
        if self.kind != "map":
            return float(drawn)
        with aside():  # gymnasium's plug-ins are imported with it
            from gymnasium.envs.toy_text.frozen_lake import generate_random_map

        size, frozen = int(self.numbers[0]), self.numbers[1]
        if not _map_is_found(size, frozen):
            raise UsageError(
                f"--vary {self.name}=map:{size},{frozen:g}: of {MAP_TRIES} such maps none can be solved; raise FROZEN"
            )
        return generate_random_map(size=size, p=frozen, seed=int(drawn))


@lru_cache
def _map_is_found(size: int, frozen: float) -> bool:
    """Whether a map that can be solved is found soon: gymnasium's generator would look for one without end."""
    import numpy as np
    from gymnasium.envs.toy_text.frozen_lake import is_valid

    rng = np.random.Generator(np.random.PCG64(0))
    for _ in range(MAP_TRIES):
        board = np.where(rng.random((size, size)) < frozen, "F", "H")
        board[0, 0], board[-1, -1] = "S", "G"
        if is_valid(board.tolist(), size):
            return True
    return False


def _fault(kind: str, first: float, second: float) -> str:
    match kind:
        case "normal" if second < 0:
            return "the standard deviation is negative"
        case "uniform" if first > second:
            return "LOW is above HIGH"
        case "map" if first < 2 or first != int(first) or not 0 < second <= 1:
            return "SIZE is a whole number from 2, FROZEN a share above 0"
    return ""


def setting(text: str) -> tuple[str, Any]:
    """The name and the value in NAME=VALUE: what Python writes so, nan and inf among it, else the text itself."""
    name, equals, value = text.partition("=")
    if not (equals and NAME.fullmatch(name)):
        raise ValueError(f"--set {text}: write NAME=VALUE")
    if value.lstrip("+-") in ("nan", "inf"):  # numbers, whatever becomes of them
        return name, float(value)
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value
