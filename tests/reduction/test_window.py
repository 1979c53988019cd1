"""Plateau and integration window on a made payout: closed forms."""

import msgspec
import numpy as np
import pytest

from winchcascade.core.rig_file import WindowRule
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.phased_run import PhasedRun, Window, find_window
from winchcascade.reduction.phases import Cycle, Plateau, find_plateau

RULES = built_in().thresholds
T = np.arange(0.0, 30.0, 0.04)
PAYOUT = Cycle(5.0, 17.0, None, None, begins_inside=False, ends_inside=False)
CUT = Cycle(5.0, 10.0, None, None, begins_inside=False, ends_inside=True)
HELD = Plateau(0.9, 7.0, 16.0)


def along(*points: tuple[float, float]) -> Signal:
    """Velocity in straight lines between (time, speed)."""
    times, speeds = zip(*points, strict=True)
    v: Signal = np.interp(T, times, speeds)
    return v


TRAPEZOID = along((5.0, 0.0), (7.0, 0.9), (16.0, 0.9), (17.0, 0.0))


def window(
    rule: WindowRule,
    cycle: Cycle = PAYOUT,
    plateau: Plateau | None = HELD,
    top: float = 0.9,
    end: float = 29.0,
) -> Window:
    run = Run("made", np.array([0.0, end]), {"velocity": np.zeros(2)}, 1.0 / end, 2)
    return find_window(
        PhasedRun(run, built_in(), rule, run.t, 1, [cycle], None, [plateau], [9.0], [top]), 0
    )


def test_plateau_and_braking_lie_where_straight_lines_pass_98_percent_of_the_speed() -> None:
    plateau = find_plateau(
        T, along((5.01, 0.0), (7.01, 0.9), (16.0, 0.9), (17.0, 0.0)), PAYOUT, RULES
    )
    assert msgspec.structs.astuple(plateau) == pytest.approx(  # type: ignore[arg-type]
        (0.9, 5.01 + 0.98 * 2.0, 16.0 + 0.02), abs=1e-9
    )


@pytest.mark.parametrize(
    ("changed", "speed", "begin", "braking"),
    [
        ((5.7, 5.85), 0.9, (6.5, 7.0), (16.0, 16.04)),  # an overshoot is no plateau
        ((10.0, 11.0), 0.8, (6.9, 7.0), (15.9, 16.04)),  # a dip ends none
    ],
)
def test_the_plateau_is_held_from_its_beginning_and_lasts_to_the_last_sample_at_its_level(
    changed: tuple[float, float],
    speed: float,
    begin: tuple[float, float],
    braking: tuple[float, float],
) -> None:
    found = find_plateau(
        T, np.where((changed[0] < T) & (changed[1] > T), speed, TRAPEZOID), PAYOUT, RULES
    )
    assert found is not None
    assert begin[0] < found.begin < begin[1]
    assert braking[0] < found.braking < braking[1]


@pytest.mark.parametrize(
    ("v", "cycle", "ends"),
    [
        (np.full(T.size, 0.9), Cycle(T[0], T[-1], None, None, True, True), (T[0], T[-1])),
        (
            np.where(T > 8.0, 0.9, 0.0),
            msgspec.structs.replace(PAYOUT, payout_end=12.0),
            (8.04 - 0.02 * 0.04, 12.0),
        ),
        (
            along((5.0, 0.0), (5.1, 0.9), (5.2, 0.0)),
            msgspec.structs.replace(PAYOUT, payout_end=5.2),
            None,
        ),
        (np.full(T.size, -0.2), PAYOUT, None),  # a payout that only a gap indicates
        (np.full(T.size, 0.9), Cycle(T[0], T[1], None, None, False, False), None),  # two samples
    ],
)
def test_a_plateau_may_be_cut_and_may_be_missing(
    v: Signal, cycle: Cycle, ends: tuple[float, float] | None
) -> None:
    found = find_plateau(T, v, cycle, RULES)
    assert (found and (found.begin, found.braking)) == (ends and pytest.approx(ends, abs=1e-9))


@pytest.mark.parametrize(
    ("rule", "plateau", "cutoff"),
    [
        ("auto", HELD, 7.5),
        ("auto", Plateau(0.9, 7.0, 7.3), 7.3),  # never past the start of braking
        (5.48, None, 10.48),
        ("payout", None, 17.0),
    ],
)
def test_a_window_ends_by_its_rule(
    rule: WindowRule, plateau: Plateau | None, cutoff: float
) -> None:
    found = window(rule, plateau=plateau)
    assert found.fault is None
    assert (found.onset, found.cutoff) == pytest.approx((5.0, cutoff))


@pytest.mark.parametrize(
    ("rule", "cycle", "plateau", "top", "end", "whole"),
    [
        *(
            (rule, msgspec.structs.replace(PAYOUT, begins_inside=True), HELD, 0.9, 29.0, False)
            for rule in ("auto", "payout", 5.0)
        ),
        (5.48, CUT, None, 0.9, 10.47, False),
        (5.0, CUT, None, 0.9, 10.0, True),
        ("payout", CUT, None, 0.9, 10.0, False),
        ("auto", PAYOUT, None, 0.9, 29.0, False),
        ("auto", CUT, HELD, 0.92, 10.0, True),
        ("auto", CUT, Plateau(0.9, 9.6, 10.0), 0.92, 10.0, False),  # not settled
        ("auto", CUT, HELD, 0.93, 10.0, False),  # was faster than what looks like its plateau
    ],
)
def test_a_window_is_whole_where_onset_end_and_plateau_are_known(
    rule: WindowRule, cycle: Cycle, plateau: Plateau | None, top: float, end: float, whole: bool
) -> None:
    assert (window(rule, cycle, plateau, top, end).fault is None) == whole
