"""Faults of the channels of a log: each becomes a finding; lost samples are bridged, unusual ones are kept and reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.integrate import stretches_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Mask, Repair, Repairs, Signal
from winchcascade.ingest.assign import gives_result
from winchcascade.ingest.checks.agreement import (
    SIGN_CORRECTED,
    correct_signs,
    disagreements,
    power_disagrees,
    speed_disagrees,
    without_sign,
)
from winchcascade.ingest.checks.balance import is_dead, others_deliver, powers_of
from winchcascade.ingest.checks.channel_findings import (
    MAY_HOLD,
    REPAIRED_IN_PART,
    at,
    limits_of,
    out_of_range,
    saturated,
    text_of,
)
from winchcascade.ingest.checks.dropouts import find_filled
from winchcascade.ingest.checks.interpolated import find_interpolated
from winchcascade.ingest.checks.jumps import take_out_jumps
from winchcascade.ingest.checks.log_in_check import SLOPE_WIDTH, LogInCheck, in_places, slope, stages_of, whole
from winchcascade.ingest.checks.spikes import Bends
from winchcascade.ingest.checks.stuck import ObservedMotion, find_still, find_stuck, motion, repeated_rows
from winchcascade.ingest.checks.timing import check_clock
from winchcascade.ingest.checks.witnesses import Witnesses

FOLLOW_LINE = frozenset({"displacement", "pressure", "force", "torque", "power_mech", "vdc", "idc"})
"""Channels that must change while the line pays out faster or slower; a channel of your own may hold its value."""

APPLIED = ("missing_channel", "derived_channel", "not_a_number", "sign_flipped")
"""Findings whose action does not change a number that was logged: these are done without repairs, too."""

_FEW = 1000
"""Number of samples that are compared first to show whether a channel changes at all."""


class Checked(msgspec.Struct, frozen=True):
    """Stamps, channels without holes, the gaps that were bridged in each, (k, 2) stamps [s], and what was found.

    `t` differs from the log's stamps where rows were lost while the clock was renumbered; `clock` holds the gaps there.
    `signs` has -1 for each channel that is logged with the opposite sign.
    """

    t: Signal
    channels: dict[str, Signal]
    gaps: dict[str, Signal]
    findings: tuple[Finding, ...]
    clock: Signal
    signs: Mapping[str, float] = {}


def check(
    t: Signal, channels: dict[str, Signal], rig: Rig, *, simulated: bool, open_circuit: bool, repairs: Repairs = "on"
) -> Checked:
    """Check every channel of a log and bridge what is lost.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    channels : (n,) each, SI units, NaN where a cell was not a number; the arrays are used up
    simulated : a simulated log has no sensors that could be stuck or out of range
    open_circuit : without a load no current flows, however long
    repairs : "off" keeps what was logged; only cells without a number are bridged
    """
    if repairs == "on":
        return _repaired(LogInCheck.of(t, channels, rig), simulated=simulated, open_circuit=open_circuit)
    logged = LogInCheck.of(t, {name: x.copy() for name, x in channels.items()}, rig)
    found = _repaired(LogInCheck.of(t, channels, rig), simulated=simulated, open_circuit=open_circuit)
    return _as_logged(logged, found)


def _repaired(log: LogInCheck, *, simulated: bool, open_circuit: bool) -> Checked:
    """Check a log and repair it."""
    channels, findings = log.channels, log.findings
    if not simulated and "displacement" not in channels:  # with a displacement the clock shows them
        findings += repeated_rows(log.t, channels)
    for name in list(channels):
        _take_out_holes(log, name)
    for name in channels:
        _take_out_filled(log, name)
    _report_missing(log)
    sharp = take_out_jumps(log, open_circuit=open_circuit)
    v, displacement = channels.get("velocity"), channels.get("displacement")
    if not (simulated or v is None or displacement is None) and _constant(v) and not _constant(displacement):
        log.leave_out("velocity", "left out")
    if not gives_result(channels, log.rig):
        return Checked(log.t, {}, {}, tuple(findings), np.empty((0, 2)))
    renumbered = np.empty((0, 2)) if simulated else _check_clock(log)
    logged = not simulated and "velocity" in channels and "displacement" in channels
    _complete_velocity(log)
    if logged:
        _give_direction(log)
    corrected = correct_signs(channels) if "velocity" in channels else []
    findings += corrected
    if not simulated:
        _check_sensors(log, corrected)
        _take_out_interpolated(log, sharp)
        witnesses = Witnesses(channels, {name: bends.usual for name, bends in sharp.items()})
        if "velocity" in channels:
            _take_out_stuck(log, witnesses, open_circuit=open_circuit)
        else:
            _take_out_still(log, witnesses)
        findings += _dead(log, open_circuit=open_circuit)
        _compare_channels(log, logged=logged)
    signs = {f.channel: -1.0 for f in corrected if f.channel is not None}
    return msgspec.structs.replace(_checked(log, renumbered), signs=signs)


def _as_logged(log: LogInCheck, found: Checked) -> Checked:
    """The log as it was logged, with what was found; its convention of signs is not a fault, and no number is no value.

    Parameters
    ----------
    found : the log with its repairs
    """
    for name in list(log.channels):
        _take_out_holes(log, name)
    applied = [kind for kind in APPLIED if kind != "derived_channel" or "velocity" not in log.channels]
    _complete_velocity(log)
    for finding in found.findings:
        x = None if finding.channel is None else log.channels.get(finding.channel)
        if finding.kind == "sign_flipped" and finding.channel is not None and x is not None:
            turned = -x if finding.action == SIGN_CORRECTED else _directed(log.t, x, log.channels["displacement"])
            log.channels[finding.channel] = turned
    times = found.t, log.t
    kept = [f if f.kind in applied else _not_repaired(f, times) for f in found.findings if f.kind != "slack_line"]
    log.findings[:] = kept
    return msgspec.structs.replace(_checked(log, np.empty((0, 2))), signs=found.signs)


def _not_repaired(finding: Finding, times: tuple[Signal, Signal]) -> Finding:
    """A finding whose repair is not done, at times of the log instead of the clock that it would have."""
    moved = finding.at_times(*times)
    if moved.repair is None:
        return msgspec.structs.replace(moved, action="reported and kept") if REPAIRED_IN_PART in moved.action else moved
    repair = msgspec.structs.replace(moved.repair, applied=False)
    return msgspec.structs.replace(moved, action="kept, as repairs are off", removed=0, repair=repair)


def _checked(log: LogInCheck, renumbered: Signal) -> Checked:
    """Bridge what is lost of a log; the log with what was found."""
    gaps = log.bridge()
    force = log.channels.get("force")
    if force is not None and force.min() < 0 and not log.rig.winch.line_can_push:
        what = "samples have a line tension below zero (for a rod, state line_can_push = true under [winch] of the rig file)"
        log.findings.append(at(log.t, force < 0, "slack_line", "force", what))
    return Checked(log.t, log.channels, gaps, tuple(log.findings), renumbered)


def _check_sensors(log: LogInCheck, corrected: Sequence[Finding]) -> None:
    """Report values that the sensors cannot give."""
    signs = {f.channel: -1.0 for f in corrected}
    for name, x in log.channels.items():
        channel = log.rig.known_channels[name]
        if name in log.rig.sensors:
            wild, sign = log.spikes.get(name), signs.get(name, 1.0)
            log.findings += out_of_range(log.t, channel, x, wild, sign, log.rig.sensors[name])
        if name in log.rig.cascade.channels and name not in MAY_HOLD:
            log.findings += saturated(log.t, channel, x)


def _compare_channels(log: LogInCheck, *, logged: bool) -> None:
    """Report channels that contradict each other.

    Parameters
    ----------
    logged : velocity and displacement were logged, each by itself
    """
    channels, rig = log.channels, log.rig
    clock_is_wrong = any(f.kind == "clock_mismatch" and f.start is None for f in log.findings)
    if logged and "displacement" in channels and not clock_is_wrong:
        log.findings += disagreements(log.t, channels["velocity"], channels["displacement"], rig.thresholds.v_onset)
    log.findings += [*power_disagrees(channels, rig.r_drum), *speed_disagrees(channels, rig)]


def _check_clock(log: LogInCheck) -> Signal:
    """Check the clock, and move what was found before to the times put back; the gaps where they were lost, (k, 2). [s]"""
    timed = check_clock(log.t, log.channels, log.rig.thresholds)
    if timed.t is not log.t:
        log.findings[:] = [finding.at_times(log.t, timed.t) for finding in log.findings]
    log.findings += timed.findings
    log.t = timed.t
    return timed.gaps


def _take_out_holes(log: LogInCheck, name: str) -> None:
    """Take out cells that are empty or not a number; a channel that holds no number is missing."""
    x = log.channels[name]
    if not np.isfinite(x.sum()):
        bad = ~np.isfinite(x)
        if bad.all():
            del log.channels[name]
            log.findings.append(Finding("missing_channel", f"the column for {name} holds no number", "left out", name))
            return
        if bad.any():
            log.findings.append(log.take_out(name, bad, "not_a_number", "cells are empty or not a number"))


def _take_out_filled(log: LogInCheck, name: str) -> None:
    """Take out the zeros that a logger writes where a slow channel has no new value."""
    filled = find_filled(log.channels[name])
    if filled is not None:
        what = "rows hold 0 between the updates of a slower channel"
        log.findings.append(log.take_out(name, filled, "dropped_samples", what))


def _report_missing(log: LogInCheck) -> None:
    """Report channels for which the rig has sensors and the log has no column; mechanical power replaces torque."""
    known = {*log.channels, *(f.channel for f in log.findings if f.kind == "missing_channel")}
    for name in log.rig.sensors:
        if name not in known and not (name == "torque" and "power_mech" in log.channels):
            message = f"the log has no {name} channel"
            log.findings.append(Finding("missing_channel", message, "metrics that need it are null", name))


def _constant(x: Signal) -> bool:
    """Whether a channel is one value throughout; most show within a few samples that they are not."""
    return all(np.ptp(part[np.isfinite(part)]) == 0 for part in (x[:_FEW], x) if np.isfinite(part).any())


def _complete_velocity(log: LogInCheck) -> None:
    """Derive a velocity that the log lacks from its displacement, else from the speed of rotation and the drum's radius."""
    if "velocity" not in log.channels and "displacement" in log.channels:
        _derive_velocity(log)
    if "velocity" not in log.channels and "speed" in log.channels and log.rig.r_drum is not None:
        _velocity_from_speed(log, log.rig.r_drum)


