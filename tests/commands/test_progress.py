"""Lines of progress where there is no terminal: tasks are counted as they end, inside a batch too."""

from __future__ import annotations

import io
import re
import sys
from typing import Any

import pytest

from qinit_cli.commands import console as messages
from qinit_cli.commands.option_groups import Display
from qinit_cli.kernels import compiled
from qinit_cli.pipeline import job
from qinit_cli.pipeline import workers as workforce
from qinit_cli.watch import Watch

LEARN = ("train-sources", "gridworld", "--size", 6, "--variance", 2, "--tasks", 24, "--jobs", 1)
Q_LEARNING = (*LEARN, "--episodes", 20_000)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line at each look, and a look every millisecond."""
    monkeypatch.setattr(workforce, "TICK", 0.001)
    for name in ("FIRST_LINE", "PLAIN_INTERVAL", "ETA_AFTER"):
        monkeypatch.setattr(messages, name, 0.0)


def test_finished_tasks_are_counted_inside_a_batch_with_steps_and_time_left(
    here: Any, impatient: None
) -> None:
    ended = here(*Q_LEARNING)
    assert ended.code == 0, ended.err
    lines = [line for line in ended.err.splitlines() if line.startswith("sources: ")]
    counts = [int(re.match(r"sources: (\d+) of 24 tasks", line)[1]) for line in lines]  # type: ignore[index]
    assert counts == sorted(counts)
    assert {count for count in counts if 0 < count < 24}  # all 24 are one batch
    assert any(re.search(r"M steps/s, \d:\d\d left", line) for line in lines)


def test_exact_tables_are_told_in_tasks_a_second(here: Any, impatient: None) -> None:
    ended = here(*LEARN, "--learner", "exact")
    assert ended.code == 0, ended.err
    assert "steps/s" not in ended.err
    assert re.search(r"sources: 24 of 24 tasks, [\d.,e+]+ tasks/s", ended.err)


def test_short_work_prints_no_line_and_quiet_none_at_all(
    here: Any, impatient: None, monkeypatch: Any
) -> None:
    assert here(*Q_LEARNING, "--quiet", "-o", "a.h5").err == ""
    monkeypatch.setattr(messages, "FIRST_LINE", 5.0)
    assert " of 24 tasks, " not in here(*Q_LEARNING, "-o", "b.h5").err


def test_the_first_line_comes_after_some_seconds_then_one_in_thirty(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(messages.time, "monotonic", lambda: now)
    watch = Watch()
    watch.add(steps=0, tasks=0.0)
    progress = messages.TaskBar(Display(), "sources", 10, 30, watch)
    said = []
    for tick in range(1, 70):
        now = 100.0 + tick
        watch.add(steps=1_000_000, tasks=0.1, finished=0)
        progress.tick()
        if line := capsys.readouterr().err:
            said.append((tick, line))
    assert [tick for tick, _ in said] == [5, 35, 65]
    # a tenth of a task a second: twenty take 200 s
    assert said[0][1] == "sources: 10 of 30 tasks, 1.0 M steps/s, 3:15 left\n"
    assert said[2][1] == "sources: 10 of 30 tasks, 1.0 M steps/s, 2:15 left\n"


def test_the_bar_of_a_terminal_shows_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(messages.time, "monotonic", lambda: now)
    monkeypatch.setattr(sys, "stderr", _Terminal())
    watch = Watch()
    with messages.TaskBar(Display(), "sources", 10, 30, watch) as progress:
        now = 102.0
        watch.add(steps=4_000_000, tasks=5.0, finished=5)  # five of twenty in 2 s: the rest takes 6 s
        progress.tick()
    shown = sys.stderr.getvalue()
    for told in ("15/30", "2.0 M steps/s", "0:06 left"):
        assert told in shown


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("seconds", "told"), [(6.6, "0:07"), (754, "12:34"), (3723, "1:02:03"), (59.7, "1:00")]
)
def test_time_left_reads_as_on_a_clock(seconds: float, told: str) -> None:
    assert messages.clock(seconds) == told


def test_what_a_failed_batch_did_is_taken_back() -> None:
    whole = Watch()
    part = whole.part()
    part.add(steps=50, tasks=3.5, finished=3)
    assert (whole.steps, whole.tasks, whole.finished) == (50, 3.5, 3)
    part.take_back()
    assert (whole.steps, whole.tasks, whole.finished) == (50, 0.0, 0)


def test_one_candidate_of_four_is_a_quarter_of_a_task_and_finishes_none() -> None:
    whole = Watch()
    whole.part().part(1 / 4).add(steps=10, tasks=8.0, finished=8)
    assert (whole.steps, whole.tasks, whole.finished) == (10, 2.0, 0)


def test_who_stops_a_part_stops_the_whole_and_every_other_part() -> None:
    whole = Watch()
    one, other = whole.part(), whole.part()
    one.stop()
    assert whole.stopped
    assert other.stopped


def test_a_fit_counts_its_sources(here: Any, pipeline: Any, impatient: None, tmp_path: Any) -> None:
    ended = here("fit", pipeline.sources, "-o", tmp_path / "fit.h5")
    assert ended.code == 0, ended.err
    assert re.search(r"^fit: 4 of 4 tasks, [\d.,e+]+ tasks/s", ended.err, re.MULTILINE)


def test_the_same_line_is_not_printed_twice(impatient: None, capsys: pytest.CaptureFixture[str]) -> None:
    progress = messages.TaskBar(Display(), "sources", 0, 20, Watch())
    for _ in range(3):  # while a kernel is compiled
        progress.tick()
    progress.advance(1)
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(",")[0] for line in lines] == ["sources: 0 of 20 tasks", "sources: 1 of 20 tasks"]


def test_reading_shows_how_many_tasks_are_read(impatient: None, capsys: pytest.CaptureFixture[str]) -> None:
    with messages.reading(Display(), "verifying a.h5") as told:
        for read in (10, 20):
            told(read, 20)
    assert [line.partition(",")[0] for line in capsys.readouterr().err.splitlines()] == [
        "verifying a.h5: 10 of 20 tasks",
        "verifying a.h5: 20 of 20 tasks",
    ]


def test_a_signal_while_a_kernel_is_compiled_is_answered(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    watch = Watch()
    reporter = messages.Printed(Display())
    tick = job._Ticking(reporter.progress("sources", 0, 20, watch), watch, reporter)
    monkeypatch.setattr(compiled, "_under_way", ["qinit_cli.kernels.gridworld"])
    tick()
    assert capsys.readouterr().err == ""
    watch.stop()
    tick()
    tick()
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("stopping once the kernel is compiled")
