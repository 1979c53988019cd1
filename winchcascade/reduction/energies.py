"""Powers of line, shaft and DC link, and their energies over each window and each whole cycle from
onset to next onset.

Gas that a payout compresses returns its energy in haul-in. From onset to onset the line ends where
it began, so that the net energy of the line is the sum of losses and delivered energy. The
uncertainty by gaps comes with each energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.cascade import ELECTRICAL
from winchcascade.core.integrate import integrals, integrals_of
from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import NOTHING, SMALLEST, ratio
from winchcascade.reduction.gap_error import (
    OF_PHASE,
    energy_error,
    gap_limits,
    gaps_of,
    instant_error,
)
from winchcascade.reduction.phased_run import PhasedRun, Window, onsets, travel_in
from winchcascade.reduction.phases import Cycle

NET_TRAVEL_MAX = 0.01
"""Largest net travel of a cycle, as a share of its stroke: a line that ends elsewhere leaves
energy in the gas. [1]
"""

SIGN = {"returned": -1.0}
"""Energies that are counted against the line's direction: what the line gives back is positive."""


class NetSpan(
    msgspec.Struct, frozen=True, rename={"begin": "begin_s", "end": "end_s", "travel": "travel_m"}
):
    """A whole cycle from onset to next onset [s] and the net travel of the line in it [m].

    `reason` gives the reason why the cycle has no net energies, None where it has.
    """

    begin: float
    end: float
    travel: float | None = None
    reason: str | None = None


def find_net_spans(phased: PhasedRun) -> list[NetSpan]:
    """Find the span of each whole cycle, and why a cycle is not whole.

    The last cycle of a log ends with the log if its haul-in is complete and the line is at rest by
    then, for as long as the velocity is smoothed over.
    """
    run, limits, spans = phased.run, phased.rig.thresholds, onsets(phased)
    rest = float(run.t[-1]) - limits.smoothing
    at_rest = np.max(np.abs(phased.v_smooth[np.searchsorted(run.t, rest) :])) <= limits.v_onset
    found = []
    for k, (cycle, moved) in enumerate(zip(phased.cycles, travel_in(run, spans), strict=True)):
        last = k == len(phased.cycles) - 1 and phased.next_onset is None
        stroke, haul_in_end = (
            abs(phased.travel[k]),
            np.inf if cycle.haul_in is None else cycle.haul_in[1],
        )
        reasons = {
            "the log has no line tension": "force" not in run.channels,
            "net energies are not evaluated in open circuit": run.open_circuit,
            "the log begins inside the payout": cycle.begins_inside,
            "the log ends inside the payout": cycle.hold is None,
            "no haul-in follows": cycle.haul_in is None,
            "the log ends before the line is at rest after the haul-in": last
            and not (at_rest and haul_in_end <= rest),
            f"the line ends more than {NET_TRAVEL_MAX:.0%} of its stroke from where it began": abs(
                moved
            )
            > NET_TRAVEL_MAX * stroke,
        }
        begin, end = spans[k].tolist()
        found.append(
            NetSpan(begin, end, moved, next((why for why, so in reasons.items() if so), None))
        )
    return found


def spans_of(
    windows: Sequence[Window], cycles: Sequence[Cycle], nets: Sequence[NetSpan]
) -> dict[str, Signal]:
    """Begin and end of the spans of all cycles by name, (k, 2) each [s]; without length for a
    cycle that is not whole.
    """
    found: dict[str, list[tuple[float, float]]] = {
        name: [] for name in ("window", "payout", "haul_in", "cycle")
    }
    for window, cycle, net in zip(windows, cycles, nets, strict=True):
        whole = cycle.haul_in if net.reason is None else None
        found["window"].append((window.onset, window.cutoff))
        found["payout"].append((cycle.onset, cycle.payout_end if whole else cycle.onset))
        found["haul_in"].append(whole or (cycle.onset, cycle.onset))
        found["cycle"].append((net.begin, net.end if whole else net.begin))
    return {name: np.array(spans).reshape(-1, 2) for name, spans in found.items()}


def net_metrics(
    joules: Mapping[str, float | None], span: NetSpan
) -> tuple[dict[str, float | None], NetSpan]:
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
        span = replace(span, reason="the net energy of the line is not positive")
    if span.reason is not None or "net" not in joules:
        return {}, span
    eta = ratio(joules["gen_cycle"], net)
    if eta is not None and eta < 0.0:
        eta, span = None, replace(span, reason="E_gen / E_net is below 0")
    return {
        f"energy_{name}": joules[name] for name in ("payout", "returned", "net", "gen_cycle")
    } | {"eta_net": eta}, span


