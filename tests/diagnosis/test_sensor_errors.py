"""Errors of sensors that a diagnosis finds stand apart from the rig: a simulation for a design is without them."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from calls import call
from numpy.typing import NDArray

from winchcascade import RigError, baseline, load_rig, read_run, simulate
from winchcascade.core.rig_file import EffectNumber, StatedEffect
from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.rig_text import corrected_text

LOG = Path(__file__).parents[2] / "fixtures" / "campaign" / "r18ohm.csv"
GAIN = 0.05
ERRORS = {
    "torque_gain": StatedEffect({"gain_error": EffectNumber(GAIN, "1", "diagnosis")}, ("a.csv",)),
    "encoder_scale": StatedEffect({"scale_error": EffectNumber(0.02, "1", "diagnosis")}, ("a.csv",)),
}
DRAG = {"line_drag": StatedEffect({"b": EffectNumber(0.7, "N.m.s/rad", "diagnosis")}, ("a.csv",))}
COLUMNS = ("displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")


@pytest.fixture
def corrected(tmp_path: Path) -> Path:
    """A rig file with an effect of the rig and two errors of its sensors, as a diagnosis writes it."""
    path = tmp_path / "corrected.toml"
    path.write_text(corrected_text(built_in(), {**ERRORS, **DRAG}, {}, "Day 2"), encoding="utf-8")
    return path


def simulated(folder: Path, rig: Path | str, *options: str) -> dict[str, NDArray[np.float64]]:
    """Columns of the log that the command simulates along a shipped log."""
    out = folder / "simulated.csv"
    called = call("simulate", LOG, "--rig", rig, "--load-ohm", "18", "--out", out, "--force", *options)
    assert called.code == 0, called.err
    table = np.loadtxt(out, delimiter=",", skiprows=1)
    return dict(zip(COLUMNS, table.T[1 : 1 + len(COLUMNS)], strict=True))


def test_errors_of_sensors_stand_under_sensors_and_the_rig_under_effects(corrected: Path) -> None:
    entries = tomllib.loads(corrected.read_text(encoding="utf-8"))
    assert set(entries["effects"]) == {"line_drag"}
    assert set(entries["sensors"]["errors"]) == set(ERRORS)
    assert entries["sensors"]["errors"]["torque_gain"]["gain_error"]["value"] == GAIN
    rig = load_rig(corrected)
    assert set(rig.effects) == {*ERRORS, *DRAG}
    assert set(rig.sensors) == set(built_in().sensors)


def test_a_simulation_is_without_the_errors_of_the_sensors_unless_they_are_wanted(
    corrected: Path, tmp_path: Path
) -> None:
    plain = tmp_path / "plain.toml"
    plain.write_text(corrected_text(built_in(), DRAG, {}, "Day 2"), encoding="utf-8")
    physics, of_rig = simulated(tmp_path, corrected), simulated(tmp_path, plain)
    for name in COLUMNS:
        assert np.array_equal(physics[name], of_rig[name]), name
    read = simulated(tmp_path, corrected, "--sensors")
    scaled = simulated(
        tmp_path, plain, "--with", f"torque_gain.gain_error={GAIN}", "--with", "encoder_scale.scale_error=0.02"
    )
    for name in COLUMNS:
        assert read[name] == pytest.approx(scaled[name], rel=1e-6, abs=1e-6), name
    assert np.abs(read["torque"]).max() > 1.03 * np.abs(physics["torque"]).max()


def test_a_rig_without_errors_of_sensors_is_simulated_alike_with_and_without_them(tmp_path: Path) -> None:
    one, other = simulated(tmp_path, "hsu2026"), simulated(tmp_path, "hsu2026", "--sensors")
    for name in COLUMNS:
        assert np.array_equal(one[name], other[name]), name


def test_the_library_simulates_the_physics_and_gives_a_model_of_what_is_logged(corrected: Path) -> None:
    rig = load_rig(corrected)
    run = read_run(LOG, rig=rig, load=18.0)
    model = baseline(rig)
    torque = simulate(run).run.channels["torque"]
    assert np.array_equal(torque, simulate(run, model.physics).run.channels["torque"])
    assert np.abs(simulate(run, model).run.channels["torque"]).max() > 1.03 * np.abs(torque).max()
    assert model.sensors.gain["torque"] == pytest.approx(GAIN)
    assert model.physics.winch == model.winch


def test_errors_of_sensors_among_the_effects_of_an_earlier_file_are_left_out_and_moved(tmp_path: Path) -> None:
    earlier = tmp_path / "earlier.toml"
    earlier.write_text(
        f'based_on = "hsu2026"\nname = "earlier"\n\n[effects.torque_gain]\ngain_error = {{ value = {GAIN}, unit = "1" }}\n',
        encoding="utf-8",
    )
    assert np.array_equal(simulated(tmp_path, earlier)["torque"], simulated(tmp_path, "hsu2026")["torque"])
    again = tomllib.loads(corrected_text(load_rig(earlier), DRAG, {}, "Day 3"))
    assert set(again["effects"]) == {"line_drag"}
    assert again["sensors"]["errors"]["torque_gain"]["gain_error"]["value"] == GAIN


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[sensors.errors.line_drag]\nb = 0.7\n", "sensors.errors.line_drag"),
        ("[sensors.errors.nothing]\nx = 0.7\n", "sensors.errors.nothing"),
        ("[sensors]\nerrors = 3\n", "errors"),
    ],
)
def test_an_error_of_no_sensor_is_rejected_with_its_place(tmp_path: Path, text: str, named: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(f'based_on = "hsu2026"\nname = "wrong"\n{text}', encoding="utf-8")
    with pytest.raises(RigError, match=named):
        load_rig(path)
    assert call("simulate", LOG, "--rig", path, "--load-ohm", "18", "--out", tmp_path / "out.csv").code == 2


def test_a_diagnosed_gain_is_written_apart_and_leaves_no_gap(shared: Path, tmp_path: Path) -> None:
    rig, record = tmp_path / "corrected.toml", tmp_path / "again.json"
    campaign = shared / "labelled" / "torque_gain"
    assert call("diagnose", campaign, "--write", rig, patience=300).code == 0
    entries = tomllib.loads(rig.read_text(encoding="utf-8"))
    assert "effects" not in entries
    assert set(entries["sensors"]["errors"]) == {"torque_gain"}
    assert call("diagnose", campaign, "--rig", rig, "--json", record, patience=300).code == 0
    assert json.loads(record.read_text(encoding="utf-8"))["verdict"] == "no_gap"
    physics = simulated(tmp_path, rig)["torque"]
    assert np.array_equal(physics, simulated(tmp_path, "hsu2026")["torque"])
