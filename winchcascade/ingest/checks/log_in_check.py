"""A log while it is checked: its channels, which of their samples are lost, and what was found."""

from __future__ import annotations

import msgspec
import numpy as np

from winchcascade.core.integrate import stretches_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, FindingKind, Index, Mask, Repair, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.ingest.checks.channel_findings import at

SLOPE_WIDTH = 0.4
"""Width of the local quadratic of a displacement whose slope is a velocity. [s]"""


class LogInCheck(msgspec.Struct):
    """A log while it is checked: channels, NaN where samples are lost, which samples these are, and what was found.

    `spikes` holds the samples that were taken out as spikes with what was logged there.
    """

    t: Signal
    channels: dict[str, Signal]
    rig: Rig
    lost: dict[str, Mask]
    spikes: dict[str, tuple[Index, Signal]] = msgspec.field(default_factory=dict)
    findings: list[Finding] = msgspec.field(default_factory=list)

    @classmethod
    def of(cls, t: Signal, channels: dict[str, Signal], rig: Rig) -> LogInCheck:
        """A log of which nothing is known yet."""
        return cls(t, channels, rig, {name: np.zeros(t.size, dtype=bool) for name in channels})

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
        repair = Repair(action, n, ((start, end),))
        kind: FindingKind = "dead_channel" if dead else "stuck"
        self.findings.append(Finding(kind, what, action, name, start, end, n, n, repair=repair))

    def bridged(self, name: str, bad: Mask) -> Signal:
        """A channel whose holes are bridged by straight lines, those of the velocity by the displacement."""
        x = whole(self.t, self.channels[name])
        if name == "velocity" and "displacement" in self.channels and np.isfinite(self.channels["displacement"]).any():
            x = np.where(bad, slope(self.t, self.channels["displacement"]), x)
        return x

    def bridge(self) -> dict[str, Signal]:
        """Bridge the holes of all channels; the last good and the first good stamp around each hole, (k, 2) by channel. [s]"""
        gaps = {}
        for name, bad in self.lost.items():
            if name in self.channels and bad.any():
                self.channels[name] = self.bridged(name, bad)
                first, after = stretches_of(bad).T
                gaps[name] = self.t[np.column_stack((np.maximum(first - 1, 0), np.minimum(after, self.t.size - 1)))]
        return gaps


def slope(t: Signal, displacement: Signal) -> Signal:
    """Velocity from the displacement, smoothed so that the steps of the encoder do not show. [m/s]"""
    return np.gradient(local_quadratic(t, whole(t, displacement), SLOPE_WIDTH), t)


def whole(t: Signal, x: Signal) -> Signal:
    """The channel with straight lines over its holes; the channel itself if it has none."""
    good = np.isfinite(x)
    return x if good.all() else np.interp(t, t[good], x[good])


def in_places(count: int) -> str:
    """Number of places, for a sentence."""
    return f"{count} place{'s' if count > 1 else ''}"


def stages_of(log: LogInCheck) -> list[tuple[str, ...]]:
    """Channels of the products that the powers of the stages are made of, of those that the log has."""
    powers = (stage.power(log.channels, log.rig.r_drum) for stage in log.rig.cascade.stages)
    return [term.channels for power in powers if power is not None for term in power.terms if term.channels]
