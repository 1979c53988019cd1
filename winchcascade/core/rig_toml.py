"""Read rig files, built-in or your own, as a Rig; a wrong entry becomes a fault of one sentence with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import cache
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.cascade_toml import CascadeTable, StageTable, read_cascade
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.errors import RigError, check_type
from winchcascade.core.quantity import Calibrated, Quantity, Unit, find_unit, read_as
from winchcascade.core.rig_file import (
    Column,
    EffectNumber,
    Finite,
    Measure,
    Rig,
    Sensor,
    StatedEffect,
    Thresholds,
    kinds_of_rig,
    measures,
)
from winchcascade.core.toml_file import Table, check_keys, convert, read_toml, toml_values

BUILT_IN = ("hsu2026", "kitepower")
DEFAULT_RIG = "hsu2026"
_FOLDER = Path(__file__).parent.parent / "rigfiles"

HUGE = 1e12
"""No range, accuracy or uncertainty of a rig is larger, in SI units."""


def built_in_text(name: str) -> str:
    """Text of a built-in rig file; RigError for a name that is none."""
    if name not in BUILT_IN:
        raise RigError(f"rig {name!r}: no such built-in rig; there are {' and '.join(BUILT_IN)}.")
    return (_FOLDER / f"{name}.toml").read_text(encoding="utf-8")


@cache
def built_in(name: str = DEFAULT_RIG) -> Rig:
    """Read a built-in rig.

    >>> built_in("hsu2026").r_drum
    0.13
    """
    return parse_rig(built_in_text(name), f"built-in rig {name}")


def read_rig(rig: str | Path) -> Rig:
    """Read a rig file, or the built-in rig of that name where no such file exists; RigError names what is wrong.

    Effects that the file states are read as they are; `rig.load_rig` compares them with the catalogue.
    """
    path = Path(rig)
    if not isfile(path):
        if str(rig) in BUILT_IN:
            return built_in(str(rig))
        raise RigError(
            f"rig {str(rig)!r}: no such file and no built-in rig of that name; give a rig file or one of "
            f"{', '.join(BUILT_IN)} (`winchcascade rig hsu2026 > rig.toml` writes one to start from)."
        )
    return parse_rig(read_toml(path, RigError), str(path))


@cache
def assumed_rig() -> Rig:
    """The rig of the paper, marked as taken because none was named."""
    return replace(built_in(), assumed=True)


def first_named(*names: str | Path | None, read: Callable[[str | Path], Rig] = read_rig) -> Rig:
    """Read the first rig that is named; that of the paper, as assumed, if none is. Raises RigError as `read`.

    >>> first_named(None, "kitepower").name, first_named(None).assumed
    ('kitepower', True)
    """
    return next((read(name) for name in names if name is not None), None) or assumed_rig()


def given_rig(call: str, rig: Rig | None, usual: Rig | None = None) -> Rig:
    """The rig that a call of the library was given, else the usual one, of a run, else that of the paper, as assumed.

    Raises
    ------
    OptionError : something else than a rig was given
    """
    found = rig if rig is not None else usual if usual is not None else assumed_rig()
    check_type(f"{call}, rig", found, Rig, "load_rig(name)")
    return found


ERRORS = "errors"
"""Table under [sensors] with effects that are errors of sensors."""

_Text = Annotated[str, Meta(min_length=1, description='the name of the rig, such as name = "my rig"')]


class _Log(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [log]: what holds for every log of the rig."""

    sample_rate_hz: Annotated[float, Meta(gt=0.0, lt=1e300)] | None = None


class _RigFile(msgspec.Struct, frozen=True):
    """What a rig file has beside the tables of the parts, and tables that are read one by one."""

    name: _Text
    title: str = ""
    source: str = ""
    note: str = ""
    drivetrain: Table = {}
    sensors: dict[str, Table] = {}
    columns: dict[str, Table | str] = {}
    channels: dict[str, Table] = {}
    effects: dict[str, Table] = {}
    cascade: Table | None = None
    stage: dict[str, Table] = {}


