"""TDMS, MATLAB, Parquet and Excel: files are made here, and what is read back is what was written."""

from __future__ import annotations

import datetime as dt
import struct
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xls
import xlsb
import xlsxwriter
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from read_here import open_excel, open_mat
from scipy.io import savemat

from winchcascade import read_run, reduce
from winchcascade.core.errors import LogError
from winchcascade.core.run import Run
from winchcascade.ingest.formats.parquet import open_parquet
from winchcascade.ingest.formats.tdms import open_tdms
from winchcascade.ingest.open_log import is_mat_v4, open_log
from winchcascade.ingest.source import LogSource, LogTable

H = 0.04
T = H * np.arange(500)
V = np.sin(T)
P = 20.0 + T

INTERPOLATED = 1e-12
"""A straight line is interpolated to rounding."""

LAST_DIGIT = 1e-15
"""openpyxl writes 16 digits of a number."""


def names(source: LogSource) -> list[str]:
    return [header.name for header in source.headers]


def units(source: LogSource) -> list[str | None]:
    return [header.unit for header in source.headers]


def sentence(call: Callable[[], object], path: Path) -> str:
    with pytest.raises(LogError) as caught:
        call()
    message = str(caught.value)
    assert message.startswith(f"{path.name}: ")
    assert "\n" not in message
    assert message.count("; ") >= 2
    return message


# --- TDMS


def wave(name: str, values: Any, group: str = "Crane", **properties: Any) -> ChannelObject:
    return ChannelObject(group, name, np.asarray(values), {"wf_increment": H, "wf_start_offset": 0.0} | properties)


def write_tdms(path: Path, *objects: Any) -> Path:
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(list(objects))
    return path


def test_tdms_gives_names_units_clock_and_properties(tmp_path: Path) -> None:
    path = write_tdms(
        tmp_path / "a.tdms",
        RootObject({"load_ohm": 36.0, "operator": "nobody"}),
        GroupObject("Crane", {"operator": "crane test", "run": 3}),
        wave("Velocity", V, unit_string="m/s"),
        wave("Pressure", P.astype(np.float32), NI_UnitDescription="bar"),
        wave("Phase", np.arange(500, dtype=np.int16), unit=""),
    )
    source = open_tdms(path)
    table = source.load([0, 1, 2], None)
    assert names(source) == ["Velocity", "Pressure", "Phase"]
    assert units(source) == ["m/s", "bar", None]
    assert (source.time_step, source.time_start) == (H, 0.0)
    assert source.properties == {"load_ohm": 36.0, "operator": "crane test", "run": 3.0}
    np.testing.assert_array_equal(table.values[0], V)
    np.testing.assert_allclose(table.values[1], P, rtol=1e-7)
    assert all(column.dtype == np.float64 for column in table.values.values())
    assert (table.stamps, table.findings) == (None, ())


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(late=st.floats(0.02, 8.0))
def test_tdms_channels_that_start_apart_agree_on_the_time_of_a_straight_line(tmp_path: Path, late: float) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("x", T), wave("y", 2 * T), wave("z", T + late, wf_start_offset=late))
    table = open_tdms(path).load([0, 1, 2], None)
    # A shift within 1 % of a sample counts as none.
    tolerance = 0.01 * H + INTERPOLATED
    np.testing.assert_allclose(table.values[2], table.values[0], atol=tolerance, rtol=0)
    np.testing.assert_allclose(np.asarray(table.stamps), table.values[0], atol=INTERPOLATED)


def test_tdms_start_times_are_aligned_and_the_cut_is_reported(tmp_path: Path) -> None:
    start = np.datetime64("2026-03-01T10:00:00", "us")
    late = start + np.timedelta64(2_020_000, "us")
    path = write_tdms(
        tmp_path / "a.tdms",
        wave("x", T, wf_start_time=start),
        wave("y", T, wf_start_time=start),
        wave("z", T + 2.02, wf_start_time=late),
    )
    source = open_tdms(path)
    table = source.load([0, 2], None)
    np.testing.assert_allclose(table.values[0], table.values[2], atol=INTERPOLATED)
    assert len(table.values[0]) == 449
    (finding,) = table.findings
    assert finding.kind == "dropped_samples"
    assert finding.removed == round((T[-1] + 2.02 - 448 * H) / H)
    assert source.load([0, 1], None).stamps is None


