"""Whether sensors read zero at rest, the torque also with the clutch open, and the line tension what the gas allows at rest."""

from __future__ import annotations

import math

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import largest, median, median_and_error, stretches_of
from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, FindingKind, Mask, Signal
from winchcascade.reduction.phased_run import PhasedRun

TIME_CONSTANTS = 5.0
"""Number of time constants after which 0.7 % remains, which counts as nothing."""

RUN_DOWN = 1.0
"""Time constant with which the rotor runs down where the rig file lacks its inertia or its drag. [s]"""

MIN_SAMPLES = 10
"""Smallest number of samples at rest that shows a zero."""

CLEAR = 4.0
"""Smallest zero in standard uncertainties of the median at rest."""

KNOWN = 0.01
"""Standard uncertainty of the frictionless force at rest: gas, piston and pressure sensor. [1]"""

NOISE = 1e-4
"""Noise of Vdc at rest over its largest value below which there is none: a sensor of 12 bit has more, a simulation less. [1]"""

BELOW = 0.2
"""Share of the samples of Vdc at rest that must be negative: a rectifier gives none, so that these are noise. [1]"""

SAME_NOISE = 0.9
"""Correlation at rest from which the noise of Idc is that of Vdc: two sensors share some of it, a computed column all. [1]"""

SLOW = 0.01
"""Share of its largest speed below which a shaft rests, if that is less than the speed from which on it turns. [1]"""

UNSTATED = 0.05
"""Smallest zero of a torque sensor without a stated accuracy that is reported, as a share of the usual torque. [1]"""

IDLE = 0.2
"""Share of its usual value below which a current holds no torque: electronics take some of it at rest. [1]"""

Span = tuple[float, float]

Rest = tuple[float, float, float]
"""Begin and end of a rest, and the end of the motion before it that turned the rotor. [s]"""


def zero_findings(phased: PhasedRun) -> list[Finding]:
    """Report zeros of torque, Idc, Vdc and force, and a torque in haul-in, that deviate by five standard uncertainties.

    No channel is changed. All rests are evaluated together, and each hold by itself, which shows a zero that stepped within the
    log. A rest before a payout is not evaluated by itself: a line that tightens loads the shaft before it moves. A sensor
    without a stated zero is not evaluated. Nor are Vdc and Idc in open circuit, where the bleed resistance alone discharges the
    capacitor over many seconds, and the torque of a rig whose file states no one-way clutch.
    """
    rig, load = phased.rig, phased.run.load
    before, holds = _rests(phased)
    rests = sorted([*before, *holds])
    inertia, drag, capacity = rig.drivetrain.inertia_rotor, rig.drivetrain.b_rotor, rig.dc_link.c_dc
    known = inertia is not None and drag is not None and drag.value > 0.0
    rotor = TIME_CONSTANTS * (inertia.value / drag.value if known and inertia and drag else RUN_DOWN)
    waits = {"torque": rotor} if rig.drivetrain.one_way_clutch else {}
    if load is not None and math.isfinite(load):
        waits |= dict.fromkeys(("idc", "vdc"), rotor + TIME_CONSTANTS * load * (capacity.value if capacity else 0.0))
    findings = []
    for channel, wait in waits.items():
        findings += _zero(phased, channel, _after(rests, wait), _after(holds, wait))
    if "torque" in waits:
        findings += _open_clutch(phased, _after(rests, rotor), _after(_haul_ins(phased), rotor))
    if "vdc" in waits:
        findings += _computed(phased, _after(rests, waits["vdc"]))
    return [*findings, *_force(phased, [(a, b) for a, b, _ in rests])]


