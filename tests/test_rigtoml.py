import math
import re
import tomllib
from pathlib import Path

import msgspec
import pytest
from loops import rejections

from winchcascade.core.errors import RigError
from winchcascade.core.machine_parts import measures
from winchcascade.core.rig_file import Thresholds
from winchcascade.core.rig_toml import BUILT_IN, built_in, built_in_text, parse_rig
from winchcascade.rig.baseline import load_rig

MINIMAL = 'name = "mine"\n'


@pytest.mark.parametrize(
    ("section", "entry", "si", "u"),
    [
        ("winch", "r_drum", 0.13, None),
        ("winch", "inertia", 0.3, None),
        ("restoring", "lead", 0.01, None),
        ("restoring", "area_piston", 7850e-6, 0.002 * 7850e-6),
        ("restoring", "p_precharge", 20.5 * 98066.5, 0.001 * 20.5 * 98066.5),
        ("restoring", "volume_gas", 4e-3, 0.003 * 4e-3),
        ("restoring", "mu_screw", 0.04, 0.0005),
        ("drivetrain", "gear_ratio", 50.0, None),
        ("drivetrain", "eta_mesh", 0.95, 0.002),
        ("drivetrain", "b_rotor", 7.5e-4, 7.5e-6),
        ("drivetrain", "inertia_rotor", 6260e-7, None),
        ("generator", "k_e", 0.062, 0.001 * 0.062),
        ("generator", "r_s", 0.61, 0.005 * 0.61),
        ("generator", "l_s", 3.35e-3, 0.007 * 3.35e-3),
        ("dc_link", "c_dc", 2.2e-3, 2.2e-4),
    ],
)
def test_a_number_of_the_papers_rig_is_in_si_units_with_its_uncertainty(
    section: str, entry: str, si: float, u: float | None
) -> None:
    quantity = getattr(getattr(built_in("hsu2026"), section), entry)
    assert quantity.value == pytest.approx(si, rel=1e-12)
    assert quantity.u == (None if u is None else pytest.approx(u, rel=1e-9))
    assert quantity.source


@pytest.mark.parametrize(
    ("sensor", "field", "si"),
    [
        ("force", "high", 2000 * 9.80665),
        ("force", "resolution", 0.2 * 9.80665),
        ("force", "accuracy_full_scale", 0.002),
        ("torque", "high", 500.0),
        ("pressure", "high", 20e6),
        ("pressure", "accuracy_full_scale", 0.001),
        ("idc", "accuracy", 0.01),
    ],
)
def test_a_sensor_of_table_1_is_in_si_units(sensor: str, field: str, si: float) -> None:
    assert getattr(built_in("hsu2026").sensors[sensor], field) == pytest.approx(si, rel=1e-3)


def test_the_papers_rig_states_no_calibration_in_place_and_the_rebuilt_campaign_does(
    fixtures: Path,
) -> None:
    own = parse_rig((fixtures / "campaign" / "rig.toml").read_text(), "rig.toml")
    for name, sensor in built_in("hsu2026").sensors.items():
        assert (sensor.u_zero, sensor.u_gain) == (None, None)
        calibrated = msgspec.structs.replace(
            own.sensors[name], u_zero=None, u_gain=None, source=sensor.source
        )
        assert calibrated == sensor
    zeros = {"pressure": 0.03 * 98066.5, "force": 2.0, "torque": 0.3, "vdc": 0.05, "idc": 0.005}
    assert {n: s.u_zero for n, s in own.sensors.items() if s.u_zero} == pytest.approx(
        zeros, rel=1e-3
    )
    assert own.thresholds == built_in("hsu2026").thresholds


def test_the_papers_rig_states_every_threshold_and_its_shares_as_the_code_has_them() -> None:
    assert set(tomllib.loads(built_in_text("hsu2026"))["thresholds"]) == set(
        Thresholds.__struct_fields__
    )
    stated, usual = built_in("hsu2026").thresholds, Thresholds()
    shares = [
        name
        for name in Thresholds.__struct_fields__
        if name not in (*measures(Thresholds), "rpm_bin")
    ]
    assert [getattr(stated, name) for name in shares] == [getattr(usual, name) for name in shares]


def test_a_rig_based_on_another_inherits_no_size_of_its_motion_but_its_shares() -> None:
    rig = parse_rig(
        'based_on = "kitepower"\nname = "kite"\n[thresholds]\nsettle = 1\n', "kite.toml"
    )
    stated = {
        name
        for name in (*measures(Thresholds), "rpm_bin")
        if not math.isnan(getattr(rig.thresholds, name))
    }
    assert stated == {"settle"}
    assert (rig.thresholds.window, rig.thresholds.reversal_max) == ("payout", 0.2)


