"""The one table of column names that loggers use, and how a header is matched to a channel by name and unit."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec

from winchcascade.channels import CHANNELS, SIMULATED_HEADERS
from winchcascade.errors import LogError
from winchcascade.quantity import Unit, find_unit
from winchcascade.run import Finding

if TYPE_CHECKING:
    from winchcascade.ingest.source import Header
    from winchcascade.rigfile import Rig

NAMES: dict[str, str] = {
    "time": """t time timestamp times timestring datetime date_time unix_time epoch zeit zeitstempel temps tiempo tempo tid
        tijd czas čas aika zaman elapsed elapsedtime elapsed_time relative_time reltime time_stamp xvalue x_value 時間 时间
        時刻 時戳 시간 время""",
    "displacement": """displacement disp position pos payout stroke travel delta δ x s length extension excursion
        verschiebung weg position_line auszug hub déplacement course desplazamiento posición carrera spostamento corsa
        verplaatsing forskyvning deslocamento läge sträcka przemieszczenie położenie siirtymä posun yer_değiştirme 位移
        線位移 行程 位置 放線長度 変位 ストローク 변위 перемещение""",
    "velocity": """velocity vel speed v vline v_line linevel linespeed reelout_speed reel_out_speed geschwindigkeit
        seilgeschwindigkeit vitesse velocidad velocità snelheid hastighet hastighed velocidade prędkość nopeus rychlost hız
        速度 線速度 线速度 速率 線速 속도 скорость""",
    "pressure": """pressure press p pacc p_acc accumulator_pressure gas_pressure druck gasdruck speicherdruck pression
        presión pressione druk trykk pressão tryck tryk ciśnienie paine tlak basınç 壓力 压力 蓄壓器壓力 氣壓 圧力 압력
        давление""",
    "force": """force f fline f_line tension load_cell loadcell linetension pull kraft seilkraft zugkraft effort
        traction fuerza tensión forza tiro kracht spanning trekkracht força siła voima síla kuvvet 力 張力 拉力 张力 荷重
        線張力 장력 힘 сила натяжение""",
    "torque": """torque t tau τ tau_pto taupto m moment drehmoment couple par torsor coppia koppel moment_shaft vridmoment
        momento binário moment_obrotowy vääntömomentti kroutící_moment tork 扭矩 轉矩 转矩 扭力 トルク 토크 момент""",
    "power_mech": """mechanical_power mech_power power_mech pmech p_mech shaft_power power_shaft pto_power ppto p_pto
        mechanische_leistung wellenleistung puissance_mécanique potencia_mecánica 機械功率 机械功率""",
    "vdc": """vdc v_dc dc_voltage voltage_dc voltage udc u_dc u v dclink_voltage dc_link_voltage dcbus_voltage
        dc_bus_voltage vbus v_bus spannung gleichspannung zwischenkreisspannung tension tension_dc tension_continue
        voltaje voltaje_dc tensione spanning tensão spänning spænding spenning napięcie jännite napětí gerilim 直流電壓
        直流电压 電壓 电压 直流側電壓 直流電圧 電圧 전압 напряжение""",
    "idc": """idc i_dc dc_current current_dc current i dclink_current dc_link_current dcbus_current ibus i_bus strom
        gleichstrom courant courant_dc courant_continu corriente corriente_dc corrente stroom strøm ström prąd virta proud
        akım 直流電流 直流电流 電流 电流 전류 ток""",
}
"""By channel, what loggers call it; matched without case, accents, blanks, punctuation and the words of `QUALIFIERS`."""

QUALIFIERS = frozenset(
    """line tether rope cable winch drum crane shaft pto accumulator acc gas sensor signal measured meas actual act value
    val raw channel ch ai dc load bus link seil leine câble cuerda of the de la du am an at""".split()
)
"""Words that say where or how a quantity was measured and may stand beside its name."""

_DATES = frozenset("date datum fecha data dato päivä 日期 날짜 дата".split())
_COUNTS = frozenset(
    """no nr n index idx row rownumber rowno record recordno recordnumber recnum rn recno sample samples sampleno
    samplenumber sampleindex scan scanno scannumber count counter line lineno 序號 序号 編號 编号 番号 번호 номер""".split()
)
"""Columns that number the rows: no channels, and nobody misses them."""

_DIMENSION = {"time": "time"} | {name: channel.dimension for name, channel in CHANNELS.items()}


def _letters(text: str) -> str:
    if text.isascii():
        return "".join(c for c in text.casefold() if c.isalnum())
    return "".join(c for c in unicodedata.normalize("NFKD", text).casefold() if c.isalnum()).replace("ı", "i")


def _by_name() -> dict[str, tuple[str, ...]]:
    table: dict[str, list[str]] = {}
    for channel, names in NAMES.items():
        for name in names.split():
            found = table.setdefault(_letters(name), [])
            if channel not in found:
                found.append(channel)
    return {name: tuple(found) for name, found in table.items()}


_CHANNELS_BY_NAME = _by_name()


class Match(msgspec.Struct, frozen=True):
    """One channel found in a log: index of its header, and SI value = factor * value + offset."""

    index: int
    factor: float
    offset: float = 0.0


class Assignment(msgspec.Struct, frozen=True):
    """Which header is which channel; `time` is None for a log without a time column, `time_unit` if it names none."""

    channels: Mapping[str, Match]
    time: Match | None
    time_unit_known: bool
    findings: tuple[Finding, ...]
    simulated: bool


class _Read(msgspec.Struct, frozen=True):
    """A header read apart: the name without its unit, the unit, and the bracket that is no known unit."""

    name: str
    unit: Unit | None
    unknown_unit: str | None


_BRACKETS = re.compile(r"[(\[{<]([^()\[\]{}<>]*(?:\([^()]*\))?[^()\[\]{}<>]*)[)\]}>]")
_LONGEST_NAME = 120
"""More of a name is not looked at: what is longer is no name."""

_BEFORE_UNIT = re.compile(r"(?<=\S)(?:\s+in\s+|\s*[/,;:_.\s]\s*)(?=\S)")


def read_header(header: Header) -> _Read:
    """Read name and unit apart: `Force [kgf]`, `Kraft / N`, `Vdc, V`, `force_kN`, or a row of units below the names."""
    name = unicodedata.normalize("NFKC", header.name[:_LONGEST_NAME]).strip().lstrip("#%").strip().strip("\"'")
    if header.unit is not None and header.unit.strip():
        unit = find_unit(header.unit.strip().strip("()[]"))
        return _Read(_BRACKETS.sub(" ", name), unit, None if unit else header.unit.strip())
    bare = _BRACKETS.sub(" ", name).strip()
    inside = [bracket.group(1).strip() for bracket in _BRACKETS.finditer(name)]
    splits = [(bare, end) for end in inside] + [(n[: m.start()], n[m.end() :]) for n, m in _before_units(name, bare)]
    for start, end in splits:
        unit = find_unit(end)
        if unit is not None and any(_DIMENSION[c] == unit.dimension for c in _candidates(start)):
            return _Read(start, unit, None)
    other = next((unit for end in inside if (unit := find_unit(end)) is not None), None)
    return _Read(bare, other, None if other or not inside else inside[-1] or None)


def _before_units(*names: str) -> Iterator[tuple[str, re.Match[str]]]:
    """Each place in a name, with or without its brackets, where a unit may begin."""
    for name in dict.fromkeys(names):
        for between in _BEFORE_UNIT.finditer(name):
            yield name, between


def _candidates(name: str) -> tuple[str, ...]:
    """Channels that a name may mean, with and without the words that say where it was measured."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    for text in (name, last):
        found = _CHANNELS_BY_NAME.get(_letters(text))
        if found:
            return found
    words = [w for w in re.split(r"[\W_]+", unicodedata.normalize("NFKC", last).casefold()) if w]
    words = [w for w in words if not re.fullmatch(r"(?:ai|ch|channel)?\d+", w)]
    place = next((k for k, w in enumerate(words) if w not in QUALIFIERS), 0)
    shorter = [words[k:] for k in range(place + 1)] + [[w for w in words if w not in QUALIFIERS]]
    for part in shorter:
        found = _CHANNELS_BY_NAME.get(_letters("".join(part)))
        if found:
            return found
    return ()


