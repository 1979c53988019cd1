"""TDMS, MATLAB, Parquet and Excel: files are made here, and what is read back is what was written."""

from __future__ import annotations

import datetime as dt
import struct
import sys
import zipfile
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
from loops import failures
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from read_here import open_excel, open_mat, readers_here
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
LABVIEW = Path(__file__).parents[3] / "shared" / "data" / "damaged_logs" / "labview.tdms"

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


def test_tdms_start_offset_is_the_stamp_of_the_first_sample(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("v", V, wf_start_offset=2.5), wave("p", P, wf_start_offset=2.5))
    source = open_tdms(path)
    assert source.time_start == 2.5
    assert source.load([0, 1], None).stamps is None


@pytest.mark.parametrize("late", [7, 24, 60])
def test_tdms_channels_that_start_whole_samples_apart_are_shifted(tmp_path: Path, late: int) -> None:
    path = write_tdms(
        tmp_path / "a.tdms", wave("v", V), wave("x", T), wave("p", P[late:], wf_start_offset=late * H * 1.00001)
    )
    table = open_tdms(path).load([0, 1, 2], None)
    np.testing.assert_array_equal(table.values[0], V[late:])
    np.testing.assert_array_equal(table.values[2], P[late:])
    np.testing.assert_allclose(np.asarray(table.stamps), T[late:])
    assert [f.removed for f in table.findings] == ([late] if late * H > 1.0 else [])


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


def test_tdms_start_time_that_labview_never_set_is_none(tmp_path: Path) -> None:
    path = write_tdms(
        tmp_path / "a.tdms",
        wave("x", T, wf_start_time=np.datetime64("1904-01-01T00:00:00", "us")),
        wave("y", T, wf_start_time=np.datetime64("2026-03-01T10:00:00", "us")),
    )
    assert len(open_tdms(path).load([0, 1], None).values[0]) == len(T)


def test_tdms_coarser_channel_is_interpolated_onto_the_clock_of_most(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("x", T), wave("y", T), wave("z", T[::5], wf_increment=5 * H))
    source = open_tdms(path)
    table = source.load([0, 1, 2], None)
    assert source.time_step == H
    np.testing.assert_allclose(table.values[2], T[:496], atol=INTERPOLATED)
    assert table.stamps is None


def test_tdms_channels_are_taken_at_the_fastest_clock_and_slower_ones_are_reported(tmp_path: Path) -> None:
    slow = [wave(name, T[::5], wf_increment=5 * H) for name in ("y", "z")]
    table = open_tdms(write_tdms(tmp_path / "a.tdms", wave("x", T), *slow)).load([0, 1, 2], None)
    assert len(table.values[0]) == 496
    np.testing.assert_allclose(table.values[1], T[:496], atol=INTERPOLATED)
    (finding,) = table.findings
    assert (finding.kind, finding.action, finding.count) == ("coarse_sampling", "interpolated by straight lines", 2)
    assert finding.message.startswith("y, z: sampled every")


def test_tdms_wanted_channels_off_the_usual_clock_bring_their_stamps(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("x", T), wave("y", T), wave("z", T[::5], wf_increment=5 * H))
    np.testing.assert_allclose(np.asarray(open_tdms(path).load([2], None).stamps), T[::5])


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


