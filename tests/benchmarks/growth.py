"""How time and memory of whole commands grow, in markdown: python tests/benchmarks/growth.py [--plot FILE].

Each row is a command whose one number is raised: processor and wall seconds, and the largest memory that was resident. An
exponent k is that of the curve a + b n^k which fits the logarithms of a command's costs best, n being what work is
proportional to (of a grid its cells): a is what starting costs, and 1 is linear growth.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

QINIT = (sys.executable, "-m", "qinit_cli")
STEEPEST = 4.0  # of the exponents that are looked for


@dataclass(frozen=True)
class Growth:
    """A number that is raised, and the commands that it is an option of; `-` stands for what the command before made."""

    title: str
    numbers: Sequence[int]
    commands: Sequence[str]
    power: int = 1  # of the number that work is proportional to


@dataclass(frozen=True)
class Cost:
    """What one command took: processor and wall seconds, megabytes at most."""

    growth: Growth
    command: str
    number: int
    processor: float
    wall: float
    memory: float


EXACT = "train-sources gridworld --learner exact --jobs 1"
LEARNED = "train-sources gridworld --jobs 1"
TARGETS = "transfer logqinit-median -"
GROWTHS = (
    Growth("tasks, exact", (10, 30, 100, 300, 1000, 3000, 10_000), (EXACT + " --tasks {}", "fit -")),
    Growth("tasks, learned", (10, 30, 100, 300, 1000), (LEARNED + " --episodes 3000 --tasks {}", "fit -")),
    Growth("target tasks", (10, 100, 1000, 10_000), (EXACT, "fit -", TARGETS + " --jobs 1 --tasks {}")),
    Growth(
        "side of the grid",
        (10, 30, 100, 200, 300),
        (EXACT + " --tasks 4 --size {}", "fit -", TARGETS + " --tasks 4 --episodes 20 --jobs 1"),
        power=2,
    ),
    Growth(
        "episodes", (10_000, 30_000, 100_000, 300_000, 1_000_000), (LEARNED + " --tasks 16 --episodes {}",)
    ),
    Growth("jobs, gridworld", (1, 2), ("train-sources gridworld --jobs {}",)),
    Growth(
        "jobs, mountain-car", (1, 2), ("train-sources mountain-car --tasks 32 --episodes 100000 --jobs {}",)
    ),
)


def main() -> None:
    """Prints a row for each command and number, and the exponents; draws them where asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--most", type=int, help="leave out numbers above this")
    parser.add_argument("--only", help="the growths whose titles have this in them")
    parser.add_argument("--plot", type=Path, help="draw the costs and the curves fitted: a PNG, SVG or PDF")
    asked = parser.parse_args()
    print(
        "| what grows | command | number | CPU s | wall s | MB |\n| --- | --- | ---: | ---: | ---: | ---: |"
    )
    costs = []
    for growth in GROWTHS:
        for number in growth.numbers:
            if (asked.only or "") in growth.title and (asked.most is None or number <= asked.most):
                for cost in _costs(growth, number):
                    print(
                        f"| {growth.title} | {cost.command} | {number} | {cost.processor:.2f} | {cost.wall:.2f} "
                        f"| {cost.memory:.0f} |",
                        flush=True,
                    )
                    costs.append(cost)
    print("\n| what grows | command | exponent of time | of memory |\n| --- | --- | ---: | ---: |")
    for line in _lines(costs):
        if len(line) > 2:
            time_curve, memory_curve = (_curve(line, what) for what in ("processor", "memory"))
            print(
                f"| {line[0].growth.title} | {line[0].command} | {_said(time_curve)} | {_said(memory_curve)} |"
            )
    if asked.plot:
        _draw(costs, asked.plot)


def _lines(costs: Sequence[Cost]) -> list[list[Cost]]:
    """The costs of each command that has the raised number in it or reads what such a one made."""
    grown = sorted(costs, key=lambda cost: (GROWTHS.index(cost.growth), cost.command))
    return [list(line) for _, line in groupby(grown, key=lambda cost: (cost.growth.title, cost.command))]


