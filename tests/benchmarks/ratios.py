"""A table of ratios, in markdown or JSON: qinit beside OpenSpiel, Gymnasium, JAX and quantecon, as one learns with them.

Runs in an environment of the peers' own (`make bench`). Each turn times qinit in a process of its own, then every peer
here; rates are per second of processor, ratios are within a turn.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import resource
import subprocess
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from statistics import median

import gymnasium_loop
import jax_loop
import openspiel_loop
import quantecon_solver


@dataclass(frozen=True)
class Peer:
    """Somebody else's way to do what qinit does."""

    name: str
    case: str  # as `qinit bench` calls it
    run: Callable[[], float]  # the work done: steps, or tables


PACKAGES = ("open_spiel", "gymnasium", "jax", "quantecon", "numpy", "numba")
PEERS = (
    Peer("OpenSpiel, its tabular Q-learner", "gridworld sources, early", openspiel_loop.gridworld),
    Peer("Gymnasium + numpy", "gridworld sources, early", gymnasium_loop.gridworld),
    Peer("JAX (float32), lax.scan under vmap", "gridworld sources, early", jax_loop.gridworld),
    Peer("OpenSpiel, its tabular Q-learner", "mountain-car sources, early", openspiel_loop.mountain_car),
    Peer("Gymnasium + numpy", "mountain-car sources, early", gymnasium_loop.mountain_car),
    Peer("JAX (float32), lax.scan under vmap", "mountain-car sources, early", jax_loop.mountain_car),
    Peer(
        "quantecon, modified policy iteration, model built before",
        "a 30 x 30 gridworld",
        quantecon_solver.solve,
    ),
)


@dataclass(frozen=True)
class Ratio:
    """How many times faster qinit is than a peer; rates are per second of processor, medians over the turns."""

    case: str
    peer: str
    qinit_rate: float
    peer_rate: float
    ratio: float  # the median of the turns' quotients
    ratio_low: float
    ratio_high: float
    turns: int


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--qinit", required=True, help="the qinit that is timed")
    parser.add_argument("--repeat", type=int, default=3, help="turns")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    found = ratios(arguments.qinit, arguments.repeat)
    if arguments.json:
        versions = {name: version(name) for name in PACKAGES}
        told = {
            "schema": "qinit.peers/1",
            "versions": versions,
            "load": os.getloadavg()[0],
            "rows": [asdict(one) for one in found],
        }
        print(json.dumps(told))
        return
    print("| what | qinit | peer | | times faster |")
    print("| --- | ---: | ---: | --- | ---: |")
    for one in found:
        case = one.case.partition(",")[0] if "sources" in one.case else f"Q* of {one.case}"
        spread = f"{one.ratio:.3g} ({one.ratio_low:.3g} to {one.ratio_high:.3g})"
        print(f"| {case} | {_told(one.qinit_rate)} | {_told(one.peer_rate)} | {one.peer} | {spread} |")


def ratios(qinit: str, repeat: int) -> list[Ratio]:
    """One for each peer."""
    for peer in PEERS:
        peer.run()  # compiles
    turns = [(_qinit(qinit), [_rate(peer) for peer in PEERS]) for _ in range(repeat)]
    found = []
    for place, peer in enumerate(PEERS):
        ours = [rates[peer.case] for rates, _ in turns]
        theirs = [rates[place] for _, rates in turns]
        quotients = [mine / their for mine, their in zip(ours, theirs, strict=True)]
        found.append(
            Ratio(
                case=peer.case,
                peer=peer.name,
                qinit_rate=median(ours),
                peer_rate=median(theirs),
                ratio=median(quotients),
                ratio_low=min(quotients),
                ratio_high=max(quotients),
                turns=repeat,
            )
        )
    return found


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
    main()
