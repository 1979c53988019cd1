"""Faults of the channels of a log: each becomes a finding; lost samples are bridged, unusual ones are kept and reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.channels import Channel
from winchcascade.core.integrate import stretches_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, FindingKind, Index, Mask, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.ingest.assign import gives_result
from winchcascade.ingest.checks.agreement import (
    correct_signs,
    disagreements,
    power_disagrees,
    speed_disagrees,
    without_sign,
)
from winchcascade.ingest.checks.balance import is_dead, others_deliver, powers_of
from winchcascade.ingest.checks.channel_findings import (
    MAY_HOLD,
    at,
    farthest,
    limits_of,
    out_of_range,
    saturated,
    text_of,
)
from winchcascade.ingest.checks.dropouts import ROUNDS, Dropout, find_dropouts, find_filled
from winchcascade.ingest.checks.glitches import LONGEST, Pulses, find_glitches, find_pulses
from winchcascade.ingest.checks.interpolated import find_interpolated
from winchcascade.ingest.checks.spikes import Bends, find_bends, single_spikes
from winchcascade.ingest.checks.stuck import ObservedMotion, find_still, find_stuck, motion, repeated_rows
from winchcascade.ingest.checks.timing import check_clock

FOLLOW_LINE = frozenset({"displacement", "pressure", "force", "torque", "power_mech", "vdc", "idc"})
"""Channels that must change while the line pays out faster or slower; a channel of your own may hold its value."""

SLOPE_WIDTH = 0.4
"""Width of the local quadratic of a displacement whose slope is a velocity. [s]"""

_FEW = 1000
"""Number of samples that are compared first to show whether a channel changes at all."""


class Checked(msgspec.Struct, frozen=True):
    """Stamps, channels without holes, the gaps that were bridged in each, (k, 2) stamps [s], and what was found.

    `t` differs from the log's stamps where rows were lost while the clock was renumbered; `clock` holds the gaps there.
    """

    t: Signal
    channels: dict[str, Signal]
    gaps: dict[str, Signal]
    findings: tuple[Finding, ...]
    clock: Signal


class _Log(msgspec.Struct):
    """A log while it is checked: channels, NaN where samples are lost, which samples these are, and what was found.

    `spikes` holds the samples that were taken out as spikes with what was logged there.
    """

    t: Signal
    channels: dict[str, Signal]
    rig: Rig
    lost: dict[str, Mask]
    spikes: dict[str, tuple[Index, Signal]] = msgspec.field(default_factory=dict)
    findings: list[Finding] = msgspec.field(default_factory=list)

    def lose(self, name: str, bad: Mask) -> None:
        """Mark samples of a channel as lost."""
        self.channels[name][bad] = np.nan
        self.lost[name] |= bad

    def take_out(self, name: str, bad: Mask, kind: FindingKind, what: str) -> Finding:
        """Mark samples of a channel as lost; the finding about them."""
        self.lose(name, bad)
        return at(self.t, bad, kind, name, what, removed=True)

    def take_out_spikes(self, name: str, samples: Index, what: str) -> list[Finding]:
        """Mark samples of a channel as lost and keep what was logged there; the finding about them, if there are any."""
        if samples.size == 0:
            return []
        new = samples, self.channels[name][samples]
        earlier = self.spikes.get(name, (samples[:0], new[1][:0]))
        self.spikes[name] = np.concatenate((earlier[0], new[0])), np.concatenate((earlier[1], new[1]))
        bad = np.zeros(self.t.size, dtype=bool)
        bad[samples] = True
        return [self.take_out(name, bad, "spike", what)]

    def leave_out(self, name: str, action: str) -> None:
        """Leave out a channel that holds one value throughout."""
        dead = not np.any(np.nan_to_num(self.channels.pop(name)))
        what = f"{name} {'is zero' if dead else 'holds one value'} through the whole log while the line moves"
        start, end, n = float(self.t[0]), float(self.t[-1]), self.t.size
        self.findings.append(Finding("dead_channel" if dead else "stuck", what, action, name, start, end, n, n))

    def bridged(self, name: str, bad: Mask) -> Signal:
        """A channel whose holes are bridged by straight lines, those of the velocity by the displacement."""
        x = _whole(self.t, self.channels[name])
        if name == "velocity" and "displacement" in self.channels and np.isfinite(self.channels["displacement"]).any():
            x = np.where(bad, _slope(self.t, self.channels["displacement"]), x)
        return x


def check(t: Signal, channels: dict[str, Signal], rig: Rig, *, simulated: bool, open_circuit: bool) -> Checked:
    """Check every channel of a log and bridge what is lost.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    channels : (n,) each, SI units, NaN where a cell was not a number; the arrays are used up
    simulated : a simulated log has no sensors that could be stuck or out of range
    open_circuit : without a load no current flows, however long
    """
    log = _Log(t, channels, rig, {name: np.zeros(t.size, dtype=bool) for name in channels})
    findings = log.findings
    if not simulated and "displacement" not in channels:  # with a displacement the clock shows them
        findings += repeated_rows(t, channels)
    for name in list(channels):
        _take_out_holes(log, name)
    _report_missing(log)
    sharp = _take_out_spikes(log, open_circuit=open_circuit)
    v, displacement = channels.get("velocity"), channels.get("displacement")
    if not (simulated or v is None or displacement is None) and _constant(v) and not _constant(displacement):
        log.leave_out("velocity", "left out")
    if not gives_result(channels, rig):
        return Checked(t, {}, {}, tuple(findings), np.empty((0, 2)))
    renumbered = np.empty((0, 2)) if simulated else _check_clock(log)
    t = log.t
    both = not simulated and "velocity" in channels and "displacement" in channels
    if "velocity" not in channels and "displacement" in channels:
        _derive_velocity(log)
    if "velocity" not in channels and "speed" in channels and rig.r_drum is not None:
        _velocity_from_speed(log, rig.r_drum)
    if both:
        _give_direction(log)
    corrected = correct_signs(channels) if "velocity" in channels else []
    findings += corrected
    if not simulated:
        signs = {f.channel: -1.0 for f in corrected}
        for name, x in channels.items():
            if name in rig.sensors:
                wild, sign = log.spikes.get(name), signs.get(name, 1.0)
                findings += out_of_range(t, rig.known_channels[name], x, wild, sign, rig.sensors[name])
            if name in rig.cascade.channels and name not in MAY_HOLD:
                findings += saturated(t, rig.known_channels[name], x)
        _take_out_interpolated(log, sharp)
        if "velocity" in channels:
            _take_out_stuck(log, open_circuit)
        else:
            _take_out_still(log)
        findings += _dead(log, open_circuit=open_circuit)
        clock_is_wrong = any(f.kind == "clock_mismatch" and f.start is None for f in findings)
        if both and "displacement" in channels and not clock_is_wrong:
            findings += disagreements(t, channels["velocity"], channels["displacement"], rig.thresholds.v_onset)
        findings += [*power_disagrees(channels, rig.r_drum), *speed_disagrees(channels, rig)]
    gaps = {}
    for name, bad in log.lost.items():
        if name in channels and bad.any():
            channels[name] = log.bridged(name, bad)
            first, after = stretches_of(bad).T
            gaps[name] = t[np.column_stack((np.maximum(first - 1, 0), np.minimum(after, t.size - 1)))]
    if "force" in channels and channels["force"].min() < 0 and not rig.winch.line_can_push:
        what = "samples have a line tension below zero (for a rod, state line_can_push = true under [winch] of the rig file)"
        findings.append(at(t, channels["force"] < 0, "slack_line", "force", what))
    return Checked(t, channels, gaps, tuple(findings), renumbered)


def _check_clock(log: _Log) -> Signal:
    """Check the clock, and move what was found before to the times put back; the gaps where they were lost, (k, 2). [s]"""
    timed = check_clock(log.t, log.channels, log.rig.thresholds)
    for k, finding in enumerate(log.findings):
        if finding.start is not None and finding.end is not None:
            start, end = np.interp([finding.start, finding.end], log.t, timed.t).tolist()
            log.findings[k] = msgspec.structs.replace(finding, start=start, end=end)
    log.findings += timed.findings
    log.t = timed.t
    return timed.gaps


def _take_out_holes(log: _Log, name: str) -> None:
    """Take out cells that are empty or not a number, and zeros that a logger writes where a slow channel has no new value.

    A channel that holds no number is missing.
    """
    x = log.channels[name]
    if not np.isfinite(x.sum()):
        bad = ~np.isfinite(x)
        if bad.all():
            del log.channels[name]
            log.findings.append(Finding("missing_channel", f"the column for {name} holds no number", "left out", name))
            return
        if bad.any():
            log.findings.append(log.take_out(name, bad, "not_a_number", "cells are empty or not a number"))
    filled = find_filled(x)
    if filled is not None:
        what = "rows hold 0 between the updates of a slower channel"
        log.findings.append(log.take_out(name, filled, "dropped_samples", what))


def _report_missing(log: _Log) -> None:
    """Report channels for which the rig has sensors and the log has no column; mechanical power replaces torque."""
    known = {*log.channels, *(f.channel for f in log.findings if f.kind == "missing_channel")}
    for name in log.rig.sensors:
        if name not in known and not (name == "torque" and "power_mech" in log.channels):
            message = f"the log has no {name} channel"
            log.findings.append(Finding("missing_channel", message, "metrics that need it are null", name))


def _constant(x: Signal) -> bool:
    """Whether a channel is one value throughout; most show within a few samples that they are not."""
    return all(np.ptp(part[np.isfinite(part)]) == 0 for part in (x[:_FEW], x) if np.isfinite(part).any())


def _derive_velocity(log: _Log) -> None:
    """Derive the velocity that the log lacks from its displacement, whose holes are then those of the velocity too."""
    log.channels["velocity"] = _slope(log.t, log.channels["displacement"])
    log.lost["velocity"] = log.lost["displacement"].copy()
    _report_derived(log, f"derived from the displacement: its slope, smoothed over {SLOPE_WIDTH:g} s")


def _velocity_from_speed(log: _Log, r_drum: float) -> None:
    """Derive the velocity of a log without motion of the line from the speed of rotation and the drum's radius [m]."""
    log.channels["velocity"] = log.channels["speed"] * r_drum
    log.lost["velocity"] = log.lost["speed"].copy()
    _report_derived(log, f"derived from the speed of rotation with the drum radius of {r_drum:g} m")


