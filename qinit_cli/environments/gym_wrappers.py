"""What is put around an environment, outermost: its actions numbered, and attributes in the place of what it observes.

Imports gymnasium, so it is imported where an environment is made and nowhere else.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import gymnasium

from qinit_cli.environments.foreign import Improper
from qinit_cli.environments.gym_leaves import NUMERIC, Leaf, builder, digits, leaves
from qinit_cli.errors import UsageError


class NumberedActions(gymnasium.ActionWrapper[Any, int, Any]):
    """The actions of a numbered space by one number each, from 0, in the order of numpy.ravel_multi_index."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._leaves = leaves(env.action_space)
        self._counts = [leaf.count for leaf in self._leaves]
        self._build = builder(env.action_space)
        self.action_space: Any = gymnasium.spaces.Discrete(math.prod(self._counts))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What the environment itself calls each action: its numbers."""
        lows = [int(leaf.low) for leaf in self._leaves]
        return tuple(
            ",".join(str(low + digit) for low, digit in zip(lows, digits(number, self._counts), strict=True))
            for number in range(math.prod(self._counts))
        )

    def action(self, action: int) -> Any:
        """As the environment takes it."""
        return self._build(iter(digits(int(action), self._counts)))


class AttributeState(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Observes attributes, of the environment or of a wrapper around it, one number after another."""

    def __init__(self, env: gymnasium.Env[Any, Any], env_id: str, names: tuple[str, ...]) -> None:
        super().__init__(env)
        self._id, self._names = env_id, names

    def observation(self, observation: Any) -> list[float | int]:
        """Their numbers now."""
        return [number for name in self._names for number in self._numbers(name)]

    def leaves(self) -> list[Leaf]:
        """What they are, once the environment is reset: no bounds are known."""
        found = []
        for name in self._names:
            numbers = self._numbers(name)
            labels = [name] if len(numbers) == 1 else [f"{name}[{place}]" for place in range(len(numbers))]
            found += [
                Leaf(label, -math.inf, math.inf, isinstance(number, int))
                for label, number in zip(labels, numbers, strict=True)
            ]
        return found

    def _numbers(self, name: str) -> list[float | int]:
        try:
            value = self.env.get_wrapper_attr(name)
        except AttributeError as error:
            raise UsageError(
                f"--state {name}: {self._id} has no such attribute; its own are "
                f"{', '.join(sorted(name for name in vars(self.unwrapped) if not name.startswith('_')))}"
            ) from error
        if isinstance(value, int | float):
            return [value + 0]  # of a flag a number
        import numpy as np

        array = np.asarray(value)
        if array.dtype.kind not in NUMERIC:
            raise Improper(f"the attribute {name} is {value!r:.80}, which is no number")
        numbers: list[float | int] = (array + 0 if array.dtype.kind == "b" else array).ravel().tolist()
        return numbers