def _derive_velocity(log: LogInCheck) -> None:
    """Derive the velocity that the log lacks from its displacement, whose holes are then those of the velocity too."""
    log.channels["velocity"] = slope(log.t, log.channels["displacement"])
    log.lost["velocity"] = log.lost["displacement"].copy()
    _report_derived(log, f"derived from the displacement: its slope, smoothed over {SLOPE_WIDTH:g} s")


def _velocity_from_speed(log: LogInCheck, r_drum: float) -> None:
    """Derive the velocity of a log without motion of the line from the speed of rotation and the drum's radius [m]."""
    log.channels["velocity"] = log.channels["speed"] * r_drum
    log.lost["velocity"] = log.lost["speed"].copy()
    _report_derived(log, f"derived from the speed of rotation with the drum radius of {r_drum:g} m")


def _report_derived(log: LogInCheck, action: str) -> None:
    """Report a velocity that was made from another channel, in place of one that is missing."""
    missing = [f for f in log.findings if f.kind == "missing_channel" and f.channel == "velocity"]
    log.findings[:] = [f for f in log.findings if f not in missing]
    message = missing[0].message if missing else "the log has no usable velocity"
    log.findings.append(Finding("derived_channel", message, action, "velocity", repair=Repair(action, 0)))


def _give_direction(log: LogInCheck) -> None:
    """Give a speed that has no sign the direction of the displacement."""
    v, displacement, thresholds = log.channels["velocity"], log.channels["displacement"], log.rig.thresholds
    if without_sign(log.t, v, displacement, thresholds.v_onset, thresholds.stroke_min):
        log.channels["velocity"] = _directed(log.t, v, displacement)
        message = "velocity has one sign whichever way the displacement goes: it is a speed without direction"
        repair = Repair("given the direction of the displacement", v.size)
        log.findings.append(Finding("sign_flipped", message, repair.what, "velocity", repair=repair))