def test_tdms_channels_are_taken_at_the_fastest_clock_and_slower_ones_are_reported(tmp_path: Path) -> None:
    slow = [wave(name, T[::5], wf_increment=5 * H) for name in ("y", "z")]
    table = open_tdms(write_tdms(tmp_path / "a.tdms", wave("x", T), *slow)).load([0, 1, 2], None)
    assert len(table.values[0]) == 496
    np.testing.assert_allclose(table.values[1], T[:496], atol=INTERPOLATED)
    (finding,) = table.findings
    assert (finding.kind, finding.action, finding.count) == ("coarse_sampling", "interpolated by straight lines", 2)


def test_tdms_channels_without_a_common_moment_are_rejected(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("x", T), wave("y", T, wf_start_offset=100.0))
    source = open_tdms(path)
    assert "overlap" in sentence(lambda: source.load([0, 1], None), path)
    assert len(source.load([1], None).values[1]) == len(T)


def test_tdms_stamps_become_seconds_since_the_first(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-03-01T10:00:00", "us") + (T * 1e6).astype("timedelta64[us]")
    path = write_tdms(
        tmp_path / "a.tdms",
        ChannelObject("g", "Time", stamps),
        ChannelObject("g", "v", V[:-3]),
        ChannelObject("g", "note", ["a"] * 500),
    )
    source = open_tdms(path)
    table = source.load([1, 2], 0)
    assert source.time_step is None
    assert table.stamped
    np.testing.assert_allclose(np.asarray(table.stamps), T[:-3], atol=2e-6)
    assert np.isnan(table.values[2]).all()
    assert [(f.kind, f.removed) for f in table.findings] == [("dropped_samples", 3)]


def test_tdms_groups_with_other_channels_are_one_log_the_largest_first(tmp_path: Path) -> None:
    path = write_tdms(
        tmp_path / "a.tdms",
        GroupObject("Electrical", {"operator": "of the converter", "converter": "B6"}),
        GroupObject("Motion", {"operator": "of the crane"}),
        wave("vdc", T[5:], group="Electrical", wf_start_offset=5 * H),
        wave("v", V, group="Motion"),
        wave("x", T, group="Motion"),
        ChannelObject("Notes", "remark", ["a", "b"]),
    )
    source = open_tdms(path)
    table = source.load([1, 2], None)
    assert names(source) == ["v", "x", "vdc"]
    assert source.properties == {"operator": "of the crane", "converter": "B6"}
    np.testing.assert_array_equal(table.values[1], table.values[2])
    assert table.findings == ()


def test_tdms_second_recording_of_the_same_channels_is_reported_and_not_read(tmp_path: Path) -> None:
    groups = {"Run 1": V, "Run 2": P, "Run 3": T}
    channels = [wave(name, values, group=group) for group, values in groups.items() for name in ("v", "p")]
    path = write_tdms(tmp_path / "a.tdms", *channels)
    assert "3 groups could be the log: 'Run 1', 'Run 2', 'Run 3'" in sentence(lambda: open_tdms(path), path)
    source = open_tdms(path, table="Run 1")
    table = source.load([0], None)
    assert names(source) == ["v", "p"]
    np.testing.assert_array_equal(table.values[0], V)
    (finding,) = table.findings
    assert (finding.kind, finding.count, finding.action) == ("unknown_column", 2, "not read")
    assert "beside 'Run 1': 'Run 2' with channels of the same names" in finding.message


@pytest.mark.parametrize(
    ("values", "properties", "why"),
    [
        (T, {"wf_start_offset": 100.0}, "sampled at another time"),
        (T[::5], {"wf_increment": 0.0}, "with neither a clock nor as many rows"),
        (T[3:], {"wf_increment": 0.0}, None),
        (T[::5], {"wf_increment": 5 * H}, None),
    ],
)
def test_tdms_group_is_joined_only_where_its_place_in_time_is_known(
    tmp_path: Path, values: Any, properties: dict[str, float], why: str | None
) -> None:
    first = [wave("v", V), wave("p", P)]
    source = open_tdms(write_tdms(tmp_path / "a.tdms", *first, wave("vdc", values, group="Other", **properties)))
    assert names(source) == ["v", "p"] + ["vdc"] * (why is None)
    assert [f.message for f in source.load([0], None).findings] == (
        [f"1 group beside 'Crane': 'Other' {why}"] * bool(why)
    )


def test_tdms_that_was_cut_off_is_read_to_the_last_common_sample(tmp_path: Path) -> None:
    path = tmp_path / "a.tdms"
    with TdmsWriter(str(path)) as writer:
        for k in range(0, 500, 100):
            writer.write_segment([wave("v", V[k : k + 100]), wave("p", P[k : k + 100])])
    path.write_bytes(path.read_bytes()[:-80])
    table = open_tdms(path).load([0, 1], None)
    assert len(table.values[0]) == len(table.values[1]) == 490
    np.testing.assert_array_equal(table.values[1], P[:490])
    assert [f.kind for f in table.findings] == ["truncated"]


@pytest.mark.parametrize("claimed", [10**6, 2**40, 2**62])
def test_tdms_that_claims_more_samples_than_bytes_is_rejected(tmp_path: Path, claimed: int) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("v", V))
    index = struct.pack("<LLQ", 10, 1, 500)
    assert path.read_bytes().count(index) == 1
    path.write_bytes(path.read_bytes().replace(index, struct.pack("<LLQ", 10, 1, claimed)))
    assert str(claimed) in sentence(lambda: open_tdms(path), path)


