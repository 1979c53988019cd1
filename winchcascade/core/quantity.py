"""A number with unit and source, and the one table of units that logs and rig files may name.

Inside the program every number is in SI units; other units appear only where files are read or written.
"""

from __future__ import annotations

import re
import unicodedata

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
    """A unit as ``SI value = factor * value + offset``; the dimension is a word that channels share."""

    dimension: str
    factor: float
    offset: float = 0.0


_SPELLED: dict[tuple[str, float], str] = {
    ("time", 1.0): "s sec secs second seconds 秒 sek с",
    ("time", 1e-3): "ms msec millis millisecond milliseconds 毫秒",
    ("time", 1e-6): "us µs μs usec microsecond microseconds",
    ("time", 1e-9): "ns nsec nanosecond",
    ("time", 60.0): "min minute minutes",
    ("time", 3600.0): "h hr hour hours",
    ("time", 86400.0): "d day days",
    ("length", 1.0): "m meter metre meters metres 公尺 米 м",
    ("length", 1e-2): "cm 公分 厘米",
    ("length", 1e-3): "mm millimeter millimetre 公釐 毫米",
    ("length", 1e3): "km",
    ("length", 0.0254): "in inch inches",
    ("length", 0.3048): "ft foot feet",
    ("length", 0.9144): "yd yds yard yards",
    ("velocity", 1.0): "m/s mps m/sec ms-1 m.s-1 meter/second metre/second meter/sec 公尺/秒 米/秒 м/с",
    ("velocity", 1e-2): "cm/s cm/sec",
    ("velocity", 1e-3): "mm/s mm/sec mmps",
    ("velocity", 1.0 / 60.0): "m/min mpm",
    ("velocity", 1.0 / 3.6): "km/h km/hr km/hour kmh kph kmph",
    ("velocity", 0.0254): "in/s in/sec ips",
    ("velocity", 0.3048): "ft/s ft/sec fps",
    ("velocity", 0.3048 / 60.0): "ft/min fpm",
    ("velocity", 0.9144): "yd/s yd/sec",
    ("velocity", 0.44704): "mph",
    ("velocity", 1852.0 / 3600.0): "kt knot knots",
    ("pressure", 1.0): "Pa N/m2 N.m-2 pascal",
    ("pressure", 1e2): "hPa mbar",
    ("pressure", 1e3): "kPa kilopascal",
    ("pressure", 1e6): "MPa Mpa MPA N/mm2 N/(mm2) megapascal",
    ("pressure", 1e5): "bar barg bar(g) bar_g bargauge",
    ("pressure", 6894.757293168): "psi psig psi(g) lbf/in2 lbf/sq.in",
    ("pressure", 101325.0 / 760.0): "mmHg torr",
    ("pressure", 3386.389): "inHg",
    ("pressure", KGCM2): "kg/cm2 kgf/cm2 kg/cm2g kgf/cm2g kg/cm2(g) kgcm2 kgfcm2 kg_cm2 kgf.cm-2 kg.cm-2"
    " kg/sq.cm kgf/sq.cm at 公斤/平方公分 кгс/см2",
    ("force", 1.0): "N newton newtons 牛頓 牛 Н",
    ("force", 1e-3): "mN",
    ("force", 10.0): "daN",
    ("force", 1e3): "kN kilonewton",
    ("force", 1e6): "MN",
    ("force", KGF * 1e-3): "gf",
    ("force", KGF): "kgf kg kp 公斤 公斤力",
    ("force", KGF * 1e3): "tf t tonf ton tonne",
    ("force", 4.4482216152605): "lbf lb lbs pound pounds poundforce",
    ("force", 4448.2216152605): "kip klbf",
    ("force", 0.27801385095378): "ozf oz",
    ("torque", 1.0): "N.m Nm N-m N_m newtonmeter newtonmetre newton-meter 牛頓米 牛米 Н.м",
    ("torque", 1e-3): "mN.m mNm N.mm Nmm",
    ("torque", 1e-2): "cN.m cNm N.cm Ncm",
    ("torque", 1e3): "kN.m kNm kN-m",
    ("torque", KGF): "kgf.m kgfm kg.m kgm kgf-m kg-m",
    ("torque", KGF * 1e-2): "kgf.cm kg.cm kgf-cm",
    ("torque", KGF * 1e-5): "gf.cm g.cm gf-cm",
    ("torque", 1.3558179483314): "lbf.ft ft.lbf ft.lb lb.ft lbft ftlb lb-ft ft-lb footpound footpoundforce",
    ("torque", 0.1129848290276): "lbf.in in.lbf in.lb lb.in lb-in in-lb",
    ("torque", 0.0070615518142261): "ozf.in oz.in oz-in ozin in.oz",
    ("voltage", 1.0): "V volt volts Vdc VDC V_dc voltdc 伏特 伏 В",
    ("voltage", 1e-3): "mV",
    ("voltage", 1e3): "kV",
    ("current", 1.0): "A amp amps ampere amperes Adc ADC 安培 安 А",
    ("current", 1e-3): "mA MA ma milliamp",
    ("current", 1e-6): "uA µA μA",
    ("current", 1e3): "kA",
    ("power", 1e-6): "uW µW μW",
    ("power", 1e-3): "mW",
    ("power", 1.0): "W watt watts 瓦 瓦特",
    ("power", 1e3): "kW kilowatt",
    ("power", 745.6998715822702): "hp",
    ("power", 735.49875): "PS",
    ("power", 1e6): "MW",
    ("rotation", 1.0): "rad/s rad/sec rads rad.s-1 radian/second",
    (
        "rotation",
        0.10471975511965977,
    ): "rpm rpms r/min 1/min min-1 rev/min U/min Umin revolution/minute tr/min giri/min omw/min об/мин obr/min"
    " 轉/分 转/分 回転/分",
    ("rotation", 0.017453292519943295): "deg/s °/s deg.s-1",
    ("rotation", TURN): "rev/s r/s rps U/s tr/s giri/s",
    ("angle", 1.0): "rad",
    ("angle", 0.017453292519943295): "deg ° degree degrees",
    ("resistance", 1.0): "ohm ohms Ohm Ω",
    ("resistance", 1e-3): "mohm mΩ",
    ("inductance", 1.0): "H",
    ("inductance", 1e-3): "mH",
    ("capacitance", 1.0): "F",
    ("capacitance", 1e-3): "mF",
    ("capacitance", 1e-6): "uF µF μF",
    ("area", 1.0): "m2",
    ("area", 1e-4): "cm2",
    ("area", 1e-6): "mm2",
    ("volume", 1.0): "m3",
    ("volume", 1e-3): "L l liter litre dm3",
    ("volume", 1e-6): "mL ml cm3",
    ("flow", 1.0): "m3/s m3.s-1",
    ("flow", 1.0 / 60.0): "m3/min",
    ("flow", 1.0 / 3600.0): "m3/h m3.h-1",
    ("flow", 1e-3): "L/s l/s dm3/s",
    ("flow", 1e-3 / 60.0): "L/min l/min lpm dm3/min",
    ("flow", 1e-3 / 3600.0): "L/h l/h",
    ("flow", 1e-6): "cm3/s mL/s cc/s",
    ("flow", 1e-6 / 60.0): "cm3/min mL/min cc/min",
    ("mass_flow", 1.0): "kg/s",
    ("mass_flow", 1.0 / 60.0): "kg/min",
    ("mass_flow", 1.0 / 3600.0): "kg/h",
    ("acceleration", 1.0): "m/s2",
    ("inertia", 1.0): "kg.m2 kgm2",
    ("inertia", 1e-7): "g.cm2 gcm2",
    ("damping", 1.0): "N.m.s/rad Nms/rad",
    ("windage", 1.0): "N.m.s2/rad2 Nms2/rad2",
    ("stiffness", 1.0): "N.m/rad Nm/rad",
    ("back_emf", 1.0): "V/rpm",
    ("lead", 1.0): "m/rev",
    ("lead", 1e-3): "mm/rev",
    ("number", 1.0): "1 -",
    ("number", 1e-2): "% percent",
    ("norm_flow", 1.0 / 3600.0): "Nm3/h Nm³/h m3(n)/h",
    ("norm_flow", 1.0 / 60000.0): "NL/min Nl/min l(n)/min",
    ("frequency", 1.0): "Hz 1/s",
    ("frequency", 1e3): "kHz",
    ("temperature", 1.0): "K kelvin",
}
"""By dimension and factor, how loggers write a unit; pressures are gauge."""

