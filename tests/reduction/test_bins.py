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


def test_a_bin_holds_the_mean_and_the_standard_error_of_its_samples() -> None:
    rng = np.random.default_rng(5)
    v = np.append(rng.uniform(0.0, 1.0, 5000), 1.55)
    watts = 1000.0 * v + rng.normal(0, 50, v.size)
    *bins, last = bin_powers(v, 3000.0, v > 0.2, {"line": watts.__getitem__, "gen": None}, 100.0)
    assert [b.rpm_low for b in bins] == [100.0 * k for k in range(6, 30)]
    for b in bins:
        inside = (v > 0.2) & (v * 3000.0 >= b.rpm_low) & (v * 3000.0 < b.rpm_high)
        assert b.count == inside.sum()
        assert b.power == {"line": pytest.approx(watts[inside].mean()), "gen": None}
        assert b.standard_error["line"] == pytest.approx(watts[inside].std(ddof=1) / np.sqrt(b.count), rel=1e-6)
    assert (last.rpm_low, last.count, last.standard_error["line"]) == (4600.0, 1, None)
