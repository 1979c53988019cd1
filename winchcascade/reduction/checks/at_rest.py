"""Whether sensors read zero at rest, the torque also with the clutch open, and the line tension what the gas allows at rest.

No channel is changed. What smoothing blurs at both ends of a rest is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import largest, median, median_and_error, stretches_of
from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, Fault, PhasedLog, Span

TIME_CONSTANTS = 5.0
"""Number of time constants after which 0.7 % remains, which counts as nothing."""

RUN_DOWN = 1.0
"""Time constant with which the rotor runs down where the rig file lacks its inertia or its drag. [s]"""

CLEAR_ZERO = 4.0
"""Smallest zero in standard uncertainties of the median at rest."""

KNOWN = 0.01
"""Standard uncertainty of the frictionless force at rest: gas, piston and pressure sensor. [1]"""

BELOW = 0.2
"""Share of the samples of Vdc at rest that must be negative: a rectifier gives none, so that these are noise. [1]"""

SAME_NOISE = 0.9
"""Correlation at rest from which the noise of Idc is that of Vdc: two sensors share some of it, a computed column all. [1]"""

UNSTATED = 0.05
"""Smallest zero of a torque sensor without a stated accuracy that is reported, as a share of the usual torque; a current that
is a smaller share of its usual value holds no torque, and a shaft rests below a fifth of it, of its top speed. [1]"""


class Rest(NamedTuple):
    """A rest or a haul-in, and the end of the motion before it that turned the rotor. [s]"""

    begin: float
    end: float
    last: float

    def after(self, wait: float) -> Span:
        """The part that begins so long after the motion that turned the rotor. [s]"""
        return max(self.begin, self.last + wait), self.end


def rests_of(log: PhasedLog) -> dict[str, list[Rest]]:
    """Rests before payouts, holds after them, and haul-ins, in which a one-way clutch is open.

    Before the first payout the beginning of the log counts as the end of the motion, since the time before it is unknown.
    """
    phased, blur = log.phased, 0.5 * log.phased.rig.thresholds.smoothing
    clutch = phased.rig.drivetrain.one_way_clutch is not False
    found: dict[str, list[Rest]] = {"rest": [], "hold": [], "haul_in": []}
    for k in phased.chosen():
        cycle, before = phased.cycles[k], phased.cycles[k - 1] if k else None
        if not cycle.begins_inside and (before is None or before.haul_in is not None):
            begin = float(phased.run.t[0]) if before is None or before.haul_in is None else before.haul_in[1]
            last = begin if before is None or not clutch else before.payout_end
            found["rest"].append(Rest(begin + blur, cycle.onset - blur, last))
        for name, span in (("hold", cycle.hold), ("haul_in", cycle.haul_in)):
            if span is not None:
                found[name].append(Rest(span[0] + blur, span[1] - blur, cycle.payout_end))
    return found


def waits_of(log: PhasedLog) -> dict[str, float]:
    """Channels that read nothing at rest, and the time after which they do. [s]

    Vdc and Idc do not in open circuit, where the bleed resistance alone discharges the capacitor over many seconds, nor does
    the torque of a rig whose file states no one-way clutch.
    """
    rig, load = log.phased.rig, log.phased.run.load
    inertia, drag, capacity = rig.drivetrain.inertia_rotor, rig.drivetrain.b_rotor, rig.dc_link.c_dc
    known = inertia is not None and drag is not None and drag.value > 0.0
    rotor = TIME_CONSTANTS * (inertia.value / drag.value if known and inertia and drag else RUN_DOWN)
    waits = {"torque": rotor} if rig.drivetrain.one_way_clutch else {}
    if load is not None and math.isfinite(load):
        waits |= dict.fromkeys(("idc", "vdc"), rotor + TIME_CONSTANTS * load * (capacity.value if capacity else 0.0))
    return waits


def significant_zero(log: PhasedLog, channel: str, spans: Sequence[Span], known: float = 0.0) -> float | None:
    """Median of a channel in some spans beyond a known one; None where that is no more than its uncertainties, or where no zero
    of the sensor is stated. [SI unit of the channel]
    """
    read, limit = log.samples(channel, spans) - known, log.zero_limit(channel)
    if read.size < MIN_COMPARED // 2 or not limit:
        return None
    zero, u = median_and_error(read)
    return zero if abs(zero) >= max(limit, CLEAR_ZERO * u) else None


def zeros(log: PhasedLog) -> Iterator[Fault]:
    """Zeros of torque, Idc and Vdc; else zeros that single holds show, which stepped or drifted within the log.

    A rest before a payout is not evaluated by itself: a line that tightens loads the shaft before it moves.
    """
    found = rests_of(log)
    for channel, wait in waits_of(log).items():
        spans = [rest.after(wait) for rest in sorted([*found["rest"], *found["hold"]])]
        zero, limit = significant_zero(log, channel, spans), log.phased.u_zero(channel)
        if zero is not None:
            yield Fault("zero", channel, read={"zero": zero, "limit": limit}, spans=spans)
            continue
        holds = [hold.after(wait) for hold in found["hold"]]
        off = {span: x for span in holds if (x := significant_zero(log, channel, [span])) is not None}
        if off:
            read, values = {"zero": max(off.values(), key=abs), "limit": limit}, {"some": len(off), "all": len(holds)}
            yield Fault("zero_in_holds", channel, values, read, list(off))


def open_clutch(log: PhasedLog) -> Iterator[Fault]:
    """A torque in haul-in that the rests do not have: the rotor does not turn with the drum, so that it needs none."""
    wait = waits_of(log).get("torque")
    if wait is None:
        return
    found = rests_of(log)
    at_rest = log.samples("torque", [rest.after(wait) for rest in (*found["rest"], *found["hold"])])
    known = at_rest.size >= MIN_COMPARED // 2
    spans = [span for rest in found["haul_in"] if (span := rest.after(wait))[1] > span[0]]
    drag = significant_zero(log, "torque", spans, median(at_rest) if known else 0.0)
    if drag is not None:
        beside = "beside its value at rest" if known else "and no rest is long enough to show its zero"
        values = {"beside": beside, "or_else": "" if known else ", or a zero of the sensor"}
        yield Fault("open_clutch", "torque", values, {"drag": drag, "limit": log.phased.u_zero("torque")}, spans)


def computed_current(log: PhasedLog) -> Iterator[Fault]:
    """An Idc that follows even the noise of Vdc at rest: it was computed from Vdc and an assumed load."""
    wait, found = waits_of(log).get("vdc"), rests_of(log)
    spans = (
        [] if wait is None else [span for r in (*found["rest"], *found["hold"]) if (span := r.after(wait))[1] > span[0]]
    )
    volt, ampere = log.samples("vdc", spans), log.samples("idc", spans)
    if not volt.size == ampere.size >= MIN_COMPARED or np.mean(volt < 0.0) < BELOW:
        return
    volt, ampere = np.diff(volt, 2), np.diff(ampere, 2)  # without what a slow motion gives both
    size = float(np.linalg.norm(volt) * np.linalg.norm(ampere))
    if size > 0.0 and float(volt @ ampere) >= SAME_NOISE * size:
        values = {"ohm": float(volt @ volt) / float(volt @ ampere)}
        yield Fault("computed_current", "idc", values, spans=spans, places=ampere.size)


def forces_at_rest(log: PhasedLog, rests: Sequence[Rest]) -> Mapping[Span, tuple[float, float]]:
    """Median line tension in each rest, and the one that holds the gas without friction (Sec. 2.1.2). [N]"""
    rig = log.phased.rig
    part, radius, found = rig.restoring, rig.r_drum, {}
    if radius is None or part.lead is None or part.area_piston is None or not log.phased.u_zero("force"):
        return {}
    per_travel = (
        part.area_piston.value * part.lead.value / (2.0 * math.pi * radius)
    )  # gas volume, or force per pressure
    for rest in rests:
        span = (rest.begin, rest.end)
        force, gauge, paid = (log.samples(name, [span]) for name in ("force", "pressure", "displacement"))
        balanced = 0.0
        if gauge.size:
            balanced = median(gauge) * per_travel
        elif paid.size and part.p_precharge is not None and part.volume_gas is not None:
            left = 1.0 - per_travel * median(paid) / part.volume_gas.value
            balanced = ((part.p_precharge.value + ATMOSPHERE) / left - ATMOSPHERE) * per_travel if left > 0.0 else 0.0
        if force.size >= MIN_COMPARED // 2 and balanced > 0.0:
            found[span] = median(force), balanced
    return found


def force_at_rest(log: PhasedLog) -> Iterator[Fault]:
    """A line tension at rest that the friction of the screw cannot explain, by its efficiencies forth and back (Table 3)."""
    part, found = log.phased.rig.restoring, rests_of(log)
    if part.lead_angle is None or part.half_angle is None or part.mu_screw is None:
        return
    held = forces_at_rest(log, sorted([*found["rest"], *found["hold"]]))
    tangent, flank, mu = math.tan(part.lead_angle.value), math.cos(part.half_angle.value), part.mu_screw.value
    band = (flank - mu / tangent) / (flank + mu * tangent), (flank + mu / tangent) / (flank - mu * tangent)
    rows = []
    for force, balanced in held.values():
        low, high = max(band[0], 0.0) * balanced, band[1] * balanced
        outside = max(force - high, 0.0) + min(force - low, 0.0)
        margin = CERTAIN * math.hypot(log.phased.u_zero("force"), KNOWN * balanced)
        rows.append((outside if abs(outside) > margin else 0.0, force, low, high))
    if rows and median(np.array(rows)[:, 0]) != 0.0:
        _, force, low, high = max(rows, key=lambda row: abs(row[0]))
        slack = " (or the line was slack)" * (force < low)
        yield Fault(
            "force_at_rest", "force", {"force": force, "low": low, "high": high, "slack": slack}, spans=list(held)
        )


def force_drift(log: PhasedLog) -> Iterator[Fault]:
    """A line tension that rises or falls from rest to rest while the gas does not: the zero of the force cell drifts.

    Rests after haul-ins and holds after payouts have their own friction. Each is divided by the frictionless force, and a line
    over the time is fitted to both. They scatter at least by the standard uncertainty of the zero.
    """
    found, columns, read = rests_of(log), [], []
    for kind, rests in enumerate((found["rest"][1:], found["hold"])):
        held = forces_at_rest(log, rests)
        usual = median(np.array([balanced for _, balanced in held.values()])) if held else 0.0
        for (begin, end), (force, balanced) in held.items():
            columns.append((float(kind == 0), float(kind == 1), 0.5 * (begin + end)))
            read.append((force * usual / balanced, begin, end))
    if len(read) < 3:
        return
    matrix, forces = np.array(columns), np.array(read)[:, 0]
    matrix = matrix[:, np.any(matrix, axis=0)]
    t = log.phased.run.t
    matrix[:, -1] = (matrix[:, -1] - t[0]) / (t[-1] - t[0])
    weight, *_ = np.linalg.lstsq(matrix, forces)
    residual = forces - matrix @ weight
    scatter = math.hypot(
        log.phased.u_zero("force"), float(np.linalg.norm(residual)) / math.sqrt(max(forces.size - 3, 1))
    )
    u = scatter * math.sqrt(np.linalg.pinv(matrix.T @ matrix)[-1, -1])
    if abs(weight[-1]) > max(log.zero_limit("force"), CERTAIN * u):
        yield Fault("force_drift", "force", {"over": float(weight[-1])}, spans=sorted((a, b) for _, a, b in read))


def bench_zero(log: PhasedLog) -> Iterator[Fault]:
    """A torque that does not read zero while the shaft of a bench without a line rests and no current flows.

    Where no accuracy of the torque sensor is stated, a zero counts from `UNSTATED` of the usual torque on.
    """
    run, rig = log.phased.run, log.phased.rig
    if {"velocity", "force"} & run.channels.keys() or not {"speed", "torque"} <= run.channels.keys():
        return
    omega, torque, blur = np.abs(run.channels["speed"]), run.channels["torque"], 0.5 * rig.thresholds.smoothing
    top = largest(omega)
    still = omega <= min(rig.phases.omega_onset, 0.2 * UNSTATED * top)
    if still.all():
        return
    current = np.abs(run.channels.get("idc", np.zeros(omega.size)))
    usual = median(current[~still])
    ends = [(float(run.t[a]) + blur, float(run.t[b - 1]) - blur) for a, b in stretches_of(still).tolist()]
    held = [(span, current[log.phased.rows(*span)]) for span in ends if span[1] > span[0]]
    spans = [span for span, x in held if x.size and median(x) <= UNSTATED * usual]
    read, stated = log.samples("torque", spans), log.phased.u_zero("torque")
    level = 0.0 if stated or top < rig.phases.omega_onset else UNSTATED * median(np.abs(torque[~still]))
    if read.size < MIN_COMPARED // 2 or not (stated or level):
        return
    zero, u = median_and_error(read)
    if abs(zero) >= max(CERTAIN * stated, level, CLEAR_ZERO * u):
        known = f"its zero is known to {stated:.2g} N.m" if stated else "the rig file states no accuracy of the sensor"
        yield Fault("bench_zero", "torque", {"known": known}, {"zero": zero}, spans)