# --- MATLAB


def cells(*texts: str) -> Any:
    return np.array(texts, dtype=object)


def write_mat(path: Path, **variables: Any) -> Path:
    savemat(path, variables, oned_as="column")
    return path


@pytest.mark.parametrize(("form", "compressed"), [("4", False), ("5", False), ("5", True)])
def test_mat_vectors_of_the_usual_length_are_columns(tmp_path: Path, form: Literal["4", "5"], compressed: bool) -> None:
    path = tmp_path / "a.mat"
    variables = {"t": T, "v": V[np.newaxis, :], "p": P[:, np.newaxis], "other": V[:7], "R_L": 36.0, "Fs": 25.0}
    savemat(path, variables, format=form, do_compression=compressed)
    source = open_mat(path)
    table = source.load([1, 2], 0)
    assert names(source) == ["t", "v", "p"]
    assert source.properties == {"R_L": 36.0, "Fs": 25.0}
    assert source.time_step == H
    np.testing.assert_array_equal(np.asarray(table.stamps), T)
    np.testing.assert_array_equal(table.values[1], V)
    np.testing.assert_array_equal(table.values[2], P)


def test_mat_struct_fields_are_columns_with_units_from_a_struct(tmp_path: Path) -> None:
    path = write_mat(
        tmp_path / "a.mat",
        log={"v": V, "p": P, "dt": H, "units": {"v": "m/s", "p": "bar"}, "inner": {"idc": V.astype(np.float32)}},
        note="crane",
    )
    source = open_mat(path)
    assert names(source) == ["v", "p", "idc"]
    assert units(source) == ["m/s", "bar", None]
    assert source.time_step == H
    assert source.properties == {"dt": H, "note": "crane"}


@pytest.mark.parametrize("turned", [False, True])
def test_mat_matrix_with_names_is_a_table(tmp_path: Path, turned: bool) -> None:
    matrix = np.column_stack([T, V, P])
    path = write_mat(
        tmp_path / "a.mat",
        data=matrix.T if turned else matrix,
        Names=cells("Time", "Velocity", "Pressure"),
        units=np.array(["s  ", "m/s", "bar"]),
    )
    source = open_mat(path)
    assert names(source) == ["Time", "Velocity", "Pressure"]
    assert units(source) == ["s", "m/s", "bar"]
    np.testing.assert_array_equal(source.load([1], None).values[1], V)


