"""A number with unit and source, and the units that logs and rig files may name, of the table
`units.toml`.

Inside the program every number is in SI units; other units appear only where files are read or
written.
"""

from __future__ import annotations

import math
import re
import tomllib
import unicodedata
from functools import lru_cache
from pathlib import Path

import msgspec

KGF = 9.80665
"""Standard gravity: newtons in one kilogram-force (ISO 80000-4)."""

KGCM2 = KGF * 1e4
"""One kilogram-force per square centimetre. [Pa]"""

ATMOSPHERE = 101325.0
"""Standard atmosphere: what an absolute pressure has over a gauge pressure. [Pa]"""

TURN = 6.283185307179586
"""Radians in one revolution."""


class Unit(msgspec.Struct, frozen=True):
    """A unit as ``SI value = factor * value + offset``; the dimension is a word that channels
    share.
    """

    dimension: str
    factor: float
    offset: float = 0.0


def _plain(text: str) -> str:
    """Fold the spellings of one unit: full width, superscripts, the signs of a product, blanks."""
    return unicodedata.normalize("NFKC", text.strip()).translate(_FOLDED)


_FOLDED = str.maketrans(
    dict.fromkeys("·⋅•∙*×", ".") | dict.fromkeys("^ ", "") | dict.fromkeys("⁻\u2212", "-")
)


_BY_DIMENSION: dict[str, list[tuple[Unit, list[str]]]] = {
    dimension: [
        (Unit(dimension, *(size if isinstance(size, list) else (size,))), names.split())
        for names, size in rows.items()
    ]
    for dimension, rows in tomllib.loads(
        (Path(__file__).parent / "units.toml").read_text(encoding="utf-8")
    ).items()
}
"""Units of each dimension with their spellings, as `units.toml` beside this module lists them."""

UNITS = {
    _plain(name): unit for rows in _BY_DIMENSION.values() for unit, names in rows for name in names
}
"""Every unit that a log or a rig file may name; pressures are gauge unless named as absolute."""

_FOLDED_CASE: dict[str, Unit | None] = {}
for _name, _unit in UNITS.items():
    _key = _name.casefold()
    _FOLDED_CASE[_key] = _unit if _FOLDED_CASE.get(_key, _unit) == _unit else None


@lru_cache(4096)
def find_unit(text: str) -> Unit | None:
    """Find a unit in the table, in another case if only one fits then; None for one it does not
    hold.

    >>> find_unit("kgf/cm²").dimension, find_unit("N·m").factor, find_unit("meters per second").factor, find_unit("furlong")
    ('pressure', 1.0, 1.0, None)
    """
    plain = _plain(text)
    if plain in UNITS or plain == "mPa":
        return UNITS.get(plain)
    spelled = (plain, _PER.sub("/", text), plain.replace("_", "/"))
    forms = dict.fromkeys(
        (*map(_plain, spelled), *(_PLURAL.sub("", _plain(form)) for form in spelled))
    )
    exact = (UNITS[form] for form in forms if form in UNITS)
    return next(exact, None) or next(
        filter(None, (_FOLDED_CASE.get(form.casefold()) for form in forms)), None
    )


_PER = re.compile(r"[\s_]+per[\s_]+", re.IGNORECASE)
_PLURAL = re.compile(r"(?<=[a-z]{3})s(?=/|$)", re.IGNORECASE)
"""An s behind a spelled unit, as in kilonewtons and meters/second."""


def read_as(unit: Unit | None, dimension: str) -> Unit | None:
    """Read a unit as one of a dimension: a frequency counts revolutions where a rotation is
    expected; None for any other.

    >>> read_as(find_unit("Hz"), "rotation"), read_as(find_unit("N"), "rotation")
    (Unit(dimension='rotation', factor=6.283185307179586, offset=0.0), None)
    """
    if unit is not None and unit.dimension == "frequency" and dimension == "rotation":
        return Unit("rotation", TURN * unit.factor)
    return None if unit is None or unit.dimension != dimension else unit


def is_load(ohm: float) -> bool:
    """Whether a number is a load: above 0, of a size that exists, or inf for an open circuit.
    [ohm]
    """
    return 0.0 < ohm < 1e12 or ohm == float("inf")


def same_load(one: float, other: float) -> bool:
    """Whether two loads are the same number of ohms."""
    return math.isclose(one, other, rel_tol=1e-9)


def load_text(load: float) -> str:
    """A load as people write it."""
    return "open circuit" if math.isinf(load) else f"{load:.12g} ohm"


def unit_suffix(unit: str) -> str:
    """A unit as it follows a number; nothing for a pure number."""
    return "" if unit in ("1", "-") else f" {unit}"


def si_unit(dimension: str) -> str:
    """SI unit of a dimension, as a text."""
    return _BY_DIMENSION[dimension][0][1][0]


def unit_names(dimension: str) -> dict[float, str]:
    """Units of a dimension by their factor, as texts."""
    return {
        unit.factor: names[0] for unit, names in _BY_DIMENSION.get(dimension, []) if not unit.offset
    }


class Quantity(msgspec.Struct, frozen=True):
    """A number in SI units with its source and, where it is known, one standard uncertainty `u` in
    the same unit.

    `calibrated` records where a number comes from that `calibrate` wrote. `rectangular`: the rig
    file states limits of the maker, whose half width is sqrt(3) u.
    """

    value: float
    unit: str
    source: str = ""
    u: float | None = None
    calibrated: Calibrated | None = None
    rectangular: bool = False

    @property
    def prior(self) -> Quantity:
        """The number before its first calibration; itself, without a record, where it was not
        stated before.
        """
        if self.calibrated is None:
            return self
        return self.calibrated.prior or msgspec.structs.replace(self, calibrated=None)


class Calibrated(msgspec.Struct, frozen=True):
    """Log of a calibrated number, and the number before its first calibration, None where the
    rig file stated none.
    """

    log: str
    sha256: str
    prior: Quantity | None = None
