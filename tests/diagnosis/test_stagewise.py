"""Stage by stage: what is wrong shows in its own stage and nowhere else, a sensor in all that it touches, nothing in none."""

import math
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import numpy as np
import pytest
from daily import daily
from openlog import made_log, motion_run
from rigs import stage_outputs

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnosis_result import Arises, StagePlace
from winchcascade.diagnosis.gap_map import STANDS_OUT, arises
from winchcascade.diagnosis.misfit import NOISELESS, Fitted
from winchcascade.diagnosis.nuisances import SECTIONS
from winchcascade.diagnosis.stagewise import TOUCHED, _noise, stagewise
from winchcascade.ingest.read import read_run
from winchcascade.report.results.diagnosis_sentences import arises_sentence
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.parts import Model
from winchcascade.rig.stages import STAGES

LOADS = (math.inf, 27.0, 4.5)
ZERO = {"pressure": 2942.0, "force": 2.0, "torque": 0.3, "idc": 0.005}
"""Standard uncertainties of the zeros, as the built-in rig file has them. SI units."""

PLANTED: dict[str, tuple[dict[str, float], str]] = {
    "gear_mesh_loss": ({"efficiency_change": -0.03}, "gearbox"),
    "rotor_friction": ({"torque": 0.15}, "gearbox"),
    "clutch_drag": ({"torque": 3.0}, "gearbox"),
    "ke_rolloff": ({"lost_to_7_a": 0.03, "lost_to_9_a": 0.05}, "generator"),
    "ke_shift": ({"k_e_change": -0.02}, "generator"),
    "load_drift": ({"r_load_change": 0.02}, "load"),
    "line_friction": ({"torque": 5.0}, "transmission"),
    "drum_layering": ({"radius_change_per_10_m": 0.05}, "transmission"),
    "gas_volume": ({"volume_extra": 4e-4}, "restoring"),
    "precharge": ({"pressure_change": 0.02}, "restoring"),
}
"""Effects, and the one stage that is off by itself."""


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
def planted(name: str, seed: int = 0) -> tuple[StagePlace, ...]:
    model = baseline(built_in())
    values = {"torque_gain": {"gain_error": 0.03}, "": {}}.get(name) or PLANTED.get(name, ({}, ""))[0]
    if name:
        model = make_effect(name, values).apply(model)
    return stagewise(Fitted(campaign(dict.fromkeys(LOADS, model), seed), built_in()))


@pytest.mark.parametrize("name", daily(PLANTED, ("clutch_drag", "ke_shift", "line_friction", "gas_volume")))
def test_what_is_wrong_in_a_stage_shows_in_that_stage_alone(name: str) -> None:
    found = arises(planted(name))
    assert found.off == (PLANTED[name][1],)
    assert found.sensor is None
    assert f"With logged inputs to each stage, only the {found.off[0]} stage deviates: " in arises_sentence(found)


def test_hot_copper_shows_in_both_stages_that_the_machine_is_part_of() -> None:
    model = make_effect("copper_heating", {"r_s_change": 0.4}).apply(baseline(built_in()))
    found = arises(stagewise(Fitted(campaign(dict.fromkeys(LOADS, model), 1), built_in())))
    assert set(found.off) == {"gearbox", "generator"}
    assert found.sensor is None


def test_a_torque_sensor_that_reads_high_shows_in_both_stages_that_end_with_it_and_is_reported() -> None:
    places = planted("torque_gain")
    found = arises(places)
    assert set(found.off) == {"transmission", "gearbox"}
    assert (found.stage, found.sensor) == ("sensor", "torque")
    assert found.gain == pytest.approx(0.03, abs=0.006)
    assert "a gain error of about +3 % in the torque sensor alone" in arises_sentence(found)
    assert all(place.bias > 0.0 for place in places if abs(place.z) > STANDS_OUT)


