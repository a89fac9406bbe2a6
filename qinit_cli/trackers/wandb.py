"""Runs of Weights & Biases, kept here: `wandb sync` sends them."""

from __future__ import annotations

from pathlib import Path

from qinit_cli.trackers.run_record import Logged, RunRecord, package

ID_DIGITS = 16  # of the content hash: the same run has the same id wherever it is sent from


def log(record: RunRecord, project: str, where: str | None) -> Logged:
    """An offline run in WHERE/wandb, by default of the current folder. Nothing is sent, and nothing of this machine recorded."""
    [wandb] = package("wandb")
    folder, id = Path(where or "."), record.content_sha256[:ID_DIGITS]
    if there := sorted(folder.glob(f"wandb/offline-run-*-{id}")):
        return Logged(str(there[-1]), False)
    folder.mkdir(parents=True, exist_ok=True)
    run = wandb.init(
        mode="offline",
        project=project,
        dir=folder,
        id=id,
        name=record.name,
        tags=["qinit", record.method],
        config={"content_sha256": record.content_sha256, **record.parameters},
        reinit="create_new",
        settings=wandb.Settings(
            silent=True,
            console="off",
            disable_git=True,
            disable_code=True,
            x_disable_meta=True,
            x_disable_stats=True,
            x_save_requirements=False,
        ),
    )
    with run:
        for step, numbers in record.steps():
            run.log(numbers, step=step)
        run.summary.update(record.summary)
        place = Path(run.dir).parent
    return Logged(str(place), True)
