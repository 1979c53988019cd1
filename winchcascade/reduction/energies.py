"""Powers of line, shaft and DC link, and their energies over each window and each whole cycle from onset to next onset.

Gas that a payout compresses returns its energy in haul-in. From onset to onset the line ends where it began, so that the net
energy of the line is the sum of losses and delivered energy. The uncertainty by gaps comes with each energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.cascade import ELECTRICAL, Stream
from winchcascade.core.integrate import integrals, integrals_of
from winchcascade.core.rig_file import Thresholds
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.efficiency import ratio
from winchcascade.reduction.gap_error import energy_error, gap_limits, gaps_of, instant_error
from winchcascade.reduction.phased_run import PhasedRun, Window, travel_in
from winchcascade.reduction.phases import Cycle

NET_TRAVEL_MAX = 0.01
"""Largest net travel of a cycle, as a share of its stroke: a line that ends elsewhere leaves energy in the gas. [1]"""

SIGN = {"returned": -1.0}
"""Energies that are counted against the line's direction: what the line gives back is positive."""


class NetSpan(msgspec.Struct, frozen=True, rename={"begin": "begin_s", "end": "end_s", "travel": "travel_m"}):
    """A whole cycle from onset to next onset [s] and the net travel of the line in it [m].

    `reason` gives the reason why the cycle has no net energies, None where it has.
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
    ends = [*(c.onset for c in cycles[1:]), float(phased.run.t[-1]) if after is None else after]
    spans = [(c.onset, end) for c, end in zip(cycles, ends, strict=False)]
    found = []
    for (begin, end), cycle, moved, stroke in zip(
        spans, cycles, travel_in(phased.run, np.array(spans).reshape(-1, 2)), phased.travel, strict=True
    ):
        reason = _not_whole(phased.run, cycle)
        if reason is None and after is None and cycle is cycles[-1] and not _ends_at_rest(phased):
            reason = "the log ends before the line is at rest after the haul-in"
        if reason is None and abs(moved) > NET_TRAVEL_MAX * abs(stroke):
            reason = f"the line ends more than {NET_TRAVEL_MAX:.0%} of its stroke from where it began"
        found.append(NetSpan(begin, end, moved, reason))
    return found


def _ends_at_rest(phased: PhasedRun) -> bool:
    """Whether the last haul-in ends, and the line rests at the log's end for as long as the velocity is smoothed over."""
    limits, t, haul_in = phased.rig.thresholds, phased.run.t, phased.cycles[-1].haul_in
    begin = float(t[-1]) - limits.smoothing
    if haul_in is None or haul_in[1] > begin:
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
    rows = [
        (*window, c.onset, c.payout_end, *c.haul_in, n.begin, n.end)
        if n.reason is None and c.haul_in is not None
        else (*window, *(c.onset,) * 6)
        for window, c, n in zip([(w.onset, w.cutoff) for w in windows], cycles, nets, strict=True)
    ]
    spans = np.array(rows).reshape(-1, 4, 2).swapaxes(0, 1)
    return dict(zip(("window", "payout", "haul_in", "cycle"), spans, strict=True))


def net_metrics(joules: Mapping[str, float | None], span: NetSpan) -> tuple[dict[str, float | None], NetSpan]:
    """Put the metrics of one whole cycle together, and add to its span why it has none.

    Parameters
    ----------
    joules : energies by their names in the parts of the cascade [J]

    Examples
    --------
    >>> parts = {"payout": 10e3, "returned": 2e3, "net": 8e3, "gen_cycle": 6e3}
    >>> net_metrics(parts, NetSpan(0.0, 60.0))[0]["eta_net"]
    0.75
    """
    net = joules.get("net")
    if span.reason is None and net is not None and net <= 0.0:
        span = msgspec.structs.replace(span, reason="the net energy of the line is not positive")
    if span.reason is not None or "net" not in joules:
        return {}, span
    values = {f"energy_{name}": joules[name] for name in ("payout", "returned", "net", "gen_cycle")}
    eta = ratio(joules["gen_cycle"], net)
    if eta is None or eta >= 0.0:
        return values | {"eta_net": eta}, span
    return values | {"eta_net": None}, msgspec.structs.replace(span, reason="E_gen / E_net is below 0")


