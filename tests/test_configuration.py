"""Settings from files: where they are found, which is stronger, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from qinit_cli import configuration
from qinit_cli.errors import UsageError

COMMANDS = {
    ("fit",): frozenset({"store", "library"}),
    ("transfer", "zero"): frozenset({"store", "jobs", "keep_q"}),
    ("transfer", "ucoi"): frozenset({"store", "jobs", "kappa"}),
}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "home" / "qinit").mkdir(parents=True)
    (tmp_path / "work").mkdir()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path / "work")
    for name in ("QINIT_STORE", "QINIT_JOBS"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def write(here: Path, *, local: str = "", user: str = "") -> None:
    if local:
        (here / "work" / "qinit.toml").write_text(local)
    if user:
        (here / "home" / "qinit" / "qinit.toml").write_text(user)


def nested() -> dict[str, object]:
    return configuration.defaults(COMMANDS, configuration.settings(COMMANDS))


def test_a_key_at_the_top_holds_for_every_command_that_has_the_option(here: Path) -> None:
    write(here, local='store = "a"\njobs = 2\n')
    assert nested() == {
        "fit": {"store": "a"},
        "transfer": {"zero": {"store": "a", "jobs": 2}, "ucoi": {"store": "a", "jobs": 2}},
    }


def test_a_table_holds_for_the_commands_below_it_and_wins_over_the_top(here: Path) -> None:
    write(here, local="jobs = 1\n[transfer]\njobs = 2\n[transfer.ucoi]\nkappa = 5\njobs = 3\n")
    assert nested() == {"fit": {}, "transfer": {"zero": {"jobs": 2}, "ucoi": {"jobs": 3, "kappa": 5}}}


def test_the_local_file_wins_over_the_users_however_special_that_is(here: Path) -> None:
    write(here, local='store = "local"\n', user='[fit]\nstore = "user"\nlibrary = 7\n')
    assert nested()["fit"] == {"store": "local", "library": 7}


@pytest.mark.parametrize(
    "text",
    ['dask = "tcp://10.0.0.7:8786"', '[transfer]\ndask = "s.json"', '[transfer.zero]\ndask = "s.json"'],
)
def test_what_connects_to_those_who_could_run_code_here_comes_from_the_users_own_file_alone(
    here: Path, text: str
) -> None:
    commands = {("transfer", "zero"): frozenset({"dask"})}
    write(here, user=text)
    assert configuration.defaults(commands, configuration.settings(commands))["transfer"]
    write(here, local=text)
    with pytest.raises(
        UsageError, match=r"^\./qinit\.toml: dask could run the code of others.*QINIT_DASK.*home/qinit"
    ):
        configuration.settings(commands)


def test_in_the_users_own_folder_the_file_is_the_users_own(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(here, user='dask = "tcp://10.0.0.7:8786"')
    monkeypatch.chdir(here / "home" / "qinit")
    commands = {("transfer", "zero"): frozenset({"dask"})}
    assert [setting.name for setting in configuration.settings(commands)] == ["dask"]


def test_dashes_and_underscores_name_the_same_option(here: Path) -> None:
    write(here, local="[transfer.zero]\nkeep-q = true\n")
    assert nested()["transfer"] == {"zero": {"keep_q": True}, "ucoi": {}}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("jobz = 2", "jobz is no option; did you mean jobs"),
        ("[fit]\njobs = 2", "jobs is no option of fit"),
        ("[transfr]\njobs = 2", r"\[transfr\] is no command; did you mean transfer"),
        ("jobs = ", "is no TOML"),
    ],
)
def test_what_nothing_has_is_refused_with_the_nearest_name(here: Path, text: str, said: str) -> None:
    write(here, local=text)
    with pytest.raises(UsageError, match=said):
        nested()


def test_a_variable_that_sets_no_option_is_refused(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QINIT_JOBS", "2")
    configuration.check_variables(COMMANDS)
    monkeypatch.setenv("QINIT_JOBZ", "2")
    with pytest.raises(UsageError, match="QINIT_JOBZ sets no option; did you mean QINIT_JOBS"):
        configuration.check_variables(COMMANDS)


def test_without_files_there_are_no_settings(here: Path) -> None:
    assert configuration.files() == []
    assert nested() == {"fit": {}, "transfer": {"zero": {}, "ucoi": {}}}
