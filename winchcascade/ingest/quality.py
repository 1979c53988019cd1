"""The faults of the channels of a log: each becomes a finding; what is lost is bridged, what is odd is kept and told."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.channels import CHANNELS
from winchcascade.ingest.signs import upright
from winchcascade.ingest.spikes import find_spikes
from winchcascade.ingest.stuck import find_stuck, motion
from winchcascade.quantity import find_unit
from winchcascade.run import Finding
from winchcascade.smooth import local_quadratic

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.rigfile import Rig, Sensor
    from winchcascade.run import FindingKind, Signal

    Mask = NDArray[np.bool_]


class Checked(msgspec.Struct, frozen=True):
    """Channels without holes, the gaps that were bridged in each, (k, 2) stamps [s], and what was found."""

    channels: dict[str, Signal]
    gaps: dict[str, Signal]
    findings: tuple[Finding, ...]


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
    for name, x in list(channels.items()):
        if np.isfinite(x.sum()):
            continue
        bad = ~np.isfinite(x)
        if bad.all():
            del channels[name]
            findings.append(Finding("missing_channel", f"the column for {name} holds no number", "left out", name))
        elif bad.any():
            x[bad] = np.nan
            lost[name] = bad
            findings.append(_at(t, bad, "not_a_number", name, "cells are empty or not a number", removed=True))
    findings += _missing(channels, rig)
    if "velocity" not in channels and "displacement" not in channels:
        return Checked({}, {}, tuple(findings))
    _derive_velocity(t, channels, findings)
    findings += upright(channels)
    for name, x in channels.items():
        findings += _odd_values(t, name, x, rig, simulated)
        _take_out_spikes(t, name, x, lost, findings)
    if not simulated:
        _take_out_stuck(t, channels, rig, lost, findings, open_circuit)
    gaps = {name: _bridge(t, name, channels, bad) for name, bad in lost.items() if name in channels}
    if "force" in channels and channels["force"].min() < 0:
        findings.append(_at(t, channels["force"] < 0, "slack_line", "force", "samples have a line force below zero"))
    return Checked(channels, gaps, tuple(findings))


def _missing(channels: dict[str, Signal], rig: Rig) -> list[Finding]:
    """Channels that the rig's sensors promise and the log does not have; mechanical power stands in for torque."""
    absent = [name for name in rig.sensors if name not in channels]
    if "power_mech" in channels and "torque" in absent:
        absent.remove("torque")
    return [
        Finding("missing_channel", f"the log has no {name} channel", "metrics that need it are null", name)
        for name in absent
    ]


def _derive_velocity(t: Signal, channels: dict[str, Signal], findings: list[Finding]) -> None:
    if "velocity" in channels:
        return
    channels["velocity"] = _slope(t, channels["displacement"])
    findings[:] = [
        Finding(f.kind, f.message, "derived from the displacement", f.channel)
        if f.kind == "missing_channel" and f.channel == "velocity"
        else f
        for f in findings
    ]


def _slope(t: Signal, displacement: Signal) -> Signal:
    """Velocity from the displacement, smoothed over 0.4 s so that the encoder's steps do not show. [m/s]"""
    good = np.isfinite(displacement)
    whole = np.interp(t, t[good], displacement[good])
    slope: Signal = np.gradient(local_quadratic(t, whole, 0.4), t)
    return slope


def _at(t: Signal, bad: Mask, kind: FindingKind, channel: str, what: str, *, removed: bool = False) -> Finding:
    """A finding about the samples of one channel where `bad` is set."""
    index = np.flatnonzero(bad)
    return Finding(
        kind,
        f"{index.size} {channel} {what}",
        "bridged by straight lines" if removed else "reported and kept",
        channel,
        float(t[index[0]]),
        float(t[index[-1]]),
        int(index.size),
        int(index.size) if removed else 0,
    )


