"""Errors of sensors that a diagnosis finds stand apart from the rig: a simulation for a design
is without them.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from calls import call
from diagnosed import write_campaign
from numpy.typing import NDArray

from winchcascade import RigError, baseline, load_rig, read_run, simulate
from winchcascade.core.rig_file import EffectNumber, StatedEffect
from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.handover.rig_text import corrected_text

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r18ohm.csv"
GAIN, SCALE, TORQUE = 0.05, 0.02, 4
ERRORS = {
    "torque_gain": StatedEffect(
        {"gain_error": EffectNumber(GAIN, "1", "diagnosis")}, ("a.csv",), of_a_sensor=True
    ),
    "encoder_scale": StatedEffect(
        {"scale_error": EffectNumber(SCALE, "1", "diagnosis")}, ("a.csv",), of_a_sensor=True
    ),
}
DRAG = {"line_drag": StatedEffect({"b": EffectNumber(0.7, "N.m.s/rad", "diagnosis")}, ("a.csv",))}
READ_WRONG = (
    "--with",
    f"torque_gain.gain_error={GAIN}",
    "--with",
    f"encoder_scale.scale_error={SCALE}",
)


@pytest.fixture
def corrected(tmp_path: Path) -> Path:
    """A rig file with an effect of the rig and two errors of its sensors, as a diagnosis writes
    it.
    """
    path = tmp_path / "corrected.toml"
    path.write_text(corrected_text(built_in(), {**ERRORS, **DRAG}, {}, "Day 2"), encoding="utf-8")
    return path


def simulated(folder: Path, rig: Path | str, *options: str) -> NDArray[np.float64]:
    """Columns that the command simulates along a shipped log, without those that no logger has."""
    out = folder / "simulated.csv"
    called = call(
        "simulate", LOG, "--rig", rig, "--load-ohm", "18", "--out", out, "--force", *options
    )
    assert called.code == 0, called.err
    return np.asarray(np.loadtxt(out, delimiter=",", skiprows=1)[:, 1:8])


def test_errors_of_sensors_stand_apart_and_are_simulated_where_they_are_wanted(
    corrected: Path, tmp_path: Path
) -> None:
    entries = tomllib.loads(corrected.read_text(encoding="utf-8"))
    assert (set(entries["effects"]), set(entries["sensors"]["errors"])) == (
        {"line_drag"},
        set(ERRORS),
    )
    assert entries["sensors"]["errors"]["torque_gain"]["gain_error"]["value"] == GAIN
    assert set(load_rig(corrected).effects) == {*ERRORS, *DRAG}
    plain = tmp_path / "plain.toml"
    plain.write_text(corrected_text(built_in(), DRAG, {}, "Day 2"), encoding="utf-8")
    physics = simulated(tmp_path, plain)
    assert np.array_equal(simulated(tmp_path, corrected), physics)
    assert np.array_equal(simulated(tmp_path, plain, "--sensors"), physics)
    read = simulated(tmp_path, corrected, "--sensors")
    assert read == pytest.approx(simulated(tmp_path, plain, *READ_WRONG), rel=1e-6, abs=1e-6)
    assert np.abs(read[:, TORQUE]).max() > 1.03 * np.abs(physics[:, TORQUE]).max()


def test_the_library_simulates_the_physics_and_gives_a_model_of_what_is_logged(
    corrected: Path,
) -> None:
    rig = load_rig(corrected)
    run, model = read_run(LOG, rig=rig, load=18.0), baseline(rig)
    torque = simulate(run).run.channels["torque"]
    assert np.array_equal(torque, simulate(run, model.physics).run.channels["torque"])
    assert np.abs(simulate(run, model).run.channels["torque"]).max() > 1.03 * np.abs(torque).max()
    assert model.sensors.gain["torque"] == pytest.approx(GAIN)


def test_errors_of_sensors_among_the_effects_are_left_out(tmp_path: Path) -> None:
    earlier = tmp_path / "earlier.toml"
    stated = f'[effects.torque_gain]\ngain_error = {{ value = {GAIN}, unit = "1" }}\n'
    earlier.write_text(f'based_on = "hsu2026"\nname = "earlier"\n\n{stated}', encoding="utf-8")
    assert np.array_equal(simulated(tmp_path, earlier), simulated(tmp_path, "hsu2026"))


@pytest.mark.parametrize("name", ["line_drag", "nothing"])
def test_an_error_of_no_sensor_is_rejected_with_its_place(tmp_path: Path, name: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(
        f'based_on = "hsu2026"\nname = "wrong"\n[sensors.errors.{name}]\nb = 0.7\n',
        encoding="utf-8",
    )
    with pytest.raises(RigError, match=f"sensors.errors.{name}"):
        load_rig(path)
    assert (
        call("simulate", LOG, "--rig", path, "--load-ohm", "18", "--out", tmp_path / "out.csv").code
        == 2
    )


@pytest.mark.slow
def test_a_diagnosed_gain_is_written_apart_and_leaves_no_gap(tmp_path: Path) -> None:
    rig, record, campaign = (
        tmp_path / "corrected.toml",
        tmp_path / "again.json",
        tmp_path / "campaign",
    )
    campaign.mkdir()
    write_campaign(campaign, {"torque_gain": {"gain_error": GAIN}})
    assert call("diagnose", campaign, "--write", rig, patience=300).code == 0
    entries = tomllib.loads(rig.read_text(encoding="utf-8"))
    assert "effects" not in entries
    assert set(entries["sensors"]["errors"]) == {"torque_gain"}
    assert call("diagnose", campaign, "--rig", rig, "--json", record, patience=300).code == 0
    assert json.loads(record.read_text(encoding="utf-8"))["verdict"] == "no_gap"
    assert np.array_equal(simulated(tmp_path, rig), simulated(tmp_path, "hsu2026"))