def recognise(header: Header) -> str | None:
    """Channel (or `time`) that a header names, None for a column that is none.

    >>> from winchcascade.ingest.source import Header
    >>> [recognise(Header(n)) for n in ("V_DC (V)", "直流電壓", "Line velocity", "Speed (rpm)", "Tension (V)")]
    ['vdc', 'vdc', 'velocity', None, 'vdc']
    """
    read = read_header(header)
    found = _candidates(read.name)
    if read.unit is not None:
        found = tuple(c for c in found if _DIMENSION[c] == read.unit.dimension)
    elif len(found) > 1:
        found = _by_case(read.name, found)
    return found[0] if found else None


def _by_case(name: str, found: tuple[str, ...]) -> tuple[str, ...]:
    """A lone letter without a unit: t is the time, T a torque; v stays a velocity; a tension is a force."""
    if name.strip() == "T":
        return ("torque",)
    return found


def assign(headers: Sequence[Header], rig: Rig, where: str) -> Assignment:
    """Match the headers of a log to channels, by the rig file's [columns] first, then by the table of names.

    Raises
    ------
    LogError : two columns for one channel, a column of the rig file that the log does not have, a unit that does not
        fit, no column that could give the line velocity
    """
    named = _named_in_rig(headers, rig, where)
    taken: dict[str, int] = dict(named)
    dates: list[int] = []
    unknown: list[int] = []
    simulated = any(header.name.strip() in SIMULATED_HEADERS for header in headers)
    for index, header in enumerate(headers):
        if index in named.values() or header.name.strip() in SIMULATED_HEADERS:
            continue
        channel = recognise(header)
        letters = _letters(header.name)
        if channel is None and letters in _DATES:
            dates.append(index)
        elif channel is None and (not header.name.strip() or letters in _COUNTS or set(header.name) <= set("# ")):
            continue
        elif channel is None or channel in named:
            unknown.append(index)
        elif channel in taken:
            taken[channel], other = _better(headers, taken[channel], index, channel, where)
            unknown += [other] if channel != "time" else []
        else:
            taken[channel] = index
    if dates:
        taken.setdefault("time", dates[0])
    _check_usable(taken, headers, where)
    return _assignment(taken, headers, rig, [headers[k].name.strip() for k in sorted(unknown)], simulated, where)


