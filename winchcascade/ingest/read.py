"""Read a file of any known format as a checked Run; a file that cannot be used raises LogError with the reason."""

from __future__ import annotations

import hashlib
import math
import os
import re
import time
import unicodedata
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.campaign_file import SIMULATED, Origin, joint_origin
from winchcascade.core.errors import LogError
from winchcascade.core.files import readable
from winchcascade.core.integrate import median
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Finding, Run
from winchcascade.ingest.assign import Assignment, assign, listed
from winchcascade.ingest.cells import clock_of_digits
from winchcascade.ingest.checks.quality import check
from winchcascade.ingest.clock import Clock, even_clock, read_clock, require_rising
from winchcascade.ingest.open_log import open_log

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.ingest.source import LogSource, LogTable

OVERFLOW = 1e30
"""Instruments write 9.9e37 where they have no reading (SCPI); nothing measured comes near."""

_TRIES = 3
"""A file that changed each time while it was read is one that a logger still writes."""

_SECOND = 1_000_000_000
"""One second. [ns]"""

_FRESH, _FRESH_IN_SECONDS = _SECOND // 20, 3 * _SECOND
"""Two changes of a file within one step of its file system's time have the same stamp: steps are 1 to 16 ms or, where stamps
are whole seconds (FAT), up to 2 s. [ns]
"""

_FEWEST = 10
"""A log with fewer rows than this shows no motion."""


@np.errstate(invalid="ignore")  # a file of binary numbers may hold NaN of the kind that signals
def read_run(
    path: str | Path,
    *,
    rig: Rig | None = None,
    load: float | None = None,
    load_source: str = "given",
    about: str = "",
    origin: Origin | None = None,
    table: str | None = None,
) -> Run:
    """Read a log of any known format and check it.

    Parameters
    ----------
    path : CSV of any dialect, LabVIEW's .lvm, TDMS, MATLAB .mat, Parquet or Excel; the content decides which
    rig : the rig whose sensors and columns are expected; the paper's by default
    load : resistance at the DC link, inf for an open circuit; by default what the file says of itself, else None [ohm]
    table : name or number of the sheet of a workbook, of the run in a MATLAB file or of the TDMS group; needed where several
        could be the log
    load_source, about : who says so, and what is to be said of the log, for the reports
    origin : whether the data are measured and where they come from; the mark of `simulate` overrides it

    Raises
    ------
    LogError : the file cannot be used; the message is one sentence

    Examples
    --------
    >>> read_run("fixtures/campaign/r36ohm.csv").samples
    2767
    """
    path = Path(path)
    rig = rig or built_in()
    for _ in range(_TRIES):
        seen = _Seen(path)
        try:
            run = _read(path, rig, load, load_source, about, table)
        except LogError:
            if seen.is_same():
                raise
            continue
        if seen.is_same(run.sha256):
            return _with_origin(run, origin or Origin())
    raise LogError(
        f"{path}: changed each of {_TRIES} times while it was read; expected a file that is complete. Wait until the logger "
        "has closed it, or reduce a copy."
    )


def _read(path: Path, rig: Rig, load: float | None, load_source: str, about: str, table_name: str | None) -> Run:
    """Read and check a log that nobody changes meanwhile."""
    source = open_log(path, table_name)
    try:
        found, table = _loaded(source, rig, path.name)
    finally:
        source.close()
    digest = _Digest(path)
    samples = len(next(iter(table.values.values())))
    if samples < _FEWEST:
        rows = f"{samples} row{'' if samples == 1 else 's'}"
        raise LogError(
            f"{path.name}: the log has {rows} of data; expected at least {_FEWEST} samples of a crane trial."
        )
    clock, time_findings = _clock(source, table, found, rig, samples, path.name)
    channels = _channels(table, found, clock)
    if load is None:
        load, load_source, load_faults = _load(source)
        time_findings = [*time_findings, *load_faults]
    checked = check(
        clock.t, channels, rig, simulated=found.simulated, open_circuit=load is not None and load == float("inf")
    )
    if "velocity" not in checked.channels:
        raise LogError(
            f"{path.name}: neither velocity nor displacement holds a number; expected the motion of the line."
        )
    lost = np.concatenate((np.interp(clock.gaps, clock.t, checked.t), checked.clock))
    gaps = dict(checked.gaps) | ({CLOCK: lost[np.argsort(lost[:, 0])]} if lost.size else {})
    findings = (*found.findings, *time_findings, *table.findings, *clock.findings, *checked.findings)
    return Run(
        name=readable(path.name),
        t=checked.t,
        channels=checked.channels,
        fs=clock.fs,
        samples=samples,
        gaps=gaps,
        load=load,
        load_source=load_source,
        path=readable(str(path)),
        sha256=digest.value(),
        findings=findings,
        simulated=found.simulated,
        about=about,
        table=None if source.table is None else readable(source.table),
    )


