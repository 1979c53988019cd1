"""The cycle with the largest gap: which it is, and what the log and the model have there."""

import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.simulated_cycle import LEAD, SimulatedCycle, cycle_gaps, largest_gap

VDC, FORCE = CHANNELS.index("vdc"), CHANNELS.index("force")


def shown(name: str) -> SimulatedCycle:
    item = largest_gap(diagnosed(name))
    assert item is not None
    return item


def test_the_cycle_with_the_largest_gap_is_shown() -> None:
    gaps = cycle_gaps(diagnosed("copper"))
    item = shown("copper")
    assert len(gaps) > 2
    assert gaps[item.log, item.cycle] == max(gaps.values())
    assert item.log == 1  # copper shows most at the smallest resistance


def test_logged_values_are_those_of_the_run_without_the_zeros_of_its_sensors() -> None:
    found, item = diagnosed("copper"), shown("copper")
    run = found.data.logs[item.log].run
    rows = np.searchsorted(run.t, item.onset + item.t - 1e-6)
    zeros = run.channels["force"][rows] - item.logged[:, FORCE]
    assert zeros == pytest.approx(found.data.zeros(found.found.best.nu)[item.log][FORCE])
    np.testing.assert_allclose(item.logged[:, VDC], run.channels["vdc"][rows])
    assert -LEAD <= item.t[0] < 0.0 < item.payout_end < item.t[-1]


def test_the_fitted_effects_bring_the_simulation_to_the_log() -> None:
    item = shown("copper")
    assert item.caused is not None
    out = (item.t > 2.0) & (item.t < item.payout_end - 1.0)
    before, after = (np.sqrt(np.mean((item.logged - x)[out, VDC] ** 2)) for x in (item.given, item.caused))
    assert after < 0.3 * before
    assert shown("nothing").caused is None
