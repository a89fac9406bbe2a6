"""Modules that register environments, imported because the user names them and never because a file does.

An id is written MODULE:ID. A module in `sys.modules` has been imported already; any other must be named.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, cast

from qinit_cli.environments.foreign import aside, ends_our_work, told
from qinit_cli.errors import UsageError

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_cli.watch import Watch

    Learn = Callable[[Integers, Watch], tuple[Integers, dict[str, Any]]]

MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")

_NAMED: dict[str, None] = {}  # modules that were named in this process, in order
_MAKERS: dict[str, str] = {}  # ids that a named module registered, and which it was


def import_named(names: Iterable[str]) -> None:
    """Imports the modules, what they print going to stderr; UsageError, one sentence, where one cannot be."""
    for name in names:
        if not MODULE.fullmatch(name):
            raise UsageError(f"--import {name}: write a module's name, such as my_environments")
        before = _registered()
        try:
            with aside():
                importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
                raise UsageError(
                    f"there is no module {name}; put the folder that holds it on PYTHONPATH"
                ) from error
            raise UsageError(f"importing {name} raised {told(error)}") from error
        except BaseException as error:  # of any kind: the module is somebody else's
            if ends_our_work(error):
                raise
            raise UsageError(f"importing {name} raised {told(error)}") from error
        _NAMED[name] = None
        _MAKERS.update(dict.fromkeys(_registered() - before, name))


def with_module(env_id: str) -> str:
    """The id as it was typed, its module imported; of an id without one MODULE:ID, if a named module has registered it."""
    module, colon, bare = env_id.rpartition(":")
    if colon:
        if not (MODULE.fullmatch(module) and bare):
            raise UsageError(f"{env_id}: write a module's name and an id, such as my_environments:Walk-v0")
        import_named([module])
        return env_id
    maker = _MAKERS.get(env_id)
    return env_id if maker is None else f"{maker}:{env_id}"


def factory(text: str) -> Callable[[Any], Any]:
    """What MODULE:FACTORY names: what is put around an environment. UsageError where there is none that may be called.

    Its module must have been named in this process: a file could name any function of any module else. A wrapper of gymnasium's
    kind needs no more than to be there.
    """
    module, _, name = text.rpartition(":")
    found = getattr(sys.modules.get(module), name, None)
    if module not in _NAMED and not _is_wrapper(found):
        raise UsageError(
            f"--wrap {text} comes from the module {module}, which is imported only where it is named: give --import {module}"
        )
    if not callable(found):
        raise UsageError(f"--wrap {text}: {module} has no {name} that could be called")
    return cast("Callable[[Any], Any]", found)


def import_factory(text: str) -> None:
    """Imports the module of MODULE:FACTORY, because it was typed; UsageError where that fails."""
    module, _, name = text.rpartition(":")
    if not (MODULE.fullmatch(module) and MODULE.fullmatch(name)):
        raise UsageError(f"--wrap {text}: write a module's name and a factory's, such as my_wrappers:Masked")
    import_named([module])
    factory(text)


def registered_id(env_id: str) -> str:
    """The id without its module; UsageError, with the option to give, if that is not imported."""
    module, _, bare = env_id.rpartition(":")
    if module and module not in sys.modules:
        raise UsageError(
            f"{env_id} comes from the module {module}, which is imported only where it is named: give --import {module}"
        )
    return bare


def packages_of(env_id: str, wraps: Iterable[str]) -> tuple[str, ...]:
    """The installed packages beside gymnasium that an id and what is put around it come from, by name, in order."""
    module, _, bare = env_id.rpartition(":")
    gymnasium = sys.modules.get("gymnasium")
    spec = None if gymnasium is None else gymnasium.registry.get(bare)
    maker = getattr(spec, "entry_point", None)
    where = maker if isinstance(maker, str) else getattr(maker, "__module__", "")
    modules = {name.partition(":")[0].partition(".")[0] for name in (module, where, *wraps)}
    found = [package for name in modules - {"", "gymnasium"} for package in _packages().get(name, ())]
    return tuple(sorted(set(found)))


@cache
def _packages() -> Mapping[str, list[str]]:
    """The installed packages by the modules at their top."""
    from importlib.metadata import packages_distributions

    return packages_distributions()


@dataclass(frozen=True)
class Importing:
    """A learner that travels to another process, with the modules that were named in this one."""

    modules: tuple[str, ...]
    learn: Learn

    def __call__(self, indices: Integers, watch: Watch) -> tuple[Integers, dict[str, Any]]:
        """What the learner learns."""
        import_named(self.modules)
        return self.learn(indices, watch)


def travelling(learn: Learn, family: Mapping[str, Any]) -> Learn:
    """The learner as another process takes it; Gymnasium's families, by their `family` options, take the named modules along."""
    return Importing(tuple(_NAMED), learn) if _NAMED and "env_id" in family else learn


def _is_wrapper(found: Any) -> bool:
    gymnasium = sys.modules.get("gymnasium")
    return gymnasium is not None and isinstance(found, type) and issubclass(found, gymnasium.Wrapper)


def _registered() -> set[str]:
    gymnasium = sys.modules.get("gymnasium")
    return set() if gymnasium is None else set(gymnasium.registry)
