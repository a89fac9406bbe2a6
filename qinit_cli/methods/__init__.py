"""The registry of methods: one line each, and the method appears as a subcommand, in the tables and in the contract tests.

Those of installed plug-ins (entry points `qinit.methods`) are in it too.
"""

from __future__ import annotations

from typing import Any

from qinit_cli.methods.drs import Drs
from qinit_cli.methods.logqinit_mean import LogQInitMean
from qinit_cli.methods.logqinit_median import LogQInitMedian
from qinit_cli.methods.logqinit_quantile import LogQInitQuantile
from qinit_cli.methods.maxqinit import MaxQInit
from qinit_cli.methods.mean import Mean
from qinit_cli.methods.method import Initial, Method
from qinit_cli.methods.ops_tl import OpsTl
from qinit_cli.methods.optimal import Optimal
from qinit_cli.methods.posterior import Posterior
from qinit_cli.methods.ptrs import Ptrs
from qinit_cli.methods.targets import Targets
from qinit_cli.methods.ucoi import Ucoi
from qinit_cli.methods.zero import Zero
from qinit_cli.registry import Registry

METHODS: Registry[Method] = Registry(
    "qinit.methods",
    "method",
    (
        Zero,
        Mean,
        MaxQInit,
        Ucoi,
        LogQInitMedian,
        LogQInitMean,
        LogQInitQuantile,
        Optimal,
        Ptrs,
        Drs,
        OpsTl,
        Posterior,
    ),
    lambda found: _fault(found),
)

__all__ = ["METHODS", "Initial", "Method", "Targets"]


def _fault(found: type[Any]) -> str:
    """What a class lacks to be a method."""
    if not issubclass(found, Method):
        return "its class is no Method"
    if found.needs_tables and not found.privileged:
        return "it needs the targets' tables and is not privileged"
    return "" if isinstance(getattr(found, "formula", None), str) else "it lacks a formula"
