"""Whole pipelines as a shell runs them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

Shell = Callable[..., Any]

TRAIN = "qinit train-sources gridworld --size 6 --tasks 4 --episodes 200 --variance 2"
TARGETS = "--tasks 4 --episodes 40"


def test_three_stages_in_one_pipe_print_the_runs_path_alone(shell: Shell, tmp_path: Path) -> None:
    ended = shell(f"{TRAIN} | qinit fit - | qinit transfer logqinit-median - {TARGETS}")
    assert ended.code == 0, ended.err
    assert (tmp_path / ended.path).is_file()
    assert ended.path.parts[:2] == ("qinit-store", "runs")
    kinds = {path.parent.name for path in (tmp_path / "qinit-store").rglob("*.h5")}
    assert kinds == {"sources", "fits", "runs"}
    assert "\x1b" not in ended.err
    assert not list(tmp_path.rglob("*.work"))


def test_a_loop_of_methods_is_compared_from_stdin(shell: Shell) -> None:
    made = shell(f"{TRAIN} | qinit fit - -o fit.h5")
    assert made.code == 0, made.err
    ended = shell(
        f"for m in zero maxqinit logqinit-median; do qinit transfer $m fit.h5 {TARGETS}; done | qinit compare -"
    )
    assert ended.code == 0, ended.err
    heading, *rows = (line.split("\t") for line in ended.out.splitlines())
    assert [row[heading.index("method")] for row in rows] == ["zero", "maxqinit", "logqinit-median"]
    assert {len(row) for row in rows} == {len(heading)}


def test_a_stage_that_fails_fails_the_pipe_and_the_next_says_why_it_has_nothing(shell: Shell) -> None:
    ended = shell(f"{TRAIN} --seed -1 | qinit fit -")
    assert ended.code == 4
    assert ended.out == ""
    first, second = ended.err.splitlines()
    assert first == "qinit: --seed is -1; it must be at least 0"
    assert "the stage before produced nothing" in second


def test_json_of_a_stage_is_one_object_that_the_contract_describes(qinit: Shell, tmp_path: Path) -> None:
    stages = (
        ("train-sources", "gridworld", "--size", 6, "--tasks", 4, "--episodes", 200),
        ("fit",),
        ("transfer", "zero", *TARGETS.split()),
    )
    made: list[str] = []
    for words in stages:
        ended = qinit(*words, *made, "--json")
        assert ended.code == 0, ended.err
        [line] = ended.out.splitlines()
        told = json.loads(line, parse_constant=_refuse)
        assert told["schema"] == f"qinit.{words[0]}/1"
        assert {"path", "digest", "tasks", "skipped", "failed", "steps", "seconds"} <= told.keys()
        assert (tmp_path / told["path"]).is_file()
        assert len(told["digest"]) == 64
        assert (told["tasks"], told["skipped"], told["failed"]) == (4, 0, 0)
        assert (told["steps"] > 0, told["seconds"] > 0) == (words[0] != "fit",) * 2
        made = [told["path"]]


def _refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is no JSON")


def test_results_do_not_depend_on_jobs_or_on_what_ran_before(shell: Shell, tmp_path: Path) -> None:
    digests = []
    for jobs, before in ((1, ""), (2, f"qinit transfer maxqinit fit.h5 {TARGETS} -q;")):
        folder = tmp_path / f"jobs-{jobs}"
        folder.mkdir()
        ended = shell(
            f"cd {folder.name}; qinit train-sources gridworld --size 6 --tasks 37 --episodes 100 --jobs {jobs} --json -q;"
            f"qinit fit - -o fit.h5 --json -q < <(ls qinit-store/sources/*.h5); {before}"
            f"qinit transfer logqinit-median fit.h5 {TARGETS} --jobs {jobs} --json -q"
        )
        assert (ended.code, ended.err) == (0, "")
        told = [json.loads(line) for line in ended.out.splitlines() if line.startswith("{")]
        digests.append([each["digest"] for each in told])
    assert len(digests[0]) == 3
    assert digests[0] == digests[1]


def test_stdin_is_read_only_for_an_explicit_dash(shell: Shell) -> None:
    ended = shell("yes nonsense | head -100 | qinit list --format csv; exit ${PIPESTATUS[2]}")
    assert ended.code == 0
    assert "nonsense" not in ended.out + ended.err


def test_several_references_on_stdin_are_one_too_many_for_a_fit(shell: Shell) -> None:
    ended = shell("printf 'a.h5\\nb.h5\\n' | qinit fit -")
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1


def test_a_reader_that_leaves_early_ends_a_stage_silently_with_its_artefact_whole(
    shell: Shell, tmp_path: Path
) -> None:
    ended = shell(f"{TRAIN} -q -o a.h5 | true; exit ${{PIPESTATUS[0]}}")
    # whether the path was written before the reader left is a race; either way nothing is said or harmed
    assert ended.code in (0, 141)
    assert ended.err == ""
    assert shell("qinit fit a.h5 -q -o f.h5").code == 0
    assert not list(tmp_path.glob(".*.work"))


def test_a_table_cut_off_by_head_ends_silently_with_141(shell: Shell, tmp_path: Path) -> None:
    # more than a pipe holds, so that the writer meets the closed end
    store = tmp_path / "qinit-store" / "sources"
    store.mkdir(parents=True)
    for number in range(1_000):
        (store / f"{'x' * 80}-{number}.h5").write_bytes(b"not an artefact")
    ended = shell("qinit list | head -1; exit ${PIPESTATUS[0]}")
    assert ended.code == 141
    assert ended.err == ""
    assert len(ended.out.splitlines()) == 1


def test_a_stage_whose_stdout_is_closed_keeps_its_artefact(shell: Shell, tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        ended = subprocess.run(
            [Path(sys.executable).with_name("qinit"), *TRAIN.split()[1:], "-o", "a.h5", "-q"],
            stdout=writer,
            stderr=subprocess.PIPE,
            cwd=tmp_path,
            timeout=60,
        )
    finally:
        os.close(writer)
    assert (ended.returncode, ended.stderr) == (141, b"")
    assert shell("qinit fit a.h5 -q").code == 0