def bench_zero_findings(phased: PhasedRun) -> list[Finding]:
    """Report a torque that does not read zero while the shaft of a bench without a line rests and no current flows.

    Where no accuracy of the torque sensor is stated, a zero counts from `UNSTATED` of the usual torque on.
    """
    run, rig = phased.run, phased.rig
    if {"velocity", "force"} & run.channels.keys() or not {"speed", "torque"} <= run.channels.keys():
        return []
    omega = np.abs(run.channels["speed"])
    onset, top = rig.phases.omega_onset, largest(omega)
    rests = omega <= min(onset, SLOW * top)
    blur = 0.5 * rig.thresholds.smoothing
    ends = [(float(run.t[a]) + blur, float(run.t[b - 1]) - blur) for a, b in stretches_of(rests).tolist()]
    spans = [(a, b) for a, b in ends if b > a and _without_current(phased, (a, b), ~rests)]
    stated = phased.u_zero("torque")
    level = 0.0 if stated or top < onset else UNSTATED * median(np.abs(run.channels["torque"][~rests]))
    read = _samples(phased, "torque", spans)
    if read.size < MIN_SAMPLES or not (stated or level):
        return []
    zero, u = median_and_error(read)
    if abs(zero) < max(CERTAIN * stated, level, CLEAR * u):
        return []
    known = f"its zero is known to {stated:.2g} N.m" if stated else "the rig file states no accuracy of the sensor"
    return [_finding("torque", f"torque reads {zero:+.3g} N.m while the shaft rests; {known}", spans)]


def _without_current(phased: PhasedRun, span: Span, moving: Mask) -> bool:
    """Whether no current flows in a span, so that the machine holds no torque; true where none is logged."""
    current = phased.run.channels.get("idc")
    if current is None or not moving.any():
        return True
    held = np.abs(_samples(phased, "idc", [span]))
    return held.size > 0 and median(held) <= IDLE * median(np.abs(current[moving]))


def _after(rests: list[Rest], wait: float) -> list[Span]:
    """The parts of some rests that begin so long after the motion that turned the rotor. [s]"""
    return [(max(a, last + wait), b) for a, b, last in rests]