@pytest.mark.parametrize(
    ("tag", "broken"),
    [(b"\x10\0\x03\0m/s", b"\xe8\0\x03\0m/s"), (b"\x05\0\0\0\x08\0\0\0", b"\x05\0\0\0\0\0\0\0")],
    ids=["type", "shape"],
)
def test_mat_with_a_broken_tag_is_rejected_and_the_process_lives(tmp_path: Path, tag: bytes, broken: bytes) -> None:
    path = write_mat(tmp_path / "a.mat", v=V, note="m/s")
    assert tag in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(tag, broken))
    assert "damaged" in sentence(lambda: open_log(path), path)


def h5_numbers(group: Any, name: str, values: Any) -> None:
    group.create_dataset(name, data=np.atleast_2d(values), dtype="f8").attrs["MATLAB_class"] = np.bytes_("double")


def h5_text(group: Any, name: str, value: str) -> Any:
    dataset = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype=np.uint16))
    dataset.attrs["MATLAB_class"] = np.bytes_("char")
    return dataset.ref


def stamp_mat73(path: Path) -> Path:
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" ") + path.read_bytes()[512:])
    return path


def write_mat73(path: Path) -> Path:
    """Lay out a file as MATLAB does with `save -v7.3`: dimensions turned round, texts as UTF-16."""
    with h5py.File(path, "w", userblock_size=512) as file:
        h5_numbers(file, "load_ohm", 36.0)
        h5_text(file, "operator", "crane")
        log = file.create_group("log")
        for name, values in {"t": T, "v": V, "p": P}.items():
            h5_numbers(log, name, values)
        h5_text(log.create_group("units"), "v", "m/s")
        empty = file.create_dataset("nothing", data=np.array([0, 0], dtype=np.uint64))
        empty.attrs["MATLAB_empty"] = np.uint8(1)
    return stamp_mat73(path)


def test_mat73_structs_texts_and_scalars_are_read(tmp_path: Path) -> None:
    source = open_mat(write_mat73(tmp_path / "a.mat"))
    assert dict(zip(names(source), units(source), strict=True)) == {"p": None, "t": None, "v": "m/s"}
    assert source.properties == {"load_ohm": 36.0, "operator": "crane"}
    v = names(source).index("v")
    np.testing.assert_array_equal(source.load([v], None).values[v], V)


def test_mat73_without_h5py_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_mat73(tmp_path / "a.mat")
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert "pip install winchcascade[mat73]" in sentence(lambda: open_mat(path), path)


def test_mat73_that_holds_itself_is_read_once(tmp_path: Path) -> None:
    path = write_mat73(tmp_path / "a.mat")
    with h5py.File(path, "r+") as file:
        file["log/again"] = file["log"]
    assert "v" in "".join(names(open_mat(path)))


# --- Parquet


def write_parquet(path: Path, row_group_size: int = 128) -> Path:
    fields = [
        pa.field("when", pa.timestamp("ns", tz="UTC")),
        pa.field("v", pa.float32(), metadata={"unit": "m/s"}),
        pa.field("p", pa.decimal128(12, 3), metadata={"units": "bar"}),
        pa.field("text", pa.string()),
        pa.field("on", pa.bool_()),
        pa.field("label", pa.dictionary(pa.int8(), pa.string())),
        pa.field("pair", pa.list_(pa.int64())),
    ]
    columns = [
        pa.array([1_770_000_000_000_000_001 + 40_000_000 * k for k in range(500)], pa.timestamp("ns", tz="UTC")),
        pa.array([None if k == 7 else float(V[k]) for k in range(500)], pa.float32()),
        pa.array(np.round(P, 3).astype(str)).cast(pa.float64()).cast(pa.decimal128(12, 3)),
        pa.array(["1.5" if k % 2 else "off" for k in range(500)]),
        pa.array([k % 2 == 0 for k in range(500)]),
        pa.array(["hold"] * 500).dictionary_encode().cast(pa.dictionary(pa.int8(), pa.string())),
        pa.array([[k] for k in range(500)]),
    ]
    schema = pa.schema(fields, metadata={"load_ohm": "36", "operator": "crane", "pandas": "{}"})
    pq.write_table(pa.table(columns, schema=schema), path, row_group_size=row_group_size)
    return path


