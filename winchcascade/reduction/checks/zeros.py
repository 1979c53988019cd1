"""Whether sensors read zero where the machine is at rest, and the line force what the restoring module allows there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import median
from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.core.run import CHANNELS, Finding

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.reduction.phased_run import PhasedRun

TIME_CONSTANTS = 5.0
"""What decays is gone after so many time constants: 0.7 % of it remains."""

RUN_DOWN = 1.0
"""Time constant with which the rotor runs down where the rig file lacks its inertia or its drag. [s]"""

FEWEST = 10
"""Fewer samples at rest give no zero."""

CLEAR = 4.0
"""A zero exceeds so many standard uncertainties of the median at rest too."""

KNOWN = 0.01
"""The frictionless force at rest is known this well: gas, piston and pressure sensor, one standard uncertainty. [1]"""

NOISE = 1e-4
"""Noise of Vdc at rest over its largest value below which there is none: a sensor of 12 bit has more, a simulation less. [1]"""

BELOW = 0.2
"""Share of the samples of Vdc at rest that must be negative: a rectifier gives none, so that these are noise. [1]"""

SAME_NOISE = 0.9
"""Correlation at rest from which the noise of Idc is that of Vdc: two sensors share some of it, a computed column all. [1]"""

Span = tuple[float, float]

Rest = tuple[float, float, float]
"""Begin and end of a rest, and the end of the motion before it that turned the rotor. [s]"""


def zero_findings(phased: PhasedRun) -> list[Finding]:
    """Report zeros of torque, Idc, Vdc and force that are off by five standard uncertainties; no channel is changed.

    All rests are evaluated together, and each hold by itself, which shows a zero that stepped within the log. A rest before a
    payout is not evaluated by itself: a line that tightens loads the shaft before it moves. A sensor without a stated zero is
    not evaluated. Nor are Vdc and Idc in open circuit, where the bleed resistance alone
    discharges the capacitor over many seconds, and the torque of a rig whose file states no one-way clutch.
    """
    before, holds = _rests(phased)
    rests = sorted([*before, *holds])
    decay = _decay(phased)
    findings = []
    for channel, wait in (
        ("torque", _run_down(phased.rig) if phased.rig.drivetrain.one_way_clutch else None),
        ("idc", decay),
        ("vdc", decay),
    ):
        if wait is not None:
            findings += _zero(phased, channel, _after(rests, wait)) or _stepped(phased, channel, _after(holds, wait))
    if decay is not None:
        findings += _computed(phased, _after(rests, decay))
    return [*findings, *_force(phased, [(a, b) for a, b, _ in rests])]


def _after(rests: list[Rest], wait: float) -> list[Span]:
    """What of some rests lies so long after the motion that turned the rotor. [s]"""
    return [(max(a, last + wait), b) for a, b, last in rests]


def _rests(phased: PhasedRun) -> tuple[list[Rest], list[Rest]]:
    """Rests before payouts, and holds after them.

    Before the first payout the log's beginning counts as that end, since nothing is known of the time before it. What
    smoothing blurs at both ends is left out.
    """
    blur = 0.5 * phased.rig.thresholds.smoothing
    clutch = phased.rig.drivetrain.one_way_clutch is not False
    start = float(phased.run.t[0])
    rests, holds = [], []
    for k in phased.chosen():
        cycle = phased.cycles[k]
        before = phased.cycles[k - 1] if k else None
        if not cycle.begins_inside and (before is None or before.haul_in is not None):
            begin = start if before is None or before.haul_in is None else before.haul_in[1]
            last = begin if before is None or not clutch else before.payout_end
            rests.append((begin + blur, cycle.onset - blur, last))
        if cycle.hold is not None:
            holds.append((cycle.hold[0] + blur, cycle.hold[1] - blur, cycle.payout_end))
    return rests, holds


def _run_down(rig: Rig) -> float:
    """Time after which the rotor stands still, by its drag alone. [s]"""
    inertia, drag = rig.drivetrain.inertia_rotor, rig.drivetrain.b_rotor
    known = inertia is not None and drag is not None and drag.value > 0.0
    return TIME_CONSTANTS * (inertia.value / drag.value if known and inertia and drag else RUN_DOWN)


def _decay(phased: PhasedRun) -> float | None:
    """Time after which neither voltage nor current is left at the load; None without a load. [s]"""
    load, capacity = phased.run.load, phased.rig.dc_link.c_dc
    if load is None or not math.isfinite(load):
        return None
    return _run_down(phased.rig) + TIME_CONSTANTS * load * (capacity.value if capacity else 0.0)


def _zero(phased: PhasedRun, channel: str, spans: list[Span]) -> list[Finding]:
    """The median of a channel where it should read nothing."""
    zero = _significant_zero(phased, channel, spans)
    if zero is None:
        return []
    return [_finding(channel, f"{channel} reads {_zero_text(phased, channel, zero)}", spans)]


def _stepped(phased: PhasedRun, channel: str, holds: list[Span]) -> list[Finding]:
    """A zero that single holds show: it stepped or drifted within the log."""
    zeros = [_significant_zero(phased, channel, [span]) for span in holds]
    spans = [span for span, zero in zip(holds, zeros, strict=True) if zero is not None]
    if not spans:
        return []
    most = max((zero for zero in zeros if zero is not None), key=abs)
    held = f"in {len(spans)} of {len(holds)} holds, but not over the whole log, {channel} reads up to "
    return [_finding(channel, held + _zero_text(phased, channel, most), spans)]


def _significant_zero(phased: PhasedRun, channel: str, spans: list[Span]) -> float | None:
    """Median of a channel in some spans, None where it is no more than its uncertainties. [SI unit of the channel]"""
    u_zero = phased.u_zero(channel)
    if channel not in phased.run.channels or not u_zero:
        return None
    read = _samples(phased, channel, spans)
    if read.size < FEWEST:
        return None
    zero = median(read)
    u = 1.4826 * median(np.abs(read - zero)) * math.sqrt(0.5 * math.pi / read.size)
    return zero if abs(zero) >= CERTAIN * u_zero and abs(zero) >= CLEAR * u else None


def _zero_text(phased: PhasedRun, channel: str, zero: float) -> str:
    unit = CHANNELS[channel].unit
    return (
        f"{zero:+.3g} {unit} at rest, after rotor and capacitor have run down; its zero is known to "
        f"{phased.u_zero(channel):.2g} {unit}"
    )


def _computed(phased: PhasedRun, spans: list[Span]) -> list[Finding]:
    """An Idc that follows even the noise of Vdc at rest: it was computed from Vdc and an assumed load."""
    if "vdc" not in phased.run.channels or "idc" not in phased.run.channels:
        return []
    v_dc, i_dc = (_samples(phased, name, spans) for name in ("vdc", "idc"))
    if v_dc.size < 2 * FEWEST:
        return []
    top = float(np.max(np.abs(phased.run.channels["vdc"])))
    below = np.count_nonzero(v_dc < 0.0) / v_dc.size
    v_dc, i_dc = np.diff(v_dc, 2), np.diff(i_dc, 2)  # without what a slow motion gives both
    size = float(np.linalg.norm(v_dc) * np.linalg.norm(i_dc))
    noisy = below >= BELOW and float(np.std(v_dc)) >= NOISE * top
    if not noisy or size == 0.0 or float(v_dc @ i_dc) < SAME_NOISE * size:
        return []
    ohm = float(v_dc @ v_dc) / float(v_dc @ i_dc)
    return [
        Finding(
            "load_mismatch",
            f"idc was computed: at rest it repeats the noise of vdc, divided by {ohm:.3g} ohm; Vdc / Idc cannot show the load",
            "reported and kept; E_gen is right only if that is the true load: log a measured current",
            "idc",
            min(a for a, _ in spans),
            max(b for _, b in spans),
            i_dc.size,
        )
    ]


def _samples(phased: PhasedRun, channel: str, spans: list[Span]) -> Signal:
    """Samples of a channel in some spans."""
    x = phased.run.channels[channel]
    parts = [x[phased.rows(a, b)] for a, b in spans if b > a]
    return np.concatenate(parts) if parts else np.empty(0)


def _force(phased: PhasedRun, spans: list[Span]) -> list[Finding]:
    """A line force at rest that the friction of the restoring module cannot explain."""
    u_zero = phased.u_zero("force")
    if "force" not in phased.run.channels or not u_zero:
        return []
    beyond, allowed, read = [], [], []
    for span in spans:
        force = _samples(phased, "force", [span])
        balanced = _frictionless(phased, span)
        if force.size >= FEWEST and balanced is not None:
            held = median(force)
            low, high = (share * balanced for share in _friction_band(phased.rig))
            margin = CERTAIN * math.hypot(u_zero, KNOWN * balanced)
            outside = max(held - high, 0.0) + min(held - low, 0.0)
            beyond.append(outside if abs(outside) > margin else 0.0)
            allowed.append((low, high))
            read.append(held)
    if not beyond or median(np.array(beyond)) == 0.0:
        return []
    k = int(np.argmax(np.abs(beyond)))
    return [
        _finding(
            "force",
            f"force reads {read[k]:.0f} N at rest, where gas and friction of the screw allow {allowed[k][0]:.0f} to "
            f"{allowed[k][1]:.0f} N",
            spans,
            " (or the line was slack)" if read[k] < allowed[k][0] else "",
        )
    ]


def _frictionless(phased: PhasedRun, span: Span) -> float | None:
    """Line force that holds the gas without friction (Sec. 2.1.2); None without a model of the restoring module. [N]"""
    part, radius = phased.rig.restoring, phased.rig.r_drum
    if radius is None or None in (part.lead, part.area_piston, part.lead_angle, part.half_angle, part.mu_screw):
        return None
    assert part.lead is not None
    assert part.area_piston is not None
    if "pressure" in phased.run.channels:
        read = _samples(phased, "pressure", [span])
        gauge = median(read) if read.size else 0.0
    elif "displacement" in phased.run.channels and part.p_precharge is not None and part.volume_gas is not None:
        read = _samples(phased, "displacement", [span])
        turns = (median(read) if read.size else 0.0) / (2.0 * math.pi * radius)
        taken = part.area_piston.value * part.lead.value * turns
        if taken >= part.volume_gas.value:
            return None
        gauge = (part.p_precharge.value + ATMOSPHERE) / (1.0 - taken / part.volume_gas.value) - ATMOSPHERE
    else:
        return None
    return gauge * part.area_piston.value * part.lead.value / (2.0 * math.pi * radius) if gauge > 0.0 else None


def _friction_band(rig: Rig) -> tuple[float, float]:
    """Least and largest force at rest over the frictionless one: efficiencies of the screw, reverse and forward (Table 3)."""
    part = rig.restoring
    assert part.lead_angle is not None
    assert part.half_angle is not None
    assert part.mu_screw is not None
    tangent, flank, mu = math.tan(part.lead_angle.value), math.cos(part.half_angle.value), part.mu_screw.value
    reverse = (flank - mu / tangent) / (flank + mu * tangent)
    forward = (flank - mu * tangent) / (flank + mu / tangent)
    return max(reverse, 0.0), 1.0 / forward


def _finding(channel: str, message: str, spans: list[Span], also: str = "") -> Finding:
    return Finding(
        "zero_offset",
        message,
        f"reported and kept; energies go with it: check the zero of the sensor{also}",
        channel,
        min(a for a, _ in spans),
        max(b for _, b in spans),
        len(spans),
    )
