import numpy as np
import pytest

from winchcascade.core.rig_file import Thresholds
from winchcascade.core.run import Signal
from winchcascade.reduction.phased_run import find_window
from winchcascade.reduction.phases import Cycle, Plateau, find_plateau

RULES = Thresholds()
T = np.arange(0.0, 30.0, 0.04)
ONE_SAMPLE = 0.04


def cycle(*, ends_inside: bool = False, begins_inside: bool = False) -> Cycle:
    return Cycle(5.0, 17.0, None, None, begins_inside, ends_inside)


def trapezoid(speed: float = 0.9) -> np.ndarray:
    """From 5 s up in 2 s, from 16 s down in 1 s."""
    v: np.ndarray = np.interp(T, [5.0, 7.0, 16.0, 17.0], [0.0, speed, speed, 0.0])
    return v


def plateau_of(v: Signal) -> Plateau:
    plateau = find_plateau(T, v, cycle(), RULES)
    assert plateau is not None
    return plateau


def test_the_plateau_is_where_the_speed_stays_above_98_percent() -> None:
    plateau = plateau_of(trapezoid())
    assert plateau.speed == pytest.approx(0.9)
    assert plateau.begin == pytest.approx(5.0 + 0.98 * 2.0, abs=ONE_SAMPLE)
    assert plateau.braking == pytest.approx(16.0 + 0.02, abs=ONE_SAMPLE)


def test_a_single_overshoot_is_no_plateau() -> None:
    v = trapezoid()
    v[(T > 5.7) & (T < 5.85)] = 0.9
    plateau = plateau_of(v)
    assert plateau.begin > 6.5


def test_braking_begins_after_the_last_sample_at_the_level_even_if_the_plateau_dips() -> None:
    v = trapezoid()
    v[(T > 10.0) & (T < 11.0)] = 0.8
    plateau = plateau_of(v)
    assert plateau.braking > 15.9


def test_a_payout_that_only_rises_and_falls_has_no_plateau() -> None:
    assert (
        find_plateau(
            T, np.interp(T, [5.0, 5.1, 5.2], [0.0, 0.9, 0.0]), Cycle(5.0, 5.2, None, None, False, False), RULES
        )
        is None
    )


def test_auto_ends_half_a_second_after_the_plateau_begins() -> None:
    plateau = find_plateau(T, trapezoid(), cycle(), RULES)
    window = find_window(cycle(), plateau, 0.9, T[-1], "auto", RULES)
    assert plateau is not None
    assert window.onset == 5.0
    assert window.cutoff == pytest.approx(plateau.begin + 0.5)
    assert window.fault is None


def test_auto_never_passes_the_start_of_braking() -> None:
    v = np.interp(T, [5.0, 7.0, 7.3, 8.0], [0.0, 0.9, 0.9, 0.0])
    short = Cycle(5.0, 8.0, None, None, False, False)
    plateau = find_plateau(T, v, short, RULES)
    assert plateau is not None
    assert find_window(short, plateau, 0.9, T[-1], "auto", RULES).cutoff == plateau.braking


def test_a_fixed_window_ends_its_length_after_the_onset() -> None:
    assert find_window(cycle(), None, 0.9, T[-1], 5.48, RULES).cutoff == pytest.approx(10.48)


def test_the_rule_payout_ends_with_the_payout() -> None:
    assert find_window(cycle(), None, 0.9, T[-1], "payout", RULES).cutoff == 17.0


@pytest.mark.parametrize("rule", ["auto", "payout", 5.0])
def test_a_payout_without_an_onset_has_no_whole_window(rule: str | float) -> None:
    window = find_window(cycle(begins_inside=True), None, 0.9, T[-1], rule, RULES)  # type: ignore[arg-type]
    assert window.fault == "the log begins inside the payout, so its onset is unknown"


@pytest.mark.parametrize(("end", "late"), [(8.0, 2.48), (10.47, 0.01)])
def test_a_fixed_window_past_the_end_of_the_log_is_not_whole(end: float, late: float) -> None:
    window = find_window(cycle(ends_inside=True), None, 0.9, end, 5.48, RULES)
    assert window.fault == f"the log ends {late:.2f} s before the window does"
    assert window.cutoff == end


