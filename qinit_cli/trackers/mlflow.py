"""Runs in MLflow's tracking store: a server, a database or a folder, as its tracking URI has it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from qinit_cli.trackers.run_record import Logged, RunRecord, package
from qinit_store.errors import SystemFailed

HASH = "qinit.content_sha256"  # the tag by which a run is found again
METRICS, PARAMETERS = 1000, 100  # at most these in one request


def log(record: RunRecord, project: str, where: str | None) -> Logged:
    """A run of the experiment `project` at the tracking URI `where`, by default MLflow's own."""
    mlflow, entities, exceptions = package("mlflow", "entities", "exceptions")
    try:
        return _log(mlflow.MlflowClient(where), entities, record, project)
    except exceptions.MlflowException as error:
        raise SystemFailed(f"MLflow did not take {record.name}: {error}") from error


def _log(client: Any, entities: Any, record: RunRecord, project: str) -> Logged:
    found = client.get_experiment_by_name(project)
    experiment = client.create_experiment(project) if found is None else found.experiment_id
    finished = f"tags.`{HASH}` = '{record.content_sha256}' and attributes.status = 'FINISHED'"
    if there := client.search_runs([experiment], finished, max_results=1):
        return Logged(there[0].info.run_id, False)
    milliseconds = int(record.time * 1000)
    tags = {HASH: record.content_sha256, "qinit.method": record.method}
    run = client.create_run(experiment, milliseconds, tags, record.name).info.run_id
    status = "KILLED"
    try:
        parameters = [entities.Param(name, str(value)) for name, value in record.parameters.items()]
        for some in _pieces(parameters, PARAMETERS):
            client.log_batch(run, params=some)
        last = len(next(iter(record.curves.values())))
        metrics = [
            entities.Metric(name, value, milliseconds, step)
            for step, numbers in (*record.steps(), (last, record.summary))
            for name, value in numbers.items()
        ]
        for some in _pieces(metrics, METRICS):
            client.log_batch(run, metrics=some)
        status = "FINISHED"
    finally:
        client.set_terminated(run, status, milliseconds)
    return Logged(run, True)


def _pieces(values: Sequence[Any], size: int) -> Iterator[Sequence[Any]]:
    return (values[first : first + size] for first in range(0, len(values), size))
