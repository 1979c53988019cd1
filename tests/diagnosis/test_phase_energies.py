"""Energies by phase: the uncertainty of what a fit leaves of them, and the alarms that compare
them all together.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec
import numpy as np
import pytest
from diagnosed import LOGS, PLANTED, SUSPECTS, diagnosed

from winchcascade.core.integrate import white_noise
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    Contribution,
    ContributionPart,
    Spot,
    StageEnergy,
)
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.judge.alarms import STAGES_OF, largest_of, left_over, unbalanced
from winchcascade.diagnosis.verdict_limits import FALSE_ALARM

CALIBRATED = 1.3
"""Maximum root mean square of 14 correlated differences in their uncertainties; rigs that follow
the model exactly leave less than others. [1]"""

RUNS = 20_000
"""Number of campaigns that are drawn."""

SCATTER = 0.004
"""Four standard deviations of a share of 1 % of so many. [1]"""


@pytest.mark.parametrize("name", [name for name in PLANTED if PLANTED[name].keys() <= {*SUSPECTS}])
def test_what_a_right_fit_leaves_of_energies_is_within_its_uncertainty(name: str) -> None:
    energies = diagnosed(name).energies
    assert {(one.run, one.stage) for one in energies} == {
        (k, s) for k in range(len(LOGS)) for s in ("line", "mech", "gen")
    }
    z = np.array([(one.measured - one.after) / one.u for one in energies])
    assert np.sqrt(np.mean(z**2)) < CALIBRATED
    assert beyond(unbalanced(energies)) == []


def test_a_power_of_noise_alone_is_no_better_known_than_the_product_of_its_noises() -> None:
    found = diagnosed("nothing")
    for one in (one for one in found.energies if (one.stage, one.phase) == ("gen", "haul_in")):
        log = found.data.logs[one.run]
        blocks = log.course.blocks
        samples = np.sum(blocks.count[blocks.phase == PHASES.index("haul_in")])
        noises = [white_noise(log.run.channels[name]) for name in ("vdc", "idc")]
        assert one.u >= np.prod(noises) * np.sqrt(samples) / log.run.fs


def test_a_payout_is_known_to_some_thousandths() -> None:
    payouts = [one for one in diagnosed("nothing").energies if one.phase == "payout"]
    assert max(one.u / abs(one.measured) for one in payouts) < 5e-3


def beyond(alarms: Iterable[Alarm]) -> list[Alarm]:
    """Those that ring."""
    return [alarm for alarm in alarms if alarm.size > alarm.limit]


def energy(z: float, run: int = 0) -> StageEnergy:
    """A payout of 100 J that deviates by some uncertainties."""
    return StageEnergy(run, "payout", "line", 100.0 + z, 100.0, 100.0, 1.0)


@pytest.mark.parametrize("count", [1, 7, 46])
def test_the_largest_of_all_energies_exceeds_its_limit_as_often_as_stated(count: int) -> None:
    largest = np.abs(np.random.default_rng(1).standard_t(count, (RUNS, count))).max(axis=1)
    assert np.mean(largest > largest_of(count)) == pytest.approx(FALSE_ALARM, abs=SCATTER)


def test_one_energy_beyond_the_limit_rings_and_one_within_it_does_not() -> None:
    others = [energy(0.5, run) for run in range(1, 20)]
    limit = largest_of(20)
    (alarm,) = beyond(unbalanced([energy(1.01 * limit), *others]))
    assert isinstance(alarm.about, Spot)
    assert (alarm.kind, alarm.about.channel, alarm.about.phase, alarm.about.run) == (
        "energy",
        "energy_line",
        "payout",
        0,
    )
    assert alarm.size == pytest.approx(1.01 * limit)
    assert alarm.limit == limit
    assert beyond(unbalanced([energy(0.99 * limit), *others])) == []


@pytest.mark.parametrize(("residual", "rings"), [(0.2, True), (0.05, False)])
def test_a_residual_of_an_efficiency_rings_beyond_its_uncertainty(
    residual: float, rings: bool
) -> None:
    """Both energies are known to 1 %; of one efficiency the limit is wide, as so few differences
    tell of their scatter.
    """
    relevant = diagnosed("nothing").data.rig.model
    energies = [
        msgspec.structs.replace(energy(0.0), stage=stage, u=0.001) for stage in ("line", "gen")
    ]
    part = ContributionPart(None, "residual", residual, math.nan, math.nan)
    window = [
        Contribution(0, 9.0, f"energy_{stage}", 100.0, 100.0, ()) for stage in ("line", "gen")
    ]
    of = Contribution(0, 9.0, "eta_pto", 0.5, 0.5, (part,))
    within = largest_of(1) * 0.5 * math.hypot(1e-5, 1e-5)
    accuracy = msgspec.structs.replace(relevant, relevant_efficiency=0.1 - within)
    found = [alarm.about for alarm in beyond(left_over([*window, of], energies, accuracy))]
    assert [about.channel for about in found if isinstance(about, Spot)] == ["eta_pto"] * rings
    assert "eta_pto" in STAGES_OF
