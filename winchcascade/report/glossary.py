"""Names of the field, each once: metrics, channels and phases with symbol, label, unit, factor,
decimals; how texts are set.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from winchcascade.core.quantity import KGCM2


class Term(NamedTuple):
    """A quantity: symbol, label, unit in which it is shown, factor from SI units to that, and
    decimals without uncertainty, None for four significant digits.
    """

    symbol: str
    label: str
    unit: str = ""
    factor: float = 1.0
    decimals: int | None = None


STAGE_PLACES = {
    "line": "line",
    "mech": "shaft",
    "gen": "DC link",
    "hyd": "hydraulic circuit",
    "ac": "AC terminals",
}
"""Where the power of a stage is taken; a stage of a rig file has its own name."""

CHANNELS = {
    "displacement": Term("x", "displacement", "m", decimals=3),
    "velocity": Term("v", "velocity", "m/s", decimals=3),
    "pressure": Term("p", "pressure", "kg/cm2", 1.0 / KGCM2, 3),
    "force": Term("F", "line tension", "N", decimals=1),
    "torque": Term("τ", "torque", "N.m", decimals=2),
    "vdc": Term("Vdc", "Vdc", "V", decimals=2),
    "idc": Term("Idc", "Idc", "A", decimals=3),
    "speed": Term("n", "speed", "rpm", decimals=1),
    "power_mech": Term("P_mech", "shaft power", "W"),
}
"""Channels of a log."""

SENSORS = {
    "pressure": "pressure sensor",
    "force": "force cell",
    "torque": "torque sensor",
    "vdc": "sensor of Vdc",
    "idc": "sensor of Idc",
}
"""What measures a channel."""

PHASES = {"payout": "payout", "hold": "hold", "haul_in": "haul-in"}
"""Phases of a cycle."""

NET = {
    "energy_payout": Term("E_payout", "line energy of the payout", "J"),
    "energy_returned": Term("E_returned", "line energy given back in haul-in", "J"),
    "energy_net": Term("E_net", "line energy from onset to next onset", "J"),
    "energy_gen_cycle": Term("E_gen, cycle", "energy at the DC link from onset to next onset", "J"),
    "eta_net": Term("η_net", "energy at the DC link over net line energy", "", 1.0, 3),
}
"""Metrics of whole cycles."""

KINDS = {
    "energy": ("E", "energy", "J", None),
    "power": ("P", "mean power", "W", None),
    "eta": ("η", "efficiency", "", 3),
}
"""Letter, label, unit and decimals of a metric by how its name begins."""


def metric(name: str) -> Term:
    """A metric of any cascade: an energy or a mean power of a stage, or an efficiency.

    >>> metric("eta_pto").symbol, metric("power_hyd").label, metric("energy_gen_cycle").symbol
    ('η_pto', 'mean power, hydraulic circuit', 'E_gen, cycle')
    """
    if name in NET:
        return NET[name]
    kind, _, place = name.partition("_")
    letter, label, unit, decimals = KINDS[kind]
    where = STAGE_PLACES.get(place, place.replace("_", " "))
    return Term(
        f"{letter}_{place}", label if kind == "eta" else f"{label}, {where}", unit, 1.0, decimals
    )


def short(name: str) -> str:
    """How a metric is called in the head of a column.

    >>> short("energy_line"), short("eta_pto")
    ('E_line', 'eta_pto')
    """
    return re.sub(r"^(energy|power)_", lambda found: f"{KINDS[found[1]][0]}_", name)


def tex(name: str) -> str:
    """Symbol of a metric in a figure.

    >>> tex("eta_trans"), tex("energy_gen_cycle")
    ('$\\\\eta_\\\\mathrm{trans}$', '$E_\\\\mathrm{gen}$')
    """
    letter, _, place = metric(name).symbol.partition(", ")[0].partition("_")
    return (
        "$" + letter.replace("η", r"\eta") + rf"_\mathrm{{{place.replace('_', chr(92) + 'to ')}}}$"
    )


def upper(text: str) -> str:
    """A text that begins with a capital letter, unless its first word is a symbol or the name of a
    field.

    >>> upper("no fault was found"), upper("k_e agrees")
    ('No fault was found', 'k_e agrees')
    """
    return text if "_" in text.partition(" ")[0] else text[:1].upper() + text[1:]


# -------------------------------------------------------------------- how a page sets plain texts
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_PLACES = ("line", "mech", "gen", "trans", "pto", "net", "payout", "returned", "hyd", "ac")
"""What the name of a metric ends with: its stage, its stages, or its part of a whole cycle."""

_METRIC = re.compile(
    rf"(?<![\w/.-])(?:(?:energy|power|eta|E|P)_(?:gen_cycle|{'|'.join(_PLACES)}))(?![\w/]|\.\w|=\d)"
)
_SIGNS: tuple[tuple[str, str], ...] = (
    (r"(?<=\d) ohm\b(?!\.\w)", "\u00a0Ω"),
    (r"(?<!--load-)(?<!\w-)\bohm\b(?!\.\w)", "Ω"),
    (r"\b(N|m)\.(?=m\b|s/rad|s/m\b)", r"\1·"),
    (r"kg/cm2\b", "kg/cm²"),
    (r"\bR2\b", "R²"),
    (r"(^| )\+- ", r"\1± "),
    (r"(?<![\w.)\]-])-(?=\d)", "\u2212"),
    (r"(?<=\d) %", "\u00a0%"),
    (r"`([^`]*)`", r"\1"),
)
"""What is written with plain letters, and the sign for it."""


def typeset(text: str) -> str:
    """A plain text with symbols for names of metrics and signs for units; names of files and
    effects stay.

    >>> typeset("run 9 ohm.csv"), typeset("--uncertainty eta_pto=0.001")
    ('run 9 ohm.csv', '--uncertainty eta_pto=0.001')
    >>> typeset("36 ohm: eta_pto drops by -0.01 +- 0.02 N.m, see energy_line.csv"), typeset("-"), typeset("2.5e-13")
    ('36\\xa0Ω: η_pto drops by −0.01 ± 0.02 N·m, see energy_line.csv', '–', '2.5×10⁻¹³')
    >>> typeset("+- 2 J")
    '± 2 J'
    """
    if text == "-":
        return "–"
    for plain, sign in _SIGNS:
        text = re.sub(plain, sign, text)
    text = re.sub(
        r"(?<=\d)e([-+]\d+)\b", lambda found: f"×10{str(int(found[1])).translate(RAISED)}", text
    )
    return _METRIC.sub(lambda found: _symbol(found[0]), text)


def _symbol(name: str) -> str:
    return name.replace("gen_cycle", "gen, cycle") if name[0] in "EP" else metric(name).symbol


SUBSCRIPTS = ("gen, cycle", *_PLACES, "max", "min", "mean", "hold")
"""Subscripts of symbols."""

SUBSCRIPT = re.compile(rf"(?<![\w/.-])([EPFvpητ])_({'|'.join(SUBSCRIPTS)})\b(?![\w/]|\.\w)")
"""A symbol with a subscript."""

_UNSHOWN = re.compile(
    "[\x00-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""Control characters, marks of writing direction, and bytes of a name that are no text."""

MAX_CHARACTERS = 1000
"""A text longer than this is cut: no cell may be taller than a page."""


def clean(text: str) -> str:
    """A text with the code of each character that cannot be shown, and of reasonable length.

    >>> clean("a\\x07b")
    'a⟨U+0007⟩b'
    """
    text = _UNSHOWN.sub(
        lambda found: " " if found[0] in "\n\r\t" else f"⟨U+{ord(found[0]):04X}⟩", text
    )
    if len(text) > MAX_CHARACTERS:
        text = f"{text[:MAX_CHARACTERS]} … ({len(text) - MAX_CHARACTERS} characters more)"
    return text