def _report_derived(log: _Log, action: str) -> None:
    """Report a velocity that was made from another channel, in place of one that is missing."""
    missing = [f for f in log.findings if f.kind == "missing_channel" and f.channel == "velocity"]
    log.findings[:] = [f for f in log.findings if f not in missing]
    message = missing[0].message if missing else "the log has no usable velocity"
    log.findings.append(Finding("derived_channel", message, action, "velocity"))


def _give_direction(log: _Log) -> None:
    """Give a speed that has no sign the direction of the displacement."""
    v, displacement, thresholds = log.channels["velocity"], log.channels["displacement"], log.rig.thresholds
    if without_sign(log.t, v, displacement, thresholds.v_onset, thresholds.stroke_min):
        log.channels["velocity"] = np.where(_slope(log.t, displacement) < 0, -np.abs(v), np.abs(v))
        message = "velocity has one sign whichever way the displacement goes: it is a speed without direction"
        log.findings.append(Finding("sign_flipped", message, "given the direction of the displacement", "velocity"))


def _slope(t: Signal, displacement: Signal) -> Signal:
    """Velocity from the displacement, smoothed so that the steps of the encoder do not show. [m/s]"""
    return np.gradient(local_quadratic(t, _whole(t, displacement), SLOPE_WIDTH), t)


