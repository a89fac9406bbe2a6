"""Imports point one way: app, commands, pipeline, artefacts, methods, environments, kernels; qinit_cli -> qinit_store."""

from __future__ import annotations

import ast
import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from running import Pipeline

ROOT = Path(__file__).parents[1]
OURS = {"qinit_cli": ROOT, "qinit_store": ROOT / "store"}  # package -> the folder it stands in
HEAVY = {"numpy", "scipy", "h5py", "numba", "matplotlib", "pandas", "dask"}
# from the top; a file imports from its own layer and those below; beneath all are the other files beside the packages
LAYERS = (
    ("qinit_cli.__main__",),
    ("qinit_cli.app",),
    ("qinit_cli.commands",),
    ("qinit_cli.study",),
    ("qinit_cli.report", "qinit_cli.paper"),
    ("qinit_cli.plots", "qinit_cli.trackers"),
    ("qinit_cli.library",),
    ("qinit_cli.pipeline", "qinit_cli.comparison"),
    ("qinit_cli.artefacts",),
    ("qinit_cli.tasks",),
    ("qinit_cli.methods",),
    ("qinit_cli.environments",),
    ("qinit_cli.task_files",),
    ("qinit_cli.kernels",),
)


def _modules() -> dict[str, Path]:
    found = {}
    for top, folder in OURS.items():
        for path in sorted((folder / top).rglob("*.py")):
            parts = path.relative_to(folder).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = _modules()


def _imported(tree: ast.AST, *, at_run_time: bool) -> Iterator[str]:
    """The absolute names that a tree imports; with `at_run_time` not those under TYPE_CHECKING."""
    for node in ast.iter_child_nodes(tree):
        if at_run_time and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"a relative import of {node.module}"
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in MODULES else str(node.module)
        yield from _imported(node, at_run_time=at_run_time)


@cache
def _parsed(module: str) -> ast.Module:
    """The module as it stands; look, do not touch."""
    return ast.parse(MODULES[module].read_text())


@cache
def _everything(module: str) -> frozenset[str]:
    return frozenset(_imported(_parsed(module), at_run_time=False))


@cache
def _but_for_types(module: str) -> frozenset[str]:
    return frozenset(_imported(_parsed(module), at_run_time=True))


@cache
def _when_loaded(module: str) -> frozenset[str]:
    """What importing the module imports at once: nothing inside functions, nothing for types alone."""
    tree = ast.parse(MODULES[module].read_text())  # its own, to change
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [ast.Pass()]
    return frozenset(_imported(tree, at_run_time=True))


def _under(module: str, packages: tuple[str, ...]) -> bool:
    return any(module == package or module.startswith(package + ".") for package in packages)


def _layer(module: str) -> int | None:
    beside = MODULES[module].parent == ROOT / "qinit_cli" and MODULES[module].name != "__init__.py"
    return next(
        (depth for depth, packages in enumerate(LAYERS) if _under(module, packages)),
        len(LAYERS) if beside else None,
    )


def test_the_modules_are_found() -> None:
    assert {"qinit_cli.app", "qinit_cli.kernels.gridworld", "qinit_store.work"} <= MODULES.keys()


@pytest.mark.parametrize("module", [module for module in MODULES if _layer(module) is not None])
def test_no_layer_imports_one_above_it(module: str) -> None:
    own = _layer(module)
    above = {
        name
        for name in _everything(module) & MODULES.keys()
        if (layer := _layer(name)) is not None and layer < own  # type: ignore[operator]
    }
    assert not above


@pytest.mark.parametrize("module", [module for module in MODULES if _under(module, ("qinit_store",))])
def test_the_store_imports_nothing_of_ours_and_numpy_and_h5py_alone(module: str) -> None:
    foreign = {
        name.partition(".")[0]
        for name in _everything(module)
        if name.partition(".")[0] not in sys.stdlib_module_names
    }
    assert foreign <= {"qinit_store", "numpy", "h5py"}


@pytest.mark.parametrize("module", [module for module in MODULES if _under(module, ("qinit_cli.kernels",))])
def test_kernels_import_no_layer_above_them_and_no_store(module: str) -> None:
    others = (
        "qinit_cli.app",
        "qinit_cli.commands",
        "qinit_cli.plots",
        "qinit_cli.pipeline",
        "qinit_cli.methods",
        "qinit_cli.environments",
        "qinit_cli.analysis",
        "qinit_store",
    )
    assert not {name for name in _everything(module) if _under(name, others)}


@pytest.mark.parametrize("module", [module for module in MODULES if _under(module, ("qinit_cli.analysis",))])
def test_analysis_knows_no_commands_stages_or_files(module: str) -> None:
    others = (
        "qinit_cli.app",
        "qinit_cli.commands",
        "qinit_cli.plots",
        "qinit_cli.pipeline",
        "qinit_store",
    )
    found = {name for name in _everything(module) if _under(name, others)}
    assert found <= {"qinit_store.wording"}  # which makes text printable, and knows no file


