"""Operating points: what enters a stage is more than what leaves it, and they agree with a
simulated log that is reduced.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs import calibrated_rig

from winchcascade.core.errors import OptionError
from winchcascade.core.run import Run, Signal
from winchcascade.design.operating import (
    PLACE,
    Motion,
    Path,
    motion_of_run,
    path_of,
    planned_cycle,
    point,
)
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.simulate import simulate

RIG = calibrated_rig()
MODEL = baseline(RIG)
WORN = make_effect("line_drag", {"b": 0.9}).apply(
    make_effect("copper_heating", {"r_s_change": 0.4}).apply(MODEL)
)

RULE = 2e-3
"""Relative difference of two rules of integration, between whose ends one step more or less
lies. [1]
"""

PEAK = 6e-3
"""Relative difference of a maximum between the steps and one of samples. [1]"""

loads = st.floats(2.0, 200.0)
speeds = st.floats(0.15, 1.2)


def logged(path: Path, load: float) -> Run:
    """The motion of a path as a log."""
    motion = path.motion
    return Run("log", motion.t, {"velocity": motion.v}, 1.0 / motion.step, motion.t.size, load=load)


@settings(max_examples=max(settings().max_examples // 4, 1))
@given(loads, speeds, st.floats(3.0, 15.0), st.floats(0.5, 4.0))
def test_no_stage_gives_more_than_it_takes(
    load: float, speed: float, length: float, ramp: float
) -> None:
    found = dict(
        zip(
            PLACE, point(WORN, path_of(planned_cycle(speed, length, ramp), WORN), load), strict=True
        )
    )
    assert found["p_line_w"] >= found["p_mech_w"] >= found["p_gen_w"] > 0.0
    assert found["e_line_j"] >= found["e_gen_j"] > 0.0
    assert found["eta_pto"] == pytest.approx(found["eta_trans"] * found["eta_gen"])
    assert found["eta_pto"] == pytest.approx(found["p_gen_w"] / found["p_line_w"])


@pytest.mark.parametrize(("load", "speed"), [(9.0, 0.8), (27.0, 0.5), (4.5, 0.3), (18.0, 1.1)])
def test_a_point_agrees_with_a_simulated_log_that_is_reduced(load: float, speed: float) -> None:
    path = path_of(planned_cycle(speed, 9.5, 1.5), WORN, RIG.thresholds)
    run = simulate(logged(path, load), WORN).run
    made, found = reduce(run, rig=RIG, window="payout").complete[0], point(WORN, path, load)
    reduced = made.metrics
    pairs = {
        "p_line_w": "power_line",
        "p_mech_w": "power_mech",
        "p_gen_w": "power_gen",
        "eta_trans": "eta_trans",
    }
    for name, metric in (pairs | {"eta_gen": "eta_gen", "eta_pto": "eta_pto"}).items():
        assert found[PLACE[name]] == pytest.approx(reduced[metric], rel=RULE), name
    assert found[PLACE["payout_s"]] == pytest.approx(made.summary.payout.duration, rel=RULE)
    plateau = made.summary.payout.plateau
    assert plateau is not None
    for name in ("line", "mech", "gen"):
        assert found[PLACE[f"plateau_p_{name}_w"]] == pytest.approx(
            getattr(plateau, f"power_{name}"), rel=RULE
        ), name
    channels = run.channels
    joules = (
        np.trapezoid(channels["vdc"] ** 2 / load, run.t),
        np.trapezoid(channels["force"] * channels["velocity"], run.t),
    )
    assert found[[PLACE["e_gen_j"], PLACE["e_line_j"]]] == pytest.approx(joules, rel=RULE)
    for name, channel in {"torque_nm": "torque", "i_dc_a": "idc", "force_n": "force"}.items():
        assert found[PLACE[name]] == pytest.approx(channels[channel].max(), rel=PEAK), name


@given(speeds, speeds)
def test_another_speed_keeps_the_path_of_the_line(speed: float, other: float) -> None:
    motion = planned_cycle(speed, 9.5, 1.5)
    changed = motion.at_speed(other)
    assert changed.speed == other == pytest.approx(changed.v.max())
    for step in (np.diff, np.cumsum):
        assert step(changed.t)[-1] * other == pytest.approx(step(motion.t)[-1] * speed)
    travel = [np.trapezoid(np.maximum(one.v, 0.0), one.t) for one in (motion, changed)]
    assert travel[1] == pytest.approx(travel[0]) == pytest.approx(9.5)


def test_rests_and_repeats_of_a_log_change_no_point() -> None:
    cycle = planned_cycle(0.8, 9.5, 1.5)
    t = np.arange(0.0, cycle.t[-1], 0.04)
    once, rest = np.interp(t, cycle.t, cycle.v), np.zeros(5000)

    def motion(v: Signal) -> Motion:
        return motion_of_run(
            Run("log", 0.04 * np.arange(v.size, dtype=np.float64), {"velocity": v}, 25.0, v.size)
        )

    motions = motion(once), motion(np.concatenate([rest, once, once, once, rest]))
    assert [found.cycles for found in motions] == [1, 3]
    assert motions[1].speed == pytest.approx(0.8, rel=0.01)  # a quadratic overshoots at a corner
    assert motions[1].t[-1] - motions[1].t[0] < 3.1 * t[-1]
    one, three = (point(WORN, path_of(found, WORN), 18.0) for found in motions)
    kept = [PLACE[name] for name in PLACE if name != "i_dc_rms_a"]
    assert three[kept] == pytest.approx(one[kept], rel=RULE)


def test_a_creep_below_the_onset_speed_of_the_rig_has_no_payout() -> None:
    with pytest.raises(OptionError, match=r"0\.02 m/s"):
        path_of(planned_cycle(0.02, 1.0, 1.5), WORN, RIG.thresholds)


def test_a_motion_of_hours_is_rejected() -> None:
    with pytest.raises(OptionError, match="takes"):
        path_of(planned_cycle(1e-3, 9.5, 1.5), WORN)


def test_a_log_without_a_payout_is_no_motion() -> None:
    t = np.arange(0.0, 10.0, 0.04)
    with pytest.raises(OptionError, match="still"):
        motion_of_run(Run("still", t, {"velocity": np.zeros(t.size)}, 25.0, t.size))
