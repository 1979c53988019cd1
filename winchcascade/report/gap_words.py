"""Names and number formats of a diagnosis, and sentences about a place of the gap and the owner's own simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    Arises,
    DiagnosisResult,
    Drift,
    EnergySpot,
    ModelForm,
    OwnSimulation,
    Place,
    Reported,
    Spot,
    StagePlace,
    Where,
)
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.line.line_data import POWER
from winchcascade.diagnosis.nuisances import Nuisance
from winchcascade.report.digits import MINUS, number, places
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import Display
from winchcascade.rig.effects.simplifications import SIMPLIFICATIONS

PLENTY = 100.0
"""More standard deviations than this are not counted."""


def display_of(effect: str, name: str, unit: str = "") -> Display:
    """How a number is shown; one of an effect from elsewhere by its own name and unit."""
    if effect_name(effect) in EFFECTS:
        return EFFECTS[effect_name(effect)].display
    return Display(name.replace("_", " "), 1.0, "" if unit == "1" else unit, signed=False)


def number_words(how: Display, found: Reported, otherwise: int = 5) -> tuple[str, str]:
    """A number and its 95 % interval with their unit, with the digits that the interval allows, else with `otherwise`."""
    u = (found.high - found.low) / 3.92 * how.factor
    size = max(abs(found.value * how.factor), 1e-12)
    decimals = places(u) if u > 0.0 else otherwise - 1 - math.floor(math.log10(size))
    low, value, high = (number(x * how.factor, decimals) for x in (found.low, found.value, found.high))
    sign = "+" if how.signed and found.value > 0.0 else ""
    return f"{sign}{value} {how.unit}".rstrip(), f"{low} to {high} {how.unit}".rstrip()


def probability_words(p: float) -> str:
    """A probability with two decimals that never states certainty.

    >>> probability_words(0.873), probability_words(0.9999), probability_words(0.0003)
    ('0.87', '> 0.99', '< 0.01')
    """
    return "> 0.99" if p > 0.995 else "< 0.01" if p < 0.005 else f"{p:.2f}"


def phase_words(phase: str) -> str:
    """A phase as a text writes it."""
    return phase.replace("_", "-")


def signed(z: float) -> str:
    """A number of standard uncertainties, with one decimal below ten and no more than three digits.

    >>> signed(3.14), signed(-41.7), signed(1.0e4), signed(-0.04)
    ('+3.1', '−42', '> 999', '0.0')
    """
    if abs(z) > 999.0:
        return "> 999" if z > 0 else f"< {MINUS}999"
    text = "0.0" if abs(z) < 0.05 else f"{z:+.1f}" if abs(z) < 9.95 else f"{z:+.0f}"
    return text.replace("-", MINUS)


def share_words(share: float) -> str:
    """A share in percent that is never rounded up to all.

    >>> share_words(0.943), share_words(0.9996), share_words(-0.2)
    ('94 %', '> 99 %', '−20 %')
    """
    return "> 99 %" if share >= 0.995 else f"{number(100.0 * share, 0)} %"


def apart_words(z: float) -> str:
    """By how many standard deviations two explanations differ.

    >>> apart_words(4.26), apart_words(21.6), apart_words(1420.0)
    ('4.3', '22', 'more than 100')
    """
    return f"{z:.1f}" if z < 9.95 else f"{z:.0f}" if z < PLENTY else f"more than {PLENTY:.0f}"


_RIG_NUMBERS = {
    "r_drum": "drum radius",
    "inertia": "inertia at the drum",
    "lead": "lead of the screw",
    "mu_screw": "friction coefficient of the screw",
    "area_piston": "piston area",
    "p_precharge": "precharge pressure",
    "volume_gas": "gas volume",
    "eta_mesh": "mesh efficiency",
    "b_rotor": "damper of the fast shaft",
    "k_shaft": "shaft spring",
    "c_shaft": "shaft damping",
    "inertia_rotor": "inertia of the fast shaft",
    "k_e": "back-EMF constant",
    "r_s": "stator resistance",
    "l_s": "phase inductance",
    "v_diode": "diode drop",
    "c_dc": "capacitor of the DC link",
    "r_bleed": "bleed resistance",
    "idc": "Idc",
    "vdc": "Vdc",
}
"""Numbers of the rig file and channels in plain words."""


_LAWS = {
    "friction of the winch": "friction of line and drum",
    "stribeck of the winch": "friction near standstill",
    "seal_friction of the restoring": "friction of the seals",
    "friction of the drivetrain": "friction of the fast shaft",
    "clutch_drag of the drivetrain": "drag of the clutch",
}
"""Laws that a rig file does not state, in plain words."""


def nuisance_words(n: Nuisance, files: Sequence[str]) -> str:
    """Name of a nuisance in words, with the file of its log in place of the number.

    >>> from winchcascade.diagnosis.nuisances import Nuisance
    >>> nuisance_words(Nuisance("zero", "idc", 0.1, "SI", log=1), ["a.csv", "b.csv"])
    'zero of Idc in b.csv'
    """
    name = _RIG_NUMBERS.get(n.name, n.name)
    return {
        "rig": name,
        "law": _LAWS.get(str(n), str(n)),
        "load": f"load of {load_words(n.load)}",
        "gain": f"gain of {name}",
        "timing": f"timing of {name}",
        "zero": f"zero of {name} in {files[n.log] if 0 <= n.log < len(files) else f'log {n.log + 1}'}",
        "discrepancy": str(msgspec.structs.replace(n, name=name)),
    }[n.kind]


NAMES = {
    "pressure": "pressure", "force": "line tension", "torque": "torque", "vdc": "Vdc", "idc": "Idc", POWER: "winch power",
}  # fmt: skip

UNITS = {"pressure": "Pa", "force": "N", "torque": "N m", "vdc": "V", "idc": "A"}

SENSORS = {
    "pressure": "pressure sensor", "force": "force cell", "torque": "torque sensor", "vdc": "sensor of Vdc",
    "idc": "sensor of Idc",
}  # fmt: skip


def spot_words(spot: Spot, names: Mapping[str, str] = NAMES) -> str:
    """A spot of the gap: channel and phase.

    >>> spot_words(Spot("idc", "haul_in")), spot_words(Spot("idc", "payout", within_blocks=True), {})
    ('Idc during haul-in', 'idc within blocks of payout')
    """
    channel = names.get(spot.channel, spot.channel)
    if spot.phase is None:
        return channel
    return f"{channel} {'within blocks of' if spot.within_blocks else 'during'} {phase_words(spot.phase)}"


def about_text(about: Spot | Nuisance | Drift | EnergySpot, files: Sequence[str] = ()) -> str:
    """What a sign of something unexplained is about, as the JSON names it.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    if isinstance(about, Drift):
        return " and ".join(about.effects) + (f" in {about.channel}" if about.channel else "")
    if isinstance(about, EnergySpot):
        return f"energy_{about.stage} in {phase_words(about.phase)} of {files[about.run]}"
    return spot_words(about, {}) if isinstance(about, Spot) else str(about)