@pytest.mark.parametrize("seed", daily((11, 12, 13, 14), (11,)))
def test_a_rig_within_its_tolerances_has_no_stage_off(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bare = Fitted([made_log(load=load, cycles=1) for load in LOADS], built_in())
    models = bare.models(rng.standard_normal(len(bare.nuisances)), [])
    places = stagewise(Fitted(campaign(dict(zip(LOADS, models, strict=True)), seed), built_in()))
    z = np.array([place.z for place in places])
    assert np.all(np.abs(z) < STANDS_OUT)
    assert np.sqrt(np.mean(z**2)) < 1.7  # one number of the rig moves many places alike
    assert arises(places).stage is None


def test_a_log_without_noise_has_no_stage_off() -> None:
    places = stagewise(Fitted([made_log(load=load, cycles=2) for load in LOADS], built_in()))
    assert max(abs(place.z) for place in places) < 1.0
    assert all(place.noise > 0.0 for place in places)


def test_every_place_states_its_yardsticks() -> None:
    places = planted("")
    assert {place.stage for place in places} == set(STAGES)
    assert {place.load for place in places if place.stage == "load"} == {27.0, 4.5}
    for place in places:
        u = math.hypot(place.u_noise, place.u_repeat, place.u_tolerance)
        assert place.z == pytest.approx(place.bias / u)
        assert place.rms >= abs(place.bias) * (1.0 - 1e-9)
        assert place.blocks >= 2
        assert place.channel not in place.inputs or place.channel == "vdc"


def test_with_one_cycle_nothing_is_known_of_how_cycles_repeat() -> None:
    model = baseline(built_in())
    run = made_log(model, seed=5, load=18.0, cycles=1)
    assert all(math.isnan(place.u_repeat) for place in stagewise(Fitted([run], built_in())) if place.phase == "payout")


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


# ------------------------------------------------------------------------------------------------------- what it rests on
@pytest.mark.parametrize("section", SECTIONS)
def test_numbers_of_a_section_move_no_stage_but_those_that_are_said_to_be_touched(section: str) -> None:
    run, model = made_log(load=18.0, cycles=1), baseline(built_in())
    before = {o.stage: o.predicted for o in stage_outputs(run, model)}
    part = getattr(model, section)
    for name in part.__struct_fields__:
        value = getattr(part, name)
        if not isinstance(value, float) or name in ("k_shaft", "c_shaft"):  # springs set when the clutch lets go
            continue
        moved = msgspec.structs.replace(
            model, **{section: msgspec.structs.replace(part, **{name: value * 1.001 or 1e-3})}
        )
        for output in stage_outputs(run, moved):
            if output.stage not in TOUCHED[section]:
                both = np.isfinite(output.predicted) & np.isfinite(before[output.stage])
                assert np.array_equal(output.predicted[both], before[output.stage][both]), (name, output.stage)


# ------------------------------------------------------------------------------------------------------------- in words
def test_no_stage_off_is_reported_as_such() -> None:
    assert arises_sentence(Arises((), None)) == (
        "With logged inputs to each stage, no stage deviates by more than 4 standard uncertainties."
    )


def test_several_stages_are_reported_the_worst_first() -> None:
    places = list(planted("precharge")) + list(planted("gear_mesh_loss"))
    found = arises(places)
    assert found.off == tuple(sorted(found.off, key=lambda s: -max(abs(p.z) for p in places if p.stage == s)))
    assert f"the {found.off[0]} and {found.off[1]} stages deviate, the {found.off[0]} most: " in arises_sentence(found)


def test_load_and_bridge_are_one_module_of_the_catalogue() -> None:
    found = arises(planted("load_drift"))
    assert found.stage == "generator"
    assert "only the load stage deviates: Idc is over-predicted during payout, most clearly at " in arises_sentence(
        found
    )


# --------------------------------------------------------------------------------------------------- an independent rig
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
    assert arises(stagewise(data)).off == LABELLED[case]


def test_a_motion_alone_says_nothing_of_any_stage() -> None:
    assert stagewise(Fitted([motion_run(load=18.0, cycles=1)], built_in())) == ()


# ------------------------------------------------------------------------------------------------------ the noise of a stage
def noise_of(residual: np.ndarray, *, simulated: bool = False, joined: np.ndarray | None = None) -> np.ndarray:
    """Noise of blocks of eleven samples of a channel that is still, where a stage predicts 200 at most."""
    n = residual.size
    blocks = SimpleNamespace(count=np.full(n, 11), joined=np.ones(n, dtype=bool) if joined is None else joined)
    run = SimpleNamespace(channels={"vdc": np.zeros(11 * n)}, simulated=simulated)
    log = SimpleNamespace(run=run, course=SimpleNamespace(blocks=blocks))
    output = SimpleNamespace(channel="vdc", predicted=np.linspace(-200.0, 100.0, 11 * n))
    return _noise(cast("Any", log), cast("Any", output), np.ones(n, dtype=bool), residual)


@pytest.mark.parametrize("sd", [0.02, 3.0])
def test_a_stages_noise_is_what_scatters_from_block_to_block(sd: float) -> None:
    k = np.arange(4000.0)
    residual = np.random.default_rng(3).normal(0.0, sd, k.size) + 0.3 * k
    assert noise_of(residual) == pytest.approx(np.full(k.size, sd), rel=0.05)


def test_a_stage_in_a_simulated_log_is_known_to_a_share_of_its_largest() -> None:
    assert noise_of(np.zeros(9), simulated=True) == pytest.approx(np.full(9, NOISELESS * 200.0))
    assert noise_of(np.zeros(9)) == pytest.approx(np.zeros(9))


def test_blocks_that_are_not_joined_do_not_scatter() -> None:
    residual, joined = np.repeat((0.0, 50.0), 20), np.ones(40, dtype=bool)
    joined[20] = False
    rough = noise_of(np.tile((0.0, 50.0), 20))
    assert noise_of(residual, joined=joined) == pytest.approx(np.zeros(40))
    assert rough[0] > 20.0


def test_what_another_log_reads_wrong_moves_no_place_of_this_one() -> None:
    runs = campaign(dict.fromkeys(LOADS, baseline(built_in())), 4)
    alone = stagewise(Fitted(runs[:1], built_in()))
    beside = [place for place in stagewise(Fitted(runs, built_in())) if place.log == 0]
    assert [place.u_noise for place in beside] == pytest.approx([place.u_noise for place in alone])
    assert [place.bias for place in beside] == pytest.approx([place.bias for place in alone])