def _with_origin(run: Run, stated: Origin) -> Run:
    """The log with its origin: that of its mark where `simulate` made it, with a finding if the campaign states otherwise."""
    if not run.simulated:
        return msgspec.structs.replace(run, origin=stated)
    if not stated.measured:
        origin = joint_origin([SIMULATED, stated]) if stated.measured is False else SIMULATED
        return msgspec.structs.replace(run, origin=origin)
    message = "the campaign states measured = true, but the log has the columns of a log made by winchcascade simulate"
    conflict = Finding("origin_conflict", message, "taken as not measured")
    return msgspec.structs.replace(run, origin=SIMULATED, findings=(conflict, *run.findings))


def _loaded(source: LogSource, rig: Rig, where: str) -> tuple[Assignment, LogTable]:
    """The channels, with the clock that a column names or else the one that stands in a column without a name."""
    found = assign(source.headers, rig, where)
    wanted = [match.index for match in found.channels.values()]
    if found.time is None and source.time_step is None:
        from winchcascade.ingest.formats.parquet import index_clock

        index = index_clock(source, wanted)
        if index is not None:
            return assign(source.headers, rig, where, clock=index[0]), index[1]
    return found, source.load(wanted, found.time.index if found.time else None)


class _Seen:
    """A file as it was before it was read, to find out whether the digest is of the bytes that were parsed.

    Stamps show that, as long as the last change lies further back than the steps in which a file system counts time; of a file
    that was changed just now the digest is taken before it is read, too.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._before = self._stamps()
        self._sha256 = _sha256(path) if self._is_fresh() else ""

    def _stamps(self) -> tuple[int, ...] | None:
        try:
            about = os.stat(self._path)
        except OSError:  # its reader reports it
            return None
        return about.st_dev, about.st_ino, about.st_size, about.st_ctime_ns, about.st_mtime_ns

    def _is_fresh(self) -> bool:
        if self._before is None or not self._path.is_file():
            return False
        *_, changed, written = self._before
        step = _FRESH if written % _SECOND else _FRESH_IN_SECONDS
        return time.time_ns() - max(changed, written) < step

    def is_same(self, sha256: str = "") -> bool:
        """Whether the file is still the same, and of this digest where it is given."""
        return self._stamps() == self._before and (not (self._sha256 and sha256) or self._sha256 == sha256)


def _sha256(path: Path) -> str:
    """Digest of a file in hexadecimal, nothing for one that cannot be read."""
    with suppress(OSError), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
    return ""


class _Digest:
    """SHA-256 of a file, computed beside other work: hashing leaves the interpreter free."""

    def __init__(self, path: Path) -> None:
        self._path, self._value = path, ""
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self._value = _sha256(self._path)  # `value` raises the error, because a thread has no caller

    def value(self) -> str:
        """Wait for the digest and give it in hexadecimal; LogError if the file has gone since it was read."""
        self._thread.join()
        if not self._value:
            raise LogError(f"{self._path}: could not be read to its end; check that the file is still there.")
        return self._value


def _clock(
    source: LogSource, table: LogTable, found: Assignment, rig: Rig, samples: int, where: str
) -> tuple[Clock, list[Finding]]:
    """Stamps from the time column, else from the increment that the file or the rig file states."""
    findings: list[Finding] = []
    if table.stamps is None:
        if source.time_step is not None:
            clock = even_clock(samples, source.time_step, source.time_start)
            require_rising(clock.t, where)
            return clock, findings
        if rig.sample_rate is not None:
            return even_clock(samples, 1.0 / rig.sample_rate), findings
        raise LogError(
            f"{where}: no time column and no sampling interval; the log has "
            f"{listed([h.name.strip() for h in source.headers])}. Name the column in a rig file under [columns], or "
            f"its rate as sample_rate_hz under [log]."
        )
    if isinstance(table.stamps, np.ndarray):
        stamps, stamped = table.stamps, table.stamped
    else:
        from winchcascade.ingest.stamps import seconds

        stamps, stamped = seconds(table.stamps), True
    if not stamped and found.time is not None:
        factor = found.time.factor
        digits = None if found.time_unit_known else clock_of_digits(stamps)
        if digits is not None:
            return read_clock(digits, where), findings
        if not found.time_unit_known:
            factor, finding = _assumed_time(stamps, table, found)
            findings.append(finding)
        stamps = stamps * factor if factor != 1.0 else stamps
    return read_clock(stamps, where), findings


_TIME_UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


def _assumed_time(stamps: Signal, table: LogTable, found: Assignment) -> tuple[float, Finding]:
    """Unit of a time column that names none: the one with which the velocity gives the displacement, else by its steps."""
    step = np.diff(stamps[np.isfinite(stamps)])
    usual = median(step) if step.size else 0.0
    unit, why = ("ms", "its steps are long") if usual >= 2 else ("s", "the usual unit")
    moved, speed = found.channels.get("displacement"), found.channels.get("velocity")
    if moved is not None and speed is not None and usual > 0:
        with np.errstate(over="ignore", invalid="ignore"):
            travelled = float(np.nansum(np.abs(np.diff(table.values[moved.index])))) * moved.factor
            expected = float(np.nansum(np.abs(table.values[speed.index]))) * speed.factor * usual
        if 0 < travelled < math.inf and 0 < expected < math.inf:
            ratio = math.log(travelled) - math.log(expected)  # the quotient itself may be too small for a number
            unit = min(_TIME_UNITS, key=lambda name: abs(math.log(_TIME_UNITS[name]) - ratio))
            why = "with which velocity and displacement agree"
    column = "the time column names no unit" if found.time_named else "the clock is a column without name or unit"
    return _TIME_UNITS[unit], Finding("unit_assumed", f"{column}; taken as {unit}, {why}", "assumed")


def _channels(table: LogTable, found: Assignment, clock: Clock) -> dict[str, Signal]:
    """Columns in SI units, in the rows that the clock kept."""
    channels = {}
    for name, match in found.channels.items():
        x = table.values[match.index]
        if clock.rows is not None:
            x = x[clock.rows]
        if not x.flags.writeable:
            x = x.copy()
        if not (x.max(initial=0.0) < OVERFLOW and x.min(initial=0.0) > -OVERFLOW):
            x[np.abs(x) >= OVERFLOW] = np.nan
        if match.factor != 1.0:
            x *= match.factor
        if match.offset:
            x += match.offset
        channels[name] = x
    return channels


def _load(source: LogSource) -> tuple[float | None, str, list[Finding]]:
    """The load by a property of the file, never from Vdc over Idc [ohm]; a property that gives none is a finding."""
    findings = []
    for key, value in source.properties.items():
        letters = "".join(c for c in unicodedata.normalize("NFKC", key) if c.isalpha())
        named = _RESISTANCE_UNIT.search(letters)
        if letters[: named.start() if named else None].casefold() in _LOAD_KEYS:
            ohm = _ohm(value, named.group() if named else "ohm")
            if ohm is not None:
                return ohm, f"property {key} of the file", []
            message = (
                f"property {key[:60]} of the file is {str(value)[:60]!r}; expected one resistance such as 9 ohm, or inf"
            )
            action = "not used: the load counts as unknown; give it by --load-ohm or a campaign.toml"
            findings.append(Finding("load_mismatch", message, action))
    return None, "unknown", findings


_LOAD_KEYS = {"load", "rload", "loadresistance", "loadresistor", "resistiveload", "rl"}

_OPEN = {"inf", "infinity", "infinite", "open", "opencircuit", "noload"}
"""How a file says that no load is connected."""

_RESISTANCE_UNIT = re.compile(r"([mkMK]?)(?:[Oo][Hh][Mm][Ss]?|\u03a9|\u03c9)$")
"""A unit of resistance with its prefix: m is milli, M mega."""

_PREFIX = {"": 1.0, "m": 1e-3, "k": 1e3, "K": 1e3, "M": 1e6}

_QUANTITY = re.compile(r"([-+]?\d*[.,]?\d+(?:[eE][-+]?\d+)?|\d+[.,])\s*([^\W\d_]*)(.*)", re.DOTALL)
"""A number, its unit, and what follows."""


def _ohm(value: str | float, unit: str) -> float | None:
    """Resistance that a property gives, None where it gives none or more than one. [ohm]

    Parameters
    ----------
    unit : of resistance, for a number without one

    Examples
    --------
    >>> _ohm("9 ohm / 50 Hz", "ohm"), _ohm("0.018 kOhm", "ohm"), _ohm("1 kW", "ohm"), _ohm("open circuit", "ohm")
    (9.0, 18.0, None, inf)
    """
    text = unicodedata.normalize("NFKC", str(value)).strip()
    if text.casefold().replace(" ", "").removesuffix("ohm") in _OPEN:
        return math.inf
    quantity = _QUANTITY.fullmatch(text)
    if quantity is None:
        return None
    number, named, remark = quantity.groups()
    prefix = _RESISTANCE_UNIT.fullmatch(named or unit)
    thousands = re.fullmatch(r"[-+]?[1-9]\d*,\d{3}", number) is not None  # a decimal comma or not, nobody can know
    several = bool(remark.strip()) and (
        not named or re.search(r"\d\s*[mkM]?(?:ohm|\u03a9)", remark.casefold()) is not None
    )
    if prefix is None or thousands or several:
        return None
    ohm = float(number.replace(",", ".")) * _PREFIX[prefix.group(1)]
    return ohm if 0.0 < ohm < math.inf else None
