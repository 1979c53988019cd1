"""Numbers with as many digits as their uncertainty allows, and sentences that begin with a capital."""

from __future__ import annotations

import math

MINUS = "\u2212"


class NumberText(str):
    """Text of a number, or of the two ends of an interval, that keeps the values before they were rounded.

    `unit` is the one that the text ends in, "" for a text without a unit.
    """

    values: tuple[float, ...]
    unit: str

    def __new__(cls, text: str, *values: float | None, unit: str = "") -> NumberText:
        """Make the text of some values; None for one that does not exist."""
        made = super().__new__(cls, text)
        made.values = tuple(math.nan if value is None else value for value in values)
        made.unit = unit
        return made


def places(u: float) -> int:
    """Decimals that a standard uncertainty allows: two of its digits, one if it begins with 3 or more (GUM 7.2.6).

    >>> places(0.0048), places(0.012), places(116.0), places(41.0)
    (3, 3, -1, -1)
    """
    lead = math.floor(math.log10(u))
    return -lead + (1 if u / 10.0**lead < 2.95 else 0)


def number(value: float | None, decimals: int) -> NumberText:
    """Text of a number, rounded; a dash for one that does not exist, a power of ten for a very large or small one.

    >>> number(7114.9, -1), number(-0.25, 1), number(None, 2), number(2.5e-13, 14)
    ('7110', '\u22120.2', '–', '2.5×10⁻¹³')
    >>> number(7114.9, -1).values
    (7114.9,)
    """
    return NumberText(_rounded(value, decimals), value)


def _rounded(value: float | None, decimals: int) -> str:
    if value is None or not math.isfinite(value):
        return "–"
    if value and (abs(value) >= _LARGE or (decimals > _LONG and abs(value) < 1.0)):
        return _power_of_ten(value, decimals)
    rounded = round(value, decimals)
    return f"{rounded + 0.0:.{max(decimals, 0)}f}".replace("-", MINUS)


_LARGE, _LONG = 1e8, 7
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _power_of_ten(value: float, decimals: int) -> str:
    value = round(value, decimals)
    if value == 0:
        return "0"
    digits = min(max(decimals + math.floor(math.log10(abs(value))), 0), 15)
    mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{mantissa.replace('-', MINUS)}×10{str(int(exponent)).translate(_RAISED)}"


def interval_text(low: float, high: float, u: float) -> NumberText:
    """Text of an interval with the digits that a standard uncertainty allows.

    >>> interval_text(0.89396, 0.91278, 0.0048)
    '0.894 to 0.913'
    """
    return NumberText(f"{number(low, places(u))} to {number(high, places(u))}", low, high)


def stated(value: float | None, u: float | None, otherwise: int) -> NumberText:
    """Text of a value with the digits that its standard uncertainty allows, else with so many decimals.

    >>> stated(0.90337, 0.0048, 3), stated(7114.9, None, 0), stated(0.0012, None, 3)
    ('0.903', '7115', '0.0012')
    """
    if u and math.isfinite(u):
        return number(value, places(u))
    if value and math.isfinite(value) and abs(value) < 10.0 ** (1 - otherwise):
        return significant(value, 2)
    return number(value, otherwise)


def of_many(value: float | None, u: float | None, otherwise: int) -> NumberText:
    """Text of one value among its like: at least three digits, also where an error common to all is larger.

    >>> of_many(90.21, 11.0, 0), of_many(0.90337, 0.0048, 3)
    ('90.2', '0.903')
    """
    if not value or not u or not math.isfinite(value):
        return stated(value, u, otherwise)
    return number(value, max(places(u), 2 - math.floor(math.log10(abs(value)))))


def uncertain(u: float | None) -> NumberText:
    """Text of a standard uncertainty with the digits that count.

    >>> uncertain(0.00477), uncertain(115.5)
    ('0.005', '120')
    """
    if u is None or not math.isfinite(u):
        return number(None, 0)
    return number(u, 0 if u == 0 else places(u))


def significant(value: float | None, digits: int = 3) -> NumberText:
    """Text of a number with so many significant digits.

    >>> significant(0.000794), significant(19.6133), significant(0.0)
    ('0.000794', '19.6', '0')
    """
    if not value or not math.isfinite(value):
        return number(value, 0)
    rounded = float(f"{value:.{digits - 1}e}")  # 0.9996 has its first digit before the point once rounded
    return NumberText(number(rounded, digits - 1 - math.floor(math.log10(abs(rounded)))), value)


def upper(text: str) -> str:
    """A text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def percent(share: float | None, decimals: int = 0) -> NumberText:
    """Text of a share in percent, without the sign; what is above zero but rounds to it is named so.

    >>> percent(0.943), percent(0.0004), percent(None)
    ('94', '<1', '–')
    """
    if share is None or not math.isfinite(share):
        return number(None, decimals)
    text = number(100.0 * share, decimals)
    small = share > 0 and float(text) == 0
    return NumberText(f"<{number(10.0**-decimals, decimals)}" if small else text, 100.0 * share)
