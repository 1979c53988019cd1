"""A log in any format gives what its text gives; and what Parquet and workbooks alone hold."""

from __future__ import annotations

import datetime as dt
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xls
import xlsb
import xlsxwriter
from read_here import open_excel, readers_here
from seeds import DATA, NAMES, ROWS, STEP, seeds

from winchcascade import read_run
from winchcascade.core.errors import LogError
from winchcascade.ingest.formats.parquet import open_parquet
from winchcascade.ingest.open_log import is_mat_v4, open_log

T = 0.04 * np.arange(500)
V = np.sin(T)
P = 20.0 + T

LAST_DIGIT = 1e-15
"""Workbooks hold 16 digits of a number."""

SCALE = {"pressure": 98_066.5}
"""What the unit of a channel is in SI units, where it is not 1."""

FORMS = ("lvm", "tdms", "mat", "mat73", "parquet", "excel", "xls")


def seeded(folder: Path, form: str, k: int) -> Path:
    """The log in a format, in a file with an ending that is none of its own."""
    path = folder / "a.csv"
    path.write_bytes(seeds(form)[k])
    return path


@pytest.mark.parametrize(
    ("form", "k"), [(form, k) for form in FORMS for k in range(len(seeds(form)))]
)
def test_a_log_is_recognised_by_its_content_and_gives_the_numbers_of_its_text(
    form: str, k: int, tmp_path: Path
) -> None:
    with readers_here():
        run = read_run(seeded(tmp_path, form, k), repairs="off")
    assert {finding.kind for finding in run.findings} <= {"unit_assumed", "stuck"}
    assert run.fs == pytest.approx(1.0 / STEP)
    assert run.samples == (500 if form in ("excel", "xls") else len(ROWS))
    for name in NAMES[1:]:
        expected = SCALE.get(name.lower(), 1.0) * DATA[name][: run.samples]
        np.testing.assert_allclose(run.channels[name.lower()], expected, rtol=1e-12, err_msg=name)
    stated = form in ("tdms", "mat") or (form == "parquet" and k < 2)  # a property of the file
    assert run.load == (36.0 if stated else None)


@pytest.mark.parametrize("form", FORMS)
def test_a_file_cut_off_anywhere_is_read_in_part_or_rejected(form: str, tmp_path: Path) -> None:
    whole = seeds(form)[0]
    for share in np.linspace(0.0, 0.999, 25):
        path = tmp_path / "a.dat"
        path.write_bytes(whole[: int(share * len(whole))])
        with readers_here(), suppress(LogError):
            assert read_run(path).samples > 0


@pytest.mark.parametrize(
    "head",
    [
        bytes(64),
        "Time (s),Velocity (m/s)".encode("utf-16-le"),
        "Time (s),Velocity (m/s)".encode("utf-32"),
        struct.pack("<5i", 0, 500, 1, 0, 5) + b"ti,e\0",
        struct.pack("<5i", 1000, 500, 1, 0, 5) + b"time\0",
        struct.pack("<5i", 0, -1, 1, 0, 5) + b"time\0",
        struct.pack("<5i", 0, 500, 1, 2, 5) + b"time\0",
        struct.pack("<5i", 0, 500, 1, 0, 5)[:17],
    ],
)
def test_mat4_is_recognised_only_by_a_whole_header(head: bytes) -> None:
    assert not is_mat_v4(head)


