"""Logs of data frames in workbooks and Parquet: the index, which has no name, is the clock if it holds times."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from campaign_log import HEAD, NOON, ROWS, SAME, T, clean, efficiencies, kinds, read, stamps, text
from read_here import readers_here

from winchcascade import read_run
from winchcascade.core.errors import LogError

STAMPS = stamps("%Y-%m-%d %H:%M:%S.~")


def as_excel(folder: Path, name: str, index: list[Any]) -> Path:
    path = folder / "log.xlsx"
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("log")
    sheet.append([name or None, *HEAD[1:]])
    for x, row in zip(index, ROWS, strict=True):
        sheet.append([x, *map(float, row[1:])])
    book.save(path)
    return path


def as_parquet(folder: Path, name: str, index: list[Any]) -> Path:
    path = folder / "log.parquet"
    times = isinstance(index[0], str)
    first = pa.array(np.array(index, dtype="datetime64[ms]")) if times else pa.array(index)
    columns = [pa.array([float(row[k]) for row in ROWS]) for k in range(1, len(HEAD))]
    pq.write_table(pa.table([*columns, first], names=[*HEAD[1:], name]), path)
    return path


Writer = Callable[[Path, str, list[Any]], Path]
BY_WRITER = pytest.mark.parametrize(("write", "name"), [(as_excel, ""), (as_parquet, "__index_level_0__")])


@BY_WRITER
def test_times_in_the_only_column_without_a_name_are_the_clock_and_numbers_of_rows_are_none(
    write: Writer, name: str, tmp_path: Path
) -> None:
    with readers_here():
        run = read_run(write(tmp_path, name, STAMPS))
        assert (kinds(run), run.fs) == (set(), 25.0)
        run = read_run(write(tmp_path, name, T))
        assert kinds(run) == {"unit_assumed"}
        assert efficiencies(run) == pytest.approx(clean(), abs=SAME)
        with pytest.raises(LogError, match="no time column and no sampling interval") as caught:
            read_run(write(tmp_path, name, list(range(len(ROWS)))))
    assert ", ," not in str(caught.value)


def test_of_two_columns_without_a_name_none_is_the_clock_and_a_named_time_comes_first(tmp_path: Path) -> None:
    rows = [[row[0], *row[1:], f"{2 * float(row[0]) + 0.5}"] for row in ROWS]
    with pytest.raises(LogError, match="no time column"):
        read(tmp_path, text(rows, ["", *HEAD[1:], ""]))
    rows = [[stamp, *row] for stamp, row in zip(stamps("%Y-%m-%d %H:%M:%S.~", NOON), ROWS, strict=True)]
    run = read(tmp_path, text(rows, ["", *HEAD]))
    assert run.t[-1] == pytest.approx(T[-1])


def test_an_index_that_is_longer_than_its_table_adds_no_rows(tmp_path: Path) -> None:
    path = as_excel(tmp_path, "", T)
    book = openpyxl.load_workbook(path)
    for k in range(50):
        book["log"].cell(len(ROWS) + 2 + k, 1, T[-1] + 0.04 * (k + 1))
    book.save(path)
    with readers_here():
        assert read_run(path).samples == len(ROWS)
