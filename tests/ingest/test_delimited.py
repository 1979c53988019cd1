"""Cells and rows of text logs: numbers in any spelling, cells that are none, files that are cut
off or spoilt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from campaign_log import HEAD, LOST, ROWS, SAME, changed, clean, efficiencies, kinds, read, text
from daily import daily
from hypothesis import given
from hypothesis import strategies as st
from loops import failures

from winchcascade.ingest.cells import looks_like_a_number, number

SIX_DIGITS = 1e-5
"""Numbers are written with six digits behind the point, or seven in all."""


def grouped(cell: str, group: str, point: str) -> str:
    return f"{float(cell):,.6f}".replace(",", "_").replace(".", point).replace("_", group)


MILLIMETRES = [[*row[:2], repr(1e3 * float(row[2])), *row[3:]] for row in ROWS]
IN_MM = [*HEAD[:2], "Velocity (mm/s)", *HEAD[3:]]


DELIMITERS = (";", "\t", ",")


def each_with_one(cases: Sequence[object]) -> list[Any]:
    """Cases, each with a delimiter; with the others in the slow tests."""
    pairs = [(case, delimiter) for case in cases for delimiter in DELIMITERS]
    return daily(pairs, [pairs[3 * k + k % 3] for k in range(len(cases))], spread=True)


@pytest.mark.parametrize(
    ("cell", "delimiter"),
    each_with_one([
        lambda c: f"{float(c):.6E}", lambda c: f"{float(c):.6e}".replace("e", "D"), lambda c: f"{float(c):+.6f}",
        lambda c: c.replace("-", "\u2212"), lambda c: c.replace("-", "–"), lambda c: f"  {c} ", lambda c: f"\u00a0{c}",
        lambda c: c.removesuffix(".0"), lambda c: c.replace("0.", ".", 1) if abs(float(c)) < 1 else c,
    ]),
)  # fmt: skip
def test_a_number_reads_the_same_in_any_spelling(
    cell: Callable[[str], str], delimiter: str, tmp_path: Path
) -> None:
    run = read(
        tmp_path,
        text(changed(cell), HEAD, delimiter=delimiter, decimal="." if delimiter == "," else ","),
    )
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SIX_DIGITS)


@pytest.mark.parametrize(
    ("group", "point"),
    [(",", "."), (".", ","), ("'", "."), ("’", "."), (" ", ","), ("\u00a0", ","), ("\u202f", ",")],
)
@pytest.mark.parametrize("delimiter", daily([";", "\t"], [";"]))
def test_thousands_may_be_set_apart(group: str, point: str, delimiter: str, tmp_path: Path) -> None:
    rows = changed(lambda c: grouped(c, group, point), MILLIMETRES)
    run = read(
        tmp_path, delimiter.join(IN_MM) + "\n" + "".join(delimiter.join(row) + "\n" for row in rows)
    )
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SIX_DIGITS)


@given(
    st.floats(-1e12, 1e12),
    st.sampled_from([".", ","]),
    st.sampled_from(["{:.6f}", "{:+.9e}", "{:,.6f}"]),
)
def test_a_number_survives_being_written_and_read(value: float, decimal: str, form: str) -> None:
    written = form.format(value)
    if decimal == ",":
        written = written.translate(str.maketrans(",.", ".,"))
    assert looks_like_a_number(written)
    assert number(written, decimal) == pytest.approx(value, rel=1e-9, abs=1e-6)


MARKS = [
    "OVL", "#N/A", "1.#QNAN", "-1.#IND", "1.#INF", "--", "***", "*****.**", "", " ", "NaN", "Over", "n.a.", "+OL", "####",
    "NULL", "-inf", "INF", "No Data", "1e400", "0x1F", "?", "12.3.4", "1 2", "1_000", "\u221e", "\u20ac",
]  # fmt: skip


def test_a_cell_that_is_no_number_is_reported_and_bridged(tmp_path: Path) -> None:
    def check(mark: str, delimiter: str) -> None:
        rows = [
            [*row[:4], mark, *row[5:]] if k in (300, 700, 1200) else row
            for k, row in enumerate(ROWS)
        ]
        content = text(rows, delimiter=delimiter, decimal="." if delimiter == "," else ",")
        run = read(tmp_path, content.replace("12,3,4", "12.3.4"))
        assert [(f.kind, f.channel, f.count) for f in run.findings] == [
            ("not_a_number", "force", 3)
        ]
        assert efficiencies(run) == pytest.approx(clean(), abs=LOST)

    assert failures(check, [(mark, ",;"[k % 2]) for k, mark in enumerate(MARKS)]) == []


@pytest.mark.parametrize(
    ("remark", "delimiter"), each_with_one(["run", '"a, b"', "größer", "12:30", ""])
)
def test_a_column_of_text_in_between_is_reported_and_not_read(
    remark: str, delimiter: str, tmp_path: Path
) -> None:
    rows = [[*row[:3], remark if k >= 100 else "go", *row[3:]] for k, row in enumerate(ROWS)]
    run = read(tmp_path, text(rows, [*HEAD[:3], "State", *HEAD[3:]], delimiter=delimiter), "cp1252")
    assert kinds(run) == {"unknown_column"}
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_sensor_whose_numbers_begin_late_is_read(tmp_path: Path) -> None:
    rows = [[*row[:4], "No Data" if k < 80 else row[4], *row[5:]] for k, row in enumerate(ROWS)]
    run = read(tmp_path, text(rows, delimiter=";", decimal=","))
    assert run.channels["force"][-1] == pytest.approx(float(ROWS[-1][4]))


@pytest.mark.parametrize("remark", ["begin", "begin, slowly", '"begin, ""slowly"""', '5" line'])
def test_a_remark_after_a_few_rows_costs_no_row(remark: str, tmp_path: Path) -> None:
    lines = [
        ",".join([*HEAD, "Comment"]),
        *(",".join(row) + f",{remark}" * (k in (0, 900)) for k, row in enumerate(ROWS)),
    ]
    run = read(tmp_path, "\n".join(lines) + "\n")
    assert kinds(run) <= {"unknown_column"}
    assert run.samples == len(ROWS)
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize("row", [ROWS[9][:5], [*ROWS[9], "7"], ["12.3", "4"]])
def test_rows_with_cells_too_many_or_too_few_are_left_out_and_counted(
    row: list[str], tmp_path: Path
) -> None:
    run = read(tmp_path, text([row if k in (500, 900, 1500) else r for k, r in enumerate(ROWS)]))
    assert run.findings[0].message == "3 lines do not have 8 cells like the others"
    assert run.samples == len(ROWS) - 3
    assert efficiencies(run) == pytest.approx(clean(), abs=LOST)


