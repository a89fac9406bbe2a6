"""Studies to begin with: a commented file for a question, about a family."""

from __future__ import annotations

import json
import re
import tomllib
from importlib.resources import files
from string import Template

from qinit_cli.environments import FAMILIES
from qinit_cli.errors import UsageError
from qinit_cli.nearest import nearest
from qinit_cli.options import key_of, options
from qinit_cli.study.questions import Question
from qinit_store.wording import shell_line

EXAMPLES = files("qinit_cli") / "study" / "examples"
FILL_IN = "<-- FILL IN"
COMMENTED = re.compile(r"^(\S.*?) {2,}(# .*)$")
EPISODES = 1_000  # of a family that the examples say nothing of


def example(question: Question, family: str, of: str | None, file: str) -> str:
    """The text of a study.

    `of` is what the family needs first (an environment's id, a file of tasks); without it that line is marked by FILL_IN,
    and the study is refused until it is filled in. `file` is what the comments call the file. UsageError for an unknown family,
    and for an `of` that the family has no use for.
    """
    if family not in list(FAMILIES):  # others are looked up too, and never drawn from
        raise UsageError(f"there is no family {family} to draw tasks from; {nearest(family, list(FAMILIES))}")
    told = tomllib.loads(_read("families")).get(family, {})
    lines = {name: text.strip("\n") for name, text in told.items() if name in ("lines", "varied", "full")}
    needed = _needed(family, of)
    usual = Template(lines.get("lines", "$needed")).substitute(needed=needed)
    episodes = told.get("episodes", EPISODES)
    values = {
        "file": shell_line(file),
        "family": family,
        "lines": usual,
        "varied": lines.get("varied", usual),
        "full": f"[scale.full.mine]\n{lines['full']}\n\n" if "full" in lines else "",
        "episodes": f"{episodes:_}",
        "full_episodes": f"{told.get('full_episodes', 10 * episodes):_}",
        **_counts(told.get("counts")),
    }
    text = Template(_read(question)).substitute(values)
    return "".join(
        COMMENTED.sub(lambda found: f"{found[1]:<31} {found[2]}", line) + "\n" for line in text.splitlines()
    )


def _needed(family: str, of: str | None) -> str:
    """The line of what the family needs first, "" where it needs nothing."""
    needed = [one for one in options(FAMILIES[family]) if one.metadata["positional"]]
    if not needed:
        if of is not None:
            raise UsageError(
                f"--of is {of!r}, and {family} needs no file and no id; leave it out, or give --family gym or tasks"
            )
        return ""
    [one] = needed
    key = key_of(one.name)
    if of is None:
        return f'# {key} = "..."   # {FILL_IN}: {one.metadata["help"]}'
    if not of.isprintable():
        raise UsageError(f"--of is {of!r}, which has characters that cannot be printed; rename it")
    return f"{key} = {json.dumps(of, ensure_ascii=False)}"


def _counts(listed: list[int] | None) -> dict[str, str]:
    """Lines of how many tasks are learned; `listed` are numbers of sources of a family that has no more than its file."""
    if listed is not None:
        every = "# tasks = 100                 # without it: all of the file"
        return {
            "source_tasks": every,
            "full_source_tasks": every,
            "target_tasks": every,
            "full_target_tasks": every,
            "counts": f"{listed}                  # {FILL_IN} larger numbers, up to the file's",
            "full_counts": f"{listed}",
        }
    return {
        "source_tasks": "tasks = 30                      # 100 in the paper",
        "full_source_tasks": "tasks = 100",
        "target_tasks": "tasks = 40                      # 200 are better",
        "full_target_tasks": "tasks = 200",
        "counts": "[3, 10, 30]             # each learns only what the one before has not",
        "full_counts": "[3, 10, 30, 100, 300]",
    }


def _read(name: str) -> str:
    return (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
