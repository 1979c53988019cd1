"""Stage by stage: what is wrong shows in its own stage and nowhere else, a sensor in all that it touches, nothing in none."""

import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from daily import daily
from openlog import made_log, motion_run

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnosis_result import Place
from winchcascade.diagnosis.gap_map import STANDS_OUT, arises, deviating_stage
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.stagewise import stagewise
from winchcascade.ingest.read import read_run
from winchcascade.report.results.diagnosis_sentences import arises_sentence
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.parts import Model
from winchcascade.rig.stages import STAGES

LOADS = (math.inf, 27.0, 4.5)
ZERO = {"pressure": 2942.0, "force": 2.0, "torque": 0.3, "idc": 0.005}
"""Standard uncertainties of the zeros, as the built-in rig file has them. SI units."""

PLANTED: dict[str, tuple[dict[str, float], set[str]]] = {
    "gear_mesh_loss": ({"efficiency_change": -0.03}, {"gearbox"}),
    "rotor_friction": ({"torque": 0.15}, {"gearbox"}),
    "clutch_drag": ({"torque": 3.0}, {"gearbox"}),
    "ke_rolloff": ({"lost_to_7_a": 0.03, "lost_to_9_a": 0.05}, {"generator"}),
    "ke_shift": ({"k_e_change": -0.02}, {"generator"}),
    "copper_heating": ({"r_s_change": 0.4}, {"gearbox", "generator"}),
    "load_drift": ({"r_load_change": 0.02}, {"load"}),
    "line_friction": ({"torque": 5.0}, {"transmission"}),
    "drum_layering": ({"radius_change_per_10_m": 0.05}, {"transmission"}),
    "gas_volume": ({"volume_extra": 4e-4}, {"restoring"}),
    "precharge": ({"pressure_change": 0.02}, {"restoring"}),
    "torque_gain": ({"gain_error": 0.03}, {"transmission", "gearbox"}),
}
"""Effects, and the stages that are off by themselves."""


def campaign(models: dict[float, Model], seed: int) -> list[Run]:
    """A log of each load, with noise and zeros."""
    rng = np.random.default_rng(seed)
    logs = []
    for load, model in models.items():
        run = made_log(model, seed=int(rng.integers(1 << 30)), load=load, cycles=2)
        zeros = {name: rng.normal(0.0, sd) for name, sd in ZERO.items()}
        channels = {name: x + zeros.get(name, 0.0) for name, x in run.channels.items()}
        logs.append(msgspec.structs.replace(run, channels=channels))
    return logs


@cache
def planted(name: str = "") -> tuple[Place, ...]:
    model = baseline(built_in())
    model = make_effect(name, PLANTED[name][0]).apply(model) if name else model
    return stagewise(Fitted(campaign(dict.fromkeys(LOADS, model), 0), built_in()))


@pytest.mark.parametrize("name", daily(PLANTED, ("clutch_drag", "ke_shift", "copper_heating", "gas_volume")))
def test_what_is_wrong_in_a_stage_shows_in_that_stage_alone(name: str) -> None:
    found = arises(planted(name))
    assert {place.stage for place in found} == PLANTED[name][1]
    assert all(place.stage in arises_sentence(found) for place in found)


def test_load_and_bridge_are_one_module_of_the_catalogue() -> None:
    assert deviating_stage(arises(planted("load_drift"))) == "generator"
    assert deviating_stage(arises(planted())) is None


@pytest.mark.parametrize("seed", daily((11, 12, 13, 14), (11,)))
def test_a_rig_within_its_tolerances_has_no_stage_off(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bare = Fitted([made_log(load=load, cycles=1) for load in LOADS], built_in())
    models = bare.models(rng.standard_normal(len(bare.nuisances)), [])
    places = stagewise(Fitted(campaign(dict(zip(LOADS, models, strict=True)), seed), built_in()))
    z = np.array([place.z for place in places])
    assert np.all(np.abs(z) < STANDS_OUT)
    assert np.sqrt(np.mean(z**2)) < 1.7  # one number of the rig moves many places alike


def test_a_log_without_noise_has_no_stage_off() -> None:
    places = stagewise(Fitted([made_log(load=load, cycles=2) for load in LOADS], built_in()))
    assert max(abs(place.z) for place in places) < 1.0
    assert all(place.noise > 0.0 for place in places)


def test_every_place_states_its_yardsticks() -> None:
    places = planted()
    assert {place.stage for place in places} == set(STAGES)
    assert {place.load for place in places if place.stage == "load"} == {27.0, 4.5}
    for place in places:
        assert place.z == pytest.approx(place.bias / math.hypot(place.u_noise, place.u_repeat, place.u_tolerance))
        assert place.rms >= abs(place.bias) * (1.0 - 1e-9)
        assert place.channel not in place.inputs or place.channel == "vdc"


@pytest.mark.parametrize(
    ("missing", "left"),
    [
        (("torque",), {"restoring", "generator", "load"}),
        (("pressure",), {"gearbox", "generator", "load"}),
        (("vdc", "idc"), {"restoring", "transmission"}),
    ],
)
def test_a_stage_that_the_log_cannot_compare_is_left_out(missing: tuple[str, ...], left: set[str]) -> None:
    run = made_log(seed=2, load=18.0, cycles=2)
    bare = msgspec.structs.replace(run, channels={k: x for k, x in run.channels.items() if k not in missing})
    assert {place.stage for place in stagewise(Fitted([bare], built_in()))} == left
    assert stagewise(Fitted([motion_run(load=18.0, cycles=1)], built_in())) == ()


def test_what_another_log_reads_wrong_moves_no_place_of_this_one() -> None:
    runs = campaign(dict.fromkeys(LOADS, baseline(built_in())), 4)
    alone = stagewise(Fitted(runs[:1], built_in()))
    beside = [place for place in stagewise(Fitted(runs, built_in())) if place.log == 0]
    assert [(place.u_noise, place.bias) for place in beside] == [
        pytest.approx((place.u_noise, place.bias)) for place in alone
    ]


LABELLED = {
    "none": (),
    "ke_rolloff": ("generator",),
    "gear_mesh_loss": ("gearbox",),
    "line_friction": ("transmission",),
}


@pytest.mark.parametrize("case", daily(LABELLED, ("none",)))
def test_a_labelled_campaign_is_off_where_its_effect_is(shared: Path, case: str) -> None:
    entries = load_campaign(shared / "labelled" / case / "campaign.toml").runs
    data = Fitted([read_run(entry.file, load=entry.load) for entry in entries], built_in())
    assert tuple(place.stage for place in arises(stagewise(data))) == LABELLED[case]