@pytest.mark.parametrize("tail", ["\0", "\0" * 5000, "\0" * 3_000_000])
@pytest.mark.parametrize("cut", [0, 20])
def test_nul_bytes_at_the_end_are_a_loss_of_power(tail: str, cut: int, tmp_path: Path) -> None:
    run = read(tmp_path, text()[: len(text()) - cut] + tail)
    assert kinds(run) == {"truncated"}
    assert run.samples == len(ROWS) - (cut > 0)


def test_nul_bytes_amid_the_rows_cost_those_rows(tmp_path: Path) -> None:
    whole = text()
    run = read(tmp_path, whole[:60_000] + "\0" * 3000 + whole[60_000:])
    assert kinds(run) == {"truncated", "dropped_samples"}
    assert run.samples == len(ROWS) - 1


CUT = {
    "comma": text(),
    "semicolon": text(delimiter=";", decimal=",", end="\r\n"),
    "quoted": text(changed(lambda c: f'"{c}"')),
    "UTF-16": text(),
}


@pytest.mark.parametrize("what", CUT)
def test_a_file_cut_anywhere_in_its_last_rows_gives_whole_rows(what: str, tmp_path: Path) -> None:
    whole = CUT[what].encode("utf-16" if what == "UTF-16" else "utf-8")
    for end in range(len(whole) - 60, len(whole) + 1, 1 if what == "comma" else 4):
        run = read(tmp_path, whole[:end])
        assert kinds(run) <= {"truncated"}
        assert len(ROWS) - 3 <= run.samples <= len(ROWS)
        missing = {
            name: np.abs(x[-1]) > 2 * np.abs(x[-60:]).max() for name, x in run.channels.items()
        }
        assert not any(missing.values()), end