def _whole(t: Signal, x: Signal) -> Signal:
    """The channel with straight lines over its holes; the channel itself if it has none."""
    good = np.isfinite(x)
    return x if good.all() else np.interp(t, t[good], x[good])


def _take_out_spikes(log: _Log, *, open_circuit: bool) -> dict[str, Bends]:
    """Take dropouts, single spikes and short glitches out of the channels; where these bend sharply."""
    longest = int(LONGEST * (log.t.size - 1) / float(log.t[-1] - log.t[0]) + 1e-6)
    sharp = _take_out_dropouts(log, open_circuit=open_circuit)
    pulses: dict[str, Pulses] = {}
    findings: dict[str, list[Finding]] = {}
    for name in log.channels:
        spikes = single_spikes(sharp[name])
        pulses[name] = find_pulses(sharp[name], spikes, longest, farthest(log.rig.sensors.get(name)))
        what = "single samples deviate far from their neighbours"
        findings[name] = log.take_out_spikes(name, sharp[name].logged(spikes), what)
    for name, glitches in find_glitches(log.t, log.channels, pulses).items():
        x = log.channels[name]
        samples = np.concatenate([np.arange(g.start, g.stop)[np.isfinite(x[g])] for g in glitches])
        what = f"samples jump away from their neighbours and back, in {_places(len(glitches))}"
        findings[name] += log.take_out_spikes(name, samples, what)
    log.findings += [finding for found in findings.values() for finding in found]
    return sharp


