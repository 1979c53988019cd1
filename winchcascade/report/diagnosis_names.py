"""What a diagnosis calls its things: effects with their numbers, places of the gap, nuisances,
logs; as plain texts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec

from winchcascade.core.campaign_file import Origin, joint_origin
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    DiagnosisResult,
    NamedCause,
    Reported,
    Spot,
)
from winchcascade.diagnosis.fit.entries import effect_name
from winchcascade.diagnosis.fit.nuisances import Nuisance
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.report.content import Measured, Span, number_text, shown
from winchcascade.report.glossary import CHANNELS, PHASES, STAGE_PLACES
from winchcascade.report.results.effects import call_all
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import Display

UNDETERMINED = "not determined by these logs"
"""In place of the interval of a number of which the logs tell little."""

INTERVAL_WIDTH = 2.0 * COVERED
"""Width of an interval of 95 % over its standard uncertainty. [1]"""

NAMES = {name: term.label for name, term in CHANNELS.items()}
"""Channels of a diagnosis."""


# ----------------------------------------------------------------------------- numbers of effects
def display_of(effect: str, name: str, unit: str = "") -> Display:
    """How a number is shown; one of an effect from elsewhere, or in another unit than the
    effect, by its own name and unit.
    """
    known = EFFECTS.get(effect_name(effect))
    if known is not None and (name == known.parameter or unit in ("1", "relative", "", known.unit)):
        return known.display
    return Display(name.replace("_", " "), 1.0, "" if unit == "1" else unit, signed=False)


def shown_as(found: DiagnosisResult, cause: NamedCause, name: str = "") -> Display:
    """How a number of a cause is shown, by default the first one that is reported."""
    if isinstance(found, StageDiagnosis):
        return found.suspects[cause.effect].display
    name = name or next(iter(cause.parameters))
    return display_of(cause.effect, name, cause.parameters[name].unit)


def number_cells(how: Display, found: Reported) -> tuple[Measured, Span | str]:
    """A number and its 95 % interval in the unit in which it is shown, with the digits that the
    interval allows.
    """
    value = found.value * how.factor
    if not found.determined:
        return Measured(value, signed=how.signed), UNDETERMINED
    low, high = found.low * how.factor, found.high * how.factor
    u = (high - low) / INTERVAL_WIDTH
    return Measured(value, u, signed=how.signed), Span(low, high, u)


def number_words(how: Display, found: Reported) -> tuple[str, str]:
    """A number and its 95 % interval with their unit, as texts.

    >>> number_words(Display("slope", 1.0, "ohm"), Reported(0.07, -math.inf, math.inf, "ohm"))
    ('+0.07000 ohm', 'not determined by these logs')

    >>> number_words(Display("stator resistance", 100.0, "%"), Reported(0.3996, 0.372, 0.427, "relative"))
    ('+40.0 %', '37.2 to 42.7 %')
    """
    value, interval = number_cells(how, found)
    unit = f" {how.unit}" if how.unit else ""
    return f"{shown(value)}{unit}", f"{shown(interval)}{unit if found.determined else ''}"


def probability_words(p: float) -> str:
    """A probability with two decimals that never states certainty.

    >>> probability_words(0.873), probability_words(0.9999), probability_words(0.0003)
    ('0.87', '> 0.99', '< 0.01')
    """
    return "> 0.99" if p > 0.995 else "< 0.01" if p < 0.005 else f"{p:.2f}"


def share_words(share: float) -> str:
    """A share in percent that is never rounded up to all.

    >>> share_words(0.943), share_words(0.9996), share_words(-0.2)
    ('94 %', '> 99 %', '-20 %')
    """
    return "> 99 %" if share >= 0.995 else f"{number_text(100.0 * share, 0)} %"


def signed(z: float) -> str:
    """A number of standard uncertainties, with one decimal below ten and no more than three digits.

    >>> signed(3.14), signed(-41.7), signed(1.0e4), signed(-0.04)
    ('+3.1', '-42', '> 999', '0.0')
    """
    if abs(z) > 999.0:
        return "> 999" if z > 0 else "< -999"
    return number_text(z, 1 if abs(z) < 9.95 else 0, signed=True)


def range_words(value: Reported) -> str:
    """Where a number lies at the end of its range or beyond what is plausible."""
    ends = {"high": "one-sided, at its upper end", "low": "one-sided, at its lower end"}
    return ends.get(value.at_limit or "", "beyond what is plausible" if value.beyond_range else "")


# --------------------------------------------------------------------------- places and nuisances
_RIG_NUMBERS = {
    "r_drum": "drum radius",
    "inertia": "inertia at the drum",
    "lead": "lead of the screw",
    "mu_screw": "friction coefficient of the screw",
    "area_piston": "piston area",
    "p_precharge": "precharge pressure",
    "volume_gas": "gas volume",
    "eta_mesh": "mesh efficiency",
    "b_rotor": "viscous loss of the high-speed shaft",
    "k_shaft": "shaft spring",
    "c_shaft": "shaft damping",
    "inertia_rotor": "inertia of the high-speed shaft",
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

_PULL = {
    "force": "force of the spring",
    "stiffness": "stiffness of the spring",
    "mass": "mass of the counterweight",
    "friction": "friction of the restoring module",
}
"""Numbers of spring and counterweight in plain words; channels have some of the same names."""

LAWS = {
    "friction of the winch": "friction of line and drum",
    "stribeck of the winch": "friction near standstill",
    "seal_friction of the restoring": "friction of the seals",
    "friction of the drivetrain": "friction of the high-speed shaft",
    "clutch_drag of the drivetrain": "drag of the clutch",
}
"""Laws that a rig file does not state, in plain words."""


def nuisance_words(n: Nuisance, files: Sequence[str]) -> str:
    """Name of a nuisance in words, with the file of its log in place of the number.

    >>> from winchcascade.diagnosis.fit.nuisances import Nuisance
    >>> nuisance_words(Nuisance("idc", "SI", kind="zero", sd=0.1, log=1), ["a.csv", "b.csv"])
    'zero of Idc in b.csv'
    """
    name = _RIG_NUMBERS.get(n.name, n.name)
    return {
        "rig": _PULL.get(n.name, name),
        "law": LAWS.get(str(n), str(n)),
        "load": f"load of {load_words(n.load, 'ohm')}",
        "gain": f"gain of {name}",
        "timing": f"timing of {name}",
        "zero": f"zero of {name} in "
        f"{files[n.log] if 0 <= n.log < len(files) else f'log {n.log + 1}'}",
        "discrepancy": str(msgspec.structs.replace(n, name=name)),
    }[n.kind]


def channel_words(channel: str) -> str:
    """Name of a channel, or of the power of a stage.

    >>> channel_words("vdc"), channel_words("power_gen"), channel_words("power_dc")
    ('Vdc', 'power at the DC link', 'power at dc')
    """
    if channel in NAMES or not channel.startswith("power_"):
        return NAMES.get(channel, channel)
    stage = channel.removeprefix("power_")
    return f"power at the {STAGE_PLACES[stage]}" if stage in STAGE_PLACES else f"power at {stage}"


def phase_words(phase: str) -> str:
    """A phase as a text writes it."""
    return PHASES.get(phase, phase.replace("_", "-"))


def spot_words(spot: Spot, names: Mapping[str, str] = NAMES) -> str:
    """A spot of the gap: channel and phase.

    >>> spot_words(Spot("idc", "haul_in")), spot_words(Spot("idc", "payout", within_blocks=True), {})
    ('Idc during haul-in', 'idc within blocks of payout')
    """
    channel = (
        channel_words(spot.channel) if names is NAMES else names.get(spot.channel, spot.channel)
    )
    if spot.phase is None:
        return channel
    return f"{channel} {'within blocks of' if spot.within_blocks else 'during'} {phase_words(spot.phase)}"


About = Spot | Nuisance


def about_words(about: About, files: Sequence[str], names: Mapping[str, str] = NAMES) -> str:
    """What a sign of something unexplained is about.

    Parameters
    ----------
    files : names of the logs, in their order
    names : of the channels; empty for the names of the JSON
    """
    if not isinstance(about, Spot):
        return nuisance_words(about, files) if names else str(about)
    if about.effects:
        effects = call_all(about.effects, between=" and ") if names else " and ".join(about.effects)
        return effects + (f" in {about.channel}" if about.channel else "")
    if about.run is not None:
        return f"{about.channel} in {phase_words(about.phase or '')} of {files[about.run]}"
    return spot_words(about, names)


def at_words(load: float | None) -> str:
    """At which load something is so; empty for no load."""
    return "" if load is None else " in open circuit" if math.isinf(load) else f" at {load:g} ohm"


def alarm_place(alarm: Alarm, files: Sequence[str]) -> str:
    """Where a sign of something unexplained is, with its load."""
    return f"{about_words(alarm.about, files)}{at_words(alarm.about.load) if isinstance(alarm.about, Spot) else ''}"


# --------------------------------------------------------------------------- logs and comparisons
def origins_of(found: DiagnosisResult) -> list[Origin]:
    """Where the data of each log come from."""
    return [run.origin for run in found.runs]


def word_of(found: DiagnosisResult) -> str:
    """What the logs are called: `measured` where that is stated of all of them, else `log` or,
    of a power, `logged`.
    """
    word = joint_origin(origins_of(found)).word
    return "logged" if isinstance(found, StageDiagnosis) and word == "log" else word


def files_of(found: DiagnosisResult) -> list[str]:
    """Names of the logs, in their order."""
    return [run.name for run in found.runs]


def items_of(found: DiagnosisResult) -> list[str]:
    """Names of what the number of a cause is estimated from one by one: the runs or, without a
    model, their cycles.
    """
    return found.data.cycle_names if isinstance(found, StageDiagnosis) else files_of(found)


def runs_with_number(cause: NamedCause) -> list[int]:
    """Numbers of the runs that give a number of a cause."""
    runs = () if cause.stability is None else cause.stability.runs
    return [one.run for one in runs if math.isfinite(one.value)]


def has_own_simulation(found: DiagnosisResult) -> bool:
    """Whether the logs are compared with a simulation of the owner and not with the model of the
    rig file.
    """
    return isinstance(found, ModelDiagnosis) and found.own_simulation is not None


def baseline_words(found: DiagnosisResult) -> str:
    """What the logs are compared with, as in a legend."""
    return "your simulation" if has_own_simulation(found) else "model of the rig file"
