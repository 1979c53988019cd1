"""Time histories of a log for a page, which draws them itself: curves by panel and the spans of the phases, thinned."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from winchcascade.core.run import Signal
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.figures import SHADED_CYCLES, powers_of
from winchcascade.report.glossary import metric, typeset
from winchcascade.report.style import look_of
from winchcascade.report.time_histories import panels_of, repaired_spans
from winchcascade.report.wording import clock_zero

POINTS = 6000
"""Instants of a page at most; of longer logs each bin keeps its least and its largest value."""


def thinned(t: Signal, curves: list[Signal]) -> tuple[Signal, list[Signal]]:
    """Instants and curves of a log with the peaks of each, two instants for each bin of samples.

    >>> t, (x,) = thinned(np.arange(1e5), [np.r_[np.zeros(99_999), 1.0]])
    >>> t.size <= POINTS, float(x.max())
    (True, 1.0)
    """
    bins = POINTS // 2
    if t.size <= POINTS:
        return t, curves
    edges = np.linspace(0, t.size, bins + 1).astype(int)[:-1]
    ends = np.r_[edges[1:], t.size] - 1
    times = np.column_stack([t[edges], t[ends]]).ravel()
    return times, [
        np.column_stack([np.minimum.reduceat(x, edges), np.maximum.reduceat(x, edges)]).ravel() for x in curves
    ]


def histories_json(reduction: Reduction) -> str:
    """The histories of a reduction as `page.js` reads them: channels, powers, payouts, holds and repaired stretches."""
    run, zero = reduction.run, clock_zero(reduction.run)
    panels = [
        (title, unit, [(title, "ink", run.channels[name] * factor)])
        for name, title, unit, factor in panels_of(run, reduction.rig)
    ]
    powers = [
        (typeset(metric(f"power_{s}").symbol), look_of(s).colour, watts) for s, watts in powers_of(reduction).items()
    ]
    panels += [("Power", "W", powers)] if powers else []
    t, curves = thinned(run.t - zero, [np.asarray(x) for _, _, row in panels for *_, x in row])
    shown = iter(curves)
    rows = [
        {
            "label": unit,
            "series": [{"label": name, "colour": colour, "values": plain(next(shown))} for name, colour, _ in row],
        }
        for _, unit, row in panels
    ]
    return msgspec.json.encode({"t": plain(t), "rows": rows, "spans": _spans(reduction, zero)}).decode()


def plain(x: Signal) -> list[float | None]:
    """Numbers with six digits, none where the log has none."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in x.tolist()]


def _spans(reduction: Reduction, zero: float) -> list[dict[str, Any]]:
    """Payouts, holds and repaired stretches, each from when to when and in which colour. [s]"""
    cycles = reduction.cycles if len(reduction.cycles) <= SHADED_CYCLES else ()
    spans = [(c.phases.onset, c.phases.payout_end, "payout") for c in cycles]
    spans += [(*c.phases.hold, "hold") for c in cycles if c.phases.hold is not None]
    spans += [(*span, "repaired") for span in repaired_spans(reduction.run, tuple(reduction.run.channels))]
    return [{"from": begin - zero, "to": end - zero, "colour": colour} for begin, end, colour in spans]