@pytest.mark.parametrize(
    "module", [module for module in MODULES if not _under(module, ("qinit_cli.app", "qinit_cli.commands"))]
)
def test_commands_and_typer_are_imported_by_commands_alone(module: str) -> None:
    wanted = {name for name in _everything(module) if _under(name, ("typer", "click", "qinit_cli.commands"))}
    assert not wanted


def test_matplotlib_is_imported_by_plots_alone() -> None:
    users = {
        module
        for module in MODULES
        if any(_under(name, ("matplotlib",)) for name in _but_for_types(module))
        and not _under(module, ("qinit_cli.plots",))
    }
    assert not users


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = {module: _when_loaded(module) & MODULES.keys() for module in MODULES}
    # a package's own file may name what is in it, whose import first loads the package: that is no circle
    finished: set[str] = set()

    def visit(module: str, trail: tuple[str, ...]) -> None:
        assert module not in trail, " -> ".join((*trail, module))
        if module in finished:
            return
        for following in graph[module]:
            visit(following, (*trail, module))
        finished.add(module)

    for module in graph:
        visit(module, ())


def _loaded_for_help() -> set[str]:
    """What the package, the commands, methods, families and the registry of plots load, and what that loads."""
    packages = ("qinit_cli.app", "qinit_cli.commands", "qinit_cli.methods", "qinit_cli.environments")
    found: set[str] = set()
    following = {
        module for module in MODULES if module in ("qinit_cli", "qinit_cli.plots") or _under(module, packages)
    }
    while following:
        found |= following
        following = {name for module in following for name in _when_loaded(module) & MODULES.keys()} - found
    return found


@pytest.mark.parametrize("module", sorted(_loaded_for_help()))
def test_what_help_needs_imports_nothing_heavy_when_loaded(module: str) -> None:
    assert not {name for name in _when_loaded(module) if name.partition(".")[0] in HEAVY}


def test_help_loads_every_plot_and_no_drawing() -> None:
    loaded = _loaded_for_help()
    assert {"qinit_cli.plots.curves", "qinit_cli.plots.heatmaps"} <= loaded
    assert not {"qinit_cli.plots.panels", "qinit_cli.plots.distributions"} & loaded


def test_numpy_is_imported_late_only_where_help_would_wait_for_it() -> None:
    late = {
        module
        for module in MODULES.keys() - _loaded_for_help()
        for function in ast.walk(_parsed(module))
        if isinstance(function, ast.FunctionDef) and "numpy" in set(_imported(function, at_run_time=True))
    }
    assert not late


def test_no_two_classes_share_a_name() -> None:
    where: dict[str, list[str]] = {}
    for module in MODULES:
        for node in ast.walk(_parsed(module)):
            if isinstance(node, ast.ClassDef):
                where.setdefault(node.name, []).append(module)
    assert {name: modules for name, modules in where.items() if len(modules) > 1} == {}


def test_every_module_can_be_the_first_one_imported() -> None:
    script = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    for loaded in [m for m in sys.modules if m.partition('.')[0] in ('qinit_cli', 'qinit_store')]:\n"
        "        del sys.modules[loaded]\n"
        "    importlib.import_module(name)\n"
    )
    modules = [module for module in MODULES if not module.startswith("qinit_cli.kernels")]
    assert all(importlib.util.find_spec(module) for module in modules)
    subprocess.run([sys.executable, "-c", script, *modules], check=True, timeout=300)


def _told_raw(tree: ast.AST) -> Iterator[int]:
    """The lines that pick a setting out of what the store keeps of them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            owner: ast.expr = node.value
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "get":
            owner = node.func.value
        else:
            continue
        if getattr(owner, "attr", getattr(owner, "id", "")) == "spec":
            yield node.lineno


def test_settings_are_read_by_their_dataclasses_alone() -> None:
    rooms = (name for name in MODULES if not name.startswith(("qinit_store", "qinit_cli.artefacts")))
    found = {f"{name}:{line}" for name in rooms for line in _told_raw(_parsed(name))}
    assert found == set()


@pytest.mark.parametrize(
    "line", ['artefact.spec["seed"]', 'spec.get("seed")', 'run.spec["learning"]["gamma"]']
)
def test_a_setting_that_is_picked_out_of_what_the_store_keeps_is_found(line: str) -> None:
    assert list(_told_raw(ast.parse(line))) == [1]


def test_a_transfer_loads_no_scipy_before_its_first_step(pipeline: Pipeline, tmp_path: Path) -> None:
    words = ["transfer", "zero", str(pipeline.fit), "--tasks", "2", "--episodes", "1", "-q", "-o", "run.h5"]
    script = f"import sys\nfrom qinit_cli.app import run\nassert run({words!r}) == 0\nprint('scipy.special' in sys.modules)"
    ended = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ended.stdout.splitlines()[-1] == "False"