def test_tdms_numeric_time_channel_is_handed_over_as_it_is(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", ChannelObject("g", "Time", 1e3 * T), ChannelObject("g", "v", V))
    table = open_tdms(path).load([1], 0)
    np.testing.assert_array_equal(np.asarray(table.stamps), 1e3 * T)
    assert not table.stamped


def test_tdms_text_time_channel_is_handed_over_as_texts(tmp_path: Path) -> None:
    texts = [f"10:00:{k:02d}" for k in range(5)]
    path = write_tdms(tmp_path / "a.tdms", ChannelObject("g", "Time", texts), ChannelObject("g", "v", V[:5]))
    assert open_tdms(path).load([1], 0).stamps == texts


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
    assert "beside 'Run 1' with channels of the same names, another recording: 'Run 2', 'Run 3'" in finding.message


def test_tdms_group_that_shares_one_name_is_another_recording_and_the_larger_one_is_read(tmp_path: Path) -> None:
    small = [wave(name, V, group="Short") for name in ("p", "vdc")]
    large = [wave(name, P, group="Long") for name in ("v", "p", "f")]
    source = open_tdms(write_tdms(tmp_path / "a.tdms", *small, *large))
    assert names(source) == ["v", "p", "f"]
    assert [f.kind for f in source.load([0], None).findings] == ["unknown_column"]


@pytest.mark.parametrize("other", [0.0, 1e-3], ids=["one clock", "two clocks"])
def test_tdms_groups_may_share_a_clock_that_both_wrote_down(tmp_path: Path, other: float) -> None:
    path = write_tdms(
        tmp_path / "a.tdms",
        *(ChannelObject("Motion", name, values) for name, values in {"Time": T, "v": V, "x": T}.items()),
        *(ChannelObject("Electrical", name, values) for name, values in {"Time": T + other, "vdc": P}.items()),
    )
    source = open_tdms(path)
    assert names(source) == ["Time", "v", "x"] + ["vdc"] * (other == 0.0)
    assert len(source.load([1], 0).findings) == (other > 0.0)


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
        [f"1 group beside 'Crane' {why}: 'Other'"] * bool(why)
    )


def test_tdms_stamps_of_one_group_do_not_serve_a_group_on_another_clock(tmp_path: Path) -> None:
    path = write_tdms(
        tmp_path / "a.tdms",
        *(wave(name, values, group="Motion") for name, values in {"Time": 1e3 * T, "x": T, "y": T}.items()),
        wave("vdc", T[::5], group="Electrical", wf_increment=5 * H),
    )
    table = open_tdms(path).load([1, 3], 0)
    np.testing.assert_allclose(table.values[3], table.values[1], atol=INTERPOLATED)
    assert table.stamps is None or table.stamped


def test_tdms_channel_that_was_never_filled_is_no_column(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("v", V), ChannelObject("Crane", "empty", np.empty(0)))
    assert names(open_tdms(path)) == ["v"]


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


def test_tdms_with_a_channel_lost_to_the_cut_is_rejected(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("v", V), wave("p", P))
    path.write_bytes(path.read_bytes()[:-4020])
    source = open_tdms(path)
    assert "no samples" in sentence(lambda: source.load([0, 1], None), path)


@pytest.mark.parametrize("claimed", [10**6, 2**40, 2**62])
def test_tdms_that_claims_more_samples_than_bytes_is_rejected(tmp_path: Path, claimed: int) -> None:
    path = write_tdms(tmp_path / "a.tdms", wave("v", V))
    index = struct.pack("<LLQ", 10, 1, 500)
    assert path.read_bytes().count(index) == 1
    path.write_bytes(path.read_bytes().replace(index, struct.pack("<LLQ", 10, 1, claimed)))
    assert str(claimed) in sentence(lambda: open_tdms(path), path)


def test_tdms_without_numbers_is_rejected(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "a.tdms", ChannelObject("g", "note", ["a", "b"]))
    assert "channel of numbers" in sentence(lambda: open_tdms(path), path)


@pytest.mark.skipif(not LABVIEW.exists(), reason="the example log lies in ../shared/data, which is not here")
def test_labview_example_opens_with_units_and_load() -> None:
    source = open_tdms(LABVIEW)
    assert units(source) == ["m", "m/s", "kgf/cm^2", "kgf", "N*m", "V", "A"]
    assert source.properties["load_ohm"] == 36.0
    assert {len(column) for column in source.load(range(7), None).values.values()} == {2767}


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


def test_mat_structs_that_name_fields_alike_are_distinguished(tmp_path: Path) -> None:
    path = write_mat(tmp_path / "a.mat", raw={"v": V, "p": P}, smooth={"v": P})
    assert "2 runs could be the log: 'raw', 'smooth'" in sentence(lambda: open_mat(path), path)
    source = open_mat(path, table="raw")
    assert names(source) == ["v", "p"]
    np.testing.assert_array_equal(source.load([0], None).values[0], V)


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


