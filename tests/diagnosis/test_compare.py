"""The map of a gap end to end: each yardstick by hand, zeros taken off as far as they may be, and where a gap is laid."""

import math
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import numpy as np
import pytest
from openlog import made_log

from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Arises, Place, StagePlace, Where
from winchcascade.diagnosis.gap_map import (
    SHARED,
    STANDS_OUT,
    ZERO_REACH,
    arises,
    compare,
    locate,
    weigh,
    without_zeros,
    zero_of,
    zeros_of,
)
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report.results.diagnosis_sentences import where_sentence
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect

U_PRESSURE = 2942.0
"""Standard uncertainty of the zero of the pressure sensor, as the built-in rig file has it. [Pa]"""


@cache
def log_of(effect: str = "", load: float = 9.0) -> Fitted:
    model = baseline(built_in())
    values = {"ke_shift": {"k_e_change": -0.05}, "precharge": {"pressure_change": 0.05}}
    if effect:
        model = make_effect(effect, values[effect]).apply(model)
    return Fitted([made_log(model, seed=4, load=load, cycles=2)], built_in())


def offset(data: Fitted, channel: str, by: float) -> Fitted:
    run = data.logs[0].run
    return Fitted(
        [msgspec.structs.replace(run, channels={**run.channels, channel: run.channels[channel] + by})], built_in()
    )


def mapped(data: Fitted) -> tuple[Place, ...]:
    predicted = data.predict(np.zeros(len(data.nuisances)), [])
    tolerances = data.tolerances(np.zeros(len(data.nuisances)), [], predicted)
    return compare(data, predicted, tolerances)


def left(data: Fitted) -> np.ndarray:
    return without_zeros(data, data.measured - data.predict(np.zeros(len(data.nuisances)), []))


# ------------------------------------------------------------------------------------------------------- the yardsticks
def test_every_yardstick_is_what_it_is_said_to_be() -> None:
    residual = np.array([1.0, 3.0, 2.0, 6.0])
    cycle = np.array([0, 0, 1, 1])
    noise = np.array([0.1, 0.1, 0.1, 0.5])
    tolerances = np.array([[1.0, 0.0], [0.0, 0.2], [1.0, 0.0], [0.0, 0.2]])
    by = weigh(residual, cycle, noise, 0.3, tolerances)
    own = math.sqrt((3 * 0.01 + 0.25) / 4.0)
    assert by.bias == pytest.approx(3.0)
    assert by.rms == pytest.approx(math.sqrt((1 + 9 + 4 + 36) / 4.0))
    assert by.noise == pytest.approx(own)
    assert by.u_noise == pytest.approx(math.hypot(own / 2.0 * math.sqrt(1.5), 0.3))
    assert by.u_repeat == pytest.approx(np.std([2.0, 4.0], ddof=1) / math.sqrt(2.0))
    assert by.u_tolerance == pytest.approx(math.hypot(0.5, 0.1))
    assert by.z == pytest.approx(3.0 / math.sqrt(by.u_noise**2 + by.u_repeat**2 + by.u_tolerance**2))


def test_one_cycle_says_nothing_of_repeating_and_no_yardstick_no_z() -> None:
    by = weigh(np.array([2.0, 2.0]), np.array([3, 3]), np.zeros(2), 0.0, np.zeros((2, 1)))
    assert math.isnan(by.u_repeat)
    assert by.z == 0.0
    assert weigh(np.array([2.0, 2.0]), np.array([3, 3]), np.ones(2), 0.0, np.zeros((2, 0))).z == pytest.approx(
        2.0 / math.sqrt(0.75)
    )


def test_the_map_has_every_channel_and_phase_that_the_noise_is_known_of() -> None:
    places = mapped(log_of())
    assert {place.channel for place in places} == set(CHANNELS)
    assert {place.phase for place in places} <= set(PHASES)
    assert all(place.blocks >= 2 and place.load == 9.0 and place.log == 0 for place in places)
    assert max(abs(place.z) for place in places) < STANDS_OUT


# ------------------------------------------------------------------------------------------------------------ the zeros
def test_zeros_are_known_to_what_the_rig_file_says() -> None:
    (u,) = zeros_of(log_of())
    assert u[CHANNELS.index("pressure")] == pytest.approx(U_PRESSURE, rel=1e-3)
    assert u[CHANNELS.index("vdc")] == 0.0


