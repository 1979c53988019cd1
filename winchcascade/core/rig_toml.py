"""Read rig files, built-in or your own, as a Rig; a wrong entry becomes a fault of one sentence with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.errors import RigError
from winchcascade.core.phase_rule import phase_rule
from winchcascade.core.quantity import Quantity, find_unit, read_as
from winchcascade.core.rig_file import (
    Column,
    DcLink,
    Drivetrain,
    EffectNumber,
    Generator,
    ModelAccuracy,
    Restoring,
    Rig,
    Sensor,
    StatedEffect,
    Thresholds,
    Winch,
)
from winchcascade.core.run import CHANNELS, Channel
from winchcascade.core.toml_text import check_keys, read_toml, toml_values

BUILT_IN = ("hsu2026", "kitepower")
DEFAULT_RIG = "hsu2026"
_FOLDER = Path(__file__).parent.parent / "rigfiles"


class _Number(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A number as a rig file writes it."""

    value: float
    unit: str
    source: str = ""
    tolerance: float | None = None
    tolerance_percent: float | None = None


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


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Lay one table over another; what has a unit or a name is replaced whole, so that no old number clings to it."""
    return base | {
        key: _merged(base[key], value)
        if isinstance(base.get(key), dict)
        and isinstance(value, dict)
        and {"value", "name", "unit", "number"}.isdisjoint(value)
        else value
        for key, value in over.items()
    }


_SECTIONS: dict[str, type[Any]] = {
    "winch": Winch,
    "restoring": Restoring,
    "drivetrain": Drivetrain,
    "generator": Generator,
    "dc_link": DcLink,
}

_DIMENSIONS = {
    "r_drum": "length", "inertia": "inertia", "lead": "lead", "lead_angle": "angle", "half_angle": "angle",
    "mu_screw": "number", "area_piston": "area", "p_precharge": "pressure", "volume_gas": "volume",
    "gear_ratio": "number", "eta_mesh": "number", "b_rotor": "damping", "k_shaft": "stiffness",
    "c_shaft": "damping", "inertia_rotor": "inertia", "pole_pairs": "number", "k_e": "back_emf",
    "r_s": "resistance", "l_s": "inductance", "v_diode": "voltage", "speed_rated": "rotation", "i_rated": "current",
    "c_dc": "capacitance", "r_bleed": "resistance", "v_onset": "velocity", "smoothing": "time",
    "stroke_min": "length", "plateau_hold": "time", "settle": "time", "tau_engaged": "torque", "gap_max": "time",
}  # fmt: skip
"""What each number of a rig file measures; `rpm_bin` stays in rpm, as the field has it."""

_POSITIVE = {
    "r_drum", "gear_ratio", "eta_mesh", "smoothing", "stroke_min", "v_onset", "rpm_bin", "plateau_hold", "area_piston",
    "volume_gas", "k_e", "lead", "reversal_max",
}  # fmt: skip
_SHARES = {
    "reversal_max",
    "creep_max",
    "aborted_below",
    "plateau_quantile",
    "plateau_band",
    "plateau_level",
    "eta_mesh",
}
_LIMITS = {
    "r_drum": (1e-3, 100.0), "gear_ratio": (1e-3, 1e5), "rpm_bin": (1.0, 1e5), "smoothing": (1e-3, 10.0),
    "v_onset": (1e-6, 100.0), "stroke_min": (1e-6, 1e4), "plateau_hold": (1e-3, 1e3), "settle": (0.0, 1e6),
    "gap_max": (0.0, 1e6),
}  # fmt: skip
"""What no rig goes beyond: a number outside is a wrong unit or a slip. SI units, bins in rpm."""

_PLAIN = {"one_way_clutch": bool, "load_tolerance_percent": float}
"""Entries of the sections that have no unit."""

_MOST_COLUMNS = 100_000
"""No log has more columns."""

HUGE = 1e12
"""No range, accuracy or tolerance of a rig is larger, in SI units."""


def _rig(raw: dict[str, Any], where: str) -> Rig:
    _check_keys(
        raw,
        sorted(
            {
                "name",
                "title",
                "source",
                "note",
                "sensors",
                "stage",
                "columns",
                "cascade",
                "channels",
                "effects",
                "log",
                "thresholds",
                "model",
                "phases",
                *_SECTIONS,
            }
        ),
        f"{where}: ",
    )
    if not isinstance(raw.get("name"), str) or not raw["name"]:
        raise RigError(f'{where}: the entry name is missing; add name = "my rig".')
    texts = {key: _convert(raw.get(key, ""), str, where, key) for key in ("title", "source", "note")}
    sections = {}
    for key, cls in _SECTIONS.items():
        values = _table(raw, key, where)
        _check_keys(values, cls.__struct_fields__, f"{where}: [{key}] ")
        sections[key] = cls(
            **{
                name: _finite(_convert(value, _PLAIN[name], where, f"[{key}] {name}"), where, f"[{key}] {name}")
                if name in _PLAIN
                else _quantity(value, where, f"[{key}] {name}", name)
                for name, value in values.items()
            }
        )
    log = _table(raw, "log", where)
    _check_keys(log, ("sample_rate_hz",), f"{where}: [log] ")
    rate = _number(log["sample_rate_hz"], where, "[log] sample_rate_hz") if log else None
    if rate is not None and rate <= 0:
        raise RigError(f"{where}: [log] sample_rate_hz is {rate:g}; expected a number above 0.")
    own = _channels(_table(raw, "channels", where), where)
    known = {**CHANNELS, **own}
    return Rig(
        name=raw["name"],
        **texts,
        sensors=_sensors(_table(raw, "sensors", where), where, known),
        columns=_columns(_table(raw, "columns", where), where, known, geared="gear_ratio" in raw.get("drivetrain", {})),
        channels=own,
        cascade=_cascade(raw, known, where),
        effects=_effects(_table(raw, "effects", where), where),
        sample_rate=rate,
        thresholds=_thresholds(_table(raw, "thresholds", where), where),
        model=_model_accuracy(_table(raw, "model", where), where),
        phases=phase_rule(_table(raw, "phases", where), where),
        path=where,
        **sections,
    )


def _cascade(raw: dict[str, Any], known: Mapping[str, Channel], where: str) -> Cascade:
    """Stages and their order, `[cascade]` and `[stage.NAME]`; those of the paper where the file states none."""
    if not raw.keys() & {"cascade", "stage"}:
        return PAPER
    from winchcascade.core.cascade_toml import CascadeTable, StageTable, read_cascade

    table = _convert(raw["cascade"], CascadeTable, where, "[cascade]") if "cascade" in raw else None
    stages = _table(raw, "stage", where)
    own = {name: _convert(stage, StageTable, where, f"[stage.{name}]") for name, stage in stages.items()}
    return read_cascade(table, own, known, where)


def _table(raw: dict[str, Any], key: str, where: str) -> dict[str, Any]:
    value = raw.get(key, {})
    if not isinstance(value, dict):
        raise RigError(f"{where}: {key} is {value!r}; expected a table [{key}].")
    return dict(value)


def _convert(value: object, kind: Any, where: str, place: str) -> Any:
    """Check a value against a type; msgspec's finding becomes one sentence with the place in the file."""
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as fault:
        what, _, deeper = str(fault).partition(" - at `$")
        inner = re.sub(r"^\.", " ", deeper.rstrip("`"))
        raise RigError(f"{where}: {place}{inner}: {what[:1].lower()}{what[1:]}.") from None


