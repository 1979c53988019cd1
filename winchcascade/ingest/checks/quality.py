"""The faults of the channels of a log: each becomes a finding; what is lost is bridged, what is odd is kept and told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.quantity import find_unit
from winchcascade.core.run import CHANNELS, Finding
from winchcascade.core.smooth import local_quadratic
from winchcascade.ingest.checks.agreement import disagreements, power_disagrees, without_sign
from winchcascade.ingest.checks.dropouts import ROUNDS, Dropout, find_dropouts, find_filled
from winchcascade.ingest.checks.glitches import LONGEST, Pulses, find_glitches, find_pulses
from winchcascade.ingest.checks.sensor_range import SATURATES, farthest, limits_of, out_of_range, saturated
from winchcascade.ingest.checks.signs import upright
from winchcascade.ingest.checks.spikes import Bends, find_bends, single_spikes
from winchcascade.ingest.checks.stuck import Motion, find_stuck, motion
from winchcascade.ingest.checks.timing import coarse_finding, factor_finding, put_back
from winchcascade.ingest.checks.told import at, dead

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal

    Index = NDArray[np.intp]
    Mask = NDArray[np.bool_]


_FEW = 1000
"""Samples that show whether a channel changes at all, before the whole of it is looked at."""


class Checked(msgspec.Struct, frozen=True):
    """Stamps, channels without holes, the gaps that were bridged in each, (k, 2) stamps [s], and what was found.

    `t` differs from the log's stamps where rows were lost while the clock was renumbered; `clock` holds the gaps there.
    """

    t: Signal
    channels: dict[str, Signal]
    gaps: dict[str, Signal]
    findings: tuple[Finding, ...]
    clock: Signal


def check(t: Signal, channels: dict[str, Signal], rig: Rig, *, simulated: bool, open_circuit: bool) -> Checked:
    """Check every channel of a log and bridge what is lost.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    channels : (n,) each, SI units, NaN where a cell was not a number; the arrays are used up
    simulated : a simulated log has no sensors that could be stuck or out of range
    open_circuit : without a load no current flows, however long
    """
    findings: list[Finding] = []
    lost: dict[str, Mask] = {}
    for name in list(channels):
        _take_out_holes(t, name, channels, lost, findings)
        _take_out_filled(t, name, channels, lost, findings)
    findings += _missing(channels, rig, {f.channel for f in findings if f.kind == "missing_channel"})
    wild = _take_out_spikes(t, channels, rig, lost, findings, open_circuit=open_circuit)
    if not simulated:
        _drop_dead_velocity(t, channels, lost, findings)
    if "velocity" not in channels and "displacement" not in channels:
        return Checked(t, {}, {}, tuple(findings), np.empty((0, 2)))
    t, renumbered = (t, np.empty((0, 2))) if simulated else _check_clock(t, channels, rig, findings)
    both = not simulated and "velocity" in channels and "displacement" in channels
    _derive_velocity(t, channels, lost, findings)
    if both:
        findings += _give_direction(t, channels, rig)
    turned = upright(channels)
    findings += turned
    if not simulated:
        signs = {f.channel: -1.0 for f in turned}
        for name, x in channels.items():
            if name in rig.sensors:
                findings += out_of_range(t, name, x, wild.get(name), signs.get(name, 1.0), rig.sensors[name])
            if name in SATURATES:
                findings += saturated(t, name, x)
        _take_out_stuck(t, channels, rig, lost, findings, open_circuit)
    if both and "displacement" in channels:
        differ = disagreements(t, channels["velocity"], channels["displacement"], rig.thresholds.v_onset)
        findings += [f for f in differ if not any(g.kind == "clock_mismatch" and g.start is None for g in findings)]
    if not simulated:
        findings += power_disagrees(channels, rig.r_drum)
    gaps = {name: _bridge(t, name, channels, bad) for name, bad in lost.items() if name in channels}
    if "force" in channels and channels["force"].min() < 0:
        findings.append(at(t, channels["force"] < 0, "slack_line", "force", "samples have a line force below zero"))
    return Checked(t, channels, gaps, tuple(findings), renumbered)


def _check_clock(t: Signal, channels: dict[str, Signal], rig: Rig, findings: list[Finding]) -> tuple[Signal, Signal]:
    """Hold the clock against velocity and displacement; stamps with the time of lost rows put back, and the gaps there."""
    v, displacement = channels.get("velocity"), channels.get("displacement")
    if v is None or displacement is None:
        whole = coarse_finding(t, rig.thresholds)
    else:
        whole = factor_finding(t, v, displacement, rig.thresholds.v_onset)
    if whole is not None:
        findings.append(whole)
        return t, np.empty((0, 2))
    timed = None if displacement is None else put_back(t, channels, rig.thresholds)
    if timed is None:
        return t, np.empty((0, 2))
    findings[:] = [_shifted(f, t, timed.t) for f in findings]
    findings += timed.findings
    return timed.t, timed.gaps


def _shifted(finding: Finding, old: Signal, new: Signal) -> Finding:
    """A finding on stamps that were moved."""
    if finding.start is None or finding.end is None:
        return finding
    start, end = np.interp([finding.start, finding.end], old, new).tolist()
    return msgspec.structs.replace(finding, start=start, end=end)


def _take_out_holes(
    t: Signal, name: str, channels: dict[str, Signal], lost: dict[str, Mask], findings: list[Finding]
) -> None:
    """Report cells that are empty or not a number; a channel that holds nothing else is missing."""
    x = channels[name]
    if np.isfinite(x.sum()):
        return
    bad = ~np.isfinite(x)
    if bad.all():
        del channels[name]
        findings.append(Finding("missing_channel", f"the column for {name} holds no number", "left out", name))
    elif bad.any():
        x[bad] = np.nan
        lost[name] = bad
        findings.append(at(t, bad, "not_a_number", name, "cells are empty or not a number", removed=True))


def _take_out_filled(
    t: Signal, name: str, channels: dict[str, Signal], lost: dict[str, Mask], findings: list[Finding]
) -> None:
    """Take out the zeros that a logger writes where a slow channel has no new value."""
    filled = find_filled(channels[name]) if name in channels else None
    if filled is None:
        return
    channels[name][filled] = np.nan
    lost[name] = lost[name] | filled if name in lost else filled
    what = "rows hold 0 between the updates of a slower channel"
    findings.append(at(t, filled, "dropped_samples", name, what, removed=True))


def _missing(channels: dict[str, Signal], rig: Rig, told: set[str | None]) -> list[Finding]:
    """Channels that the rig's sensors promise and the log does not have; mechanical power stands in for torque."""
    absent = [name for name in rig.sensors if name not in channels and name not in told]
    if "power_mech" in channels and "torque" in absent:
        absent.remove("torque")
    return [
        Finding("missing_channel", f"the log has no {name} channel", "metrics that need it are null", name)
        for name in absent
    ]


