"""Diagnosis, calibration and files of rigs without gas, and of a machine on the shaft of the
drum, from simulated campaigns.
"""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path

import pytest
from calls import call
from daily import daily
from own_rigs import RESTORING, SHAFT, Effects, own_campaign, own_rig, own_text
from rigs import suspects_on

from winchcascade.core.errors import RigError
from winchcascade.core.rig_toml import parse_rig
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.handover.calibrate import calibrate
from winchcascade.rig.baseline import load_rig, stated_effects
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.simulate import write_simulated

OF_THE_GAS = {
    *(name for name, effect in EFFECTS.items() if effect.stage == "restoring"), "pressure_gain", "screw_lead",
}  # fmt: skip


patient = partial(call, patience=600)
"""Diagnoses take seconds, on a busy machine more."""


def found(kind: str, shaft: str, effects: Effects) -> ModelDiagnosis:
    return diagnose(own_campaign(kind, shaft, effects), own_rig(kind, shaft), EFFECTS)


HIDDEN = (
    ("gas_screw", "direct", "line_friction.torque", 6.0),
    ("spring", "geared", "spring_stiffness.stiffness_change", 0.2),
    ("spring", "direct", "line_drag.b", 3.0),
    ("counterweight", "geared", "gear_mesh_loss.efficiency_change", -0.04),
    ("counterweight", "direct", "rotor_friction.torque", 6.0),
    ("none", "geared", "line_friction.torque", 6.0),
    ("none", "direct", "ke_shift.k_e_change", -0.03),
)
"""Restoring module, shaft, and the effect that is hidden with its number."""


@pytest.mark.parametrize(
    ("kind", "shaft", "effect", "value"), daily(HIDDEN, HIDDEN[1:2], spread=True)
)
def test_a_hidden_effect_is_named_alone_with_its_size(
    kind: str, shaft: str, effect: str, value: float
) -> None:
    name, _, field = effect.partition(".")
    result = found(kind, shaft, {name: {field: value}})
    assert result.verdict == "explained"
    (cause,) = result.causes
    assert cause.effect == name
    reported = next(iter(cause.parameters.values()))
    expected = 40.0 * (1.0 + value) if name == "spring_stiffness" else value
    assert reported.value == pytest.approx(expected, rel=0.08)
    assert reported.low < expected < reported.high


PARTS = (("spring", "direct"), ("counterweight", "geared"), ("none", "direct"))
"""Restoring module and shaft of a rig."""


@pytest.mark.parametrize(("kind", "shaft"), daily(PARTS, PARTS[1:2], spread=True))
def test_a_campaign_without_an_effect_has_no_gap_and_misses_no_pressure(
    kind: str, shaft: str
) -> None:
    result = found(kind, shaft, {})
    assert result.verdict == "no_gap"
    assert result.missing_channels == []


@pytest.mark.parametrize("shaft", SHAFT)
@pytest.mark.parametrize("kind", RESTORING)
def test_suspects_are_effects_of_parts_that_the_rig_has(kind: str, shaft: str) -> None:
    rig = own_rig(kind, shaft)
    names = {effect.name for effect in suspects_on(rig, own_campaign(kind, shaft, {})).values()}
    assert (names & OF_THE_GAS == set()) == (kind != "gas_screw")
    assert ({"gear_mesh_loss", "gear_ratio"} <= names) == (shaft == "geared")
    assert ("counterweight" in names) == (kind == "counterweight")
    assert ({"spring_force", "spring_stiffness"} <= names) == (kind == "spring")
    assert {"line_friction", "rotor_friction", "ke_shift", "drum_radius"} <= names


@pytest.mark.parametrize(
    ("kind", "shaft"), [("spring", "direct"), ("counterweight", "geared"), ("gas_screw", "direct")]
)
def test_a_calibration_finds_back_emf_and_damper_and_a_screw_only_where_there_is_one(
    kind: str, shaft: str
) -> None:
    (run,) = (run for run in own_campaign(kind, shaft, {}, cycles=2) if math.isinf(run.load or 0.0))
    rig = own_rig(kind, shaft)
    calibration = calibrate(run, rig)
    new = {n.name: n for n in calibration.numbers if n.new}
    assert set(new) == {"k_e", "b_rotor", *(["mu_screw"] if kind == "gas_screw" else [])}
    for name, stated in (("k_e", rig.generator.k_e), ("b_rotor", rig.drivetrain.b_rotor)):
        assert stated is not None
        assert abs(new[name].value - stated.value) < 4.0 * new[name].u
        assert new[name].u < 0.15 * stated.value


