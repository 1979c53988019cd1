"""Columns: names and units are recognised in any language, what is no channel is not, and a
rejection helps on.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from campaign_log import (
    HEAD,
    NAMES,
    ROWS,
    SAME,
    SOURCE,
    UNITS,
    clean,
    efficiencies,
    kinds,
    read,
    scaled,
    text,
    write,
)
from loops import failures

from winchcascade import Run, read_run
from winchcascade.core.channels import CHANNELS
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.quantity import KGF
from winchcascade.core.quantity import UNITS as UNIT_TABLE
from winchcascade.core.rig_toml import parse_rig
from winchcascade.ingest import headers
from winchcascade.ingest.headers import DIMENSION, Header, read_header, recognise

TABLE = tomllib.loads(
    (Path(headers.__file__).parent / "column_names.toml").read_text(encoding="utf-8")
)
LISTED = [(channel, name) for channel in DIMENSION for name in TABLE[channel]["names"].split()]
UNIT = {"time": "s"} | {name: channel.unit for name, channel in CHANNELS.items()}

PUBLIC, FOUR_LANGUAGES = (
    tomllib.loads((Path(__file__).parent / "headers" / file).read_text(encoding="utf-8"))["log"]
    for file in ("public_logs.toml", "four_languages.toml")
)
RECOGNISED = [(PUBLIC, 0.8), (FOUR_LANGUAGES, 0.85)]
"""Smallest share of the channels of each set of headers that are recognised without a rig file."""

ROUNDED = 1e-5
"""Factors below are given to six digits or more."""


@pytest.mark.parametrize(("logs", "share"), RECOGNISED, ids=["public", "four languages"])
def test_columns_of_many_logs_are_recognised_and_none_wrongly(
    logs: list[dict[str, Any]], share: float
) -> None:
    found = [
        (recognise(Header(n, u or None)) or "", right, n)
        for log in logs
        for n, u, right in log["headers"]
    ]
    assert [name for channel, right, name in found if channel not in ("", right)] == []
    count = Counter(channel == right for channel, right, _ in found if right)
    assert count[True] >= share * count.total()


def test_the_headers_of_public_logs_come_from_many_repositories() -> None:
    assert len({log["repository"] for log in PUBLIC}) >= 10


def test_no_header_of_four_languages_is_another_channel_without_its_unit() -> None:
    headers = [
        (name.partition("(")[0].partition("[")[0], right)
        for log in FOUR_LANGUAGES
        for name, _, right in log["headers"]
    ]
    assert [name for name, right in headers if recognise(Header(name)) not in (None, right)] == []


def test_a_listed_name_with_the_unit_of_its_channel_is_that_channel() -> None:
    def check(channel: str, name: str) -> None:
        assert recognise(Header(f"{name} ({UNIT[channel]})")) == channel
        assert recognise(Header(name.upper(), UNIT[channel])) == channel

    assert failures(check, LISTED) == []


def test_every_unit_of_the_table_is_read_back_from_a_header() -> None:
    def check(channel: str, form: str) -> None:
        name = TABLE[channel]["names"].split()[1]
        for spelled, unit in UNIT_TABLE.items():
            if unit.dimension == DIMENSION[channel]:
                assert read_header(Header(form.format(name, spelled))).unit == unit, spelled

    forms = [
        "{} [{}]",
        "{}({})",
        "{} / {}",
        "{}, {}",
        "{} {}",
        "{}_{}",
        "{} in {}",
        "{}:{}",
        "{}（{}）",
    ]
    assert failures(check, product(DIMENSION, forms)) == []


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("AI3 force (N)", "force"), ("ch2_load cell (N)", "force"), ("cDAQ1Mod1/tension (N)", "force"),
        ("cDAQ1Mod1/F", "force"), ("testMachineForce2", "force"), ("/winch/tension", "force"), ("V", "vdc"),
        ("RopeVelocity_kmh", "velocity"),
        ("field.tether_speed", "velocity"), ("Speed", "velocity"), ("Speed_m_s", "velocity"), ("wire_out_m", "displacement"),
        ("Shaft speed", "speed"), ("speed_rad_s", "speed"), ("Motor Optical Speed (RPM)", "speed"), ("Speed (Hz)", "speed"),
        ("rotation speed (U/min)", "speed"), ("回転数 (rpm)", "speed"), ("Status RPM", None), ("/cmd/torque", None),
        ("/wind/speed", None), ("pose/position/x", None), ("command_torque", None), ("T_motor", None), ("motor_current", None),
        ("Line voltage (V)", None), ("Torque (mV/V)", None), ("Speed (A)", None), ("Temperature "
                                                                                   "(degC)", None), ("n", None),
        ("Flow (gpm)", None), ("flow", None), ("AC power", None), ("start time", None), ("x" * 10_000, None), ("", None),
    ],
)  # fmt: skip
def test_a_name_is_a_channel_by_all_of_its_words(name: str, channel: str | None) -> None:
    assert recognise(Header(name)) == channel


def test_a_temperature_is_no_torque_and_no_time() -> None:
    def check(form: str, unit: str) -> None:
        assert recognise(Header(form.format(unit))) is None
        assert recognise(Header("T", unit)) is None

    units = ["°C", "℃", "ºC", "C", "degC", "deg C", "Celsius", "K", "kelvin", "°F", "degF"]
    assert (
        failures(
            check, product(["T ({})", "T [{}]", "t ({})", "T / {}", "T, {}", "Torque ({})"], units)
        )
        == []
    )


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
    "sv": "Tid Läge Hastighet Tryck Kraft Vridmoment Spänning Ström",
    "pl": "Czas Przemieszczenie Prędkość Ciśnienie Siła Moment Napięcie Prąd",
}
ENCODED = [(language, "utf-8") for language in LANGUAGES] + [
    ("zh-tw", "cp950"), ("zh-tw", "utf-16"), ("zh-cn", "gb18030"), ("ja", "cp932"), ("ja", "euc_jp"), ("ko", "cp949"),
    ("ru", "cp1251"), ("ru", "koi8-r"), ("pl", "cp1250"), ("de", "cp850"), ("fr", "cp1252"), ("sv", "latin-1"),
]  # fmt: skip


@pytest.mark.parametrize(("language", "encoding"), ENCODED)
def test_a_log_reads_the_same_in_any_language_and_encoding(
    language: str, encoding: str, tmp_path: Path
) -> None:
    head = [
        f"{name} ({unit})" for name, unit in zip(LANGUAGES[language].split(), UNITS, strict=True)
    ]
    run = read(tmp_path, text(ROWS, head, delimiter=";", decimal=","), encoding)
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    ("column", "factor", "header"),
    [
        (1, 1e3, "Displacement (mm)"), (1, 1 / 0.9144, "Payout [yards]"), (2, 1e3, "Velocity_mm/s"),
        (2, 60.0, "Line speed (m/min)"), (3, KGF * 1e-2, "Pressure (MPa)"), (3, KGF * 1e4 / 6894.757, "Druck / psi"),
        (4, 1e-3, "force_kN"), (4, 1 / 4.448222, "Tension: lbf"), (4, 3.596943, "Force (ozf)"),
        (5, 0.7375621, "Torque (lbf.ft)"), (6, 1e-3, "DC link voltage (kV)"), (7, 1e3, "Idc mA"),
    ],
)  # fmt: skip
def test_a_unit_changes_no_result(column: int, factor: float, header: str, tmp_path: Path) -> None:
    run = read(tmp_path, scaled(column, factor, header))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=ROUNDED)


def test_a_column_without_a_unit_is_taken_in_the_usual_one_and_reported(tmp_path: Path) -> None:
    run = read(tmp_path, text(ROWS, ["Time (s)", *NAMES[1:]]))
    assert [f.channel for f in run.findings if f.kind == "unit_assumed"] == [
        *list(CHANNELS)[:5],
        "vdc",
        "idc",
    ]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize("unit", ["foo", "_", "N N N", "%%", "9**9**9", "kilofurlongs"])
def test_a_unit_that_nobody_knows_is_assumed(unit: str, tmp_path: Path) -> None:
    assert kinds(read(tmp_path, text(ROWS, [*HEAD[:4], f"Force ({unit})", *HEAD[5:]]))) == {
        "unit_assumed"
    }


def test_columns_that_are_no_channel_make_one_finding_and_numbers_of_rows_none(
    tmp_path: Path,
) -> None:
    extra = [*(f"CH{k} temp" for k in range(292)), "Record", ""]
    run = read(tmp_path, text([["1.5"] * 294 + row for row in ROWS], extra + HEAD))
    assert [(f.kind, f.count) for f in run.findings] == [("unknown_column", 292)]
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_time_with_its_unit_comes_before_a_stamp(tmp_path: Path) -> None:
    run = read(
        tmp_path, text([["2026-04-18 10:00:00", *row] for row in ROWS], ["Timestamp", *HEAD])
    )
    assert kinds(run) == set()
    assert run.fs == 25.0
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_of_several_columns_for_one_channel_none_is_read_and_the_rig_file_decides(
    tmp_path: Path,
) -> None:
    rows = [[*row, f"{1.05 * float(row[5]):.5f}"] for row in ROWS]
    run = read(
        tmp_path, text(rows, [*HEAD, "Torque 2 (N.m)"]).replace("Torque (N.m)", "Torque 1 (N.m)")
    )
    (finding,) = [f for f in run.findings if f.kind == "ambiguous_column"]
    assert (finding.channel, finding.count) == ("torque", 2)
    assert "'Torque 1 (N.m)' (column 6), 'Torque 2 (N.m)' (column 9)" in finding.message
    assert "[columns]" in finding.action
    assert "torque" not in run.channels
    assert "force" in run.channels
    rig = parse_rig(
        'based_on = "hsu2026"\nname = "two"\n[columns]\ntorque = "Torque 2"\n', "two.toml"
    )
    run = read(tmp_path, text(rows, [*HEAD, "Torque 2 (N.m)"]), rig=rig)
    assert run.channels["torque"].max() == pytest.approx(1.05 * max(float(row[5]) for row in ROWS))


# ------------------------------------------------------------------------------------- rejections
@pytest.mark.parametrize(
    ("head", "found"),
    [
        ([f"c{k}" for k in range(8)], r"the log has c0, c1"),
        (
            ["Status_RPM_V1", "waveMakerPos", "TorqueValue"],
            r"displacement: 'waveMakerPos'; speed: 'Status_RPM_V1'\.",
        ),
        (
            ["Velocity (m/s)", "Line speed (m/s)"],
            r"'Velocity \(m/s\)', 'Line speed \(m/s\)'; expected one for each",
        ),
    ],
)
def test_a_log_without_motion_names_what_comes_near(
    head: list[str], found: str, tmp_path: Path
) -> None:
    rows = [["1.0"] * len(head)] * 20
    with pytest.raises(LogError, match=found):
        read(tmp_path, text(rows, head))


def test_a_column_that_the_rig_names_and_the_log_lacks_is_named_with_what_comes_near(
    tmp_path: Path,
) -> None:
    mine = 'based_on = "hsu2026"\nname = "mine"\n[columns]\n{} = "{}"\n'
    with pytest.raises(
        LogError, match=r"no column 'Velocty', .*near it: 'Velocity \(m/s\)'.*\[columns\]"
    ):
        read(tmp_path, text(), rig=parse_rig(mine.format("velocity", "Velocty"), "rig.toml"))
    run = read(tmp_path, text(), rig=parse_rig(mine.format("torque", "Torqe (N.m)"), "rig.toml"))
    finding, *_ = run.findings
    assert (finding.kind, finding.channel) == ("missing_channel", "torque")
    assert "near it: 'Torque (N.m)'" in finding.message


SEVERAL = parse_rig(
    'based_on = "hsu2026"\nname = "mine"\n[columns]\nforce = ["LC-17 [N]", "Celda"]\n', "rig.toml"
)


def forces(run: Run) -> list[float]:
    return list(run.channels["force"].tolist())


@pytest.mark.parametrize("name", ["LC-17 [N]", "LC-17 (N)", "Celda", "Celda [N]", "Force (N)"])
def test_a_rig_file_names_a_column_in_several_ways(name: str, tmp_path: Path) -> None:
    head = [name if one == "Force (N)" else one for one in HEAD]
    run = read(tmp_path, text(ROWS, head), rig=SEVERAL)
    assert "missing_channel" not in kinds(run)
    assert forces(run) == forces(read_run(SOURCE))


def test_a_name_with_a_unit_is_that_of_a_column_with_a_row_of_units(tmp_path: Path) -> None:
    names = ["LC-17" if one == "Force" else one for one in NAMES]
    run = read(tmp_path, text([UNITS, *ROWS], names), rig=SEVERAL)
    assert forces(run) == forces(read_run(SOURCE))


def test_a_log_with_two_of_the_names_of_a_channel_is_rejected(tmp_path: Path) -> None:
    head = {"Force (N)": "LC-17 [N]", "Pressure (kg/cm2)": "Celda"}
    with pytest.raises(LogError, match=r"2 columns .* force: LC-17 \[N\], Celda"):
        read(tmp_path, text(ROWS, [head.get(one, one) for one in HEAD]), rig=SEVERAL)


def test_an_entry_of_a_campaign_names_columns_of_its_own(tmp_path: Path) -> None:
    head = {"Force (N)": "LC-17 [N]", "Pressure (kg/cm2)": "Celda"}
    log = write(tmp_path, text(ROWS, [head.get(one, one) for one in HEAD]))
    (tmp_path / "rig.toml").write_text(
        'based_on = "hsu2026"\nname = "mine"\n[columns]\nforce = ["LC-17 [N]", "Celda"]\n'
    )
    entry = 'rig = "rig.toml"\n[[run]]\nfile = "log.csv"\ncolumns = {}\n'
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(entry.format('{ force = "LC-17 [N]", pressure = "Celda" }'))
    assert forces(read_run(log)) == forces(read_run(SOURCE))
    campaign.write_text(entry.format('{ forse = "LC-17 [N]" }'))
    with pytest.raises(RigError, match=r"campaign\.toml: log\.csv: \[columns\] forse"):
        read_run(log)


def test_a_log_with_the_columns_of_a_built_in_rig_is_referred_to_it(shared: Path) -> None:
    log = shared / "kitepower-2019-10-08" / "ground_station_cycles_01_43.csv"
    with pytest.raises(
        LogError, match="built-in rig kitepower, and no rig was named; add --rig kitepower"
    ):
        read_run(log)


# ----------------------------------------------------------- units of the log and of the rig file
def reduced_with(folder: Path, unit: str, header: str = "Idc (A)", more: str = "") -> Run:
    entry = f'{{ name = "{header}", unit = "{unit}"{more} }}'
    rig = parse_rig(f'name = "mine"\nbased_on = "hsu2026"\n[columns]\nidc = {entry}\n', "rig.toml")
    return read(folder, text(ROWS, [*HEAD[:-1], header]), rig=rig)


@pytest.mark.parametrize(("more", "largest"), [("", 1.0), (", override = true", 0.0)])
def test_a_unit_that_contradicts_the_header_is_reported_and_counts_where_it_overrides(
    more: str, largest: float, tmp_path: Path
) -> None:
    run = reduced_with(tmp_path, "mA", more=more)
    finding, *_ = run.findings
    assert (finding.kind, finding.channel) == ("unit_conflict", "idc")
    assert largest < run.channels["idc"].max() < largest + 10.0


@pytest.mark.parametrize(
    ("unit", "header"), [("A", "Idc (A)"), ("A", "Idc"), ("ampere", "Idc [A]")]
)
def test_a_unit_that_the_header_shares_or_lacks_gives_no_finding(
    tmp_path: Path, unit: str, header: str
) -> None:
    assert [f.kind for f in reduced_with(tmp_path, unit, header).findings] == ["thresholds_assumed"]
