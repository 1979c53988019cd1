"""Formulas of rig files and tables: sums and differences of products and quotients of named quantities and constants."""

from __future__ import annotations

import math
import re
from collections.abc import Collection

import msgspec

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.quantity import find_unit
from winchcascade.core.toml_file import check_keys

_FACTOR = re.compile(
    r"\s*(?P<sign>[-+*/]?)\s*"
    r"(?:(?P<name>[^\W\d]\w*)|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?:\s*(?P<unit>[^\W\d]\w*|%))?)\s*"
)
"""One factor with the sign before it: the name of a quantity, or a number with or without a unit."""


class Product(msgspec.Struct, frozen=True):
    """One term of a formula: a constant times some quantities, divided by others.

    `constant` is in SI units and has the sign of the term; `scaled` states whether the formula writes a number.
    """

    constant: float
    times: tuple[str, ...] = ()
    over: tuple[str, ...] = ()
    scaled: bool = False


class Formula(msgspec.Struct, frozen=True):
    """A sum of terms, and its text."""

    text: str
    terms: tuple[Product, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities of all terms."""
        return tuple(dict.fromkeys(name for term in self.terms for name in (*term.times, *term.over)))


def read_formula(text: str, known: Collection[str], place: str, fault: type[WinchcascadeError]) -> Formula:
    """Read a formula; a number without a unit is in SI units.

    A fault with the place of the text for another text, a name that is not known, or a unit that is none.

    >>> from winchcascade.core.errors import RigError
    >>> read_formula("60 V * i - p / 2", ("i", "p"), "here", RigError).terms
    (Product(constant=60.0, times=('i',), over=(), scaled=True), Product(constant=-0.5, times=('p',), over=(), scaled=True))
    """
    terms: list[Product] = []
    end = 0
    while end < len(text) or not terms:
        found = _FACTOR.match(text, end)
        sign = "" if found is None else found["sign"]
        if found is None or (sign in ("*", "/") if not terms else not sign):
            raise fault(
                f"{place}: {text[end:].strip()[:40]!r} is no term of a formula; expected names and numbers joined by *, /, + "
                'and -, such as "torque * speed" or "60 V * current - loss".'
            )
        if sign not in ("*", "/"):
            terms.append(Product(-1.0 if sign == "-" else 1.0))
        terms[-1] = _with_factor(terms[-1], found, known, place, fault)
        end = found.end()
    return Formula(text.strip(), tuple(terms))


def _with_factor(
    term: Product, found: re.Match[str], known: Collection[str], place: str, fault: type[WinchcascadeError]
) -> Product:
    """A term with one more factor."""
    divides = found["sign"] == "/"
    if found["name"]:
        check_keys([found["name"]], known, f"{place}:", fault)
        side = "over" if divides else "times"
        return msgspec.structs.replace(term, **{side: (*getattr(term, side), found["name"])})
    unit = find_unit(found["unit"] or "1")
    if unit is None or unit.offset:
        raise fault(f"{place}: the unit {found['unit']!r} is unknown; expected a number, or one with a unit such as V.")
    value = float(found["number"]) * unit.factor
    if not 0.0 < value < math.inf:
        raise fault(f"{place}: {found[0].strip()!r} is no constant; expected a number above 0.")
    constant = term.constant / value if divides else term.constant * value
    return msgspec.structs.replace(term, constant=constant, scaled=True)