def _take_out_dropouts(log: _Log, *, open_circuit: bool) -> dict[str, Bends]:
    """Take out the stretches in which a channel holds a value that it cannot have; where the channels then bend sharply."""
    bends = {name: find_bends(x) for name, x in log.channels.items()}
    stages = _stages(log)
    taken: dict[str, tuple[Signal, list[Dropout], list[Index]]] = {}
    for _ in range(ROUNDS):
        dropouts = find_dropouts(log.t, log.channels, bends, stages, open_circuit=open_circuit)
        for name, found in dropouts.items():
            x = log.channels[name]
            _, stretches, parts = taken.setdefault(name, (x.copy(), [], []))
            for d in found:
                samples = np.arange(d.before + 1, d.after)
                parts.append(samples[(x[samples] == d.value) | (not d.even)])
            stretches += found
            x[np.concatenate(parts)] = np.nan
            bends[name] = find_bends(x)
        if not dropouts:
            break
    for name, (whole, stretches, parts) in taken.items():
        log.channels[name][:] = whole
        values = _values(log.rig.known_channels[name], stretches)
        what = f"samples jump to {values} while other channels continue, in {_places(len(parts))}"
        log.findings += log.take_out_spikes(name, np.concatenate(parts), what)
    return bends


def _stages(log: _Log) -> list[tuple[str, ...]]:
    """Channels whose product is the power of each stage that the log has."""
    powers = (stage.power(log.channels, log.rig.r_drum) for stage in log.rig.cascade.stages)
    return [power.channels for power in powers if power is not None]


def _values(channel: Channel, stretches: Sequence[Dropout]) -> str:
    """The values that a channel dropped to, the most frequent ones, for a sentence."""
    texts = [text_of(channel, d.value, 6) if d.even else f"about {text_of(channel, d.value, 2)}" for d in stretches]
    by_count = sorted({*texts}, key=lambda text: (-texts.count(text), text))
    return f"{' or '.join(by_count[:2])} {channel.unit}" + (" or other constants" if len(by_count) > 2 else "")


def _places(count: int) -> str:
    return f"{count} place{'s' if count > 1 else ''}"


def _motion(log: _Log) -> ObservedMotion | None:
    """Motion of the line, or of the shaft of a bench without one; None where the log has neither."""
    channels, rig = log.channels, log.rig
    if "velocity" in channels:
        return motion(log.t, _whole(log.t, channels["velocity"]), rig.thresholds.v_onset)
    if "speed" in channels:
        return motion(log.t, _whole(log.t, channels["speed"]), rig.phases.omega_onset)
    return None


