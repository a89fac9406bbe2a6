"""qinit: initial values for new tasks from solved ones, in tabular reinforcement learning.

    import qinit_cli as qinit

What the library offers is in qinit_cli.library, and loaded when it is first used.
"""

import sys

# `python -m qinit_cli` loads this before the current folder is off the path, where a typing.py may lie: sys is built in
TYPE_CHECKING = False
if TYPE_CHECKING:
    from types import ModuleType

    from qinit_cli.library import (
        compare,
        families,
        fit,
        folds,
        import_runs,
        import_tables,
        learners,
        lifelong,
        methods,
        open,
        sensitivity,
        start,
        train_sources,
        transfer,
        tune,
    )
    from qinit_cli.pipeline.reporter import Reporter
    from qinit_store.catalog import Store
else:
    ModuleType = type(sys)

__version__ = "0.1.0"
__all__ = [
    "Reporter",
    "Store",
    "compare",
    "families",
    "fit",
    "folds",
    "import_runs",
    "import_tables",
    "learners",
    "lifelong",
    "methods",
    "open",
    "sensitivity",
    "start",
    "train_sources",
    "transfer",
    "tune",
]


class _Library(ModuleType):
    """The package, whose public names come from qinit_cli.library when they are first used."""

    def __getattr__(self, name: str) -> object:
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from qinit_cli import library

        return getattr(library, name)

    def __setattr__(self, name: str, value: object) -> None:
        # the import system would put the packages of these names in the place of methods and learners by name
        if name not in ("methods", "learners"):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted([*__all__, "__version__"])


sys.modules[__name__].__class__ = _Library