class Energies(msgspec.Struct, frozen=True, dict=True):
    """Windows and whole cycles with what is wrong with them, the energies of each by their names in
    the parts of the cascade, None for one not measured, and what gaps may have changed of them. [J]
    """

    windows: list[Window]
    nets: list[NetSpan]
    joules: dict[str, list[float] | None]
    bridged: dict[str, tuple[float, ...]]

    @cached_property
    def nothing(self) -> float:
        """Energy that counts as zero beside the largest one of the log. [J]"""
        return max(
            NOTHING
            * max((abs(x) for column in self.joules.values() for x in column or ()), default=0.0),
            SMALLEST,
        )


def integrate_energies(
    phased: PhasedRun, windows: Sequence[Window], nets: Sequence[NetSpan]
) -> Energies:
    """Integrate each stage's power over each window and each whole cycle.

    Gaps that make an energy uncertain become the fault of the window, or the reason why a cycle has
    no net energies.
    """
    run, rig, cascade = phased.run, phased.rig, phased.rig.cascade
    limits, spans = gap_limits(run, rig), spans_of(windows, phased.cycles, nets)
    powers = cascade.powers(run.channels, rig.r_drum)
    known = {name: power.stream(run.channels, rig.r_drum) for name, power in powers.items()}
    whole = integrals_of(run.t, list(known.values()), np.concatenate(list(spans.values())))
    of_gaps = {name: gaps_of(run, power.channels) for name, power in powers.items()}
    of_stages = dict(zip(known, whole.reshape(len(known), len(spans), len(windows)), strict=True))
    nothing = max(NOTHING * float(np.max(np.abs(whole), initial=0.0)), SMALLEST)
    joules: dict[str, list[float] | None] = dict.fromkeys(cascade.parts)
    bridged: dict[str, tuple[float, ...]] = {}
    faults: dict[str, dict[int, str]] = {"its window": {}, "the cycle": {}}
    payouts = np.array([cycle.payout_end - cycle.onset for cycle in phased.cycles])
    for name, (stage, span) in cascade.parts.items():
        if stage not in powers:
            continue
        energy, gaps = of_stages[stage][[*spans].index(span)], of_gaps[stage]
        joules[name] = (SIGN.get(name, 1.0) * energy).tolist()
        idle = (
            stage in ELECTRICAL and run.open_circuit
        )  # no current flows: any of it is a large share
        if len(gaps) and not idle:
            watts, moved = (
                known[stage](slice(None)),
                np.zeros(len(windows)),
            )  # at an onset the line hardly moves
            if (
                span == "window" and phased.rule != "payout"
            ):  # what moves onset or plateau moves the cutoff
                onset, cutoff = spans["window"].T
                instants = onset if isinstance(phased.rule, float) else cutoff - limits.settle
                moved = instant_error(run, phased.v_smooth, instants, limits)
            changed = energy_error(run.t, watts, gaps, spans[span], moved, limits.smoothing)
            bridged[name] = tuple(changed.tolist())
            # the net energy of a reciprocating machine may be small
            flow = (
                energy
                if rig.phases.by_motion
                else integrals(run.t, np.abs(watts).__getitem__, spans[span])
            )
            share = np.where(
                np.ptp(spans[span], axis=1) > 0.0, changed / np.maximum(np.abs(flow), nothing), 0.0
            )
            place = "its window" if span == "window" else "the cycle"
            phase = np.maximum(payouts, np.ptp(spans[span], axis=1))
            longest = np.minimum(limits.gap_max, OF_PHASE * phase + 1.0 / run.fs)
            limit = limits.gap_energy_max
            found = gap_faults(name, place, gaps, spans[span], longest, share, limit)
            faults[place] = found | faults[place]
    return Energies(
        [replace(w, fault=w.fault or faults["its window"].get(k)) for k, w in enumerate(windows)],
        [replace(n, reason=n.reason or faults["the cycle"].get(k)) for k, n in enumerate(nets)],
        joules,
        bridged,
    )


def gap_faults(
    name: str,
    place: str,
    gaps: Signal,
    spans: Signal,
    longest: Signal,
    share: Signal,
    limit: float,
) -> dict[int, str]:
    """Faults of the spans in which a gap is too long, or in which bridging could change the energy
    by too much.

    Parameters
    ----------
    name, place : of the energy, and what its spans are called
    longest : gap in each span that may be bridged, (k,) [s]
    share, limit : of the energy in each span that bridging could change, (k,), and may change [1]
    """
    found: dict[int, str] = {}
    width = gaps[:, 1] - gaps[:, 0]
    for begin, end in gaps[width > np.min(longest, initial=np.inf)].tolist():
        touched = (spans[:, 0] < end) & (spans[:, 1] > begin) & (end - begin > longest)
        for k in np.flatnonzero(touched).tolist():
            found.setdefault(k, f"a gap of {end - begin:.2f} s lies in {place} (E_{name})")
    for k in np.flatnonzero(share > limit).tolist():
        found.setdefault(k, f"bridging its gaps could change E_{name} by {min(share[k], 9.99):.1%}")
    return found