def about_words(about: Spot | Nuisance | Drift | EnergySpot, files: Sequence[str]) -> str:
    """What a sign of something unexplained is about.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    if isinstance(about, Drift | EnergySpot):
        return about_text(about, files)
    return spot_words(about) if isinstance(about, Spot) else nuisance_words(about, files)


def differs_text(spot: Spot | None) -> str:
    """Where a cause and its alternative differ most, as the JSON has it.

    >>> differs_text(Spot("idc", "payout", 4.5, z=458.52)), differs_text(Spot("power_mech", "hold", bias=12.3))
    ('idc during payout at 4.5 ohm, where they differ by 458.5 sigma', 'power_mech during hold, by 12 W rms')
    """
    if spot is None or spot.load is None:
        return differs_words(spot, {})
    return f"{spot_words(spot, {})} at {load_words(spot.load, 'ohm')}, where they differ by {spot.z:.1f} sigma"


def differs_words(spot: Spot | None, names: Mapping[str, str] = NAMES) -> str:
    """Where a cause and its alternative differ most.

    >>> differs_words(Spot("idc", "payout", 4.5, z=458.52))
    'Idc during payout at 4.5 Ω, by more than 100 standard deviations'
    """
    if spot is None:
        return "nothing that these logs measure"
    if spot.load is None:
        return f"{spot_words(spot, names)}, by {spot.bias:.0f} W rms"
    return f"{spot_words(spot, names)} at {load_words(spot.load)}, by {apart_words(spot.z)} standard deviations"


def where_sentence(
    where: Where, word: str = "measured", *, own_simulation: bool = False, explained: bool = True
) -> str:
    """Where a gap lies: in which direction, at what currents and speeds, by how much; as the JSON has it.

    Parameters
    ----------
    word : what the power of a winch without a model is called
    own_simulation : the logs are compared with a simulation of the owner
    explained : the causes explain the gap, so that a wrong entry among them may be called its origin
    """
    worst = where.worst
    if worst.channel == POWER:
        return (
            f"{where.stage}: in {phase_words(worst.phase)} the {word} power of the winch lies {abs(worst.bias) / 1e3:.2g} kW "
            f"{'above' if worst.bias > 0.0 else 'below'} line tension times speed on average (z = {worst.z:+.0f}), "
            f"{worst.rms / 1e3:.2g} kW rms; that phase holds {100.0 * worst.share:.0f} % of the squared gap."
        )
    region = ""
    if worst.phase == "payout" and math.isfinite(where.rpm[0]):
        region = f" between {where.rpm[0]:.0f} and {where.rpm[1]:.0f} rpm"
        if where.i_dc[1] > 0.5:
            region += f" and {max(where.i_dc[0], 0.0):.1f} to {where.i_dc[1]:.1f} A DC"
    entry = "comes from a wrong entry" if explained else "is most like that of a wrong entry"
    place = {"sensor": "lies in a sensor", "entry": entry}.get(where.stage, f"lies in the {where.stage} stage")
    gap = "The gap between your simulation and the logs" if own_simulation else "The gap"
    return f"{gap} {place}: {_deviates(worst, where.size, region)}by up to {size_text(worst.channel, where.size)}."


def arises_sentence(own: Arises | None) -> str:
    """In which stage a gap arises when each stage has its logged inputs, as the JSON has it."""
    if own is None:
        return ""
    inputs = "With logged inputs to each stage,"
    if own.worst is None:
        return f"{inputs} no stage deviates by more than {STANDS_OUT:g} standard uncertainties."
    stages = " and ".join([", ".join(own.off[:-1]), own.off[-1]] if len(own.off) > 1 else own.off)
    if own.sensor is not None:
        return (
            f"{inputs} the {stages} stages deviate as they would with a gain error of about {100.0 * own.gain:+.1g} % in the "
            f"{SENSORS[own.sensor]} alone."
        )
    which = (
        f"the {stages} stages deviate, the {own.off[0]} most"
        if len(own.off) > 1
        else f"only the {stages} stage deviates"
    )
    size = size_text(own.worst.channel, own.worst.bias)
    return f"{inputs} {which}: {_deviates(own.worst, own.worst.bias)}by {size} in the mean."


def _deviates(worst: Place | StagePlace, bias: float, region: str = "") -> str:
    """In which direction a channel deviates, by the sign of measured minus simulated, and at which load it does so most."""
    return (
        f"{NAMES[worst.channel]} is {'over' if bias < 0.0 else 'under'}-predicted during {phase_words(worst.phase)}{region}, "
        f"most clearly{_at(worst.load)}, "
    )


def _at(load: float | None) -> str:
    """At which load something is so, as the JSON has it; empty for no load."""
    return "" if load is None else " in open circuit" if math.isinf(load) else f" at {load:g} ohm"


def size_text(channel: str, size: float) -> str:
    """The magnitude of a difference with its unit, from SI units.

    >>> size_text("pressure", -98066.5), size_text("vdc", 12.345)
    ('1 kg/cm2', '12.3 V')
    """
    factor, unit = (1.0 / 98066.5, "kg/cm2") if channel == "pressure" else (1.0, UNITS[channel])
    return f"{abs(size) * factor:.3g} {unit}"


class Sign(NamedTuple):
    """What the size of an alarm is, and what the alarm may mean, empty for nothing beyond that."""

    size: str
    meaning: str = ""


SIGNS = {
    "structure": Sign("root mean square of block means over their noise", "the shape of the model is wrong there"),
    "scatter": Sign(
        "scatter within blocks over what noise explains",
        "something faster than a block of 0.4 s moves, a ripple or a vibration",
    ),
    "ripple": Sign(
        "scatter of block means about a smooth course over what noise explains",
        "something comes and goes within seconds, as with every turn of a drum that is out of round",
    ),
    "nuisance": Sign(
        "how far the fit moved it, in its standard uncertainties",
        "its tolerance is wrong, or it takes the place of another effect",
    ),
    "drift": Sign(
        "how improbable it is by chance that the number differs so much between runs, as a power of ten",
        "it follows another law, or something changes in the course of the campaign",
    ),
    "range": Sign(
        "the number lies at an end of its range or beyond what is plausible",
        "the effect is far larger than usual, or takes the place of another",
    ),
    "cancelling": Sign("the smaller of the two over what both do together", "the data need neither of them"),
    "worse": Sign("misfit that the causes add to held-out predictions, over the noise", "they do not act as fitted"),
    "energy": Sign("energy that the fit leaves, in standard uncertainties"),
    "residual": Sign("efficiency that the causes leave"),
    "slow": Sign("share of the squared residual that lasts longer than a second"),
}
"""Kinds of alarms."""

LINE_ENERGY = Sign("deviation of the predicted energy from the measured one, as a share")
"""An alarm about an energy of a winch without a model."""


def alarm_place(alarm: Alarm, files: Sequence[str]) -> str:
    """Where a sign of something unexplained is, with its load.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    return f"{about_words(alarm.about, files)}{_at(alarm.about.load) if isinstance(alarm.about, Spot) else ''}"


