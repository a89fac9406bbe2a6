"""The registry of methods: one line each, and the method appears as a subcommand, in the tables and in the contract tests."""

from __future__ import annotations

from qinit_cli.methods.logqinit_median import LogQInitMedian
from qinit_cli.methods.maxqinit import MaxQInit
from qinit_cli.methods.method import Initial, Method
from qinit_cli.methods.targets import Targets
from qinit_cli.methods.zero import Zero

METHODS: dict[str, type[Method]] = {
    method.name: method
    for method in (
        Zero,
        MaxQInit,
        LogQInitMedian,
    )
}

__all__ = ["METHODS", "Initial", "Method", "Targets"]