def _check_keys(raw: Mapping[str, object], known: Sequence[str], place: str) -> None:
    check_keys(raw, known, place, f"no entry of a rig file; expected {', '.join(known)}", RigError)


def _number(value: object, where: str, place: str) -> float:
    return _finite(_convert(value, float, where, place), where, place)


def _finite(value: float, where: str, place: str) -> float:
    if not math.isfinite(value):
        raise RigError(f"{where}: {place} is {value}; expected a finite number.")
    return value


def _quantity(value: object, where: str, place: str, name: str) -> Quantity:
    if not isinstance(value, dict):
        raise RigError(f'{where}: {place} is {value!r}; expected {{ value = ..., unit = "...", source = "..." }}.')
    number: _Number = _convert(value, _Number, where, place)
    unit = find_unit(number.unit)
    dimension = _DIMENSIONS[name]
    if unit is None or unit.dimension != dimension:
        raise RigError(f"{where}: {place}: the unit {number.unit!r} is none of {dimension.replace('_', ' ')}.")
    _finite(number.value, where, place)
    in_si = number.value * unit.factor + unit.offset
    _check_sign(in_si, where, place, name)
    tolerance = None if number.tolerance is None else number.tolerance * unit.factor
    if number.tolerance_percent is not None:
        tolerance = abs(in_si) * number.tolerance_percent / 100.0
    if tolerance is not None and not 0 <= tolerance <= HUGE:
        raise RigError(f"{where}: {place}: the tolerance is {tolerance:g}; expected a number that is not negative.")
    return Quantity(in_si, number.unit, number.source, tolerance)


