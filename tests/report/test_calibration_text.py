"""A calibration in words and as a record."""

from functools import cache

import msgspec
import pytest
from openlog import made_log, steady_payouts

from winchcascade import Calibration, calibrate
from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.calibrate import Strain
from winchcascade.report.calibration_sheet import calibration_record, calibration_text

WIDEST = 120
"""The table is as wide as its reasons are long; sentences end at 100 columns."""


@cache
def calibration() -> Calibration:
    run = made_log(seed=1)
    return calibrate(run, built_in(), steady_payouts(run))


def with_regression(**numbers: float) -> Calibration:
    return msgspec.structs.replace(
        calibration(), regression=msgspec.structs.replace(calibration().regression, **numbers)
    )


def test_every_number_stands_in_the_table_with_its_interval() -> None:
    lines = calibration_text(calibration()).splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("number"))
    assert lines[head].split() == ["number", "before", "found", "95", "%", "interval", "unit", "how"]
    assert [line.split()[0] for line in lines[head + 1 : head + 5]] == ["k_e", "mu_screw", "eta_mesh", "b_rotor"]
    assert lines[head + 1].split()[1] == "0.062000"
    assert all(" to " in line for line in lines[head + 1 : head + 5])
    assert all(len(line) <= WIDEST for line in lines)


def test_the_regression_is_reported_with_what_eq_8_would_read() -> None:
    text = " ".join(calibration_text(calibration()).split())
    assert "rpm, R2 = 0.99" in text
    assert "of which the fit 0.0" in text
    assert "too low: it leaves out the current of the bleed of 4500 ohm" in text


def test_what_cannot_be_distinguished_is_reported() -> None:
    assert "cannot be distinguished here: k_e and gain of vdc (-0.9" in calibration_text(calibration())
    alone = msgspec.structs.replace(calibration(), together=())
    assert "cannot be distinguished here: nothing" in calibration_text(alone)


def test_numbers_that_differ_from_the_rig_file_are_distinguished_from_those_that_agree() -> None:
    assert "against rig hsu2026: k_e, mu_screw and b_rotor agree" in calibration_text(calibration())
    worn = tuple(
        msgspec.structs.replace(n, value=1.5 * n.before, u=0.01 * n.before) if n.name == "b_rotor" else n
        for n in calibration().numbers
    )
    text = " ".join(calibration_text(msgspec.structs.replace(calibration(), numbers=worn)).split())
    assert "k_e and mu_screw agree within the tolerances; b_rotor is 50 % above it, 35 standard" in text


@pytest.mark.parametrize(
    ("lag", "u_lag", "says"),
    [
        (0.120, 0.003, "lag: Vdc is recorded 120 ms late (95 % within 6 ms)"),
        (-0.050, 0.003, "lag: Vdc is recorded 50 ms early"),
        (0.120, 0.050, "findings: none"),
        (0.004, 0.001, "findings: none"),
    ],
)
def test_a_lag_is_a_finding_where_it_is_beyond_doubt(lag: float, u_lag: float, says: str) -> None:
    assert says in calibration_text(with_regression(lag=lag, u_lag=u_lag))


def test_a_fit_that_does_not_follow_the_log_is_a_finding() -> None:
    strained = msgspec.structs.replace(calibration(), misfit=9.0, strained=(Strain("volume_gas", -12.3),))
    text = " ".join(calibration_text(strained).split())
    assert "findings: 2" in text
    assert "still differ from the model by 3.0 times their noise" in text
    assert "it moves volume_gas by 12 of their tolerances" in text
    assert "part of it may be contained in mu_screw and b_rotor: `winchcascade diagnose` finds what it is" in text


def test_the_record_is_plain_json() -> None:
    record = msgspec.json.decode(msgspec.json.encode(calibration_record(calibration())))
    assert set(record) >= {"schema", "log", "rig", "numbers", "regression", "together"}
    assert set(record["numbers"][0]) == {
        "section", "name", "unit", "before", "u_before", "value", "low", "high", "u", "how", "new",
    }  # fmt: skip
    assert set(record["regression"]) == {"k_e", "low", "high", "r2", "samples", "eq8", "lag_s", "u_lag_s"}
    number = calibration().numbers[0]
    assert record["numbers"][0]["value"] == number.value
    assert type(number.value) is float


def test_a_number_that_the_rig_file_did_not_have_has_no_value_before() -> None:
    first, *rest = calibration().numbers
    unknown = msgspec.structs.replace(first, before=float("nan"))
    found = msgspec.structs.replace(calibration(), numbers=(unknown, *rest))
    assert calibration_record(found)["numbers"][0]["before"] is None
    row = next(line for line in calibration_text(found).splitlines() if line.startswith("k_e "))
    assert row.split()[1] == "-"