def _rests(phased: PhasedRun) -> tuple[list[Rest], list[Rest]]:
    """Rests before payouts, and holds after them.

    Before the first payout the beginning of the log counts as the end of the motion, since the time before it is unknown.
    What smoothing blurs at both ends is left out.
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


def _haul_ins(phased: PhasedRun) -> list[Rest]:
    """Haul-ins, in which a one-way clutch is open, without what smoothing blurs at both ends."""
    blur = 0.5 * phased.rig.thresholds.smoothing
    cycles = [phased.cycles[k] for k in phased.chosen()]
    return [(c.haul_in[0] + blur, c.haul_in[1] - blur, c.payout_end) for c in cycles if c.haul_in is not None]


def _zero(phased: PhasedRun, channel: str, spans: list[Span], holds: list[Span]) -> list[Finding]:
    """The median of a channel where it should read nothing; else a zero that single holds show: it stepped or drifted."""
    zero, where = _significant_zero(phased, channel, spans), f"{channel} reads "
    if zero is None:
        zeros = [(span, x) for span in holds if (x := _significant_zero(phased, channel, [span])) is not None]
        if not zeros:
            return []
        spans, zero = [span for span, _ in zeros], max((x for _, x in zeros), key=abs)
        where = f"in {len(spans)} of {len(holds)} holds, but not over the whole log, {channel} reads up to "
    unit = phased.rig.known_channels[channel].unit
    message = (
        f"{where}{zero:+.3g} {unit} at rest, after rotor and capacitor have run down; its zero is known to "
        f"{phased.u_zero(channel):.2g} {unit}"
    )
    return [_finding(channel, message, spans)]


def _open_clutch(phased: PhasedRun, rests: list[Span], haul_ins: list[Span]) -> list[Finding]:
    """A torque in haul-in that the rests do not have: the rotor does not turn with the drum, so that it needs none."""
    at_rest = _samples(phased, "torque", rests) if "torque" in phased.run.channels else np.empty(0)
    known = at_rest.size >= MIN_SAMPLES
    drag = _significant_zero(phased, "torque", haul_ins, median(at_rest) if known else 0.0)
    if drag is None:
        return []
    beside = "beside its value at rest" if known else "and no rest is long enough to show its zero"
    message = (
        f"torque reads {drag:+.3g} N.m in haul-in, {beside}; its zero is known to {phased.u_zero('torque'):.2g} N.m"
    )
    action = "reported and kept: drag of the open clutch" + ("" if known else ", or a zero of the sensor")
    return [_finding("torque", message, [(a, b) for a, b in haul_ins if b > a], "open_clutch_torque", action)]


def _significant_zero(phased: PhasedRun, channel: str, spans: list[Span], known: float = 0.0) -> float | None:
    """Median of a channel in some spans beyond a known one, None where that is no more than its uncertainties.

    [SI unit of the channel]
    """
    u_zero = phased.u_zero(channel)
    if channel not in phased.run.channels or not u_zero:
        return None
    read = _samples(phased, channel, spans) - known
    if read.size < MIN_SAMPLES:
        return None
    if abs(median(read)) < CERTAIN * u_zero:  # most sensors
        return None
    zero, u = median_and_error(read)
    return zero if abs(zero) >= CLEAR * u else None


def _computed(phased: PhasedRun, spans: list[Span]) -> list[Finding]:
    """An Idc that follows even the noise of Vdc at rest: it was computed from Vdc and an assumed load."""
    if "vdc" not in phased.run.channels or "idc" not in phased.run.channels:
        return []
    v_dc, i_dc = (_samples(phased, name, spans) for name in ("vdc", "idc"))
    if v_dc.size < 2 * MIN_SAMPLES:
        return []
    top = largest(phased.run.channels["vdc"])
    below = np.mean(v_dc < 0.0)
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
    """A line tension at rest that the friction of the restoring module cannot explain."""
    u_zero, band = phased.u_zero("force"), _friction_band(phased.rig)
    if "force" not in phased.run.channels or not u_zero or band is None:
        return []
    rows = []
    for span in spans:
        force = _samples(phased, "force", [span])
        balanced = _frictionless(phased, span)
        if force.size >= MIN_SAMPLES and balanced is not None:
            held = median(force)
            low, high = band[0] * balanced, band[1] * balanced
            outside = max(held - high, 0.0) + min(held - low, 0.0)
            margin = CERTAIN * math.hypot(u_zero, KNOWN * balanced)
            rows.append((outside if abs(outside) > margin else 0.0, held, low, high))
    if not rows or median(np.array(rows)[:, 0]) == 0.0:
        return []
    _, held, low, high = max(rows, key=lambda row: abs(row[0]))
    message = f"force reads {held:.0f} N at rest, where gas and friction of the screw allow {low:.0f} to {high:.0f} N"
    return [_finding("force", message, spans, action=_CHECK_ZERO + " (or the line was slack)" * (held < low))]


def _frictionless(phased: PhasedRun, span: Span) -> float | None:
    """Line tension that holds the gas without friction (Sec. 2.1.2); None without a model of the restoring module. [N]"""
    part, radius = phased.rig.restoring, phased.rig.r_drum
    if radius is None or part.lead is None or part.area_piston is None:
        return None

    per_travel = (
        part.area_piston.value * part.lead.value / (2.0 * math.pi * radius)
    )  # gas volume, or force per pressure
    if "pressure" in phased.run.channels:
        gauge = _median_of(phased, "pressure", span)
    elif "displacement" in phased.run.channels and part.p_precharge is not None and part.volume_gas is not None:
        left = 1.0 - per_travel * _median_of(phased, "displacement", span) / part.volume_gas.value
        gauge = (part.p_precharge.value + ATMOSPHERE) / left - ATMOSPHERE if left > 0.0 else 0.0
    else:
        return None
    return gauge * per_travel if gauge > 0.0 else None


def _median_of(phased: PhasedRun, channel: str, span: Span) -> float:
    """Median of a channel in a span, 0 in one without samples."""
    read = _samples(phased, channel, [span])
    return median(read) if read.size else 0.0


def _friction_band(rig: Rig) -> tuple[float, float] | None:
    """Minimum and maximum force at rest over the frictionless one, by the efficiencies of the screw (Table 3)."""
    lead, half, friction = rig.restoring.lead_angle, rig.restoring.half_angle, rig.restoring.mu_screw
    if lead is None or half is None or friction is None:
        return None
    tangent, flank, mu = math.tan(lead.value), math.cos(half.value), friction.value
    reverse = (flank - mu / tangent) / (flank + mu * tangent)
    return max(reverse, 0.0), (flank + mu / tangent) / (flank - mu * tangent)


_CHECK_ZERO = "reported and kept; energies go with it: check the zero of the sensor"


def _finding(
    channel: str, message: str, spans: list[Span], kind: FindingKind = "zero_offset", action: str = _CHECK_ZERO
) -> Finding:
    return Finding(
        kind,
        message,
        action,
        channel,
        min(a for a, _ in spans),
        max(b for _, b in spans),
        len(spans),
    )
