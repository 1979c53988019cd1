"""The load that a log states of itself, in a column of a simulated log or in a property of its
file.
"""

from __future__ import annotations

import math
import re
import unicodedata

import numpy as np

from winchcascade.core.quantity import is_load
from winchcascade.core.run import LOAD_HEADER, Finding
from winchcascade.ingest.assign import load_column
from winchcascade.ingest.source import LogSource, LogTable

_NOT_USED = "not used: the load counts as unknown; give it by --load-ohm or a campaign.toml"
_LOAD_KEYS = {"load", "rload", "loadresistance", "loadresistor", "resistiveload", "rl"}
_OPEN = {"inf", "infinity", "infinite", "open", "opencircuit", "noload"}
_PREFIX = {"m": 1e-3, "k": 1e3, "K": 1e3, "M": 1e6}
_OHM = r"(?P<prefix>[mkMK]?)(?:[Oo][Hh][Mm][Ss]?|\u03a9|\u03c9)"
_QUANTITY = re.compile(
    rf"(?P<number>\d*[.,]?\d+(?:[eE][-+]?\d+)?|\d+[.,])\s*(?:{_OHM}(?![^\W\d_])(?P<remark>.*))?",
    re.DOTALL,
)
"""A number, and its unit of resistance, behind which a remark may follow."""


def stated_load(source: LogSource, table: LogTable) -> tuple[float | None, str, list[Finding]]:
    """The load that a log states, by the column of a simulated log or a property of the file, its
    source and findings on it.

    It is never taken from Vdc over Idc. A property that gives none is a finding. [ohm]
    """
    findings = []
    written = load_column(source.headers)
    if written is not None:
        texts = table.texts.get(written)
        loads = (
            np.unique(table.values[written]).tolist() if texts is None else [*map(_ohm, set(texts))]
        )
        if len(loads) == 1 and loads[0] is not None and is_load(loads[0]):
            return loads[0], f"column {LOAD_HEADER} of the log", []
        message = f"column {LOAD_HEADER} does not hold one load in all rows"
        findings.append(Finding("load_mismatch", message, _NOT_USED))
    for key, value in source.properties.items():
        letters = "".join(c for c in unicodedata.normalize("NFKC", key) if c.isalpha())
        unit = re.search(f"{_OHM}$", letters)
        if letters[: unit.start() if unit else None].casefold() not in _LOAD_KEYS:
            continue
        ohm = _ohm(value, unit["prefix"] if unit else "")
        if ohm is not None:
            return ohm, f"property {key} of the file", []
        message = f"property {key[:60]} of the file is {str(value)[:60]!r}; expected one resistance such as 9 ohm, or inf"
        findings.append(Finding("load_mismatch", message, _NOT_USED))
    return None, "unknown", findings


def _ohm(value: str | float, prefix: str = "") -> float | None:
    """Resistance that a property gives, None where it gives none or more than one. [ohm]

    Parameters
    ----------
    prefix : of the unit in the name of the property

    Examples
    --------
    >>> _ohm("9 ohm / 50 Hz"), _ohm("0.018 kOhm"), _ohm("1 kW"), _ohm("9000", "m"), _ohm("open circuit")
    (9.0, 18.0, None, 9.0, inf)
    """
    text = unicodedata.normalize("NFKC", str(value)).strip()
    if text.casefold().replace(" ", "").removesuffix("ohm") in _OPEN:
        return math.inf
    found = _QUANTITY.fullmatch(text)
    if found is None or re.fullmatch(
        r"[1-9]\d*,\d{3}", found["number"]
    ):  # a decimal comma or one of thousands
        return None
    if re.search(rf"\d\s*{_OHM}", found["remark"] or ""):
        return None
    ohm = float(found["number"].replace(",", ".")) * _PREFIX.get(
        prefix if found["prefix"] is None else found["prefix"], 1.0
    )
    return ohm if 0.0 < ohm < math.inf else None
