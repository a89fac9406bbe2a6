"""Runs of Weights & Biases, kept here: `wandb sync` sends them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from qinit_cli.trackers.run_record import Logged, RunRecord, package
from qinit_store.errors import SystemFailed

ID_DIGITS = 16  # of a hash: the same run of a project has the same id wherever it is sent from


def log(record: RunRecord, project: str, where: str | None) -> Logged:
    """An offline run in WHERE/wandb, by default of the current folder. Nothing is sent, and nothing of this machine recorded."""
    wandb, errors = package("wandb", "errors")
    kept = Path(where or ".") / "wandb"
    id = hashlib.sha256(f"{project}/{record.content_sha256}".encode()).hexdigest()[:ID_DIGITS]
    if there := sorted(kept.glob(f"offline-run-*-{id}")):
        return Logged(str(there[-1]), False)
    kept.mkdir(parents=True, exist_ok=True)
    # made elsewhere and moved: what was interrupted does not pass for a run
    with TemporaryDirectory(prefix=".", suffix=".part", dir=kept, ignore_cleanup_errors=True) as beside:
        try:
            made = _made(wandb, record, project, beside, id)
        except errors.Error as error:
            raise SystemFailed(f"wandb did not take {record.name}: {error}") from error
        return Logged(str(made.rename(kept / made.name)), True)


def _made(wandb: Any, record: RunRecord, project: str, folder: str, id: str) -> Path:
    """The folder of a finished offline run."""
    settings = wandb.Settings(
        silent=True,
        console="off",
        disable_git=True,
        disable_code=True,
        x_disable_meta=True,
        x_disable_stats=True,
        x_save_requirements=False,
    )
    with wandb.init(
        mode="offline",
        project=project,
        dir=folder,
        id=id,
        name=record.name,
        tags=["qinit", record.method],
        config={"content_sha256": record.content_sha256, **record.parameters},
        reinit="create_new",
        settings=settings,
    ) as run:
        for step, numbers in record.steps():
            run.log(numbers, step=step)
        run.summary.update(record.summary)
        return Path(run.dir).parent
