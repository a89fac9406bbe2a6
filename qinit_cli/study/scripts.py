"""The commands of a study written for make, Snakemake, a shell and Slurm."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath

from qinit_cli.errors import UsageError
from qinit_cli.study.exporting import OMITTED, Exported, ScriptStep
from qinit_cli.study.forms import Form

SETTINGS = (
    "Settings of stages in qinit.toml or QINIT_* would change what plain commands make: have none of them."
)


@dataclass(frozen=True)
class Slurm:
    """How jobs are submitted."""

    shards: int = 1  # jobs among which the tasks of each sources artefact are shared
    cpus: int = 1  # of each job
    time: str = ""  # that each may take, as sbatch reads it; "": the cluster's own


def script(exported: Exported, form: Form, slurm: Slurm) -> str:
    """The text; UsageError where a word has a line break, which no form can hold."""
    for step in exported.steps:
        for word in step.words:
            if "\n" in word or "\r" in word:
                raise UsageError(
                    f"{word!r} of {step.target} has a line break in it, and a script has a command a line; take it out"
                )
    lines = FORMS[form](exported, slurm)
    return "\n".join(lines) + "\n"


def _make(exported: Exported, slurm: Slurm) -> Iterator[str]:
    yield from _opening(
        exported, "make -j4", "QINIT_JOBS=1 make -j4 learns one task at once in each command."
    )
    yield ""
    yield f".PHONY: all\nall: {' '.join(exported.ends)}"
    for step in exported.steps:
        recipe = _line(step).replace("$", "$$")
        yield ""
        yield f"{step.target}: {' '.join(step.inputs)}".rstrip()
        yield f"\t@mkdir -p {shlex.quote(_parent(step))}"
        yield f"\t{recipe}"


def _snakemake(exported: Exported, slurm: Slurm) -> Iterator[str]:
    yield from _opening(exported, "snakemake --cores 4")
    yield ""
    yield f"rule all:\n    input: {_listed(exported.ends)}"
    for number, step in enumerate(exported.steps, 1):
        yield ""
        yield f"rule {step.stage}_{number}:"
        if step.inputs:
            yield f"    input: {_listed(step.inputs)}"
        yield f"    output: {step.target!r}"
        # Snakemake fills in braces
        yield f"    shell: {_line(step).replace('{', '{{').replace('}', '}}')!r}"


def _sh(exported: Exported, slurm: Slurm) -> Iterator[str]:
    yield "#!/bin/sh"
    yield from _opening(exported, "sh FILE")
    yield f"set -eu\nmkdir -p {shlex.join(exported.folders)}"
    for step in exported.steps:
        yield _line(step)


def _sbatch(exported: Exported, slurm: Slurm) -> Iterator[str]:
    """One script that submits a job for each step, or an array and the joining of its shares."""
    logs = f"{exported.folder}/logs"
    options = ["--parsable", f"--cpus-per-task={slurm.cpus}", "--kill-on-invalid-dep=yes"]
    options += [f"--time={slurm.time}"] if slurm.time else []
    yield "#!/bin/sh"
    yield from _opening(exported, "sh FILE", "Submits all jobs, each behind those that it needs.")
    yield f"set -eu\nmkdir -p {shlex.join([*exported.folders, logs])}"
    # of a federation, sbatch prints the cluster's name behind the number
    yield f'submit() {{ id=$(sbatch {shlex.join(options)} "$@") && echo "${{id%%;*}}"; }}'
    jobs: dict[str, str] = {}
    for number, step in enumerate(exported.steps, 1):
        jobs[step.target] = job = f"job_{number}"
        shares = min(slurm.shards, step.tasks)
        after = ":".join(f"${jobs[file]}" for file in step.inputs)
        waiting = f'--dependency="afterok:{after}" ' if after else ""
        name = shlex.quote(f"--job-name={step.job}")
        if shares < 2:
            log = shlex.quote(f"--output={logs}/{step.job}-%j.out")
            yield f"{job}=$(submit {name} {log} {waiting}--wrap {shlex.quote(_line(step))})"
            continue
        log = shlex.quote(f"--output={logs}/{step.job}-%A-%a.out")
        stem = step.target.removesuffix(".h5")
        share = f'{shlex.quote(stem)}-share-"$SLURM_ARRAY_TASK_ID"-of-{shares}.h5'
        words = list(step.words)
        at = words.index("-o")
        learning = f"qinit {shlex.join(words[:at])} -o {share} {shlex.join(words[at + 2 :])}".rstrip()
        learning += f' --shard "$SLURM_ARRAY_TASK_ID"/{shares}'
        yield f"shares=$(submit {name} {log} --array=1-{shares} --wrap {shlex.quote(learning)})"
        files = [f"{stem}-share-{one}-of-{shares}.h5" for one in range(1, shares + 1)]
        merging = shlex.join(["qinit", "merge", *files, "-o", step.target])
        log = shlex.quote(f"--output={logs}/{step.job}-%j.out")
        yield f'{job}=$(submit {name} {log} --dependency="afterok:$shares" --wrap {shlex.quote(merging)})'
    yield 'echo "$' + f'job_{len(exported.steps)}"'


FORMS: dict[Form, Callable[[Exported, Slurm], Iterator[str]]] = {
    "make": _make,
    "snakemake": _snakemake,
    "sh": _sh,
    "sbatch": _sbatch,
}


def _opening(exported: Exported, use: str, *more: str) -> Iterator[str]:
    """Comments that every form begins with."""
    yield f"# The commands of {exported.name!r}, written by qinit study export. {use}"
    for said in (*more, SETTINGS):
        yield f"# {said}"
    for name in exported.omitted:
        yield f"# {name!r} is left out: {OMITTED}"


def _line(step: ScriptStep) -> str:
    """The command as a shell reads it; what it prints gets the file's name once it is whole."""
    line = shlex.join(["qinit", *step.words])
    if not step.printed:
        return line
    target, part = shlex.quote(step.target), shlex.quote(f"{step.target}.part")
    return f"{line} > {part} && mv {part} {target}"


def _listed(files: list[str] | tuple[str, ...]) -> str:
    return ", ".join(map(repr, files))


def _parent(step: ScriptStep) -> str:
    return str(PurePosixPath(step.target).parent)
