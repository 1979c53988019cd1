"""MATLAB objects and what Simulink saves: signals and series as structs are read, objects are rejected with their export."""

from __future__ import annotations

import struct
from pathlib import Path

import h5py
import numpy as np
import pytest
from campaign_log import ROWS, SAME, clean, efficiencies
from scipy.io import savemat

from winchcascade import read_run
from winchcascade.core.errors import LogError

HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
NAMES = ["time", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc"]
VALUES = np.array([[float(cell) for cell in row] for row in ROWS])
UNITS = {"time": "s", "displacement": "m", "velocity": "m/s", "pressure": "kgf/cm2", "force": "N", "torque": "N.m"}
UNITS |= {"vdc": "V", "idc": "A"}


def element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def opaque(name: bytes, kind: bytes) -> bytes:
    """An object as MATLAB v7 saves it."""
    numbers = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    inner = element(14, numbers + element(6, np.arange(6, dtype="<u4").tobytes()))
    texts = element(1, name) + element(1, b"MCOS") + element(1, kind)
    return element(14, element(6, struct.pack("<II", 17, 0)) + texts + inner)


def test_the_signals_of_simulink_are_named_by_their_labels(tmp_path: Path) -> None:
    signals = np.array([{"values": VALUES[:, k], "label": name} for k, name in enumerate(NAMES) if k], dtype=object)
    savemat(tmp_path / "a.mat", {"out": {"time": VALUES[:, 0], "signals": signals}, "units": UNITS})
    assert efficiencies(read_run(tmp_path / "a.mat")) == pytest.approx(clean(), abs=SAME)


def test_time_series_saved_as_structs_are_columns(tmp_path: Path) -> None:
    series = {name: {"Time": VALUES[:, 0], "Data": VALUES[:, k]} for k, name in enumerate(NAMES) if k}
    savemat(tmp_path / "a.mat", series | {"units": UNITS})
    assert efficiencies(read_run(tmp_path / "a.mat")) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    ("kind", "export"),
    [
        (b"timetable", "writetimetable(run, 'run.csv')"),
        (b"table", "writetable(run, 'run.csv')"),
        (b"timeseries", "s.time = run.Time; s.velocity = run.Data; save('run.mat', '-struct', 's')"),
        (b"Simulink.SimulationData.Dataset", "save('run.mat', '-struct', 's') with a struct s of vectors"),
    ],
)
def test_an_object_is_rejected_with_its_export(kind: bytes, export: str, tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(HEAD + opaque(b"other", kind) + opaque(b"run", kind))
    with pytest.raises(LogError) as caught:
        read_run(tmp_path / "a.mat")
    assert f"holds 'run', a {kind.decode()}, which only MATLAB can read" in str(caught.value)
    assert str(caught.value).endswith(f"export it in MATLAB by {export}.")


def test_an_object_of_v73_is_rejected_with_its_export(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        item = file.create_dataset("run", data=np.arange(6, dtype="u4")[None])
        item.attrs["MATLAB_class"], item.attrs["MATLAB_object_decode"] = np.bytes_("timetable"), np.int32(3)
    content = bytearray((tmp_path / "a.mat").read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(LogError, match="holds 'run', a timetable, which only MATLAB can read"):
        read_run(tmp_path / "a.mat")


def test_an_object_beside_vectors_is_reported_and_not_read(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {name: VALUES[:, k] for k, name in enumerate(NAMES)} | {"units": UNITS})
    with (tmp_path / "a.mat").open("ab") as file:
        file.write(opaque(b"notes", b"table"))
    run = read_run(tmp_path / "a.mat")
    assert [(f.kind, f.message) for f in run.findings] == [("unknown_column", "MATLAB objects: notes (table)")]
