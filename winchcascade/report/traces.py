"""Traces thinned for drawing so that no peak is lost."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from winchcascade.core.quantity import KGF, find_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.report.history_marks import phase_spans, power_sources, repaired_spans, window_spans

READ_OUT = 4000
"""Number of samples above which the read-out of a page shows the range of each trace in equal stretches of the log."""

STRETCHES = 1500
"""Number of those stretches."""

MOST_SPANS = 300
"""Cycles that a reader may choose from at most."""

PANELS = (
    ("displacement", "Line displacement", "m", 1.0),
    ("velocity", "Line velocity", "m/s", 1.0),
    ("pressure", "Accumulator pressure, gauge", "kg/cm²", 1.0 / (KGF * 1e4)),
    ("force", "Line tension", "N", 1.0),
    ("torque", "Torque of the PTO shaft", "N·m", 1.0),
    ("vdc", "Voltage of the DC link", "V", 1.0),
    ("idc", "Current of the DC link", "A", 1.0),
)
"""Channels that have a panel of their own: name, title, unit, and what turns SI units into it."""

MORE_PANELS = (
    ("speed", "Speed of the shaft", "rpm", 30.0 / math.pi),
    ("flow", "Flow", "L/min", 6e4),
    ("power_ac", "AC power", "W", 1.0),
)
"""The same of channels that cranes seldom log."""


def panels_of(run: Run, rig: Rig) -> list[tuple[str, str, str, float]]:
    """Panels of the channels of a log, those of the rig's own last."""
    own = ((name, name, channel.unit, _per_unit(channel.unit)) for name, channel in rig.channels.items())
    return [panel for panel in (*PANELS, *MORE_PANELS, *own) if panel[0] in run.channels]


def _per_unit(unit: str) -> float:
    found = find_unit(unit)
    return 1.0 if found is None else 1.0 / found.factor


def envelope(x: Signal, most: int) -> NDArray[np.intp]:
    """Rows of a trace that draw it: all of them, or the least and the largest of each of equal stretches.

    Parameters
    ----------
    x : (n,) the trace
    most : rows to keep at most, about

    Examples
    --------
    >>> envelope(np.array([0.0, 9.0, 1.0, 2.0, -5.0, 3.0, 2.0, 2.0]), 4).tolist()
    [0, 1, 4, 5, 7]
    """
    n = x.size
    if n <= most:
        return np.arange(n)
    width = -(-2 * n // most)
    whole = n // width * width
    blocks = x[:whole].reshape(-1, width)
    start = np.arange(0, whole, width)
    rows = np.column_stack((start + blocks.argmin(axis=1), start + blocks.argmax(axis=1))).ravel()
    if whole < n:
        rest = x[whole:]
        rows = np.append(rows, (whole + rest.argmin(), whole + rest.argmax()))
    kept: NDArray[np.intp] = np.unique_values(np.append(rows, (0, n - 1)))
    return np.sort(kept)


def clock_zero(run: Run) -> float:
    """What a drawn time axis begins from: 0, or the log's first stamp where that is large, as the seconds of an epoch. [s]"""
    first, last = float(run.t[0]), float(run.t[-1])
    return 0.0 if abs(first) < 10.0 * max(last - first, 1.0) else first


def time_label(run: Run) -> str:
    """Label of a drawn time axis."""
    zero = clock_zero(run)
    return "Time (s)" if zero == 0.0 else f"Time since {zero:.2f} s on the log's clock (s)"


def readout(reduction: Reduction, powers: Mapping[str, Signal]) -> str:
    """Traces as JSON for the read-out of a page: samples, or of a long log the least and the largest of each stretch.

    `spans` names phases and windows with their begin and end; `repaired` of a trace are the stretches that were bridged in it.
    """
    import msgspec

    run, cycles, zero = reduction.run, reduction.cycles[:MOST_SPANS], clock_zero(reduction.run)
    shown: list[tuple[str, str, Signal, float, tuple[str, ...]]]
    shown = [(title, unit, run.channels[name], f, (name,)) for name, title, unit, f in panels_of(run, reduction.rig)]
    shown += [(f"P_{stage}", "W", x, 1.0, power_sources(reduction, [stage])) for stage, x in powers.items()]
    starts = np.linspace(0, run.t.size, min(run.t.size, STRETCHES) + 1)[:-1].astype(np.intp)
    whole = run.t.size <= READ_OUT
    rows = []
    for title, unit, x, factor, sources in shown:
        row: dict[str, object] = {"name": title, "unit": unit}
        if whole:
            row["x"] = _short(x * factor)
        else:
            row |= {
                "low": _short(np.minimum.reduceat(x, starts) * factor),
                "high": _short(np.maximum.reduceat(x, starts) * factor),
            }
        repaired = repaired_spans(run, sources)
        if repaired:
            row["repaired"] = [[round(edge - zero, 3) for edge in span] for span in repaired]
        rows.append(row)
    last = end_of(cycles[-1]) if cycles else 0.0
    spans = [(f"{name} of cycle {number}", a, b) for name, number, a, b in phase_spans(reduction)]
    page = {
        "span": [float(run.t[0]) - zero, float(run.t[-1]) - zero],
        "label": time_label(run),
        "cycles": [[c.cycle, c.phases.onset - zero - 1.0, end_of(c) + 0.5 - zero] for c in cycles],
        "spans": [
            [name, round(a - zero, 3), round(b - zero, 3)]
            for name, a, b in (*spans, *window_spans(reduction))
            if a <= last
        ],
        "times": np.round((run.t if whole else run.t[starts]) - zero, 3).tolist(),
        "traces": rows,
    }
    return msgspec.json.encode(page).decode()


def _short(x: Signal) -> list[float]:
    """Values to four significant digits."""
    return [float(f"{value:.4g}") for value in x.tolist()]


def end_of(cycle: CycleResult) -> float:
    """End of the last phase of a cycle that the log holds. [s]"""
    phases = cycle.phases
    return (phases.haul_in or phases.hold or (0.0, phases.payout_end))[1]