def _drop_dead_velocity(t: Signal, channels: dict[str, Signal], lost: dict[str, Mask], findings: list[Finding]) -> None:
    """Leave out a velocity that is one value through the whole log while the displacement moves."""
    v, displacement = channels.get("velocity"), channels.get("displacement")
    if v is None or displacement is None or not _constant(v) or _constant(displacement):
        return
    del channels["velocity"]
    lost.pop("velocity", None)
    findings.append(dead(t, "velocity", "derived from the displacement"))


def _constant(x: Signal) -> bool:
    """Whether a channel is one value throughout; most show within a few samples that they are not."""
    return all(np.ptp(part[np.isfinite(part)]) == 0 for part in (x[:_FEW], x) if np.isfinite(part).any())


def _derive_velocity(t: Signal, channels: dict[str, Signal], lost: dict[str, Mask], findings: list[Finding]) -> None:
    """Make the velocity that the log lacks from its displacement, whose holes are then the velocity's too."""
    if "velocity" in channels:
        return
    channels["velocity"] = _slope(t, channels["displacement"])
    if "displacement" in lost:
        lost["velocity"] = lost["displacement"].copy()
    findings[:] = [
        Finding(f.kind, f.message, "derived from the displacement", f.channel)
        if f.kind == "missing_channel" and f.channel == "velocity"
        else f
        for f in findings
    ]


