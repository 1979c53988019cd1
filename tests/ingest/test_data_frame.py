"""A DataFrame is read like a file with the same columns: same numbers, same findings, same
faults.
"""

import csv
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest

from winchcascade import read_run, reduce
from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.run import Run
from winchcascade.reduction.run_record import reduction_json

UNITS = {
    "displacement": "m", "velocity": "m/s", "pressure": "kg/cm2", "force": "N", "torque": "N.m", "vdc": "V", "idc": "A",
}  # fmt: skip


def frame_of(path: Path) -> pd.DataFrame:
    """The columns of a log with every number as Python reads it, NaN for what is none."""
    with path.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return pd.DataFrame(
        [[float(cell) if cell else np.nan for cell in row] for row in rows], columns=names
    )


def assert_same(run: Run, other: Run) -> None:
    """To the last digit, but for name, path and digest."""
    assert np.array_equal(run.t, other.t)
    assert run.channels.keys() == other.channels.keys()
    for name, x in run.channels.items():
        assert np.array_equal(x, other.channels[name]), name
    assert run.findings == other.findings
    assert (run.fs, run.samples, run.load) == (other.fs, other.samples, other.load)
    assert run.gaps.keys() == other.gaps.keys()


def test_a_frame_reduces_to_the_result_of_its_file_to_the_last_digit(fixtures: Path) -> None:
    path = fixtures / "campaign" / "r9ohm.csv"
    results = []
    for log in (path, frame_of(path)):
        run = read_run(log, load=9.0, name="r9ohm.csv", campaign=False)
        run = msgspec.structs.replace(run, path="", sha256="")
        results.append(reduction_json(reduce(run, window=5.48)))
    assert results[0] == results[1]


def test_a_damaged_frame_has_the_findings_of_its_file(fixtures: Path, tmp_path: Path) -> None:
    frame = frame_of(fixtures / "campaign" / "r36ohm.csv").round(4)
    frame.loc[300:305, "Force (N)"] = np.nan
    frame.loc[700, "Torque (N.m)"] = 4000.0
    frame = frame.drop(index=range(1500, 1520)).reset_index(drop=True)
    frame.to_csv(tmp_path / "damaged.csv", index=False)
    from_file = read_run(tmp_path / "damaged.csv")
    assert {"not_a_number", "spike", "dropped_samples"} <= {
        finding.kind for finding in from_file.findings
    }
    assert_same(read_run(frame), from_file)


@pytest.mark.parametrize("start", [None, "2026-03-01 08:00:00", "2026-03-01 08:00:00+01:00"])
def test_an_index_of_durations_or_dates_is_the_clock(fixtures: Path, start: str | None) -> None:
    path = fixtures / "campaign" / "r36ohm.csv"
    frame = frame_of(path)
    clock = pd.to_timedelta(frame.pop("Time (s)"), unit="s")
    frame.index = pd.Index(clock if start is None else pd.Timestamp(start) + clock, name=None)
    assert_same(read_run(frame), read_run(path, campaign=False))


def test_named_channels_take_their_units_from_the_call(fixtures: Path) -> None:
    path = fixtures / "campaign" / "r36ohm.csv"
    frame = frame_of(path).set_axis(["Time (s)", *UNITS], axis=1)
    assert_same(read_run(frame, units=UNITS), read_run(path, campaign=False))
    frame["force"] /= 1024.0  # exactly representable, so that nothing is rounded
    loud = read_run(frame, units=UNITS | {"force": "kN"}).channels["force"]
    assert np.array_equal(loud, frame["force"].to_numpy() * 1000.0)


def test_two_levels_of_columns_are_names_and_units(fixtures: Path) -> None:
    path = fixtures / "campaign" / "r36ohm.csv"
    frame = frame_of(path)
    pairs = [(name.rpartition(" ")[0], name.rpartition(" ")[2]) for name in frame.columns]
    frame.columns = pd.MultiIndex.from_tuples(pairs)
    assert_same(read_run(frame), read_run(path, campaign=False))


def test_texts_objects_and_arrow_columns_are_numbers(fixtures: Path) -> None:
    path = fixtures / "campaign" / "r36ohm.csv"
    frame = frame_of(path)
    mixed = frame.astype(object)
    mixed["Force (N)"] = [
        repr(x) if k % 2 else x for k, x in enumerate(frame["Force (N)"].tolist())
    ]
    mixed["Notes"] = [{"k": k} if k % 2 else k for k in range(len(frame))]
    other = read_run(mixed)
    assert np.array_equal(other.channels["force"], read_run(path, campaign=False).channels["force"])
    for kind in ("string", "double[pyarrow]", "Float64"):
        assert_same(read_run(frame.astype(kind)), read_run(path, campaign=False))


def test_a_frame_is_never_changed_and_its_digest_follows_its_values(fixtures: Path) -> None:
    frame = frame_of(fixtures / "campaign" / "r36ohm.csv")
    frame["Pressure (kg/cm2)"] *= 1.5
    before = frame.copy()
    first = read_run(frame)
    assert not np.shares_memory(first.channels["velocity"], frame["Velocity (m/s)"].to_numpy())
    pd.testing.assert_frame_equal(frame, before)
    assert len(first.sha256) == 64
    assert read_run(frame).sha256 == first.sha256
    frame.iloc[5, 4] += 1e-9
    assert read_run(frame).sha256 != first.sha256


def test_what_is_no_frame_and_what_it_lacks_is_reported(fixtures: Path) -> None:
    path = fixtures / "campaign" / "r36ohm.csv"
    frame = frame_of(path)
    with pytest.raises(
        LogError, match=r"^bench 2: is a dict; expected the path of a log or a pandas DataFrame"
    ):
        read_run({"force": [1.0]}, name="bench 2")
    with pytest.raises(LogError, match=r"units has 'forse', but the frame has no such column"):
        read_run(frame, units={"forse": "N"})
    with pytest.raises(OptionError, match=r"units are given for a file, which names its own"):
        read_run(path, units={"force": "N"})
    with pytest.raises(LogError, match=r"no time column and no sampling interval"):
        read_run(frame.drop(columns="Time (s)"))
    with pytest.raises(LogError, match=r"^bench 2: the log has 3 rows of data"):
        read_run(frame[:3], name="bench 2")