def kind_words(alarms: Sequence[Alarm]) -> dict[str, str]:
    """What the sizes of some alarms are and what they may mean, by their kinds."""
    signs = {
        alarm.kind: LINE_ENERGY if alarm.kind == "energy" and isinstance(alarm.about, Spot) else SIGNS[alarm.kind]
        for alarm in alarms
    }
    means = {kind: f"; it may mean that {sign.meaning}" if sign.meaning else "" for kind, sign in signs.items()}
    return {kind: f"size: {sign.size}{means[kind]}." for kind, sign in signs.items()}


def has_own_simulation(found: DiagnosisResult) -> bool:
    """Whether the logs are compared with a simulation of the owner and not with the model of the rig file."""
    return isinstance(found, ModelDiagnosis) and found.own_simulation is not None


def baseline_words(found: DiagnosisResult) -> str:
    """What the logs are compared with, as in a legend."""
    return "your simulation" if has_own_simulation(found) else "model of the rig file"


def own_simulation_words(found: DiagnosisResult) -> list[str]:
    """What the own simulation has in another form than the rig's model, the largest difference first; none without one."""
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    if own is None:
        return []
    causes = {cause.effect for cause in found.causes}
    forms = [_form_words(form, own, named=form.likely in causes) for form in own.forms]
    return forms or ["Your simulation agrees with the model of the rig file within its tolerances."]


def _form_words(form: ModelForm, own: OwnSimulation, *, named: bool) -> str:
    """One difference between an own simulation and the rig's model.

    Parameters
    ----------
    named : the logs have the same effect, as a cause
    """
    place = (
        f"its {NAMES[form.channel]} is {size_text(form.channel, form.bias)} {'higher' if form.bias > 0.0 else 'lower'} during "
        f"{phase_words(form.phase)}{_at(form.load)}"
    )
    differs = f"Your simulation differs from the rig's model in the {form.stage} stage"
    if form.likely is None:
        return f"{differs}: {place}; no effect and no usual simplification explains it."
    if form.likely in SIMPLIFICATIONS:
        return f"{differs}; likely {own.likely[form.likely].display.what}: {place}."
    effect, numbers = own.likely[form.likely], own.numbers[form.likely].items()
    displays = [(display_of(form.likely, name, value.unit), value) for name, value in numbers]
    sizes = "; ".join(f"{how.what} {number_words(how, value)[0]}" for how, value in displays)
    too = " The logs have this effect too; only what differs of it is part of their gap." if named else ""
    return (
        f"Your simulation already contains {effect.label} ({form.likely}, {form.stage} stage): {sizes}; {place}.{too}"
    )
