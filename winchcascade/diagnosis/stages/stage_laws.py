"""Laws of the stages of a cascade: which of them act between two powers, and the power that one
unit of each takes.

Between two stages the energy is conserved: what comes out is what goes in, less losses and less
what stores take up. Each of these is a number times a signal, so that power out minus power in is
linear in the numbers. A sensor that reads (1 + g) x + o gives x = (1 - h) x_read - o', with h = g /
(1 + g) and o' = o / (1 + g), which is linear in h and o'. A store takes up d(x^2 / 2)/dt, whose
mean over a block is a difference between its ends: no slope has to be smoothed.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import Part, part_uncertainty
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import ATMOSPHERE, si_unit
from winchcascade.core.rig_file import StatedLaw
from winchcascade.rig.effects.catalogue import EFFECTS, LAWS
from winchcascade.rig.effects.effect import Display, Effect, Parameter, StageLaw, Values
from winchcascade.rig.physics import REST

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from winchcascade.core.cascade import Power, Stage
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.fit.suspects import Suspects

SIGNALS = {"rotation": "speed"} | {
    name: name for name in ("velocity", "force", "torque", "voltage", "current", "flow", "pressure")
}
"""Signals that laws are made of, by the dimension of the channels that they follow from."""

MOTIONS = {
    "velocity": 1,
    "speed": 1,
    "flow": 1,
    "voltage": 1,
    "displacement": 1,
    "force": 0,
    "torque": 0,
    "current": 0,
    "pressure": 0,
}
"""Signals that grow with the motion of a stage (1), and with its load (0), as in a machine with
magnets or with pistons."""

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

STORES = ("store", "gas")
"""Kinds of laws that take up energy for a while."""

TOP = 0.9
"""Quantile of the magnitude of a signal that a zero of its sensor is compared with. [1]"""

BROKEN = 3.0
"""Bound of an error of a sensor, as a multiple of its plausible range: beyond it the sensor is
broken or has a wrong unit. [1]"""

FAR = 100.0
"""Bound of a number, as a multiple of what would take all power. [1]"""


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


class Suspected(msgspec.Struct, frozen=True):
    """A law that may act on the `paths` of these numbers, by itself or through a sensor `channel`.

    `stated` is what the rig file states of a law; of a sensor it is `known` where it states an
    uncertainty. A law beside a model is `signed`: the rig may lose less than its model.
    """

    law: StageLaw
    paths: tuple[int, ...]
    channel: str = ""
    signed: bool = False
    stated: StatedLaw | None = None
    known: bool = False


Suspecteds = dict[str, Suspected]
"""Laws by the names of the suspects."""


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
            f"{rig.name} with its logs gives "
            f"{len(known)}; it lacks that of {places}. Log its channels, or name their columns "
            f"under [columns] in the rig file."
        )
    return tuple(StagePath(into, out) for into, out in pairwise(known))


def stage_signals(run: Run, rig: Rig, path: StagePath) -> StageSignals:
    """Powers and signals of one path in one log."""
    channels, radius = run.channels, rig.r_drum
    own: dict[str, Signal] = {}
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
        own = found | own
    line, shaft = (
        any(end.name == name for end in (path.into, path.out)) for name in ("line", "mech")
    )
    if line:
        own = {name: x for name, x in own.items() if name not in ("speed", "torque")}
        own |= {
            name: channels[name]
            for name in ("velocity", "displacement", "pressure")
            if name in channels
        }
    elif shaft:
        own |= _of_shaft(run, rig, power_in if path.into.name == "mech" else power_out)
        own.pop("velocity", None)
    shaft_goes_in = path.into.name == "mech" and not line
    at_out = axes_of(own)[0] not in incoming and not shaft_goes_in
    own["power"] = np.abs(power_out if at_out and "" not in axes_of(own) else power_in)
    if not {path.into.name, path.out.name} <= {"line", "mech"}:
        own["drive"] = own["power"]
    return StageSignals(run.t, power_in, power_out, own, errors)


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


# ----------------------------------------------------------------------------------- the suspects
def suspected_laws(
    each: Sequence[StageSignals],
    paths: Sequence[StagePath],
    rig: Rig,
    suspects: Suspects,
    over: Collection[str] = (),
) -> Suspecteds:
    """Laws that may act on some paths, by the names of the suspects.

    Parameters
    ----------
    each : signals of every path in one log
    suspects : effects that may be named; if some effect of the catalogue is none, laws are suspects
        by their names alone
    over : signals that laws may be made of; all by default, and sensors

    Raises
    ------
    RigError : the rig file states a law that the stage does not have, or in another unit
    """
    allowed = _allowed(suspects)
    several: list[tuple[str, Suspected]] = []
    for k, (path, one) in enumerate(zip(paths, each, strict=True)):
        stated, signals = _stated(path, one, rig), set(one.signals)
        signals &= {*over, "power", "drive"} if over else signals
        for name in dict.fromkeys((*allowed, *stated)):
            law = LAWS[name]
            timeless = law.kind in STORES and rig.phases.source == "rows"  # rows of a table
            if (_acts(law, signals) or name in stated) and not timeless:
                several.append((name, Suspected(law, (k,), stated=stated.get(name))))
    names = [name for name, _ in several]
    found = {
        name if names.count(name) == 1 else f"{name}({paths[one.paths[0]].name})": one
        for name, one in several
    }
    return found if over else found | _suspected_sensors(each, paths, rig, suspects)


def laws_beside_model(
    each: Sequence[StageSignals], paths: Sequence[StagePath], rig: Rig, suspects: Suspects
) -> Suspecteds:
    """Laws that may act beside those of a model, and sensors, by the names of the suspects.

    A law acts alike on all paths that have its signals: what a current loses in the machine lowers
    its voltage and takes power of the shaft.
    """
    found = {
        name: Suspected(LAWS[name], acts, signed=True)
        for name in _allowed(suspects)
        if (acts := tuple(k for k, one in enumerate(each) if _acts(LAWS[name], one.signals)))
    }
    return found | _suspected_sensors(each, paths, rig, suspects)


def _allowed(suspects: Suspects) -> list[str]:
    """Laws that may be named, in the order of the catalogue."""
    every = EFFECTS.keys() <= suspects.keys()
    return [name for name in LAWS if name in suspects or (every and name not in EFFECTS)]


def _suspected_sensors(
    each: Sequence[StageSignals], paths: Sequence[StagePath], rig: Rig, suspects: Suspects
) -> Suspecteds:
    """Errors of sensors that may act.

    A balance of powers has no scale of its own: the sensors at its end are the reference of the
    others.
    """
    allowed, found = _allowed(suspects), Suspecteds()
    reference = {name for power in paths[-1].out.powers for name in power.channels}
    for channel in dict.fromkeys(name for one in each for name in one.errors["gain"]):
        sensor, dimension = rig.sensors.get(channel), rig.known_channels[channel].dimension
        for part in PARTS[channel in reference :]:
            name, law = sensor_suspect(channel, part), LAWS[part]
            if name in suspects or (name not in EFFECTS and part in allowed):
                known = sensor is not None and part_uncertainty(sensor, part) > 0.0
                unit = si_unit(dimension) if part == "zero" else law.unit
                law = msgspec.structs.replace(law, unit=unit)
                found[name] = Suspected(law, tuple(range(len(paths))), channel, known=known)
    return found


def sensor_suspect(channel: str, part: str) -> str:
    """Name of an error of a sensor: that of the catalogue, else by its channel.

    >>> sensor_suspect("vdc", "gain"), sensor_suspect("torque", "zero")
    ('voltage_gain', 'torque_zero')
    """
    known = (name for name, effect in EFFECTS.items() if effect.path == f"sensors.{part}.{channel}")
    return next(known, f"{channel}_{part}")


def _acts(law: StageLaw, signals: Collection[str]) -> bool:
    needed = {*law.over, *([law.needs] if law.needs else [])}
    return law.kind not in ("gain", "zero") and needed <= {*signals} and law.without not in signals


def _stated(path: StagePath, one: StageSignals, rig: Rig) -> dict[str, StatedLaw]:
    """Laws of a path that the rig file states: under [laws], and by the numbers of rotor, spring
    and capacitor.
    """
    gear, spring = rig.drivetrain.gear_ratio, rig.drivetrain.k_shaft
    square = 1.0 if gear is None else gear.value**2
    compliance = None if spring is None or not spring.value else -1.0 / spring.value**2
    parts = {
        "shaft_inertia": (rig.drivetrain.inertia_rotor, square),
        "shaft_spring": (spring, compliance),
        "capacitor": (rig.dc_link.c_dc if path.out.name == "gen" else None, 1.0),
    }
    found: dict[str, StatedLaw] = {}
    for name, (part, slope) in parts.items():
        law = LAWS[name]
        if (
            part is not None
            and slope
            and path.into.name not in ("line", "hyd")
            and _acts(law, one.signals)
        ):
            found[name] = StatedLaw(abs(part.value * slope), law.unit, abs((part.u or 0.0) * slope))
    for name, stated in rig.laws.get(path.out.name, {}).items():
        place = f"{rig.path}: [laws.{path.out.name}] {name}"
        if name not in LAWS or not _acts(LAWS[name], one.signals):
            known = ", ".join(name for name, law in LAWS.items() if _acts(law, one.signals))
            raise RigError(
                f"{place}: no such law from {path.into.name} to {path.out.name}; expected one of "
                f"{known}."
            )
        if stated.unit != LAWS[name].unit:
            raise RigError(f"{place}: the unit is {stated.unit!r}; expected {LAWS[name].unit!r}.")
        found[name] = stated
    return found


def effects_of(
    laws: Suspecteds, paths: Sequence[StagePath], most: Sequence[float], tops: Mapping[str, float]
) -> dict[str, Effect]:
    """The suspects with the number of each.

    No loss is a source of power, and no range of its number is known beforehand: at most it takes
    as much power as the stage has.

    Parameters
    ----------
    most : number of each law that takes all power
    tops : top reading of each channel
    """
    several = zip(laws.items(), most, strict=True)
    return {
        name: _effect(name, one, paths, size, tops.get(one.channel, 0.0))
        for (name, one), size in several
    }


def _effect(
    name: str, one: Suspected, paths: Sequence[StagePath], most: float, top: float
) -> Effect:
    law, known = one.law, EFFECTS.get(name.partition("(")[0])
    number = 0.0 if one.stated is None else one.stated.value
    low, high, least = -min(number, most), most, -number
    stage = "sensor"
    display = Display(
        law.what,
        law.factor,
        "%" if law.factor == 100.0 else law.unit.replace(".", "·"),
        signed=False,
    )
    if one.channel:
        low, high = ((top if law.kind == "zero" else 1.0) * end for end in law.share)
        least, far = BROKEN * low, BROKEN * high
        display = msgspec.structs.replace(display, what=f"{law.kind} of {one.channel}", signed=True)
    else:
        far = FAR * most
        low, least = (-most, -far) if one.signed else (low, least)
        stage = known.stage if one.signed and known is not None else paths[one.paths[-1]].place
    return Effect(
        name=name,
        label=f"{law.label} of {one.channel}"
        if known is None and one.channel
        else (known or law).label,
        stage=stage,
        summary=(known or law).summary,
        shows_as=f"power over {', '.join(law.over) or 'time'}",
        fields=(Parameter(law.parameter, law.unit, low, high, (least, far)),),
        display=display if known is None or not one.channel else known.display,
        unit=law.unit,
        reported_from=_gain if law.kind == "gain" else partial(_total, number) if number else None,
    )


def _gain(values: Values) -> float:
    """The gain error of a sensor, of the share by which its reading is too large.

    >>> round(_gain((0.2,)), 9)
    0.25
    """
    return values[0] / (1.0 - values[0])


def _total(stated: float, values: Values) -> float:
    """The number of a law of which the rig file states a part."""
    return stated + values[0]
