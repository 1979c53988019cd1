"""The three power streams: line, shaft, DC link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import integrals
from winchcascade.reduction.gap_error import bridging_error, gaps_of, instant_error, windows_of
from winchcascade.reduction.net_energy import PARTS, SIGN, NetSpan, spans_of
from winchcascade.reduction.windows import Window

if TYPE_CHECKING:
    from winchcascade.core.integrate import Stream
    from winchcascade.core.rig_file import Rig, WindowRule
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.phases import Cycle


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


def integrate_energies(
    run: Run,
    v_smooth: Signal,
    cycles: Sequence[Cycle],
    windows: Sequence[Window],
    nets: Sequence[NetSpan],
    rule: WindowRule,
    rig: Rig,
) -> Energies:
    """Integrate each stage's power over each window and each whole cycle.

    Gaps that make an energy uncertain become the fault of the window, or the reason why a cycle has no net energies.
    """
    spans = spans_of(windows, cycles, nets)
    joules: dict[str, list[float] | None] = dict.fromkeys(PARTS)
    bridged: dict[str, tuple[float, ...]] = {}
    faults: dict[bool, dict[int, str]] = {True: {}, False: {}}
    moved = _cutoff_error(run, v_smooth, spans["window"], rule, rig)
    for stage in STAGES:
        watts = stream(run.channels, stage, rig.r_drum)
        if watts is None:
            continue
        parts = {name: span for name, (source, span) in PARTS.items() if source == stage}
        joule = integrals(run.t, watts, np.concatenate([spans[span] for span in parts.values()]))
        gaps = gaps_of(run, sources(run.channels, stage))
        for (name, span), part in zip(parts.items(), np.split(joule, len(parts)), strict=True):
            joules[name] = (SIGN.get(name, 1.0) * part).tolist()
            if len(gaps) and not (
                stage == "gen" and run.open_circuit
            ):  # no current flows, so that any of it is a large share
                shift = moved if span == "window" else np.zeros(len(part))  # at an onset the line hardly moves
                found = faults[span == "window"]
                bridged[name] = tuple(_doubt(run, gaps, spans[span], part, shift, name, rig, found).tolist())
    return Energies(
        [Window(w.onset, w.cutoff, w.fault or faults[True].get(k)) for k, w in enumerate(windows)],
        [NetSpan(n.begin, n.end, n.travel, n.reason or faults[False].get(k)) for k, n in enumerate(nets)],
        joules,
        bridged,
    )


def _cutoff_error(run: Run, v_smooth: Signal, spans: Signal, rule: WindowRule, rig: Rig) -> Signal:
    """What gaps may move each cutoff, by moving the onset or the plateau that it hangs on, (k,) [s]."""
    if rule == "payout":
        return np.zeros(len(spans))
    return instant_error(run, v_smooth, spans[:, 0] if isinstance(rule, float) else spans[:, 1] - rig.thresholds.settle)


def _doubt(
    run: Run,
    gaps: Signal,
    spans: Signal,
    joule: Signal,
    moved: Signal,
    name: str,
    rig: Rig,
    faults: dict[int, str],
) -> Signal:
    """Name the spans in which a gap is too long, or in which bridging could change the energy by too much.

    Returns what it could change of each energy, (k,) [J].
    """
    limits = rig.thresholds
    stage, span = PARTS[name]
    where = "its window" if span == "window" else "the cycle"
    for begin, end in gaps[gaps[:, 1] - gaps[:, 0] > limits.gap_max]:
        for k in np.flatnonzero((spans[:, 0] < end) & (spans[:, 1] > begin)).tolist():
            faults.setdefault(k, f"a gap of {end - begin:.2f} s lies in {where} (E_{name})")
    watts = power(run.channels, stage, rig.r_drum)
    assert watts is not None
    square = (moved * np.interp(spans[:, 1], run.t, watts)) ** 2  # gaps err independently of each other
    error = bridging_error(run.t, watts, gaps) ** 2
    for which in windows_of(gaps, spans):
        np.add.at(square, which[which >= 0], error[which >= 0])
    changed: Signal = np.sqrt(square)
    share = np.where(spans[:, 1] > spans[:, 0], changed / np.maximum(np.abs(joule), 1e-9), 0.0)
    for k in np.flatnonzero(share > limits.gap_energy_max).tolist():
        faults.setdefault(k, f"bridging its gaps could change E_{name} by {min(share[k], 9.99):.1%}")
    return changed