def _named_in_rig(headers: Sequence[Header], rig: Rig, where: str) -> dict[str, int]:
    names = [h.name.strip() for h in headers]
    bare = [read_header(h).name.strip() for h in headers]
    found = {}
    for channel, column in rig.columns.items():
        if column.name.strip() in names:
            found[channel] = names.index(column.name.strip())
        elif column.name.strip() in bare:
            found[channel] = bare.index(column.name.strip())
        elif channel in ("velocity", "time"):
            raise LogError(
                f"{where}: no column {column.name!r}, which the rig {rig.name} names for {channel}; the log has "
                f"{_listed(names)}. Correct [columns] in the rig file or choose the rig with --rig."
            )
    return found


def _better(headers: Sequence[Header], old: int, new: int, channel: str, where: str) -> tuple[int, int]:
    """Of two columns for one channel, the one whose name is a plain one of the table, and the other; a draw is a fault.

    Of two time columns it is the one that names a unit of time, as a stamp may be coarser than the time elapsed.
    """
    read = [read_header(headers[k]) for k in (old, new)]
    better = [channel in _CHANNELS_BY_NAME.get(_letters(r.name), ()) for r in read]
    if channel == "time":
        coarse = read[0].unit is None and read[1].unit is not None
        better = [not coarse, coarse]
    names = [headers[k].name.strip() for k in (old, new)]
    if better[0] == better[1] and names[0] == names[1]:
        raise LogError(
            f"{where}: columns {old + 1} and {new + 1} are both named {names[0]!r}; expected one {channel}. Rename or "
            f"delete one of them."
        )
    if better[0] == better[1]:
        raise LogError(
            f"{where}: both {names[0]!r} and {names[1]!r} could be the {channel}; expected one. Name the right one in a "
            f"rig file under [columns]."
        )
    return (old, new) if better[0] else (new, old)


