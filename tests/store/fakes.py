"""Small schemas and made-up tasks: what a learner would hand to the store, without learning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from breakable import Unflushed

from qinit_cli.artefacts.fit import fit_schema
from qinit_cli.artefacts.run import run_schema
from qinit_cli.artefacts.sources import sources_schema
from qinit_store.schema import ANYTHING, Axis, Column
from qinit_store.work import open_work

DISK = Unflushed()

ROW = Axis("row", np.arange(3))
COL = Axis("col", np.arange(3))
ACTION = Axis("action", np.array([b"up", b"down", b"left", b"right"]))
PARAMETERS = (
    Column("goal_row", ("task",), "i4"),
    Column("goal_col", ("task",), "i4"),
    Column("p", ("task",), "f8"),
)


def free(schema):
    """The schema with columns that may have any value: made-up tasks have any."""
    return replace(schema, columns=tuple(replace(column, **ANYTHING) for column in schema.columns))


SOURCES = free(sources_schema((ROW, COL), ACTION, PARAMETERS, 5))


def spec_for(tasks=6, **changed):
    family = {"name": "gridworld", "size": 3, "variance": 7.0}
    return {"family": family, "learning": {"alpha": 0.1}, "seed": 0, "tasks": tasks, **changed}


def rows_for(ids, schema=SOURCES):
    """Every given task column of the tasks `ids`; a task's numbers depend on its id alone."""
    tables = [one_task(int(number), schema) for number in ids]
    return {name: np.stack([table[name] for table in tables]) for name in tables[0]} if tables else {}


def one_task(number, schema=SOURCES):
    rng = np.random.default_rng([number, 1])
    task = {}
    for column in schema.task_columns:
        if column.given:
            values = rng.random(schema.row_shape(column)) * 100
            task[column.name] = np.asarray(values).astype(column.dtype)
    return task


def statics_for(schema):
    rng = np.random.default_rng(5)
    return {
        column.name: (rng.random(schema.row_shape(column)) * 100).astype(column.dtype)
        for column in schema.static_columns
    }


def make_sources(path, tasks=6, batch=4, order=None, schema=SOURCES, spec=None, disk=DISK, **how):
    """An artefact made as a stage would make it: the tasks that are not saved, batch by batch."""
    spec = spec_for(tasks) if spec is None else spec
    provenance = {"command": f"qinit train-sources gridworld --tasks {tasks}"}
    with open_work(path, schema, spec, provenance=provenance, disk=disk, **how) as work:
        if work.complete:
            return work.target
        ids = np.arange(tasks) if order is None else np.asarray(order)
        left = ids[~np.isin(ids, work.saved)]
        for first in range(0, left.size, batch):
            some = left[first : first + batch]
            work.save(rows_for(some, schema), some)
        return work.finish(np.arange(tasks), statics_for(schema), provenance, [])


def make_fit(path, seed=0, inputs=()):
    schema = free(fit_schema((ROW, COL), ACTION, 3))
    with open_work(path, schema, {"estimator": "mle", "seed": seed}, disk=DISK) as work:
        if work.complete:
            return work.target
        return work.finish(None, statics_for(schema), {"command": "qinit fit"}, list(inputs))


def make_run(path, tasks=4, episodes=8, keep_q=True):
    schema = free(
        run_schema(
            (ROW, COL),
            ACTION,
            PARAMETERS,
            episodes,
            start_per_task=False,
            potential_per_task=True,
            exact_values=True,
            evaluations=2,
            keep_q=keep_q,
        )
    )
    with open_work(path, schema, {"method": "zero", "tasks": tasks}, disk=DISK) as work:
        ids = np.arange(tasks)
        work.save(rows_for(ids, schema), ids)
        return work.finish(ids, statics_for(schema), {"command": "qinit transfer zero"}, [])


def narrow_schema(length, keep_q=False):
    """The least there can be, with final tables of `length` * 8 bytes a task where `keep_q`.

    For tests of size, and where hundreds of artefacts are made.
    """
    return free(
        run_schema(
            (Axis("place", np.arange(length)),),
            Axis("action", np.arange(1)),
            (),
            3,
            start_per_task=False,
            potential_per_task=False,
            exact_values=False,
            evaluations=0,
            keep_q=keep_q,
        )
    )


LIGHT = narrow_schema(4)
