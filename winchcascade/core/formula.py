"""Formulas of rig files and tables: sums of products, quotients and powers of named quantities
and constants.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from itertools import product
from typing import NoReturn

import msgspec

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.quantity import Unit, find_unit
from winchcascade.core.toml_file import check_keys

_TOKEN = re.compile(
    r"\s*(?:(?P<name>[^\W\d]\w*)|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<sign>\*\*|[-+*/^()]))"
)
_UNIT = re.compile(r"\s*(%|[^\W\d]\w*(?:/[^\W\d]\w*)?)")

HIGHEST_POWER = 9
"""Largest exponent of a formula."""


class Product(msgspec.Struct, frozen=True):
    """One term of a formula: a constant times some quantities, divided by others.

    `constant` is in SI units and has the sign of the term; `scaled` states whether the formula
    writes a number.
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
        return tuple(
            dict.fromkeys(name for term in self.terms for name in (*term.times, *term.over))
        )


def read_formula(
    text: str,
    known: Collection[str],
    place: str,
    fault: type[WinchcascadeError],
    unit_of: Callable[[str], Unit | None] = find_unit,
) -> Formula:
    """Read a formula; a number without a unit is in SI units, and factors are joined by `*`, by `/`
    or by a blank.

    A fault with the place of the text for another text, a name that is not known, or a unit that is
    none.

    >>> from winchcascade.core.errors import RigError
    >>> read_formula("60 V * i - p / 2", ("i", "p"), "here", RigError).terms
    (Product(constant=60.0, times=('i',), over=(), scaled=True), Product(constant=-0.5, times=('p',), over=(), scaled=True))
    >>> read_formula("p / (2 i^2)", ("i", "p"), "here", RigError).terms
    (Product(constant=0.5, times=('p',), over=('i', 'i'), scaled=True),)
    """
    reader = _Reader(text, known, place, fault, unit_of)
    terms = reader.sum()
    if reader.text[reader.end :].strip():
        reader.reject()
    return Formula(text.strip(), terms)


Terms = tuple[Product, ...]
"""A sum of products."""


class _Reader(msgspec.Struct):
    """Reads the text of a formula from its begin on; `end` is where the rest begins."""

    text: str
    known: Collection[str]
    place: str
    fault: type[WinchcascadeError]
    unit_of: Callable[[str], Unit | None]
    end: int = 0

    def reject(self) -> NoReturn:
        """Reject what cannot be read on."""
        raise self.fault(
            f"{self.place}: {self.text[self.end :].strip()[:40]!r} is no term of a formula; "
            f"expected names and numbers with "
            '*, /, ^, +, - and brackets, such as "torque * speed", "60 V * current - loss" or "p '
            '/ (0.5 rho a u^3)".'
        )

    def sign(self, *signs: str) -> str:
        """Take one of some signs if it comes next; empty otherwise."""
        token = _TOKEN.match(self.text, self.end)
        if token is None or token["sign"] not in signs:
            return ""
        self.end = token.end()
        return token["sign"]

    def sum(self) -> Terms:
        """Terms up to what is no sign between terms."""
        sign, terms = self.sign("+", "-"), Terms()
        while True:
            factor = Product(-1.0 if sign == "-" else 1.0)
            terms += tuple(_times(factor, term) for term in self.product())
            if not (sign := self.sign("+", "-")):
                return terms

    def product(self) -> Terms:
        """Factors of a term, multiplied out."""
        terms = self.power()
        while True:
            begin = self.end
            sign = self.sign("*", "/")
            token = _TOKEN.match(self.text, self.end)
            if not sign and (token is None or (token["sign"] or "(") != "("):
                return terms
            factor = self.power()
            if sign == "/" and len(factor) > 1:
                self.end = begin
                self.reject()
            factor = (_inverse(factor[0]),) if sign == "/" else factor
            terms = tuple(_times(one, other) for one, other in product(terms, factor))

    def power(self) -> Terms:
        """A name, a number with or without a unit, or a sum in brackets, and its power."""
        base = self.atom()
        if not self.sign("^", "**"):
            return base
        down, token = self.sign("-"), _TOKEN.match(self.text, self.end)
        if (
            token is None
            or not (token["number"] or "").isdecimal()
            or not 0 < int(token["number"]) <= HIGHEST_POWER
        ):
            self.reject()
        terms: Terms = (Product(1.0),)
        self.end = token.end()
        for _ in range(int(token["number"])):
            terms = tuple(_times(one, other) for one, other in product(terms, base))
        if down and len(terms) > 1:
            self.reject()
        return (_inverse(terms[0]),) if down else terms

    def atom(self) -> Terms:
        """A name, a number with or without a unit, or a sum in brackets."""
        if self.sign("("):
            terms = self.sum()
            return terms if self.sign(")") else self.reject()
        token = _TOKEN.match(self.text, self.end)
        if token is None or token["sign"]:
            self.reject()
        self.end = token.end()
        if token["name"]:
            check_keys([token["name"]], self.known, f"{self.place}:", self.fault)
            return (Product(1.0, (token["name"],)),)
        value = float(token["number"]) * self.unit()
        if not 0.0 < value < math.inf:
            raise self.fault(
                f"{self.place}: {token[0].strip()!r} is no constant; expected a number above 0."
            )
        return (Product(value, scaled=True),)

    def unit(self) -> float:
        """Factor of the unit that comes next; 1 without one, as the name of a quantity is none."""
        word = _UNIT.match(self.text, self.end)
        first, _, below = word[1].partition("/") if word else ("", "", "")
        if word is None or first in self.known:
            return 1.0
        text = first if below in self.known else word[1]
        unit = self.unit_of(text)
        if unit is None or unit.offset:
            raise self.fault(
                f"{self.place}: the unit {text!r} is unknown; expected a number, or one with a "
                f"unit such as V."
            )
        self.end = word.start(1) + len(text)
        return unit.factor


def _times(one: Product, other: Product) -> Product:
    """Product of two terms."""
    scaled = one.scaled or other.scaled
    return Product(
        one.constant * other.constant, (*one.times, *other.times), (*one.over, *other.over), scaled
    )


def _inverse(term: Product) -> Product:
    """One over a term."""
    return Product(1.0 / term.constant, term.over, term.times, term.scaled)