@pytest.mark.slow
def test_a_corrected_file_states_the_mass_that_the_logs_fit_and_the_commands_take_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "rig.toml").write_text(own_text("counterweight", "direct"), encoding="utf-8")
    entries = ['title = "own"', 'rig = "rig.toml"']
    for run in own_campaign(
        "counterweight", "direct", {"counterweight": {"mass_change": 0.25}}, cycles=2
    ):
        write_simulated(run, tmp_path / run.name)
        entries += ["[[run]]", f'file = "{run.name}"', f"load_ohm = {run.load}"]
    (tmp_path / "campaign.toml").write_text("\n".join(entries) + "\n", encoding="utf-8")
    corrected, exported = tmp_path / "corrected.toml", tmp_path / "model.json"
    done = patient("diagnose", tmp_path, "--write", corrected, "--export", exported)
    assert done.code == 0, done.err
    mass = load_rig(corrected).restoring.mass
    assert mass is not None
    assert mass.unit == "kg"
    assert mass.value == pytest.approx(1.25 * 40.0 * 9.80665, rel=0.01)
    restoring = json.loads(exported.read_text())["restoring"]
    assert restoring["mass"]["value"] == pytest.approx(50.0, rel=0.01)
    assert set(restoring) == {"mass", "friction"}
    again = patient("diagnose", tmp_path, "--rig", corrected, "--json", "-")
    assert json.loads(again.out)["verdict"] == "no_gap"
    reduced = patient("reduce", tmp_path / "r12ohm.csv", "--json", "-")
    assert reduced.code == 0
    assert [one["kind"] for one in json.loads(reduced.out)["quality"]] == []


def test_an_effect_of_a_part_that_the_rig_has_not_is_rejected_not_ignored(
    fixtures: Path, tmp_path: Path
) -> None:
    rig, log = tmp_path / "rig.toml", fixtures / "campaign" / "r9ohm.csv"
    rig.write_text(own_text("none", "direct"), encoding="utf-8")
    for effect in ("gas_volume.volume_extra=0.001", "gear_mesh_loss.efficiency_change=-0.02"):
        done = call(
            "simulate",
            log,
            "--load-ohm",
            "9",
            "--rig",
            rig,
            "--with",
            effect,
            "--out",
            tmp_path / "out.csv",
        )
        assert done.code == 2
        assert effect.partition(".")[0] in done.err
    stated = own_text("spring") + "[effects.seal_friction]\nforce = 100\n"
    with pytest.raises(RigError, match=r"\[effects.seal_friction\].*no gas"):
        stated_effects(parse_rig(stated, "mine.toml"))


# --------------------------------------------------------------------------- based on another rig
BASED = 'based_on = "hsu2026"\nname = "my rig"\n[winch]\nr_drum = { value = 150, unit = "mm" }\n'


@pytest.mark.slow
def test_a_rig_file_that_states_a_drum_radius_alone_serves_every_command(
    fixtures: Path, tmp_path: Path
) -> None:
    rig, entries = tmp_path / "rig.toml", ['title = "mine"', 'rig = "rig.toml"']
    rig.write_text(BASED, encoding="utf-8")
    for name, load in (("open_circuit", "inf"), ("r36ohm", "36"), ("r9ohm", "9")):
        log, motion = tmp_path / f"{name}.csv", fixtures / "campaign" / f"{name}.csv"
        hidden = ("--with", "line_friction.torque=5")
        made = patient("simulate", motion, "--load-ohm", load, "--rig", rig, *hidden, "--out", log)
        assert made.code == 0, made.err
        entries += ["[[run]]", f'file = "{log.name}"', f"load_ohm = {load}"]
    (tmp_path / "campaign.toml").write_text("\n".join(entries) + "\n", encoding="utf-8")
    assert patient("batch", tmp_path, "--out", tmp_path / "results").code == 0
    corrected, calibrated = tmp_path / "corrected.toml", tmp_path / "calibrated.toml"
    found = json.loads(patient("diagnose", tmp_path, "--json", "-", "--write", corrected).out)
    assert [cause["effect"] for cause in found["causes"]] == ["line_friction"]
    done = patient("calibrate", tmp_path / "open_circuit.csv", "--write", calibrated)
    assert done.code == 0, done.err
    for written in (corrected, calibrated):
        assert 'based_on = "hsu2026"' in written.read_text()
        assert load_rig(written).r_drum == 0.15
        assert load_rig(written).drivetrain.gear_ratio == load_rig("hsu2026").drivetrain.gear_ratio
    reduced = json.loads(
        patient("reduce", tmp_path / "r36ohm.csv", "--rig", calibrated, "--json", "-").out
    )
    assert reduced["rig"]["name"] == "my rig"


def test_a_rig_file_without_the_rig_below_names_what_it_lacks_and_based_on(
    fixtures: Path, tmp_path: Path
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(BASED.partition("\n")[2], encoding="utf-8")
    done = patient("diagnose", fixtures / "campaign", "--rig", rig)
    assert done.code == 2
    assert all(
        word in done.err for word in ("based_on", "gear_ratio", "p_precharge", "counterweight")
    )
