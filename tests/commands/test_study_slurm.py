"""What `qinit study run --slurm` reads, and the sentence about each fault of it."""

from __future__ import annotations

import pytest

from qinit_cli.commands.study import Spread
from qinit_cli.errors import UsageError
from qinit_cli.pipeline.slurm import SlurmJobs


def test_jobs_are_read_with_what_each_is_asked_to_have() -> None:
    assert Spread(slurm="3").submitted() == SlurmJobs(3)
    asked = Spread(slurm="20:cores=16,walltime=1-04:00:00,memory=16GB,partition=long,logs=out")
    assert asked.submitted() == SlurmJobs(
        20, cores=16, walltime="1-04:00:00", memory="16GB", partition="long", logs="out"
    )
    assert Spread().submitted() is None


def test_more_artefacts_are_made_at_once_on_a_cluster() -> None:
    assert (Spread().artefacts, Spread(slurm="3").artefacts, Spread(dask="tcp://node:1").artefacts) == (
        1,
        8,
        8,
    )
    assert Spread(slurm="3", at_once=2).artefacts == 2


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("many", r"write JOBS\[:KEY=VALUE,\.\.\.\]"),
        ("2:core=4", "'core' is no KEY of it; did you mean cores"),
        ("2:memory", "no value of memory; write memory=VALUE"),
        ("2:cores=four", "cores is a whole number"),
        ("2:cores=4,cores=8", "cores given twice"),
        ("0", "both must be at least 1"),
        ("2:walltime=soon", "DAYS-.HOURS:MINUTES:SECONDS"),
    ],
)
def test_what_cannot_be_asked_of_slurm_is_refused(asked: str, said: str) -> None:
    with pytest.raises((ValueError, UsageError), match=said):
        Spread(slurm=asked)


def test_a_cluster_and_jobs_to_submit_exclude_each_other() -> None:
    with pytest.raises(ValueError, match="leave one of them out"):
        Spread(slurm="2", dask="tcp://node:1")
