"""The load that a log states of itself, in a column of a simulated log or in a property of its file."""

from __future__ import annotations

import math
import re
import unicodedata

import numpy as np

from winchcascade.core.quantity import is_load
from winchcascade.core.run import LOAD_HEADER, Finding
from winchcascade.ingest.assign import load_column
from winchcascade.ingest.source import LogSource, LogTable


def stated_load(source: LogSource, table: LogTable) -> tuple[float | None, str, list[Finding]]:
    """The load that a log states, by the column of a simulated log or a property of the file, its source and findings on it.

    It is never taken from Vdc over Idc. A property that gives none is a finding. [ohm]
    """
    findings = []
    written = load_column(source.headers)
    if written is not None:
        loads = np.unique(table.values[written]).tolist()
        if np.isnan(loads).all() and source.texts is not None:  # readers of columns take inf for no number
            loads = [_ohm(text, "ohm") for text in set(source.texts(written, []))]
        if len(loads) == 1 and loads[0] is not None and is_load(loads[0]):
            return loads[0], f"column {LOAD_HEADER} of the log", []
        findings.append(
            Finding(
                "load_mismatch",
                f"column {LOAD_HEADER} does not hold one load in all rows",
                "not used: the load counts as unknown; give it by --load-ohm or a campaign.toml",
            )
        )
    for key, value in source.properties.items():
        letters = "".join(c for c in unicodedata.normalize("NFKC", key) if c.isalpha())
        named = _RESISTANCE_UNIT.search(letters)
        if letters[: named.start() if named else None].casefold() in _LOAD_KEYS:
            ohm = _ohm(value, named.group() if named else "ohm")
            if ohm is not None:
                return ohm, f"property {key} of the file", []
            findings.append(
                Finding(
                    "load_mismatch",
                    f"property {key[:60]} of the file is {str(value)[:60]!r}; expected one resistance such as 9 ohm, or inf",
                    "not used: the load counts as unknown; give it by --load-ohm or a campaign.toml",
                )
            )
    return None, "unknown", findings


_LOAD_KEYS = {"load", "rload", "loadresistance", "loadresistor", "resistiveload", "rl"}

_OPEN = {"inf", "infinity", "infinite", "open", "opencircuit", "noload"}
"""Words by which a file states that no load is connected."""

_RESISTANCE_UNIT = re.compile(r"([mkMK]?)(?:[Oo][Hh][Mm][Ss]?|\u03a9|\u03c9)$")
"""A unit of resistance with its prefix: m is milli, M mega."""

_PREFIX = {"": 1.0, "m": 1e-3, "k": 1e3, "K": 1e3, "M": 1e6}

_QUANTITY = re.compile(r"([-+]?\d*[.,]?\d+(?:[eE][-+]?\d+)?|\d+[.,])\s*([^\W\d_]*)(.*)", re.DOTALL)
"""A number, its unit, and what follows."""


def _ohm(value: str | float, unit: str) -> float | None:
    """Resistance that a property gives, None where it gives none or more than one. [ohm]

    Parameters
    ----------
    unit : of resistance, for a number without one

    Examples
    --------
    >>> _ohm("9 ohm / 50 Hz", "ohm"), _ohm("0.018 kOhm", "ohm"), _ohm("1 kW", "ohm"), _ohm("open circuit", "ohm")
    (9.0, 18.0, None, inf)
    """
    text = unicodedata.normalize("NFKC", str(value)).strip()
    if text.casefold().replace(" ", "").removesuffix("ohm") in _OPEN:
        return math.inf
    quantity = _QUANTITY.fullmatch(text)
    if quantity is None:
        return None
    number, named, remark = quantity.groups()
    prefix = _RESISTANCE_UNIT.fullmatch(named or unit)
    thousands = (
        re.fullmatch(r"[-+]?[1-9]\d*,\d{3}", number) is not None
    )  # a decimal comma or not cannot be distinguished
    several = bool(remark.strip()) and (
        not named or re.search(r"\d\s*[mkM]?(?:ohm|\u03a9)", remark.casefold()) is not None
    )
    if prefix is None or thousands or several:
        return None
    ohm = float(number.replace(",", ".")) * _PREFIX[prefix.group(1)]
    return ohm if 0.0 < ohm < math.inf else None
