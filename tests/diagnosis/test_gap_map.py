"""The map of a gap end to end and stage by stage: its yardsticks, where a gap lies, and what
each stage shows.
"""

import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from daily import daily
from openlog import made_log, motion_run
from rigs import calibrated_rig

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnosis_result import Place
from winchcascade.diagnosis.explain.gap_map import (
    STANDS_OUT,
    arises,
    compare,
    deviating_stage,
    locate,
    stagewise,
    weigh,
)
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.misfit import ZERO_REACH, Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.ingest.read import read_run
from winchcascade.report.results.diagnosis_sentences import arises_sentence
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.parts import Model
from winchcascade.rig.stages import STAGES

OF_NOISE = 0.3
"""Difference between the places of a log alone and among others over their noise: all motions
set step and smoothing. [1]
"""

U_PRESSURE = 2942.0
"""Standard uncertainty of the zero of the pressure sensor, as the built-in rig file has it. [Pa]"""

SPEED = calibrated_rig().rpm_per_velocity or math.nan
"""Generator speed over line velocity. [rpm s/m]"""


@cache
def log_of(k_e_change: float = 0.0) -> Fitted:
    """One log at 9 ohm, the back-EMF constant of whose rig differs."""
    model = make_effect("ke_shift", {"k_e_change": k_e_change}).apply(baseline(calibrated_rig()))
    return Fitted([made_log(model, seed=4, load=9.0, cycles=2)], calibrated_rig())


def offset(data: Fitted, channel: str, by: float | np.ndarray) -> Fitted:
    """The same log with something added to a channel."""
    run = data.logs[0].run
    channels = {**run.channels, channel: run.channels[channel] + by}
    return Fitted([msgspec.structs.replace(run, channels=channels)], calibrated_rig())


def mapped(data: Fitted) -> tuple[Place, ...]:
    return compare(data, data.stated)


def left(data: Fitted) -> np.ndarray:
    return data.gap(data.stated)


# --------------------------------------------------------------------------------- the yardsticks
def test_every_yardstick_is_what_it_is_said_to_be() -> None:
    residual, cycle, noise = (
        np.array([1.0, 3.0, 2.0, 6.0]),
        np.array([0, 0, 1, 1]),
        np.array([0.1, 0.1, 0.1, 0.5]),
    )
    by = weigh(
        residual, cycle, noise, 0.3, np.array([[1.0, 0.0], [0.0, 0.2], [1.0, 0.0], [0.0, 0.2]])
    )
    own = math.sqrt((3 * 0.01 + 0.25) / 4.0)
    assert (by.bias, by.rms, by.noise) == pytest.approx(
        (3.0, math.sqrt((1 + 9 + 4 + 36) / 4.0), own)
    )
    assert by.u_noise == pytest.approx(math.hypot(own / 2.0 * math.sqrt(1.5), 0.3))
    assert by.u_repeat == pytest.approx(np.std([2.0, 4.0], ddof=1) / math.sqrt(2.0))
    assert by.u_tolerance == pytest.approx(math.hypot(0.5, 0.1))
    assert by.z == pytest.approx(
        3.0 / math.sqrt(by.u_noise**2 + by.u_repeat**2 + by.u_tolerance**2)
    )


def test_one_cycle_says_nothing_of_repeating_and_no_yardstick_no_z() -> None:
    by = weigh(np.array([2.0, 2.0]), np.array([3, 3]), np.zeros(2), 0.0, np.zeros((2, 1)))
    assert math.isnan(by.u_repeat)
    assert by.z == 0.0


def test_the_map_has_every_channel_and_phase_that_the_noise_is_known_of() -> None:
    places = mapped(log_of())
    assert {place.channel for place in places} == set(CHANNELS)
    assert {place.phase for place in places} <= set(PHASES)
    assert max(abs(place.z) for place in places) < STANDS_OUT


@pytest.mark.parametrize(
    ("channel", "times"), [("pressure", 1.0), ("pressure", 10.0), ("vdc", 0.001)]
)
def test_a_zero_is_taken_off_within_its_reach_where_a_sensor_has_one(
    channel: str, times: float
) -> None:
    k, by = CHANNELS.index(channel), times * U_PRESSURE
    reach = ZERO_REACH * U_PRESSURE if channel == "pressure" else 0.0
    moved = left(offset(log_of(), channel, by))[:, k] - left(log_of())[:, k]
    assert np.nanmean(moved) == pytest.approx(
        max(by - reach, 0.0), abs=0.5 * U_PRESSURE if reach else 1e-9
    )


# ------------------------------------------------------------------------------------------ where
def place(channel: str, z: float) -> Place:
    return Place(
        channel=channel, phase="payout", log=0, load=9.0, blocks=20, bias=z, rms=abs(z), noise=1.0,
        u_noise=1.0, u_repeat=0.0, u_tolerance=0.0, z=z,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("z", "stage", "found"),
    [
        ({"force": -50.0, "torque": 20.0, "idc": -4.5}, None, ("transmission", "force")),
        ({"force": 1.0, "pressure": -3.0, "idc": 2.0}, None, ("restoring", "pressure")),
        ({"force": -50.0, "pressure": 5.0}, "restoring", ("restoring", "pressure")),
        ({"force": -50.0, "pressure": 3.0}, "restoring", ("restoring", "force")),
        ({"force": -50.0, "vdc": 5.0}, "sensor", ("sensor", "force")),
    ],
)
def test_a_gap_lies_in_the_known_stage_where_its_output_stands_out_or_in_the_largest_deviation(
    z: dict[str, float], stage: str | None, found: tuple[str, str]
) -> None:
    where = locate(log_of(), left(log_of()), [place(*one) for one in z.items()], stage)
    assert (where.stage, where.worst.channel) == found


