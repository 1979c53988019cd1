"""Which samples of a payout drive the generator, and what is averaged of them."""

from collections.abc import Mapping

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Run
from winchcascade.reduction.bins import bin_powers, engaged
from winchcascade.reduction.phases import Cycle, Plateau

Signal = NDArray[np.float64]

T = np.arange(10.0)
CYCLE = Cycle(2.0, 7.0, None, None, False, False)
PLATEAU = Plateau(0.8, 4.0, 5.0)
RISING = np.array([0.0, 9.0, 0.0, 1.0, 5.0, 5.0, 1.0, 3.0, 9.0, 0.0])
"""A torque that is above 2 N m in samples 1, 4, 5, 7 and 8."""


def driven(
    channels: Mapping[str, Signal],
    gaps: Mapping[str, Signal] | None = None,
    *,
    plateau: Plateau | None = PLATEAU,
    clutch: bool = True,
) -> list[int]:
    rig = built_in()
    rig = msgspec.structs.replace(rig, drivetrain=msgspec.structs.replace(rig.drivetrain, one_way_clutch=clutch))
    run = Run("a.csv", T, {"displacement": T, **channels}, 1.0, T.size, gaps=gaps or {})
    rows: list[int] = np.flatnonzero(engaged(run, [CYCLE], [plateau], rig)).tolist()
    return rows


def test_from_the_onset_until_the_torque_has_risen_and_then_wherever_there_is_torque() -> None:
    assert driven({"torque": RISING}) == [2, 3, 4, 5, 7]


def test_a_torque_that_never_rises_drives_nothing() -> None:
    assert driven({"torque": np.zeros(10)}) == []


def test_without_a_torque_the_clutch_is_engaged_until_braking() -> None:
    assert driven({}) == [2, 3, 4, 5]
    assert driven({}, plateau=None) == [2, 3, 4, 5, 6, 7]


def test_without_a_clutch_the_whole_payout_drives() -> None:
    assert driven({"torque": RISING}, clutch=False) == [2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize("name", [CLOCK, "velocity", "force", "torque", "power_mech", "vdc", "idc"])
def test_bridged_samples_are_left_out_but_not_the_good_ones_around_them(name: str) -> None:
    assert driven({}, {name: np.array([[2.0, 4.0]])}) == [2, 4, 5]


def test_a_gap_of_the_pressure_concerns_no_power() -> None:
    assert driven({}, {"pressure": np.array([[2.0, 4.0]])}) == [2, 3, 4, 5]


def test_of_two_samples_the_standard_error_is_half_their_distance() -> None:
    (only,) = bin_powers(
        np.array([0.11, 0.12]), 1000.0, np.ones(2, dtype=bool), {"line": np.array([3.0, 9.0]).__getitem__}, 100.0
    )
    assert only.standard_error["line"] == pytest.approx(3.0)


def test_the_standard_error_is_that_of_independent_samples() -> None:
    watts = np.array([1.0, 2.0, 6.0, 100.0])
    one, other = bin_powers(
        np.array([0.11, 0.12, 0.13, 0.31]), 1000.0, np.ones(4, dtype=bool), {"line": watts.__getitem__}, 100.0
    )
    assert (one.rpm_low, one.rpm_high, one.count, one.power["line"]) == (100.0, 200.0, 3, 3.0)
    assert one.standard_error["line"] == pytest.approx(np.std([1.0, 2.0, 6.0], ddof=1) / np.sqrt(3.0))
    assert (other.rpm_low, other.count, other.power["line"], other.standard_error["line"]) == (300.0, 1, 100.0, None)
