"""The numbers of every kind of artefact, as bits: content hashes that no change to the code may move unless it means to.

A hash that is changed on purpose is changed here, in the commit that says why.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from running import run_here

GRID = ("--size", "6", "--variance", "2", "--tasks", "9", "--episodes", "300")
CAR = ("--tasks", "3", "--episodes", "2000", "--bins", "8")
TARGETS = ("--tasks", "5", "--episodes", "80")

# what is made -> the words that make it, "{name}" being an artefact made before
COMMANDS = {
    "grid": ("train-sources", "gridworld", *GRID),
    "grid-exact": ("train-sources", "gridworld", *GRID[:4], "--tasks", "12", "--learner", "exact"),
    "grid-uniform": (
        "train-sources",
        "gridworld",
        "--size",
        "6",
        "--goals",
        "uniform",
        "--tasks",
        "5",
        "--learner",
        "exact",
    ),
    "windy": ("train-sources", "windy-gridworld", "--size", "6", "--tasks", "5", "--episodes", "300"),
    "mixture": (
        "train-sources",
        "mixture-gridworld",
        "--size",
        "8",
        "--means",
        "2:2,5:5",
        "--tasks",
        "5",
        "--episodes",
        "300",
    ),
    "car": ("train-sources", "mountain-car", *CAR),
    "lake": (
        "train-sources",
        "gym",
        "FrozenLake-v1",
        "--vary",
        "success_rate=uniform:0.4,0.9",
        "--tasks",
        "4",
        "--episodes",
        "500",
    ),
    "lake-exact": (
        "train-sources",
        "gym",
        "FrozenLake-v1",
        "--vary",
        "success_rate=uniform:0.4,0.9",
        "--tasks",
        "4",
        "--learner",
        "exact",
    ),
    "pole": (
        "train-sources",
        "gym",
        "CartPole-v1",
        "--goal",
        "survived",
        "--horizon",
        "30",
        "--bins",
        "1,4,6,4",
        "--range",
        "1=-2:2",
        "--range",
        "3=-2:2",
        "--vary",
        "gravity=normal:9.8,2",
        "--tasks",
        "2",
        "--episodes",
        "100",
    ),
    "fit": ("fit", "{grid}"),
    "fit-umvue": ("fit", "{grid}", "--estimator", "umvue", "--library", "4"),
    "fit-theory": ("fit", "{grid-exact}", "--check-theory", "--holdout", "3"),
    "car-fit": ("fit", "{car}"),
    "lake-fit": ("fit", "{lake-exact}"),
    **{
        f"run-{method}": ("transfer", method, "{fit}", *TARGETS)
        for method in (
            "zero",
            "mean",
            "maxqinit",
            "ucoi",
            "logqinit-median",
            "logqinit-mean",
            "logqinit-quantile",
            "optimal",
            "ptrs",
            "drs",
            "ops-tl",
            "posterior",
        )
    },
    "run-ptrs-plus": ("transfer", "ptrs", "{fit}", *TARGETS, "--init", "logqinit-median"),
    "run-shifted": (
        "transfer",
        "logqinit-median",
        "{fit}",
        *TARGETS,
        "--shift",
        "p_low=0.8",
        "--keep-q",
        "--evaluate-every",
        "20",
    ),
    "run-umvue": ("transfer", "logqinit-mean", "{fit-umvue}", *TARGETS),
    **{
        f"car-run-{method}": ("transfer", method, "{car-fit}", *TARGETS)
        for method in ("zero", "logqinit-median", "optimal", "ptrs", "drs", "ops-tl", "posterior")
    },
    "lake-run": ("transfer", "posterior", "{lake-fit}", *TARGETS),
    "lifelong": ("lifelong", "logqinit-median", "{grid-exact}", *TARGETS, "--update"),
    "tuning": ("tune", "ucoi", "{grid-exact}", "--kappa", "1,3", "--episodes", "20"),
}
HASHES = {  # the first 16 digits
    "grid": "97ca2f036700322a",
    "grid-exact": "5b4f9ff1d4498a9d",
    "grid-uniform": "37ca39bc9f76ccc5",
    "windy": "6dfb8d8a8138f922",
    "mixture": "4de9c9a72103e2ee",
    "car": "4374e3e2cf604caa",
    "lake": "5968d319daa95af2",
    "lake-exact": "58707ede5a15038d",
    "pole": "c8d73f281abe30bb",
    "fit": "58bddfb31f0d4967",
    "fit-umvue": "3c7876007d6f0d66",
    "fit-theory": "d333e572e6f36c15",
    "car-fit": "17fc227c41fe4acc",
    "lake-fit": "cf8b35eff49c2d9a",
    "run-zero": "b8294f9052b5805e",
    "run-mean": "26ba737c8ec87d25",
    "run-maxqinit": "1cf9bf0a35b02c26",
    "run-ucoi": "6d1da0a210ca5889",
    "run-logqinit-median": "68818b01cdaece81",
    "run-logqinit-mean": "21c27428f8aaaeee",
    "run-logqinit-quantile": "74bdf8abb2be9f5d",
    "run-optimal": "b9378563a694579d",
    "run-ptrs": "ea6bc8453eae8f85",
    "run-drs": "39ab6bcaa0c25067",
    "run-ops-tl": "a4b263f7bca9cbf7",
    "run-posterior": "bc7501b7cf1816f0",
    "run-ptrs-plus": "f6379034865aa503",
    "run-shifted": "edd39431693d4b41",
    "run-umvue": "950b143c8af28828",
    "car-run-zero": "0a3e03437d2c6327",
    "car-run-logqinit-median": "4712b847477a0a68",
    "car-run-optimal": "6291896eaec31f09",
    "car-run-ptrs": "098f19c272ac19e7",
    "car-run-drs": "7f29148b2b9379e2",
    "car-run-ops-tl": "994ea89f101de0d6",
    "car-run-posterior": "83d08c61055e7cfb",
    "lake-run": "5f9fb766ebfb78ac",
    "lifelong": "0dc21976f22719e9",
    "tuning": "f36b5613e0d9f218",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The content hash of all of them, made in the order in which they are listed."""
    folder, found = tmp_path_factory.mktemp("hashes"), {}
    for name, words in COMMANDS.items():
        filled = [word.format_map(_Paths(folder)) for word in words]
        ended = run_here([*filled, "-o", str(folder / f"{name}.h5"), "--store", str(folder), "--json", "-q"])
        assert ended.code in (0, 3), (name, ended.err)
        found[name] = ended.json["digest"]
    return found


class _Paths(dict[str, str]):
    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __missing__(self, name: str) -> str:
        return str(self.folder / f"{name}.h5")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_numbers_are_the_same_bits_as_ever(made: dict[str, str], name: str) -> None:
    assert made[name][:16] == HASHES[name]
