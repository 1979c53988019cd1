"""A campaign diagnosed with a calibrated rig file: the causes are those of the file before its calibration."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from test_cli import winchcascade

from winchcascade import load_rig
from winchcascade.diagnosis.nuisances import calibrated_numbers

ESTIMATES = """based_on = "hsu2026"
name = "estimates"
[restoring]
mu_screw = { value = 0.04, unit = "1", u_percent = 10 }
[drivetrain]
b_rotor = { value = 7.5e-4, unit = "N.m.s/rad", u_percent = 10 }
[generator]
k_e = { value = 0.062, unit = "V/rpm", u_percent = 1 }
"""
"""A rig file whose numbers are known so well only that an open circuit replaces them."""

NUMBERS = {"restoring.mu_screw": 0.04, "drivetrain.b_rotor": 7.5e-4, "generator.k_e": 0.062}


def diagnosed(campaign: Path, *options: str | Path) -> dict[str, Any]:
    done = winchcascade("diagnose", campaign, *options, "--json", "-")
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def calibrated(campaign: Path, folder: Path, *rig: str | Path) -> Path:
    """The rig file that a calibration by the open circuit of a campaign writes."""
    path = folder / "calibrated.toml"
    done = winchcascade("calibrate", campaign / "open_circuit.csv", *rig, "--write", path)
    assert done.returncode == 0, done.stderr
    return path


def causes_of(found: dict[str, Any]) -> set[str]:
    return {cause["effect"] for cause in found["causes"]}


def assert_same_causes(campaign: Path, tmp_path: Path) -> None:
    estimates = tmp_path / "estimates.toml"
    estimates.write_text(ESTIMATES, encoding="utf-8")
    rig = calibrated(campaign, tmp_path, "--rig", estimates)
    corrected = [tmp_path / name for name in ("before.toml", "after.toml")]
    before = diagnosed(campaign, "--rig", estimates, "--write", corrected[0])
    after = diagnosed(campaign, "--rig", rig, "--write", corrected[1])
    assert causes_of(before)
    assert causes_of(after) == causes_of(before)
    assert before["calibrated"] == []
    assert {one["number"]: one["prior"] for one in after["calibrated"]} == NUMBERS
    assert {one["log"] for one in after["calibrated"]} == {"open_circuit.csv"}
    assert [one["value"] for one in after["calibrated"]] == pytest.approx(
        [number.value for number in calibrated_numbers(load_rig(rig)).values()], rel=1e-5
    )
    first, second = map(load_rig, corrected)
    assert calibrated_numbers(second) == {}
    assert second.effects == first.effects
    for section, _, name in (number.partition(".") for number in NUMBERS):
        numbers = [getattr(getattr(one, section), name) for one in (first, second)]
        assert numbers[1].value == pytest.approx(numbers[0].value)
        assert numbers[1].u == pytest.approx(numbers[0].u)


def test_the_causes_of_three_logs_do_not_depend_on_a_calibration(fixtures: Path, tmp_path: Path) -> None:
    runs = ""
    for name, load in (("open_circuit", "inf"), ("r27ohm", "27"), ("r9ohm", "9")):
        shutil.copy(fixtures / "campaign" / f"{name}.csv", tmp_path)
        runs += f'[[run]]\nfile = "{name}.csv"\nload_ohm = {load}\n'
    (tmp_path / "campaign.toml").write_text(f'title = "three logs"\n{runs}', encoding="utf-8")
    assert_same_causes(tmp_path, tmp_path)


@pytest.mark.slow
def test_the_causes_of_the_shipped_campaign_do_not_depend_on_a_calibration(fixtures: Path, tmp_path: Path) -> None:
    assert_same_causes(fixtures / "campaign", tmp_path)


@pytest.mark.slow
def test_with_the_built_in_rig_they_are_the_seven_effects(fixtures: Path, tmp_path: Path) -> None:
    campaign = fixtures / "campaign"
    before, after = diagnosed(campaign), diagnosed(campaign, "--rig", calibrated(campaign, tmp_path))
    assert len(causes_of(before)) == 7
    assert causes_of(after) == causes_of(before)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["gear_mesh_loss", "line_friction", "rotor_viscous", "copper_heating_and_line_drag"])
def test_the_causes_of_a_labelled_campaign_do_not_depend_on_a_calibration(
    case: str, shared: Path, tmp_path: Path
) -> None:
    assert_same_causes(shared / "labelled" / case, tmp_path)
