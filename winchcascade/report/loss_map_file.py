"""A loss map as a file for look-up tables: CSV, MATLAB or JSON.

Rows of the table follow the breakpoints of the load, columns those of the motion. Outside of the
hull of the points a cell of the table is NaN, in JSON null. The grid has a row for each cell, with
the uncertainty, and also where no data lie.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes, write_content
from winchcascade.core.matlab_file import matlab_bytes
from winchcascade.core.run import Signal
from winchcascade.core.version import GENERATOR
from winchcascade.diagnosis.stages.stage_map import LossMap

SCHEMA = "winchcascade/loss_map/2"

ENDINGS = (".csv", ".mat", ".json")

FIELDS = {
    "speed": "speed_rad_s", "torque": "torque_nm", "velocity": "velocity_m_s", "force": "force_n", "flow": "flow_m3_s",
    "pressure": "pressure_pa", "voltage": "voltage_v", "current": "current_a",
}  # fmt: skip
"""Names of the axes in files."""


def check_ending(path: Path) -> None:
    """Reject a file whose ending names no format; OptionError."""
    if path.suffix.casefold() not in ENDINGS:
        raise OptionError(f"--loss-map {path}: expected a file that ends in .csv, .mat or .json.")


def write_loss_map(found: LossMap, path: Path, source: str, *, force: bool = False) -> None:
    """Write a loss map in the format that the ending of the file names; beside a CSV its grid,
    `NAME_grid.csv`.

    Parameters
    ----------
    source : log or campaign that the map was made from

    Raises
    ------
    OptionError : an ending that names no format
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
    to replace it
    """
    check_ending(path)
    record, ending = _record(found, source), path.suffix.casefold()
    if ending == ".csv":
        table, grid = _csv(record, found)
        write_content(path.with_name(f"{path.stem}_grid.csv"), grid, force=force)
        write_content(path, table, force=force)
    elif ending == ".mat":
        write_content(path, matlab_bytes("loss_map", record), force=force)
    else:
        write_content(
            path, json_bytes(msgspec.to_builtins(record, enc_hook=np.ndarray.tolist)), force=force
        )


def _record(found: LossMap, source: str) -> dict[str, Any]:
    """The map with the names of the interface."""
    motion, load = (FIELDS[name] for name in found.axes)
    rows, parts = found.data.rows, found.data.parts
    moves = rows.axes[:, 0] != 0.0
    x, y, power_in, power_out, stored, duration = found.points.T
    return {
        "schema": SCHEMA,
        "written_by": GENERATOR,
        "source": source,
        "stage_in": found.path.into.name,
        "stage_out": found.path.out.name,
        load: found.load,
        motion: found.motion,
        "loss_w": np.where(found.inside, found.loss, np.nan),
        "loss_standard_uncertainty_w": np.where(found.inside, found.u_loss, np.nan),
        "grid": {
            "loss_w": found.loss,
            "loss_standard_uncertainty_w": found.u_loss,
            "inside": found.inside * 1.0,
        },
        "hull": {motion: found.hull[:, 0], load: found.hull[:, 1]},
        "laws": {
            one.name.partition("(")[0]: {
                name: getattr(one.number, name) for name in ("value", "low", "high", "unit")
            }
            | {"alternatives": list(one.alternatives)}
            for one in found.laws
        },
        "held_out_w": found.held_out,
        "energy_lost_j": found.energy,
        "points": {
            "log": [parts[k].run.name for k in rows.part[moves]],
            load: y,
            motion: x,
            "power_in_w": power_in,
            "power_out_w": power_out,
            "stored_w": stored,
            "loss_w": found.lost,
            "duration_s": duration,
        },
    }


def _csv(record: dict[str, Any], found: LossMap) -> tuple[bytes, bytes]:
    """The table under its breakpoints of the motion, after lines of comment with source and laws;
    and the grid.
    """
    motion, load = (FIELDS[name] for name in found.axes)
    laws = ", ".join(
        f"{name} {one['value']:.6g} {one['unit']}" for name, one in record["laws"].items()
    )
    head = (
        f"# Loss map by {GENERATOR} from "
        f"{' '.join(str(record['source']).replace(',', ';').split())}\n"
        f"# loss in W from {record['stage_in']} to {record['stage_out']}\n"
        f"# laws: {laws or 'none'}\n"
    )
    x, y = np.meshgrid(found.motion, found.load)
    above = ",".join([f"{load}\\{motion}", *(f"{speed:.9g}" for speed in found.motion)])
    grid = [one.ravel() for one in (x, y, found.loss, found.u_loss, found.inside)]
    return (
        _written(
            f"{head}# rows: {load}, columns: {motion}\n{above}",
            np.column_stack([found.load, record["loss_w"]]),
        ),
        _written(
            f"{head}{motion},{load},loss_w,loss_standard_uncertainty_w,inside",
            np.column_stack(grid),
        ),
    )


def _written(header: str, rows: Signal) -> bytes:
    """Rows under a header as CSV."""
    file = io.BytesIO()
    np.savetxt(file, rows, fmt="%.9g", delimiter=",", header=header, comments="")
    return file.getvalue()
