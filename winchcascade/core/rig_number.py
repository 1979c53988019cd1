"""Read the numbers of a rig file, each with unit, source and uncertainty, and say in one sentence what is wrong with one."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from itertools import product
from typing import Any

import msgspec

from winchcascade.core.errors import RigError
from winchcascade.core.quantity import Calibrated, Quantity, find_unit
from winchcascade.core.rig_file import Measure
from winchcascade.core.toml_text import struct_fields

HUGE = 1e12
"""No range, accuracy or uncertainty of a rig is larger, in SI units."""


class _Prior(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A number before its first calibration, in the unit of the number."""

    value: float
    u: float | None = None
    source: str = ""


class _Calibrated(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a calibrated number comes from."""

    log: str
    sha256: str
    prior: _Prior | None = None


class _Number(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A number as a rig file writes it."""

    value: float
    unit: str
    source: str = ""
    u: float | None = None
    u_percent: float | None = None
    limits: float | None = None
    limits_percent: float | None = None
    calibrated: _Calibrated | None = None


def convert(value: object, kind: Any, place: str) -> Any:
    """Check a value against a type; msgspec's finding becomes one sentence with the place in the file."""
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as fault:
        what, _, deeper = str(fault).partition(" - at `$")
        inner = re.sub(r"^\.", " ", deeper.rstrip("`"))
        raise RigError(f"{place}{inner}: {_in_words(what, None if inner else kind)}.") from None


_TYPES = {
    "float": "a number", "int": "a whole number", "str": "a text", "bool": "true or false", "object": "a table",
    "array": "a list",
}  # fmt: skip
"""Types of TOML in words."""


def _in_words(what: str, kind: Any) -> str:
    """A finding of msgspec in words; `kind` is the type that was expected, None for a part of it."""
    if found := re.fullmatch(r"Expected `([^`]*)`, got `([^`]*)`", what):
        expected = [_TYPES.get(name, name) for name in found[1].split(" | ") if name != "null"]
        return f"expected {' or '.join(expected)}, found {_TYPES.get(found[2], found[2])}"
    if found := re.fullmatch(r"Object contains unknown field `([^`]*)`", what):
        fields = [f.encode_name for f in struct_fields(kind)] if isinstance(kind, type(msgspec.Struct)) else []
        return f"{found[1]} is no entry here" + (f"; expected {', '.join(fields)}" if fields else "")
    if found := re.fullmatch(r"Object missing required field `([^`]*)`", what):
        return f"the entry {found[1]} is missing"
    return f"{what[:1].lower()}{what[1:]}"


UNCERTAINTIES = ("u", "u_percent", "limits", "limits_percent")
"""Keys of the uncertainty of a number, of which one is stated: a standard uncertainty, or the maker's +- limits."""


def check_replaced(values: Mapping[str, object], place: str) -> None:
    """Reject a tolerance, which does not state whether it is a standard uncertainty or a limit."""
    for load, percent in product(("", "load_"), ("", "_percent")):
        if (old := f"{load}tolerance{percent}") in values:
            raise RigError(
                f"{place} {old}: a tolerance is not read; write {load}u{percent} for one standard uncertainty, or "
                f"{load}limits{percent} for the maker's +- limits."
            )


def number_of(value: object, place: str) -> float:
    """A value that must be a finite number; RigError with its place."""
    return finite(convert(value, float, place), place)


def finite(value: float, place: str) -> float:
    """A number that must be finite; RigError with its place."""
    if not math.isfinite(value):
        raise RigError(f"{place} is {value}; expected a finite number.")
    return value


def quantity(value: object, place: str, measure: Measure) -> Quantity:
    """Read a number with unit, source and uncertainty, in SI units; RigError with its place for one that cannot be used."""
    if not isinstance(value, dict):
        raise RigError(f'{place} is {value!r}; expected {{ value = ..., unit = "...", source = "..." }}.')
    check_replaced(value, place)
    number: _Number = convert(value, _Number, place)
    unit = find_unit(number.unit)
    if unit is None or unit.dimension != measure.dimension:
        raise RigError(f"{place}: the unit {number.unit!r} is none of {str(measure.dimension).replace('_', ' ')}.")
    in_si = possible(finite(number.value, place) * unit.factor + unit.offset, place, measure)
    calibrated = _calibrated(number, f"{place} calibrated", measure)
    stated = [key for key in UNCERTAINTIES if getattr(number, key) is not None]
    if not stated:
        return Quantity(in_si, number.unit, number.source, None, calibrated)
    if len(stated) > 1:
        raise RigError(f"{place} has {' and '.join(stated)}; expected one of them, leave the others out.")
    key, size = stated[0], getattr(number, stated[0])
    half = size * (abs(in_si) / 100.0 if key.endswith("_percent") else unit.factor)
    if not 0.0 <= half <= HUGE:
        raise RigError(f"{place}: {key} is {size:g}; expected a number that is not negative.")
    limits = key.startswith("limits")
    return Quantity(in_si, number.unit, number.source, half / math.sqrt(3.0) if limits else half, calibrated, limits)


_SHA256 = re.compile("([0-9a-f]{64})?")


def _calibrated(number: _Number, place: str, measure: Measure) -> Calibrated | None:
    """The record of a calibrated number, its prior in SI units."""
    record = number.calibrated
    if record is None:
        return None
    if _SHA256.fullmatch(record.sha256) is None:
        raise RigError(
            f"{place}.sha256 is {record.sha256!r}; expected the 64 hexadecimal digits of the SHA-256 of the log, or "
            '"" where the log is no file.'
        )
    if record.prior is None:
        return Calibrated(record.log, record.sha256)
    prior = {"unit": number.unit, **msgspec.structs.asdict(record.prior)}
    return Calibrated(record.log, record.sha256, quantity(prior, f"{place}.prior", measure))


def possible(value: float, place: str, measure: Measure) -> float:
    """A number that must be possible for what it measures [SI unit]; RigError with its place."""
    if not measure.holds(value):
        raise RigError(f"{place} is {value:g}; expected {measure.words}.")
    return value
