"""Nuisance parameters, known within a tolerance only: numbers of the rig, loads, gains and zeros
of the sensors, the model.
"""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, Literal

import msgspec

from winchcascade.core.accuracy import part_uncertainty
from winchcascade.core.quantity import Quantity
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.rig.effects.effect import Parameter
from winchcascade.rig.parts import IN_RIG, in_rig_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig, Sensor
    from winchcascade.core.run import Run
    from winchcascade.core.scales import Scales

SECTIONS = ("winch", "restoring", "drivetrain", "generator", "dc_link")

OF_THE_MODEL = {
    ("generator", "v_diode"): 0.06,
    ("generator", "r_s"): 0.008,
    ("generator", "l_s"): 0.012,
    ("winch", "inertia"): 0.07,
    ("drivetrain", "inertia_rotor"): 0.03,
}
"""Standard uncertainty of a number due to the model, as a share of it, beside that of the rig file.
Generator: the ideal bridge on a stiff DC link is within about 0.1 % of Vdc of a switched circuit
with a finite capacitor, which these shares move as much. Inertias: the acceleration of a smoothed
velocity is some hundredths too small where the motion turns, and more where a ramp has fewer
samples than `OF_A_RAMP`."""

OF_THE_BRIDGE = 1.4e-4
"""What the ideal bridge leaves of Vdc that a drop of the diodes takes up, as a share of the
back-EMF at the top speed. [1]
"""

OF_A_RAMP = 10.0
"""Number of samples of a ramp from which more of them make no acceleration more precise. [1]"""

ABSENT = {
    ("winch", "friction"): (8.6e-4, "torque_drum", "N.m"),
    ("winch", "stribeck"): (1.0e-3, "torque_drum", "N.m"),
    ("restoring", "seal_friction"): (3.8e-3, "thrust", "N"),
    ("drivetrain", "friction"): (9.5e-4, "torque_rotor", "N.m"),
    ("drivetrain", "clutch_drag"): (5.7e-4, "torque", "N.m"),
}
"""Standard uncertainty of a law that is taken as absent, by part and number of the model, as a
share of a scale: no rig is quite free of dry friction, and the model deviates by as much where the
motion begins and ends. About that of the zeros of torque and force; assumed. The friction near
standstill also stands for how the screw changes its direction: laws that do so within the same
speed by other curves differ by as much just above the onset speed."""

WITHOUT_ZERO = ("vdc",)
"""Channels without a zero in the fit: that of Vdc acts as the drop of the diodes, which has
twice the uncertainty.
"""

SKEW = 0.05
"""Channels of a logger are read one after the other: against the velocity each by this share of a
sample's interval, one standard uncertainty, assumed. The pressure changes too slowly for it to
matter. [1]"""

LATE = 1 / 24
"""Share of an electrical period by which a bridge answers late, one standard uncertainty: that of
the model answers at once, a real one at its next commutation, after a twelfth of a period in the
mean. Half of that, of the period at the top speed of the line. [1]"""

RISING = 1 / 3
"""Voltage `2 l_s di/dt` of a current that rises in a ramp, which the model leaves out, over the
drop by commutation `(3/pi) w_e l_s i`: this over the number of electrical periods in the ramp. The
inductance is uncertain by as much. [1]"""

LOAD = "dc_link.load_change"
"""Path in the model of the deviation of a load."""

COURSES = ("level", "speed", "current")
"""What a discrepancy of the model is proportional to within a phase: nothing, the line speed,
the DC current.
"""

SHARED = 0.5
"""Correlation of the discrepancy of the model between two loads. [1]"""


class Nuisance(Parameter, frozen=True, kw_only=True):
    """A parameter that every fit allows within its tolerance `sd`.

    `kind` is `rig` (a number `name` of a `section`, the same in every log), `law` (one of the model
    that a rig has not), `load` (relative, of one load [ohm]), `gain` (relative, of the sensor of a
    channel), `timing` (by how much that sensor is read late), `zero` (of that sensor in one log, by
    its number) or `discrepancy` (of the model from any rig: of a channel in a `phase`, as a share
    of its plateau in the log, along one of the `COURSES`, at one load or, where that is NaN, at
    all).
    """

    kind: Literal["rig", "law", "load", "gain", "timing", "zero", "discrepancy"]
    section: str = ""
    phase: str = ""
    course: str = ""
    role: Literal["effect", "entry", "nuisance"] = "nuisance"

    def __str__(self) -> str:
        """How a report calls it."""
        course = "" if self.course == COURSES[0] else f", with the {self.course}"
        where = course if math.isnan(self.load) else f"{course} at {self.load:g} ohm"
        return {
            "rig": f"{self.name} of the {self.section}"
            if self.name in CHANNELS or self.name == "friction"
            else self.name,
            "law": f"{self.name} of the {self.section}",
            "load": f"load of {self.load:g} ohm",
            "gain": f"gain of {self.name}",
            "timing": f"timing of {self.name}",
            "zero": f"zero of {self.name} in log {self.log + 1}",
            "discrepancy": f"model of {self.name} in {self.phase.replace('_', '-')}{where}",
        }[self.kind]