def test_mat_texts_of_the_usual_length_may_be_stamps(tmp_path: Path) -> None:
    stamps = [f"2026-03-01 10:00:{k:02d}" for k in range(20)]
    path = write_mat(tmp_path / "a.mat", when=cells(*stamps), v=V[:20])
    source = open_mat(path)
    table = source.load([0, 1], 0)
    assert table.stamps == stamps
    assert np.isnan(table.values[0]).all()


def test_mat_without_vectors_is_rejected(tmp_path: Path) -> None:
    path = write_mat(tmp_path / "a.mat", note="nothing", load_ohm=36.0, image=np.ones((4, 5)))
    assert "vectors" in sentence(lambda: open_mat(path), path)


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


def h5_cell(group: Any, name: str, *values: str) -> None:
    refs = [[h5_text(group.file.require_group("#refs#"), f"{name}{k}", v)] for k, v in enumerate(values)]
    dataset = group.create_dataset(name, data=np.array(refs, dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
    dataset.attrs["MATLAB_class"] = np.bytes_("cell")


def stamp_mat73(path: Path) -> Path:
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b" ") + path.read_bytes()[512:])
    return path


def write_mat73(path: Path, matrix: bool = False) -> Path:
    """Lay out a file as MATLAB does with `save -v7.3`: dimensions turned round, texts as UTF-16, cells by reference."""

    with h5py.File(path, "w", userblock_size=512) as file:
        h5_numbers(file, "load_ohm", 36.0)
        h5_text(file, "operator", "crane")
        if matrix:
            h5_numbers(file, "data", np.array([T, V, P]))
            h5_cell(file, "names", "Time", "Velocity", "Pressure")
            h5_cell(file, "units", "s", "m/s", "bar")
        else:
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


def test_mat73_matrix_with_names_is_a_table(tmp_path: Path) -> None:
    source = open_mat(write_mat73(tmp_path / "a.mat", matrix=True))
    assert names(source) == ["Time", "Velocity", "Pressure"]
    assert units(source) == ["s", "m/s", "bar"]
    np.testing.assert_array_equal(source.load([2], None).values[2], P)


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


def test_parquet_gives_names_units_and_properties(tmp_path: Path) -> None:
    source = open_parquet(write_parquet(tmp_path / "a.parquet"))
    assert names(source) == ["when", "v", "p", "text", "on", "label", "pair"]
    assert units(source) == [None, "m/s", "bar", None, None, None, None]
    assert source.properties == {"load_ohm": 36.0, "operator": "crane"}


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


def test_parquet_text_stamps_are_handed_over_as_texts(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"t": ["10:00:00", None], "v": [1, 2]}), path)
    table = open_parquet(path).load([1], 0)
    assert table.stamps == ["10:00:00", ""]
    assert not table.stamped


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


def test_ods_is_read_like_a_workbook_of_excel(tmp_path: Path) -> None:
    def row(*cells: str | float) -> str:
        texts = "<table:table-cell office:value-type='string'><text:p>{0}</text:p></table:table-cell>"
        numbers = "<table:table-cell office:value-type='float' office:value='{0}'/>"
        inner = "".join((texts if isinstance(cell, str) else numbers).format(cell) for cell in cells)
        return f"<table:table-row>{inner}</table:table-row>"

    spaces = " ".join(f"xmlns:{x}='urn:oasis:names:tc:opendocument:xmlns:{x}:1.0'" for x in ("office", "table", "text"))
    rows = "".join([row("Time", "v"), row("s", "m/s"), row(0.0, 1.5), row(0.04, "2,5")])
    sheet = f"<table:table table:name='Log'>{rows}</table:table>"
    body = f"<office:body><office:spreadsheet>{sheet}</office:spreadsheet></office:body>"
    path = tmp_path / "a.ods"
    with zipfile.ZipFile(path, "w") as book:
        book.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        book.writestr("META-INF/manifest.xml", "<manifest/>")
        book.writestr("content.xml", f"<office:document-content {spaces}>{body}</office:document-content>")
    source = open_excel(path)
    assert list(zip(names(source), units(source), strict=True)) == [("Time", "s"), ("v", "m/s")]
    np.testing.assert_array_equal(source.load([1], 0).values[1], [1.5, 2.5])


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