def _directed(t: Signal, v: Signal, displacement: Signal) -> Signal:
    """A speed with the direction of the displacement. [m/s]"""
    return np.where(slope(t, displacement) < 0, -np.abs(v), np.abs(v))


def _motion(log: LogInCheck) -> ObservedMotion | None:
    """Motion of the line, or of the shaft of a bench without one; None where the log has neither."""
    channels, rig = log.channels, log.rig
    if "velocity" in channels:
        return motion(log.t, whole(log.t, channels["velocity"]), rig.thresholds.v_onset)
    if "speed" in channels:
        return motion(log.t, whole(log.t, channels["speed"]), rig.phases.omega_onset)
    return None


def _take_out_interpolated(log: LogInCheck, bends: Mapping[str, Bends]) -> None:
    """Take out the samples with which gaps were filled in before."""
    line = _motion(log)
    moving = np.ones(log.t.size, dtype=bool) if line is None else line.out | line.back
    filled = find_interpolated(log.t, log.channels, bends, moving)
    if not filled:
        return
    any_filled = np.zeros(log.t.size, dtype=bool)
    for name, samples in filled.items():
        bad = np.zeros(log.t.size, dtype=bool)
        bad[samples] = True
        any_filled |= bad
        log.lose(name, bad)
    places = in_places(len(stretches_of(any_filled)))
    what = f"run between their neighbours without noise, in {places}, as if a gap had been filled in"
    *others, last = filled
    found = at(log.t, any_filled, "dropped_samples", last, f"samples {what}", removed=True)
    if others:
        alike = all(np.array_equal(samples, filled[last]) for samples in filled.values())
        said = f"{found.count} samples of {', '.join(others)} {'and' if alike else 'or'} {last} {what}"
        found = msgspec.structs.replace(found, message=said, channel=None)
    log.findings.append(found)


