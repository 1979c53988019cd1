"""TDMS: channels of several clocks and groups are put on one clock, and what cannot be is
reported or rejected.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from winchcascade.core.errors import LogError
from winchcascade.ingest.formats.tdms import open_tdms

H = 0.04
T = H * np.arange(500)
V = np.sin(T)
P = 20.0 + T

INTERPOLATED = 1e-12
"""A straight line is interpolated to rounding."""


def wave(name: str, values: Any, group: str = "Crane", **properties: Any) -> ChannelObject:
    return ChannelObject(
        group, name, np.asarray(values), {"wf_increment": H, "wf_start_offset": 0.0} | properties
    )


def write(folder: Path, *objects: Any) -> Path:
    with TdmsWriter(str(folder / "a.tdms")) as writer:
        writer.write_segment(list(objects))
    return folder / "a.tdms"


def names(path: Path, table: str | None = None) -> list[str]:
    return [header.name for header in open_tdms(path, table=table).headers]


def test_names_units_clock_and_properties_are_those_of_the_file(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        RootObject({"load_ohm": 36.0, "operator": "nobody"}),
        GroupObject("Crane", {"operator": "crane test", "run": 3}),
        wave("Velocity", V, unit_string="m/s"),
        wave("Pressure", P.astype(np.float32), NI_UnitDescription="bar"),
        wave("Phase", np.arange(500, dtype=np.int16), unit=""),
    )
    source = open_tdms(path)
    table = source.load([0, 1, 2], None)
    assert [(h.name, h.unit) for h in source.headers] == [
        ("Velocity", "m/s"),
        ("Pressure", "bar"),
        ("Phase", None),
    ]
    assert (source.time_step, source.time_start) == (H, 0.0)
    assert source.properties == {"load_ohm": 36.0, "operator": "crane test", "run": 3.0}
    np.testing.assert_array_equal(table.values[0], V)
    np.testing.assert_allclose(table.values[1], P, rtol=1e-7)
    assert (table.stamps, table.findings) == (None, ())


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(late=st.floats(0.02, 8.0))
def test_channels_that_start_apart_agree_on_the_time_of_a_straight_line(
    tmp_path: Path, late: float
) -> None:
    path = write(
        tmp_path, wave("x", T), wave("y", 2 * T), wave("z", T + late, wf_start_offset=late)
    )
    table = open_tdms(path).load([0, 1, 2], None)
    # A shift within 1 % of a sample counts as none.
    np.testing.assert_allclose(
        table.values[2], table.values[0], atol=0.01 * H + INTERPOLATED, rtol=0
    )
    np.testing.assert_allclose(np.asarray(table.stamps), table.values[0], atol=INTERPOLATED)


def test_start_times_are_aligned_and_the_cut_is_reported(tmp_path: Path) -> None:
    start = np.datetime64("2026-03-01T10:00:00", "us")
    late: dict[str, Any] = {"wf_start_time": start + np.timedelta64(2_020_000, "us")}
    path = write(
        tmp_path,
        wave("x", T, wf_start_time=start),
        wave("y", T, wf_start_time=start),
        wave("z", T + 2.02, **late),
    )
    table = open_tdms(path).load([0, 2], None)
    np.testing.assert_allclose(table.values[0], table.values[2], atol=INTERPOLATED)
    assert [(f.kind, f.removed) for f in table.findings] == [
        ("dropped_samples", round((T[-1] + 2.02 - 448 * H) / H))
    ]
    assert open_tdms(path).load([0, 1], None).stamps is None


def test_channels_are_taken_at_the_fastest_clock_and_slower_ones_are_reported(
    tmp_path: Path,
) -> None:
    slow = [wave(name, T[::5], wf_increment=5 * H) for name in ("y", "z")]
    table = open_tdms(write(tmp_path, wave("x", T), *slow)).load([0, 1, 2], None)
    np.testing.assert_allclose(table.values[1], T[:496], atol=INTERPOLATED)
    assert [(f.kind, f.count) for f in table.findings] == [("coarse_sampling", 2)]


def test_channels_without_a_common_moment_are_rejected(tmp_path: Path) -> None:
    source = open_tdms(write(tmp_path, wave("x", T), wave("y", T, wf_start_offset=100.0)))
    with pytest.raises(LogError, match=r"a.tdms: .*overlap"):
        source.load([0, 1], None)
    assert len(source.load([1], None).values[1]) == len(T)


def test_stamps_become_seconds_since_the_first_and_texts_stay(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-03-01T10:00:00", "us") + (T * 1e6).astype("timedelta64[us]")
    note = ChannelObject("g", "note", ["a"] * 500)
    table = open_tdms(
        write(tmp_path, ChannelObject("g", "Time", stamps), ChannelObject("g", "v", V[:-3]), note)
    ).load([1, 2], 0)
    assert table.stamped
    np.testing.assert_allclose(np.asarray(table.stamps), T[:-3], atol=2e-6)
    assert np.isnan(table.values[2]).all()
    assert table.texts[2] == ["a"] * 497
    assert [(f.kind, f.removed) for f in table.findings] == [("dropped_samples", 3)]


def test_groups_with_other_channels_are_one_log_the_largest_first(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        GroupObject("Electrical", {"operator": "of the converter", "converter": "B6"}),
        GroupObject("Motion", {"operator": "of the crane"}),
        wave("vdc", T[5:], group="Electrical", wf_start_offset=5 * H),
        wave("v", V, group="Motion"),
        wave("x", T, group="Motion"),
        ChannelObject("Notes", "remark", ["a", "b"]),
    )
    source = open_tdms(path)
    table = source.load([1, 2], None)
    assert names(path) == ["v", "x", "vdc"]
    assert source.properties == {"operator": "of the crane", "converter": "B6"}
    np.testing.assert_array_equal(table.values[1], table.values[2])
    assert table.findings == ()


def test_a_second_recording_of_the_same_channels_is_reported_and_not_read(tmp_path: Path) -> None:
    groups = {"Run 1": V, "Run 2": P, "Run 3": T}
    path = write(
        tmp_path,
        *(wave(name, x, group=group) for group, x in groups.items() for name in ("v", "p")),
    )
    with pytest.raises(LogError, match="3 groups could be the log: 'Run 1', 'Run 2', 'Run 3'"):
        open_tdms(path)
    table = open_tdms(path, table="Run 1").load([0], None)
    np.testing.assert_array_equal(table.values[0], V)
    assert [(f.kind, f.count, f.action) for f in table.findings] == [
        ("unknown_column", 2, "not read")
    ]


@pytest.mark.parametrize(
    ("values", "properties", "joined"),
    [
        (T, {"wf_start_offset": 100.0}, False),
        (T[::5], {"wf_increment": 0.0}, False),
        (T[3:], {"wf_increment": 0.0}, True),
        (T[::5], {"wf_increment": 5 * H}, True),
    ],
)
def test_a_group_is_joined_only_where_its_place_in_time_is_known(
    tmp_path: Path, values: Any, properties: dict[str, float], joined: bool
) -> None:
    path = write(
        tmp_path, wave("v", V), wave("p", P), wave("vdc", values, group="Other", **properties)
    )
    assert names(path) == ["v", "p"] + ["vdc"] * joined
    assert [f.kind for f in open_tdms(path).load([0], None).findings] == ["unknown_column"] * (
        not joined
    )


def test_a_file_that_was_cut_off_is_read_to_the_last_common_sample(tmp_path: Path) -> None:
    path = tmp_path / "a.tdms"
    with TdmsWriter(str(path)) as writer:
        for k in range(0, 500, 100):
            writer.write_segment([wave("v", V[k : k + 100]), wave("p", P[k : k + 100])])
    path.write_bytes(path.read_bytes()[:-80])
    table = open_tdms(path).load([0, 1], None)
    assert len(table.values[0]) == len(table.values[1]) == 490
    assert [f.kind for f in table.findings] == ["truncated"]


@pytest.mark.parametrize("claimed", [10**6, 2**62])
def test_a_channel_that_claims_more_samples_than_bytes_is_rejected(
    tmp_path: Path, claimed: int
) -> None:
    path = write(tmp_path, wave("v", V))
    index = struct.pack("<LLQ", 10, 1, 500)
    path.write_bytes(path.read_bytes().replace(index, struct.pack("<LLQ", 10, 1, claimed)))
    with pytest.raises(LogError, match=f"a.tdms: .*{claimed}"):
        open_tdms(path)


@pytest.mark.parametrize("start", [1e17, -1e17])
def test_a_clock_that_begins_aeons_away_is_rejected(start: float, tmp_path: Path) -> None:
    from winchcascade import read_run

    with pytest.raises(LogError, match="too far from zero"):
        read_run(
            write(
                tmp_path,
                wave("Velocity", V, wf_start_offset=start),
                wave("Force", P, wf_start_offset=start),
            )
        )
