"""Whole cycles, from onset to the next onset: line energy of the payout, energy returned in haul-in, net energy.

Gas that a payout compresses returns its energy in haul-in. From onset to onset the line ends where it began, so nothing but
losses and delivered energy remains of the line's net energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.reduction.efficiency import is_efficiency, ratio
from winchcascade.reduction.phased_run import travel_in

if TYPE_CHECKING:
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.phased_run import PhasedRun
    from winchcascade.reduction.phases import Cycle
    from winchcascade.reduction.windows import Window

NET_TRAVEL_MAX = 0.01
"""Largest net travel of a cycle, as a share of its stroke: a line that ends elsewhere leaves energy in the gas. [1]"""

PARTS = {
    "line": ("line", "window"),
    "mech": ("mech", "window"),
    "gen": ("gen", "window"),
    "payout": ("line", "payout"),
    "returned": ("line", "haul_in"),
    "net": ("line", "cycle"),
    "gen_cycle": ("gen", "cycle"),
}
"""Each energy of a cycle: the stage whose power is integrated, and the span over which."""

SIGN = {"returned": -1.0}
"""Energies that are counted against the line's direction: what the line gives back is positive."""


class NetSpan(msgspec.Struct, frozen=True):
    """A whole cycle from onset to next onset [s] and the net travel of the line in it [m].

    `reason` says why the cycle has no net energies, None where it has.
    """

    begin: float
    end: float
    travel: float | None = None
    reason: str | None = None


def find_net_spans(phased: PhasedRun) -> list[NetSpan]:
    """Find the span of each whole cycle, and why a cycle is not whole.

    The last cycle of a log ends with the log if its haul-in is complete and the line is at rest by then.
    """
    cycles, after = phased.cycles, phased.next_onset
    ends = [*(c.onset for c in cycles[1:]), float(phased.run.t[-1]) if after is None else after][: len(cycles)]
    moved = travel_in(
        phased.run, np.array([(c.onset, end) for c, end in zip(cycles, ends, strict=True)]).reshape(-1, 2)
    )
    rests = after is not None or _ends_at_rest(phased)
    found = []
    for k, (cycle, stroke) in enumerate(zip(cycles, phased.travel, strict=True)):
        reason = _not_whole(phased.run, cycle)
        if reason is None and k == len(cycles) - 1 and not rests:
            reason = "the log ends before the line is at rest after the haul-in"
        if reason is None and abs(moved[k]) > NET_TRAVEL_MAX * abs(stroke):
            reason = f"the line ends more than {NET_TRAVEL_MAX:.0%} of its stroke from where it began"
        found.append(NetSpan(cycle.onset, ends[k], moved[k], reason))
    return found


def _ends_at_rest(phased: PhasedRun) -> bool:
    """Whether the last haul-in ends, and the line rests at the log's end for as long as the velocity is smoothed over."""
    limits, t = phased.rig.thresholds, phased.run.t
    last = phased.cycles[-1].haul_in if phased.cycles else None
    begin = float(t[-1]) - limits.smoothing
    if last is None or last[1] > begin:
        return False
    return bool(np.max(np.abs(phased.v_smooth[np.searchsorted(t, begin) :])) <= limits.v_onset)


def _not_whole(run: Run, cycle: Cycle) -> str | None:
    if "force" not in run.channels:
        return "the log has no line tension"
    if run.open_circuit:
        return "net energies are not evaluated in open circuit"
    if cycle.begins_inside:
        return "the log begins inside the payout"
    if cycle.hold is None:
        return "the log ends inside the payout"
    return None if cycle.haul_in is not None else "no haul-in follows"


def spans_of(windows: Sequence[Window], cycles: Sequence[Cycle], nets: Sequence[NetSpan]) -> dict[str, Signal]:
    """Begin and end of the spans of all cycles by name, (k, 2) each [s]; without length for a cycle that is not whole."""
    whole = [
        ((c.onset, c.payout_end), c.haul_in, (n.begin, n.end))
        if n.reason is None and c.haul_in is not None
        else ((c.onset, c.onset),) * 3
        for c, n in zip(cycles, nets, strict=True)
    ]
    columns = {"window": [(w.onset, w.cutoff) for w in windows]}
    columns |= {name: [spans[k] for spans in whole] for k, name in enumerate(("payout", "haul_in", "cycle"))}
    return {name: np.array(column).reshape(-1, 2) for name, column in columns.items()}


def net_metrics(joules: Mapping[str, float | None], span: NetSpan) -> tuple[dict[str, float | None], NetSpan]:
    """Put the metrics of one whole cycle together, and add to its span why it has none.

    Parameters
    ----------
    joules : energies by their names in `PARTS` [J]

    Examples
    --------
    >>> parts = {"payout": 10e3, "returned": 2e3, "net": 8e3, "gen_cycle": 6e3}
    >>> net_metrics(parts, NetSpan(0.0, 60.0))[0]["eta_net"]
    0.75
    """
    net = joules["net"]
    if span.reason is None and net is not None and net <= 0.0:
        span = msgspec.structs.replace(span, reason="the net energy of the line is not positive")
    if span.reason is not None:
        return {}, span
    values = {f"energy_{name}": joules[name] for name in ("payout", "returned", "net", "gen_cycle")}
    eta = ratio(joules["gen_cycle"], net)
    if eta is not None and not is_efficiency(eta):
        span = msgspec.structs.replace(span, reason="E_gen / E_net lies outside 0 to 1")
        eta = None
    return values | {"eta_net": eta}, span
