import math
import tomllib

import pytest
from loops import failures

from winchcascade.core.errors import RigError
from winchcascade.core.quantity import Calibrated
from winchcascade.core.rig_file import Thresholds
from winchcascade.core.rig_toml import BUILT_IN, built_in, built_in_text, parse_rig
from winchcascade.rig.open_rig import load_rig

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
        ("force", "u_zero", 2.0),
        ("torque", "high", 500.0),
        ("pressure", "high", 20e6),
        ("pressure", "u_zero", 0.03 * 98066.5),
        ("idc", "u_zero", 0.005),
    ],
)
def test_a_sensor_of_table_1_is_in_si_units(sensor: str, field: str, si: float) -> None:
    assert getattr(built_in("hsu2026").sensors[sensor], field) == pytest.approx(si, rel=1e-3)


def test_the_papers_rig_states_every_threshold_and_as_the_code_has_it() -> None:
    assert set(tomllib.loads(built_in_text("hsu2026"))["thresholds"]) == set(Thresholds.__struct_fields__)
    assert built_in("hsu2026").thresholds == Thresholds()


def test_one_metre_a_second_turns_the_generator_at_3673_rpm() -> None:
    assert built_in("hsu2026").rpm_per_velocity == pytest.approx(50 / 0.13 * 30 / 3.141592653589793)


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
    ("stated", "u"), [("", 0.001), ("load_u_percent = 2", 0.02), ("load_limits_percent = 2", 0.02 / math.sqrt(3.0))]
)
def test_the_uncertainty_of_a_load_replaces_that_of_the_rig_below(stated: str, u: float) -> None:
    rig = parse_rig(f'based_on = "hsu2026"\nname = "mine"\n[dc_link]\n{stated}\n', "mine.toml")
    assert rig.dc_link.load_u == pytest.approx(u, rel=1e-12)


@pytest.mark.parametrize("percent", ["", "_percent"])
@pytest.mark.parametrize(
    ("table", "entry", "load"),
    [("winch", 'r_drum = {{ value = 1, unit = "m", {} = 1 }}', ""), ("dc_link", "{} = 1", "load_")],
)
def test_a_tolerance_is_rejected_with_both_keys_that_replace_it(
    table: str, entry: str, load: str, percent: str
) -> None:
    stated = entry.format(f"{load}tolerance{percent}")
    with pytest.raises(RigError) as fault:
        parse_rig(f"{MINIMAL}[{table}]\n{stated}\n", "mine.toml")
    assert {f"{load}u{percent}", f"{load}limits{percent}"} <= set(str(fault.value).replace(",", "").split())
    assert f"[{table}]" in str(fault.value)


def test_a_rig_based_on_another_says_only_what_differs() -> None:
    rig = parse_rig(
        'based_on = "hsu2026"\nname = "mine"\n[winch]\nr_drum = { value = 200, unit = "mm" }\n'
        '[columns]\nforce = { name = "LC1", unit = "kN" }\nvelocity = "enc"\n[thresholds]\nsettle = 1\nwindow = 5.48\n',
        "mine.toml",
    )
    assert rig.r_drum == 0.2
    assert rig.drivetrain == built_in().drivetrain
    assert rig.columns["force"].name == "LC1"
    assert rig.columns["velocity"].unit is None
    assert rig.thresholds.settle == 1.0
    assert rig.thresholds.window == "5.48"


def test_a_sensor_of_a_rig_based_on_another_keeps_nothing_of_the_old_one() -> None:
    rig = parse_rig('based_on = "hsu2026"\n[sensors.force]\nunit = "N"\nhigh = 5000\n', "mine.toml")
    assert rig.sensors["force"].high == 5000.0
    assert rig.sensors["force"].resolution is None


SPEED = '[sensors.speed]\nunit = "rpm"\n'
COLUMNS, PHASES = "[columns]\n", "[phases]\n"


