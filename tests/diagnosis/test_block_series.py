"""Blocks of a diagnosed campaign: before and after the causes, over generator speed, and with one effect alone."""

import math

import numpy as np
import pytest
from diagnosed import diagnosed, made_logs

from winchcascade.diagnosis.block_means import PAYOUT
from winchcascade.diagnosis.block_series import (
    SPEED_BIN,
    means_over_speed,
    most_telling,
    representative,
    series,
    sides,
    sides_of_one,
)
from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.stator_current import by_load, loaded, rated_dc_current, stator_current
from winchcascade.rig.baseline import load_rig
from winchcascade.rig.effects.catalogue import EFFECTS

ALL = ["copper", "rolloff", "nothing", "outsider"]


@pytest.mark.parametrize("name", ALL)
def test_after_is_there_where_effects_were_fitted(name: str) -> None:
    found = diagnosed(name)
    assert (sides(found).after is None) == (not found.causes)


def test_after_comes_from_fits_that_did_not_know_the_log() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    both = sides(found)
    assert both.after is not None
    left = found.closure.residual
    fresh = np.isfinite(left[:, 0])
    assert np.allclose((both.logged - both.after)[fresh], left[fresh])


def test_zeros_are_taken_off_before_as_in_the_closure() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    both = sides(found)
    for k, channel in enumerate(CHANNELS):
        squares, count = 0.0, 0
        for log in found.closure.withheld:
            seen = found.data.logs[log].noise.seen[:, k]
            squares += float(np.sum((both.logged - both.before)[found.data.rows[log], k][seen] ** 2))
            count += int(seen.sum())
        assert math.sqrt(squares / count) == pytest.approx(found.closure.channels[channel].before)


def test_logs_stand_in_the_order_of_their_loads() -> None:
    found = diagnosed("copper")
    loads = [found.data.logs[k].load for k in by_load(found)]
    assert loads == sorted(loads, reverse=True)
    assert loaded(found) == by_load(found)
    assert representative(found) == by_load(found)
    assert most_telling(found) in loaded(found)


def test_means_over_speed_are_those_of_the_blocks_before_braking() -> None:
    found = diagnosed("copper")
    one = series(found, sides(found), 0, "idc")
    rpm, logged, before, _ = means_over_speed([one])
    here = one.before_braking
    bins: dict[int, list[int]] = {}
    for k in np.flatnonzero(here & np.isfinite(one.logged) & (one.rpm > 0)):
        bins.setdefault(math.floor(one.rpm[k] / SPEED_BIN), []).append(int(k))
    for n, rows in enumerate(bins[key] for key in sorted(bins)):
        assert rpm[n] == pytest.approx(np.mean(one.rpm[rows]))
        assert logged[n] == pytest.approx(np.mean(one.logged[rows]))
        assert before[n] == pytest.approx(np.mean(one.before[rows]))
    assert len(bins) == rpm.size


def test_braking_is_left_out_of_means_over_speed() -> None:
    one = series(diagnosed("copper"), sides(diagnosed("copper")), 0, "idc")
    out, kept = one.phase == PAYOUT, one.before_braking
    assert not np.any(kept & ~out)
    dropped = out & ~kept
    assert np.any(dropped)
    assert np.max(one.rpm[dropped]) < 0.9 * np.max(one.rpm[out])


def test_the_rated_current_of_the_stator_is_a_larger_one_of_the_dc_link() -> None:
    found = diagnosed("rolloff")
    rated = found.rig.generator.i_rated
    direct = rated_dc_current(found)
    assert rated is not None
    assert direct is not None
    assert 0.72 < rated.value / direct < 0.85  # a bridge with a capacitor: 0.75 to 0.83 over the loads
    stator, dc = stator_current(found)
    assert stator.shape == dc.shape


def test_the_only_suspect_is_applied_with_all_else_as_in_the_rig_file() -> None:
    runs = [one.run for one in made_logs({"ke_rolloff": {"lost_to_7_a": 0.04, "lost_to_9_a": 0.08}})]
    found = diagnose(runs, load_rig("hsu2026"), {"ke_rolloff": EFFECTS["ke_rolloff"]})
    both = sides_of_one(found)
    assert both is not None
    assert both.after is not None
    heavy = series(found, both, loaded(found)[-1], "idc")
    here = heavy.before_braking & np.isfinite(heavy.logged) & (heavy.logged > 6.0)
    before, after = (float(np.mean(error[here])) for error in heavy.errors)
    assert before < -0.1
    assert abs(after) < 0.2 * abs(before)
    (effect,) = found.found.fits["ke_rolloff",].effects(found.suspects)
    alone = found.data.predict(np.zeros(len(found.data.nuisances)), [effect])
    assert found.alone is not None
    assert np.array_equal(found.alone, alone, equal_nan=True)


def test_of_several_suspects_none_is_applied_alone() -> None:
    assert sides_of_one(diagnosed("copper")) is None