def _costs(growth: Growth, number: int) -> list[Cost]:
    """What each command costs that the number changes."""
    found = []
    with tempfile.TemporaryDirectory() as store:
        reference, grows = "none", False
        for command in growth.commands:
            grows |= "{}" in command
            words = [reference if word == "-" else word for word in command.format(number).split()]
            began = time.perf_counter()
            process = subprocess.Popen(
                [*QINIT, *words, "--quiet", "--store", store], stdout=subprocess.PIPE, text=True
            )
            assert process.stdout is not None
            reference = process.stdout.read().strip()
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = status
            if status:
                raise SystemExit(f"qinit {' '.join(words)} failed")
            if grows:
                name = " ".join(command.split()[: 1 if command.startswith("fit") else 2])
                spent = used.ru_utime + used.ru_stime
                wall = time.perf_counter() - began
                found.append(Cost(growth, name, number, spent, wall, used.ru_maxrss / 1024))
    return found


def _curve(line: Sequence[Cost], what: str) -> tuple[float, float, float]:
    """a, b and k of a + b n^k, by least squares of the logarithms; k is NaN where the most is not a tenth above the least."""
    work = np.array([cost.number**cost.growth.power for cost in line], dtype=float)
    cost = np.array([getattr(one, what) for one in line])
    if cost.max() < 1.1 * cost.min():
        return float(cost.mean()), 0.0, math.nan
    work_most = work.max()

    def misses(parameters: Any) -> Any:
        start, rise, exponent = parameters
        return np.log(np.exp(start) + np.exp(rise) * (work / work_most) ** exponent) - np.log(cost)

    first = (math.log(cost.min()), math.log(cost.max()), 1.0)
    bounds = ([-np.inf, -np.inf, 0.0], [math.log(cost.min()) + 0.1, np.inf, STEEPEST])
    start, rise, exponent = least_squares(misses, first, bounds=bounds).x
    return float(np.exp(start)), float(np.exp(rise) / work_most**exponent), float(exponent)


def _said(curve: tuple[float, float, float]) -> str:
    return "does not grow" if math.isnan(curve[2]) else f"{curve[2]:.2f}"


def _draw(costs: Sequence[Cost], path: Path) -> None:
    """A column for each number that is raised, time above memory, both in logarithms."""
    from matplotlib import pyplot

    lines = [line for line in _lines(costs) if len(line) > 2]
    titles = list(dict.fromkeys(line[0].growth.title for line in lines))
    commands = list(dict.fromkeys(line[0].command for line in lines))
    figure, axes = pyplot.subplots(
        2,
        len(titles),
        figsize=(2.2 * len(titles), 4.4),
        sharex="col",
        sharey="row",
        layout="constrained",
        squeeze=False,
    )
    for line in lines:
        column = titles.index(line[0].growth.title)
        colour = f"C{commands.index(line[0].command)}"
        numbers = np.array([cost.number for cost in line], dtype=float)
        between = np.geomspace(numbers[0], numbers[-1], 60)
        for row, what in enumerate(("processor", "memory")):
            start, rise, exponent = _curve(line, what)
            power = line[0].growth.power
            drawn = start + rise * between ** (power * exponent) if rise else np.full_like(between, start)
            axes[row, column].loglog(between, drawn, color=colour, linewidth=0.8)
            axes[row, column].loglog(
                numbers,
                [getattr(cost, what) for cost in line],
                "o",
                color=colour,
                markersize=4,
                label=line[0].command,
            )
        axes[1, column].set_xlabel(line[0].growth.title)
    axes[0, 0].set_ylabel("processor seconds")
    axes[1, 0].set_ylabel("largest memory, MB")
    named = {
        label: mark for one in axes[0] for mark, label in zip(*one.get_legend_handles_labels(), strict=True)
    }
    figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=len(named), frameon=False)
    for one in axes.flat:
        one.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
