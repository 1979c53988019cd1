"""Read rig files, built-in or your own, as a Rig; a wrong entry becomes a fault of one sentence
with its place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from functools import cache, lru_cache
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from winchcascade.core.cascade import read_cascade
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.errors import RigError, check_type
from winchcascade.core.machine_parts import Generator, Measure, Restoring, measures
from winchcascade.core.quantity import Calibrated, Quantity, Unit, find_unit, read_as
from winchcascade.core.rig_file import (
    PARTS,
    Column,
    EffectNumber,
    Rig,
    Sensor,
    StatedEffect,
    StatedLaw,
    Thresholds,
)
from winchcascade.core.toml_file import (
    Finite,
    NotNegative,
    Positive,
    Table,
    check_keys,
    convert,
    read_toml,
    shown,
    toml_values,
)

BUILT_IN = ("hsu2026", "kitepower")
DEFAULT_RIG = "hsu2026"
_FOLDER = Path(__file__).parent.parent / "rigfiles"

OTHER_MACHINE = 0.1
"""Share by which the constant k_e of another machine deviates: limits of makers for one machine
are 10 %. [1]
"""

ERRORS = "errors"
"""Table under [sensors] with effects that are errors of sensors."""


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
    """Read a rig file, or the built-in rig of that name where no such file exists; RigError names
    what is wrong.

    Effects that the file states are read as they are; `rig.load_rig` compares them with the
    catalogue.
    """
    path = Path(rig)
    if isfile(path):
        return parse_rig(read_toml(path, RigError), str(path))
    if str(rig) in BUILT_IN:
        return built_in(str(rig))
    raise RigError(
        f"rig {str(rig)!r}: no such file and no built-in rig of that name; give a rig file or one "
        f"of "
        f"{', '.join(BUILT_IN)} (`winchcascade rig hsu2026 > rig.toml` writes one to start from)."
    )


def first_named(*names: str | Path | None, read: Callable[[str | Path], Rig] = read_rig) -> Rig:
    """Read the first rig that is named; that of the paper, as assumed, if none is. Raises RigError
    as `read`.

    >>> first_named(None, "kitepower").name, first_named(None).assumed
    ('kitepower', True)
    """
    return next((read(name) for name in names if name is not None), None) or replace(
        built_in(), assumed=True
    )


def given_rig(call: str, rig: Rig | None, usual: Rig | None = None) -> Rig:
    """The rig that a call of the library was given, else the usual one, of a run, else that of the
    paper, as assumed.

    OptionError if something else than a rig was given.
    """
    found = rig if rig is not None else usual or first_named()
    check_type(f"{call}, rig", found, Rig, "load_rig(name)")
    return found


@lru_cache(maxsize=16)
def parse_rig(text: str, where: str) -> Rig:
    """Turn the text of a rig file into a Rig; `where` names the file in the one sentence of a
    RigError. All logs of one file share its rig.

    `based_on = "hsu2026"` takes everything that the file does not state from that built-in rig, but
    for sizes of its motion and its machine: thresholds with a dimension, and the rated values of
    another machine. Entries are read table by table: what has a unit becomes a number in SI units,
    and the struct of the table checks the rest.
    """
    own_parts = toml_values(text, where, RigError)
    base = own_parts.pop("based_on", None)
    raw = own_parts if base is None else _merged(_base(base, own_parts, where), own_parts)
    texts, tables = ("name", "title", "source", "note"), ("sensors", "channels", "effects", "stage")
    check_keys(
        raw, (*texts, *PARTS, *tables, "columns", "cascade", "laws", "log"), f"{where}:", RigError
    )
    sensors, channels, effects, stages = (
        convert(raw.get(name, {}), dict[str, Table], f"{where}: {name}", RigError)
        for name in tables
    )
    own = {
        name: _channel(name, table, f"{where}: [channels.{name}]")
        for name, table in channels.items()
    }
    known = {**CHANNELS, **own}
    errors = convert(
        sensors.pop(ERRORS, {}), dict[str, Table], f"{where}: [sensors.{ERRORS}]", RigError
    )
    check_keys(sensors, known, f"{where}: [sensors]", RigError)
    log: _Log = convert(raw.get("log", {}), _Log, f"{where}: [log]", RigError)
    read = {
        **{name: raw[name] for name in texts if name in raw},
        **{
            name: _part(raw.get(name, {}), kind, f"{where}: [{name}]")
            for name, kind in PARTS.items()
        },
        "sensors": {
            name: _sensor(one, known[name], f"{where}: [sensors.{name}]")
            for name, one in sensors.items()
        },
        "columns": read_columns(raw.get("columns", {}), known, where, {}),
        "channels": own,
        "effects": {
            name: _effect(one, f"{where}: [{table}.{name}]", of_a_sensor=stated is errors)
            for table, stated in (("effects", effects), (f"sensors.{ERRORS}", errors))
            for name, one in stated.items()
        },
        "laws": convert(
            raw.get("laws", {}), dict[str, dict[str, StatedLaw]], f"{where}: laws", RigError
        ),
        "cascade": read_cascade(raw.get("cascade"), stages, known, where),
        "sample_rate": log.sample_rate_hz,
        "path": where,
        "inherited": _paths(raw) - _paths(own_parts),
    }
    rig: Rig = convert(read, Rig, f"{where}:", RigError)
    if (
        any(column.side == "generator" for column in rig.columns.values())
        and rig.drivetrain.gear_ratio is None
    ):
        raise RigError(
            f'{where}: [columns] speed: side = "generator" needs the gear ratio; add gear_ratio '
            f"under [drivetrain], with "
            'the value 1 for a direct drive, or side = "shaft".'
        )
    return rig


def _paths(raw: Mapping[str, object]) -> frozenset[str]:
    """Numbers of the parts of a rig file, as `generator.k_e`."""
    tables = {part: raw.get(part) for part in PARTS}
    return frozenset(
        f"{part}.{name}"
        for part, table in tables.items()
        for name in (table if isinstance(table, Mapping) else ())
    )


class _Log(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [log]: what holds for every log of the rig."""

    sample_rate_hz: Positive | None = None


