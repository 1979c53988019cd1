"""Tables keep what their cells hold before it is rounded, and list every row where a file has no page to fill."""

from __future__ import annotations

import math

from winchcascade.report.exports import csv_text

from winchcascade.report.digits import NumberText, interval_text, number, percent, stated, with_uncertainty
from winchcascade.report.publish import cleaned
from winchcascade.report.sheet import (
    Limit,
    Report,
    Table,
    TableColumn,
    every_row,
    make_table,
    number_column,
    rows_of,
    section,
    text_column,
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


def test_the_numbers_of_a_column_end_at_the_same_decimal() -> None:
    columns = [number_column("x"), number_column("y"), number_column("d", "%")]
    rows = [
        (stated(0.12345, 0.0048, 3), with_uncertainty(7114.9, 116.0, 0), number(3.061, 2)),
        (stated(0.5, 0.012, 3), with_uncertainty(511.0, 41.0, 0), number(0.0, 0)),
        (stated(None, None, 3), with_uncertainty(3.0, None, 0), number(12.5, 1)),
    ]
    shown = make_table("t", "c", columns, rows).rows
    assert [row[0] for row in shown] == ["0.1235", "0.5000", "–"]
    assert [row[1] for row in shown] == ["7115 ± 116", "511 ± 41", "3.0"]
    assert [row[2] for row in shown] == ["3.06", "0", "12.5"]  # without an uncertainty each is as it was given


def test_an_exceptionally_small_uncertainty_does_not_decide_the_digits_of_a_column() -> None:
    rows = [(stated(1.0, u, 1),) for u in (0.01, 0.02, 0.015, 1e-9)]
    assert [row[0] for row in make_table("t", "c", [number_column("x")], rows).rows] == ["1.0000"] * 4


def test_rows_of_different_units_have_digits_of_their_own() -> None:
    columns = [text_column("Unit"), number_column("x")]
    rows = [("J", stated(7114.9, 116.0, 0)), ("", stated(0.90337, 0.0048, 3))]
    assert [row[1] for row in make_table("t", "c", columns, rows).rows] == ["7110", "0.9034"]


def test_a_number_with_its_uncertainty_has_two_columns_in_a_file() -> None:
    table = make_table("t", "c", [number_column("E", "J")], [(with_uncertainty(7114.9, 116.0, 0),)])
    assert csv_text(table) == 'E (J),"E (J), standard uncertainty"\n7114.9,116.0\n'


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
    assert len(rows_of(columns, range(9), Limit(4))) == 5
    with every_row():
        assert rows_of(columns, range(9), Limit(4)) == [(k,) for k in range(9)]
