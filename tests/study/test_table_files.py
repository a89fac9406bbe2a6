"""Tables as files, read by pandas and pyarrow."""

from __future__ import annotations

import io

import pytest

from qinit_cli.study.table_files import csv_of, parquet_of

ROWS = [
    {"method": 'a, "b"', "targets": "größe\n2", "return": 0.1 + 0.2, "regret": None, "tasks": 3},
    {"method": "zero", "targets": "", "return": -1e-300, "regret": 0.5, "tasks": 4},
]


def test_csv_is_read_back_by_pandas() -> None:
    pandas = pytest.importorskip("pandas")
    read = pandas.read_csv(io.BytesIO(csv_of(ROWS)), dtype=str, keep_default_na=False)
    assert list(read.columns) == list(ROWS[0])
    assert list(read["method"]) == [row["method"] for row in ROWS]
    assert list(read["targets"]) == [row["targets"] for row in ROWS]
    assert [float(one) for one in read["return"]] == [row["return"] for row in ROWS]
    assert list(read["regret"]) == ["", "0.5"]
    assert list(read["tasks"]) == ["3", "4"]


def test_parquet_is_read_back_by_pyarrow() -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    content = parquet_of(ROWS)
    assert content is not None
    assert parquet.read_table(io.BytesIO(content)).to_pylist() == ROWS


def test_a_study_s_columns_are_those_of_compare_in_its_order() -> None:
    from qinit_cli.commands.comparison_tables import columns
    from qinit_cli.comparison.table import MEASURES, OF_ROW, with_columns

    printed = [column.key for column in columns("return", "zero", greedy=False)]
    assert (*OF_ROW, "return", *MEASURES) == tuple(printed)
    row = {
        "targets": "t",
        "sets": 1,
        "method": "mean",
        "return": 0.5,
        "return_low": 0.4,
        "return_high": 0.6,
        "p": None,
    }
    assert with_columns([row], ["p", "return"]) == [
        {
            "targets": "t",
            "sets": 1,
            "method": "mean",
            "p": None,
            "return": 0.5,
            "return_low": 0.4,
            "return_high": 0.6,
        }
    ]
    assert list(with_columns([row], ["p", "return"])[0]) == [
        *OF_ROW,
        "p",
        "return",
        "return_low",
        "return_high",
    ]
