"""Traces thinned for drawing so that no peak is lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.cascade.reduce import CycleResult
    from winchcascade.run import Run, Signal

READ_OUT = 4000
"""Points of each trace that the page's read-out knows at most."""

MOST_SPANS = 300
"""Cycles that a reader may choose from at most."""


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


def readout(run: Run, cycles: Sequence[CycleResult], powers: Mapping[str, Signal]) -> str:
    """Traces as JSON for the read-out of a page: times and values to four digits, thinned so that no peak is lost."""
    import msgspec

    from winchcascade.report.figures import PANELS, clock_zero, time_label

    shown = [
        (f"trace-{name}", title, unit, run.channels[name], f) for name, title, unit, f in PANELS if name in run.channels
    ]
    shown += [(f"trace-power_{stage}", f"P_{stage}", "W", x, 1.0) for stage, x in powers.items()]
    zero = clock_zero(run)
    times: list[list[float]] = []
    rows = []
    for trace, title, unit, x, factor in shown:
        kept = envelope(x, READ_OUT)
        t = np.round(run.t[kept] - zero, 3).tolist()
        if t not in times[:1]:
            times.append(t)
        values = [float(f"{v:.4g}") for v in (x[kept] * factor).tolist()]
        rows.append({"id": trace, "name": title, "unit": unit, "t": times.index(t), "x": values})
    spans = [[c.cycle, c.phases.onset - zero - 1.0, _end(c) - zero] for c in cycles[:MOST_SPANS]]
    page = {
        "span": [float(run.t[0]) - zero, float(run.t[-1]) - zero],
        "label": time_label(run),
        "cycles": spans,
        "times": times,
        "traces": rows,
    }
    return msgspec.json.encode(page).decode()


def _end(cycle: CycleResult) -> float:
    phases = cycle.phases
    return (phases.haul_in or phases.hold or (0.0, phases.payout_end))[1] + 0.5