def _odd_values(t: Signal, name: str, x: Signal, rig: Rig, simulated: bool) -> list[Finding]:
    """Values outside the sensor's range are reported and kept: clipping or dropping them would hide what happened."""
    sensor = rig.sensors.get(name)
    if sensor is None or simulated:
        return []
    low, high = _range(sensor)
    top, bottom = float(np.nanmax(x)), float(np.nanmin(x))
    if bottom >= low and top <= high:
        return []
    limit, worst = (high, top) if top > high else (low, bottom)
    unit = CHANNELS[name].unit
    known = find_unit(unit)
    factor = known.factor if known is not None else 1.0
    what = f"samples lie outside the sensor's range, up to {worst / factor:.5g} {unit} where it ends at {limit / factor:.5g}"
    return [_at(t, (x < low) | (x > high), "out_of_range", name, what)]


def _range(sensor: Sensor) -> tuple[float, float]:
    """Limits of a sensor; its zero error may carry a reading below an end at zero."""
    high = float("inf") if sensor.high is None else sensor.high
    if sensor.low is None:
        return float("-inf"), high
    zero = (sensor.accuracy_full_scale or 0.0) * high if sensor.low == 0 and np.isfinite(high) else 0.0
    return sensor.low - zero, high


def _take_out_spikes(t: Signal, name: str, x: Signal, lost: dict[str, Mask], findings: list[Finding]) -> None:
    spikes = find_spikes(x)
    if spikes.size == 0:
        return
    bad = np.zeros(x.size, dtype=bool)
    bad[spikes] = True
    x[spikes] = np.nan
    lost[name] = lost[name] | bad if name in lost else bad
    findings.append(_at(t, bad, "spike", name, "single samples stand far off their neighbours", removed=True))


def _take_out_stuck(
    t: Signal,
    channels: dict[str, Signal],
    rig: Rig,
    lost: dict[str, Mask],
    findings: list[Finding],
    open_circuit: bool,
) -> None:
    line = motion(t, _whole(t, channels["velocity"]), rig.thresholds.v_onset)
    stuck = {
        name: find_stuck(name, x, line, channels)
        for name, x in channels.items()
        if not (open_circuit and name == "idc")
    }
    for name, stretches in stuck.items():
        if not stretches:
            continue
        bad = np.zeros(t.size, dtype=bool)
        for a, b in stretches:
            bad[a + 1 : b] = True  # the first sample of a held value is still a measurement
        if bad.sum() >= t.size - 2:
            del channels[name]
            findings.append(_dead(t, name))
            continue
        channels[name][bad] = np.nan
        lost[name] = lost[name] | bad if name in lost else bad
        what = f"samples repeat one value while the line moves, in {len(stretches)} stretch"
        findings.append(_at(t, bad, "stuck", name, what + ("es" if len(stretches) > 1 else ""), removed=True))


def _dead(t: Signal, name: str) -> Finding:
    return Finding(
        "stuck",
        f"{name} holds one value through the whole log while the line moves",
        "channel left out, metrics that need it are null",
        name,
        float(t[0]),
        float(t[-1]),
        t.size,
        t.size,
    )


def _whole(t: Signal, x: Signal) -> Signal:
    """The channel with straight lines over its holes; the channel itself if it has none."""
    good = np.isfinite(x)
    return x if good.all() else np.interp(t, t[good], x[good])


def _bridge(t: Signal, name: str, channels: dict[str, Signal], bad: Mask) -> Signal:
    """Bridge a channel's holes in place, the velocity by the displacement where that goes on; (k, 2) gaps [s]."""
    x = channels[name]
    good = ~bad
    if name == "velocity" and "displacement" in channels and np.isfinite(channels["displacement"]).any():
        x[bad] = _slope(t, channels["displacement"])[bad]
    else:
        x[bad] = np.interp(t[bad], t[good], x[good])
    edges = np.flatnonzero(np.diff(np.concatenate(([False], bad, [False])).astype(np.int8)))
    before, after = np.maximum(edges[::2] - 1, 0), np.minimum(edges[1::2], t.size - 1)
    return np.column_stack((t[before], t[after]))
