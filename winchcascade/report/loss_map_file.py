"""A loss map as a file for look-up tables: CSV, MATLAB or JSON.

Rows of the file follow the breakpoints of torque, columns those of speed. Outside of the hull of the points a cell is NaN, in
JSON null.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes, write_content
from winchcascade.core.matlab_file import matlab_bytes
from winchcascade.core.version import GENERATOR
from winchcascade.reduction.loss_map import LossMap

SCHEMA = "winchcascade/loss_map/1"

ENDINGS = (".csv", ".mat", ".json")


def check_ending(path: Path) -> None:
    """Reject a file whose ending names no format; OptionError."""
    if path.suffix.casefold() not in ENDINGS:
        raise OptionError(f"--loss-map {path}: expected a file that ends in .csv, .mat or .json.")


def write_loss_map(found: LossMap, path: Path, source: str, *, force: bool = False) -> None:
    """Write a loss map in the format that the ending of the file names.

    Parameters
    ----------
    source : log or campaign that the map was made from

    Raises
    ------
    OptionError : an ending that names no format
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    check_ending(path)
    surface, points = found.surface, found.points
    record = {
        "schema": SCHEMA,
        "written_by": GENERATOR,
        "source": source,
        "stage_in": points.stages[0],
        "stage_out": points.stages[1],
        "torque_nm": found.torque,
        "speed_rad_s": found.speed,
        "loss_w": found.loss,
        "loss_standard_uncertainty_w": found.u_loss,
        "hull": {"torque_nm": found.hull[:, 0], "speed_rad_s": found.hull[:, 1]},
        "surface": {
            c.term: {name: getattr(c, name) for name in ("value", "low", "high", "unit")}
            | {"contained_in": list(c.contained_in)}
            for c in surface.coefficients
        },
        "condition": surface.condition,
        "condition_all": surface.condition_all,
        "residual_w": surface.residual,
        "held_out_w": surface.held_out,
        "held_out_by": surface.held_out_by,
        "energy_lost_j": found.energy,
        "energy_lost_standard_uncertainty_j": found.u_energy,
        "left_out": dict(points.left_out),
        "points": {
            "log": [points.logs[k] for k in points.log],
            "torque_nm": points.torque,
            "speed_rad_s": points.speed,
            "power_in_w": points.power_in,
            "power_out_w": points.power_out,
            "stored_w": points.stored,
            "loss_w": points.loss,
            "duration_s": points.duration,
        },
    }
    made: dict[str, Callable[[], bytes]] = {
        ".csv": lambda: _csv(record),
        ".mat": lambda: matlab_bytes("loss_map", record),
        ".json": lambda: json_bytes(msgspec.to_builtins(record, enc_hook=np.ndarray.tolist)),
    }
    write_content(path, made[path.suffix.casefold()](), force=force)


def _csv(record: dict[str, Any]) -> bytes:
    """The table under its breakpoints of speed, after lines of comment with source and surface."""
    terms = ", ".join(
        f"{name} {'not distinguished' if c['value'] is None else format(c['value'], '.6g')} {c['unit']}"
        for name, c in record["surface"].items()
    )
    lines = [
        f"# Loss map by {GENERATOR} from {' '.join(str(record['source']).replace(',', ';').split())}",
        f"# loss in W from {record['stage_in']} to {record['stage_out']}",
        "# rows: torque of the shaft in N m, columns: speed of the shaft in rad/s",
        "# NaN: outside of the hull of the operating points",
        f"# surface: {terms}",
        ",".join(["torque_nm\\speed_rad_s", *(f"{x:.9g}" for x in record["speed_rad_s"])]),
        *(
            ",".join([f"{torque:.9g}", *("NaN" if math.isnan(x) else f"{x:.9g}" for x in row)])
            for torque, row in zip(record["torque_nm"], record["loss_w"], strict=True)
        ),
    ]
    return ("\n".join(lines) + "\n").encode()