_PARTS = {
    name: kind for name, kind in kinds_of_rig().items() if issubclass(kind, msgspec.Struct) and kind is not Cascade
}
"""Tables of a rig file that a struct declares whole."""


def parse_rig(text: str, where: str) -> Rig:
    """Turn the text of a rig file into a Rig; `where` names the file in the one sentence of a RigError.

    `based_on = "hsu2026"` takes everything that the file does not state from that built-in rig.
    """
    raw = toml_values(text, where, RigError)
    base = raw.pop("based_on", None)
    if base is not None:
        if base not in BUILT_IN:
            raise RigError(f"{where}: based_on = {base!r} is no built-in rig; expected one of {', '.join(BUILT_IN)}.")
        raw = _merged(toml_values(built_in_text(str(base)), str(base), RigError), raw)
    check_keys(raw, dict.fromkeys((*_RigFile.__struct_fields__, *_PARTS, "log")), f"{where}:", RigError)
    file: _RigFile = convert(raw, _RigFile, f"{where}:", RigError)
    own = {name: _channel(name, table, f"{where}: [channels.{name}]") for name, table in file.channels.items()}
    known = {**CHANNELS, **own}
    return Rig(
        name=file.name,
        title=file.title,
        source=file.source,
        note=file.note,
        sensors={
            name: _sensor(table, _channel_of(name, known, f"{where}: [sensors.{name}]"), f"{where}: [sensors.{name}]")
            for name, table in file.sensors.items()
            if name != ERRORS
        },
        columns=_columns(file, where, known),
        channels=own,
        effects=_effects(file, where),
        cascade=_cascade(file, known, where),
        sample_rate=_part(raw.get("log", {}), _Log, f"{where}: [log]").sample_rate_hz,
        path=where,
        **{name: _part(raw.get(name, {}), kind, f"{where}: [{name}]") for name, kind in _PARTS.items()},
    )


def _merged(base: Mapping[str, object], over: Mapping[str, object]) -> Table:
    """Lay one table over another; what has a unit or a name is replaced whole, so that no old number clings to it."""
    loads = {"load_u_percent", "load_limits_percent"}
    merged = {key: value for key, value in base.items() if not (key in loads and loads & over.keys())}
    for key, value in over.items():
        below = base.get(key)
        if (
            isinstance(below, dict)
            and isinstance(value, dict)
            and {"value", "name", "unit", "number"}.isdisjoint(value)
        ):
            value = _merged(below, value)
        merged[key] = value
    return merged


def _part(raw: object, kind: Any, place: str) -> Any:
    """Read a table by the struct that declares its entries: numbers with a unit first, then all others."""
    table: Table = convert(raw, Table, place, RigError)
    _check_replaced(table, place)
    numbers: Table = {}
    for name, measure in measures(kind).items():
        if (stated := table.get(name)) is None or (kind is Thresholds and not isinstance(stated, dict)):
            continue
        number = _quantity(stated, f"{place} {name}", measure)
        numbers[name] = number.value if kind is Thresholds else number
    return convert({**table, **numbers}, kind, place, RigError)


def _check_replaced(table: Mapping[str, object], place: str) -> None:
    """Reject a tolerance, which does not state whether it is a standard uncertainty or a limit."""
    for key in table:
        if found := re.fullmatch("(load_)?tolerance(_percent)?", key):
            load, percent = found[1] or "", found[2] or ""
            raise RigError(
                f"{place} {key}: a tolerance is not read; write {load}u{percent} for one standard uncertainty, or "
                f"{load}limits{percent} for the maker's +- limits."
            )


_Uncertainty = Annotated[float, Meta(ge=0.0, le=1e300, description="a number that is not negative")]
_Digest = Annotated[
    str,
    Meta(
        pattern="^([0-9a-f]{64})?$", description='the 64 hexadecimal digits of the SHA-256 of the log, "" for no file'
    ),
]

UNCERTAINTIES = ("u", "u_percent", "limits", "limits_percent")
"""Keys of the uncertainty of a number, of which one is stated: a standard uncertainty, or the maker's +- limits."""


