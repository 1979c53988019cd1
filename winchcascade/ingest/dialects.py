"""The one table of column names that loggers use, and how a header is matched to a channel by name and unit."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from functools import lru_cache

import msgspec

from winchcascade.core.channels import CHANNELS
from winchcascade.core.quantity import Unit, find_unit, read_as


class Header(msgspec.Struct, frozen=True):
    """One column as the file names it; the unit is None where the file keeps none apart from the name."""

    name: str
    unit: str | None = None


NAMES: dict[str, str] = {
    "time": """t time timestamp times timestring datetime date_time unix_time epoch zeit zeitstempel temps tiempo tempo tid
        tijd czas čas aika zaman elapsed elapsedtime elapsed_time relative_time reltime time_stamp xvalue x_value 時間 时间
        時刻 時戳 시간 время""",
    "displacement": """displacement disp position pos payout stroke travel delta δ x s length extension excursion
        verschiebung weg seilweg position_line auszug hub déplacement course desplazamiento posición carrera spostamento corsa
        verplaatsing forskyvning forskydning deslocamento läge sträcka przemieszczenie położenie siirtymä posun yer_değiştirme
        位移 線位移 行程 位置 放線長度 変位 ストローク 변위 перемещение""",
    "velocity": """velocity vel speed v vline v_line linevel linespeed reelout_speed reel_out_speed geschwindigkeit geschw
        seilgeschwindigkeit vitesse velocidad velocità snelheid hastighet hastighed velocidade prędkość nopeus rychlost hız
        速度 線速度 线速度 速率 線速 속도 скорость""",
    "pressure": """pressure press p pacc p_acc accumulator_pressure gas_pressure druck gasdruck speicherdruck pression
        presión pressione druk trykk pressão tryck tryk ciśnienie paine tlak basınç 壓力 压力 蓄壓器壓力 氣壓 圧力 압력
        давление""",
    "force": """force f fline f_line tension load_cell loadcell linetension pull kraft seilkraft seilzug zugkraft effort
        traction fuerza tensión forza tiro kracht spanning trekkracht força siła voima síla kuvvet 力 張力 拉力 张力 荷重
        線張力 장력 힘 сила натяжение""",
    "torque": """torque t tau τ tau_pto taupto m moment drehmoment couple par torsor coppia koppel moment_shaft vridmoment
        momento binário moment_obrotowy vääntömomentti kroutící_moment tork 扭矩 轉矩 转矩 扭力 トルク 토크 момент""",
    "power_mech": """mechanical_power mech_power power_mech pmech p_mech shaft_power power_shaft pto_power ppto p_pto
        mechanische_leistung wellenleistung puissance_mécanique potencia_mecánica 機械功率 机械功率""",
    "vdc": """vdc v_dc dc_voltage voltage_dc voltage udc u_dc u v dclink_voltage dc_link_voltage dcbus_voltage
        dc_bus_voltage vbus v_bus spannung gleichspannung zwischenkreisspannung tension tension_dc tension_cc tension_continue
        voltaje voltaje_dc voltaje_cc tensione tensione_cc spanning tensão spänning spænding spenning napięcie jännite
        napětí gerilim 直流電壓 直流电压 電壓 电压 直流側電壓 直流電圧 電圧 전압 직류전압 напряжение""",
    "idc": """idc i_dc dc_current current_dc current i dclink_current dc_link_current dcbus_current ibus i_bus strom
        gleichstrom zwischenkreisstrom courant courant_dc courant_cc courant_continu corriente corriente_dc corriente_cc
        corrente corrente_cc stroom strøm ström prąd virta proud akım
        直流電流 直流电流 電流 电流 전류 직류전류 ток""",
    "speed": """speed rotation_speed rotational_speed speed_of_rotation angular_velocity angular_speed velocity vel rpm
        generator_speed gen_speed motor_speed rotor_speed generator_rpm gen_rpm motor_rpm omega ω n n_gen n_mot n_motor
        n_generator drehzahl motordrehzahl generatordrehzahl wellendrehzahl trommeldrehzahl winkelgeschwindigkeit
        geschwindigkeit régime régime_moteur régime_de_rotation vitesse vitesse_de_rotation vitesse_rotation vitesse_angulaire
        giri velocità_di_rotazione velocità_angolare velocità velocidad_de_giro velocidad_de_rotación velocidad_angular
        velocidad velocidade_de_rotação velocidade_angular rotação toerental hoeksnelheid varvtal rotationshastighet
        omdrejningstal turtall prędkość_obrotowa prędkość_kątowa obroty pyörimisnopeus kierrosluku otáčky devir
        devir_sayısı 回転数
        回転速度 角速度 转速 轉速 旋转速度 회전수 회전속도 각속도 частота_вращения скорость_вращения обороты""",
    "flow": """flow flow_rate volume_flow volume_flow_rate volumetric_flow volumetric_flow_rate q durchfluss volumenstrom
        débit caudal portata vazão debiet flöde przepływ virtaus průtok debi 流量 유량 расход""",
    "power_ac": """ac_power power_ac p_ac active_power wirkleistung puissance_active potencia_activa potenza_attiva
        potência_ativa 有功功率 交流功率 有効電力 유효전력 активная_мощность""",
}
"""By channel, what loggers call it; matched without case, accents, blanks, punctuation and the words of `QUALIFIERS`."""

QUALIFIERS = frozenset(
    """line tether rope cable winch drum crane shaft pto accumulator acc gas sensor signal measured meas actual act value
    val raw channel ch ai dc load bus link seil leine câble cuerda of the de la du am an at""".split()
)
"""Words that describe where or how a quantity was measured and may stand beside its name."""

DATES = frozenset("date datum fecha data dato päivä 日期 날짜 дата".split())
"""Columns of dates: the clock where there is no other, else not reported as unknown."""

COUNTS = frozenset(
    """no nr n index idx row rownumber rowno record recordno recordnumber recnum rn recno sample samples sampleno
    samplenumber sampleindex scan scanno scannumber count counter line lineno 序號 序号 編號 编号 番号 번호 номер
    indexlevel0 unnamed0""".split()
)
"""Columns that number the rows: no channels, and not reported as unknown."""

UNITS_DECIDE = frozenset({"flow", "power_ac"})
"""Channels that are recognised only with a unit: their names are short, and no unit is the usual one."""

DIMENSION = {"time": "time"} | {name: channel.dimension for name, channel in CHANNELS.items()}
"""What each channel, and the time, measures."""

_MEASURED = frozenset(DIMENSION.values())


_HEADERS = 500
"""Number of headers whose reading is kept: a log needs each several times, and the logs of a campaign have the same ones."""


@lru_cache(_HEADERS)
def letters_of(text: str) -> str:
    """Letters and digits of a name without case and accents, by which names are compared."""
    if text.isascii():
        return "".join(c for c in text.casefold() if c.isalnum())
    return "".join(c for c in unicodedata.normalize("NFKD", text).casefold() if c.isalnum()).replace("ı", "i")


_NO_NAME = re.compile(r"(?:index|indexlevel0|unnamed0|column\d+)?")
"""Letters of a column that has no name, or the one that a program gave it for want of a name."""


def nameless(header: Header) -> bool:
    """Whether a column has no name of its own.

    >>> [nameless(Header(name)) for name in ("", "Unnamed: 0", "__index_level_0__", "Force")]
    [True, True, True, False]
    """
    return _NO_NAME.fullmatch(letters_of(header.name)) is not None


def _by_name() -> dict[str, tuple[str, ...]]:
    table: dict[str, dict[str, None]] = {}
    for channel, names in NAMES.items():
        for name in names.split():
            table.setdefault(letters_of(name), {})[channel] = None
    return {name: tuple(found) for name, found in table.items()}


CHANNELS_BY_NAME = _by_name()


class _Read(msgspec.Struct, frozen=True):
    """A header read apart: the name without its unit, the unit, and the bracket that is no known unit."""

    name: str
    unit: Unit | None
    unknown_unit: str | None


_BRACKETS = re.compile(r"[(\[{<]([^()\[\]{}<>]*(?:\([^()]*\))?[^()\[\]{}<>]*)[)\]}>]")
_LONGEST_NAME = 120
"""Length up to which a name is read; a longer text is no name. [characters]"""

_BEFORE_UNIT = re.compile(r"(?<=\S)(?:\s+in\s+|\s*[/,;:_.\s]\s*)(?=\S)")


@lru_cache(_HEADERS)
def read_header(header: Header) -> _Read:
    """Read name and unit apart: `Force [kgf]`, `Kraft / N`, `Vdc, V`, `force_kN`, or a row of units below the names."""
    name = unicodedata.normalize("NFKC", header.name[:_LONGEST_NAME]).strip().lstrip("#%").strip().strip("\"'")
    if header.unit is not None and header.unit.strip():
        unit = find_unit(header.unit.strip().strip("()[]"))
        return _Read(_BRACKETS.sub(" ", name), unit, None if unit else header.unit.strip())
    bare = _BRACKETS.sub(" ", name).strip()
    inside = [bracket.group(1).strip() for bracket in _BRACKETS.finditer(name)]
    splits = [(bare, end) for end in inside]
    splits += [(n[: m.start()], n[m.end() :]) for n in dict.fromkeys((name, bare)) for m in _BEFORE_UNIT.finditer(n)]
    units = [(start, end, unit) for start, end in splits if (unit := find_unit(end)) is not None]
    for start, _, own in units:
        if any(read_as(own, DIMENSION[c]) for c in _candidates(start)):
            return _Read(start, own, None)
    # A unit that no channel has, behind the name of one, as in `T / °F`; a lone letter, as in `Force/F`, may be a name.
    foreign = (u for n, end, u in units if len(end) > 1 and u.dimension not in _MEASURED and _candidates(n))
    other = next(filter(None, map(find_unit, inside)), None) or next(foreign, None)
    return _Read(bare, other, None if other or not inside else inside[-1] or None)


def _candidates(name: str) -> tuple[str, ...]:
    """Channels that a name may mean, with and without the words that describe where it was measured."""
    last = name.replace("\\", "/").rsplit("/", 1)[-1]
    if last != name and find_unit(name) is not None:  # m/s is no s in a group m
        return ()
    return next((found for text in _spellings(name, last) if (found := CHANNELS_BY_NAME.get(letters_of(text)))), ())


def _spellings(name: str, last: str) -> Iterator[str]:
    """Yield a name, its last part, and the words of that with fewer and fewer of the qualifiers."""
    yield name
    yield last
    words = [w for w in re.split(r"[\W_]+", unicodedata.normalize("NFKC", last).casefold()) if w]
    words = [w for w in words if not re.fullmatch(r"(?:ai|ch|channel)?\d+", w)]
    place = next((k for k, w in enumerate(words) if w not in QUALIFIERS), 0)
    yield from ("".join(words[k:]) for k in range(place + 1))
    yield "".join(w for w in words if w not in QUALIFIERS)


@lru_cache(_HEADERS)
def recognise(header: Header) -> str | None:
    """Channel (or `time`) that a header names, None for a column that is none.

    >>> [recognise(Header(n)) for n in ("V_DC (V)", "直流電壓", "Line velocity", "Speed (rpm)", "Tension (V)")]
    ['vdc', 'vdc', 'velocity', 'speed', 'vdc']
    """
    read = read_header(header)
    found = _candidates(read.name)
    if read.unit is not None:
        found = tuple(c for c in found if read_as(read.unit, DIMENSION[c]))
    elif letters_of(read.name) in COUNTS or UNITS_DECIDE.issuperset(found):
        found = ()
    elif len(found) > 1 and read.name.strip() == "T":  # without a unit t is the time, T a torque
        found = ("torque",)
    return found[0] if found else None
