"""What an environment is made of: its id, its arguments and attributes, what is put around it, and what is read as its state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any


class KeywordArguments(tuple[tuple[str, Any], ...]):
    """Names and values that an environment is made with; equal where they are written alike.

    So a list can stand among the keys of a cache, and 1, 1.0 and True are three values.
    """

    def __hash__(self) -> int:
        return hash(repr(self))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, KeywordArguments) and repr(self) == repr(other)

    @property
    def told(self) -> str:
        """In words."""
        return ", ".join(f"{name}={value}" for name, value in self) or "its defaults"


NOTHING_SET = KeywordArguments()


@dataclass(frozen=True)
class Recipe:
    """How an environment is made; a key of caches, and its id where it is written into a sentence."""

    env_id: str
    settings: KeywordArguments = NOTHING_SET  # constructor arguments and attributes
    wraps: tuple[str, ...] = ()  # MODULE:FACTORY, from the inside out
    state: tuple[str, ...] = ()  # attributes that stand for what it observes; none: what it observes

    def __str__(self) -> str:
        return self.env_id

    @property
    def told(self) -> str:
        """The id and the settings, in words."""
        return f"{self.env_id} with {self.settings.told}"

    def given(self, settings: KeywordArguments) -> Recipe:
        """The same with these settings in the place of its own."""
        return replace(self, settings=settings)