class _Calibrated(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a calibrated number comes from."""

    log: str
    sha256: _Digest
    prior: Table | None = None


class _Number(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A number as a rig file writes it, with one of `UNCERTAINTIES` at most."""

    value: Finite
    unit: str
    source: str = ""
    u: _Uncertainty | None = None
    u_percent: _Uncertainty | None = None
    limits: _Uncertainty | None = None
    limits_percent: _Uncertainty | None = None
    calibrated: _Calibrated | None = None

    def __post_init__(self) -> None:
        """Reject several uncertainties: ValueError."""
        stated = [key for key in UNCERTAINTIES if getattr(self, key) is not None]
        if len(stated) > 1:
            raise ValueError(f"{' and '.join(stated)} are both there; expected one of them, leave the others out.")


def _quantity(raw: object, place: str, measure: Measure) -> Quantity:
    """Read a number with unit, source and uncertainty in SI units; limits are those of a rectangular distribution.

    Raises
    ------
    RigError : it cannot be used, or is not possible for what it measures
    """
    _check_replaced(raw if isinstance(raw, dict) else {}, place)
    number: _Number = convert(raw, _Number, place, RigError)
    unit = find_unit(number.unit)
    if unit is None or unit.dimension != measure.dimension:
        raise RigError(f"{place}: the unit {number.unit!r} is none of {measure.dimension.replace('_', ' ')}.")
    value: float = convert(number.value * unit.factor + unit.offset, measure.si, f"{place} in SI units", RigError)
    key = next((key for key in UNCERTAINTIES if getattr(number, key) is not None), None)
    u, limits = None, key is not None and key.startswith("limits")
    if key is not None:
        half = getattr(number, key) * (abs(value) / 100.0 if key.endswith("_percent") else unit.factor)
        u = half / math.sqrt(3.0) if limits else half
        if u > HUGE:
            raise RigError(f"{place} {key} gives {u:g} in SI units; check it and its unit.")
    calibrated = None
    if (record := number.calibrated) is not None:
        prior, where = None, f"{place} calibrated prior"
        if record.prior is not None:
            check_keys(record.prior, ("value", "u", "source"), where, RigError)
            prior = _quantity({"unit": number.unit, **record.prior}, where, measure)
        calibrated = Calibrated(record.log, record.sha256, prior)
    return Quantity(value, number.unit, number.source, u, calibrated, limits)


def _cascade(file: _RigFile, known: Mapping[str, Channel], where: str) -> Cascade:
    """Stages and their order, `[cascade]` and `[stage.NAME]`; those of the paper where the file states none."""
    if file.cascade is None and not file.stage:
        return PAPER
    order = None if file.cascade is None else convert(file.cascade, CascadeTable, f"{where}: [cascade]", RigError)
    own = {name: convert(raw, StageTable, f"{where}: [stage.{name}]", RigError) for name, raw in file.stage.items()}
    return read_cascade(order, own, known, where)


class _OwnChannel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [channels.NAME]: a channel of the rig's own."""

    unit: str


def _channel(name: str, table: Table, place: str) -> Channel:
    """A channel of the rig's own; its unit decides what is measured, and a power may name it, such as `torque * pump`."""
    if name in CHANNELS or name == "time" or re.fullmatch(r"[A-Za-z]\w*", name) is None:
        raise RigError(
            f"{place}: expected a name of letters, digits and underscores that no built-in channel has; those are time, "
            f"{', '.join(CHANNELS)}."
        )
    text = convert(table, _OwnChannel, place, RigError).unit
    unit = find_unit(text)
    if unit is None:
        raise RigError(f'{place}: the unit {text!r} is unknown; expected one such as "W", "bar", "L/min" or "1".')
    return Channel(name, name, unit.dimension, text, f"{name} ({text})")


def _channel_of(name: str, known: Mapping[str, Channel], place: str) -> Channel:
    """A channel by its name; RigError for one that is none."""
    if name not in known:
        raise RigError(f"{place} is no channel; expected one of {', '.join(known)}.")
    return known[name]


def _sensor(table: Table, channel: Channel, place: str) -> Sensor:
    """A sensor in SI units."""
    sensor: Sensor = convert(table, Sensor, place, RigError)
    unit = read_as(find_unit(sensor.unit), channel.dimension)
    if unit is None:
        raise RigError(f"{place} unit {sensor.unit!r} is none of {channel.dimension}.")
    counts_from = unit.offset if unit.dimension == "temperature" else 0.0
    if unit.offset != counts_from and (sensor.low is not None or sensor.high is not None):
        raise RigError(
            f"{place} unit {sensor.unit!r} does not count from the zero of the channel, as gauge pressure does; "
            'give the range as gauge pressure, such as low = 0, high = 20, unit = "bar".'
        )
    in_si = {
        key: value * unit.factor + (counts_from if key in ("low", "high") else 0.0)
        for key in ("low", "high", "resolution", "accuracy", "u_zero")
        if (value := getattr(sensor, key)) is not None
    }
    if any(abs(value) > HUGE for value in in_si.values()):
        raise RigError(f"{place} has a number beyond {HUGE:g} in SI units; check it and its unit.")
    return replace(sensor, **in_si)


def _columns(file: _RigFile, where: str, known: Mapping[str, Channel]) -> dict[str, Column]:
    """Columns by channel."""
    columns: dict[str, Column] = {}
    for name, stated in file.columns.items():
        place = f"{where}: [columns] {name}"
        dimension = "time" if name == "time" else _channel_of(name, known, place).dimension
        column = convert({"name": stated} if isinstance(stated, str) else stated, Column, place, RigError)
        if column.side is not None and name != "speed":
            raise RigError(f"{place}: only the speed of rotation has a side; leave it out.")
        if column.side == "generator" and "gear_ratio" not in file.drivetrain:
            raise RigError(
                f'{place}: side = "generator" needs the gear ratio; add gear_ratio under [drivetrain], with the '
                'value 1 for a direct drive, or side = "shaft".'
            )
        unit = find_unit(column.unit or "")
        if unit is not None and read_as(unit, dimension) is None:
            raise RigError(f"{place}: the unit {column.unit!r} is none of {dimension}.")
        for other, taken in columns.items():
            if (taken.name, taken.number) == (column.name, column.number):
                raise RigError(
                    f"{place} and {other} both name the column {column.name or column.number!r}; expected one each."
                )
        columns[name] = column
    return columns


def _effects(file: _RigFile, where: str) -> dict[str, StatedEffect]:
    """Effects of the rig, and those that are errors of sensors."""
    of_sensors: dict[str, Table] = convert(
        file.sensors.get(ERRORS, {}), dict[str, Table], f"{where}: [sensors.{ERRORS}]", RigError
    )
    for name in file.effects:
        if name in of_sensors:
            raise RigError(
                f"{where}: {name} stands under [effects] and under [sensors.{ERRORS}]; leave one of them out."
            )
    effects = {}
    for name, table in {**file.effects, **of_sensors}.items():
        stated = StatedEffect({}, of_a_sensor=name in of_sensors)
        place = f"{where}: [{stated.table(name)}]"
        logs = convert(table.get("logs", ()), tuple[str, ...], f"{place} logs", RigError)
        fields = {key: _effect_number(value, f"{place} {key}") for key, value in table.items() if key != "logs"}
        effects[name] = replace(stated, fields=fields, logs=logs)
    return effects


def _effect_number(raw: object, place: str) -> EffectNumber:
    """A field of an effect, a number or a table; with a unit its numbers are read in SI units."""
    number: EffectNumber = convert(raw if isinstance(raw, dict) else {"value": raw}, EffectNumber, place, RigError)
    unit = find_unit(number.unit) if number.unit else Unit("number", 1.0)
    if unit is None:
        raise RigError(f"{place}: the unit {number.unit!r} is unknown.")
    ends = {key: value for key in ("value", "low", "high") if (value := getattr(number, key)) is not None}
    return replace(number, **{key: value * unit.factor for key, value in ends.items()})
