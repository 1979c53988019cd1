"""NetCDF of both kinds: variables along one dimension in SI units, dates, missing values."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from read_here import readers_here
from scipy.io import netcdf_file

from winchcascade.core.errors import LogError
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run

ROWS = 400
T = np.arange(ROWS) / 25.0
V = 0.5 * np.sin(0.3 * T)
FORCE = 2000.0 + 50.0 * np.cos(T)
VARIABLES: dict[str, tuple[Any, dict[str, Any]]] = {
    "time": (T, {"units": "seconds since 2026-05-14 09:30:00"}),
    "line_velocity": (60.0 * V, {"units": "m/min"}),
    "ch3": (np.rint(FORCE / 0.5).astype(np.int32), {
        "units": "N", "long_name": "line tension", "scale_factor": 0.5, "_FillValue": np.int32(-1)
    }),
}  # fmt: skip
"""Values and attributes of a log; the force is packed."""


def classic(path: Path, version: int = 1) -> None:
    file: Any = netcdf_file(path, "w", version=version)
    with file:
        file.load_ohm = 36.0
        file.createDimension("time", None)
        file.createDimension("mode", 3)
        for name, (values, stated) in VARIABLES.items():
            variable = file.createVariable(name, values.dtype.newbyteorder(">"), ("time",))
            variable[:] = values
            for key, value in stated.items():
                setattr(variable, key, value)
        file.createVariable("frequency", "f8", ("mode",))[:] = np.ones(3)


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.attrs["load_ohm"] = 36.0
        for name, (values, stated) in VARIABLES.items():
            variable = file.create_dataset(name, data=values)
            variable.attrs.update(stated)
        file["time"].make_scale("time")
        for name in ("line_velocity", "ch3"):
            file[name].dims[0].attach_scale(file["time"])


WRITERS: dict[str, Callable[[Path], None]] = {
    "classic": classic,
    "64 bit offset": lambda path: classic(path, 2),
    "NetCDF 4": hdf5,
}


def read(path: Path) -> Run:
    with readers_here():
        return read_run(path)


@pytest.mark.parametrize("form", WRITERS)
def test_variables_are_read_in_si_units(tmp_path: Path, form: str) -> None:
    WRITERS[form](tmp_path / "a.log")
    run = read(tmp_path / "a.log")
    np.testing.assert_allclose(run.t - run.t[0], T, atol=1e-9)
    np.testing.assert_allclose(run.channels["velocity"], V, atol=1e-12)
    np.testing.assert_allclose(run.channels["force"], FORCE, atol=0.25)
    assert run.load == 36.0
    assert run.started == 1778751000.0


def test_a_filled_value_is_missing(tmp_path: Path) -> None:
    classic(tmp_path / "a.nc")
    with netcdf_file(tmp_path / "a.nc", "a") as file:
        file.variables["ch3"][100] = -1
    run = read(tmp_path / "a.nc")
    assert "not_a_number" in {finding.kind for finding in run.findings}
    np.testing.assert_allclose(run.channels["force"], FORCE, atol=1.0)


def test_another_file_of_hdf5_is_read_as_one_of_matlab(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["velocity"], file["force"] = T, V, FORCE
    np.testing.assert_allclose(read(tmp_path / "a.h5").channels["velocity"], V)


def test_a_file_without_a_variable_along_a_dimension_is_rejected(tmp_path: Path) -> None:
    with netcdf_file(tmp_path / "a.nc", "w") as file:
        file.createVariable("x", "f8", ())[...] = 1.0
    with pytest.raises(LogError):
        read(tmp_path / "a.nc")


@pytest.mark.parametrize("form", WRITERS)
def test_a_file_cut_off_anywhere_is_read_in_part_or_rejected(tmp_path: Path, form: str) -> None:
    WRITERS[form](tmp_path / "whole")
    whole = (tmp_path / "whole").read_bytes()
    for share in np.linspace(0.0, 0.999, 15):
        (tmp_path / "a.nc").write_bytes(whole[: int(share * len(whole))])
        with suppress(LogError):
            assert read(tmp_path / "a.nc").samples > 0
