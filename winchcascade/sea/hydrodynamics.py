"""Coefficients of a float in heave as Capytaine (NetCDF) and BEMIO of WEC-Sim (HDF5) write them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.extras import require
from winchcascade.core.run import Signal
from winchcascade.sea.line_motion import FloatResponse, read_response
from winchcascade.sea.wave_spectra import ComplexSignal

HEAVE = 2
"""Number of heave among the six motions of a body."""

FADED = 0.005
"""Share of its first value below which the memory of a float is left out. [1]"""

HDF5, NETCDF3 = b"\x89HDF", b"CDF"
"""First bytes of a file of HDF5, as NetCDF 4 is, and of NetCDF 3."""

Variable = tuple[tuple[str, ...], np.ndarray[Any, Any]]
"""Names of the dimensions of an array, and the array."""


class Hydrodynamics(msgspec.Struct, frozen=True):
    """A float that heaves, SI units: frequencies, (k,) [rad/s], added mass [kg] and radiation
    damping [N s/m] there, complex excitation per wave amplitude, (k,) [N/m], mass [kg] and
    hydrostatic stiffness [N/m].
    """

    omega: Signal
    added: Signal
    damping: Signal
    excitation: ComplexSignal
    mass: float
    stiffness: float

    @property
    def response(self) -> FloatResponse:
        """Excitation as what `FloatResponse.at` interpolates."""
        return FloatResponse(self.omega / (2.0 * np.pi), self.excitation)

    def memory(self, step: float) -> tuple[Signal, float]:
        """Retardation function at even steps, (m,) [N/m], and added mass at infinite frequency
        [kg] (Cummins 1962).
        """
        omega, damping = np.append(0.0, self.omega), np.append(0.0, self.damping)
        longest = np.pi / float(np.max(np.diff(omega)))
        t = np.arange(0.0, longest, step)
        memory = np.array(
            [2.0 / np.pi * np.trapezoid(damping * np.cos(omega * now), omega) for now in t]
        )
        late = np.flatnonzero(np.abs(memory) > FADED * np.max(np.abs(memory)))
        kept = memory[: (late[-1] + 1 if late.size else 1)]
        own = t[: kept.size]
        of_memory = [np.trapezoid(kept * np.sin(w * own), own) / w for w in self.omega]
        return kept, float(np.mean(self.added + np.array(of_memory)))


def read_float(path: Path) -> FloatResponse | Hydrodynamics:
    """Read what moves a line: coefficients where the file is of NetCDF or HDF5, else a response.
    Raises as its readers.
    """
    try:
        with path.open("rb") as file:
            head = file.read(len(HDF5))
    except OSError as fault:
        raise OptionError(
            f"--float {path}: cannot be read ({fault}); expected a response or coefficients."
        ) from None
    return read_hydrodynamics(path) if head.startswith((HDF5, NETCDF3)) else read_response(path)


def read_hydrodynamics(path: Path) -> Hydrodynamics:
    """Read the heave of the first body of a file.

    Raises
    ------
    OptionError : the file is of neither program, lacks a coefficient, or needs h5py
    """
    try:
        if path.read_bytes().startswith(NETCDF3):
            found = _capytaine(_netcdf(path))
        else:
            require("h5py", f"--float {path}")
            import h5py

            with h5py.File(path) as file:
                found = (
                    _bemio(file) if "simulation_parameters" in file else _capytaine(_of_hdf5(file))
                )
    except (KeyError, ValueError, OSError, IndexError) as fault:
        raise OptionError(
            f"--float {path}: a part is missing or wrong ({fault}); expected coefficients of a body "
            f"in heave by Capytaine (NetCDF) or BEMIO (HDF5)."
        ) from None
    order = np.argsort(found.omega)
    kept = order[np.isfinite(found.omega[order]) & (found.omega[order] > 0.0)]
    numbers = {
        name: getattr(found, name)[kept] for name in ("omega", "added", "damping", "excitation")
    }
    if (
        kept.size < 2
        or not all(np.isfinite(x).all() for x in numbers.values())
        or found.mass <= 0.0
    ):
        raise OptionError(
            f"--float {path}: expected two frequencies or more above 0, finite coefficients and a "
            f"mass above 0."
        )
    return msgspec.structs.replace(found, **numbers)


def _netcdf(path: Path) -> Mapping[str, Variable]:
    """Variables of a file of NetCDF 3."""
    from scipy.io import netcdf_file

    with netcdf_file(path, mmap=False) as file:
        return {
            name: (tuple(one.dimensions), np.array(one[:])) for name, one in file.variables.items()
        }


def _of_hdf5(file: Any) -> Mapping[str, Variable]:
    """Variables of a file of NetCDF 4."""
    found = {}
    for name, one in file.items():
        scales = [
            one.dims[k][0].name.strip("/") if len(one.dims[k]) else name for k in range(one.ndim)
        ]
        found[name] = tuple(scales), np.array(one[()])
    return found


def _capytaine(variables: Mapping[str, Variable]) -> Hydrodynamics:
    """Heave of a data set of Capytaine, whose time factor is exp(-i omega t): excitation is
    conjugated.
    """

    def of(name: str, real: bool = True) -> np.ndarray[Any, Any]:
        dimensions, values = variables[name]
        place: dict[str, Any] = {"radiating_dof": _heave(variables, "radiating_dof")}
        place |= {
            "influenced_dof": _heave(variables, "influenced_dof"),
            "omega": slice(None),
            "complex": slice(None),
        }
        found = values[tuple(place.get(one, 0) for one in dimensions)]
        if real:
            return np.asarray(found, dtype=np.float64)
        two = np.moveaxis(
            found, [one for one in dimensions if one in ("complex", "omega")].index("complex"), 0
        )
        return np.asarray(two[0] - 1j * two[1])

    forces = (
        ["excitation_force"]
        if "excitation_force" in variables
        else ["diffraction_force", "Froude_Krylov_force"]
    )
    return Hydrodynamics(
        omega=np.asarray(variables["omega"][1], dtype=np.float64),
        added=of("added_mass"),
        damping=of("radiation_damping"),
        excitation=np.sum([of(name, real=False) for name in forces], axis=0),
        mass=float(of("inertia_matrix")),
        stiffness=float(of("hydrostatic_stiffness")),
    )


def _heave(variables: Mapping[str, Variable], dimension: str) -> int:
    """Place of heave among the motions of a data set; the only one where there is one."""
    if dimension not in variables:
        return 0
    raw = variables[dimension][1]
    joined = (
        [b"".join(row.tolist()) for row in raw] if raw.ndim > 1 else np.atleast_1d(raw).tolist()
    )
    texts = [
        name.decode(errors="replace") if isinstance(name, bytes) else str(name) for name in joined
    ]
    known = [k for k, text in enumerate(texts) if "heave" in text.casefold()]
    if not known and len(texts) > 1:
        raise ValueError(f"no heave among {', '.join(texts)}")
    return known[0] if known else 0


def _bemio(file: Any) -> Hydrodynamics:
    """Heave of the first body of a file of BEMIO, whose coefficients are divided by density,
    gravity and frequency.
    """
    about, body = file["simulation_parameters"], file["body1"]
    omega = np.ravel(about["w"][()]).astype(np.float64)
    rho, g = (float(np.ravel(about[name][()])[0]) for name in ("rho", "g"))
    coefficients = body["hydro_coeffs"]

    def matrix(name: str) -> Any:
        return np.array(coefficients[name][()])

    re, im = (matrix(f"excitation/{part}")[HEAVE, 0] for part in ("re", "im"))
    return Hydrodynamics(
        omega=omega,
        added=rho * matrix("added_mass/all")[HEAVE, HEAVE],
        damping=rho * omega * matrix("radiation_damping/all")[HEAVE, HEAVE],
        excitation=rho * g * (re + 1j * im),
        mass=rho * float(np.ravel(body["properties/disp_vol"][()])[0]),
        stiffness=rho * g * float(matrix("linear_restoring_stiffness")[HEAVE, HEAVE]),
    )