@pytest.mark.parametrize(
    ("k_e", "kept"), [(0.062, True), (0.067, True), (0.07, False), (0.03, False)]
)
def test_rated_values_are_those_of_a_machine_with_the_same_constant(k_e: float, kept: bool) -> None:
    entry = f'[generator]\nk_e = {{ value = {k_e}, unit = "V/rpm" }}\n'
    machine = parse_rig(f'based_on = "hsu2026"\nname = "mine"\n{entry}', "mine.toml").generator
    assert (machine.i_rated is not None, machine.speed_rated is not None) == (kept, kept)
    assert machine.r_s == built_in().generator.r_s


def test_the_field_winch_has_no_drum_radius_and_says_so() -> None:
    rig = built_in("kitepower")
    assert rig.r_drum is None
    assert rig.rpm_per_velocity is None
    assert "drum radius not published" in rig.note


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_built_in_rig_can_be_written_out_and_read_back(name: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "my rig.toml"
    path.write_text(built_in_text(name), encoding="utf-8")
    assert load_rig(path).winch == built_in(name).winch


@pytest.mark.parametrize(
    ("stated", "u", "rectangular"),
    [
        ("u = 2", 0.002, False),
        ("u_percent = 2", 0.02 * 0.2, False),
        ("limits = 2", 0.002 / math.sqrt(3.0), True),
        ("limits_percent = 2", 0.02 * 0.2 / math.sqrt(3.0), True),
    ],
)
def test_an_uncertainty_is_one_standard_uncertainty_or_limits_of_a_rectangular_distribution(
    stated: str, u: float, rectangular: bool
) -> None:
    radius = parse_rig(
        f'{MINIMAL}[winch]\nr_drum = {{ value = 200, unit = "mm", {stated} }}\n', "mine.toml"
    ).winch.r_drum
    assert radius is not None
    assert radius.u == pytest.approx(u, rel=1e-12)
    assert radius.rectangular == rectangular


@pytest.mark.parametrize(
    ("stated", "u"),
    [("", 0.001), ("load_u_percent = 2", 0.02), ("load_limits_percent = 2", 0.02 / math.sqrt(3.0))],
)
def test_the_uncertainty_of_a_load_replaces_that_of_the_rig_below(stated: str, u: float) -> None:
    rig = parse_rig(f'based_on = "hsu2026"\nname = "mine"\n[dc_link]\n{stated}\n', "mine.toml")
    assert rig.dc_link.load_u == pytest.approx(u, rel=1e-12)


@pytest.mark.parametrize(
    ("table", "entry", "load"),
    [
        ("winch", 'r_drum = { value = 1, unit = "m", tolerance = 1 }', ""),
        ("dc_link", "load_tolerance_percent = 1", "load_"),
    ],
)
def test_a_tolerance_is_rejected_with_both_keys_that_replace_it(
    table: str, entry: str, load: str
) -> None:
    with pytest.raises(RigError) as fault:
        parse_rig(f"{MINIMAL}[{table}]\n{entry}\n", "mine.toml")
    assert {f"{load}u_percent", f"{load}limits_percent"} <= set(
        re.findall(r"\w+", str(fault.value))
    )
    assert f"[{table}]" in str(fault.value)


def test_a_rig_based_on_another_says_only_what_differs() -> None:
    rig = parse_rig(
        'based_on = "hsu2026"\nname = "mine"\n[winch]\nr_drum = { value = 200, unit = "mm" }\n'
        '[columns]\nforce = { name = "LC1", unit = "kN" }\nvelocity = "enc"\n[thresholds]\nsettle '
        "= 1\nwindow = 5.48\n",
        "mine.toml",
    )
    assert rig.r_drum == 0.2
    assert rig.drivetrain == built_in().drivetrain
    assert rig.columns["force"].name == "LC1"
    assert rig.columns["velocity"].unit is None
    assert rig.thresholds.settle == 1.0
    assert rig.thresholds.window == 5.48


def test_a_sensor_of_a_rig_based_on_another_keeps_nothing_of_the_old_one() -> None:
    rig = parse_rig('based_on = "hsu2026"\n[sensors.force]\nunit = "N"\nhigh = 5000\n', "mine.toml")
    assert rig.sensors["force"].high == 5000.0
    assert rig.sensors["force"].resolution is None


WRONG = """
name = @ TOML
title = "x" @ name missing
NAME colour = 1 @ colour columns
NAME winch = 3 @ winch 3 table
NAME [winch]; r_drum = 0.13 @ [winch] r_drum 0.13 table
NAME [winch]; r_drum = { value = "a", unit = "m" } @ [winch] r_drum value 'a'
NAME [winch]; r_drum = { value = 1, unit = "kg" } @ [winch] r_drum 'kg' length
NAME [winch]; r_drum = { value = -1, unit = "m" } @ [winch] r_drum -1 0.001
NAME [winch]; r_drum = { value = 1, unit = "m", sorce = "x" } @ [winch] r_drum sorce source
NAME [winch]; r_drum = { value = 1, unit = "m", u = 1, limits_percent = 1 } @ [winch] r_drum u limits_percent
NAME [restoring]; lead = { value = 0, unit = "mm/rev" } @ [restoring] lead > 0
NAME [sensors.weight]; unit = "N" @ [sensors] weight force
NAME [sensors.force]; unit = "bar" @ [sensors.force] 'bar' force
NAME [sensors.force]; high = 2 @ [sensors.force] unit missing
NAME [sensors.force]; unit = "N"; low = 3; high = 2 @ [sensors.force] low 3 high 2
NAME [sensors.pressure]; unit = "bar(a)"; low = 0 @ [sensors.pressure] 'bar(a)' gauge
NAME [sensors.speed]; unit = "rpm"; accuracy_reading = 0.01; daq_full_scale = 0.1 @ [sensors.speed] daq_full_scale high
NAME [columns]; wind = "w" @ [columns] wind force
NAME [columns]; force = { name = "F", unit = "V" } @ [columns] force 'V'
NAME [columns]; force = "F"; torque = "F" @ [columns] force torque 'F'
NAME [columns]; speed = { name = "n", side = "generator" } @ [columns] speed gear_ratio
NAME [thresholds]; window = "soon" @ [thresholds] window 'soon'
NAME [thresholds]; rpm_bin = 0 @ [thresholds] rpm_bin > 0
NAME [dc_link]; load_u_percent = 1; load_limits_percent = 1 @ [dc_link] load_u_percent load_limits_percent
NAME [channels.torque]; unit = "N.m" @ [channels.torque] name
NAME [channels.pump]; unit = "furlong" @ [channels.pump] 'furlong'
NAME [phases]; from = "tides" @ [phases] from 'tides' waves
NAME [phases]; from = "column" @ [phases] column payout
NAME [phases]; ranges_s = [[3, 2]] @ [phases] ranges_s begins
based_on = "other" @ based_on 'other' hsu2026
"""
"""Rig files that cannot be used, and words of the sentence: the place, what was found, what was
expected.
"""


def test_a_wrong_entry_is_one_sentence_with_its_place() -> None:
    assert rejections(parse_rig, RigError, WRONG.replace("NAME", 'name = "mine";')) == []


@pytest.mark.parametrize("name", ["hsu2025", "9" * 5000])
def test_a_name_that_is_no_rig_is_reported_with_those_there_are(name: str) -> None:
    with pytest.raises(RigError, match="hsu2026, kitepower"):
        load_rig(name)


SHA256 = "0123456789abcdef" * 4


def calibrated(record: str) -> str:
    """A rig file whose gear mesh has a record of its calibration."""
    return f'{MINIMAL}[drivetrain]\neta_mesh = {{ value = 94, unit = "%", u = 0.5, calibrated = {record} }}\n'


def test_a_calibrated_number_has_its_prior_in_si_units() -> None:
    record = f'{{ log = "a.csv", sha256 = "{SHA256}", prior = {{ value = 95, u = 2, source = "Table 4" }} }}'
    number = parse_rig(calibrated(record), "mine.toml").drivetrain.eta_mesh
    assert number is not None
    assert number.value == pytest.approx(0.94)
    prior = number.calibrated.prior if number.calibrated else None
    assert prior is not None
    assert (prior.value, prior.u) == pytest.approx((0.95, 0.02))
    assert (prior.unit, prior.source, prior.calibrated) == ("%", "Table 4", None)


WRONG_RECORDS = """
{ sha256 = "" } @ calibrated log missing
{ log = "a.csv", sha256 = "01AB" } @ calibrated sha256 '01AB' 64
{ log = "a.csv", sha256 = "", prior = { u = 2 } } @ calibrated prior value missing
{ log = "a.csv", sha256 = "", prior = { value = 95, unit = "%" } } @ calibrated prior unit value
{ log = "a.csv", sha256 = "", prior = { value = 950 } } @ calibrated prior 9.5
"""


def test_a_wrong_record_of_a_calibration_is_a_fault_with_its_place() -> None:
    def read(record: str, where: str) -> object:
        return parse_rig(calibrated(record), where)

    assert rejections(read, RigError, WRONG_RECORDS) == []