@pytest.mark.parametrize("times", [1.0, -2.0])
def test_a_zero_within_its_reach_is_taken_off(times: float) -> None:
    k = CHANNELS.index("pressure")
    plain, moved = left(log_of())[:, k], left(offset(log_of(), "pressure", times * U_PRESSURE))[:, k]
    assert np.nanmax(np.abs(moved - plain)) < 0.02 * U_PRESSURE


def test_of_a_larger_zero_no_more_than_its_reach_is_taken_off() -> None:
    k = CHANNELS.index("pressure")
    zero = 10.0 * U_PRESSURE
    moved = left(offset(log_of(), "pressure", zero))[:, k] - left(log_of())[:, k]
    assert np.nanmean(moved) == pytest.approx(zero - ZERO_REACH * U_PRESSURE, abs=0.5 * U_PRESSURE)


def test_blocks_that_were_not_seen_tell_no_zero() -> None:
    seen = np.ones((6, len(CHANNELS)), dtype=bool)
    seen[4:] = False
    log = SimpleNamespace(noise=SimpleNamespace(seen=seen, total=np.full(seen.shape, 0.1)))
    residual = np.where(seen, 1.0, 700.0)
    zero = zero_of(cast("Any", log), residual, np.full(len(CHANNELS), 5.0))
    assert zero == pytest.approx(np.full(len(CHANNELS), 400.0 / (400.0 + 1.0 / 25.0)))


def test_a_channel_whose_sensor_has_no_zero_keeps_all() -> None:
    k = CHANNELS.index("vdc")
    moved = left(offset(log_of(), "vdc", 2.0))[:, k] - left(log_of())[:, k]
    assert moved == pytest.approx(2.0, abs=1e-9)


# -------------------------------------------------------------------------------------------------------------- where
def place(channel: str, z: float, phase: str = "payout", load: float | None = 9.0) -> Place:
    return Place(
        channel=channel, phase=phase, log=0, load=load, blocks=20, bias=z, rms=abs(z), noise=1.0,
        u_noise=1.0, u_repeat=0.0, u_tolerance=0.0, z=z,
    )  # fmt: skip


def where(*places: Place, stage: str | None = None, effect: str = "") -> tuple[str, str]:
    data = log_of(effect)
    found = locate(data, left(data), places, stage)
    return found.stage, found.worst.channel


def test_a_gap_is_laid_to_the_last_stage_whose_output_stands_out() -> None:
    assert where(place("force", -50.0), place("torque", 20.0), place("idc", -4.5)) == ("generator", "idc")
    assert where(place("force", -50.0), place("torque", 20.0), place("idc", -3.9)) == ("gearbox", "torque")
    assert where(place("force", -50.0), place("pressure", 5.0)) == ("restoring", "pressure")
    assert where(place("force", -50.0), place("pressure", 3.0)) == ("transmission", "force")


def test_where_nothing_stands_out_it_is_laid_to_the_largest() -> None:
    assert where(place("force", 1.0), place("pressure", -3.0), place("idc", 2.0)) == ("restoring", "pressure")


def test_a_known_stage_shows_in_its_own_output_if_that_stands_out() -> None:
    both = (place("force", -50.0), place("pressure", 5.0))
    assert where(*both, stage="restoring") == ("restoring", "pressure")
    assert where(*both, stage="transmission") == ("transmission", "force")
    assert where(place("force", -50.0), place("pressure", 3.0), stage="restoring") == ("restoring", "force")


def test_a_sensor_is_no_stage_and_shows_where_the_cascade_ends() -> None:
    assert where(place("force", -50.0), place("vdc", 5.0), stage="sensor") == ("sensor", "vdc")


def test_a_lower_back_emf_is_reported_with_its_region_and_size() -> None:
    data = log_of("ke_shift")
    places = mapped(data)
    found = locate(data, left(data), places, own=Arises((), None))
    assert (found.stage, found.worst.phase, found.worst.load, found.arises) == (
        "generator",
        "payout",
        9.0,
        Arises((), None),
    )
    assert found.worst.channel in ("vdc", "idc")
    assert 0.0 < found.rpm[0] < found.rpm[1]
    speed = built_in().rpm_per_velocity
    assert speed is not None
    assert found.rpm[1] == pytest.approx(0.95 * speed, rel=0.05)
    assert found.i_dc[0] < found.i_dc[1]
    assert (
        f"The gap lies in the generator stage: {'Vdc' if found.worst.channel == 'vdc' else 'Idc'} is over-predicted"
        in (where_sentence(found))
    )
    assert f"during payout between {found.rpm[0]:.0f} and {found.rpm[1]:.0f} rpm and " in where_sentence(found)
    assert "A DC, most clearly at 9 ohm, by up to " in where_sentence(found)