class Energies(msgspec.Struct, frozen=True):
    """Windows and whole cycles with what is wrong with them, the energies of each by their names in the parts of the
    cascade, None for one not measured, and what gaps may have changed of them. [J]
    """

    windows: list[Window]
    nets: list[NetSpan]
    joules: dict[str, list[float] | None]
    bridged: dict[str, tuple[float, ...]]


def integrate_energies(phased: PhasedRun, windows: Sequence[Window], nets: Sequence[NetSpan]) -> Energies:
    """Integrate each stage's power over each window and each whole cycle.

    Gaps that make an energy uncertain become the fault of the window, or the reason why a cycle has no net energies.
    """
    run, limits = phased.run, gap_limits(phased.run, phased.rig)
    spans = spans_of(windows, phased.cycles, nets)
    cascade, r_drum = phased.rig.cascade, phased.rig.r_drum
    joules: dict[str, list[float] | None] = dict.fromkeys(cascade.parts)
    bridged: dict[str, tuple[float, ...]] = {}
    faults: dict[str, dict[int, str]] = {span: {} for span in spans}
    moved = dict.fromkeys(spans, np.zeros(len(windows)))  # at an onset the line hardly moves
    if phased.rule != "payout":  # what moves onset or plateau moves the cutoff that depends on it
        onset, cutoff = spans["window"].T
        instants = onset if isinstance(phased.rule, float) else cutoff - limits.settle
        moved["window"] = instant_error(run, phased.v_smooth, instants)
    measured = [
        (stage, watts, product.channels)
        for stage in cascade.stages
        if (watts := stage.stream(run.channels, r_drum)) and (product := stage.power(run.channels, r_drum))
    ]
    whole = integrals_of(run.t, [watts for _, watts, _ in measured], np.concatenate(list(spans.values())))
    whole = whole.reshape(len(measured), len(spans), len(windows))
    for (stage, watts, channels), of_spans in zip(measured, whole, strict=True):
        gaps, joule = gaps_of(run, channels), dict(zip(spans, of_spans, strict=True))
        for name, span in [(name, span) for name, (source, span) in cascade.parts.items() if source == stage.name]:
            part = joule[span]
            joules[name] = (SIGN.get(name, 1.0) * part).tolist()
            idle = stage.name in ELECTRICAL and run.open_circuit  # no current flows: any of it is a large share
            if len(gaps) and not idle:
                changed = energy_error(run.t, watts(slice(None)), gaps, spans[span], moved[span])
                bridged[name] = tuple(changed.tolist())
                flow = np.abs(part) if phased.rig.phases.by_motion else _flow(run.t, watts, spans[span])
                share = np.where(np.ptp(spans[span], axis=1) > 0.0, changed / np.maximum(flow, 1e-9), 0.0)
                which, place = ("window", "its window") if span == "window" else ("cycle", "the cycle")
                for k, fault in gap_faults(name, place, gaps, spans[span], share, limits).items():
                    faults[which].setdefault(k, fault)
    return Energies(
        [Window(w.onset, w.cutoff, w.fault or faults["window"].get(k)) for k, w in enumerate(windows)],
        [NetSpan(n.begin, n.end, n.travel, n.reason or faults["cycle"].get(k)) for k, n in enumerate(nets)],
        joules,
        bridged,
    )


def _flow(t: Signal, watts: Stream, spans: Signal) -> Signal:
    """Energy that flows in either direction in each span, (k,): the net energy of a reciprocating machine may be small. [J]"""
    return integrals(t, lambda part: np.abs(watts(part)), spans)


def gap_faults(name: str, place: str, gaps: Signal, spans: Signal, share: Signal, limits: Thresholds) -> dict[int, str]:
    """Faults of the spans in which a gap is too long, or in which bridging could change the energy by too much.

    Parameters
    ----------
    name, place : of the energy, and what its spans are called
    share : of the energy in each span that bridging could change, (k,) [1]
    """
    found: dict[int, str] = {}
    for begin, end in gaps[gaps[:, 1] - gaps[:, 0] > limits.gap_max]:
        for k in np.flatnonzero((spans[:, 0] < end) & (spans[:, 1] > begin)).tolist():
            found.setdefault(k, f"a gap of {end - begin:.2f} s lies in {place} (E_{name})")
    for k in np.flatnonzero(share > limits.gap_energy_max).tolist():
        found.setdefault(k, f"bridging its gaps could change E_{name} by {min(share[k], 9.99):.1%}")
    return found