def _give_direction(t: Signal, channels: dict[str, Signal], rig: Rig) -> list[Finding]:
    """Give a speed that has no sign the direction of the displacement."""
    v, displacement = channels["velocity"], channels["displacement"]
    if not without_sign(t, v, displacement, rig.thresholds.v_onset, rig.thresholds.stroke_min):
        return []
    channels["velocity"] = np.where(_slope(t, displacement) < 0, -np.abs(v), np.abs(v))
    message = "velocity has one sign whichever way the displacement goes: it is a speed without direction"
    return [Finding("sign_flipped", message, "given the direction of the displacement", "velocity")]


def _slope(t: Signal, displacement: Signal) -> Signal:
    """Velocity from the displacement, smoothed over 0.4 s so that the encoder's steps do not show. [m/s]"""
    good = np.isfinite(displacement)
    whole = np.interp(t, t[good], displacement[good])
    slope: Signal = np.gradient(local_quadratic(t, whole, 0.4), t)
    return slope


def _take_out_spikes(
    t: Signal,
    channels: dict[str, Signal],
    rig: Rig,
    lost: dict[str, Mask],
    findings: list[Finding],
    *,
    open_circuit: bool,
) -> dict[str, tuple[Index, Signal]]:
    """Take dropouts, single spikes and short glitches out of the channels; which they were, and what was logged there."""
    longest = int(LONGEST * (t.size - 1) / float(t[-1] - t[0]) + 1e-6)
    sharp, wild = _take_out_dropouts(t, channels, lost, findings, open_circuit=open_circuit)
    singles: dict[str, Index] = {}
    pulses: dict[str, Pulses] = {}
    logged: dict[str, Signal] = {}
    for name, x in channels.items():
        bends = sharp[name]
        spikes = single_spikes(bends)
        pulses[name] = find_pulses(bends, spikes, longest, farthest(rig.sensors.get(name)))
        singles[name] = bends.logged(spikes)
        logged[name] = x[singles[name]]
        x[singles[name]] = np.nan
    glitches = find_glitches(t, channels, pulses)
    for name, x in channels.items():
        spikes, values = singles[name], logged[name]
        if spikes.size:
            what = "single samples stand far off their neighbours"
            findings.append(_taken_out(t, name, spikes, what, lost))
        if name in glitches:
            stretches = [np.arange(g.start, g.stop)[np.isfinite(x[g])] for g in glitches[name]]
            samples = np.concatenate(stretches)
            spikes, values = np.concatenate((spikes, samples)), np.concatenate((values, x[samples]))
            x[samples] = np.nan
            what = f"samples jump away from their neighbours and back, in {_places(len(stretches))}"
            findings.append(_taken_out(t, name, samples, what, lost))
        if name in wild:
            spikes, values = np.concatenate((wild[name][0], spikes)), np.concatenate((wild[name][1], values))
        if spikes.size:
            wild[name] = spikes, values
    return wild


def _take_out_dropouts(
    t: Signal, channels: dict[str, Signal], lost: dict[str, Mask], findings: list[Finding], *, open_circuit: bool
) -> tuple[dict[str, Bends], dict[str, tuple[Index, Signal]]]:
    """Take out the stretches in which a channel holds a value that it cannot have.

    Returns
    -------
    where the channels then bend sharply, and the samples that were taken out with what was logged there
    """
    bends = {name: find_bends(x) for name, x in channels.items()}
    values: dict[str, list[Dropout]] = {}
    taken: dict[str, list[Index]] = {}
    logged: dict[str, list[Signal]] = {}
    for _ in range(ROUNDS):
        dropouts = find_dropouts(t, channels, bends, open_circuit=open_circuit)
        if not dropouts:
            break
        for name, stretches in dropouts.items():
            for d in stretches:
                samples = np.arange(d.before + 1, d.after)
                samples = samples[(channels[name][samples] == d.value) | (not d.even)]
                taken.setdefault(name, []).append(samples)
                logged.setdefault(name, []).append(channels[name][samples])
                values.setdefault(name, []).append(d)
            channels[name][np.concatenate(taken[name])] = np.nan
            bends[name] = find_bends(channels[name])
    wild = {}
    for name, parts in taken.items():
        wild[name] = np.concatenate(parts), np.concatenate(logged[name])
        what = f"samples jump to {_values(name, values[name])} while other channels go on, in {_places(len(parts))}"
        findings.append(_taken_out(t, name, wild[name][0], what, lost))
    return bends, wild


