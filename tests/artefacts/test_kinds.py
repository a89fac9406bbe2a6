"""Every registered kind is known wherever kinds are told apart, and registering one is all that it takes."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from running import Pipeline, run_here

import qinit_cli as qinit
from qinit_cli.app import run
from qinit_cli.artefacts.kind import Kind, Shown
from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.artefacts.settings import Spec, StoredFamily
from qinit_store.errors import StoreError
from qinit_store.kinds import REGISTERED, folder_of, register
from qinit_store.reading import Artefact
from qinit_store.schema import TASK, Column, Schema, digest_axis, digest_column
from qinit_store.work import open_work

ROOT = Path(__file__).parents[2]
MADE_UP = "diary"
EVERY = [pytest.param(kind, id=name) for name, kind in KINDS.items()]
Artefacts = Mapping[str, Path]  # one of each kind by its name, each in its folder of one store


@dataclass(frozen=True)
class DiarySettings:
    """Those of a kind that no part of qinit has heard of."""

    kind: ClassVar[str] = MADE_UP
    algorithm_version: int
    family: StoredFamily
    tasks: int

    def spec(self) -> dict[str, Any]:
        own = {"kind": self.kind, "algorithm_version": self.algorithm_version, "tasks": self.tasks}
        return own | {"family": self.family.spec()}

    @property
    def sources(self) -> DiarySettings:
        return self


class DiaryKind(Kind[DiarySettings]):
    """A kind that no part of qinit has heard of: a number a day."""

    name, folder, maker = MADE_UP, "diaries", "keep-diary"
    one, several, counted = "diary", "diaries", "days"
    tables: ClassVar[Mapping[str, str]] = {"days": "mood"}
    results = ("mood",)

    def read(self, spec: Spec) -> DiarySettings:
        if spec["tasks"] < 1:
            raise ValueError("it has no days")
        return DiarySettings(spec["algorithm_version"], StoredFamily.read(spec["family"]), spec["tasks"])

    def lack(self, schema: Schema, *, part: bool) -> str:
        return "" if {"mood", "task_digest"} <= {column.name for column in schema.columns} else "mood"

    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        return diary_schema().columns

    def shown(self, artefact: Artefact) -> Shown:
        return Shown({"days": artefact.task_count}, np.empty(0))


def diary_schema() -> Schema:
    columns = (Column("mood", (TASK,), "f8", low=0, high=1), digest_column())
    return Schema(MADE_UP, (digest_axis(),), columns)


@contextmanager
def registered(kind: Kind[Any]) -> Iterator[Kind[Any]]:
    """The kind, known as long as the block runs."""
    KINDS[kind.name] = kind
    register(kind.name, kind.folder, kind.maker, kind.lack)
    try:
        yield kind
    finally:
        del KINDS[kind.name], REGISTERED[kind.name]


@pytest.fixture(scope="module")
def artefacts(pipeline: Pipeline, tuning: Path, tmp_path_factory: pytest.TempPathFactory) -> Artefacts:
    """Look, do not touch."""
    there = {"sources": pipeline.sources, "fit": pipeline.fit, "run": pipeline.runs["mean"], "tuning": tuning}
    store = tmp_path_factory.mktemp("kinds") / "store"
    found = {}
    for name, path in there.items():
        found[name] = store / KINDS[name].folder / path.name
        found[name].parent.mkdir(parents=True)
        shutil.copy(path, found[name])
    found[MADE_UP] = store / DiaryKind.folder / "mine.h5"
    family = {"name": "gridworld", "size": 6, "variance": 2.0}
    spec = DiarySettings(1, StoredFamily.read(family), 3).spec()
    with registered(DiaryKind()), open_work(found[MADE_UP], diary_schema(), spec) as work:
        work.save({"mood": np.array([0.0, 0.5, 1.0])}, np.arange(3))
        work.finish(np.arange(3), {}, provenance={"command": "qinit keep-diary"})
    return found


def listed(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`list` names it, of its kind, with what there is of it."""
    rows = run_here(["list", "--store", path.parents[1], "--json"]).json["rows"]
    [row] = [row for row in rows if row["name"] == path.stem]
    assert (row["kind"], row["state"], row["family"]) == (kind.name, "done", "gridworld")
    assert row["tasks"] > 1


