"""What is stored or printed is the same on every processor: no sum is left to BLAS, no logarithm to numpy's vector units."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli import elementary
from qinit_cli.analysis.weighted_sums import weighted_sums

PACKAGE = Path(elementary.__file__).parent
# pictures are drawn by matplotlib, which makes no such promise, and benchmarks print times
EXEMPT = ("plots", "benchmarks")
COMPARES_ALONE = Path("artefacts/fit_values.py")  # within 1e-6, and keeps nothing
BY_SCIPY = Path(
    "projection.py"
)  # starts by tiles, whose norms scipy leaves to BLAS: docs/continuous.md tells their limits
# shares of variance by least squares: printed to nine places, and no artefact keeps them
BY_LEAST_SQUARES = Path("analysis/variance_shares.py")
BLAS = {
    "convolve", "corrcoef", "correlate", "cov", "dot", "inner", "linalg", "matmul", "tensordot", "vdot", "vecdot"
}  # fmt: skip
# numpy has versions of these for AVX-512 alone whose last bits differ
VECTORISED = {
    "arccos", "arccosh", "arcsin", "arcsinh", "arctan", "arctan2", "arctanh", "cbrt", "cos", "cosh", "exp", "exp2", "expm1",
    "log", "log10", "log1p", "log2", "power", "sin", "sinh", "tan", "tanh",
}  # fmt: skip
FILES = sorted(
    path
    for path in PACKAGE.rglob("*.py")
    if (inside := path.relative_to(PACKAGE)).parts[0] not in EXEMPT
    and inside not in (COMPARES_ALONE, BY_SCIPY, BY_LEAST_SQUARES)
)


def _suspects(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.BinOp(op=ast.MatMult()) | ast.AugAssign(op=ast.MatMult()):
                yield f"line {node.lineno}: @"
            case ast.Attribute(value=ast.Name(id="np"), attr=name) if name in BLAS | VECTORISED:
                yield f"line {node.lineno}: np.{name}"
            case ast.Attribute(attr="dot"):
                yield f"line {node.lineno}: .dot"
            case ast.Call(func=ast.Attribute(attr="einsum"), keywords=keywords):
                if not any(
                    word.arg == "optimize"
                    and isinstance(word.value, ast.Constant)
                    and word.value.value is False
                    for word in keywords
                ):
                    yield f"line {node.lineno}: einsum without optimize=False"


def test_no_number_is_left_to_what_differs_by_processor() -> None:
    found = {str(path): list(_suspects(ast.parse(path.read_text()))) for path in FILES}
    assert len(found) > 100
    assert not {path: suspects for path, suspects in found.items() if suspects}


@pytest.mark.parametrize("columns", [1, 5, 40])
def test_weighted_sums_are_the_matrix_product(columns: int) -> None:
    rng = np.random.default_rng(0)
    counts, values = rng.integers(0, 4, (30, 70)), rng.normal(size=(70, columns))
    np.testing.assert_allclose(weighted_sums(counts, values), counts @ values, rtol=1e-12, atol=1e-12)


def test_the_elementary_functions_are_those_of_the_c_library() -> None:
    import math

    rng = np.random.default_rng(1)
    x = np.append(rng.uniform(0, 3, 2_000), [1e-300, 1.0])
    assert elementary.ln(x).tolist() == [math.log(value) for value in x]
    assert elementary.exp(x).tolist() == [math.exp(value) for value in x]
    assert elementary.power(0.95, x).tolist() == [math.pow(0.95, value) for value in x]
    np.testing.assert_allclose(
        elementary.ln1p(-x[x < 1]), [math.log1p(-value) for value in x[x < 1]], rtol=1e-15
    )
    assert elementary.ln(np.array([0.0])).tolist() == [-math.inf]
    assert elementary.exp(np.array([-math.inf, 1e4])).tolist() == [0.0, math.inf]


PROGRAM = """
import sys
from qinit_cli.app import run
sources, folder, *runs = sys.argv[1:]
assert run(["fit", sources, "-o", folder + "/fit.h5", "--alternatives", "--json", "-q"]) == 0
for metric in ("return", "steps"):
    assert run(["compare", *runs, "--metric", metric, "--json", "-q"]) == 0
"""


def test_a_fit_and_a_comparison_are_the_same_bits_on_two_kinds_of_processor(
    here: Callable[..., Any], tmp_path: Path
) -> None:
    grid = ("gridworld", "--size", "6", "--variance", "2", "--learner", "exact", "--tasks", "12")
    assert here("train-sources", *grid, "-o", "s.h5").code == 0
    assert here("fit", "s.h5", "-o", "f.h5", "--normality", "none").code == 0
    methods = ("zero", "mean", "ucoi", "logqinit-median")
    for method in methods:
        target = ("--tasks", "30", "--episodes", "40", "-o", f"{method}.h5")
        assert here("transfer", method, "f.h5", *target).code == 0
    runs = [str(tmp_path / f"{method}.h5") for method in methods]

    found = []
    for core in ("Nehalem", "Haswell"):
        folder = tmp_path / core
        folder.mkdir()
        ended = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(tmp_path / "s.h5"), str(folder), *runs],
            capture_output=True,
            text=True,
            env=os.environ | {"OPENBLAS_CORETYPE": core},
            timeout=120,
        )
        assert ended.returncode == 0, ended.stderr
        fit, *comparisons = ended.stdout.splitlines()
        found.append((json.loads(fit)["digest"], comparisons))
    assert found[0] == found[1]
