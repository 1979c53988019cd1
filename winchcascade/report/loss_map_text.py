"""A loss map in words and tables, for terminal and reports, and as a file for look-up tables: CSV, MATLAB or JSON.

Rows of the file follow the breakpoints of torque, columns those of speed. Outside of the hull of the points a cell is NaN, in
JSON null.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes, write_content
from winchcascade.core.version import __version__
from winchcascade.reduction.loss_map import CONDITION_MAX, Coefficient, LossMap
from winchcascade.report.digits import interval_text, number, percent, places, significant, uncertain
from winchcascade.report.matlab_file import matlab_bytes
from winchcascade.report.sheet import ItemTable, Table, TableColumn, rows_of
from winchcascade.report.text_table import table_lines, wrapped

COLUMN_WORDS = {
    "speed": "speed",
    "speed_squared": "speed²",
    "torque_squared": "torque²",
    "torque": "|torque|",
    "speed_times_torque": "speed × torque",
}
"""Columns of the surface, in words."""

MEANING = {
    "speed": "friction that does not depend on speed",
    "speed_squared": "viscous friction, iron",
    "torque_squared": "copper",
    "torque": "diodes",
    "speed_times_torque": "share of the power, as in a gear mesh",
}
"""Losses that follow these columns."""

UNIT_WORDS = {
    "N.m": "N m", "N.m.s/rad": "N m s/rad", "W/(N.m)2": "W/(N m)²", "W/(N.m)": "W/(N m)", "1": "1",
}  # fmt: skip


def loss_map_lines(found: LossMap) -> list[str]:
    """A loss map in the terminal: where its points lie, its coefficients, and how good it is."""
    cells = rows_of(_COEFFICIENTS, found.surface.coefficients)
    rows = [[column.name.lower() for column in _COEFFICIENTS], *(list(map(str, row)) for row in cells)]
    return [
        *wrapped(f"loss map {loss_points_words(found)}", piped=80),
        "",
        *table_lines(rows, left=(0, 3, 4), omit=("such as", "95 % interval")),
        "",
        *(line for sentence in quality_words(found) for line in wrapped(sentence, piped=80)),
    ]


def loss_points_words(found: LossMap) -> str:
    """Number and range of the points, and where the energy went."""
    points = found.points
    logs = "" if len(points.logs) == 1 else f" of {len(points.logs)} logs"
    many = "" if points.loss.size == 1 else "s"
    u = (
        f"standard uncertainty {uncertain(found.u_energy)} J"
        if math.isfinite(found.u_energy)
        else "uncertainty unknown"
    )
    return (
        f"{points.stages[0]} to {points.stages[1]}: {points.loss.size} point{many}{logs}, torque "
        f"{_range(points.torque.min(), points.torque.max())} N m, speed "
        f"{_range(points.speed.min(), points.speed.max())} rad/s; together {_joules(found)} J lost, {u}"
    )


def _joules(found: LossMap) -> str:
    """Energy lost, with the digits of its uncertainty where that is known."""
    known = math.isfinite(found.u_energy) and found.u_energy > 0.0
    return number(found.energy, _digits(found.u_energy)) if known else significant(found.energy)


def quality_words(found: LossMap) -> list[str]:
    """How well the surface meets the points, what they do not distinguish, and what was left out."""
    surface, mean = found.surface, float(abs(found.points.loss).mean())
    held, exact = (
        surface.held_out,
        "as many coefficients as points: the surface meets them exactly, and no interval is known",
    )
    without = dict.fromkeys(c.contained_in for c in surface.coefficients if c.value is None)
    return [
        *([exact] if surface.freedom == 0 else []),
        f"residual {significant(surface.residual)} W"
        + (
            ", too few points to hold any out"
            if held is None
            else f", of held-out points {significant(held)} W ({percent(held / mean, 1)} % of the mean loss; each "
            f"{surface.held_out_by} held out {'in turn' if surface.held_out_by != 'point' else 'once'})"
        ),
        f"condition number {number(surface.condition, 1)}"
        + (
            ""
            if surface.condition == surface.condition_all
            else f"; {_all_five(surface.condition_all)} of all five columns"
        ),
        *(_left_out_words(surface.coefficients, others) for others in without),
        *(f"points left out, {reason}: {count}" for reason, count in found.points.left_out.items()),
        *(
            ["the points lie on one line over torque and speed: the table holds no value"]
            if len(found.hull) < 3
            else []
        ),
    ]


def _left_out_words(coefficients: Sequence[Coefficient], others: tuple[str, ...]) -> str:
    """Columns that are left out, as the points do not distinguish them from some others."""
    columns = ", ".join(COLUMN_WORDS[c.term] for c in coefficients if c.value is None and c.contained_in == others)
    alike = " and ".join(COLUMN_WORDS[name] for name in others)
    where = f" from {alike}, whose coefficients stand for them too" if alike else ""
    return f"left out, as these points do not distinguish them{where}: {columns}"


_COEFFICIENTS: tuple[TableColumn[Coefficient], ...] = (
    TableColumn("Loss over", text=True, of=lambda c: COLUMN_WORDS[c.term]),
    TableColumn("Coefficient", of=lambda c: _value(c)),
    TableColumn("95 % interval", of=lambda c: _interval(c)),
    TableColumn("Unit", text=True, of=lambda c: UNIT_WORDS[c.unit]),
    TableColumn("Such as", text=True, of=lambda c: MEANING[c.term]),
)


def coefficients_table(found: LossMap) -> Table | None:
    """Coefficients of the surface with their intervals."""
    note = ". ".join(sentence[0].upper() + sentence[1:] for sentence in quality_words(found))
    return ItemTable[Coefficient](
        "loss-coefficients",
        "Surface of the loss over torque and speed of the shaft: the sum of these columns times their coefficients.",
        _COEFFICIENTS,
        note=f"{note}. Columns are left out while the condition number exceeds {CONDITION_MAX:g}.{_intervals_words(found)}",
    ).of(found.surface.coefficients)


def _intervals_words(found: LossMap) -> str:
    """What the intervals contain, empty without any."""
    freedom = found.surface.freedom
    if freedom == 0:
        return ""
    return (
        f" Intervals (coverage 95 %, Student's t with {freedom} degrees of freedom) contain the scatter of the points and the "
        "accuracies of the sensors that the rig file states."
    )


def _value(c: Coefficient) -> str:
    if c.value is None:
        return "–"
    return significant(c.value) if c.low is None else number(c.value, _digits((c.value - c.low) / 2.0))


def _interval(c: Coefficient) -> str:
    if c.value is None:
        return "not distinguished"
    if c.low is None or c.high is None:
        return "unknown"
    u = (c.value - c.low) / 2.0
    return interval_text(c.low, c.high, u) if u > 0.0 else significant(c.value)


def _digits(u: float) -> int:
    return places(u) if u > 0.0 and math.isfinite(u) else 3


def _range(low: float, high: float) -> str:
    return f"{significant(float(low))} to {significant(float(high))}"


def _all_five(condition: float) -> str:
    return "infinite" if math.isinf(condition) else significant(condition)


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
        "written_by": f"winchcascade/{__version__}",
        "source": source,
        "stage_in": points.stages[0],
        "stage_out": points.stages[1],
        "torque_nm": found.torque,
        "speed_rad_s": found.speed,
        "loss_w": found.loss,
        "loss_standard_uncertainty_w": found.u_loss,
        "hull": {"torque_nm": found.hull[:, 0], "speed_rad_s": found.hull[:, 1]},
        "surface": {
            c.term: {
                "value": c.value,
                "low": c.low,
                "high": c.high,
                "unit": c.unit,
                "contained_in": list(c.contained_in),
            }
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
        ".json": lambda: json_bytes(_plain(record)),
    }
    write_content(path, made[path.suffix.casefold()](), force=force)


def _csv(record: dict[str, Any]) -> bytes:
    """The table under its breakpoints of speed, after lines of comment with source and surface."""
    terms = ", ".join(
        f"{name} {'not distinguished' if c['value'] is None else format(c['value'], '.6g')} {c['unit']}"
        for name, c in record["surface"].items()
    )
    lines = [
        f"# Loss map by winchcascade/{__version__} from {' '.join(str(record['source']).replace(',', ';').split())}",
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


def _plain(value: Any) -> Any:
    """A value as JSON holds it: lists, and null for what is not finite."""
    if isinstance(value, dict):
        return {name: _plain(inner) for name, inner in value.items()}
    if isinstance(value, np.ndarray | list):
        return [_plain(inner) for inner in (value.tolist() if isinstance(value, np.ndarray) else value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value
