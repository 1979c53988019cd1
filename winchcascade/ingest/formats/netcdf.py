"""NetCDF: the variables over one dimension, with units, fill values and scales as their attributes
state them (CF conventions, sections 2.5, 4.4 and 8.1).

scipy reads the classic forms, h5py reads NetCDF 4.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from winchcascade.core.extras import is_installed
from winchcascade.core.quantity import find_unit
from winchcascade.ingest.formats.mat import read_mat
from winchcascade.ingest.headers import Header, recognise
from winchcascade.ingest.limits import require_numbers
from winchcascade.ingest.source import arrow_table, choose, damage_reported, moves, reject_sheet
from winchcascade.ingest.stamps import moment

NAMES = ("long_name", "standard_name")
"""Attributes that may name the channel of a variable whose own name is none."""

FILLS = ("_FillValue", "missing_value")
"""Attributes of the value that stands for a missing one."""

CALENDARS = ("standard", "gregorian", "proleptic_gregorian")
"""Calendars of real dates; in others stamps count from the first sample."""

_SINCE = re.compile(r"\s*(\w+)\s+since\s+(.+?)\s*", re.IGNORECASE)
"""Unit and first instant of stamps."""

_HDF5 = b"\x89HDF"

_STRUCTURE = frozenset(("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"))
"""Attributes by which HDF5 stores dimensions."""


class Variable(NamedTuple):
    """A variable with its dimensions and attributes."""

    name: str
    dimensions: tuple[str, ...]
    values: Any
    attributes: Mapping[str, str | float]

    @property
    def header(self) -> Header:
        """Its header: its own name, or the first of its attributes that is the name of a channel
        where its own is none.
        """
        unit = str(self.attributes.get("units", ""))
        texts = (self.name, *(str(self.attributes.get(key, "")) for key in NAMES))
        headers = [Header(text, unit or None) for text in texts if text]
        return next(filter(recognise, headers), headers[0])


class NetcdfFile(NamedTuple):
    """Variables and attributes of a file."""

    variables: list[Variable]
    attributes: Mapping[str, str | float]


def read_netcdf(path: Path, *, table: str | None = None) -> pa.Table:
    """Read a NetCDF file, or another HDF5 file as one of MATLAB.

    Parameters
    ----------
    table : name or number of the dimension along which the log lies, where there are several

    Raises
    ------
    LogError : the file is damaged, or holds no variable along a dimension
    """
    with path.open("rb") as stream:
        is_hdf5 = stream.read(len(_HDF5)) == _HDF5
    with damage_reported(path, "NetCDF file", "copy or export it again"):
        found = _hdf5(path) if is_hdf5 else _classic(path)
    if found is None:
        return read_mat(path, table=table)
    with damage_reported(path, "NetCDF file", "copy or export it again"):
        return _table(path, found, table)


def _table(path: Path, found: NetcdfFile, table: str | None) -> pa.Table:
    """The columns along the dimension that is read."""
    along: dict[str, list[Variable]] = {}
    for one in found.variables:
        if len(one.dimensions) == 1 and one.values.dtype.kind in "iuf":
            along.setdefault(one.dimensions[0], []).append(one)
    if not along:
        raise ValueError("no variable along a dimension")
    logs = [name for name, group in along.items() if moves(one.header for one in group)]
    candidates = logs or [max(along, key=lambda name: len(along[name]))]
    if table is not None and len(along) == 1:
        reject_sheet(table, path.name)
    name = choose(candidates, table, path.name, "dimension")
    columns = dict(_column(one) for one in along[name])
    read = {one.name for one in along[name]}
    left = [one.name for one in found.variables if one.name not in read and one.dimensions]
    scalars = {
        one.name: float(one.values)
        for one in found.variables
        if one.values.ndim == 0 and one.values.dtype.kind in "iuf"
    }
    more = f"{len(left)} variables along other dimensions: {', '.join(left[:8])}" if left else None
    about = {"properties": {**found.attributes, **scalars}, "not_read": more}
    about |= {"table": name} if len(along) > 1 else {}
    return arrow_table(list(columns), list(columns.values()), **about)


def _column(variable: Variable) -> tuple[Header, pa.Array]:
    """Header and values of a variable, unpacked; stamps that count from a date become dates."""
    stated, header = variable.attributes, variable.header
    raw = variable.values
    missing = np.isnan(raw) if raw.dtype.kind == "f" else np.zeros(raw.shape, dtype=bool)
    for key in FILLS:
        if isinstance(fill := stated.get(key), float):
            missing = missing | (raw == np.asarray(fill).astype(raw.dtype))
    numbers = {key: x for key, x in stated.items() if isinstance(x, float)}
    values = raw * numbers.get("scale_factor", 1.0) + numbers.get("add_offset", 0.0)
    values = values.astype(np.float64)
    values[missing] = np.nan
    since = _SINCE.fullmatch(str(stated.get("units", "")))
    unit = find_unit(since[1]) if since is not None else None
    if since is None or unit is None or unit.dimension != "time":
        return header, pa.array(values)
    began = moment(since[2].removesuffix("UTC"))
    if began is None or stated.get("calendar", CALENDARS[0]) not in CALENDARS:
        return Header(header.name, since[1]), pa.array(values)
    ticks = np.rint(np.where(missing, 0.0, values) * (unit.factor * 1e9)).astype(np.int64)
    dates = pa.array(ticks + round(began * 1e9), pa.timestamp("ns"), mask=missing)
    return Header(header.name), dates


def _classic(path: Path) -> NetcdfFile:
    """Read a file of the classic forms."""
    from scipy.io import netcdf_file

    with netcdf_file(path, mmap=False, maskandscale=False) as file:
        for one in file.variables.values():
            require_numbers(path, int(np.prod(one.shape, dtype=float)))
        stated: Any = file  # scipy declares no attributes
        variables = [
            Variable(
                name,
                tuple(one.dimensions),
                _native(one[:] if one.shape else one.getValue()),
                _attributes(one._attributes),
            )
            for name, one in stated.variables.items()
        ]
        return NetcdfFile(variables, _attributes(stated._attributes))


def _hdf5(path: Path) -> NetcdfFile | None:
    """Read a file of NetCDF 4; None for another HDF5, and without h5py."""
    if not is_installed("h5py"):
        return None
    import h5py

    with h5py.File(path) as file:
        sets = {name: one for name, one in file.items() if isinstance(one, h5py.Dataset)}
        if not any(one.attrs.get("CLASS") == b"DIMENSION_SCALE" for one in sets.values()):
            return None
        for one in sets.values():
            require_numbers(path, int(np.prod(one.shape, dtype=float)))
        variables = [
            Variable(name, tuple(_dimensions(name, one)), _native(one[()]), _attributes(one.attrs))
            for name, one in sets.items()
        ]
        return NetcdfFile(variables, _attributes(file.attrs))


def _dimensions(name: str, dataset: Any) -> Iterator[str]:
    """Names of the dimensions of a data set; a coordinate has its own."""
    for dimension in dataset.dims:
        yield dimension[0].name.strip("/") if len(dimension) else name


def _native(values: Any) -> Any:
    """Values in the order of bytes of this machine."""
    array = np.asarray(values)
    return array.astype(array.dtype.newbyteorder("="))


def _attributes(stated: Mapping[str, Any]) -> dict[str, str | float]:
    """Attributes that are a text or a single number."""
    found: dict[str, str | float] = {}
    for key, value in stated.items():
        if key in _STRUCTURE or key.startswith("_Netcdf4"):
            continue
        if isinstance(value, bytes | str):
            found[key] = value if isinstance(value, str) else value.decode("utf-8", "replace")
        elif np.size(value) == 1 and np.asarray(value).dtype.kind in "iuf":
            found[key] = float(np.asarray(value).item())
    return found
