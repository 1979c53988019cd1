"""Faults of the channels of a log: each becomes a finding; lost samples are bridged, unusual
ones are kept and reported.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import msgspec
import numpy as np

from winchcascade.core.log_thresholds import completed, is_complete, log_scales, thresholds_finding
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Mask, Repair, Repairs, Signal
from winchcascade.ingest.assign import gives_result
from winchcascade.ingest.checks.faults import FILLED_ROWS, JUMPS, STILL, Fault
from winchcascade.ingest.checks.lost_rows import put_back
from winchcascade.ingest.checks.motion import clock_mismatch, directed, give_direction
from winchcascade.ingest.checks.samples import SLOPE_WIDTH, Samples
from winchcascade.ingest.checks.sensors import (
    MAY_HOLD,
    is_constant,
    leave_out,
    out_of_range,
    repeated_rows,
    report_constant,
    saturated,
)
from winchcascade.ingest.checks.signs import correct_signs

APPLIED = (
    "missing_channel",
    "derived_channel",
    "not_a_number",
    "sign_flipped",
    "thresholds_assumed",
)
"""Findings whose action does not change a number that was logged: these are done without
repairs, too.
"""

MIN_CHECKED = 50
"""Fewer samples do not show what a channel usually does. [1]"""


class Checked(msgspec.Struct, frozen=True):
    """Stamps, channels without holes, the gaps that were bridged in each, (k, 2) stamps [s], and
    what was found.

    `t` differs from the stamps of the log where rows were lost while the clock was renumbered;
    `clock` holds the gaps there. `signs` has -1 for each channel that is logged with the opposite
    sign. `rig` has complete thresholds.
    """

    t: Signal
    channels: dict[str, Signal]
    gaps: dict[str, Signal]
    findings: tuple[Finding, ...]
    clock: Signal
    rig: Rig
    signs: Mapping[str, float] = {}


def check(
    t: Signal,
    channels: dict[str, Signal],
    rig: Rig,
    *,
    simulated: bool,
    open_circuit: bool,
    repairs: Repairs = "on",
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
    logged = {name: x.copy() for name, x in channels.items()} if repairs == "off" else None
    log, complete = Samples(t, channels, rig, open_circuit), is_complete(rig, channels)
    log.rig = completed(rig, log_scales(t, _typical(log), rig)) if not complete else rig
    if not simulated and "displacement" not in channels:  # with a displacement the clock shows them
        repeated_rows(log)
    _take_out_holes(log)
    _run(log, FILLED_ROWS)
    _report_missing(log)
    _run(log, JUMPS)
    v, displacement = channels.get("velocity"), channels.get("displacement")
    if (
        not (simulated or v is None or displacement is None)
        and is_constant(v)
        and not is_constant(displacement)
    ):
        leave_out(log, "velocity", "left out")
    if not gives_result(channels, rig):
        return Checked(t, {}, {}, tuple(log.findings), np.empty((0, 2)), rig)
    renumbered = np.empty((0, 2)) if simulated else _check_clock(log)
    both = not simulated and "velocity" in channels and "displacement" in channels
    _complete_velocity(log)
    turned = both and give_direction(log)
    signs = correct_signs(log)
    if not simulated:
        for name in log.channels:
            if name in log.rig.sensors:
                out_of_range(log, name, signs.get(name, 1.0))
            if name in log.rig.cascade.channels and name not in MAY_HOLD:
                saturated(log, name)
        for fault in STILL:
            _run(
                log, fault, without=() if both or "displacement" not in channels else ("velocity",)
            )
        report_constant(log)
    log.rig = completed(rig, log_scales(log.t, log.channels, rig)) if not complete else rig
    assumed = thresholds_finding(rig, log.rig)
    log.findings += [] if assumed is None else [assumed]
    if logged is not None:
        return _as_logged(log, t, logged, signs, turned=turned)
    return _checked(log, renumbered, signs)


def _typical(log: Samples) -> dict[str, Signal]:
    """Channels within the range in which each usually moves: spikes and codes show no scale."""
    return {name: np.clip(x, *log.level(name)[:2]) for name, x in log.channels.items()}


def _run(log: Samples, fault: Fault, without: Collection[str] = ()) -> None:
    """Seek a fault in all channels until none is found, take out what has it, and report it.

    All channels are checked before the samples of one are taken out: each is a witness of the
    others.
    """
    total: dict[str, Mask] = {}
    for _ in range(fault.rounds):
        names = [
            n
            for n, x in log.channels.items()
            if n not in without and np.count_nonzero(np.isfinite(x)) > MIN_CHECKED
        ]
        found = {name: bad for name in names if (bad := fault.mask(log, name)).any()}
        for name, bad in found.items():
            log.take_out(name, bad)
            total[name] = total[name] | bad if name in total else bad
        if not found:
            break
    for name, bad in total.items():
        log.report(fault.kind, name, bad, fault.words)


def _take_out_holes(log: Samples) -> None:
    """Take out cells that are empty or not a number; a channel that holds no number is missing."""
    for name, x in [*log.channels.items()]:
        if np.isfinite(x.sum()):
            continue
        bad = ~np.isfinite(x)
        if bad.all():
            del log.channels[name]
            log.findings.append(
                Finding(
                    "missing_channel", f"the column for {name} holds no number", "left out", name
                )
            )
        elif bad.any():
            log.take_out(name, bad)
            log.report("not_a_number", name, bad, "are empty or not a number")


def _report_missing(log: Samples) -> None:
    """Report channels for which the rig has sensors and the log has no column; mechanical power
    replaces torque.
    """
    known = {*log.channels, *(f.channel for f in log.findings if f.kind == "missing_channel")}
    for name in log.rig.sensors:
        if name not in known and not (name == "torque" and "power_mech" in log.channels):
            message = f"the log has no {name} channel"
            log.findings.append(
                Finding("missing_channel", message, "metrics that need it are null", name)
            )


def _check_clock(log: Samples) -> Signal:
    """Check the clock, and put back the time of rows that were lost; stamps around these, (k,
    2). [s]
    """
    mismatch = clock_mismatch(log)
    if mismatch is not None:
        log.findings.append(Finding("clock_mismatch", mismatch, "reported and kept"))
    elif "displacement" in log.channels:
        return put_back(log)
    return np.empty((0, 2))


def _complete_velocity(log: Samples) -> None:
    """Derive a velocity that the log lacks from its displacement, else from the speed of
    rotation and the drum radius.
    """
    if "velocity" in log.channels:
        return
    if "displacement" in log.channels:
        source, velocity = "displacement", log.slope()
        action = f"derived from the displacement: its slope, smoothed over {SLOPE_WIDTH * log.smoothing:.3g} s"
    elif "speed" in log.channels and log.rig.r_drum is not None:
        source, velocity = "speed", log.channels["speed"] * log.rig.r_drum
        action = f"derived from the speed of rotation with the drum radius of {log.rig.r_drum:g} m"
    else:
        return
    log.channels["velocity"] = velocity
    if source in log.lost:
        log.lost["velocity"] = log.lost[source].copy()
    missing = [f for f in log.findings if f.kind == "missing_channel" and f.channel == "velocity"]
    log.findings[:] = [f for f in log.findings if f not in missing]
    message = missing[0].message if missing else "the log has no usable velocity"
    log.findings.append(
        Finding("derived_channel", message, action, "velocity", repair=Repair(action, 0))
    )


def _as_logged(
    found: Samples,
    t: Signal,
    channels: dict[str, Signal],
    signs: Mapping[str, float],
    *,
    turned: bool,
) -> Checked:
    """The log as it was logged, with what was found; its convention of signs is not a fault, and no
    number is no value.

    Parameters
    ----------
    found : the log with its repairs
    t, channels : stamps and channels as they were logged
    turned : whether the velocity was a speed that was given the direction of the displacement
    """
    log = Samples(t, channels, found.rig, found.open_circuit)
    _take_out_holes(log)
    applied = [
        kind for kind in APPLIED if kind != "derived_channel" or "velocity" not in log.channels
    ]
    _complete_velocity(log)
    if turned:
        log.channels["velocity"] = directed(log)
    for name, sign in signs.items():
        if name in log.channels:
            log.channels[name] = sign * log.channels[name]
    log.findings[:] = [
        f if f.kind in applied else _not_repaired(f.at_times(found.t, t)) for f in found.findings
    ]
    return _checked(log, np.empty((0, 2)), signs)


def _not_repaired(finding: Finding) -> Finding:
    """A finding whose repair is not done."""
    if finding.repair is None:
        return msgspec.structs.replace(finding, action="reported and kept")
    repair = msgspec.structs.replace(finding.repair, applied=False)
    return msgspec.structs.replace(
        finding, action="kept, as repairs are off", removed=0, repair=repair
    )


def _checked(log: Samples, renumbered: Signal, signs: Mapping[str, float]) -> Checked:
    """Bridge what is lost of a log; the log with what was found."""
    gaps = log.bridge()
    force = log.channels.get("force")
    slack = (
        log.rig.winch.line_can_push or log.rig.restoring.kind == "none"
    )  # a usual state, which noise puts below zero
    if force is not None and force.min() < 0 and not slack:
        what = "have a line tension below zero (for a rod, state line_can_push = true under [winch] of the rig file)"
        log.report("slack_line", "force", force < 0, what, removed=False)
    return Checked(log.t, log.channels, gaps, tuple(log.findings), renumbered, log.rig, signs)