@pytest.mark.parametrize("row_group_size", [1, 128, 500])
def test_parquet_columns_of_any_kind_become_numbers(tmp_path: Path, row_group_size: int) -> None:
    table = open_parquet(write_parquet(tmp_path / "a.parquet", row_group_size)).load([1, 2, 3, 4, 5, 6], 0)
    expected = V.astype(np.float32).astype(np.float64)
    expected[7] = np.nan
    np.testing.assert_array_equal(table.values[1], expected)
    np.testing.assert_array_equal(table.values[2], np.round(P, 3))
    np.testing.assert_array_equal(table.values[3][:4], [np.nan, 1.5, np.nan, 1.5])
    np.testing.assert_array_equal(table.values[4][:3], [1.0, 0.0, 1.0])
    assert np.isnan(table.values[5]).all()
    assert np.isnan(table.values[6]).all()
    assert table.stamped
    np.testing.assert_allclose(np.asarray(table.stamps), T, rtol=1e-15)


@pytest.mark.parametrize("kind", [pa.timestamp("s"), pa.timestamp("us"), pa.time32("ms"), pa.time64("ns"), pa.date32()])
def test_parquet_stamps_count_from_the_first_that_is_there(tmp_path: Path, kind: Any) -> None:
    path = tmp_path / "a.parquet"
    day = pa.types.is_date(kind)
    ticks = [None, 3, 4, None, 7]
    scale = 1 if day else {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[kind.unit]
    whole = pa.int32() if day or kind == pa.time32("ms") else pa.int64()
    column = pa.array([None if k is None else k * scale for k in ticks], whole).cast(kind)
    pq.write_table(pa.table({"t": column, "v": V[:5]}), path)
    table = open_parquet(path).load([1], 0)
    np.testing.assert_array_equal(
        np.asarray(table.stamps), (86400.0 if day else 1.0) * np.array([np.nan, 0.0, 1.0, np.nan, 4.0])
    )


def test_parquet_names_with_dots_and_twins_are_distinguished(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.Table.from_arrays([pa.array([float(k)]) for k in range(3)], names=["a.b", "a", "a"]), path)
    table = open_parquet(path).load([0, 1, 2], None)
    assert [table.values[k][0] for k in range(3)] == [0.0, 1.0, 2.0]


# --- Excel


def write_excel(path: Path, *rows: Any, title: str = "Log") -> Path:
    book = openpyxl.Workbook()
    book.active.title = "Notes"
    book.active.append(["Trial of the crane", None])
    book.active.append(["Operator", "nobody"])
    sheet = book.create_sheet(title)
    for row in rows:
        sheet.append(row)
    book.save(path)
    return path


def test_excel_finds_the_sheet_the_names_the_units_and_the_numbers(tmp_path: Path) -> None:
    path = write_excel(
        tmp_path / "a.xlsx",
        ["Crane trial"],
        ["Load", 36, "ohm"],
        [],
        ["Time", None, "Velocity", "Pressure", "Remark"],
        ["[s]", None, "(m/s)", "kgf/cm²", None],
        *([t, None, v, p, "x"] for t, v, p in zip(T, V, P, strict=True)),
        [None, None, None, None, None],
        [None, "", None, None, None],
    )
    source = open_excel(path)
    table = source.load([2, 3, 4], 0)
    assert names(source) == ["Time", "", "Velocity", "Pressure", "Remark"]
    assert units(source) == ["s", None, "m/s", "kgf/cm²", None]
    assert source.properties["Load"] == "36"
    np.testing.assert_allclose(np.asarray(table.stamps), T, rtol=LAST_DIGIT)
    np.testing.assert_allclose(table.values[2], V, rtol=LAST_DIGIT)
    assert np.isnan(table.values[4]).all()
    assert not table.stamped


def test_excel_texts_that_look_like_numbers_are_numbers(tmp_path: Path) -> None:
    texts = ["1,5", "-2.5", " 3 ", "1.234,5", "1,234.5", "1e3", "n/a", "#N/A", "1_0", "nan", True, None]
    path = write_excel(tmp_path / "a.xlsx", ["v", "p"], *([text, 1.0] for text in texts))
    expected = [1.5, -2.5, 3.0, 1234.5, 1234.5, 1000.0, *[np.nan] * 4, 1.0, np.nan]
    np.testing.assert_array_equal(open_excel(path).load([0], None).values[0], expected)


@pytest.mark.parametrize(
    "first",
    [dt.datetime(2026, 3, 1, 23, 59, 59), dt.time(10, 0, 0), dt.timedelta(hours=30)],
    ids=["datetime", "time", "timedelta"],
)
def test_excel_stamps_become_seconds_since_the_first(tmp_path: Path, first: Any) -> None:
    moments = [k * dt.timedelta(milliseconds=40) for k in range(50)]
    if isinstance(first, dt.time):
        stamps: list[Any] = [(dt.datetime.combine(dt.date(2026, 3, 1), first) + m).time() for m in moments]
    else:
        stamps = [first + m for m in moments]
    path = write_excel(tmp_path / "a.xlsx", ["Time", "v"], *([s, k] for k, s in enumerate(stamps)), [None, 3.0])
    table = open_excel(path).load([1], 0)
    assert table.stamped
    # A workbook keeps stamps as days; what is read back is rounded to milliseconds.
    np.testing.assert_allclose(np.asarray(table.stamps), [*T[:50], np.nan], atol=1e-3)


def test_an_old_workbook_with_a_password_is_rejected_as_such(tmp_path: Path) -> None:
    path = tmp_path / "a.xls"
    path.write_bytes(xls.book([["v"], [1.0]], top=xls.record(0x2F, b"\1".ljust(54, b"\0"))))
    assert "locked with a password" in sentence(lambda: open_excel(path), path)


def test_a_panic_of_the_reader_leaves_the_sentence_alone(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = xlsb.write(tmp_path / "a.xlsb", xlsb.sheet([["v"], [1.0]]), name_letters=1_000_000)
    assert "damaged or breaks off" in sentence(lambda: open_log(path), path)
    assert capfd.readouterr().err == ""


# --- every format


def _tdms(path: Path) -> Path:
    return write_tdms(path, RootObject({"load_ohm": 36.0}), wave("v", V, unit_string="m/s"), wave("p", P))


def _mat(path: Path) -> Path:
    return write_mat(path, log={"v": V, "p": P, "units": {"v": "m/s"}}, names=cells("v", "p"), fs=25.0)


def _mat4(path: Path) -> Path:
    savemat(path, {"v": V, "p": P, "fs": 25.0}, format="4")
    return path


def _excel(path: Path) -> Path:
    return write_excel(path, ["Time", "v"], ["s", "m/s"], *([t, v] for t, v in zip(T, V, strict=True)))


def _binary_excel(path: Path) -> Path:
    rows = zip(T.tolist(), V.tolist(), strict=True)
    return xlsb.write(path, xlsb.sheet([["Time", "v"], ["s", "m/s"], *([t, v] for t, v in rows)]))


def _old_excel(path: Path) -> Path:
    rows = zip(T.tolist(), V.tolist(), strict=True)
    path.write_bytes(xls.book([["Time", "v"], ["s", "m/s"], *([t, v] for t, v in rows)]))
    return path


FORMATS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], LogSource]]] = {
    "tdms": (_tdms, open_tdms),
    "mat": (_mat, open_mat),
    "mat4": (_mat4, open_mat),
    "mat73": (write_mat73, open_mat),
    "parquet": (write_parquet, open_parquet),
    "xlsx": (_excel, open_excel),
    "xlsb": (_binary_excel, open_excel),
    "xls": (_old_excel, open_excel),
}