@pytest.mark.parametrize(
    ("magic", "what"),
    [
        (b"CDF\x05", "NetCDF file of 64 bit data, .*nccopy"),
        (b"MDF     4.10", r"MDF measurement \(MF4\), .*asammdf"),
        (b"ARROW1\0\0", "Feather file, .*to_parquet"),
        (b"#ROSBAG V2.0", "ROS bag, .*rostopic"),
    ],
)
def test_an_unreadable_format_is_named_with_its_export(
    magic: bytes, what: str, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_bytes(magic + bytes(range(256)))
    with pytest.raises(LogError, match=rf"^a.csv: is an? {what}"):
        open_log(tmp_path / "a.csv")


# --- Parquet


@pytest.mark.parametrize("row_group_size", [1, 128, 500])
def test_columns_of_parquet_of_any_kind_become_numbers(tmp_path: Path, row_group_size: int) -> None:
    path = tmp_path / "a.parquet"
    columns = {
        "when": pa.array(
            [1_770_000_000_000_000_001 + 40_000_000 * k for k in range(500)],
            pa.timestamp("ns", tz="UTC"),
        ),
        "v": pa.array([None if k == 7 else float(V[k]) for k in range(500)], pa.float32()),
        "p": pa.array(np.round(P, 3)).cast(pa.decimal128(12, 3)),
        "text": pa.array(["1.5" if k % 2 else "off" for k in range(500)]),
        "on": pa.array([k % 2 == 0 for k in range(500)]),
        "label": pa.array(["hold"] * 500).dictionary_encode(),
        "pair": pa.array([[k] for k in range(500)]),
    }
    pq.write_table(pa.table(columns), path, row_group_size=row_group_size)
    table = open_parquet(path).load([1, 2, 3, 4, 5, 6], 0)
    expected = V.astype(np.float32).astype(np.float64)
    expected[7] = np.nan
    np.testing.assert_array_equal(table.values[1], expected)
    np.testing.assert_array_equal(table.values[2], np.round(P, 3))
    np.testing.assert_array_equal(table.values[3][:4], [np.nan, 1.5, np.nan, 1.5])
    np.testing.assert_array_equal(table.values[4][:3], [1.0, 0.0, 1.0])
    assert np.isnan(table.values[6]).all()
    assert table.texts[5] == ["hold"] * 500
    assert table.stamped
    np.testing.assert_allclose(np.asarray(table.stamps), T, rtol=1e-15)


@pytest.mark.parametrize(
    "kind", [pa.timestamp("s"), pa.timestamp("us"), pa.time32("ms"), pa.time64("ns"), pa.date32()]
)
def test_stamps_of_parquet_count_from_the_first_that_is_there(tmp_path: Path, kind: Any) -> None:
    day = pa.types.is_date(kind)
    scale = 1 if day else {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[kind.unit]
    whole = pa.int32() if day or kind == pa.time32("ms") else pa.int64()
    ticks = [None if k is None else k * scale for k in (None, 3, 4, None, 7)]
    pq.write_table(
        pa.table({"t": pa.array(ticks, whole).cast(kind), "v": V[:5]}), tmp_path / "a.parquet"
    )
    stamps = np.asarray(open_parquet(tmp_path / "a.parquet").load([1], 0).stamps)
    np.testing.assert_array_equal(
        stamps, (86400.0 if day else 1.0) * np.array([np.nan, 0.0, 1.0, np.nan, 4.0])
    )


def test_names_of_parquet_with_dots_and_twins_are_distinguished(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(
        pa.Table.from_arrays([pa.array([float(k)]) for k in range(3)], names=["a.b", "a", "a"]),
        path,
    )
    table = open_parquet(path).load([0, 1, 2], None)
    assert [table.values[k][0] for k in range(3)] == [0.0, 1.0, 2.0]


# --- workbooks


def book(folder: Path, *rows: Sequence[Any]) -> Path:
    """A workbook with a sheet of notes before these rows."""
    path = folder / "a.xlsx"
    with xlsxwriter.Workbook(str(path), {"default_date_format": "yyyy-mm-dd hh:mm:ss.000"}) as made:
        made.add_worksheet("Notes").write_row(0, 0, ["Trial of the crane"])
        sheet = made.add_worksheet("Log")
        for k, row in enumerate(rows):
            sheet.write_row(k, 0, row)
    return path


def test_the_sheet_the_names_the_units_and_the_numbers_of_a_workbook_are_found(
    tmp_path: Path,
) -> None:
    path = book(
        tmp_path,
        ["Crane trial"],
        ["Load", 36, "ohm"],
        [],
        ["Time", None, "Velocity", "Pressure", "Remark"],
        ["[s]", None, "(m/s)", "kgf/cm²", None],
        *([t, None, v, p, "x"] for t, v, p in zip(T, V, P, strict=True)),
        [None, "", None, None, None],
    )
    source = open_excel(path)
    table = source.load([2, 3, 4], 0)
    units = [
        ("Time", "s"),
        ("", None),
        ("Velocity", "m/s"),
        ("Pressure", "kgf/cm²"),
        ("Remark", None),
    ]
    assert [(header.name, header.unit) for header in source.headers] == units
    assert source.properties["Load"] == "36"
    np.testing.assert_allclose(np.asarray(table.stamps), T, rtol=LAST_DIGIT)
    np.testing.assert_allclose(table.values[2], V, rtol=LAST_DIGIT)
    assert table.texts[4] == ["x"] * 500


def test_texts_of_a_workbook_that_look_like_numbers_are_numbers(tmp_path: Path) -> None:
    texts = ["1,5", "-2.5", " 3 ", "1.234,5", "1,234.5", "1e3", "n/a", "#N/A", "1_0", "nan", True]
    path = book(tmp_path, ["v", "p"], *([text, 1.0] for text in texts))
    expected = [1.5, -2.5, 3.0, 1234.5, 1234.5, 1000.0, *[np.nan] * 4, 1.0]
    np.testing.assert_array_equal(open_excel(path).load([0], None).values[0], expected)


@pytest.mark.parametrize(
    ("first", "began"),
    [
        (dt.datetime(2026, 3, 1, 23, 59, 59), True),
        (dt.time(10, 0, 0), False),
        (dt.timedelta(hours=30), False),
    ],
)
def test_stamps_of_a_workbook_become_seconds_since_the_first(
    tmp_path: Path, first: Any, began: bool
) -> None:
    moments = [k * dt.timedelta(milliseconds=40) for k in range(50)]
    day = dt.date(2026, 3, 1)
    stamps = [
        (dt.datetime.combine(day, first) + m).time() if isinstance(first, dt.time) else first + m
        for m in moments
    ]
    table = open_excel(
        book(tmp_path, ["Time", "v"], *([s, k] for k, s in enumerate(stamps)), [None, 3.0])
    ).load([1], 0)
    assert table.stamped
    assert (table.began is not None) == began
    # A workbook keeps stamps as days; what is read back is rounded to milliseconds.
    np.testing.assert_allclose(np.asarray(table.stamps), [*T[:50], np.nan], atol=1e-3)


def test_an_old_workbook_with_a_password_is_rejected_as_such(tmp_path: Path) -> None:
    (tmp_path / "a.xls").write_bytes(
        xls.book([["v"], [1.0]], top=xls.record(0x2F, b"\1".ljust(54, b"\0")))
    )
    with pytest.raises(LogError, match=r"a.xls: .*password"):
        open_excel(tmp_path / "a.xls")


def test_a_panic_of_the_reader_leaves_the_sentence_alone(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = xlsb.write(tmp_path / "a.xlsb", xlsb.sheet([["v"], [1.0]]), name_letters=1_000_000)
    with pytest.raises(LogError, match=r"a.xlsb: .*damaged"):
        open_log(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("cell", "factor"),
    [
        (lambda x: f"{x:,.0f}", 1.0),
        (lambda x: f"{x / 1000:.3f}".replace(".", ","), 1e-3),
        (lambda x: f"{x:,.1f}", 1.0),
    ],
    ids=["thousands", "decimals", "both"],
)
def test_a_comma_in_the_texts_of_a_workbook_is_read_by_its_whole_column(
    tmp_path: Path, cell: Callable[[float], str], factor: float
) -> None:
    force = [200.0 + 9.0 * abs(k - 250) for k in range(500)]
    path = book(
        tmp_path, ["Time (s)", "Force (N)"], *([0.04 * k, cell(force[k])] for k in range(500))
    )
    values = open_excel(path).load([1], 0).values[1]
    assert values.tolist() == pytest.approx([factor * x for x in force], abs=0.5 * factor)


@pytest.mark.parametrize(
    "odd", [["Time (s)", "Velocity (m/s)", "Force (N)"], ["crane stopped", "", ""]]
)
@pytest.mark.parametrize("place", [100, 500])
def test_a_note_or_repeated_names_in_a_workbook_are_skipped(
    tmp_path: Path, odd: Sequence[str], place: int
) -> None:
    rows: list[Sequence[object]] = [[0.04 * k, 0.5, 300.0 + k] for k in range(500)]
    rows.insert(place, odd)
    table = open_excel(book(tmp_path, ["Time (s)", "Velocity (m/s)", "Force (N)"], *rows)).load(
        [1, 2], 0
    )
    assert table.values[2].tolist() == [300.0 + k for k in range(500)]
