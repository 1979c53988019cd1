"""Names and number formats of a diagnosis: effects, loads, phases, probabilities, nuisance parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from winchcascade.diagnosis.diagnosis_result import Reported
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.nuisances import Nuisance
from winchcascade.report.digits import MINUS, NumberText, number, places
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import Display

PLENTY = 100.0
"""More standard deviations than this are not counted."""


def display_of(effect: str, name: str, unit: str = "") -> Display:
    """How a number is shown; one of an effect from elsewhere by its own name and unit."""
    if effect_name(effect) in EFFECTS:
        return EFFECTS[effect_name(effect)].display
    return Display(name.replace("_", " "), 1.0, "" if unit == "1" else unit, signed=False)


def number_words(how: Display, found: Reported, otherwise: int = 5) -> tuple[str, str]:
    """A number and its 95 % interval with their unit, with the digits that the interval allows, else with so many."""
    u = (found.high - found.low) / 3.92 * how.factor
    size = max(abs(found.value * how.factor), 1e-12)
    decimals = places(u) if u > 0.0 else otherwise - 1 - math.floor(math.log10(size))
    low, value, high = (number(x * how.factor, decimals) for x in (found.low, found.value, found.high))
    sign, factor, unit = "+" if how.signed and found.value > 0.0 else "", how.factor, how.unit
    return (
        NumberText(f"{sign}{value} {unit}".rstrip(), found.value * factor, unit=unit),
        NumberText(f"{low} to {high} {unit}".rstrip(), found.low * factor, found.high * factor, unit=unit),
    )


def probability_words(p: float) -> str:
    """A probability with two decimals that never states certainty.

    >>> probability_words(0.873), probability_words(0.9999), probability_words(0.0003)
    ('0.87', '> 0.99', '< 0.01')
    """
    return NumberText("> 0.99" if p > 0.995 else "< 0.01" if p < 0.005 else f"{p:.2f}", p)


def phase_words(phase: str) -> str:
    """A phase as a text writes it."""
    return phase.replace("_", "-")


def signed(z: float) -> str:
    """A number of standard uncertainties, with one decimal below ten and no more than three digits.

    >>> signed(3.14), signed(-41.7), signed(1.0e4), signed(-0.04)
    ('+3.1', '−42', '> 999', '0.0')
    """
    if abs(z) > 999.0:
        return NumberText("> 999" if z > 0 else f"< {MINUS}999", z)
    text = "0.0" if abs(z) < 0.05 else f"{z:+.1f}" if abs(z) < 9.95 else f"{z:+.0f}"
    return NumberText(text.replace("-", MINUS), z)


def share_words(share: float) -> str:
    """A share in percent that is never rounded up to all.

    >>> share_words(0.943), share_words(0.9996), share_words(-0.2)
    ('94 %', '> 99 %', '−20 %')
    """
    text = "> 99 %" if share >= 0.995 else f"{number(100.0 * share, 0)} %"
    return NumberText(text, 100.0 * share, unit="%")


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
