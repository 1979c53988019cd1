"""What figures of a diagnosis draw: blocks before and after the causes, the cycle with the
largest gap, costs, the roll-off.
"""

import math
from functools import cache

import msgspec
import numpy as np
import pandas as pd
import pytest
from diagnosed import PLANTED, SUSPECTS, diagnosed, made_logs
from rigs import calibrated_rig

from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.diagnosis.explain.figure_data import (
    LEAD,
    block_table,
    by_load,
    largest_gap,
    load_costs,
    profile_of,
)
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.rig.effects.catalogue import EFFECTS

VDC, FORCE = CHANNELS.index("vdc"), CHANNELS.index("force")


@cache
def table_of(name: str) -> pd.DataFrame:
    return block_table(diagnosed(name))


@pytest.mark.parametrize("name", PLANTED)
def test_after_is_there_where_causes_are_named_and_every_block_is_seen(name: str) -> None:
    found, table = diagnosed(name), table_of(name)
    assert table.after.notna().all() == bool(found.causes)
    assert len(table) == np.count_nonzero(found.data.seen)
    assert table[["t", "rpm", "noise", "logged", "before"]].notna().all().all()


def test_errors_are_those_of_the_closure() -> None:
    found, table = diagnosed("copper"), table_of("copper")
    assert found.closure is not None
    held = table[table.log.isin(found.closure.withheld)]
    for channel, own in held.groupby("channel"):
        shrunk = found.closure.channels[str(channel)]
        for side, size in (("before", shrunk.before), ("after", shrunk.after)):
            assert math.sqrt(float(((own.logged - own[side]) ** 2).mean())) == pytest.approx(size)


def test_logs_stand_in_the_order_of_their_loads() -> None:
    assert [diagnosed("copper").data.logs[k].load for k in by_load(diagnosed("copper"))] == [
        18.0,
        4.5,
    ]


# -------------------------------------------------------------------------------------- one cycle
def test_the_cycle_with_the_largest_gap_is_shown_and_the_effects_bring_the_simulation_to_the_log() -> (
    None
):
    found, item = diagnosed("copper"), largest_gap(diagnosed("copper"), table_of("copper"))
    assert item is not None
    assert item.log == 1  # copper shows most at the smallest resistance
    run = found.data.logs[item.log].run
    logged, given, caused = item.sides
    rows = np.searchsorted(run.t, item.onset + item.t - 1e-6)
    zeros = run.channels["force"][rows] - logged[:, FORCE]
    assert zeros == pytest.approx(found.data.zeros(found.found.best.nu)[item.log][FORCE])
    assert -LEAD * found.data.scales.motion.time <= item.t[0] < 0.0 < item.payout_end < item.t[-1]
    out = (item.t > 2.0) & (item.t < item.payout_end - 1.0)
    before, after = (np.sqrt(np.mean((logged - x)[out, VDC] ** 2)) for x in (given, caused))
    assert after < 0.3 * before
    nothing = largest_gap(diagnosed("nothing"), table_of("nothing"))
    assert nothing is not None
    assert len(nothing.sides) == 2


# ------------------------------------------------------------------------------ numbers and costs
def test_the_roll_off_never_rises_lies_in_its_band_and_is_the_one_reported() -> None:
    profile = profile_of(diagnosed("rolloff"))
    assert profile is not None
    current, left, low, high = profile
    assert left[0] == 1.0
    assert np.all(np.diff(left) <= 1e-12)
    assert np.all((low <= left + 2e-3) & (high >= left - 2e-3))
    reported = diagnosed("rolloff").causes[0].parameters["k_e_ratio_at_10_a"].value
    assert current[-1] > 10.0
    assert np.interp(10.0, current, left) == pytest.approx(reported, abs=1e-4)
    assert profile_of(diagnosed("copper")) is None


def test_costs_of_runs_of_one_load_are_averaged() -> None:
    found = diagnosed("copper")
    twice = msgspec.structs.replace(
        found, contributions=(*found.contributions, *found.contributions)
    )
    for two, one in zip(load_costs(twice, "eta_pto"), load_costs(found, "eta_pto"), strict=True):
        assert (two.load, two.as_given) == pytest.approx((one.load, one.as_given))
        assert two.parts[0].value == pytest.approx(one.parts[0].value)
        assert one.as_given + sum(part.value for part in one.parts) == pytest.approx(
            one.measured, abs=1e-6
        )


@pytest.mark.slow
@pytest.mark.parametrize(("times", "named"), [(2.0, True), (0.4, False)])
def test_what_is_said_of_the_smallest_effect_holds_in_logs(times: float, named: bool) -> None:
    thresholds = {one.effect: one.value for one in diagnosed("nothing").thresholds}
    assert set(thresholds) == set(SUSPECTS)
    minimum = thresholds["copper_heating"]
    assert minimum is not None
    runs = [one.run for one in made_logs({"copper_heating": {"r_s_change": times * minimum}})]
    found = diagnose(runs, calibrated_rig(), {suspect: EFFECTS[suspect] for suspect in SUSPECTS})
    assert [cause.effect for cause in found.causes] == (["copper_heating"] if named else [])