def _take_out_stuck(log: LogInCheck, witnesses: Witnesses, *, open_circuit: bool) -> None:
    """Take out the samples that only repeat a stuck value; a value beyond the sensor's range is kept."""
    t, channels, sensors = log.t, log.channels, log.rig.sensors
    line = motion(t, whole(t, channels["velocity"]), log.rig.thresholds.v_onset)
    names = [name for name in channels if name in FOLLOW_LINE and not (open_circuit and name == "idc")]
    for name in ("velocity", *names):
        x = channels[name]
        low, high = limits_of(sensors.get(name))
        stretches = [(a, b) for a, b in find_stuck(name, line, witnesses) if low <= x[a] <= high]
        if not stretches:
            continue
        bad = _repeats(stretches, x.size)
        if bad.sum() >= t.size - 2 and name != "velocity":
            log.leave_out(name, "channel left out, metrics that need it are null")
            continue
        log.findings.append(log.take_out(name, bad, "stuck", _stuck_words(stretches)))
        if name == "velocity":
            line = motion(t, log.bridged(name, bad), log.rig.thresholds.v_onset)


def _take_out_still(log: LogInCheck, witnesses: Witnesses) -> None:
    """Take out what repeats a stuck value in a log without a line; report a channel that holds one value throughout."""
    used = [name for name in log.rig.cascade.channels if name in log.channels]
    constant = {name: _constant(log.channels[name]) for name in used}
    shaft = _motion(log) or motion(log.t, np.zeros(log.t.size), 1.0)
    powers = powers_of(log.channels, stages_of(log))
    for name in used:
        x, channel = log.channels[name], log.rig.known_channels[name]
        low, high = limits_of(log.rig.sensors.get(name))
        loaded = others_deliver(name, powers, log.t.size)
        stretches = [(a, b) for a, b in find_still(name, shaft, witnesses, loaded) if low <= x[a] <= high]
        if stretches:
            bad = _repeats(stretches, x.size)
            log.findings.append(log.take_out(name, bad, "stuck", _stuck_words(stretches)))
        elif constant[name] and np.nanmax(np.abs(x)) > 0.0 and not all(constant.values()):
            value = f"{text_of(channel, float(np.nanmax(x)))} {channel.unit}"
            what = f"{name} holds one value, {value}, through the whole log while other channels change"
            ends = float(log.t[0]), float(log.t[-1])
            log.findings.append(Finding("stuck", what, "reported and kept", name, *ends, x.size))


def _dead(log: LogInCheck, *, open_circuit: bool) -> list[Finding]:
    """Report channels that are zero throughout although their stages work; in open circuit no current flows."""
    moving, powers = _motion(log), powers_of(log.channels, stages_of(log))
    turns = moving is not None and bool((moving.out | moving.back).any())
    ends = float(log.t[0]), float(log.t[-1])
    action = "reported and kept, so that its energies are zero; check the sensor, and which column is read"
    return [
        Finding(
            "dead_channel",
            f"{name} is zero through the whole log while its stage works",
            action,
            name,
            *ends,
            log.t.size,
        )
        for name in log.rig.cascade.channels
        if name in log.channels and not (open_circuit and name == "idc")
        if is_dead(name, log.channels, powers, turns=turns)
    ]


def _repeats(stretches: Sequence[tuple[int, int]], samples: int) -> Mask:
    """Samples that only repeat a held value: the first one of each stretch is still a measurement."""
    bad = np.zeros(samples, dtype=bool)
    for a, b in stretches:
        bad[a + 1 : b] = True
    return bad


def _stuck_words(stretches: Sequence[tuple[int, int]]) -> str:
    count = f"{len(stretches)} stretch{'es' if len(stretches) > 1 else ''}"
    return f"samples repeat one value where it should change, in {count}"
