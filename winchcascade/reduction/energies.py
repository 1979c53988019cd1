"""The three power streams: line, shaft, DC link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import integrals
from winchcascade.reduction.gap_error import energy_error, gaps_of, instant_error
from winchcascade.reduction.net_energy import PARTS, SIGN, NetSpan, spans_of
from winchcascade.reduction.windows import Window

if TYPE_CHECKING:
    from winchcascade.core.integrate import Stream
    from winchcascade.core.rig_file import Thresholds
    from winchcascade.core.run import Signal
    from winchcascade.reduction.phased_run import PhasedRun


STAGES = ("line", "mech", "gen")
"""The stages of the cascade in the order of the power's way."""


def power_line(f_line: Signal, v_line: Signal) -> Signal:
    """Power that the tether brings in, P = F v (Eq. 2); forces in N, velocities in m/s, payout positive. [W]"""
    return f_line * v_line


def power_mech(tau_pto: Signal, v_line: Signal, r_drum: float) -> Signal:
    """Power of the shaft behind the clutch, P = tau v / r_drum (Eq. 3); torque in N m, radius in m. [W]"""
    return tau_pto * (v_line / r_drum)


def power_gen(v_dc: Signal, i_dc: Signal) -> Signal:
    """Power at the DC link, P = Vdc Idc (Eq. 4). [W]"""
    return v_dc * i_dc


def stream(channels: Mapping[str, Signal], stage: str, r_drum: float | None) -> Stream | None:
    """Power stream of one stage as a function of the rows of the log, None where log or rig lack what it needs. [W]

    A logged mechanical power is taken as it is; otherwise torque and drum radius give it.
    """
    if any(name not in channels for name in sources(channels, stage)):
        return None
    x, y = (channels[name] for name in (*sources(channels, stage), "velocity")[:2])
    if stage == "line":
        return lambda part: power_line(x[part], y[part])
    if stage == "gen":
        return lambda part: power_gen(x[part], y[part])
    if "power_mech" in channels:
        return x.__getitem__
    return None if r_drum is None else lambda part: power_mech(x[part], y[part], r_drum)


def power(channels: Mapping[str, Signal], stage: str, r_drum: float | None) -> Signal | None:
    """Power stream of one stage over the whole log, (n,), None where log or rig lack what it needs. [W]"""
    part = stream(channels, stage, r_drum)
    return None if part is None else part(slice(None))


def sources(channels: Mapping[str, Signal], stage: str) -> tuple[str, ...]:
    """Channels that a stage's power is made of."""
    if stage == "line":
        return ("force", "velocity")
    if stage == "mech":
        return ("power_mech",) if "power_mech" in channels else ("torque", "velocity")
    return ("vdc", "idc")


class Energies(msgspec.Struct, frozen=True):
    """Windows and whole cycles with what is wrong with them, the energies of each by their names in `PARTS`, None for one
    not measured, and what gaps may have changed of them. [J]
    """

    windows: list[Window]
    nets: list[NetSpan]
    joules: dict[str, list[float] | None]
    bridged: dict[str, tuple[float, ...]]


def integrate_energies(phased: PhasedRun, windows: Sequence[Window], nets: Sequence[NetSpan]) -> Energies:
    """Integrate each stage's power over each window and each whole cycle.

    Gaps that make an energy uncertain become the fault of the window, or the reason why a cycle has no net energies.
    """
    run, limits = phased.run, phased.rig.thresholds
    spans = spans_of(windows, phased.cycles, nets)
    joules: dict[str, list[float] | None] = dict.fromkeys(PARTS)
    bridged: dict[str, tuple[float, ...]] = {}
    faults: dict[str, dict[int, str]] = {span: {} for span in spans}
    moved = dict.fromkeys(spans, np.zeros(len(windows)))  # at an onset the line hardly moves
    moved["window"] = _cutoff_error(phased, spans["window"])
    for stage in STAGES:
        watts = stream(run.channels, stage, phased.rig.r_drum)
        if watts is None:
            continue
        parts = {name: span for name, (source, span) in PARTS.items() if source == stage}
        joule = integrals(run.t, watts, np.concatenate([spans[span] for span in parts.values()]))
        gaps = gaps_of(run, sources(run.channels, stage))
        for (name, span), part in zip(parts.items(), np.split(joule, len(parts)), strict=True):
            joules[name] = (SIGN.get(name, 1.0) * part).tolist()
            if len(gaps) and not (stage == "gen" and run.open_circuit):  # no current flows: any of it is a large share
                changed = energy_error(run.t, watts(slice(None)), gaps, spans[span], moved[span])
                bridged[name] = tuple(changed.tolist())
                share = np.where(np.ptp(spans[span], axis=1) > 0.0, changed / np.maximum(np.abs(part), 1e-9), 0.0)
                for k, fault in gap_faults(name, gaps, spans[span], share, limits).items():
                    faults["window" if span == "window" else "cycle"].setdefault(k, fault)
    return Energies(
        [Window(w.onset, w.cutoff, w.fault or faults["window"].get(k)) for k, w in enumerate(windows)],
        [NetSpan(n.begin, n.end, n.travel, n.reason or faults["cycle"].get(k)) for k, n in enumerate(nets)],
        joules,
        bridged,
    )


def _cutoff_error(phased: PhasedRun, spans: Signal) -> Signal:
    """What gaps may move each cutoff, by moving the onset or the plateau that it depends on, (k,) [s]."""
    if phased.rule == "payout":
        return np.zeros(len(spans))
    instants = spans[:, 0] if isinstance(phased.rule, float) else spans[:, 1] - phased.rig.thresholds.settle
    return instant_error(phased.run, phased.v_smooth, instants)


def gap_faults(name: str, gaps: Signal, spans: Signal, share: Signal, limits: Thresholds) -> dict[int, str]:
    """Faults of the spans in which a gap is too long, or in which bridging could change the energy by too much.

    Parameters
    ----------
    name : of the energy in `PARTS`
    share : of the energy in each span that bridging could change, (k,) [1]
    """
    found: dict[int, str] = {}
    where = "its window" if PARTS[name][1] == "window" else "the cycle"
    for begin, end in gaps[gaps[:, 1] - gaps[:, 0] > limits.gap_max]:
        for k in np.flatnonzero((spans[:, 0] < end) & (spans[:, 1] > begin)).tolist():
            found.setdefault(k, f"a gap of {end - begin:.2f} s lies in {where} (E_{name})")
    for k in np.flatnonzero(share > limits.gap_energy_max).tolist():
        found.setdefault(k, f"bridging its gaps could change E_{name} by {min(share[k], 9.99):.1%}")
    return found