def test_a_wrong_entry_is_one_sentence_with_its_place() -> None:
    def check(text: str, says: str) -> None:
        with pytest.raises(RigError) as fault:
            parse_rig(text, "mine.toml")
        message = str(fault.value)
        assert message.startswith("mine.toml: ")
        assert says in message
        assert "\n" not in message

    cases = [
        ("name = ", "not a valid TOML file"),
        ('title = "x"\n', "the entry name is missing"),
        (MINIMAL + "colour = 1\n", "colour is no entry of a rig file"),
        (MINIMAL + "winch = 3\n", "winch is 3; expected a table"),
        (MINIMAL + "[winch]\nr_drumm = 0.13\n", "[winch] r_drumm is no entry"),
        (MINIMAL + "[winch]\nr_drum = 0.13\n", "expected { value = ..., unit ="),
        (MINIMAL + '[winch]\nr_drum = { value = "a", unit = "m" }\n', "r_drum value: expected a number, found a text"),
        (MINIMAL + '[winch]\nr_drum = { value = 1, unit = "kg" }\n', "the unit 'kg' is none of length"),
        (MINIMAL + '[winch]\nr_drum = { value = -1, unit = "m" }\n', "expected between 0.001 and 100 in SI units"),
        (MINIMAL + '[winch]\nr_drum = { value = nan, unit = "m" }\n', "expected a finite number"),
        (
            MINIMAL + '[winch]\nr_drum = { value = 1, unit = "m", sorce = "x" }\n',
            "sorce is no entry here; expected value",
        ),
        (MINIMAL + '[drivetrain]\neta_mesh = { value = 1.2, unit = "1" }\n', "expected a share between 0 and 1"),
        (MINIMAL + '[drivetrain]\none_way_clutch = "yes"\n', "one_way_clutch is 'yes'; expected true or false"),
        (MINIMAL + '[sensors.weight]\nunit = "N"\n', "[sensors.weight] is no channel"),
        (MINIMAL + '[sensors.force]\nunit = "bar"\n', "'bar' is none of force"),
        (MINIMAL + '[sensors.force]\nunit = "N"\nlow = 3\nhigh = 2\n', "low 3 is not below high 2"),
        (MINIMAL + '[sensors.pressure]\nunit = "bar(a)"\nlow = 0\n', "does not count from the zero of the channel"),
        (MINIMAL + "[sensors.force]\nhigh = 2\n", "unit is missing; expected the unit of the numbers"),
        (MINIMAL + '[columns]\nwind = "w"\n', "[columns] wind is no channel"),
        (MINIMAL + '[columns]\nforce = { name = "F", unit = "V" }\n', "'V' is none of force"),
        (MINIMAL + "[thresholds]\nwindow = 0\n", "[thresholds]: window is 0"),
        (MINIMAL + "[thresholds]\nwindow = 1" + "0" * 400 + "\n", "thresholds window is the whole number of hundreds"),
        (MINIMAL + "[thresholds]\nrpm_bin = 1e-9\n", "expected between 1 and 100000"),
        (MINIMAL + "[thresholds]\nsmoothing = 3000\n", "expected between 0.001 and 10"),
        (MINIMAL + '[winch]\nr_drum = { value = 130, unit = "m" }\n', "expected between 0.001 and 100"),
        (MINIMAL + '[sensors.force]\nunit = "N"\nresolution = -1\n', "expected a number that is not negative"),
        (MINIMAL + '[columns]\nforce = "F"\ntorque = "F"\n', "both name the column 'F'"),
        (MINIMAL + '[thresholds]\nwindow = "soon"\n', "[thresholds]: window is 'soon'"),
        (MINIMAL + "[thresholds]\nonset = 1\n", "[thresholds] onset is no entry"),
        (MINIMAL + "[thresholds]\nv_onset = inf\n", "expected a finite number"),
        (MINIMAL + "[log]\nsample_rate_hz = 0\n", "expected a number above 0"),
        (MINIMAL + '[restoring]\nlead = { value = 0, unit = "mm/rev" }\n', "lead is 0; expected a number above 0"),
        (
            MINIMAL + '[restoring]\nmu_screw = { value = -1, unit = "1" }\n',
            "mu_screw is -1; expected a number from 0 on",
        ),
        (MINIMAL + "[dc_link]\nload_u_percent = 1\nload_limits_percent = 1\n", "expected one of them"),
        (
            MINIMAL + '[winch]\nr_drum = { value = 1, unit = "m", u = 1, limits_percent = 1 }\n',
            "has u and limits_percent",
        ),
        (MINIMAL + "[dc_link]\nload_u_percent = -1\n", "is -1; expected percent of the load, from 0 on"),
        (MINIMAL + "[model]\ndiscrepancy = 0.6\n", "discrepancy is 0.6; expected a share from 0 to 0.5"),
        (MINIMAL + "[thresholds]\nplateau_level = 1.1\n", "plateau_level is 1.1; expected a share between 0 and 1"),
        (MINIMAL + "[sensors]\nforce = 3\n", "[sensors] force is 3; expected a table [sensors.force]"),
        (MINIMAL + '[sensors.force]\nunit = "N"\nlow = inf\n', "low is inf; expected a finite number"),
        (MINIMAL + "[log]\nrate = 25\n", "[log] rate is no entry"),
        ('based_on = "other"\n', "based_on = 'other' is no built-in rig"),
        (MINIMAL + '[channels.torque]\nunit = "N.m"\n', "that no built-in channel has"),
        (MINIMAL + '[channels."a b"]\nunit = "W"\n', "letters, digits and underscores"),
        (MINIMAL + '[channels.pump]\nunit = "furlong"\n', "the unit 'furlong' is unknown"),
        (MINIMAL + "[channels.pump]\n", "the unit '' is unknown"),
        (MINIMAL + "[channels]\npump = 3\n", "expected a table [channels.pump]"),
        (MINIMAL + '[columns]\nspeed = { name = "n", side = "generator" }\n', "needs the gear ratio"),
        (MINIMAL + '[columns]\nforce = { name = "n", side = "drum" }\n', "only the speed of rotation has a side"),
        (MINIMAL + '[columns]\nspeed = { name = "n", side = "left" }\n', "left"),
        (MINIMAL + '[columns]\npump = "n"\n', "is no channel"),
        (
            MINIMAL + SPEED + "accuracy_reading = 0.01\ncoverage = 0.5\n",
            "coverage is 0.5; expected a coverage factor from 1 to 10",
        ),
        (MINIMAL + SPEED + "coverage = 2\n", "coverage belongs to an accuracy, and none is stated"),
        (
            MINIMAL + SPEED + "daq_reading = 0.001\n",
            "has the share of the acquisition system and no accuracy of the sensor",
        ),
        (MINIMAL + SPEED + "accuracy_reading = 0.01\ndaq_full_scale = 0.1\n", "daq_full_scale has no full scale"),
        (MINIMAL + SPEED + "accuracy_reading = 0.01\ndaq_reading = 3\n", "daq_reading is 3; expected a share"),
        (MINIMAL + COLUMNS + "force = { number = 0 }", "number is 0; expected the column's place, from 1 on"),
        (MINIMAL + COLUMNS + 'force = { number = 2, name = "F" }', "expected either name"),
        (MINIMAL + COLUMNS + 'force = { unit = "N" }', "expected either name"),
        (
            MINIMAL + COLUMNS + "force = { number = 2 }\ntorque = { number = 2 }",
            "both name the column 2; expected one each",
        ),
        (MINIMAL + PHASES + 'from = "tides"', "from is 'tides'; expected velocity, displacement, speed, column,"),
        (MINIMAL + PHASES + 'from = "column"', "needs the column and its values in payout"),
        (MINIMAL + PHASES + "step_min_s = 0", "step_min_s is 0; expected a number above 0"),
        (MINIMAL + PHASES + "speed_band = 2", "speed_band is 2; expected a share above 0"),
        (MINIMAL + PHASES + "ranges_s = [[3, 2]]", "expected pairs of begin and end in seconds"),
        (MINIMAL + PHASES + "step = 1", "[phases] step is no entry of a rig file"),
    ]
    assert failures(check, cases) == []


