"""`qinit`, but every finished batch is saved at once, and after the first one no more is begun before the signal comes.

Whoever watches the folder then meets a process with saved and missing tasks, on any machine: at most the batches that were
in flight are saved besides. With EAGER_UNTIL in the environment learning also goes on once a file of that name exists.

python eager.py train-sources gridworld -o a.h5
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from qinit_cli.__main__ import main
from qinit_cli.pipeline import cluster, job, workers

PATIENCE = 0.005  # seconds between two looks
usual = workers.results


def results(
    executor: Any,
    jobs: Callable[[], int],
    learn: Any,
    waiting: Any,
    stopped: Callable[[], bool],
    tick: Callable[[], None],
) -> Iterator[Any]:
    """As it is, but that it waits once the first result was saved."""
    until = os.environ.get("EAGER_UNTIL")
    for result in usual(executor, jobs, learn, waiting, stopped, tick):
        yield result  # it is saved when the next one is asked for
        while not (stopped() or (until and Path(until).exists())):
            time.sleep(PATIENCE)


if __name__ == "__main__":
    job.SAVE_SECONDS = 0.0
    for module in (workers, cluster):
        setattr(module, usual.__name__, results)
    main()
