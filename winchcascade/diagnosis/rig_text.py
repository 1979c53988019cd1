"""Write calibrated numbers or named causes into the text of a rig file and keep all else: comments, order, line ends."""

from __future__ import annotations

import json
import math
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import Quantity, Unit, find_unit
from winchcascade.core.rig_file import EffectNumber, Rig, StatedEffect
from winchcascade.core.rig_toml import ERRORS, UNCERTAINTIES, built_in_text, parse_rig
from winchcascade.core.version import __version__
from winchcascade.diagnosis.causes import COVERED, posterior_of
from winchcascade.diagnosis.limits import LAW
from winchcascade.diagnosis.nuisances import calibrated_numbers, quantity_of, with_quantity
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.rig.baseline import stated_effects
from winchcascade.rig.effects.catalogue import EFFECTS, SHARED_RADIUS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.calibrate import Calibration, Number
    from winchcascade.diagnosis.diagnose import ModelDiagnosis

MARK = "# Calibrated by winchcascade/"
"""Beginning of the first line of a calibrated rig file, by which the tool recognises its own files."""

CORRECTED = "# Corrected by winchcascade/"
"""How the first line of a rig file with effects that a diagnosis found begins."""

CALIBRATED = "calibrated from "
"""How the source of a calibrated number begins."""