def test_excel_text_stamps_are_handed_over_as_texts(tmp_path: Path) -> None:
    stamps = [f"2026-03-01 10:00:{k:02d}" for k in range(5)]
    path = write_excel(tmp_path / "a.xlsx", ["Time", "v"], *([s, 1.0] for s in stamps))
    assert open_excel(path).load([1], 0).stamps == stamps


def test_excel_line_of_group_names_above_the_names_is_passed_over(tmp_path: Path) -> None:
    path = write_excel(tmp_path / "a.xlsx", ["Motion", "Motion"], ["path", "speed"], [1.0, 2.0], [3.0, 4.0])
    assert names(open_excel(path)) == ["path", "speed"]


def test_excel_without_a_table_is_rejected(tmp_path: Path) -> None:
    path = write_excel(tmp_path / "a.xlsx", ["only", "words"])
    assert "names" in sentence(lambda: open_excel(path), path)


def test_a_binary_workbook_is_read_like_any_other(tmp_path: Path) -> None:
    rows = [["Time", "Force"], ["s", "kgf"], *([0.04 * k, 100.0 + k] for k in range(300))]
    source, table = read_all(xlsb.write(tmp_path / "a.xlsb", xlsb.sheet(rows)), open_excel)
    assert names(source) == ["Time", "Force"]
    assert units(source) == ["s", "kgf"]
    assert table.values[1][-1] == 399.0


def test_a_workbook_of_excel_97_is_read_like_any_other(tmp_path: Path) -> None:
    rows: list[list[Any]] = [["Time", "Force"], ["s", "kgf"], *([0.04 * k, 100.0 + k] for k in range(300))]
    path = tmp_path / "a.xls"
    path.write_bytes(xls.book(rows))
    source, table = read_all(path, open_excel)
    assert names(source) == ["Time", "Force"]
    assert units(source) == ["s", "kgf"]
    assert table.values[1][-1] == 399.0


def test_an_old_workbook_may_lie_about_its_shared_texts(tmp_path: Path) -> None:
    path = tmp_path / "a.xls"
    path.write_bytes(xls.book([["v", "p"], *([0.1 * k, 2.0] for k in range(30))], claimed=2**32 - 1))
    source, table = read_all(path, open_excel)
    assert names(source) == ["v", "p"]
    assert table.values[1].tolist() == [2.0] * 30


def test_an_old_workbook_with_a_password_is_rejected_as_such(tmp_path: Path) -> None:
    path = tmp_path / "a.xls"
    path.write_bytes(xls.book([["v"], [1.0]], top=xls.record(0x2F, b"\1".ljust(54, b"\0"))))
    assert "locked with a password" in sentence(lambda: open_excel(path), path)


