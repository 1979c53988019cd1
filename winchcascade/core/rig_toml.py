"""Read rig files, built-in or your own, as a Rig; a wrong entry becomes a fault of one sentence with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated, Any, get_args

import msgspec

from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.errors import RigError
from winchcascade.core.quantity import find_unit, read_as
from winchcascade.core.rig_file import (
    Column,
    DcLink,
    Drivetrain,
    EffectNumber,
    Generator,
    Measure,
    ModelAccuracy,
    Restoring,
    Rig,
    Sensor,
    StatedEffect,
    Thresholds,
    Winch,
    phase_rule,
)
from winchcascade.core.rig_number import HUGE, check_replaced, convert, finite, number_of, possible, quantity
from winchcascade.core.toml_text import (
    Entries,
    Expected,
    check_keys,
    entries,
    entry,
    read_toml,
    struct_fields,
    toml_values,
)

BUILT_IN = ("hsu2026", "kitepower")
DEFAULT_RIG = "hsu2026"
_FOLDER = Path(__file__).parent.parent / "rigfiles"


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
    return parse_rig(read_toml(path, "a rig file that can be read", RigError), str(path))


def parse_rig(text: str, where: str) -> Rig:
    """Turn the text of a rig file into a Rig; `where` names the file in the one sentence of a RigError.

    `based_on = "hsu2026"` takes everything that the file does not state from that built-in rig.
    """
    raw = toml_values(text, where, RigError)
    base = raw.pop("based_on", None)
    if base is not None:
        if base not in BUILT_IN:
            raise RigError(f"{where}: based_on = {base!r} is no built-in rig; expected one of {', '.join(BUILT_IN)}.")
        raw = _merged(toml_values(built_in_text(base), base, RigError), raw)
    return _rig(raw, where)


def _merged(base: dict[str, object], over: dict[str, object]) -> dict[str, object]:
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
            merged[key] = _merged(below, value)
        else:
            merged[key] = value
    return merged


_SECTIONS: Mapping[str, type[Any]] = {
    "winch": Winch,
    "restoring": Restoring,
    "drivetrain": Drivetrain,
    "generator": Generator,
    "dc_link": DcLink,
}

_TABLE_OF = {field: table for table, kind in _SECTIONS.items() for field in kind.__struct_fields__}
"""Table of each entry with a number of the rig."""

_TABLES = sorted({*Rig.__struct_fields__, "stage", "log"} - {"sample_rate", "path", "assumed"})
"""Entries of a rig file, tables and texts."""

_Window = Annotated[
    str | float,
    Expected(
        '"auto", "payout" or a length in seconds',
        lambda rule: rule in ("auto", "payout") if isinstance(rule, str) else 0 < rule < 1e9,
    ),
]


class _Log(msgspec.Struct, frozen=True):
    """Table [log]: what holds for every log of the rig."""

    sample_rate_hz: Annotated[float | None, Expected("a number above 0", lambda rate: 0.0 < rate < float("inf"))] = None


_MAX_COLUMNS = 100_000
"""No log has more columns."""


def _rig(raw: dict[str, object], where: str) -> Rig:
    _check_keys(raw, _TABLES, f"{where}: ")
    name = raw.get("name")
    if not isinstance(name, str) or not name:
        raise RigError(f'{where}: the entry name is missing; add name = "my rig".')
    texts = {key: convert(raw.get(key, ""), str, f"{where}: {key}") for key in ("title", "source", "note")}
    own = _channels(_table(raw, "channels", where), where)
    known = {**CHANNELS, **own}
    sections = {key: _section(raw, key, kind, where) for key, kind in _SECTIONS.items()}
    if sections["dc_link"].load_u_percent and sections["dc_link"].load_limits_percent:
        raise RigError(
            f"{where}: [dc_link] has load_u_percent and load_limits_percent; expected one of them, leave the other out."
        )
    return Rig(
        name=name,
        **texts,
        sensors=_sensors(_table(raw, "sensors", where), where, known),
        columns=_columns(
            _table(raw, "columns", where), where, known, geared="gear_ratio" in _table(raw, "drivetrain", where)
        ),
        channels=own,
        cascade=_cascade(raw, known, where),
        effects=_effects(_table(raw, "effects", where), where),
        sample_rate=_section(raw, "log", _Log, where).sample_rate_hz,
        thresholds=_thresholds(raw, where),
        model=_section(raw, "model", ModelAccuracy, where),
        phases=phase_rule(_table(raw, "phases", where), where),
        path=where,
        **sections,
    )


def _section(raw: dict[str, object], key: str, kind: type[Entries], where: str) -> Entries:
    """Read a table of a rig file by the struct that declares its entries."""
    declared = {field.name: field.type for field in struct_fields(kind)}
    values = _table(raw, key, where)
    place = f"{where}: [{key}]"
    check_replaced(values, place)
    for name in values:
        table = None if name in declared else _TABLE_OF.get(name)
        if table is not None:
            raise RigError(f"{place} {name} is an entry of [{table}]; move it there.")
    _check_keys(values, list(declared), f"{place} ")
    return kind(**{name: _declared(value, name, declared[name], place) for name, value in values.items()})


def _declared(value: object, name: str, kind: Any, place: str) -> Any:
    """Read an entry by its declaration: a number with a unit or, if it is declared as a plain one, also without."""
    python_type, *notes = get_args(kind)
    measure = next((note for note in notes if isinstance(note, Measure)), None)
    if measure is None:
        return entry(value, name, kind, place, RigError)
    place = f"{place} {name}"
    if python_type is not float:
        return quantity(value, place, measure)
    if measure.dimension is not None and isinstance(value, dict):
        return quantity(value, place, measure).value
    return possible(number_of(value, place), place, measure)


def _thresholds(raw: dict[str, object], where: str) -> Thresholds:
    values = _table(raw, "thresholds", where)
    window = values.pop("window", Thresholds().window)
    entry(window, "window", _Window, f"{where}: [thresholds]", RigError)
    others = _section({"thresholds": values}, "thresholds", Thresholds, where)
    return msgspec.structs.replace(others, window=str(window))


def _cascade(raw: dict[str, object], known: Mapping[str, Channel], where: str) -> Cascade:
    """Stages and their order, `[cascade]` and `[stage.NAME]`; those of the paper where the file states none."""
    if not raw.keys() & {"cascade", "stage"}:
        return PAPER
    from winchcascade.core.cascade_toml import CascadeTable, StageTable, read_cascade

    table = convert(raw["cascade"], CascadeTable, f"{where}: [cascade]") if "cascade" in raw else None
    stages = _table(raw, "stage", where)
    own = {name: convert(stage, StageTable, f"{where}: [stage.{name}]") for name, stage in stages.items()}
    return read_cascade(table, own, known, where)


def _table(raw: dict[str, object], key: str, where: str) -> dict[str, object]:
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise RigError(f"{where}: {key} is {value!r}; expected a table [{key}].")
    return dict(value)


def _check_keys(raw: Mapping[str, object], known: Sequence[str], place: str) -> None:
    check_keys(raw, known, place, f"no entry of a rig file; expected {', '.join(known)}", RigError)


_OWN_NAME = re.compile(r"[A-Za-z]\w*")
"""A name of a channel of your own: it is used in products such as `torque * speed`."""


def _channels(raw: dict[str, object], where: str) -> dict[str, Channel]:
    """Channels of the rig's own, `[channels.NAME] unit = "..."`; the unit decides what is measured."""
    channels = {}
    for name, stated in raw.items():
        place = f"{where}: [channels.{name}]"
        if name in CHANNELS or name == "time" or _OWN_NAME.fullmatch(name) is None:
            raise RigError(
                f"{place}: expected a name of letters, digits and underscores that no built-in channel has; those "
                f"are time, {', '.join(CHANNELS)}."
            )
        if not isinstance(stated, dict):
            raise RigError(
                f'{where}: [channels] {name} is {stated!r}; expected a table [channels.{name}] with unit = "...".'
            )
        _check_keys(stated, ("unit",), f"{place} ")
        text = convert(stated.get("unit", ""), str, f"{place} unit")
        unit = find_unit(text)
        if unit is None:
            raise RigError(f'{place}: the unit {text!r} is unknown; expected one such as "W", "bar", "L/min" or "1".')
        channels[name] = Channel(name, name, unit.dimension, text, f"{name} ({text})")
    return channels


