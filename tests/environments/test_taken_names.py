"""The names that axes and parameters may not have are those that artefacts have."""

from __future__ import annotations

import numpy as np

from qinit_cli.artefacts.fit import fit_schema
from qinit_cli.artefacts.fit_columns import FitStatistics, fit_statistics
from qinit_cli.artefacts.run import run_schema
from qinit_cli.artefacts.sources import sources_schema
from qinit_cli.environments.taken_names import OF_FITS, OF_TASKS
from qinit_store.schema import TASK, Axis, Schema

STATE, ACTION = Axis("a_state", np.arange(1)), Axis("action", np.arange(1))


def names(*schemas: Schema) -> set[str]:
    found = [{*schema.sizes, *(column.name for column in schema.columns)} for schema in schemas]
    return {TASK}.union(*found) - {STATE.name}


def test_every_name_in_sources_and_runs_is_taken() -> None:
    run = run_schema(
        (STATE,),
        ACTION,
        (),
        1,
        start_per_task=False,
        potential_per_task=False,
        exact_values=True,
        evaluations=1,
        keep_q=True,
        updating=True,
        hypotheses=1,
        told_returns=True,
    )
    there = names(sources_schema((STATE,), ACTION, (), 1), run)
    assert there <= OF_TASKS
    assert OF_TASKS - there == {"artefact", "method"}  # columns of exported tables


def test_every_name_in_fits_is_taken() -> None:
    everything = FitStatistics("a test", "a test", ("a distribution",), ("a start",), 1, theory=True)
    fit = fit_schema((STATE,), ACTION, 1, *fit_statistics(everything, (STATE.name, ACTION.name)))
    assert names(fit) - OF_TASKS == OF_FITS