_ABSOLUTE: dict[float, str] = {
    1.0: "Pa(a)",
    1e3: "kPa(a) kPaa kPaabs",
    1e6: "MPa(a) MPaa MPaabs",
    1e5: "bar(a) bara barabs bar_a",
    6894.757293168: "psia psi(a)",
    KGCM2: "kgf/cm2a kg/cm2a kgf/cm2(a) kg/cm2(a) ata",
}
"""By factor, how loggers write an absolute pressure."""

_TEMPERATURES: dict[tuple[float, float], str] = {
    (1.0, 273.15): "°C ºC ￭C ｰC C degC deg.C deg_C degreesC oC celsius 攝氏 摄氏 攝氏度 摄氏度",
    (5.0 / 9.0, 459.67 * 5.0 / 9.0): "°F degF deg.F deg_F degreesF oF fahrenheit",
}
"""By factor and offset, how loggers write a temperature; none is a channel, and these distinguish it from a torque T."""


def _plain(text: str) -> str:
    """Fold the spellings of one unit: full width, superscripts, the signs of a product, blanks."""
    return unicodedata.normalize("NFKC", text.strip()).translate(_FOLDED)


_FOLDED = str.maketrans(dict.fromkeys("·⋅•∙*×", ".") | dict.fromkeys("^ ", "") | dict.fromkeys("⁻\u2212", "-"))