def test_a_lower_back_emf_lies_in_the_generator_at_all_speeds() -> None:
    data = log_of(-0.05)
    found = locate(data, left(data), mapped(data), "generator")
    assert (found.stage, found.worst.phase, found.worst.load) == ("generator", "payout", 9.0)
    assert found.worst.channel in ("vdc", "idc")
    assert found.rpm[1] == pytest.approx(0.95 * SPEED, rel=0.05)
    assert found.i_dc[0] < found.i_dc[1]


def test_the_region_is_that_of_the_blocks_that_stand_out() -> None:
    """A Vdc that is off above a speed alone: the region begins there."""
    velocity = log_of().logs[0].run.channels["velocity"]
    data = offset(log_of(), "vdc", np.where(velocity > 0.6, -8.0, 0.0))
    found, blocks = locate(data, left(data), mapped(data)), data.logs[0].course.blocks
    off = blocks.mean(velocity)[blocks.mean((velocity > 0.6).astype(np.float64)) > 0.0]
    assert found.worst.channel == "vdc"
    assert found.rpm[0] == pytest.approx(np.min(off) * SPEED, rel=0.05)
    assert abs(found.size) == pytest.approx(8.0, abs=0.6)


# --------------------------------------------------------------------------------- stage by stage
LOADS = (math.inf, 27.0, 4.5)
ZERO = {"pressure": 2942.0, "force": 2.0, "torque": 0.3, "idc": 0.005}
"""Standard uncertainties of the zeros, as the built-in rig file has them. SI units."""

PLANTED: dict[str, tuple[dict[str, float], set[str]]] = {
    "gear_mesh_loss": ({"efficiency_change": -0.03}, {"gearbox"}),
    "rotor_friction": ({"torque": 0.15}, {"gearbox"}),
    "clutch_drag": ({"torque": 3.0}, {"gearbox"}),
    "ke_rolloff": ({"lost_to_1p4": 0.03, "lost_to_1p8": 0.05}, {"generator"}),
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
    model = baseline(calibrated_rig())
    model = make_effect(name, PLANTED[name][0]).apply(model) if name else model
    return stagewise(Fitted(campaign(dict.fromkeys(LOADS, model), 0), calibrated_rig()))


@pytest.mark.parametrize(
    "name", daily(PLANTED, ("clutch_drag", "ke_shift", "copper_heating", "gas_volume"))
)
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
    bare = Fitted([made_log(load=load, cycles=1) for load in LOADS], calibrated_rig())
    models = bare.models(rng.standard_normal(len(bare.nuisances)), [])
    places = stagewise(
        Fitted(campaign(dict(zip(LOADS, models, strict=True)), seed), calibrated_rig())
    )
    z = np.array([place.z for place in places])
    assert np.all(np.abs(z) < STANDS_OUT)
    assert np.sqrt(np.mean(z**2)) < 1.7  # one number of the rig moves many places alike


def test_a_log_without_noise_has_no_stage_off() -> None:
    places = stagewise(Fitted([made_log(load=load, cycles=2) for load in LOADS], calibrated_rig()))
    assert max(abs(place.z) for place in places) < 1.0
    assert all(place.noise > 0.0 for place in places)


@pytest.mark.parametrize(
    ("missing", "left"),
    [
        ((), set(STAGES)),
        (("torque",), {"restoring", "generator", "load"}),
        (("pressure",), {"gearbox", "generator", "load"}),
        (("vdc", "idc"), {"restoring", "transmission"}),
    ],
)
def test_a_stage_that_the_log_cannot_compare_is_left_out(
    missing: tuple[str, ...], left: set[str]
) -> None:
    run = made_log(seed=2, load=18.0, cycles=2)
    bare = msgspec.structs.replace(
        run, channels={k: x for k, x in run.channels.items() if k not in missing}
    )
    assert {place.stage for place in stagewise(Fitted([bare], calibrated_rig()))} == left
    assert stagewise(Fitted([motion_run(load=18.0, cycles=1)], calibrated_rig())) == ()


def test_what_another_log_reads_wrong_moves_no_place_of_this_one() -> None:
    runs = campaign(dict.fromkeys(LOADS, baseline(calibrated_rig())), 4)
    alone = stagewise(Fitted(runs[:1], calibrated_rig()))
    beside = [place for place in stagewise(Fitted(runs, calibrated_rig())) if place.log == 0]
    for near, place in zip(beside, alone, strict=True):
        allowed = OF_NOISE * place.u_noise
        assert (near.u_noise, near.bias) == pytest.approx((place.u_noise, place.bias), abs=allowed)


LABELLED = {
    "none": (),
    "ke_rolloff": ("generator",),
    "gear_mesh_loss": ("gearbox",),
    "line_friction": ("transmission",),
}


@pytest.mark.parametrize("case", daily(LABELLED, ("none",)))
def test_a_labelled_campaign_is_off_where_its_effect_is(shared: Path, case: str) -> None:
    entries = load_campaign(shared / "labelled" / case / "campaign.toml").runs
    data = Fitted([read_run(entry.file, load=entry.load) for entry in entries], calibrated_rig())
    assert tuple(place.stage for place in arises(stagewise(data))) == LABELLED[case]
