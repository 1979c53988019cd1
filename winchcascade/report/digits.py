"""Numbers with as many digits as their uncertainty allows, and sentences that begin with a capital."""

from __future__ import annotations

import math
from collections.abc import Iterable

MINUS = "\u2212"


class NumberText(str):
    """Text of a number, of the two ends of an interval, or of a number with its uncertainty; keeps the values behind it.

    `unit` is the one that the text ends in, "" for a text without a unit. `decimals` are those that an uncertainty allows, None
    where there is no uncertainty. `form` holds braces for the values.
    """

    values: tuple[float, ...]
    unit: str
    decimals: int | None
    form: str

    def __new__(
        cls, text: str, *values: float | None, unit: str = "", decimals: int | None = None, form: str = "{}"
    ) -> NumberText:
        """Make the text of some values; None for one that does not exist."""
        made = super().__new__(cls, text)
        made.values = tuple(math.nan if value is None else value for value in values)
        made.unit, made.decimals, made.form = unit, decimals, form
        return made

    def at(self, decimals: int) -> NumberText:
        """The same values with other decimals.

        >>> stated(0.90337, 0.0048, 3).at(2)
        '0.90'
        """
        texts = [_rounded(value, decimals) for value in self.values]
        shown = self.form.format(*texts)
        if self.form == SIGNED and not any(digit in texts[0] for digit in "123456789"):
            shown = texts[0]
        return NumberText(shown, *self.values, unit=self.unit, decimals=decimals, form=self.form)


SIGNED = "+{}"
"""Form of a number above zero with its sign, which one that is rounded to zero does not have."""

PLUS_MINUS = "{} ± {}"
"""Form of a number with its standard uncertainty."""


def places(u: float) -> int:
    """Decimals that a standard uncertainty allows: those of its first two digits (GUM 7.2.6).

    >>> places(0.0048), places(0.012), places(116.0), places(41.0), places(0.0996)
    (4, 3, -1, 0, 2)
    """
    return 1 - math.floor(math.log10(float(f"{u:.1e}")))


def with_uncertainty(value: float | None, u: float | None, otherwise: int) -> NumberText:
    """Text of a value with its standard uncertainty, where that is known.

    >>> with_uncertainty(0.90337, 0.0048, 3), with_uncertainty(0.90337, None, 3)
    ('0.9034 ± 0.0048', '0.903')
    """
    if value is None or not u or not math.isfinite(u):
        return stated(value, u, otherwise)
    return NumberText("", value, u, form=PLUS_MINUS).at(places(u))


def common_decimals(cells: Iterable[object]) -> int | None:
    """Decimals of all numbers of a column: those that the smallest of their uncertainties allows, which hides nothing.

    Of a much smaller one than the others, one more than the median allows. None without uncertainties.

    >>> common_decimals([stated(0.5, 0.011, 3), stated(0.25, 0.0048, 3), "-"]), common_decimals([number(1.0, 2)])
    (4, None)
    """
    allowed = sorted(cell.decimals for cell in cells if isinstance(cell, NumberText) and cell.decimals is not None)
    return min(allowed[-1], allowed[len(allowed) // 2] + 1) if allowed else None


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
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Digits of exponents."""


def _power_of_ten(value: float, decimals: int) -> str:
    value = round(value, decimals)
    if value == 0:
        return "0"
    digits = min(max(decimals + math.floor(math.log10(abs(value))), 0), 15)
    mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{mantissa.replace('-', MINUS)}×10{str(int(exponent)).translate(RAISED)}"


def interval_text(low: float, high: float, u: float) -> NumberText:
    """Text of an interval with the digits that a standard uncertainty allows.

    >>> interval_text(0.89396, 0.91278, 0.0048)
    '0.8940 to 0.9128'
    """
    return NumberText("", low, high, form="{} to {}").at(places(u))


def stated(value: float | None, u: float | None, otherwise: int) -> NumberText:
    """Text of a value with the digits that its standard uncertainty allows, else with a given number of decimals.

    >>> stated(0.90337, 0.0048, 3), stated(7114.9, None, 0), stated(0.0012, None, 3)
    ('0.9034', '7115', '0.0012')
    """
    if u and math.isfinite(u):
        return NumberText("", value).at(places(u))
    if value and math.isfinite(value) and abs(value) < 10.0 ** (1 - otherwise):
        return significant(value, 2)
    return number(value, otherwise)


def of_many(value: float | None, u: float | None, otherwise: int) -> NumberText:
    """Text of one value among its like: at least three digits, also where an error common to all is larger.

    >>> of_many(90.21, 11.0, 0), of_many(0.90337, 0.0048, 3)
    ('90.2', '0.9034')
    """
    if not value or not u or not math.isfinite(value):
        return stated(value, u, otherwise)
    return NumberText("", value).at(max(places(u), 2 - math.floor(math.log10(abs(value)))))


def with_sign(text: NumberText) -> NumberText:
    """A number with a plus where it is above zero.

    >>> with_sign(number(0.02, 2)), with_sign(number(0.001, 2))
    ('+0.02', '0.00')
    """
    if not text.values[0] > 0.0 or not any(digit in text for digit in "123456789"):
        return text
    return NumberText(f"+{text}", *text.values, unit=text.unit, decimals=text.decimals, form=SIGNED)


def uncertain(u: float | None) -> NumberText:
    """Text of a standard uncertainty with the digits that count.

    >>> uncertain(0.00477), uncertain(115.5)
    ('0.0048', '120')
    """
    if not u or not math.isfinite(u):
        return number(u, 0)
    return NumberText("", u).at(places(u))


def significant(value: float | None, digits: int = 3) -> NumberText:
    """Text of a number with a given number of significant digits.

    >>> significant(0.000794), significant(19.6133), significant(0.0)
    ('0.000794', '19.6', '0')
    """
    if not value or not math.isfinite(value):
        return number(value, 0)
    rounded = float(f"{value:.{digits - 1}e}")  # 0.9996 has its first digit before the point once rounded
    return NumberText(number(rounded, digits - 1 - math.floor(math.log10(abs(rounded)))), value)


def upper(text: str) -> str:
    """A text that begins with a capital letter, unless its first word is a symbol or the name of a field.

    >>> upper("no fault was found"), upper("k_e agrees")
    ('No fault was found', 'k_e agrees')
    """
    return text if "_" in text.partition(" ")[0] else text[:1].upper() + text[1:]


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
