"""The registry of methods: one line each, and the method appears as a subcommand, in the tables and in the contract tests."""

from __future__ import annotations

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

METHODS: dict[str, type[Method]] = {
    method.name: method
    for method in (
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
    )
}

__all__ = ["METHODS", "Initial", "Method", "Targets"]