def _sensors(raw: dict[str, object], where: str, known: Mapping[str, Channel]) -> dict[str, Sensor]:
    sensors = {}
    for name, table in raw.items():
        place = f"{where}: [sensors.{name}]"
        if name not in known:
            raise RigError(f"{place} is no channel; expected one of {', '.join(known)}.")
        if not isinstance(table, dict):
            raise RigError(f"{where}: [sensors] {name} is {table!r}; expected a table [sensors.{name}].")
        _check_keys(table, Sensor.__struct_fields__, f"{place} ")
        sensor = entries(table, Sensor, place, RigError)
        unit = read_as(find_unit(sensor.unit), known[name].dimension)
        if unit is None:
            raise RigError(f"{place} unit {sensor.unit!r} is none of {known[name].dimension}.")
        counts_from = unit.offset if unit.dimension == "temperature" else 0.0
        if unit.offset != counts_from and (sensor.low is not None or sensor.high is not None):
            raise RigError(
                f"{place} unit {sensor.unit!r} does not count from the zero of the channel, as gauge pressure does; "
                'give the range as gauge pressure, such as low = 0, high = 20, unit = "bar".'
            )
        if sensor.low is not None and sensor.high is not None and sensor.low >= sensor.high:
            raise RigError(f"{place} low {sensor.low:g} is not below high {sensor.high:g}.")
        _check_accuracy(sensor, place)
        in_si = {
            key: value * unit.factor + (counts_from if key in ("low", "high") else 0.0)
            for key in ("low", "high", "resolution", "accuracy", "u_zero")
            if (value := getattr(sensor, key)) is not None
        }
        if any(abs(value) > HUGE for value in in_si.values()):
            raise RigError(f"{place} has a number beyond {HUGE:g} in SI units; check it and its unit.")
        sensors[name] = msgspec.structs.replace(sensor, **in_si)
    return sensors


