"""Numbers with as many digits as their uncertainty allows."""

from __future__ import annotations

import math

MINUS = "\u2212"


def places(u: float) -> int:
    """Decimals that a standard uncertainty allows: two of its digits, one if it begins with 3 or more (GUM 7.2.6).

    >>> places(0.0048), places(0.012), places(116.0), places(41.0)
    (3, 3, -1, -1)
    """
    lead = math.floor(math.log10(u))
    return -lead + (1 if u / 10.0**lead < 2.95 else 0)


def number(value: float | None, decimals: int) -> str:
    """Text of a number, rounded; a dash for one that does not exist.

    >>> number(7114.9, -1), number(-0.25, 1), number(None, 2)
    ('7110', '\u22120.2', '–')
    """
    if value is None or not math.isfinite(value):
        return "–"
    rounded = round(value, decimals)
    text = f"{rounded + 0.0:.{max(decimals, 0)}f}"
    return text.replace("-", MINUS)


def stated(value: float | None, u: float | None, otherwise: int) -> str:
    """Text of a value with the digits that its standard uncertainty allows, else with so many decimals.

    >>> stated(0.90337, 0.0048, 3), stated(7114.9, None, 0)
    ('0.903', '7115')
    """
    return number(value, places(u) if u else otherwise)


def uncertain(u: float | None) -> str:
    """Text of a standard uncertainty with the digits that count.

    >>> uncertain(0.00477), uncertain(115.5)
    ('0.005', '120')
    """
    return "–" if u is None else "0" if u == 0 else number(u, places(u))


def significant(value: float | None, digits: int = 3) -> str:
    """Text of a number with so many significant digits.

    >>> significant(0.000794), significant(19.6133), significant(0.0)
    ('0.000794', '19.6', '0')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return number(value, decimals)


def percent(share: float | None, decimals: int = 0) -> str:
    """Text of a share in percent, without the sign; what is above zero but rounds to it is named so.

    >>> percent(0.943), percent(0.0004), percent(None)
    ('94', '<1', '–')
    """
    if share is None:
        return "–"
    text = number(100.0 * share, decimals)
    return f"<{number(10.0**-decimals, decimals)}" if share > 0 and float(text) == 0 else text
