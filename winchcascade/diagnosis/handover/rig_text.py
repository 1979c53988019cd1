"""Edit rig files: calibrated numbers or named causes go into the document of the file, and all
else of it stays as it is.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import Calibrated, Quantity, Unit, find_unit
from winchcascade.core.rig_file import EffectNumber, Rig, StatedEffect
from winchcascade.core.rig_toml import built_in_text, parse_rig
from winchcascade.core.version import __version__
from winchcascade.diagnosis.fit.nuisances import calibrated_numbers, quantity_of, with_quantity
from winchcascade.diagnosis.fit.suspects import freedom, with_values
from winchcascade.diagnosis.judge.causes import COVERED, posterior_of
from winchcascade.diagnosis.verdict_limits import LAW
from winchcascade.rig.baseline import stated_effects
from winchcascade.rig.effects.catalogue import SHARED_RADIUS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tomlkit.items import InlineTable, Table

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.handover.calibrate import Calibration

MARK, CORRECTED = "# Calibrated by winchcascade/", "# Corrected by winchcascade/"
"""Beginnings of the first line of a calibrated rig file and of one with effects that a diagnosis
found.
"""

Entry = dict[str, Any]
"""A number as a rig file has it, in the unit of the file."""


def calibrated_text(calibration: Calibration) -> str:
    """Write the numbers that an open circuit gives into the text of the rig file.

    A number that is found anew gets its value, its standard uncertainty as `u`, a `source` that
    names the log, and as `calibrated` the log and the number before the first calibration; a number
    that the log does not determine better keeps its entry. The first line names this tool, its
    version and the log.

    Raises
    ------
    RigError : the rig file cannot be read again
    LogError : a number comes out as no rig has it
    """
    run, numbers = calibration.run, dict[tuple[str, str], Quantity]()
    for n in (number for number in calibration.numbers if number.new):
        if n.value <= 0.0:
            raise LogError(
                f"{run.name}: {n.name} comes out as {n.value:.3g}, which no rig has, so that no "
                f"rig file is written; check "
                "sign, unit and zero of the log's force and torque."
            )
        old = quantity_of(calibration.rig, n.section, n.name)
        prior = old if old is None or old.calibrated is None else old.calibrated.prior
        unit = n.unit if old is None else old.unit
        was = "" if math.isnan(n.before) else f"; was {_in_file(n.before, unit):.6g}"
        source, record = (
            f"calibrated from {log_name(run)}: {n.how}{was}",
            Calibrated(run.name, run.sha256, prior),
        )
        numbers[n.section, n.name] = Quantity(n.value, unit, source, n.u, record)
    names = ", ".join(name for _, name in numbers) or "no number"
    return _edited(
        calibration.rig, f"{MARK}{__version__} from {log_name(run)}: {names}.", numbers, {}
    )


def corrected_text(
    rig: Rig,
    effects: Mapping[str, StatedEffect],
    entries: Mapping[tuple[str, str], Quantity],
    title: str,
) -> str:
    """Write effects into the text of a rig file, in place of those that it states by the same
    names, and corrected numbers.

    Errors of sensors go to [sensors.errors]: they change what is read of the rig. Calibrated
    numbers are as before their calibration again, since the effects were found against those.

    Parameters
    ----------
    entries : corrected numbers by section and name
    title : of the campaign that they were found from, which the first line names

    Raises
    ------
    RigError : the rig file cannot be read again
    """
    numbers = {place: number.prior for place, number in calibrated_numbers(rig).items()} | dict(
        entries
    )
    names = ", ".join([*effects, *(name for _, name in numbers)])
    return _edited(
        rig, f"{CORRECTED}{__version__} from {printable_name(title)}: {names}.", numbers, effects
    )


def _edited(
    rig: Rig,
    mark: str,
    numbers: Mapping[tuple[str, str], Quantity],
    effects: Mapping[str, StatedEffect],
) -> str:
    """The text of a rig file with a first line, numbers by section and name, and effects; line
    ends as they are.
    """
    import tomlkit

    text = _text_of(rig)
    first, _, rest = text.partition("\n")
    document = tomlkit.parse(
        (rest if first.startswith((MARK, CORRECTED)) else text).replace("\r\n", "\n")
    )
    for (section, name), quantity in numbers.items():
        _put(
            document.setdefault(section, tomlkit.table()),
            name,
            _entry(quantity),
            tomlkit.inline_table(),
        )
    for name, effect in effects.items():
        group = document
        for part in effect.table(name).split(".")[:-1]:
            group = group.setdefault(part, tomlkit.table(is_super_table=True))
        numbers_of = {field: msgspec.to_builtins(number) for field, number in effect.fields.items()}
        stated = {
            field: {key: x for key, x in number.items() if x is not None}
            for field, number in numbers_of.items()
        }
        _put(group, name, {"logs": list(effect.logs), **stated}, tomlkit.table())
    edited = document.as_string()
    if tomllib.loads(edited) != document.unwrap():
        raise RigError(
            f"{rig.path}: cannot be edited without a change to other entries; put each on a line "
            f"of its own."
        )
    parse_rig(edited, rig.path)
    return f"{mark}\n{edited}".replace("\n", "\r\n" if "\r\n" in text else "\n")


def _put(parent: Any, name: str, entry: Entry, new: Table | InlineTable) -> None:
    """Give a table of a document these keys alone: the one that is there, with its comments, or
    a new one.
    """
    from tomlkit import inline_table
    from tomlkit.items import Table

    if not isinstance(parent.get(name), Table):
        parent[name] = new
    for key in list(parent[name]):
        parent[name].pop(key)
    for key, value in entry.items():
        if isinstance(value, dict):
            _put(parent[name], key, value, inline_table())
        else:
            parent[name][key] = value


def _entry(number: Quantity) -> Entry:
    """A number in the unit of its file; a number before its calibration has the same unit, which
    is not repeated.
    """
    entry: Entry = {
        "value": float(f"{_in_file(number.value, number.unit):.9g}"),
        "unit": number.unit,
    }
    if number.u is not None:
        entry["u"] = float(
            f"{number.u * (_in_file(1.0, number.unit) - _in_file(0.0, number.unit)):.9g}"
        )
    if number.source:
        entry["source"] = number.source
    if (found := number.calibrated) is not None:
        entry["calibrated"] = {"log": printable_name(found.log), "sha256": found.sha256}
        if found.prior is not None:
            entry["calibrated"]["prior"] = {
                key: x for key, x in _entry(found.prior).items() if key != "unit"
            }
    return entry


def _in_file(value: float, unit: str) -> float:
    """A number in the unit that a rig file has for it, of its value in SI units."""
    scale = find_unit(unit) or Unit("number", 1.0)
    return (value - scale.offset) / scale.factor


def _text_of(rig: Rig) -> str:
    """Text of the file that a rig was read from, line ends as they are."""
    if rig.path == f"built-in rig {rig.name}":
        return built_in_text(rig.name)
    try:
        return Path(rig.path).read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as fault:
        raise RigError(
            f"{rig.path}: the rig file cannot be read again ({fault}); give it by --rig."
        ) from None


def printable_name(name: str) -> str:
    """A name without characters that a line of a rig file cannot hold."""
    return "".join(c if c.isprintable() else "?" for c in name)


def log_name(run: Run) -> str:
    """Name a log by its file, the first digits of its SHA-256 and its length."""
    return (
        f"{printable_name(run.name)} (sha256 {run.sha256[:12] or 'unknown'}, {run.samples} samples)"
    )


def corrected_rig_text(found: ModelDiagnosis) -> str:
    """Write the causes of a diagnosis into the text of its rig file, with its verdict; RigError
    where that is not possible.
    """
    return corrected_text(
        found.rig, *corrections(found), f"{found.title} ({found.verdict.replace('_', ' ')})"
    )


def corrected_rig(found: ModelDiagnosis) -> Rig:
    """The rig that a diagnosis started from, with its named causes as effects."""
    effects, entries = corrections(found)
    rig = msgspec.structs.replace(found.data.rig, effects={**found.rig.effects, **effects})
    for place, number in entries.items():
        rig = with_quantity(rig, *place, number)
    return rig


def corrections(
    found: ModelDiagnosis,
) -> tuple[dict[str, StatedEffect], dict[tuple[str, str], Quantity]]:
    """Named causes as a rig file states them: effects with the logs of the fit, and corrected
    numbers by section and name.

    A wrong entry corrects its number, with its standard uncertainty; only the motion that a logger
    computes with the same wrong radius gets its scale. A wrong load of one run is an entry of the
    campaign. A cause that the rig file states already is a further change: its values become those
    of both together.
    """
    logs = tuple(log_name(run) for k, run in enumerate(found.runs) if k not in found.data.withheld)
    names, fit, title = (
        [cause.effect for cause in found.causes],
        found.found.best,
        printable_name(found.title),
    )
    u = np.sqrt(np.diag(posterior_of(found.found, fit).covariance))
    effects, entries = dict[str, StatedEffect](), dict[tuple[str, str], Quantity]()
    for name in names:
        effect, place = found.suspects[name], fit.place[name]
        share = 1.0 + float(fit.x[place.start])
        if effect.law is SHARED_RADIUS.law:
            scale = EffectNumber(1.0 / share - 1.0, "1", f"diagnosis of {title}")
            effects["encoder_scale"] = StatedEffect({"scale_error": scale}, logs, of_a_sensor=True)
        if effect.entry is not None and effect.number:
            section, _, key = effect.number.partition(".")
            if (old := quantity_of(found.data.rig, section, key)) is not None:
                source = f"diagnosis of {title}: {share:.4g} times the stated number"
                new_u = abs(old.value) * float(u[place.start])
                entries[section, key] = Quantity(old.value * share, old.unit, source, new_u)
        elif effect.entry is None or effect.entry.log < 0:
            beside = " and ".join(other for other in names if other != name)
            source = f"diagnosis of {title}{f', fitted with {beside}' if beside else ''}"
            numbers = _numbers(found, name, fit.x[place], u[place], source)
            effects[name] = StatedEffect(numbers, logs, of_a_sensor=effect.of_a_sensor)
    return effects, entries


def _numbers(
    found: ModelDiagnosis, name: str, values: Signal, u: Signal, source: str
) -> dict[str, EffectNumber]:
    """Fields of a cause, (k,), with their intervals; one at a bound of its range has none."""
    effect = found.suspects[name]
    earlier = {one.effect.name: one.values for one in stated_effects(found.rig)}.get(name)
    half = COVERED * np.hypot(u, LAW * np.abs(values - freedom(effect).absent))
    numbers = {}
    for k, field in enumerate(effect.fields):
        ends = np.tile(values, (3, 1))
        ends[:, k] += (-half[k], 0.0, half[k])
        changes = [with_values(effect, row) for row in ends]
        low, value, high = (
            (change if earlier is None else change.after(earlier)).values[k] for change in changes
        )
        low, value, high = (float(f"{x:.6g}") for x in (low, value, high))
        minimum, maximum = field.limits
        interval = {"low": max(low, minimum), "high": min(high, maximum)} if u[k] else {}
        numbers[field.name] = EffectNumber(value, field.unit, source, **interval)
    return numbers
