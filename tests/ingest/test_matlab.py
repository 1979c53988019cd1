"""MATLAB files: vectors, structs, matrices with names and what Simulink saves are columns;
objects are rejected.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
import pytest
from campaign_log import ROWS, SAME, clean, efficiencies
from read_here import open_mat, readers_here
from scipy.io import savemat
from seeds import seeds

from winchcascade import read_run
from winchcascade.core.errors import LogError

H = 0.04
T = H * np.arange(500)
V = np.sin(T)
P = 20.0 + T

HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
NAMES = ["time", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc"]
VALUES = np.array([[float(cell) for cell in row] for row in ROWS])
UNITS = dict(zip(NAMES, ["s", "m", "m/s", "kgf/cm2", "N", "N.m", "V", "A"], strict=True))


def write(folder: Path, **variables: Any) -> Path:
    savemat(folder / "a.mat", variables, oned_as="column")
    return folder / "a.mat"


def headers(path: Path) -> dict[str, str | None]:
    return {header.name: header.unit for header in open_mat(path).headers}


@pytest.mark.parametrize(("form", "compressed"), [("4", False), ("5", True)])
def test_vectors_of_the_usual_length_are_columns(
    tmp_path: Path, form: Literal["4", "5"], compressed: bool
) -> None:
    path = tmp_path / "a.mat"
    variables = {
        "t": T,
        "v": V[np.newaxis, :],
        "p": P[:, np.newaxis],
        "other": V[:7],
        "R_L": 36.0,
        "Fs": 25.0,
    }
    savemat(path, variables, format=form, do_compression=compressed)
    source = open_mat(path)
    table = source.load([1, 2], 0)
    assert [header.name for header in source.headers] == ["t", "v", "p"]
    assert source.properties == {"R_L": 36.0, "Fs": 25.0}
    assert source.time_step == H
    for column, expected in ((table.stamps, T), (table.values[1], V), (table.values[2], P)):
        np.testing.assert_array_equal(np.asarray(column), expected)


def test_fields_of_structs_are_columns_with_units_from_a_struct(tmp_path: Path) -> None:
    log = {
        "v": V,
        "p": P,
        "dt": H,
        "units": {"v": "m/s", "p": "bar"},
        "inner": {"idc": V.astype(np.float32)},
    }
    path = write(tmp_path, log=log, note="crane")
    assert headers(path) == {"v": "m/s", "p": "bar", "idc": None}
    assert open_mat(path).time_step == H
    assert open_mat(path).properties == {"dt": H, "note": "crane"}


@pytest.mark.parametrize("turned", [False, True])
def test_a_matrix_with_names_is_a_table(tmp_path: Path, turned: bool) -> None:
    matrix = np.column_stack([T, V, P])
    names = np.array(["Time", "Velocity", "Pressure"], dtype=object)
    path = write(
        tmp_path,
        data=matrix.T if turned else matrix,
        Names=names,
        units=np.array(["s  ", "m/s", "bar"]),
    )
    assert headers(path) == {"Time": "s", "Velocity": "m/s", "Pressure": "bar"}
    np.testing.assert_array_equal(open_mat(path).load([1], None).values[1], V)


@pytest.mark.parametrize(
    ("tag", "broken"),
    [(b"\x10\0\x03\0m/s", b"\xe8\0\x03\0m/s"), (b"\x05\0\0\0\x08\0\0\0", b"\x05\0\0\0\0\0\0\0")],
    ids=["type", "shape"],
)
def test_a_broken_tag_is_rejected_and_the_process_lives(
    tmp_path: Path, tag: bytes, broken: bytes
) -> None:
    path = write(tmp_path, v=V, note="m/s")
    path.write_bytes(path.read_bytes().replace(tag, broken))
    with pytest.raises(LogError, match=r"^a.mat: .*damaged"):
        read_run(path)


def test_v73_may_hold_itself_and_needs_h5py(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(seeds("mat73")[0])
    with h5py.File(path, "r+") as file:
        file.create_dataset("nothing", data=np.array([0, 0], np.uint64)).attrs["MATLAB_empty"] = (
            np.uint8(1)
        )
    assert headers(path)["Velocity"] == "m/s"
    with h5py.File(path, "r+") as file:
        file["log/again"] = file["log"]
    with pytest.raises(LogError, match=r"'log', 'log\.again'"):
        open_mat(path)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(LogError, match=r"pip install \"winchcascade\[mat73\]\""):
        open_mat(path)


def test_the_signals_of_simulink_and_series_as_structs_are_named_by_their_labels(
    tmp_path: Path,
) -> None:
    columns = {name: VALUES[:, k] for k, name in enumerate(NAMES) if k}
    signals = np.array([{"values": x, "label": name} for name, x in columns.items()], dtype=object)
    series: dict[str, Any] = {
        name: {"Time": VALUES[:, 0], "Data": x} for name, x in columns.items()
    }
    for variables in ({"out": {"time": VALUES[:, 0], "signals": signals}}, series):
        with readers_here():
            assert efficiencies(
                read_run(write(tmp_path, **variables, units=UNITS))
            ) == pytest.approx(clean(), abs=SAME)


def element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def opaque(name: bytes, kind: bytes) -> bytes:
    """An object as MATLAB v7 saves it."""
    numbers = (
        element(6, struct.pack("<II", 13, 0))
        + element(5, struct.pack("<ii", 6, 1))
        + element(1, b"")
    )
    inner = element(14, numbers + element(6, np.arange(6, dtype="<u4").tobytes()))
    texts = element(1, name) + element(1, b"MCOS") + element(1, kind)
    return element(14, element(6, struct.pack("<II", 17, 0)) + texts + inner)


@pytest.mark.parametrize(
    ("kind", "export"),
    [
        (b"timetable", "writetimetable(run, 'run.csv')"),
        (
            b"timeseries",
            "s.time = run.Time; s.velocity = run.Data; save('run.mat', '-struct', 's')",
        ),
        (
            b"Simulink.SimulationData.Dataset",
            "save('run.mat', '-struct', 's') with a struct s of vectors",
        ),
    ],
)
def test_an_object_is_rejected_with_its_export(kind: bytes, export: str, tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(HEAD + opaque(b"other", kind) + opaque(b"run", kind))
    with pytest.raises(LogError, match=f"'run', a {kind.decode()}") as caught:
        open_mat(tmp_path / "a.mat")
    assert export in str(caught.value)


def test_an_object_of_v73_is_rejected(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        item = file.create_dataset("run", data=np.arange(6, dtype="u4")[None])
        item.attrs["MATLAB_class"], item.attrs["MATLAB_object_decode"] = (
            np.bytes_("timetable"),
            np.int32(3),
        )
    with pytest.raises(LogError, match="'run', a timetable"):
        open_mat(tmp_path / "a.mat")


def test_an_object_beside_vectors_is_reported_and_not_read(tmp_path: Path) -> None:
    path = write(tmp_path, **{name: VALUES[:, k] for k, name in enumerate(NAMES)}, units=UNITS)
    path.write_bytes(path.read_bytes() + opaque(b"notes", b"table"))
    with readers_here():
        assert [f.kind for f in read_run(path).findings] == ["unknown_column"]