def _values(name: str, stretches: Sequence[Dropout]) -> str:
    """The values that a channel dropped to, the most frequent ones, for a sentence."""
    unit = CHANNELS[name].unit
    known = find_unit(unit)
    factor = known.factor if known is not None else 1.0
    texts = [f"{'' if d.even else 'about '}{d.value / factor:.{6 if d.even else 2}g}" for d in stretches]
    most = sorted({*texts}, key=lambda text: (-texts.count(text), text))
    return f"{' or '.join(most[:2])} {unit}" + (" or other constants" if len(most) > 2 else "")


def _places(count: int) -> str:
    return f"{count} place{'s' if count > 1 else ''}"


def _taken_out(t: Signal, name: str, samples: Index, what: str, lost: dict[str, Mask]) -> Finding:
    """Mark samples of a channel as lost, and tell."""
    bad = np.zeros(t.size, dtype=bool)
    bad[samples] = True
    lost[name] = lost[name] | bad if name in lost else bad
    return at(t, bad, "spike", name, what, removed=True)


def _take_out_stuck(
    t: Signal,
    channels: dict[str, Signal],
    rig: Rig,
    lost: dict[str, Mask],
    findings: list[Finding],
    open_circuit: bool,
) -> None:
    line = motion(t, _whole(t, channels["velocity"]), rig.thresholds.v_onset)
    names = [name for name in channels if name != "velocity" and not (open_circuit and name == "idc")]
    for name in ("velocity", *names):
        bad, stretches = _stuck(name, rig, line, channels)
        if not stretches:
            continue
        if bad.sum() >= t.size - 2 and name != "velocity":
            del channels[name]
            findings.append(dead(t, name, "channel left out, metrics that need it are null"))
            continue
        channels[name][bad] = np.nan
        lost[name] = lost[name] | bad if name in lost else bad
        what = f"samples repeat one value where it should change, in {stretches} stretch{'es' if stretches > 1 else ''}"
        findings.append(at(t, bad, "stuck", name, what, removed=True))
        if name == "velocity":
            line = motion(t, _bridged(t, name, channels, bad), rig.thresholds.v_onset)


def _stuck(name: str, rig: Rig, line: Motion, channels: dict[str, Signal]) -> tuple[Mask, int]:
    """Samples that only repeat a stuck value, and in how many stretches; a value beyond the sensor's range is kept."""
    x = channels[name]
    low, high = limits_of(rig.sensors[name]) if name in rig.sensors else (-np.inf, np.inf)
    stretches = [(a, b) for a, b in find_stuck(name, x, line, channels) if low <= x[a] <= high]
    bad = np.zeros(x.size, dtype=bool)
    for a, b in stretches:
        bad[a + 1 : b] = True  # the first sample of a held value is still a measurement
    return bad, len(stretches)


def _whole(t: Signal, x: Signal) -> Signal:
    """The channel with straight lines over its holes; the channel itself if it has none."""
    good = np.isfinite(x)
    return x if good.all() else np.interp(t, t[good], x[good])


def _bridged(t: Signal, name: str, channels: dict[str, Signal], bad: Mask) -> Signal:
    """A channel whose holes are bridged by straight lines, the velocity's by the displacement."""
    x = _whole(t, channels[name])
    if name == "velocity" and "displacement" in channels and np.isfinite(channels["displacement"]).any():
        x = np.where(bad, _slope(t, channels["displacement"]), x)
    return x


def _bridge(t: Signal, name: str, channels: dict[str, Signal], bad: Mask) -> Signal:
    """Bridge a channel's holes; (k, 2) gaps [s], from the last good sample to the next."""
    channels[name] = _bridged(t, name, channels, bad)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], bad, [False])).astype(np.int8)))
    before, after = np.maximum(edges[::2] - 1, 0), np.minimum(edges[1::2], t.size - 1)
    return np.column_stack((t[before], t[after]))