def test_a_payout_cut_on_its_ramp_has_not_settled() -> None:
    """The speed reached so far always has a quantile; that is no plateau."""
    for end in np.arange(5.6, 7.0, 0.1):
        kept = end >= T
        cut = Cycle(5.0, float(T[kept][-1]), None, None, False, True)
        v = trapezoid()[kept]
        window = find_window(cut, find_plateau(T[kept], v, cut, RULES), float(v.max()), cut.payout_end, "auto", RULES)
        assert window.fault is not None


def test_a_payout_cut_late_on_its_plateau_has_a_whole_window() -> None:
    kept = T <= 10.0
    cut = Cycle(5.0, float(T[kept][-1]), None, None, False, True)
    v = trapezoid()[kept]
    window = find_window(cut, find_plateau(T[kept], v, cut, RULES), float(v.max()), cut.payout_end, "auto", RULES)
    assert window.fault is None


def test_plateau_and_braking_lie_between_the_samples() -> None:
    """On straight lines the instants are exact: 98 % of the ramp that begins at 5.01 s and 2 % down from 16 s."""
    v = np.interp(T, [5.01, 7.01, 16.0, 17.0], [0.0, 0.9, 0.9, 0.0])
    plateau = plateau_of(v)
    assert plateau.begin == pytest.approx(5.01 + 0.98 * 2.0, abs=1e-9)
    assert plateau.braking == pytest.approx(16.0 + 0.02, abs=1e-9)


def test_a_plateau_that_the_log_begins_or_ends_in_reaches_its_first_or_last_stamp() -> None:
    v = np.full(T.size, 0.9)
    plateau = find_plateau(T, v, Cycle(T[0], T[-1], None, None, True, True), RULES)
    assert plateau is not None
    assert (plateau.begin, plateau.braking) == (T[0], T[-1])


def test_a_plateau_that_the_payout_ends_in_reaches_its_last_sample() -> None:
    v = np.where(T > 8.0, 0.9, 0.0)
    plateau = find_plateau(T, v, Cycle(5.0, 12.0, None, None, False, False), RULES)
    assert plateau is not None
    assert plateau.braking == pytest.approx(12.0, abs=1e-9)


@pytest.mark.parametrize(("samples", "found"), [(2, False), (3, True)])
def test_three_samples_are_the_fewest_a_plateau_is_sought_in(samples: int, found: bool) -> None:
    t, v = 0.2 * np.arange(samples, dtype=np.float64), np.full(samples, 0.9)
    assert (find_plateau(t, v, Cycle(t[0], t[-1], None, None, False, False), RULES) is not None) == found


def test_a_level_that_is_only_reached_counts() -> None:
    v = np.where((T >= 6.0) & (T <= 8.0), 1.0, np.where((T >= 8.0) & (T <= 14.0), 0.98, 0.0))
    v[T < 5.0] = 0.0
    rules = Thresholds(plateau_quantile=1.0, plateau_band=0.99)
    plateau = find_plateau(T, v, cycle(), rules)
    assert plateau is not None
    assert plateau.speed == 1.0
    assert plateau.braking > 13.9


@pytest.mark.parametrize(("ends_inside", "fault"), [(False, None), (True, "the log ends inside the payout")])
def test_the_rule_payout_says_if_the_log_ends_before_it(ends_inside: bool, fault: str | None) -> None:
    assert find_window(cycle(ends_inside=ends_inside), None, 0.9, T[-1], "payout", RULES).fault == fault


def test_a_fixed_window_may_end_with_the_log() -> None:
    assert find_window(cycle(), None, 0.9, 10.0, 5.0, RULES).fault is None


def test_a_cut_payout_must_hold_its_window_and_must_not_have_been_faster_than_its_plateau() -> None:
    cut = Cycle(5.0, 10.0, None, None, False, True)
    late, early = Plateau(0.9, 9.6, 10.0), Plateau(0.9, 7.0, 10.0)
    assert find_window(cut, early, 0.92, 10.0, "auto", RULES).fault is None
    assert find_window(cut, late, 0.92, 10.0, "auto", RULES).fault is not None
    assert find_window(cut, early, 0.93, 10.0, "auto", RULES).fault is not None


def test_a_payout_without_a_plateau_has_no_window_of_its_own() -> None:
    window = find_window(cycle(), None, 0.9, T[-1], "auto", RULES)
    assert (window.cutoff, window.fault) == (17.0, "the payout never holds a plateau speed")


def test_a_payout_that_only_a_gap_indicates_has_no_plateau() -> None:
    assert find_plateau(T, np.full(T.size, -0.2), cycle(), RULES) is None
    assert find_plateau(T, np.zeros(T.size), cycle(), RULES) is None
