"""The map of a gap end to end: each yardstick by hand, zeros taken off as far as they may be, and where a gap lies."""

import math
from functools import cache

import msgspec
import numpy as np
import pytest
from openlog import made_log

from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Place
from winchcascade.diagnosis.gap_map import STANDS_OUT, ZERO_REACH, compare, locate, weigh, without_zeros
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect

U_PRESSURE = 2942.0
"""Standard uncertainty of the zero of the pressure sensor, as the built-in rig file has it. [Pa]"""

SPEED = built_in().rpm_per_velocity or math.nan
"""Generator speed over line velocity. [rpm s/m]"""


@cache
def log_of(k_e_change: float = 0.0) -> Fitted:
    """One log at 9 ohm, the back-EMF constant of whose rig differs."""
    model = make_effect("ke_shift", {"k_e_change": k_e_change}).apply(baseline(built_in()))
    return Fitted([made_log(model, seed=4, load=9.0, cycles=2)], built_in())


def offset(data: Fitted, channel: str, by: float | np.ndarray) -> Fitted:
    """The same log with something added to a channel."""
    run = data.logs[0].run
    channels = {**run.channels, channel: run.channels[channel] + by}
    return Fitted([msgspec.structs.replace(run, channels=channels)], built_in())


def mapped(data: Fitted) -> tuple[Place, ...]:
    nothing = np.zeros(len(data.nuisances))
    predicted = data.predict(nothing, [])
    return compare(data, predicted, data.tolerances(nothing, [], predicted))


def left(data: Fitted) -> np.ndarray:
    return without_zeros(data, data.measured - data.predict(np.zeros(len(data.nuisances)), []))


# ------------------------------------------------------------------------------------------------------- the yardsticks
def test_every_yardstick_is_what_it_is_said_to_be() -> None:
    residual, cycle, noise = np.array([1.0, 3.0, 2.0, 6.0]), np.array([0, 0, 1, 1]), np.array([0.1, 0.1, 0.1, 0.5])
    by = weigh(residual, cycle, noise, 0.3, np.array([[1.0, 0.0], [0.0, 0.2], [1.0, 0.0], [0.0, 0.2]]))
    own = math.sqrt((3 * 0.01 + 0.25) / 4.0)
    assert (by.bias, by.rms, by.noise) == pytest.approx((3.0, math.sqrt((1 + 9 + 4 + 36) / 4.0), own))
    assert by.u_noise == pytest.approx(math.hypot(own / 2.0 * math.sqrt(1.5), 0.3))
    assert by.u_repeat == pytest.approx(np.std([2.0, 4.0], ddof=1) / math.sqrt(2.0))
    assert by.u_tolerance == pytest.approx(math.hypot(0.5, 0.1))
    assert by.z == pytest.approx(3.0 / math.sqrt(by.u_noise**2 + by.u_repeat**2 + by.u_tolerance**2))


def test_one_cycle_says_nothing_of_repeating_and_no_yardstick_no_z() -> None:
    by = weigh(np.array([2.0, 2.0]), np.array([3, 3]), np.zeros(2), 0.0, np.zeros((2, 1)))
    assert math.isnan(by.u_repeat)
    assert by.z == 0.0


def test_the_map_has_every_channel_and_phase_that_the_noise_is_known_of() -> None:
    places = mapped(log_of())
    assert {place.channel for place in places} == set(CHANNELS)
    assert {place.phase for place in places} <= set(PHASES)
    assert max(abs(place.z) for place in places) < STANDS_OUT


@pytest.mark.parametrize(("channel", "times"), [("pressure", 1.0), ("pressure", 10.0), ("vdc", 0.001)])
def test_a_zero_is_taken_off_within_its_reach_where_a_sensor_has_one(channel: str, times: float) -> None:
    k, by = CHANNELS.index(channel), times * U_PRESSURE
    reach = ZERO_REACH * U_PRESSURE if channel == "pressure" else 0.0
    moved = left(offset(log_of(), channel, by))[:, k] - left(log_of())[:, k]
    assert np.nanmean(moved) == pytest.approx(max(by - reach, 0.0), abs=0.5 * U_PRESSURE if reach else 1e-9)


# -------------------------------------------------------------------------------------------------------------- where
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
    data = offset(log_of(), "vdc", np.where(log_of().logs[0].run.channels["velocity"] > 0.6, -8.0, 0.0))
    found = locate(data, left(data), mapped(data))
    assert found.worst.channel == "vdc"
    assert found.rpm[0] == pytest.approx(0.6 * SPEED, rel=0.12)  # a block averages over 0.44 s
    assert abs(found.size) == pytest.approx(8.0, abs=0.6)