def nuisances(rig: Rig, runs: Sequence[Run], scales: Scales) -> tuple[Nuisance, ...]:
    """Every nuisance of some logs on a rig, in a fixed order: rig, laws, loads, gains, timing,
    zeros, discrepancy.
    """
    coarse = max(OF_A_RAMP / (scales.ramp * min(run.fs for run in runs)), 1.0)
    found = _of_the_rig(rig, scales, coarse)
    share = rig.dc_link.load_u
    loads = dict.fromkeys(
        run.load for run in runs if run.load is not None and math.isfinite(run.load)
    )
    found += [
        Nuisance(
            f"{load:g} ohm", "1", kind="load", sd=share, path=LOAD, operation="compound", load=load
        )
        for load in loads
    ]
    logged = [name for name in CHANNELS if any(name in run.channels for run in runs)]
    errors = {name: sensor_errors(rig.sensors.get(name)) for name in logged}
    late = LATE * scales.ramp / _periods_in_a_ramp(rig, scales)
    skew = max(SKEW / max(run.fs for run in runs), late)
    for name in logged:
        path = f"sensors.gain.{name}"
        found.append(
            Nuisance(name, "1", kind="gain", sd=errors[name][0], path=path, operation="compound")
        )
    found += [Nuisance(name, "s", kind="timing", sd=skew) for name in logged if name != "pressure"]
    for log, run in enumerate(runs):
        own = (name for name in logged if name in run.channels and name not in WITHOUT_ZERO)
        found += [
            Nuisance(
                name, "SI", kind="zero", sd=errors[name][1], path=f"sensors.zero.{name}", log=log
            )
            for name in own
        ]
    stated = dict.fromkeys(math.inf if run.load is None else run.load for run in runs)
    for load, part in [(math.nan, SHARED), *((load, 1.0 - SHARED) for load in stated)]:
        sd = rig.model.discrepancy * math.sqrt(part / len(COURSES))
        for name, phase, course in product(logged, PHASES, COURSES):
            found.append(
                Nuisance(
                    name, "1", kind="discrepancy", sd=sd, load=load, phase=phase, course=course
                )
            )
    return tuple(n for n in found if n.sd)


def _of_the_rig(rig: Rig, scales: Scales, coarse: float) -> list[Nuisance]:
    """Numbers that the rig file states, by their names there, and laws of the model that it has
    not.

    Parameters
    ----------
    coarse : factor by which coarse samples make inertias less certain [1]
    """
    found = []
    for section, number, name in (
        (part, *names) for part in SECTIONS for names in in_rig_file(part).items()
    ):
        value, path = quantity_of(rig, section, name), f"{section}.{number}"
        if value is not None:
            per = IN_RIG.get(path, 1.0)
            of_the_model = OF_THE_MODEL.get((section, name), 0.0) * value.value
            of_the_model *= coarse if "inertia" in name else 1.0
            if name == "l_s":
                rising = RISING / _periods_in_a_ramp(rig, scales) * value.value
                of_the_model = max(of_the_model, rising)
            of_the_bridge = OF_THE_BRIDGE * scales.voltage if name == "v_diode" else 0.0
            sd = math.hypot(value.u or 0.0, of_the_model, of_the_bridge)
            found.append(
                Nuisance(name, value.unit, kind="rig", sd=sd, path=path, per=per, section=section)
            )
    for (part, name), (share, scale, unit) in ABSENT.items():
        if part == "restoring" and not rig.restoring.has_gas:
            continue
        path = f"{part}.{name}"
        found.append(
            Nuisance(name, unit, kind="law", sd=share * scales.of(scale), path=path, section=part)
        )
    return found


def _periods_in_a_ramp(rig: Rig, scales: Scales) -> float:
    """Number of electrical periods in a ramp at the top speed of the line, infinite for a rig
    without a machine. [1]
    """
    pairs = rig.generator.pole_pairs
    if pairs is None:
        return math.inf
    return pairs.value * scales.omega_rotor * scales.ramp / (2.0 * math.pi)


def sensor_errors(sensor: Sensor | None) -> tuple[float, float]:
    """Standard uncertainties of a sensor's gain [1] and zero [SI unit of its channel].

    They are those of a reduction, with one addition: a limit in shares of the full scale bounds a
    reading whatever errs of it, so it allows a gain as well as a zero, and a fit has to distinguish
    them.
    """
    gain, zero = part_uncertainty(sensor, "gain"), part_uncertainty(sensor, "zero")
    if sensor is not None and sensor.u_zero is None and sensor.u_gain is None and sensor.full_scale:
        gain = math.hypot(gain, zero / sensor.full_scale)
    return gain, zero


def quantity_of(rig: Rig, section: str, name: str) -> Quantity | None:
    """A number of a rig; None where the rig lacks it."""
    number: Quantity | None = getattr(getattr(rig, section), name)
    return number


def stated_share(rig: Rig, nuisance: Nuisance) -> float:
    """Share of the uncertainty of a nuisance that is one of an input of the model, as the rig file
    states it; what a fit allows beside it is an error of the model. [1]
    """
    if nuisance.kind != "rig":
        return float(nuisance.kind == "load")
    number = quantity_of(rig, nuisance.section, nuisance.name)
    return 0.0 if number is None else (number.u or 0.0) / nuisance.sd


def with_quantity(rig: Rig, section: str, name: str, number: Quantity | None) -> Rig:
    """A rig with another number."""
    part = msgspec.structs.replace(getattr(rig, section), **{name: number})
    return msgspec.structs.replace(rig, **{section: part})


def calibrated_numbers(rig: Rig) -> dict[tuple[str, str], Quantity]:
    """Numbers of a rig that a calibration wrote, by section and name."""
    stated = {
        (section, name): getattr(getattr(rig, section), name)
        for section in SECTIONS
        for name in getattr(rig, section).__struct_fields__
    }
    return {
        place: n
        for place, n in stated.items()
        if isinstance(n, Quantity) and n.calibrated is not None
    }


def before_calibration(rig: Rig) -> Rig:
    """The rig with each calibrated number as it was before its first calibration."""
    for place, number in calibrated_numbers(rig).items():
        rig = with_quantity(rig, *place, number.prior)
    return rig