def _check_usable(taken: Mapping[str, int], headers: Sequence[Header], where: str) -> None:
    if "velocity" in taken or "displacement" in taken:
        return
    found = _listed([h.name.strip() for h in headers])
    raise LogError(
        f"{where}: no column for the line velocity or displacement; the log has {found}. Name the columns in a rig file "
        f"under [columns]."
    )


def _listed(names: Sequence[str], most: int = 12) -> str:
    shown = ", ".join((n if len(n) <= 40 else n[:37] + "...") for n in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "") if names else "no columns"


def _assignment(
    taken: Mapping[str, int], headers: Sequence[Header], rig: Rig, unknown: Sequence[str], simulated: bool, where: str
) -> Assignment:
    findings = []
    channels = {}
    time, time_unit_known = None, False
    for channel in ("time", *CHANNELS):
        if channel not in taken:
            continue
        index = taken[channel]
        unit = _unit_of(headers[index], channel, rig, where)
        if channel == "time":
            time_unit_known = unit is not None
            time = Match(index, 1.0 if unit is None else unit.factor)
            continue
        if unit is None:
            unit, finding = _assumed(headers[index], channel)
            findings.append(finding)
        channels[channel] = Match(index, unit.factor, unit.offset)
    if unknown:
        what = f"{len(unknown)} columns that are no channel" if len(unknown) > 1 else "1 column that is no channel"
        findings.append(Finding("unknown_column", f"{what}: {_listed(unknown)}", "not read", count=len(unknown)))
    return Assignment(channels, time, time_unit_known, tuple(findings), simulated)


def _assumed(header: Header, channel: str) -> tuple[Unit, Finding]:
    """The usual unit of a channel, for a column that names none, and the finding that says so."""
    usual = CHANNELS[channel].unit
    unit = find_unit(usual)
    assert unit is not None
    message = f"column {header.name.strip()!r} names no unit that is known; taken as {usual}"
    return unit, Finding("unit_assumed", message, "assumed", channel)


def _unit_of(header: Header, channel: str, rig: Rig, where: str) -> Unit | None:
    """Unit of a column: the rig file's word for it, else the log's own; None where neither names one that is known."""
    column = rig.columns.get(channel)
    if column is not None and column.unit is not None:
        named = find_unit(column.unit) or _unit_by_pint(column.unit, channel)
        if named is None:
            raise LogError(
                f"{where}: the rig {rig.name} gives {channel} the unit {column.unit!r}, which is none of "
                f"{_DIMENSION[channel]}; correct [columns] in the rig file."
            )
        return named
    read = read_header(header)
    unit = read.unit
    if unit is None and read.unknown_unit is not None:
        unit = _unit_by_pint(read.unknown_unit, channel)
    if unit is not None and unit.dimension != _DIMENSION[channel]:
        raise LogError(
            f"{where}: column {header.name.strip()!r} is named for {channel} but its unit is one of {unit.dimension}; "
            f"expected one of {_DIMENSION[channel]}. Correct the log or [columns] in a rig file."
        )
    return unit


_PINT_UNIT = {
    "time": "s", "length": "m", "velocity": "m/s", "pressure": "Pa", "force": "N", "torque": "N*m", "power": "W",
    "voltage": "V", "current": "A",
}  # fmt: skip


def _unit_by_pint(text: str, channel: str) -> Unit | None:
    """Ask pint for a unit that the table does not hold; None where pint does not know it for this channel either."""
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    dimension = _DIMENSION[channel]
    try:
        at_zero, at_one = (float(registry.Quantity(x, text).to(_PINT_UNIT[dimension]).magnitude) for x in (0.0, 1.0))
    except Exception:  # pint raises errors of many kinds, tokenizer errors among them, for text that is no unit
        return None
    return Unit(dimension, at_one - at_zero, at_zero)
