"""How time and memory of whole commands grow, in markdown: python tests/benchmarks/growth.py.

Each row is a command whose one number is raised; time is processor seconds, memory the largest that was resident. An
exponent is the slope between the two largest runs of what is above the cheapest run's cost, in logarithms: 1 is linear in
the number, for states in its square.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass

QINIT = (sys.executable, "-m", "qinit_cli")


@dataclass(frozen=True)
class Growth:
    """A number that is raised, and the commands that it is an option of; `-` stands for what the command before made."""

    title: str
    numbers: Sequence[int]
    commands: Sequence[str]
    power: int = 1  # of the number that work is proportional to


EXACT = "train-sources gridworld --learner exact --jobs 1"
LEARNED = "train-sources gridworld --jobs 1"
GROWTHS = (
    Growth("tasks, exact", (10, 30, 100, 300, 1000, 3000), (EXACT + " --tasks {}", "fit -")),
    Growth("tasks, learned", (10, 30, 100, 300), (LEARNED + " --episodes 3000 --tasks {}", "fit -")),
    Growth(
        "states, side of the grid",
        (10, 30, 100, 300),
        (
            EXACT + " --tasks 4 --size {}",
            "fit -",
            "transfer logqinit-median - --tasks 4 --episodes 20 --jobs 1",
        ),
        power=2,
    ),
    Growth("episodes", (10_000, 30_000, 100_000, 300_000), (LEARNED + " --tasks 16 --episodes {}",)),
    Growth("jobs", (1, 2), ("train-sources gridworld --tasks 64 --episodes 10000 --jobs {}",)),
)


def main() -> None:
    """Prints a row for each command and number, and the exponents."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--most", type=int, help="leave out numbers above this")
    most = parser.parse_args().most
    print("| what grows | command | number | CPU s | MB |\n| --- | --- | ---: | ---: | ---: |")
    exponents = []
    for growth in GROWTHS:
        numbers = [number for number in growth.numbers if most is None or number <= most]
        costs = [_costs(growth, number) for number in numbers]
        for place, command in enumerate(growth.commands):
            name = " ".join(command.split()[: 1 if command.startswith("fit") else 2])
            for number, cost in zip(numbers, costs, strict=True):
                seconds, megabytes = cost[place]
                print(f"| {growth.title} | {name} | {number} | {seconds:.2f} | {megabytes:.0f} |", flush=True)
            if len(numbers) > 2:
                seconds_slope = _slope(numbers, [cost[place][0] for cost in costs], growth.power)
                memory_slope = _slope(numbers, [cost[place][1] for cost in costs], growth.power)
                exponents.append(f"| {growth.title} | {name} | {seconds_slope:.2f} | {memory_slope:.2f} |")
    print("\n| what grows | command | exponent of time | of memory |\n| --- | --- | ---: | ---: |")
    print("\n".join(exponents))


def _costs(growth: Growth, number: int) -> list[tuple[float, float]]:
    """Processor seconds and largest megabytes of each command."""
    found = []
    with tempfile.TemporaryDirectory() as store:
        reference = "none"
        for command in growth.commands:
            words = [reference if word == "-" else word for word in command.format(number).split()]
            process = subprocess.Popen(
                [*QINIT, *words, "--quiet", "--store", store], stdout=subprocess.PIPE, text=True
            )
            assert process.stdout is not None
            reference = process.stdout.read().strip()
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = status
            if status:
                raise SystemExit(f"qinit {' '.join(words)} failed")
            found.append((used.ru_utime + used.ru_stime, used.ru_maxrss / 1024))
    return found


def _slope(numbers: Sequence[int], costs: Sequence[float], power: int) -> float:
    """The exponent between the two largest numbers of what the cheapest run did not cost already; NaN if nothing grew."""
    before, last = (cost - min(costs) for cost in costs[-2:])
    if before <= 0 or last <= 0:
        return math.nan
    return math.log(last / before) / math.log(numbers[-1] / numbers[-2]) / power


if __name__ == "__main__":
    main()
