"""A simulation as a log: the headers of a measured one, then what no sensor sees, which marks it as simulated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.files import write_whole
from winchcascade.core.quantity import find_unit
from winchcascade.core.run import CHANNELS, SIMULATED_HEADERS

if TYPE_CHECKING:
    from winchcascade.rig.simulate import Simulation

LOGGED = ("displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")
"""Channels of a log, in the order of its columns."""


def write_log(simulation: Simulation, path: Path, *, force: bool = False) -> None:
    """Write a simulation as CSV; whole or not at all.

    Raises
    ------
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    write_whole(path, lambda part: _fill(simulation, part), force=force)


def _fill(simulation: Simulation, path: Path) -> None:
    run = simulation.run
    columns, headers = [run.t], ["Time (s)"]
    for name in LOGGED:
        channel = CHANNELS[name]
        unit = find_unit(channel.unit)
        factor = 1.0 if unit is None else unit.factor
        columns.append(run.channels[name] / factor)
        headers.append(channel.header)
    columns += [simulation.rpm_gen, simulation.i_s, simulation.torque_em]
    header = ",".join([*headers, *SIMULATED_HEADERS])
    stamps = "%.6f" if run.t[-1] < 1e6 else "%.3f"
    np.savetxt(
        path,
        np.column_stack(columns),
        fmt=[stamps] + ["%.9g"] * (len(columns) - 1),
        delimiter=",",
        header=header,
        comments="",
    )