def test_a_name_that_is_no_rig_is_reported_with_those_there_are() -> None:
    with pytest.raises(
        RigError, match="no such file and no built-in rig of that name; give a rig file or one of hsu2026"
    ):
        load_rig("hsu2025")


def test_a_name_that_no_file_can_have_is_no_rig() -> None:
    with pytest.raises(RigError, match="no such file and no built-in rig of that name"):
        load_rig("9" * 5000)


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


def test_a_calibrated_number_need_not_have_a_prior_nor_the_prior_an_uncertainty() -> None:
    bare = parse_rig(calibrated('{ log = "a", sha256 = "" }'), "mine.toml").drivetrain.eta_mesh
    exact = parse_rig(calibrated('{ log = "a", sha256 = "", prior = { value = 95 } }'), "mine.toml").drivetrain.eta_mesh
    assert bare is not None
    assert exact is not None
    assert bare.calibrated == Calibrated("a", "")
    assert exact.calibrated is not None
    assert exact.calibrated.prior is not None
    assert exact.calibrated.prior.u is None


@pytest.mark.parametrize(
    ("record", "place", "found"),
    [
        ("3", "calibrated", "a whole number"),
        (f'{{ sha256 = "{SHA256}" }}', "calibrated", "log"),
        ('{ log = "a.csv" }', "calibrated", "sha256"),
        (f'{{ log = 1, sha256 = "{SHA256}" }}', "calibrated.log", "a whole number"),
        ('{ log = "a.csv", sha256 = "01AB" }', "calibrated.sha256", "'01AB'"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", by = "me" }}', "calibrated", "by"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", prior = 0.95 }}', "calibrated.prior", "a number"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", prior = {{ u = 2 }} }}', "calibrated.prior", "value"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", prior = {{ value = 95, unit = "%" }} }}', "calibrated.prior", "unit"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", prior = {{ value = 950 }} }}', "calibrated.prior", "9.5"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", prior = {{ value = nan }} }}', "calibrated.prior", "nan"),
        (f'{{ log = "a.csv", sha256 = "{SHA256}", prior = {{ value = 95, u = -1 }} }}', "calibrated.prior", "u is -1"),
    ],
)
def test_a_wrong_record_of_a_calibration_is_a_fault_with_its_place(record: str, place: str, found: str) -> None:
    with pytest.raises(RigError) as fault:
        parse_rig(calibrated(record), "mine.toml")
    text = str(fault.value)
    assert text.startswith(f"mine.toml: [drivetrain] eta_mesh {place}")
    assert found in text