def _check_accuracy(sensor: Sensor, place: str) -> None:
    """Reject shares of a full scale that is not stated, and shares and coverage factors of an accuracy that is not stated."""
    for key in ("accuracy_full_scale", "daq_full_scale"):
        if getattr(sensor, key) is not None and not (sensor.high or sensor.low):
            raise RigError(f"{place} {key} has no full scale; give the range as high = ... too.")
    known = (sensor.accuracy, sensor.accuracy_full_scale, sensor.accuracy_reading, sensor.u_zero, sensor.u_gain)
    if any((sensor.daq_full_scale, sensor.daq_reading)) and not any(known):
        raise RigError(
            f"{place} has the share of the acquisition system and no accuracy of the sensor; add the one of the "
            "sensor, such as accuracy_reading = ..."
        )
    stated = {
        "coverage": (sensor.accuracy, sensor.accuracy_full_scale, sensor.accuracy_reading),
        "daq_coverage": (sensor.daq_full_scale, sensor.daq_reading),
    }
    for key, accuracies in stated.items():
        if getattr(sensor, key) is not None and not any(accuracies):
            raise RigError(f"{place} {key} belongs to an accuracy, and none is stated; add it or leave {key} out.")


def _columns(raw: dict[str, object], where: str, known: Mapping[str, Channel], *, geared: bool) -> dict[str, Column]:
    """Columns by channel; `geared`: the file states a gear ratio, which a speed of the generator is divided by."""
    columns: dict[str, Column] = {}
    for name, stated in raw.items():
        place = f"{where}: [columns] {name}"
        if name not in known and name != "time":
            raise RigError(f"{place} is no channel; expected time or one of {', '.join(known)}.")
        column = Column(stated) if isinstance(stated, str) else convert(stated, Column, place)
        if bool(column.name.strip()) == (column.number is not None):
            raise RigError(f'{place}: expected either name = "..." or number = ..., the column from 1 on.')
        if column.number is not None and not 1 <= column.number <= _MAX_COLUMNS:
            raise RigError(f"{place}: number is {column.number}; expected the column's place, from 1 on.")
        if column.override and column.unit is None:
            raise RigError(f'{place}: override = true without a unit; add unit = "...", or leave override out.')
        if column.side is not None and name != "speed":
            raise RigError(f"{place}: only the speed of rotation has a side; leave it out.")
        if column.side == "generator" and not geared:
            raise RigError(
                f'{place}: side = "generator" needs the gear ratio; add gear_ratio under [drivetrain], with the '
                'value 1 for a direct drive, or side = "shaft".'
            )
        dimension, unit = "time" if name == "time" else known[name].dimension, find_unit(column.unit or "")
        if unit is not None and read_as(unit, dimension) is None:
            raise RigError(f"{place}: the unit {column.unit!r} is none of {dimension}.")
        for other, taken in columns.items():
            if (taken.name, taken.number) == (column.name, column.number):
                called = repr(column.name) if column.number is None else str(column.number)
                raise RigError(f"{place} and {other} both name the column {called}; expected one each.")
        columns[name] = column
    return columns


def _effects(raw: dict[str, object], where: str) -> dict[str, StatedEffect]:
    """Effects with their fields, each a number or a table; `logs` lists the logs that they come from."""
    effects = {}
    for name, stated in raw.items():
        place = f"{where}: [effects.{name}]"
        if not isinstance(stated, dict):
            raise RigError(f"{where}: [effects] {name} is {stated!r}; expected a table [effects.{name}].")
        logs = convert(stated.get("logs", ()), tuple[str, ...], f"{place} logs")
        fields = {key: _effect_number(value, f"{place} {key}") for key, value in stated.items() if key != "logs"}
        effects[name] = StatedEffect(fields, logs)
    return effects


def _effect_number(value: object, place: str) -> EffectNumber:
    if not isinstance(value, dict):
        return EffectNumber(number_of(value, place))
    number: EffectNumber = convert(value, EffectNumber, place)
    unit = find_unit(number.unit) if number.unit else None
    if unit is None and number.unit:
        raise RigError(f"{place}: the unit {number.unit!r} is unknown.")
    factor = 1.0 if unit is None else unit.factor
    in_si = {
        key: finite(given, f"{place} {key}") * factor
        for key in ("value", "low", "high")
        if (given := getattr(number, key)) is not None
    }
    if not in_si.get("low", -math.inf) <= in_si["value"] <= in_si.get("high", math.inf):
        raise RigError(f"{place}: the value {number.value:g} is not between low and high; correct the interval.")
    return msgspec.structs.replace(number, **in_si)
