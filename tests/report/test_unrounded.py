"""Tables keep what their cells hold before it is rounded, and list every row where a file has no page to fill."""

from __future__ import annotations

import math

from winchcascade.report.digits import NumberText, interval_text, number, percent
from winchcascade.report.publish import cleaned
from winchcascade.report.report_model import (
    Report,
    Table,
    TableColumn,
    every_row,
    make_table,
    number_column,
    rows_of,
    section,
)


def test_a_table_keeps_the_values_behind_its_texts() -> None:
    columns = [TableColumn[object]("x", "m", 2), number_column("interval"), number_column("share", "%")]
    table = make_table("t", "c", columns, [(1.23456, interval_text(0.12345, 0.23456, 0.01), percent(0.98765))])
    assert table.rows == (("1.23", "0.123 to 0.235", "99"),)
    x, interval, share = table.values[0]
    assert x == 1.23456
    assert isinstance(interval, NumberText)
    assert interval.values == (0.12345, 0.23456)
    assert isinstance(share, NumberText)
    assert share.values == (98.765,)


def test_what_does_not_exist_is_a_dash_without_a_value() -> None:
    assert number(None, 2) == "–"
    assert math.isnan(number(None, 2).values[0])


def test_a_report_with_numbers_that_are_formatted_can_be_published() -> None:
    table = make_table("t", "c", [number_column("x")], [(number(1.26, 1),)])
    report = cleaned(Report("kind", "title", "", (), (), (section("s", "S", table),)))
    (shown,) = report.sections[0].blocks
    assert isinstance(shown, Table)
    assert shown.rows == (("1.3",),)


def test_a_long_table_has_all_its_rows_where_every_row_is_wanted() -> None:
    columns = [TableColumn("k", of=int)]
    assert len(rows_of(columns, range(9), most=4)) == 5
    with every_row():
        assert rows_of(columns, range(9), most=4) == [(k,) for k in range(9)]
