"""A campaign diagnosed with a calibrated rig file: the causes are those of the file before its
calibration.
"""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from test_cli import winchcascade

from winchcascade import load_rig
from winchcascade.core.rig_file import Rig
from winchcascade.diagnosis.fit.nuisances import calibrated_numbers

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


def numbers_of(rig: Rig) -> dict[str, float]:
    """Numbers of the effects that a rig file states, by effect and field."""
    return {
        f"{name}.{key}": one.value
        for name, effect in rig.effects.items()
        for key, one in effect.fields.items()
    }


def assert_same_causes(campaign: Path, tmp_path: Path) -> None:
    estimates = tmp_path / "estimates.toml"
    estimates.write_text(ESTIMATES, encoding="utf-8")
    rig = tmp_path / "calibrated.toml"
    done = winchcascade(
        "calibrate", campaign / "open_circuit.csv", "--rig", estimates, "--write", rig
    )
    assert done.returncode == 0, done.stderr
    corrected = [tmp_path / name for name in ("before.toml", "after.toml")]
    before = diagnosed(campaign, "--rig", estimates, "--write", corrected[0])
    after = diagnosed(campaign, "--rig", rig, "--write", corrected[1])
    causes, same = ({cause["effect"] for cause in found["causes"]} for found in (before, after))
    assert causes
    assert same == causes
    assert before["calibrated"] == []
    assert {one["number"]: one["prior"] for one in after["calibrated"]} == NUMBERS
    assert {one["log"] for one in after["calibrated"]} == {"open_circuit.csv"}
    assert [one["value"] for one in after["calibrated"]] == pytest.approx(
        [number.value for number in calibrated_numbers(load_rig(rig)).values()], rel=1e-5
    )
    first, second = map(load_rig, corrected)
    assert calibrated_numbers(second) == {}
    assert numbers_of(second) == {
        path: pytest.approx(number, rel=1e-3) for path, number in numbers_of(first).items()
    }
    for section, _, name in (number.partition(".") for number in NUMBERS):
        numbers = [getattr(getattr(one, section), name) for one in (first, second)]
        assert numbers[1].value == pytest.approx(numbers[0].value)
        assert numbers[1].u == pytest.approx(numbers[0].u)


@pytest.mark.slow
def test_the_causes_of_three_logs_do_not_depend_on_a_calibration(
    fixtures: Path, tmp_path: Path
) -> None:
    runs = ""
    for name, load in (("open_circuit", "inf"), ("r27ohm", "27"), ("r9ohm", "9")):
        shutil.copy(fixtures / "campaign" / f"{name}.csv", tmp_path)
        runs += f'[[run]]\nfile = "{name}.csv"\nload_ohm = {load}\n'
    (tmp_path / "campaign.toml").write_text(f'title = "three logs"\n{runs}', encoding="utf-8")
    assert_same_causes(tmp_path, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["", "line_friction", "rotor_viscous"])
def test_the_causes_of_a_campaign_do_not_depend_on_a_calibration(
    case: str, fixtures: Path, shared: Path, tmp_path: Path
) -> None:
    """The packaged campaign with causes of every stage, and each cause that resembles a number
    of the calibration alone.
    """
    assert_same_causes(shared / "labelled" / case if case else fixtures / "campaign", tmp_path)
