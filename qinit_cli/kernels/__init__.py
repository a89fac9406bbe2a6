"""Compiled loops and what surrounds them, on arrays and scalars alone: no files, no command line.

What environment variables tell Numba is settled here, before any module imports it.
"""

from __future__ import annotations

import os

from qinit_cli.errors import UsageError


def _settle_variables() -> None:
    """UsageError for variables with which Numba cannot be imported, or compiles nothing."""
    # else loops are compiled with Intel's vector library where that is installed, and the last bits of exp differ
    os.environ.setdefault("NUMBA_DISABLE_INTEL_SVML", "1")
    threads = os.environ.get("NUMBA_NUM_THREADS", "1")
    if not threads.strip().isdecimal() or int(threads) == 0:
        raise UsageError(f"NUMBA_NUM_THREADS is {threads!r}; set it to a number from 1, or unset it")
    without = os.environ.get("NUMBA_DISABLE_JIT", "0").strip()
    if without not in ("", "0"):
        raise UsageError(f"NUMBA_DISABLE_JIT is {without!r}, and qinit's kernels run only compiled; unset it")


_settle_variables()