def _check_sign(value: float, where: str, place: str, name: str) -> None:
    if (name in _POSITIVE and value <= 0) or value < 0:
        raise RigError(f"{where}: {place} is {value:g}; expected a number above 0.")
    low, high = _LIMITS.get(name, (-math.inf, math.inf))
    if not low <= value <= high:
        raise RigError(f"{where}: {place} is {value:g} in SI units; expected between {low:g} and {high:g}.")
    if name in _SHARES and value > 1:
        raise RigError(f"{where}: {place} is {value:g}; expected a share between 0 and 1.")


_OWN_NAME = re.compile(r"[A-Za-z]\w*")
"""A name of a channel of one's own: it stands in products such as `torque * speed`."""


def _channels(raw: dict[str, Any], where: str) -> dict[str, Channel]:
    """Channels of the rig's own, `[channels.NAME] unit = "..."`; the unit decides what is measured."""
    channels = {}
    for name, entry in raw.items():
        place = f"[channels.{name}]"
        if name in CHANNELS or name == "time" or _OWN_NAME.fullmatch(name) is None:
            raise RigError(
                f"{where}: {place}: expected a name of letters, digits and underscores that no built-in channel has; those "
                f"are time, {', '.join(CHANNELS)}."
            )
        if not isinstance(entry, dict):
            raise RigError(f'{where}: [channels] {name} is {entry!r}; expected a table {place} with unit = "...".')
        _check_keys(entry, ("unit",), f"{where}: {place} ")
        text = _convert(entry.get("unit", ""), str, where, f"{place} unit")
        unit = find_unit(text)
        if unit is None:
            raise RigError(
                f'{where}: {place}: the unit {text!r} is unknown; expected one such as "W", "bar", "L/min" or "1".'
            )
        channels[name] = Channel(name, name, unit.dimension, text, f"{name} ({text})")
    return channels