def test_a_panic_of_the_reader_leaves_the_sentence_alone(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = xlsb.write(tmp_path / "a.xlsb", xlsb.sheet([["v"], [1.0]]), name_letters=1_000_000)
    assert "damaged or breaks off" in sentence(lambda: open_log(path), path)
    assert capfd.readouterr().err == ""


def compound_file(*streams: str) -> bytes:
    """Lay out an OLE compound file that holds empty streams: what an encrypted workbook is wrapped in."""
    end, free, none = 0xFFFFFFFE, 0xFFFFFFFF, 0xFFFFFFFF

    def entry(name: str, kind: int, right: int, child: int) -> bytes:
        text = f"{name}\0".encode("utf-16-le")
        head = text.ljust(64, b"\0") + struct.pack("<HBBLLL", len(text), kind, 1, none, right, child)
        return head + bytes(36) + struct.pack("<LQ", end, 0)

    header = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(16) + struct.pack("<5H", 0x3E, 3, 0xFFFE, 9, 6) + bytes(6)
    header += struct.pack("<LLLLLLLLL", 0, 1, 1, 0, 4096, end, 0, end, 0) + struct.pack("<109L", 0, *[free] * 108)
    table = struct.pack("<128L", 0xFFFFFFFD, end, *[free] * 126)
    entries = [entry("Root Entry", 5, none, 1)]
    entries += [entry(s, 2, k + 2 if k + 1 < len(streams) else none, none) for k, s in enumerate(streams)]
    return header + table + b"".join(entries).ljust(512, b"\0")


def test_excel_with_a_password_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    path.write_bytes(compound_file("EncryptionInfo", "EncryptedPackage"))
    assert "password" in sentence(lambda: open_excel(path), path)


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


@pytest.mark.parametrize("form", list(FORMATS))
def test_source_hands_over_only_the_wanted_columns(tmp_path: Path, form: str) -> None:
    make, opener = FORMATS[form]
    source = opener(make(tmp_path / f"a.{form}"))
    table = source.load([1], None)
    assert list(table.values) == [1]
    assert table.stamps is None


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


def _log_parquet_named(path: Path) -> Path:
    table = pa.table({f"{name} [{UNIT[name]}]": values for name, values in DATA.items()})
    pq.write_table(table.replace_schema_metadata({"load_ohm": "36"}), path)
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
    "parquet named": _log_parquet_named,
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


@pytest.mark.parametrize("form", [form for form in LOGS if form != "mat4"])
def test_log_is_recognised_by_content_and_gives_what_its_csv_gives(
    logs: dict[str, Path], etas_of_csv: list[float], form: str
) -> None:
    run = read_run(logs[form])
    assert run.findings == ()
    assert run.fs == pytest.approx(25.0)
    assert etas(run) == pytest.approx(etas_of_csv, abs=SAME)
    states_its_load(run, form)


def states_its_load(run: Run, form: str) -> None:
    """The load is that which the file states as a property; the workbooks state none."""
    assert (run.load, "property" in run.load_source) == ((None, False) if "xlsx" in form else (36.0, True))


def test_log_in_mat4_needs_only_units_that_it_cannot_name(logs: dict[str, Path], etas_of_csv: list[float]) -> None:
    run = read_run(logs["mat4"])
    assert {finding.kind for finding in run.findings} == {"unit_assumed"}
    assert etas(run) == pytest.approx(etas_of_csv, abs=SAME)
    states_its_load(run, "mat4")


@pytest.mark.parametrize("form", ["tdms", "mat5", "mat4", "mat73", "parquet", "xlsx"])
def test_the_ending_of_a_name_does_not_matter(logs: dict[str, Path], tmp_path: Path, form: str) -> None:
    def check(suffix: str) -> None:
        path = tmp_path / f"log{suffix}"
        path.write_bytes(logs[form].read_bytes())
        assert read_run(path).channels.keys() == channels

    with readers_here():
        channels = read_run(logs[form]).channels.keys()
        assert len(channels) > 5
        assert failures(check, [(s,) for s in (".csv", ".tdms", ".mat", ".parquet", ".xlsx", ".xls", "")]) == []


def test_a_load_that_is_given_is_taken_in_place_of_that_of_the_file(logs: dict[str, Path]) -> None:
    assert read_run(logs["tdms"], load=18.0).load == 18.0


@pytest.mark.parametrize(("order", "mopt"), [("<", 0), (">", 1000)])
def test_mat4_is_recognised_in_either_byte_order(tmp_path: Path, order: str, mopt: int) -> None:
    path = tmp_path / "a"
    with path.open("wb") as file:
        for name, values in DATA.items():
            file.write(struct.pack(f"{order}5i", mopt, len(values), 1, 0, len(name) + 1) + name.encode() + b"\0")
            file.write(values.astype(f"{order}f8").tobytes())
    assert read_run(path).samples == 2767


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
