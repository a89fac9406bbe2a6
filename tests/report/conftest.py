"""A browser, and the pages that it opens: of artefacts, of a reproduction, and one with hostile words in it."""

from __future__ import annotations

import io
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--no-sandbox",  # of a browser that root starts, and that sees our own pages alone
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE = 120_000  # milliseconds: a busy machine takes its time to start a browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Debian's Chromium without a window. Where it is missing, tests are left out; in CI they fail."""
    chromium = shutil.which("chromium")
    if chromium is None:
        lacking = "there is no chromium here; .ci/install-chromium installs it"
        pytest.fail(lacking) if os.environ.get("CI") else pytest.skip(lacking)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=chromium, args=list(FLAGS), timeout=PATIENCE)
        yield opened
        opened.close()


@pytest.fixture
def opened(browser: Any) -> Iterator[Callable[..., Any]]:
    """A page of ours as a browser shows it: `opened(path, width=360, color_scheme="dark")`.

    Whatever it asks for and whatever its console says is in `page.asked` and `page.said`.
    """
    contexts = []

    def call(path: Path, width: int = 1280, **settings: Any) -> Any:
        context = browser.new_context(viewport={"width": width, "height": 800}, **settings)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.asked, page.said = [], []
        page.on("request", lambda request: page.asked.append(request.url))
        page.on("console", lambda message: page.said.append(message.text))
        page.on("pageerror", lambda error: page.said.append(str(error)))
        page.goto(path.as_uri(), wait_until="load")
        return page

    yield call
    for context in contexts:
        context.close()


@pytest.fixture(scope="session")
def reproduction(pipeline: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A reproduction's folder; look, do not touch."""
    return _reproduction(tmp_path_factory.mktemp("reproduced") / "reproduction", _runs(pipeline))


@pytest.fixture(scope="module")
def pages(
    pipeline: Any, hostile_run: Path, reproduction: Path, tmp_path_factory: pytest.TempPathFactory
) -> Mapping[str, Path]:
    """Pages as `qinit report` writes them."""
    from qinit_cli.app import run

    folder = tmp_path_factory.mktemp("pages")
    given = {
        "artefacts": [pipeline.sources, pipeline.fit, *_runs(pipeline)],
        "reproduction": [reproduction],
        "hostile": [pipeline.runs["zero"], hostile_run],
    }
    found = {}
    for name, paths in given.items():
        found[name] = folder / f"{name}.html"
        assert run(["report", *map(str, paths), "-o", str(found[name]), "--quiet"]) == 0
    return found


def _runs(pipeline: Any) -> list[Path]:
    return [pipeline.runs[name] for name in ("zero", "logqinit-median", "ops-tl")]


def _reproduction(folder: Path, runs: list[Path]) -> Path:
    """A reproduction's folder with one picture, one table, and a verdict of each answer."""
    from qinit_store.reading import describe

    folder.mkdir()
    (folder / "fig6-a.svg").write_text(_picture())
    (folder / "table.json").write_text(json.dumps(_compared(runs)))
    (folder / "verdicts.json").write_text(json.dumps({"schema": "qinit.verdicts/1", "rows": _verdicts()}))
    figure = {
        "name": "fig6",
        "file": "fig6-a.svg",
        "title": "Learning curves",
        "caption": "Of lines.",
        "alt": "Up.",
    }
    manifest = {
        "schema": "qinit.reproduction/1",
        "command": "qinit reproduce fig6",
        "scale": "quick",
        "target": "fig6",
        "source_sets": 1,
        "complete": True,
        "stages": [{"stage": "runs", "made": 3, "seconds": 12.0, "steps": 10}],
        "started": "2026-01-02T03:04:05Z",
        "seconds": 12.5,
        "artefacts": [
            {
                "role": "run",
                "path": str(path),
                "content_sha256": describe(path).content_sha256,
                "command": "qinit transfer",
                "seconds": 1.0,
            }
            for path in runs
        ],
        "figures": [figure],
        "tables": [{"name": "fig6", "file": "table.json", "title": "Methods on variance 2"}],
        "verdicts": "verdicts.json",
    }
    (folder / "reproduction.json").write_text(json.dumps(manifest))
    return folder


def _picture() -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 2))
    figure.add_subplot().plot([1, 2, 3])
    image = io.BytesIO()
    figure.savefig(image, format="svg")
    return image.getvalue().decode()


def _compared(runs: list[Path]) -> dict[str, Any]:
    from qinit_cli.comparison.rows import compare
    from qinit_cli.comparison.runs import read_runs
    from qinit_cli.comparison.table import told

    return told(compare(read_runs(runs), "zero", "return"), "return")


def _verdicts() -> list[dict[str, Any]]:
    detail = {"label": "variance 7", "value": -0.5, "low": None, "high": None, "sets": 1, "holds": False}
    return [
        {
            "claim": f"C{number}",
            "statement": "What the paper says, in a sentence.",
            "source": "section 7.1",
            "verdict": answer,
            "statistic": "a rank correlation",
            "value": 0.5,
            "low": 0.25,
            "high": 0.75,
            "sets": 10,
            "depends_on": "gamma" if answer == "depends" else "",
            "sentence": "What was found, in another sentence that is somewhat longer than the first.",
            "details": [detail],
        }
        for number, answer in enumerate(("holds", "does not hold", "depends", "not judged"), 1)
    ]