def _base(name: object, over: Table, where: str) -> Table:
    """Tables of the built-in rig below another one, without what that does not take over.

    These are thresholds with a dimension; numbers and pressure sensor of a restoring module of
    another kind; the mesh efficiency of a gear where the machine is on the shaft of the drum; and
    the rated values of a machine with another constant k_e.
    """
    if name not in BUILT_IN:
        raise RigError(
            f"{where}: based_on = {name!r} is no built-in rig; expected one of "
            f"{', '.join(BUILT_IN)}."
        )
    base = toml_values(built_in_text(str(name)), str(name), RigError)
    below, above = (
        {part: _table(rig, part, where) for part in ("restoring", "drivetrain", "generator")}
        for rig in (base, over)
    )
    dropped: dict[str, Collection[str]] = {"thresholds": {*measures(Thresholds), "rpm_bin"}}
    kinds = [rig["restoring"].get("kind", Restoring().kind) for rig in (below, above)]
    if kinds[0] != kinds[1]:
        dropped |= {"restoring": below["restoring"], "sensors": {"pressure"}}
    gear = above["drivetrain"].get("gear_ratio")
    if isinstance(gear, dict) and gear.get("value") == 1:
        dropped["drivetrain"] = {"eta_mesh"}
    machines = [rig["generator"].get("k_e") for rig in (below, above)]
    if None not in machines:
        measure = measures(Generator)["k_e"]
        known, other = (
            _quantity(number, f"{where}: [generator] k_e", measure).value for number in machines
        )
        if abs(other - known) > OTHER_MACHINE * known:
            dropped["generator"] = {"i_rated", "speed_rated"}
    kept = {
        table: {key: x for key, x in _table(base, table, where).items() if key not in names}
        for table, names in dropped.items()
    }
    return base | kept


def _table(rig: Table, name: str, where: str) -> Table:
    """A table of a rig file; empty where it is not stated."""
    table: Table = convert(rig.get(name, {}), Table, f"{where}: [{name}]", RigError)
    return table


def _merged(base: Mapping[str, object], over: Mapping[str, object]) -> Table:
    """Lay one table over another; what has a unit or a name is replaced whole, so that no old
    number clings to it.
    """
    loads = {"load_u_percent", "load_limits_percent"}
    merged = {
        key: value for key, value in base.items() if not (key in loads and loads & over.keys())
    }
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


def _unit(text: str, dimension: str, place: str) -> Unit:
    """The unit of a text, of a dimension; of any if that is empty."""
    unit = find_unit(text)
    unit = read_as(unit, dimension) if dimension else unit
    if unit is None:
        raise RigError(
            f"{place}: the unit {text!r} is none of "
            f"{dimension.replace('_', ' ') or 'those that are known'}."
        )
    return unit


def _part(raw: object, kind: Any, place: str) -> Any:
    """Read a table by the struct that declares its entries: numbers with a unit first, then all
    others.
    """
    table: Table = dict(convert(raw, Table, place, RigError))
    for name, measure in measures(kind).items():
        stated, of_motion = table.get(name), kind is Thresholds
        if isinstance(stated, dict) or (stated is not None and not of_motion):
            number = _quantity(stated, f"{place} {name}", measure)
            table[name] = number.value if of_motion else number
    return convert(table, kind, place, RigError)


UNCERTAINTIES = ("u", "u_percent", "limits", "limits_percent")
"""Keys of the uncertainty of a number, of which one is stated: a standard uncertainty, or the
maker's +- limits.
"""