def _sensors(raw: dict[str, Any], where: str, known: Mapping[str, Channel]) -> dict[str, Sensor]:
    sensors = {}
    for name, entry in raw.items():
        place = f"[sensors.{name}]"
        if name not in known:
            raise RigError(f"{where}: {place} is no channel; expected one of {', '.join(known)}.")
        sensor: Sensor = _convert(entry, Sensor, where, place)
        unit = read_as(find_unit(sensor.unit), known[name].dimension)
        if unit is None:
            raise RigError(f"{where}: {place} unit {sensor.unit!r} is none of {known[name].dimension}.")
        if unit.offset and (sensor.low is not None or sensor.high is not None):
            raise RigError(
                f"{where}: {place} unit {sensor.unit!r} does not count from the zero of the channel, as gauge pressure does; "
                'give the range as gauge pressure, such as low = 0, high = 20, unit = "bar".'
            )
        if sensor.low is not None and sensor.high is not None and sensor.low >= sensor.high:
            raise RigError(f"{where}: {place} low {sensor.low:g} is not below high {sensor.high:g}.")
        _check_accuracy(sensor, where, place)
        in_si = {
            key: _finite(value, where, f"{place} {key}") * unit.factor
            for key in ("low", "high", "resolution", "accuracy", "u_zero")
            if (value := getattr(sensor, key)) is not None
        }
        if any(abs(value) > HUGE for value in in_si.values()):
            raise RigError(f"{where}: {place} has a number beyond {HUGE:g} in SI units; check it and its unit.")
        sensors[name] = msgspec.structs.replace(sensor, **in_si)
    return sensors


_SHARES_OF_SENSOR = ("accuracy_full_scale", "accuracy_reading", "daq_full_scale", "daq_reading", "u_gain")

_LARGEST_COVERAGE = 10.0
"""No statement of a maker has a larger coverage factor: k = 2 and 3 are usual."""


def _check_accuracy(sensor: Sensor, where: str, place: str) -> None:
    """Reject accuracies of a sensor that are no size or no share, and coverage factors that are none."""
    for key in ("resolution", "accuracy", "u_zero", *_SHARES_OF_SENSOR):
        size = getattr(sensor, key) or 0.0
        if not 0 <= size <= HUGE:
            raise RigError(f"{where}: {place} {key} is {size:g}; expected a number that is not negative.")
        if size > 1 and key in _SHARES_OF_SENSOR:
            raise RigError(f"{where}: {place} {key} is {size:g}; expected a share, such as 0.002 for 0.2 %.")
    for key in ("accuracy_full_scale", "daq_full_scale"):
        if getattr(sensor, key) is not None and not (sensor.high or sensor.low):
            raise RigError(f"{where}: {place} {key} has no full scale; give the range as high = ... too.")
    known = (sensor.accuracy, sensor.accuracy_full_scale, sensor.accuracy_reading, sensor.u_zero, sensor.u_gain)
    if any((sensor.daq_full_scale, sensor.daq_reading)) and not any(known):
        raise RigError(
            f"{where}: {place} has the share of the acquisition system and no accuracy of the sensor; add the one of the "
            "sensor, such as accuracy_reading = ..."
        )
    stated = {
        "coverage": (sensor.accuracy, sensor.accuracy_full_scale, sensor.accuracy_reading),
        "daq_coverage": (sensor.daq_full_scale, sensor.daq_reading),
    }
    for key, accuracies in stated.items():
        factor = getattr(sensor, key)
        if factor is not None and not 1.0 <= factor <= _LARGEST_COVERAGE:
            raise RigError(f"{where}: {place} {key} is {factor:g}; expected a coverage factor from 1 to 10, such as 2.")
        if factor is not None and not any(accuracies):
            raise RigError(
                f"{where}: {place} {key} belongs to an accuracy, and none is stated; add it or leave {key} out."
            )