UNITS: dict[str, Unit] = {
    _plain(name): unit
    for unit, names in (
        *((Unit(dimension, factor), names) for (dimension, factor), names in _SPELLED.items()),
        *((Unit("pressure", factor, -ATMOSPHERE), names) for factor, names in _ABSOLUTE.items()),
        *((Unit("temperature", factor, offset), names) for (factor, offset), names in _TEMPERATURES.items()),
    )
    for name in names.split()
}
"""Every unit that a log or a rig file may name; pressures are gauge unless named as absolute."""

_FOLDED_CASE: dict[str, Unit | None] = {}
for _name, _unit in UNITS.items():
    _key = _name.casefold()
    _FOLDED_CASE[_key] = _unit if _FOLDED_CASE.get(_key, _unit) == _unit else None


def find_unit(text: str) -> Unit | None:
    """Find a unit in the table, in another case if only one fits then; None for one it does not hold.

    >>> find_unit("kgf/cm²").dimension, find_unit("N·m").factor, find_unit("meters per second").factor, find_unit("furlong")
    ('pressure', 1.0, 1.0, None)
    """
    plain = _plain(text)
    if plain == "mPa":
        return None
    spelled = (plain, _PER.sub("/", text), plain.replace("_", "/"))
    forms = dict.fromkeys((*map(_plain, spelled), *(_PLURAL.sub("", _plain(form)) for form in spelled)))
    exact = (UNITS[form] for form in forms if form in UNITS)
    return next(exact, None) or next(filter(None, (_FOLDED_CASE.get(form.casefold()) for form in forms)), None)


_PER = re.compile(r"[\s_]+per[\s_]+", re.IGNORECASE)
_PLURAL = re.compile(r"(?<=[a-z]{3})s(?=/|$)", re.IGNORECASE)
"""An s behind a spelled unit, as in kilonewtons and meters/second."""


def read_as(unit: Unit | None, dimension: str) -> Unit | None:
    """Read a unit as one of a dimension: a frequency counts revolutions where a rotation is expected; None for any other.

    >>> read_as(find_unit("Hz"), "rotation"), read_as(find_unit("N"), "rotation")
    (Unit(dimension='rotation', factor=6.283185307179586, offset=0.0), None)
    """
    if unit is not None and unit.dimension == "frequency" and dimension == "rotation":
        return Unit("rotation", TURN * unit.factor)
    return None if unit is None or unit.dimension != dimension else unit


def is_load(ohm: float) -> bool:
    """Whether a number is a load: above 0, of a size that exists, or inf for an open circuit. [ohm]

    >>> is_load(36.0), is_load(float("inf")), is_load(0.0)
    (True, True, False)
    """
    return 0.0 < ohm < 1e12 or ohm == float("inf")


def si_unit(dimension: str) -> str:
    """SI unit of a dimension, as a text.

    >>> si_unit("torque")
    'N.m'
    """
    return _SPELLED[dimension, 1.0].split()[0]


def unit_names(dimension: str) -> dict[float, str]:
    """Units of a dimension by their factor, as texts.

    >>> unit_names("torque")[1e3], unit_names("nothing")
    ('kN.m', {})
    """
    return {factor: names.split()[0] for (name, factor), names in _SPELLED.items() if name == dimension}


class Quantity(msgspec.Struct, frozen=True):
    """A number in SI units with its source and, where it is known, one standard uncertainty `u` in the same unit.

    `calibrated` records where a number comes from that `calibrate` wrote. `rectangular`: the rig file states limits of the
    maker, whose half width is sqrt(3) u.
    """

    value: float
    unit: str
    source: str = ""
    u: float | None = None
    calibrated: Calibrated | None = None
    rectangular: bool = False

    @property
    def prior(self) -> Quantity:
        """The number before its first calibration; itself, without a record, where it was not stated before."""
        if self.calibrated is None:
            return self
        return self.calibrated.prior or msgspec.structs.replace(self, calibrated=None)


class Calibrated(msgspec.Struct, frozen=True):
    """Log of a calibrated number, and the number before its first calibration, None where the rig file stated none."""

    log: str
    sha256: str
    prior: Quantity | None = None
