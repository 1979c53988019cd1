"""Laws of the stages of a cascade as suspects: which of them may act between two powers, and the
range of the number of each.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.accuracy import part_uncertainty
from winchcascade.core.errors import RigError
from winchcascade.core.quantity import si_unit
from winchcascade.core.rig_file import StatedLaw
from winchcascade.diagnosis.stages.stage_signals import PARTS, SIGNALS, StagePath, StageSignals
from winchcascade.rig.effects.catalogue import EFFECTS, LAWS
from winchcascade.rig.effects.effect import Display, Effect, Parameter, StageLaw, Values

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.fit.suspects import Suspects


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


STORES = ("store", "gas")
"""Kinds of laws that take up energy for a while."""

TOP = 0.9
"""Quantile of the magnitude of a signal that a zero of its sensor is compared with. [1]"""

BOUND_OF_SENSOR = 3.0
"""Bound of an error of a sensor, as a multiple of its plausible range: beyond it the sensor is
broken or has a wrong unit. [1]"""

BOUND_OF_LAW = 100.0
"""Bound of a number, as a multiple of what would take all power. [1]"""


class Suspected(msgspec.Struct, frozen=True):
    """A law that may act on the `paths` of these numbers, by itself or through a sensor `channel`.

    `stated` is what the rig file states of a law; of a sensor it is `known` where it states an
    uncertainty, and `of_motion` where it reads what grows with the motion. A law beside a model is
    `signed`: the rig may lose less than its model.
    """

    law: StageLaw
    paths: tuple[int, ...]
    channel: str = ""
    signed: bool = False
    stated: StatedLaw | None = None
    known: bool = False
    of_motion: bool = False


Suspecteds = dict[str, Suspected]
"""Laws by the names of the suspects."""


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
                of_motion = MOTIONS[SIGNALS[dimension]] == 1
                every = tuple(range(len(paths)))
                found[name] = Suspected(law, every, channel, known=known, of_motion=of_motion)
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
        least, far = BOUND_OF_SENSOR * low, BOUND_OF_SENSOR * high
        display = msgspec.structs.replace(display, what=f"{law.kind} of {one.channel}", signed=True)
    else:
        far = BOUND_OF_LAW * most
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