class _Calibrated(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a calibrated number comes from: a log with its SHA-256, and the number as it was
    before.
    """

    log: str
    sha256: Annotated[str, Meta(pattern="^([0-9a-f]{64})?$")]
    prior: Table | None = None


class _Number(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A number as a rig file writes it, with one of `UNCERTAINTIES` at most."""

    value: Finite
    unit: str
    source: str = ""
    u: NotNegative | None = None
    u_percent: NotNegative | None = None
    limits: NotNegative | None = None
    limits_percent: NotNegative | None = None
    calibrated: _Calibrated | None = None

    def __post_init__(self) -> None:
        """Reject several uncertainties: ValueError."""
        if len(self.uncertainties) > 1:
            raise ValueError(
                f"{' and '.join(self.uncertainties)} are both there; expected one of them."
            )

    @property
    def uncertainties(self) -> dict[str, float]:
        """Those that are stated, by their keys."""
        return {key: value for key in UNCERTAINTIES if (value := getattr(self, key)) is not None}


def _quantity(raw: object, place: str, measure: Measure) -> Quantity:
    """Read a number with unit, source and uncertainty in SI units; limits are those of a
    rectangular distribution.
    """
    if not isinstance(raw, dict):
        raise RigError(
            f"{place} is {shown(raw)}; expected a table with its unit, such as {{ value = 1.5, "
            f'unit = "m" }}.'
        )
    number: _Number = convert(raw, _Number, place, RigError)
    unit = _unit(number.unit, measure.dimension, place)
    value: float = convert(
        number.value * unit.factor + unit.offset, measure.si, f"{place} in SI units", RigError
    )
    u, limits = None, False
    for key, stated in number.uncertainties.items():
        limits = key.startswith("limits")
        half = stated * (abs(value) / 100.0 if key.endswith("_percent") else unit.factor)
        u = half / math.sqrt(3.0) if limits else half
    calibrated = None
    if (record := number.calibrated) is not None:
        prior, where = None, f"{place} calibrated prior"
        if record.prior is not None:
            check_keys(record.prior, ("value", "u", "source"), where, RigError)
            prior = _quantity({"unit": number.unit, **record.prior}, where, measure)
        calibrated = Calibrated(record.log, record.sha256, prior)
    return Quantity(value, number.unit, number.source, u, calibrated, limits)


def _channel(name: str, table: Table, place: str) -> Channel:
    """A channel of the rig's own; its unit decides what is measured, and a power may name it,
    such as `torque * pump`.
    """
    if name in CHANNELS or name == "time" or not name.isidentifier():
        raise RigError(
            f"{place}: expected a name of letters, digits and underscores that no built-in "
            f"channel has; those are time, "
            f"{', '.join(CHANNELS)}."
        )
    check_keys(table, ("unit",), place, RigError)
    text = str(table.get("unit"))
    return Channel(name, name, _unit(text, "", place).dimension, text, f"{name} ({text})")


def _sensor(table: Table, channel: Channel, place: str) -> Sensor:
    """A sensor in SI units."""
    sensor: Sensor = convert(table, Sensor, place, RigError)
    unit = _unit(sensor.unit, channel.dimension, place)
    if unit.dimension == "pressure" and unit.offset and (sensor.low, sensor.high) != (None, None):
        raise RigError(
            f"{place} unit {sensor.unit!r} does not count from the zero of the channel; give the "
            f"range as gauge pressure, "
            'such as low = 0, high = 20, unit = "bar".'
        )
    in_si = {
        key: value * unit.factor + (unit.offset if key in ("low", "high") else 0.0)
        for key in ("low", "high", "resolution", "accuracy", "u_zero")
        if (value := getattr(sensor, key)) is not None
    }
    return replace(sensor, **in_si)


def read_columns(
    raw: object, known: Mapping[str, Channel], where: str, others: Mapping[str, Column]
) -> dict[str, Column]:
    """Read a table of columns by channel, which precedes the `others`.

    RigError for an unknown channel, a wrong entry, or one column of two channels.
    """
    stated = convert(raw, dict[str, Table | str | list[str]], f"{where}: columns", RigError)
    check_keys(stated, (*known, "time"), f"{where}: [columns]", RigError)
    columns = {name: column for name, column in others.items() if name not in stated}
    for name, table in stated.items():
        place = f"{where}: [columns] {name}"
        column: Column = convert(
            table if isinstance(table, dict) else {"name": table}, Column, place, RigError
        )
        dimension = "time" if name == "time" else known[name].dimension
        if (
            column.unit is not None and find_unit(column.unit) is not None
        ):  # a log may name it in words of its own
            _unit(column.unit, dimension, place)
        for other, taken in columns.items():
            for shared in (*column.names, column.number):
                if shared is not None and shared in (*taken.names, taken.number):
                    raise RigError(f"{place} and {other} both name the column {shared!r}.")
        columns[name] = column
    return columns


def _effect(table: Table, place: str, *, of_a_sensor: bool = False) -> StatedEffect:
    """An effect of the rig or of a sensor; each field is a number or a table, with a unit its
    numbers are read in SI units.
    """
    fields = {}
    for key, raw in table.items():
        if key == "logs":
            continue
        number: EffectNumber = convert(
            raw if isinstance(raw, dict) else {"value": raw},
            EffectNumber,
            f"{place} {key}",
            RigError,
        )
        factor = _unit(number.unit, "", f"{place} {key}").factor if number.unit else 1.0
        ends = {
            end: factor * value
            for end in ("value", "low", "high")
            if (value := getattr(number, end)) is not None
        }
        fields[key] = replace(number, **ends)
    logs = convert(table.get("logs", ()), tuple[str, ...], f"{place} logs", RigError)
    return StatedEffect(fields, logs, of_a_sensor)