def _take_out_interpolated(log: _Log, bends: Mapping[str, Bends]) -> None:
    """Take out the samples with which gaps were filled in before."""
    line = _motion(log)
    moving = np.ones(log.t.size, dtype=bool) if line is None else line.out | line.back
    filled = find_interpolated(log.t, {name: bends[name] for name in bends if name in log.channels}, moving)
    if not filled:
        return
    whole = np.zeros(log.t.size, dtype=bool)
    for name, samples in filled.items():
        bad = np.zeros(log.t.size, dtype=bool)
        bad[samples] = True
        whole |= bad
        log.lose(name, bad)
    places = _places(len(stretches_of(whole)))
    what = f"run between their neighbours without noise, in {places}, as if a gap had been filled in"
    *others, last = filled
    found = at(log.t, whole, "dropped_samples", last, f"samples {what}", removed=True)
    if others:
        alike = all(np.array_equal(samples, filled[last]) for samples in filled.values())
        said = f"{found.count} samples of {', '.join(others)} {'and' if alike else 'or'} {last} {what}"
        found = msgspec.structs.replace(found, message=said, channel=None)
    log.findings.append(found)


def _take_out_stuck(log: _Log, open_circuit: bool) -> None:
    """Take out the samples that only repeat a stuck value; a value beyond the sensor's range is kept."""
    t, channels, sensors = log.t, log.channels, log.rig.sensors
    line = motion(t, _whole(t, channels["velocity"]), log.rig.thresholds.v_onset)
    names = [name for name in channels if name in FOLLOW_LINE and not (open_circuit and name == "idc")]
    for name in ("velocity", *names):
        x = channels[name]
        low, high = limits_of(sensors.get(name))
        stretches = [(a, b) for a, b in find_stuck(name, x, line, channels) if low <= x[a] <= high]
        if not stretches:
            continue
        bad = _repeats(stretches, x.size)
        if bad.sum() >= t.size - 2 and name != "velocity":
            log.leave_out(name, "channel left out, metrics that need it are null")
            continue
        log.findings.append(log.take_out(name, bad, "stuck", _stuck_words(stretches)))
        if name == "velocity":
            line = motion(t, log.bridged(name, bad), log.rig.thresholds.v_onset)


def _take_out_still(log: _Log) -> None:
    """Take out what repeats a stuck value in a log without a line; report a channel that holds one value throughout."""
    used = [name for name in log.rig.cascade.channels if name in log.channels]
    constant = {name: _constant(log.channels[name]) for name in used}
    shaft = _motion(log) or motion(log.t, np.zeros(log.t.size), 1.0)
    powers = powers_of(log.channels, _stages(log))
    for name in used:
        x, channel = log.channels[name], log.rig.known_channels[name]
        low, high = limits_of(log.rig.sensors.get(name))
        loaded = others_deliver(name, powers, log.t.size)
        stretches = [(a, b) for a, b in find_still(x, shaft, loaded) if low <= x[a] <= high]
        if stretches:
            bad = _repeats(stretches, x.size)
            log.findings.append(log.take_out(name, bad, "stuck", _stuck_words(stretches)))
        elif constant[name] and np.nanmax(np.abs(x)) > 0.0 and not all(constant.values()):
            value = f"{text_of(channel, float(np.nanmax(x)))} {channel.unit}"
            what = f"{name} holds one value, {value}, through the whole log while other channels change"
            ends = float(log.t[0]), float(log.t[-1])
            log.findings.append(Finding("stuck", what, "reported and kept", name, *ends, x.size))


def _dead(log: _Log, *, open_circuit: bool) -> list[Finding]:
    """Report channels that are zero throughout although their stages work; in open circuit no current flows."""
    moving, powers = _motion(log), powers_of(log.channels, _stages(log))
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
