"""Whether sensors read zero at rest, and the line tension what the gas allows.

No channel is changed. What smoothing blurs at both ends of a rest is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.integrate import largest, median, median_and_error, stretches_of
from winchcascade.reduction.checks.phased_log import MIN_COMPARED, Fault, PhasedLog, Span

TIME_CONSTANTS = 5.0
"""Number of time constants after which 0.7 % remains, which counts as nothing."""

RUN_DOWN = 5 / 3
"""Time constant with which the rotor runs down where the rig file lacks its inertia or its drag, in
widths that smooth the velocity. [1]"""

KNOWN = 0.01
"""Standard uncertainty of the frictionless force at rest: gas, piston and pressure sensor. [1]"""

UNSTATED = 0.05
"""Smallest zero of a torque sensor without a stated accuracy that is reported, as a share of the
usual torque; a current that is a smaller share of its usual value holds no torque, and a shaft
rests below a fifth of it, of its top speed. [1]"""


def waits_of(log: PhasedLog) -> dict[str, float]:
    """Channels that read nothing at rest, and the time after which they do. [s]

    Vdc and Idc do not in open circuit, where the bleed resistance alone discharges the capacitor
    over many seconds, nor does the torque of a rig whose file states no one-way clutch.
    """
    rig, load, smoothing = log.rig, log.run.load, log.rig.thresholds.smoothing
    inertia, drag, capacity = rig.drivetrain.inertia_rotor, rig.drivetrain.b_rotor, rig.dc_link.c_dc
    run_down = (
        inertia.value / drag.value
        if inertia and drag and drag.value > 0.0
        else RUN_DOWN * smoothing
    )
    waits = {"torque": TIME_CONSTANTS * run_down} if rig.drivetrain.one_way_clutch else {}
    if load is not None and math.isfinite(load):
        both = TIME_CONSTANTS * (run_down + load * (capacity.value if capacity else 0.0))
        waits |= {"idc": both, "vdc": both}
    return waits


def zeros(log: PhasedLog) -> Iterator[Fault]:
    """Zeros of torque, Idc and Vdc; else zeros that single holds show, which stepped or drifted
    within the log.

    A rest before a payout is not evaluated by itself: a line that tightens loads the shaft before
    it moves. What remains of a rest counts if it is longer than the smoothing, which cannot tell
    less of it from the beginning of the next motion.
    """
    rests = log.rests
    for channel, wait in waits_of(log).items():
        spans, holds = [], []
        for rest in rests:
            begin = max(rest.begin, rest.last + wait)
            if rest.end - begin > log.rig.thresholds.smoothing:
                spans.append((begin, rest.end))
                holds += [[spans[-1]]] if rest.hold else []
        for groups in ([spans], holds):
            off = [
                (zero, group) for group in groups if (zero := significant_zero(log, channel, group))
            ]
            if off:
                where = "at rest" if groups is not holds else f"in {len(off)} of {len(holds)} holds"
                values = {
                    "zero": max((zero for zero, _ in off), key=abs),
                    "limit": log.phased.u_zero(channel),
                    "where": where,
                }
                places = [span for _, group in off for span in group]
                yield Fault("zero", channel, places, values)
                break


def significant_zero(log: PhasedLog, channel: str, spans: list[Span], least: float = 0.0) -> float:
    """Median of a channel in some spans; 0 where the uncertainties of zero and median explain it,
    or where neither a zero of the sensor nor a least one is stated. [SI unit of the channel]
    """
    read, u_zero = log.samples(channel, spans), log.phased.u_zero(channel)
    least = max(least, CERTAIN * u_zero)
    if read.size < MIN_COMPARED // 2 or not least or abs(median(read)) < least:
        return 0.0
    zero, u = median_and_error(read)
    return zero if abs(zero) >= CERTAIN * math.hypot(u_zero, u) else 0.0


def bench_zero(log: PhasedLog) -> Iterator[Fault]:
    """A torque that does not read zero while the shaft of a bench without a line rests and no
    current flows.

    Where no accuracy of the torque sensor is stated, a zero counts from `UNSTATED` of the usual
    torque on.
    """
    run, onset = log.run, log.rig.phases.omega_onset
    if {"velocity", "force"} & run.channels.keys() or not {
        "speed",
        "torque",
    } <= run.channels.keys():
        return
    omega, blur = np.abs(run.channels["speed"]), 0.5 * log.rig.thresholds.smoothing
    top = largest(omega)
    still = omega <= min(onset, 0.2 * UNSTATED * top)
    if still.all():
        return
    current = np.abs(run.channels.get("idc", np.zeros(omega.size)))
    stretches = [
        (float(run.t[a]) + blur, float(run.t[b - 1]) - blur)
        for a, b in stretches_of(still).tolist()
    ]
    held = [(span, current[log.phased.rows(*span)]) for span in stretches]
    spans = [span for span, x in held if x.size and median(x) <= UNSTATED * median(current[~still])]
    stated, torque = log.phased.u_zero("torque"), run.channels["torque"]
    least = 0.0 if stated or top < onset else UNSTATED * median(np.abs(torque[~still]))
    zero = significant_zero(log, "torque", spans, least)
    if zero:
        name = "zero" if stated else "zero_of_unknown_sensor"
        yield Fault(
            name, "torque", spans, {"zero": zero, "limit": stated, "where": "while the shaft rests"}
        )


def force_at_rest(log: PhasedLog) -> Iterator[Fault]:
    """A line tension at rest that the friction of the screw cannot explain, by its efficiencies
    forth and back (Table 3), and one that rises or falls from rest to rest while the gas does not:
    the zero of the force cell drifts.

    Rests after haul-ins and holds after payouts have their own friction: each is divided by the
    force that holds the gas without friction (Sec. 2.1.2), and a line over the time is fitted to
    both. They scatter at least by the zero.
    """
    part, held = log.rig.restoring, log.forces_at_rest
    u_zero, spans = log.phased.u_zero("force"), [(rest.begin, rest.end) for rest, _, _ in held]
    if part.lead_angle and part.half_angle and part.mu_screw and held:
        tangent, flank, mu = (
            math.tan(part.lead_angle.value),
            math.cos(part.half_angle.value),
            part.mu_screw.value,
        )
        lowest = max((flank - mu / tangent) / (flank + mu * tangent), 0.0)
        highest = (flank + mu / tangent) / (flank - mu * tangent)
        rows = []
        for _, force, balanced in held:
            outside = max(force - highest * balanced, 0.0) + min(force - lowest * balanced, 0.0)
            certain = abs(outside) > CERTAIN * math.hypot(u_zero, KNOWN * balanced)
            rows.append((outside if certain else 0.0, force, lowest * balanced, highest * balanced))
        _, force, low, high = max(rows, key=lambda row: abs(row[0]))
        if median(np.array([row[0] for row in rows])) != 0.0:
            yield Fault("force_at_rest", "force", spans, {"force": force, "low": low, "high": high})
    held = [row for row in held if row[0].hold or row[0].begin > log.phased.cycles[0].onset]
    kinds = np.array(
        [(not rest.hold, rest.hold, 0.5 * (rest.begin + rest.end)) for rest, _, _ in held],
        dtype=np.float64,
    )
    if len(held) < 3:
        return
    forces, balances = np.array([(force, balanced) for _, force, balanced in held]).T
    usual = kinds[:, :2] @ [
        median(balances[kinds[:, k] > 0.0]) if kinds[:, k].any() else 0.0 for k in range(2)
    ]
    kinds[:, 2] = (kinds[:, 2] - log.run.t[0]) / (log.run.t[-1] - log.run.t[0])
    kinds = kinds[:, kinds.any(axis=0)]
    inverse, balanced = np.linalg.pinv(kinds), forces * usual / balances
    weight = inverse @ balanced
    residual = balanced - kinds @ weight
    scatter = math.hypot(
        u_zero, float(np.linalg.norm(residual)) / math.sqrt(max(forces.size - 3, 1))
    )
    u = scatter * float(np.linalg.norm(inverse[-1]))
    if abs(weight[-1]) > CERTAIN * max(u_zero, u):
        yield Fault(
            "force_drift",
            "force",
            [(rest.begin, rest.end) for rest, _, _ in held],
            {"over": float(weight[-1])},
        )
