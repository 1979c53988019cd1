"""Small tables of numbers: rows are read, and what is none is rejected with its place."""

import os
from pathlib import Path

import pytest

from winchcascade.core.errors import OptionError
from winchcascade.core.number_table import number_rows

COLUMNS = ("hs_m", "hours")


def rows(path: Path) -> list[tuple[float, ...]]:
    return number_rows(path, COLUMNS, lambda hs, hours: hs > 0.0 <= hours, "a height", "--scatter")


def test_rows_are_numbers_and_blank_lines_are_none(tmp_path: Path) -> None:
    table = tmp_path / "two seas.csv"
    table.write_text("\ufeffhs_m, hours\n\n0.5,100\n1,2e3\n\n", encoding="utf-8")
    assert rows(table) == [(0.5, 100.0), (1.0, 2000.0)]


@pytest.mark.parametrize("text", ["", "hs_m\n", "hs_m,hours\n", "hs_m,hours\n0,1\n", "\xff"])
def test_what_is_no_table_is_rejected_with_its_option_and_columns(
    tmp_path: Path, text: str
) -> None:
    table = tmp_path / "table.csv"
    table.write_text(text, encoding="latin-1")
    with pytest.raises(OptionError, match=r"--scatter .*table\.csv"):
        rows(table)


@pytest.mark.parametrize("place", [os.devnull, "/dev/zero", "."])
def test_what_is_no_file_is_not_read(place: str) -> None:
    with pytest.raises(OptionError, match="--scatter"):
        rows(Path(place))