def test_the_region_is_that_of_the_blocks_that_stand_out() -> None:
    """A Vdc that is off above a speed alone: the region begins there."""
    base = log_of()
    run = base.logs[0].run
    fast = run.channels["velocity"] > 0.6
    vdc = run.channels["vdc"] - np.where(fast, 8.0, 0.0)
    data = Fitted([msgspec.structs.replace(run, channels={**run.channels, "vdc": vdc})], built_in())
    found = locate(data, left(data), mapped(data))
    speed = built_in().rpm_per_velocity
    assert speed is not None
    assert found.worst.channel == "vdc"
    assert found.rpm[0] == pytest.approx(0.6 * speed, rel=0.12)  # a block averages over 0.44 s
    assert found.rpm[1] == pytest.approx(0.95 * speed, rel=0.05)
    assert float(where_sentence(found).rsplit("by up to ", 1)[1].split()[0]) == pytest.approx(8.0, abs=0.6)


def test_at_rest_or_without_current_no_region_is_reported() -> None:
    data = log_of("precharge", load=math.inf)
    found = locate(data, left(data), [place("pressure", 9.0, "hold", math.inf)])
    assert where_sentence(found).startswith(
        "The gap lies in the restoring stage: pressure is under-predicted during hold, most "
    )
    assert "clearly in open circuit, by up to " in where_sentence(found)
    found = locate(data, left(data), [place("pressure", 9.0, "payout", math.inf)])
    assert " rpm, most clearly in open circuit" in where_sentence(found)


@pytest.mark.parametrize(("maximum", "stated"), [(0.4, False), (0.6, True)])
def test_a_current_of_less_than_half_an_ampere_is_no_region(maximum: float, stated: bool) -> None:
    sentence = where_sentence(Where("generator", place("vdc", 9.0), (100.0, 900.0), (-0.1, maximum), 2.0))
    assert (" A DC" in sentence) == stated
    assert "between 100 and 900 rpm" in sentence


# ------------------------------------------------------------------------------------------------------ the shared sensor
def off(stage: str, bias: float, by_gain: dict[str, float], u: float = 1.0) -> StagePlace:
    return StagePlace(
        stage=stage, channel="torque", inputs=(), phase="payout", log=0, load=9.0, blocks=20, bias=bias, rms=bias,
        noise=u, u_noise=u, u_repeat=math.nan, u_tolerance=0.0, z=bias / u, by_gain=by_gain,
    )  # fmt: skip


def test_one_gain_that_takes_nearly_all_away_is_reported_and_one_that_does_not_is_not() -> None:
    for spoilt, sensor in ((0.2, "torque"), (0.5, None)):
        places = [
            off("gearbox", 10.0, {"torque": 100.0}),
            off("transmission", -10.0 * (1.0 - spoilt), {"torque": -100.0}),
        ]
        places.append(off("restoring", 10.0 * spoilt, {"pressure": 3.0}))
        found = arises(places)
        assert found.sensor == sensor
        if sensor:
            assert found.stage == "sensor"
            assert found.gain == pytest.approx((10.0 + 8.0) / 200.0)
        else:
            assert found.stage == "gearbox"
    assert SHARED == 0.9


def test_a_sensor_that_not_every_stage_reads_is_not_reported() -> None:
    places = [off("gearbox", 10.0, {"torque": 100.0}), off("restoring", 4.5, {"pressure": 100.0})]
    assert arises(places).sensor is None


def test_a_gain_is_weighed_by_what_each_place_is_known_to() -> None:
    """A far place that is hardly known must not decide."""
    places = [
        off("gearbox", 10.0, {"idc": 100.0}),
        off("generator", 20.0, {"idc": 200.0}),
        off("load", 500.0, {"idc": 100.0}, u=1000.0),
    ]
    found = arises(places)
    assert found.sensor == "idc"
    assert found.gain == pytest.approx(0.1, abs=0.001)
    assert found.off == ("generator", "gearbox")


def test_a_place_without_any_yardstick_is_passed_over() -> None:
    unknown = StagePlace(
        stage="load", channel="idc", inputs=(), phase="payout", log=0, load=9.0, blocks=20, bias=1.0, rms=1.0, noise=0.0,
        u_noise=0.0, u_repeat=math.nan, u_tolerance=0.0, z=0.0, by_gain={"torque": 1.0},
    )  # fmt: skip
    places = [off("gearbox", 10.0, {"torque": 100.0}), off("transmission", 10.0, {"torque": 100.0}), unknown]
    assert arises(places).sensor == "torque"