def read_all(path: Path, opener: Callable[[Path], LogSource]) -> tuple[LogSource, LogTable]:
    source = opener(path)
    return source, source.load(range(len(source.headers)), None)


@pytest.fixture(scope="module", params=list(FORMATS))
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes, Any]:
    make, opener = FORMATS[request.param]
    path = make(tmp_path_factory.mktemp("cut") / f"a.{request.param}")
    return path, path.read_bytes(), opener


@settings(suppress_health_check=list(HealthCheck))
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_file_cut_off_anywhere_is_read_in_part_or_rejected_in_one_sentence(
    whole: tuple[Path, bytes, Any], share: float
) -> None:
    path, content, opener = whole
    path.write_bytes(content[: int(share * len(content))])
    message, lengths = f"{path.name}: ", []
    try:
        source, table = read_all(path, opener)
        lengths = [len(column) for column in table.values.values()]
        assert len(lengths) == len(source.headers)
    except LogError as fault:
        message = str(fault)
    assert message.startswith(f"{path.name}: ")
    assert "\n" not in message
    assert len(set(lengths)) <= 1


@pytest.mark.parametrize("form", list(FORMATS))
def test_file_of_another_kind_is_rejected_in_one_sentence(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"a.{form}"
    path.write_bytes(b"time,velocity\n0,1\n" * 50)
    sentence(lambda: FORMATS[form][1](path), path)


# --- as a log is read

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"
CHANNELS = ["Time", "Displacement", "Velocity", "Pressure", "Force", "Torque", "Vdc", "Idc"]
UNITS = ["s", "m", "m/s", "kg/cm2", "N", "N.m", "V", "A"]
DATA = dict(zip(CHANNELS, np.loadtxt(LOG, delimiter=",", skiprows=1).T, strict=True))
UNIT = dict(zip(CHANNELS, UNITS, strict=True))

SAME = 1e-6
"""A ratio of energies that differ by the rounding of stamps and of the last digits of numbers."""


def _log_tdms(path: Path) -> Path:
    waves = [wave(name, DATA[name], unit_string=UNIT[name]) for name in CHANNELS[1:]]
    return write_tdms(path, RootObject({"load_ohm": 36.0}), *waves)


def _log_tdms_in_groups(path: Path) -> Path:
    start = np.datetime64("2026-03-01T10:00:00", "us")
    group = {name: "Electrical" if name in ("Vdc", "Idc") else "Motion" for name in CHANNELS[1:]}
    late = {name: 3 * (group[name] == "Electrical") for name in group}  # samples by which the second loop starts later
    waves = [
        wave(
            name,
            DATA[name][late[name] :],
            group[name],
            unit_string=UNIT[name],
            wf_start_time=start + np.timedelta64(40_000 * late[name], "us"),
        )
        for name in group
    ]
    return write_tdms(path, GroupObject("Electrical", {"Load (ohm)": "36"}), *waves)


def _log_mat5(path: Path) -> Path:
    return write_mat(path, log=DATA | {"units": UNIT}, load_ohm=36.0)


def _log_mat4(path: Path) -> Path:
    savemat(path, DATA | {"load_ohm": 36.0}, format="4")
    return path


def _log_mat73(path: Path) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        h5_numbers(file, "load_ohm", 36.0)
        log = file.create_group("log")
        units = log.create_group("units")
        for name in CHANNELS:
            h5_numbers(log, name, DATA[name])
            h5_text(units, name, UNIT[name])
    return stamp_mat73(path)


def _log_parquet(path: Path) -> Path:
    fields = [pa.field(name, pa.float64(), metadata={"unit": UNIT[name]}) for name in CHANNELS]
    pq.write_table(pa.table(list(DATA.values()), schema=pa.schema(fields, metadata={"load_ohm": "36"})), path)
    return path


def _log_excel(path: Path) -> Path:
    return write_excel(path, CHANNELS, UNITS, *zip(*(column.tolist() for column in DATA.values()), strict=True))


def _log_excel_stamped(path: Path) -> Path:
    stamps = [dt.datetime(2026, 3, 1, 10) + dt.timedelta(milliseconds=round(1e3 * t)) for t in DATA["Time"]]
    columns = [stamps, *(DATA[name].tolist() for name in CHANNELS[1:])]
    headers = ["Timestamp", *(f"{name} ({UNIT[name]})" for name in CHANNELS[1:])]
    return write_excel(path, headers, *zip(*columns, strict=True))


LOGS: dict[str, Callable[[Path], Path]] = {
    "tdms": _log_tdms,
    "tdms in groups": _log_tdms_in_groups,
    "mat5": _log_mat5,
    "mat4": _log_mat4,
    "mat73": _log_mat73,
    "parquet": _log_parquet,
    "xlsx": _log_excel,
    "xlsx stamped": _log_excel_stamped,
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The paper's run at 36 ohm in every format, each with an ending that is none of its own."""
    folder = tmp_path_factory.mktemp("formats")
    return {form: make(folder / f"r36ohm {form}.csv") for form, make in LOGS.items()}


def etas(run: Run) -> list[float | None]:
    mean = reduce(run, window=5.48).mean
    return [mean.eta_trans, mean.eta_gen, mean.eta_pto]


@pytest.fixture(scope="module")
def etas_of_csv() -> list[float | None]:
    return etas(read_run(LOG))


@pytest.mark.parametrize("form", LOGS)
def test_log_is_recognised_by_content_and_gives_what_its_csv_gives(
    logs: dict[str, Path], etas_of_csv: list[float], form: str
) -> None:
    run = read_run(logs[form])
    assert {finding.kind for finding in run.findings} == ({"unit_assumed"} if form == "mat4" else set())
    assert run.fs == pytest.approx(25.0)
    assert etas(run) == pytest.approx(etas_of_csv, abs=SAME)
    # The load is that which the file states as a property; the workbooks state none.
    assert (run.load, "property" in run.load_source) == ((None, False) if "xlsx" in form else (36.0, True))


@pytest.mark.parametrize(
    "head",
    [
        bytes(64),
        LOG.read_text()[:100].encode("utf-16-le"),
        LOG.read_text()[:100].encode("utf-32"),
        struct.pack("<5i", 0, 500, 1, 0, 5) + b"time",
        struct.pack("<5i", 0, 500, 1, 0, 5) + b"ti,e\0",
        struct.pack("<5i", 60, 500, 1, 0, 5) + b"time\0",
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
        (b"CDF\x02", "NetCDF file, not a log; .*to_csv"),
        (b"MDF     4.10", r"MDF measurement \(MF4\), not a log; .*asammdf"),
        (b"ARROW1\0\0", "Feather file, not a log; .*to_parquet"),
        (b"#ROSBAG V2.0", "ROS bag, not a log; .*rostopic"),
    ],
)
def test_an_unreadable_format_is_named_with_its_export(magic: bytes, what: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(magic + bytes(range(256)))
    with pytest.raises(LogError, match=rf"^a.csv: is an? {what}"):
        open_log(tmp_path / "a.csv")


# ------------------------------------------------------------------------------- texts and notes in a workbook's cells
def book_of(folder: Path, head: Sequence[str], rows: Sequence[Sequence[object]]) -> Path:
    path = folder / "log.xlsx"
    with xlsxwriter.Workbook(str(path)) as book:
        sheet = book.add_worksheet("Run")
        for k, row in enumerate([head, *rows]):
            sheet.write_row(k, 0, row)
    return path


@pytest.mark.parametrize(
    ("cell", "factor"),
    [(lambda x: f"{x:,.0f}", 1.0), (lambda x: f"{x / 1000:.3f}".replace(".", ","), 1e-3), (lambda x: f"{x:,.1f}", 1.0)],
    ids=["thousands", "decimals", "both"],
)
def test_a_comma_in_the_texts_of_a_workbook_is_read_by_its_whole_column(
    tmp_path: Path, cell: Callable[[float], str], factor: float
) -> None:
    force = [200.0 + 9.0 * abs(k - 250) for k in range(500)]
    rows = [[0.04 * k, 0.5, cell(force[k])] for k in range(500)]
    run = read_run(book_of(tmp_path, ["Time (s)", "Velocity (m/s)", "Force (N)"], rows))
    assert run.channels["force"] == pytest.approx([factor * x for x in force], abs=0.5 * factor)


@pytest.mark.parametrize("odd", [["Time (s)", "Velocity (m/s)", "Force (N)"], ["crane stopped", "", ""]])
@pytest.mark.parametrize("place", [100, 500])
def test_a_note_or_repeated_names_in_a_workbook_are_skipped(tmp_path: Path, odd: Sequence[str], place: int) -> None:
    rows: list[Sequence[object]] = [[0.04 * k, 0.5, 300.0 + k] for k in range(500)]
    rows.insert(place, odd)
    run = read_run(book_of(tmp_path, ["Time (s)", "Velocity (m/s)", "Force (N)"], rows))
    assert run.samples == 500
    assert {f.kind for f in run.findings} <= {"missing_channel"}