def _columns(raw: dict[str, Any], where: str, known: Mapping[str, Channel], *, geared: bool) -> dict[str, Column]:
    """Columns by channel; `geared`: the file states a gear ratio, which a speed of the generator is divided by."""
    columns: dict[str, Column] = {}
    for name, entry in raw.items():
        place = f"[columns] {name}"
        if name not in known and name != "time":
            raise RigError(f"{where}: {place} is no channel; expected time or one of {', '.join(known)}.")
        column = Column(entry) if isinstance(entry, str) else _convert(entry, Column, where, place)
        if bool(column.name.strip()) == (column.number is not None):
            raise RigError(f'{where}: {place}: expected either name = "..." or number = ..., the column from 1 on.')
        if column.number is not None and not 1 <= column.number <= _MOST_COLUMNS:
            raise RigError(f"{where}: {place}: number is {column.number}; expected the column's place, from 1 on.")
        if column.override and column.unit is None:
            raise RigError(
                f'{where}: {place}: override = true without a unit; add unit = "...", or leave override out.'
            )
        if column.side is not None and name != "speed":
            raise RigError(f"{where}: {place}: only the speed of rotation has a side; leave it out.")
        if column.side == "generator" and not geared:
            raise RigError(
                f'{where}: {place}: side = "generator" needs the gear ratio; add gear_ratio under [drivetrain], with the '
                'value 1 for a direct drive, or side = "shaft".'
            )
        dimension, unit = "time" if name == "time" else known[name].dimension, find_unit(column.unit or "")
        if unit is not None and read_as(unit, dimension) is None:
            raise RigError(f"{where}: {place}: the unit {column.unit!r} is none of {dimension}.")
        for other, taken in columns.items():
            if (taken.name, taken.number) == (column.name, column.number):
                called = repr(column.name) if column.number is None else str(column.number)
                raise RigError(f"{where}: {place} and {other} both name the column {called}; expected one each.")
        columns[name] = column
    return columns


def _effects(raw: dict[str, Any], where: str) -> dict[str, StatedEffect]:
    """Effects with their fields, each a number or a table; `logs` lists the logs that they come from."""
    effects = {}
    for name, entries in raw.items():
        place = f"[effects.{name}]"
        if not isinstance(entries, dict):
            raise RigError(f"{where}: [effects] {name} is {entries!r}; expected a table {place}.")
        logs = _convert(entries.get("logs", ()), tuple[str, ...], where, f"{place} logs")
        fields = {
            key: _effect_number(value, where, f"{place} {key}") for key, value in entries.items() if key != "logs"
        }
        effects[name] = StatedEffect(fields, logs)
    return effects


def _effect_number(value: object, where: str, place: str) -> EffectNumber:
    if not isinstance(value, dict):
        return EffectNumber(_number(value, where, place))
    number: EffectNumber = _convert(value, EffectNumber, where, place)
    unit = find_unit(number.unit) if number.unit else None
    if unit is None and number.unit:
        raise RigError(f"{where}: {place}: the unit {number.unit!r} is unknown.")
    factor = 1.0 if unit is None else unit.factor
    in_si = {
        key: _finite(given, where, f"{place} {key}") * factor
        for key in ("value", "low", "high")
        if (given := getattr(number, key)) is not None
    }
    if not in_si.get("low", -math.inf) <= in_si["value"] <= in_si.get("high", math.inf):
        raise RigError(
            f"{where}: {place}: the value {number.value:g} is not between low and high; correct the interval."
        )
    return msgspec.structs.replace(number, **in_si)


def _thresholds(raw: dict[str, Any], where: str) -> Thresholds:
    values: dict[str, Any] = {}
    _check_keys(raw, Thresholds.__struct_fields__, f"{where}: [thresholds] ")
    for name, value in raw.items():
        place = f"[thresholds] {name}"
        if name == "window":
            seconds = isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e9
            if value not in ("auto", "payout") and not seconds:
                raise RigError(f'{where}: {place} is {value!r}; expected "auto", "payout" or a length in seconds.')
            values[name] = str(value)
        elif name in _DIMENSIONS and isinstance(value, dict):
            values[name] = _quantity(value, where, place, name).value
        else:
            values[name] = _number(value, where, place)
            _check_sign(values[name], where, place, name)
    return Thresholds(**values)


def _model_accuracy(raw: dict[str, Any], where: str) -> ModelAccuracy:
    _check_keys(raw, ModelAccuracy.__struct_fields__, f"{where}: [model] ")
    values = {name: _number(value, where, f"[model] {name}") for name, value in raw.items()}
    for name, value in values.items():
        if not 0.0 <= value <= 0.5:
            raise RigError(f"{where}: [model] {name} is {value:g}; expected a share from 0 to 0.5.")
    return ModelAccuracy(**values)