def shown(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`show`, given its name and its folder, tells its numbers and its settings."""
    ended = run_here(["show", f"{kind.folder}/{path.stem}", "--store", path.parents[1], "--json"])
    assert ended.code == 0, ended.err
    assert ended.json["kind"] == kind.name
    assert ended.json["numbers"]
    people = run_here(["show", path, "--format", "table"]).out
    assert people.startswith(f"{kind.name} {path.stem}")
    assert all(name.replace("_", " ") in people for name in ended.json["numbers"])


def completed(kind: Kind[Any], path: Path, folder: Path) -> None:
    """The shell completes its name."""
    words = f"qinit show --store {path.parents[1]} {path.stem[:3]}"
    completing = {"_QINIT_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": "4"}
    with pytest.MonkeyPatch.context() as shell:
        for name, value in completing.items():
            shell.setenv(name, value)
        shell.setattr("sys.stdout", offered := io.StringIO())
        with pytest.raises(SystemExit):
            run([])
    assert path.stem in offered.getvalue().split()


def verified(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`verify` finds it sound, and knows what it is."""
    [row] = run_here(["verify", path, "--json"]).json["rows"]
    assert (row["kind"], row["state"]) == (kind.name, "sound")


def salvaged(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`salvage` writes its tasks again; what has none is made again."""
    ended = run_here(["salvage", path, "-o", folder / "salvaged.h5", "--json"])
    if not kind.by_task:
        assert ended.code == 6
        assert "no task of it holds; make it again" in ended.err
        return
    assert ended.code == 0, ended.err
    assert ended.json["digest"] == run_here(["show", path, "--json"]).json["content_sha256"]


def exported(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`export` writes each of its tables in every format, and the first unless another is asked for."""
    import pyarrow.parquet

    from qinit_cli.artefacts.long_tables import tables
    from qinit_cli.artefacts.opening import open_artefact

    with open_artefact(path) as artefact:
        there = tables(artefact)
    assert there[0] == next(iter(kind.tables))
    for table in there:
        for ending in ("csv", "parquet", "npz", "json"):
            words = ["export", path, "--what", table, "-o", folder / f"{kind.name}-{table}.{ending}"]
            assert run_here(words).code == 0, words
        frame = pyarrow.parquet.read_table(folder / f"{kind.name}-{table}.parquet")
        lines = (folder / f"{kind.name}-{table}.csv").read_text().splitlines()
        assert lines[0].split(",") == frame.column_names
        assert len(lines) == 1 + frame.num_rows > 1
        [said] = json.loads((folder / f"{kind.name}-{table}.json").read_text())["artefacts"]
        assert (said["kind"], kind.tables[table] in said["arrays"]) == (kind.name, True)
        with np.load(folder / f"{kind.name}-{table}.npz") as arrays:
            assert {*arrays.files} == {"metadata_json", *said["arrays"]}
    plain = run_here(["export", path, "--to", "csv", "-o", "-"]).out
    assert plain == (folder / f"{kind.name}-{there[0]}.csv").read_text()


def reported(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`report` counts it among what the page rests on, lists its hash and shows its settings."""
    page = folder / f"{kind.name}.html"
    ended = run_here(["report", path, "-o", page])
    assert ended.code == 0, ended.err
    told = " ".join(unescape(re.sub(r"<svg.*?</svg>|<[^>]*>", " ", page.read_text(), flags=re.S)).split())
    shown = run_here(["show", path, "--json"]).json
    assert f"All of it rests on 1 {kind.one}." in told
    assert shown["content_sha256"] in told
    settings = told.partition(" Settings ")[2].partition(" Provenance and hashes ")[0]
    for part in kind.reported(kind.read(shown["spec"])):
        assert f"{part.heading} " in settings
    assert f" size {shown['spec'].get('sources', shown['spec'])['family']['size']} " in settings


def opened(kind: Kind[Any], path: Path, folder: Path) -> None:
    """The library opens it, as the class of its kind where there is one, and has its arrays."""
    artefact = qinit.open(path)
    assert getattr(artefact, "kind", kind.name) == kind.name
    lead = next(iter(kind.tables.values()))
    assert artefact.to_xarray()[lead].size > 1
    assert artefact[lead].size > 1


def judged(kind: Kind[Any], path: Path, folder: Path) -> None:
    """`verdicts` takes it, or names it as one that no claim is about."""
    ended = run_here(["verdicts", path, "--json"])
    assert ended.code == 0, ended.err
    assert ended.json["rows"]


USES = [listed, shown, completed, verified, salvaged, exported, reported, opened, judged]
HERE = [use for use in USES if use is not verified]  # which a process of its own does
Use = Callable[[Kind[Any], Path, Path], None]


@pytest.mark.parametrize("use", USES, ids=lambda use: use.__name__)
@pytest.mark.parametrize("kind", EVERY)
def test_the_kind_is_known(kind: Kind[Any], use: Use, artefacts: Artefacts, tmp_path: Path) -> None:
    use(kind, artefacts[kind.name], tmp_path)


@pytest.mark.parametrize("use", HERE, ids=lambda use: use.__name__)
def test_registering_a_kind_makes_it_known(use: Use, artefacts: Artefacts, tmp_path: Path) -> None:
    with registered(DiaryKind()) as diary:
        use(diary, artefacts[MADE_UP], tmp_path)


@pytest.mark.parametrize("use", HERE, ids=lambda use: use.__name__)
def test_a_kind_that_is_not_registered_is_not_known(use: Use, artefacts: Artefacts, tmp_path: Path) -> None:
    with pytest.raises((AssertionError, ValueError, StoreError)):
        use(DiaryKind(), artefacts[MADE_UP], tmp_path)


@pytest.mark.parametrize("kind", EVERY)
def test_the_store_knows_the_kind_its_folder_and_what_makes_it(kind: Kind[Any]) -> None:
    assert folder_of(kind.name) == kind.folder
    assert REGISTERED[kind.name].maker == kind.maker


def test_no_two_kinds_share_a_folder_or_a_name() -> None:
    assert len({kind.folder for kind in KINDS.values()}) == len(KINDS)
    assert all(name == kind.name for name, kind in KINDS.items())


@pytest.mark.parametrize("kind", EVERY)
def test_a_command_makes_the_kind(kind: Kind[Any]) -> None:
    assert run_here([kind.maker, "-h"]).code == 0


@pytest.mark.parametrize("kind", EVERY)
def test_list_takes_the_kind(kind: Kind[Any], artefacts: Artefacts) -> None:
    words = ["list", "--kind", kind.name, "--store", artefacts[kind.name].parents[1], "--json"]
    assert [row["kind"] for row in run_here(words).json["rows"]] == [kind.name]


@pytest.mark.parametrize("kind", EVERY)
def test_help_tells_of_the_kind(kind: Kind[Any]) -> None:
    told = {
        command: " ".join(run_here([command, "-h"]).out.split()) for command in ("list", "export", "report")
    }
    assert re.search(rf"<[a-z|]*\b{kind.name}\b[a-z|]*>", told["list"])
    assert f"{kind.several.capitalize()}: {', '.join(kind.tables)}." in told["export"]
    assert kind.several in told["report"]


@pytest.mark.parametrize("kind", EVERY)
def test_the_manual_tells_of_the_kind(kind: Kind[Any]) -> None:
    pages = "".join(path.read_text() for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    assert f"qinit {kind.maker}" in pages
    assert [table for table in kind.tables if table not in pages] == []


@pytest.mark.parametrize("kind", EVERY)
def test_the_page_of_the_store_names_the_kind_its_folder_and_its_axes(kind: Kind[Any]) -> None:
    page = (ROOT / "docs" / "store.md").read_text()
    assert f"`{kind.name}`" in page.partition("## What an artefact is")[2].partition("A store is")[0]
    assert f"`{kind.folder}/`" in page
    assert f"`qinit/{kind.name}`" in page
    assert [axis for axis in kind.indices if f"| `{axis}` |" not in page] == []


@pytest.mark.parametrize("kind", EVERY)
def test_settings_of_another_kind_are_refused(kind: Kind[Any]) -> None:
    with pytest.raises(ValueError, match="its settings are of 'another', the artefact is of"):
        kind.read({"kind": "another"})
