"""Powers between two stages of a cascade in one log, and the signals that laws are made of.

Between two stages the energy is conserved: what comes out is what goes in, less losses and less
what stores take up. Each of these is a number times a signal, so that power out minus power in is
linear in the numbers. A sensor that reads (1 + g) x + o gives x = (1 - h) x_read - o', with h = g /
(1 + g) and o' = o / (1 + g), which is linear in h and o'. A store takes up d(x^2 / 2)/dt, whose
mean over a block is a difference between its ends: no slope has to be smoothed.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import Part
from winchcascade.core.errors import LogError
from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.rig.physics import REST

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from winchcascade.core.cascade import Power, Stage
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.rig.effects.effect import StageLaw


SIGNALS = {"rotation": "speed"} | {
    name: name for name in ("velocity", "force", "torque", "voltage", "current", "flow", "pressure")
}
"""Signals that laws are made of, by the dimension of the channels that they follow from."""


AXES = (("velocity", "force"), ("flow", "pressure"), ("speed", "torque"), ("voltage", "current"))
"""Pairs of signals that a stage is mapped over: the first that it has."""


def axes_of(signals: Collection[str]) -> tuple[str, str]:
    """Motion and load that a stage is mapped over; empty where it has no pair.

    >>> axes_of(("speed", "torque", "voltage", "current"))
    ('speed', 'torque')
    """
    return next((pair for pair in AXES if {*pair} <= {*signals}), ("", ""))


MEASURING = ("force", "torque", "voltage", "current", "flow", "pressure")
"""Dimensions of the channels whose sensors are suspected: encoders and logged powers are not."""


PARTS: tuple[Part, ...] = ("gain", "zero")
"""Errors of a sensor."""


class StagePath(msgspec.Struct, frozen=True):
    """Two stages that a power flows between, the powers of both being logged.

    `at` is the stage of a model whose output the power is, empty without a model.
    """

    into: Stage
    out: Stage
    at: str = ""

    @property
    def name(self) -> str:
        """Names of both stages."""
        return f"{self.into.name}-{self.out.name}"

    @property
    def place(self) -> str:
        """Stage of a cause: that of the catalogue with a model, and between line and shaft."""
        ends = self.into.name, self.out.name
        without = "transmission" if ends == ("line", "mech") else f"{ends[0]} to {ends[1]}"
        return self.at or without

    @property
    def channel(self) -> str:
        """Channel in which the gap shows."""
        return f"power_{self.out.name}"


class StageSignals(msgspec.Struct, frozen=True):
    """One path in one log: both powers (n,) [W], signals of the laws by name (n,) in SI units, and
    what one unit of h and of o' of a sensor adds to power out minus power in, by part and channel.

    With a model, `power_in` is the power that it makes come out.
    """

    t: Signal
    power_in: Signal
    power_out: Signal
    signals: dict[str, Signal]
    errors: dict[Part, dict[str, Signal]]

    def column(self, law: StageLaw, channel: str = "") -> Signal:
        """What one unit of the number of a law adds to power out minus power in, (n,). [W]"""
        if law.kind == "gain" or law.kind == "zero":
            return self.errors[law.kind].get(channel, np.zeros(self.t.size))
        if law.kind == "loss":
            sized = [_sized(self.signals[name], power) for name, power in law.over.items()]
            return np.asarray(-np.prod([np.ones(self.t.size), *sized], axis=0))
        if law.kind == "exchange":
            return np.asarray(
                -np.prod([self.signals[name] ** power for name, power in law.over.items()], axis=0)
            )
        x = next(self.signals[name] for name in law.over)
        absolute = np.maximum(x + ATMOSPHERE, 1.0)
        stored = 0.5 * x**2 if law.kind == "store" else np.log(absolute) + ATMOSPHERE / absolute
        return -np.gradient(stored, self.t)


def _sized(x: Signal, power: int) -> Signal:
    """A power of the magnitude of a signal; about zero an odd one is smooth, so that noise is not
    rectified.
    """
    if power % 2 == 0:
        return x**power
    return np.asarray(x**power * np.tanh(x / max(REST * float(np.max(np.abs(x))), 1e-300)))


# -------------------------------------------------------------------- what a log has of a cascade
def paths_of(runs: Sequence[Run], rig: Rig) -> tuple[StagePath, ...]:
    """Neighbouring stages of which all logs have both powers.

    Raises
    ------
    LogError : there are none
    """
    known = [
        s
        for s in rig.cascade.stages
        if all(s.power(run.channels, rig.r_drum) is not None for run in runs)
    ]
    if len(known) < 2:
        lacking = [stage for stage in rig.cascade.stages if stage not in known]
        places = (
            ", ".join(f"{stage.name} ({stage.where})" for stage in lacking)
            or "a second stage under [cascade]"
        )
        raise LogError(
            f"{runs[0].name}: laws of stages follow from the powers of two stages, and rig "
            f"{rig.name} with its logs gives {len(known)}; it lacks that of {places}. Log its "
            "channels, or name their columns under [columns] in the rig file."
        )
    return tuple(StagePath(into, out) for into, out in pairwise(known))


def stage_signals(run: Run, rig: Rig, path: StagePath) -> StageSignals:
    """Powers and signals of one path in one log."""
    channels, radius = run.channels, rig.r_drum
    signals: dict[str, Signal] = {}
    powers = [
        power
        for stage in (path.into, path.out)
        if (power := stage.power(channels, radius)) is not None
    ]
    power_in, power_out = (power.stream(channels, radius)(slice(None)) for power in powers)
    errors: dict[Part, dict[str, Signal]] = {part: {} for part in PARTS}
    incoming: Collection[str] = ()
    for power, sign in zip(powers, (1.0, -1.0), strict=True):
        found: dict[str, Signal] = {}
        for name in power.channels:
            dimension = rig.known_channels[name].dimension
            if dimension in MEASURING:
                both = zip(errors.values(), _by_channel(power, name, run, radius), strict=True)
                for of_part, watts in both:
                    of_part[name] = of_part.get(name, 0.0) - sign * watts
            if (signal := SIGNALS.get(dimension)) is not None:
                found[signal] = found.get(signal, 0.0) + channels[name]
        incoming = incoming or found.keys()
        signals = found | signals
    line, shaft = (
        any(end.name == name for end in (path.into, path.out)) for name in ("line", "mech")
    )
    if line:
        signals = {name: x for name, x in signals.items() if name not in ("speed", "torque")}
        signals |= {
            name: channels[name]
            for name in ("velocity", "displacement", "pressure")
            if name in channels
        }
    elif shaft:
        signals |= _of_shaft(run, rig, power_in if path.into.name == "mech" else power_out)
        signals.pop("velocity", None)
    shaft_goes_in = path.into.name == "mech" and not line
    at_out = axes_of(signals)[0] not in incoming and not shaft_goes_in
    signals["power"] = np.abs(power_out if at_out and "" not in axes_of(signals) else power_in)
    if not {path.into.name, path.out.name} <= {"line", "mech"}:
        signals["drive"] = signals["power"]
    return StageSignals(run.t, power_in, power_out, signals, errors)


def _of_shaft(run: Run, rig: Rig, power: Signal) -> dict[str, Signal]:
    """Speed and torque of the shaft, the torque with the sign of the power; what is not logged
    follows from power and speed.
    """
    speed = run.channels.get("speed")
    if speed is None:
        if "velocity" not in run.channels or rig.r_drum is None:
            return {}
        speed = run.channels["velocity"] / rig.r_drum
    turns = np.abs(speed) > REST * float(np.max(np.abs(speed)))
    return {"speed": speed, "torque": np.where(turns, power / np.where(turns, speed, 1.0), 0.0)}


def _by_channel(power: Power, name: str, run: Run, radius: float | None) -> tuple[Signal, Signal]:
    """The terms of a power that have a channel, and their derivative over it, (n,) each."""
    gain, slope = np.zeros(run.t.size), np.zeros(run.t.size)
    for term in power.terms:
        if name in term.channels:
            others = [run.channels[other] for other in term.channels if other != name]
            rest = np.prod([np.full(run.t.size, term.scale(radius)), *others], axis=0)
            slope, gain = slope + rest, gain + rest * run.channels[name]
    return gain, slope
