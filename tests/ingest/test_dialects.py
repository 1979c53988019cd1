"""Headers: every listed name and unit is recognised, and a log gives the same results in any language."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from campaign_log import HEAD, NAMES, ROWS, SAME, UNITS, clean, efficiencies, kinds, read, scaled, text
from loops import failures

from winchcascade import Run, load_rig
from winchcascade.core.channels import CHANNELS
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import KGF
from winchcascade.core.quantity import UNITS as UNIT_TABLE
from winchcascade.ingest import dialects
from winchcascade.ingest.dialects import Header, read_header, recognise

UNIT = {"time": "s"} | {name: channel.unit for name, channel in CHANNELS.items()}
DIMENSION = {"time": "time"} | {name: channel.dimension for name, channel in CHANNELS.items()}
LISTED = [(channel, name) for channel, names in dialects.NAMES.items() for name in names.split()]

ROUNDED = 1e-5
"""Factors below are given to six digits or more."""


def test_a_listed_name_with_the_unit_of_its_channel_is_that_channel() -> None:
    def check(channel: str, name: str) -> None:
        assert recognise(Header(f"{name} ({UNIT[channel]})")) == channel
        assert recognise(Header(name.upper(), UNIT[channel])) == channel

    assert failures(check, LISTED) == []


def test_every_unit_of_the_table_is_read_back_from_a_header() -> None:
    def check(channel: str, form: str) -> None:
        name = dialects.NAMES[channel].split()[1]
        for spelled, unit in UNIT_TABLE.items():
            if unit.dimension == DIMENSION[channel]:
                assert read_header(Header(form.format(name, spelled))).unit == unit, spelled

    forms = ["{} [{}]", "{}({})", "{} / {}", "{}, {}", "{} {}", "{}_{}", "{} in {}", "{}:{}", "{}（{}）"]
    assert failures(check, product(dialects.NAMES, forms)) == []


@pytest.mark.parametrize("prefix", ["AI3 ", "ch2_", "cDAQ1Mod1/", "Line ", "Measured "])
@pytest.mark.parametrize("name", ["force (N)", "load cell (N)", "tension (N)"])
def test_a_place_or_a_number_may_stand_before_a_name(prefix: str, name: str) -> None:
    assert recognise(Header(prefix + name)) == "force"


@pytest.mark.parametrize("name", ["Speed (A)", "Force (V)", "Temperature (degC)", "x" * 10_000, "a_" * 5_000, ""])
def test_another_quantity_is_no_channel(name: str) -> None:
    assert recognise(Header(name)) is None


def test_a_temperature_is_no_torque_and_no_time() -> None:
    def check(form: str, unit: str) -> None:
        assert recognise(Header(form.format(unit))) is None
        assert recognise(Header("T", unit)) is None

    units = ["°C", "℃", "ºC", "C", "degC", "deg C", "Celsius", "K", "kelvin", "°F", "degF"]
    assert failures(check, product(["T ({})", "T [{}]", "t ({})", "T / {}", "T, {}", "Torque ({})"], units)) == []


@pytest.mark.parametrize("name", ["Force/F", "cDAQ1Mod1/F", "Force", "F"])
def test_a_lone_letter_that_may_be_a_unit_stays_a_name(name: str) -> None:
    assert recognise(Header(name)) == "force"


def test_a_temperature_beside_the_torque_is_left_unread(tmp_path: Path) -> None:
    rows = [[*row, "31.5"] for row in ROWS]
    run = read(tmp_path, text(rows, [*HEAD, "T (°C)"]))
    assert [f.message for f in run.findings] == ["1 column that is no channel: T (°C)"]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


LANGUAGES = {
    "zh-tw": "時間 位移 線速度 壓力 張力 扭矩 直流電壓 直流電流",
    "zh-cn": "时间 位移 线速度 压力 拉力 扭矩 直流电压 直流电流",
    "ja": "時間 変位 速度 圧力 張力 トルク 直流電圧 直流電流",
    "ko": "시간 변위 속도 압력 장력 토크 전압 전류",
    "ru": "Время Перемещение Скорость Давление Сила Момент Напряжение Ток",
    "de": "Zeit Weg Geschwindigkeit Druck Kraft Drehmoment Spannung Strom",
    "fr": "Temps Déplacement Vitesse Pression Effort Couple Tension Courant",
    "es": "Tiempo Posición Velocidad Presión Fuerza Par Voltaje Corriente",
    "it": "Tempo Spostamento Velocità Pressione Forza Coppia Tensione Corrente",
    "pt": "Tempo Deslocamento Velocidade Pressão Força Binário Tensão Corrente",
    "nl": "Tijd Verplaatsing Snelheid Druk Kracht Koppel Spanning Stroom",
    "da": "Tid Position Hastighed Tryk Kraft Moment Spænding Strøm",
    "no": "Tid Forskyvning Hastighet Trykk Kraft Moment Spenning Strøm",
    "sv": "Tid Läge Hastighet Tryck Kraft Vridmoment Spänning Ström",
    "pl": "Czas Przemieszczenie Prędkość Ciśnienie Siła Moment Napięcie Prąd",
}
ENCODED = [(language, "utf-8") for language in LANGUAGES] + [
    ("zh-tw", "cp950"), ("zh-tw", "utf-16"), ("zh-cn", "gb18030"), ("ja", "cp932"), ("ja", "euc_jp"), ("ko", "cp949"),
    ("ru", "cp1251"), ("ru", "koi8-r"), ("pl", "cp1250"), ("de", "cp850"), ("de", "cp1252"), ("fr", "cp1252"),
    ("es", "cp1252"), ("it", "cp1252"), ("pt", "cp1252"), ("da", "cp1252"), ("no", "cp1252"), ("sv", "latin-1"),
]  # fmt: skip


@pytest.mark.parametrize(("language", "encoding"), ENCODED)
def test_a_log_reads_the_same_in_any_language_and_encoding(language: str, encoding: str, tmp_path: Path) -> None:
    head = [f"{name} ({unit})" for name, unit in zip(LANGUAGES[language].split(), UNITS, strict=True)]
    run = read(tmp_path, text(ROWS, head, delimiter=";", decimal=","), encoding)
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    ("column", "factor", "header"),
    [
        (1, 1e3, "Displacement (mm)"),
        (1, 1 / 0.3048, "Payout [ft]"),
        (2, 1e3, "Velocity_mm/s"),
        (2, 60.0, "Line speed (m/min)"),
        (3, KGF * 1e-2, "Pressure (MPa)"),
        (3, KGF * 1e-1, "Pressure / bar"),
        (3, KGF * 1e4 / 6894.757, "Druck / psi"),
        (4, 1e-3, "force_kN"),
        (4, 0.1, "Kraft [daN]"),
        (4, 1 / KGF, "Load cell (kgf)"),
        (4, 1 / 4.448222, "Tension: lbf"),
        (4, 3.596943, "Force (ozf)"),
        (5, 0.7375621, "Torque (lbf.ft)"),
        (6, 1e-3, "DC link voltage (kV)"),
        (7, 1e3, "Idc mA"),
    ],
)
def test_a_unit_changes_no_result(column: int, factor: float, header: str, tmp_path: Path) -> None:
    run = read(tmp_path, scaled(column, factor, header))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=ROUNDED)


def test_a_column_without_a_unit_is_taken_in_the_usual_one_and_reported(tmp_path: Path) -> None:
    run = read(tmp_path, text(ROWS, ["Time (s)", *NAMES[1:]]))
    assert [f.channel for f in run.findings if f.kind == "unit_assumed"] == [*list(CHANNELS)[:5], "vdc", "idc"]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize("unit", ["foo", "_", "N N N", "%%"])
def test_a_unit_that_nobody_knows_is_assumed(unit: str, tmp_path: Path) -> None:
    run = read(tmp_path, text(ROWS, [*HEAD[:4], f"Force ({unit})", *HEAD[5:]]))
    assert kinds(run) == {"unit_assumed"}


def test_columns_that_are_no_channel_make_one_finding(tmp_path: Path) -> None:
    extra = [f"CH{k} temp" for k in range(292)]
    run = read(tmp_path, text([["1.5"] * 292 + row for row in ROWS], extra + HEAD))
    assert [(f.kind, f.count) for f in run.findings] == [("unknown_column", 292)]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize("name", ["No.", "#", "Index", "RECORD", "Sample", "序號", ""])
def test_numbers_of_rows_are_nothing_to_tell(name: str, tmp_path: Path) -> None:
    run = read(tmp_path, text([[str(k), *row] for k, row in enumerate(ROWS)], [name, *HEAD]))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_plain_name_wins_over_one_that_says_where(tmp_path: Path) -> None:
    rows = [[*r[:3], "9.9", *r[3:]] for r in ROWS]
    run = read(tmp_path, text(rows, [*HEAD[:3], "Velocity of drum actual (m/s)", *HEAD[3:]]))
    assert kinds(run) == {"unknown_column"}
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_time_that_names_its_unit_wins_over_a_stamp(tmp_path: Path) -> None:
    run = read(tmp_path, text([["2026-04-18 10:00:00", *row] for row in ROWS], ["Timestamp", *HEAD]))
    assert kinds(run) == set()
    assert run.fs == 25.0


def test_a_log_without_motion_lists_what_it_has(tmp_path: Path) -> None:
    with pytest.raises(
        LogError, match=r"no column for a motion .* and none for a power; the log has c0, c1.*\[columns\]"
    ):
        read(tmp_path, text(ROWS, [f"c{k}" for k in range(8)]))


# ------------------------------------------------------------------------------ units of the log and of the rig file
def reduced_with(folder: Path, unit: str, header: str = "Idc (A)", *, override: bool = False) -> Run:
    rig = folder / "rig.toml"
    entry = f'{{ name = "{header}", unit = "{unit}"{", override = true" if override else ""} }}'
    rig.write_text(f'name = "mine"\nbased_on = "hsu2026"\n[columns]\nidc = {entry}\n')
    return read(folder, text(ROWS, [*HEAD[:-1], header]), rig=load_rig(rig))


def test_a_unit_of_the_rig_file_that_contradicts_the_header_is_reported_and_the_header_counts(tmp_path: Path) -> None:
    run = reduced_with(tmp_path, "mA")
    (finding,) = run.findings
    assert (finding.kind, finding.channel) == ("unit_conflict", "idc")
    assert "'Idc (A)'" in finding.message
    assert "idc in mA" in finding.message
    assert finding.action == "the unit of the header is used; override = true takes the other"
    assert run.channels["idc"].max() > 1.0


def test_the_unit_of_the_rig_file_counts_where_it_says_override(tmp_path: Path) -> None:
    run = reduced_with(tmp_path, "mA", override=True)
    (finding,) = run.findings
    assert (finding.kind, finding.action) == ("unit_conflict", "the unit of the rig is used")
    assert run.channels["idc"].max() < 0.1


@pytest.mark.parametrize(("unit", "header"), [("A", "Idc (A)"), ("A", "Idc"), ("ampere", "Idc [A]")])
def test_a_unit_of_the_rig_file_that_the_header_shares_or_lacks_gives_no_finding(
    tmp_path: Path, unit: str, header: str
) -> None:
    assert reduced_with(tmp_path, unit, header).findings == ()


def test_override_without_a_unit_is_a_fault_of_the_rig_file(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('name = "mine"\nbased_on = "hsu2026"\n[columns]\nidc = { name = "Idc (A)", override = true }\n')
    with pytest.raises(RigError, match=r"\[columns\] idc: override = true without a unit; add unit"):
        load_rig(rig)
