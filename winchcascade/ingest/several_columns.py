"""Choice among several columns that could be one channel, by what the other channels show; else none is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.assign import Assignment, Match, gives_result, listed
from winchcascade.ingest.dialects import Header
from winchcascade.ingest.source import LogTable

SAME = 0.002
"""Columns hold the same signal if the mean square of their difference is below the square of this share of theirs. [1]"""

FOLLOWS = 0.8
"""Smallest correlation with the other channels of a column that is chosen. [1]"""

CLEARER = 3.0
"""Minimum ratio of the lack of correlation of the second best column to that of the chosen one. [1]"""

APART = 0.05
"""The correlation of the second best column is lower by at least this. [1]"""

_MAX_SAMPLES = 20_000
"""Samples on which columns are compared, spread over the log."""

_Kind = Literal["as_is", "size", "travel"]

_FOLLOWED: Mapping[str, tuple[tuple[str, _Kind], ...]] = {
    "displacement": (("velocity", "travel"),),
    "velocity": (("displacement", "as_is"),),
    "speed": (("velocity", "as_is"), ("displacement", "as_is")),
    "pressure": (("displacement", "as_is"), ("velocity", "travel")),
    "force": (("torque", "as_is"), ("pressure", "as_is")),
    "torque": (("force", "as_is"), ("power_mech", "as_is"), ("idc", "size")),
    "power_mech": (("torque", "as_is"), ("velocity", "size")),
    "flow": (("velocity", "as_is"), ("speed", "as_is")),
    "power_ac": (("power_mech", "as_is"), ("idc", "size")),
    "vdc": (("velocity", "size"), ("speed", "size"), ("idc", "size")),
    "idc": (("vdc", "size"), ("torque", "size")),
}
"""The channels that each one follows, the closest first: as they are, by their size, or by the distance that they travel."""


def with_chosen(found: Assignment, table: LogTable, headers: Sequence[Header], rig: Rig, where: str) -> Assignment:
    """Decide which of several columns is each channel, and report every choice.

    The pressure, for example, is the column that follows the stroke. Columns of the same signal count as one, the first. A
    channel without a clear column is left out.

    Raises
    ------
    LogError : what is left shows neither a motion nor a power
    """
    known = {name: _signal(table, match) for name, match in found.channels.items()}
    channels, findings = dict(found.channels), list(found.findings)
    for name, matches in found.candidates.items():
        chosen, why = _choice(name, [_signal(table, match) for match in matches], known)
        if chosen is not None:
            channels[name] = matches[chosen]
        findings.append(_finding(name, _names(matches, headers), chosen, why))
    if not gives_result(channels, rig):
        columns = [name for matches in found.candidates.values() for name in _names(matches, headers)]
        raise LogError(
            f"{where}: several columns could be the motion or the power: {listed(columns)}; expected one for each channel. "
            "Name the right ones in a rig file under [columns]."
        )
    ordered = {name: channels[name] for name in rig.known_channels if name in channels}
    return msgspec.structs.replace(found, channels=ordered, findings=tuple(findings), candidates={})


def _signal(table: LogTable, match: Match) -> Signal:
    """Samples of a column in SI units, spread over the log."""
    values = table.values[match.index]
    offset = 0.0 if match.unit is None else match.unit.offset
    return values[:: max(1, values.size // _MAX_SAMPLES)] * match.factor + offset


def _choice(name: str, columns: Sequence[Signal], known: Mapping[str, Signal]) -> tuple[int | None, str]:
    """Number of the column that is the channel, None where that is open, and the reason."""
    filled = [k for k, column in enumerate(columns) if np.isfinite(column).any()]
    if len(filled) == 1:
        return filled[0], "the others hold no numbers"
    if filled and all(_same(columns[filled[0]], columns[k]) for k in filled[1:]):
        return filled[0], "they hold the same signal"
    for other, kind in _FOLLOWED.get(name, ()):
        if other not in known:
            continue
        reference = _seen_as(known[other], kind)
        travels = name in ("velocity", "speed") and other == "displacement"
        moved = [_travel(column) for column in columns] if travels else columns
        found = sorted(((_correlation(column, reference), -k) for k, column in enumerate(moved)), reverse=True)
        (best, place), (second, _) = found[:2]
        if best >= FOLLOWS and best - second >= APART and 1.0 - second >= CLEARER * (1.0 - best):
            return -place, f"it follows the {other} (correlation {best:.3f}, of the others at most {second:.3f})"
    return None, ""


def _same(one: Signal, other: Signal) -> bool:
    both = np.isfinite(one) & np.isfinite(other)
    apart, size = float(np.sum((one - other)[both] ** 2)), float(np.sum(one[both] ** 2))
    return bool(both.any()) and apart <= SAME**2 * size


def _seen_as(signal: Signal, kind: _Kind) -> Signal:
    return np.abs(signal) if kind == "size" else _travel(signal) if kind == "travel" else signal


def _travel(speed: Signal) -> Signal:
    """Sum of a speed up to each sample, which follows the distance."""
    return np.cumsum(np.nan_to_num(speed, posinf=0.0, neginf=0.0))


def _correlation(one: Signal, other: Signal) -> float:
    """Size of the correlation of two signals, 0 where one of them does not change. [1]"""
    both = np.isfinite(one) & np.isfinite(other)
    if np.count_nonzero(both) < 3:
        return 0.0
    a, b = one[both] - np.mean(one[both]), other[both] - np.mean(other[both])
    size = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return abs(float(np.sum(a * b))) / size if 0.0 < size < np.inf else 0.0


def _names(matches: Sequence[Match], headers: Sequence[Header]) -> list[str]:
    """Names of columns for a message, with their numbers where a name is there twice."""
    names = [headers[match.index].name.strip() for match in matches]
    return [
        repr(name) if names.count(name) == 1 else f"{name!r} (column {match.index + 1})"
        for name, match in zip(names, matches, strict=True)
    ]


def _finding(name: str, names: Sequence[str], chosen: int | None, why: str) -> Finding:
    message = f"{len(names)} columns could be the {name}: {listed(names)}"
    action = "none is read; name the right one in a rig file under [columns]"
    if chosen is not None:
        action = f"{names[chosen]} is read: {why}"
    return Finding("ambiguous_column", message, action, name, count=len(names))