_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(#.*)?$")
_KEY = re.compile(r"""\s*([A-Za-z0-9_\-."' \t]+?)\s*=""")
_SIGN = r"""[^{}"']|"(?:\\.|[^"\\])*"|'[^']*'"""
_PRIOR = rf"\{{(?:{_SIGN})*\}}"
_CALIBRATED = rf"\{{(?:{_SIGN}|{_PRIOR})*\}}"
_TABLE = re.compile(rf"\{{(?:{_SIGN}|{_CALIBRATED})*\}}")
_quoted = partial(json.dumps, ensure_ascii=False)
"""A TOML string; JSON escapes the same characters by the same signs."""

_OF_A_NUMBER = ("value", "unit", "source", "calibrated", *UNCERTAINTIES)


def calibrated_text(calibration: Calibration) -> str:
    """Write the numbers that an open circuit gives into the text of the rig file.

    A number that is found anew gets its value, its standard uncertainty as `u`, a `source` that names the log, and as
    `calibrated` the log and the number before the first calibration; a number that the log does not determine better keeps its
    entry. The first line names this tool, its version and the log.

    Raises
    ------
    RigError : the rig file cannot be read again, or writes a number in a way that cannot be replaced
    LogError : a number comes out as no rig has it
    """
    found = [number for number in calibration.numbers if number.new]
    for number in found:
        if number.value <= 0.0:
            raise LogError(
                f"{calibration.run.name}: {number.name} comes out as {number.value:.3g}, which no rig has, so that no rig file "
                "is written; check sign, unit and zero of the log's force and torque."
            )
    text = _text_of(calibration.rig)
    for number in found:
        text = _with_entry(text, (number.section, number.name), _entry(number, calibration))
    text = _marked(text, MARK, log_name(calibration.run), [number.name for number in found] or ["no number"])
    _check(text, calibration.rig, found)
    return text


def corrected_text(
    rig: Rig, effects: Mapping[str, StatedEffect], entries: Mapping[tuple[str, str], Quantity], title: str
) -> str:
    """Write effects into the text of a rig file, in place of those that it states by the same names, and corrected numbers.

    Errors of sensors, also those that the file stated among the effects of the rig, go to [sensors.errors]: they change what is
    read of the rig. Calibrated numbers are as before their calibration again, since the effects were found against those.

    Parameters
    ----------
    entries : corrected numbers by section and name
    title : of the campaign that they were found from, which the first line names

    Raises
    ------
    RigError : the rig file cannot be read again, or states an effect in a way that cannot be replaced
    """
    text = _text_of(rig)
    first, _, rest = text.partition("\n")
    text, end = rest if first.startswith(MARK) else text, _line_end(text)
    effects = _by_place({**{name: one for name, one in rig.effects.items() if _is_misplaced(name, one)}, **effects})
    for name, effect in effects.items():
        for place in (("effects", name), ("sensors", ERRORS, name)):
            text = "".join(_without_table(text.splitlines(keepends=True), place))
        text = f"{text.rstrip()}{end}{end}{end.join(_effect_lines(name, effect))}{end}"
    changed = {place: number.prior for place, number in calibrated_numbers(rig).items()} | dict(entries)
    for place, number in changed.items():
        text = _with_entry(text, place, _quantity_entry(number) if place in entries else _prior_entry(number))
    text = _marked(text, CORRECTED, printable_name(title), [*effects, *(name for _, name in changed)])
    expected = msgspec.structs.replace(rig, effects={**rig.effects, **effects}, assumed=False)
    try:
        again = parse_rig(text, rig.path)
        for place, number in changed.items():
            written = quantity_of(again, *place)
            if written is not None and written.calibrated is None and written.source == number.source:
                again = with_quantity(again, *place, quantity_of(rig, *place))
    except RigError as fault:
        raise RigError(
            f"{rig.path}: cannot be corrected ({fault}); write each effect that it states as a table [effects.NAME]."
        ) from None
    if again != expected:
        raise RigError(
            f"{rig.path}: cannot be corrected without a change to other entries; put each on a line of its own."
        )
    return text


def _is_misplaced(name: str, effect: StatedEffect) -> bool:
    """Whether an effect of the catalogue is an error of a sensor that a rig file states among the effects of the rig."""
    return name in EFFECTS and EFFECTS[name].of_a_sensor and not effect.of_a_sensor


def _by_place(effects: Mapping[str, StatedEffect]) -> dict[str, StatedEffect]:
    """Effects, each with the place of its table."""
    return {
        name: msgspec.structs.replace(effect, of_a_sensor=True) if _is_misplaced(name, effect) else effect
        for name, effect in effects.items()
    }


def _quantity_entry(number: Quantity) -> dict[str, str]:
    """Keys and TOML values of a number in the unit of its file."""
    scale, u = find_unit(number.unit) or Unit("number", 1.0), number.u or 0.0
    return {
        "value": rounded((number.value - scale.offset) / scale.factor, u / scale.factor),
        "unit": _quoted(number.unit),
        "u": f"{u / scale.factor:.3g}",
        "source": _quoted(number.source),
    }


def _prior_entry(number: Quantity) -> dict[str, str]:
    """Keys and TOML values of a number as it was before its calibration."""
    stated = _stated(number)
    return {"value": stated["value"], "unit": _quoted(number.unit), **stated}


def _stated(number: Quantity) -> dict[str, str]:
    """Value, standard uncertainty and source of a number, in the unit of its file; none that is not stated."""
    scale = find_unit(number.unit) or Unit("number", 1.0)
    entry = {"value": f"{(number.value - scale.offset) / scale.factor:.12g}"}
    if number.u is not None:
        entry["u"] = f"{number.u / scale.factor:.12g}"
    return entry | ({"source": _quoted(number.source)} if number.source else {})


def _inline(entry: Mapping[str, str]) -> str:
    """An inline table."""
    return f"{{ {', '.join(f'{key} = {value}' for key, value in entry.items())} }}"


def _effect_lines(name: str, effect: StatedEffect) -> Iterator[str]:
    yield f"[{effect.table(name)}]"
    yield "logs = ["
    yield from (f"    {_quoted(log)}," for log in effect.logs)
    yield "]"
    for field, number in effect.fields.items():
        yield f"{field} = {{ {', '.join(_effect_entries(number))} }}"


def _effect_entries(number: EffectNumber) -> Iterator[str]:
    yield f"value = {number.value!r}"
    yield f"unit = {_quoted(number.unit)}"
    yield from (f"{name} = {end!r}" for name in ("low", "high") if (end := getattr(number, name)) is not None)
    yield f"source = {_quoted(number.source)}"


def _without_table(lines: Sequence[str], path: tuple[str, ...]) -> Iterator[str]:
    """Lines without a table and the tables in it; comments before the next header stay."""
    inside, held = False, list[str]()
    for line in lines:
        if header := _HEADER.match(line):
            inside = _path(header[1])[: len(path)] == path
        if not inside:
            yield from (*held, line)
            held = []
        elif line.strip() and not line.lstrip().startswith("#"):
            held = []
        else:
            held.append(line)
    yield from held


def _line_end(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def _marked(text: str, mark: str, source: str, names: Sequence[str]) -> str:
    """The text with a first line that names this tool, its version and where the named entries come from."""
    first, _, rest = text.partition("\n")
    return f"{mark}{__version__} from {source}: {', '.join(names)}.{_line_end(text)}" + (
        rest if first.startswith(mark) else text
    )


def _text_of(rig: Rig) -> str:
    """Text of the file that a rig was read from, line ends as they are."""
    if rig.path == f"built-in rig {rig.name}":
        return built_in_text(rig.name)
    try:
        return Path(rig.path).read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as fault:
        raise RigError(f"{rig.path}: the rig file cannot be read again ({fault}); give it by --rig.") from None


def printable_name(name: str) -> str:
    """A name without characters that a line of a rig file cannot hold."""
    return "".join(c if c.isprintable() else "?" for c in name)


def log_name(run: Run) -> str:
    """Name a log by its file, the first digits of its SHA-256 and its length."""
    return f"{printable_name(run.name)} (sha256 {run.sha256[:12] or 'unknown'}, {run.samples} samples)"


def _entry(number: Number, calibration: Calibration) -> dict[str, str]:
    """Keys and TOML values of a calibrated number, in the unit that the rig file has for it."""
    old = quantity_of(calibration.rig, number.section, number.name)
    unit = number.unit if old is None else old.unit
    scale = find_unit(unit) or Unit("number", 1.0)
    u = number.u / scale.factor
    was = "" if math.isnan(number.before) else f"; was {(number.before - scale.offset) / scale.factor:.6g}"
    record = {"log": _quoted(printable_name(calibration.run.name)), "sha256": _quoted(calibration.run.sha256)}
    prior = old if old is None or old.calibrated is None else old.calibrated.prior
    if prior is not None:
        record["prior"] = _inline(_stated(prior))
    return {
        "value": rounded((number.value - scale.offset) / scale.factor, u),
        "unit": _quoted(unit),
        "u": f"{u:.3g}",
        "source": _quoted(f"{CALIBRATED}{log_name(calibration.run)}: {number.how}{was}"),
        "calibrated": _inline(record),
    }


def rounded(value: float, u: float) -> str:
    """A number with digits down to a hundredth of its uncertainty.

    >>> rounded(0.0618228492643, 6.3e-5)
    '0.0618228'
    """
    decimals = 2 - math.floor(math.log10(u)) if u > 0.0 else 12
    return repr(round(value, decimals))


def _with_entry(text: str, wanted: tuple[str, str], entry: dict[str, str]) -> str:
    """Replace the entry of a number by section and name, an inline table or keys of their own, or add it if there is none."""
    lines = text.splitlines(keepends=True)
    end = _line_end(text)
    inline = _inline(entry)
    section, own = None, []
    for k, here, key in _keys(lines):
        path = here + _path(key)
        if path == wanted and (table := _TABLE.search(lines[k])):
            lines[k] = lines[k][: table.start()] + inline + lines[k][table.end() :]
            return "".join(lines)
        if path[:-1] == wanted and path[-1] in _OF_A_NUMBER:
            own.append((k, key))
        section = k if here == wanted[:1] else section
    if own:
        return "".join(_with_keys(lines, own, entry, end))
    added = f"{wanted[1]} = {inline}{end}"
    if section is None:
        return f"{text.rstrip()}{end}{end}[{wanted[0]}]{end}{added}"
    lines[section] = f"{lines[section].rstrip()}{end}{added}"
    return "".join(lines)


def _keys(lines: Sequence[str]) -> Iterator[tuple[int, tuple[str, ...], str]]:
    """Lines with a header or a key: number of the line, path of the table that it stands in, and the key, "" for a header."""
    here: tuple[str, ...] = ()
    for k, line in enumerate(lines):
        if header := _HEADER.match(line):
            here = _path(header[1])
            yield k, here, ""
        elif key := _KEY.match(line):
            yield k, here, key[1]


def _path(key: str) -> tuple[str, ...]:
    """Parts of a dotted key."""
    return tuple(part.strip().strip("\"'") for part in key.split("."))


def _with_keys(lines: Sequence[str], own: Sequence[tuple[int, str]], entry: dict[str, str], end: str) -> Iterator[str]:
    """Lines in which the keys of one number, each on a line of its own, are replaced."""
    first, key = own[0]
    stem = key[: key.rfind(".") + 1]
    gone = {k for k, _ in own}
    for k, line in enumerate(lines):
        if k == first:
            yield from (f"{stem}{name} = {value}{end}" for name, value in entry.items())
        elif k not in gone:
            yield line


def _check(text: str, rig: Rig, found: Sequence[Number]) -> None:
    """Read the text again: the calibrated numbers must be in it, and nothing else may have changed."""
    try:
        again = parse_rig(text, rig.path)
    except RigError:
        again = None
    for number in found:
        new = None if again is None else quantity_of(again, number.section, number.name)
        if again is None or new is None or not new.source.startswith(CALIBRATED):
            raise RigError(
                f"{rig.path}: [{number.section}] {number.name} stands there in a way that cannot be replaced; write it as "
                f'{number.name} = {{ value = ..., unit = "...", source = "..." }} under [{number.section}].'
            )
        old = quantity_of(rig, number.section, number.name)
        again = with_quantity(again, number.section, number.name, old)
    if again != msgspec.structs.replace(rig, assumed=False):
        raise RigError(
            f"{rig.path}: cannot be rewritten without a change to other entries; put each on a line of its own."
        )


def corrected_rig_text(found: ModelDiagnosis) -> str:
    """Write the named causes of a diagnosis into the text of its rig file; RigError where that is not possible."""
    return corrected_text(found.rig, stated_causes(found), corrected_entries(found), found.title)


def corrected_rig(found: ModelDiagnosis) -> Rig:
    """The rig that a diagnosis started from, with its named causes as effects."""
    rig = msgspec.structs.replace(found.data.rig, effects=_by_place({**found.rig.effects, **stated_causes(found)}))
    for place, number in corrected_entries(found).items():
        rig = with_quantity(rig, *place, number)
    return rig


def corrected_entries(found: ModelDiagnosis) -> dict[tuple[str, str], Quantity]:
    """Numbers of the rig file, by section and name, that named wrong entries correct, with their standard uncertainty.

    A wrong load of one run is an entry of the campaign and not among them.
    """
    fit = found.found.best
    u = np.sqrt(np.diag(posterior_of(found.found, fit).covariance))
    numbers = {}
    for cause in found.causes:
        effect, k = found.suspects[cause.effect], fit.place[cause.effect].start
        if effect.entry is None or not effect.number:
            continue
        section, _, name = effect.number.partition(".")
        stated = quantity_of(found.data.rig, section, name)
        if stated is not None:
            share = 1.0 + float(fit.x[k])
            source = f"diagnosis of {printable_name(found.title)}: {share:.4g} times the stated number"
            numbers[section, name] = Quantity(
                stated.value * share, stated.unit, source, abs(stated.value) * float(u[k])
            )
    return numbers


def stated_causes(found: ModelDiagnosis) -> dict[str, StatedEffect]:
    """Named causes as effects that a rig file states, each with 95 % intervals and the logs of the fit.

    A cause that the rig file states already is a further change: its values become those of both together. Wrong entries are
    corrected themselves; only the motion that a logger computes with the same wrong radius gets its scale.
    """
    logs = tuple(log_name(run) for k, run in enumerate(found.runs) if k not in found.data.withheld)
    names = [cause.effect for cause in found.causes]
    fit = found.found.best
    u = np.sqrt(np.diag(posterior_of(found.found, fit).covariance))
    stated = {}
    for name in names:
        others = [other for other in names if other != name]
        beside = f", fitted with {' and '.join(others)}" if others else ""
        source = f"diagnosis of {printable_name(found.title)}{beside}"
        place = fit.place[name]
        entry = found.suspects[name].entry
        if found.suspects[name].law is SHARED_RADIUS.law:
            scale = 1.0 / (1.0 + float(fit.x[place.start])) - 1.0
            stated["encoder_scale"] = StatedEffect({"scale_error": EffectNumber(scale, "1", source)}, logs)
        if entry is not None and (found.suspects[name].number or entry.log >= 0):
            continue
        stated[name] = StatedEffect(_numbers(found, name, fit.x[place], u[place], source), logs)
    return stated


def _numbers(found: ModelDiagnosis, name: str, values: Signal, u: Signal, source: str) -> dict[str, EffectNumber]:
    """Fields of a cause, (k,), with their intervals; one at a bound of its range has none."""
    effect = found.suspects[name]
    earlier = {one.effect.name: one.values for one in stated_effects(found.rig)}.get(name)
    half = COVERED * np.hypot(u, LAW * np.abs(values - freedom(effect).absent))
    numbers = {}
    for k, field in enumerate(effect.fields):
        ends = np.tile(values, (3, 1))
        ends[:, k] += (-half[k], 0.0, half[k])
        changes = [with_values(effect, row) for row in ends]
        low, value, high = ((change if earlier is None else change.after(earlier)).values[k] for change in changes)
        low, value, high = (float(rounded(x, (high - low) / (2.0 * COVERED))) for x in (low, value, high))
        minimum, maximum = field.possible
        interval = {"low": max(low, minimum), "high": min(high, maximum)} if u[k] else {}
        numbers[field.name] = EffectNumber(value, field.unit, source, **interval)
    return numbers
