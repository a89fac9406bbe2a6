"""Drawing by the command line, and catching the picture before it is saved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def drawn(here: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """The matplotlib figure of one picture: `drawn("bars", run, "--metric", "steps")`; it is saved as well."""
    from qinit_cli.plots.drawn import Drawn

    save = Drawn.save

    def draw(picture: str, *arguments: object) -> Any:
        figures: list[Any] = []

        def caught(picture: Drawn, path: Path) -> None:
            figures.append(picture.figure)
            save(picture, path)

        monkeypatch.setattr(Drawn, "save", caught)
        ended = here("plot", picture, *arguments, "-o", tmp_path / "picture.png", "--force")
        assert ended.code == 0, ended.err
        assert ended.out == f"{tmp_path / 'picture.png'}\n"
        [figure] = figures
        return figure

    return draw


@pytest.fixture
def refused(here: Callable[..., Any], tmp_path: Path) -> Callable[..., tuple[int, str]]:
    """Exit code and sentence of a picture that cannot be drawn; nothing is written."""

    def draw(picture: str, *arguments: object) -> tuple[int, str]:
        ended = here("plot", picture, *arguments, "-o", tmp_path / "picture.png")
        assert ended.out == ""
        assert not list(tmp_path.glob("*picture*"))
        assert ended.err.count("\n") == 1
        return ended.code, ended.err

    return draw


@pytest.fixture
def uniform(here: Callable[..., Any], tmp_path: Path) -> Path:
    """A fit of another distribution on the same grid."""
    store = ("--store", tmp_path / "store", "-q")
    family = ("gridworld", "--size", 6, "--goals", "uniform", "--tasks", 4, "--learner", "exact")
    fit: Path = here("fit", here("train-sources", *family, *store).path, *store).path
    return fit
