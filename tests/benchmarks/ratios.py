"""A table of ratios, in markdown: qinit beside Gymnasium, JAX and quantecon, as one writes the same learning with them.

Runs in an environment of the peers' own (`make bench`). Each turn times qinit in a process of its own, then every peer
here; rates are per second of processor, ratios are within a turn.
"""

from __future__ import annotations

import argparse
import gc
import json
import resource
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median

import gymnasium_loop
import jax_loop
import quantecon_solver


@dataclass(frozen=True)
class Peer:
    """Somebody else's way to do what qinit does."""

    name: str
    case: str  # as `qinit bench` calls it
    run: Callable[[], float]  # the work done: steps, or tables


PEERS = (
    Peer("Gymnasium + numpy", "gridworld sources, early", gymnasium_loop.gridworld),
    Peer("JAX (float32), lax.scan under vmap", "gridworld sources, early", jax_loop.gridworld),
    Peer("Gymnasium + numpy", "mountain-car sources, early", gymnasium_loop.mountain_car),
    Peer("JAX (float32), lax.scan under vmap", "mountain-car sources, early", jax_loop.mountain_car),
    Peer(
        "quantecon, modified policy iteration, model built before",
        "a 30 x 30 gridworld",
        quantecon_solver.solve,
    ),
)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--qinit", required=True, help="the qinit that is timed")
    parser.add_argument("--repeat", type=int, default=3, help="turns")
    arguments = parser.parse_args()
    for peer in PEERS:
        peer.run()  # compiles
    turns = [(_qinit(arguments.qinit), [_rate(peer) for peer in PEERS]) for _ in range(arguments.repeat)]
    print("| what | qinit | peer | | times faster |")
    print("| --- | ---: | ---: | --- | ---: |")
    for place, peer in enumerate(PEERS):
        ours = [rates[peer.case] for rates, _ in turns]
        theirs = [rates[place] for _, rates in turns]
        ratios = sorted(mine / their for mine, their in zip(ours, theirs, strict=True))
        spread = f"{median(ratios):.3g} ({ratios[0]:.3g} to {ratios[-1]:.3g})"
        case = peer.case.partition(",")[0] if "sources" in peer.case else f"Q* of {peer.case}"
        print(f"| {case} | {_told(median(ours))} | {_told(median(theirs))} | {peer.name} | {spread} |")


def _qinit(qinit: str) -> dict[str, float]:
    """qinit's rate for each case: steps, or tables, a second of processor."""
    rows: list[dict[str, object]] = []
    for what in ("kernels", "exact"):
        command = [qinit, "bench", "--what", what, "--repeat", "1", "--json", "--quiet"]
        told = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
        rows += told["rows"]
    return {
        str(row["case"]): float(str(row["ours_figure"])) * 1e6
        if row["unit"] == "M steps/s"
        else 1e3 / float(str(row["ours_figure"]))
        for row in rows
    }


def _rate(peer: Peer) -> float:
    gc.collect()
    began = _cpu_seconds()
    work = peer.run()
    return work / (_cpu_seconds() - began)


def _cpu_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _told(rate: float) -> str:
    """Steps or tables a second, by size."""
    if rate >= 1e6:
        return f"{rate / 1e6:.1f} M/s"
    return f"{rate / 1e3:.0f} k/s" if rate >= 1e4 else f"{rate:.0f} /s"


if __name__ == "__main__":
    began = time.perf_counter()
    main()
    print(f"\nin {time.perf_counter() - began:.0f} s")
