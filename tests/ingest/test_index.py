"""Logs of data frames: their index, which has no name, is the clock if it holds times, and none if it counts rows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from campaign_log import HEAD, NOON, ROWS, SAME, T, clean, efficiencies, kinds, read, stamps, text
from daily import daily
from read_here import readers_here

from winchcascade import read_run
from winchcascade.core.errors import LogError
from winchcascade.core.rig_toml import built_in

STAMPS = stamps("%Y-%m-%d %H:%M:%S.~")
NAMES_OF_NONE = ["", "index", "__index_level_0__", "Unnamed: 0"]

Writer = Callable[[Path, str, list[Any]], Path]


def as_csv(folder: Path, name: str, index: list[Any]) -> Path:
    path = folder / "log.csv"
    path.write_text(text([[str(x), *row[1:]] for x, row in zip(index, ROWS, strict=True)], [name, *HEAD[1:]]))
    return path


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


WRITERS = [(as_csv, name) for name in NAMES_OF_NONE]
WRITERS += [(as_excel, ""), (as_excel, "Unnamed: 0"), (as_parquet, "index"), (as_parquet, "__index_level_0__")]
"""Every name in a text file; of the files that a process of their own reads, names that data frames give there."""

BY_WRITER = pytest.mark.parametrize(
    ("write", "name"), daily(WRITERS, [*WRITERS[: 1 + len(NAMES_OF_NONE)], (as_parquet, "index")], spread=True)
)


@BY_WRITER
def test_stamps_in_the_only_column_without_a_name_are_the_clock(write: Writer, name: str, tmp_path: Path) -> None:
    run = read_run(write(tmp_path, name, STAMPS))
    assert kinds(run) == set()
    assert run.fs == 25.0
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@BY_WRITER
def test_numbers_that_rise_in_the_only_column_without_a_name_are_the_clock(
    write: Writer, name: str, tmp_path: Path
) -> None:
    with readers_here():
        run = read_run(write(tmp_path, name, T))
    assert [f.message for f in run.findings] == [
        "the clock is a column without name or unit; taken as s, with which velocity and displacement agree"
    ]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(("write", "name", "step"), [(*writer, (1, 10)[k % 2]) for k, writer in enumerate(WRITERS)])
def test_an_index_that_counts_rows_is_no_clock(write: Writer, name: str, step: int, tmp_path: Path) -> None:
    path = write(tmp_path, name, list(range(0, step * len(ROWS), step)))
    missing = r"no time column and no sampling interval; the log has .*sample_rate_hz"
    with readers_here(), pytest.raises(LogError, match=missing) as caught:
        read_run(path)
    assert "has , " not in str(caught.value)
    assert ", ," not in str(caught.value)
    with readers_here():
        run = read_run(path, rig=msgspec.structs.replace(built_in(), sample_rate=25.0))
    assert run.fs == 25.0
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_the_message_names_a_column_without_a_name_so_that_it_can_be_seen(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"the log has \(no name\), Displacement \(m\)"):
        read_run(as_csv(tmp_path, "", list(range(len(ROWS)))))


def test_of_two_columns_without_a_name_that_rise_none_is_the_clock(tmp_path: Path) -> None:
    rows = [[row[0], *row[1:], f"{2 * float(row[0]) + 0.5}"] for row in ROWS]
    with pytest.raises(LogError, match="no time column"):
        read(tmp_path, text(rows, ["", *HEAD[1:], ""]))


def test_a_time_that_is_named_wins_over_an_index(tmp_path: Path) -> None:
    rows = [[stamp, *row] for stamp, row in zip(stamps("%Y-%m-%d %H:%M:%S.~", NOON), ROWS, strict=True)]
    run = read(tmp_path, text(rows, ["", *HEAD]))
    assert kinds(run) == set()
    assert run.t[-1] == pytest.approx(T[-1])


def test_an_index_that_is_longer_than_its_table_adds_no_rows(tmp_path: Path) -> None:
    path = as_excel(tmp_path, "", T)
    book = openpyxl.load_workbook(path)
    for k in range(50):
        book["log"].cell(len(ROWS) + 2 + k, 1, T[-1] + 0.04 * (k + 1))
    book.save(path)
    assert read_run(path).samples == len(ROWS)
