"""Phases found on made motions; what a person would say of the profile is what must come out."""

from collections.abc import Sequence

import numpy as np
import pytest

from winchcascade.phases.detect import Cycle, detect, smoothed_velocity
from winchcascade.rigfile import Thresholds
from winchcascade.run import CLOCK, Run

RULES = Thresholds()
DT = 0.04
EARLY = 0.06
"""What smoothing over 0.6 s may move an instant at a kink of the velocity. [s]"""


def profile(*pieces: tuple[float, float]) -> np.ndarray:
    """Velocity that goes in straight lines: (seconds, speed at the end) one after the other, from rest."""
    ends = np.cumsum([0.0, *(seconds for seconds, _ in pieces)])
    speeds = [0.0, *(speed for _, speed in pieces)]
    return np.interp(np.arange(0.0, ends[-1], DT), ends, speeds)


def run_of(v: np.ndarray, *, noise: float = 0.0, seed: int = 1, gaps: Sequence[tuple[float, float]] = ()) -> Run:
    t = np.arange(v.size, dtype=np.float64) * DT
    displacement = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * DT)))
    noisy = v + noise * np.random.default_rng(seed).normal(size=v.size)
    known = {CLOCK: np.array(gaps)} if gaps else {}
    return Run("made", t, {"velocity": noisy, "displacement": displacement}, 1 / DT, v.size, gaps=known)


def cycles_of(v: np.ndarray, *, noise: float = 0.0, seed: int = 1) -> list[Cycle]:
    run = run_of(v, noise=noise, seed=seed)
    return detect(run, smoothed_velocity(run, RULES), RULES)


REST = (5.0, 0.0)
PAYOUT = ((2.0, 0.9), (9.0, 0.9), (1.0, 0.0))
HOLD = (4.0, 0.0)
HAUL_IN = ((1.0, -1.2), (7.0, -1.2), (1.0, 0.0))
CYCLE = (*PAYOUT, HOLD, *HAUL_IN, REST)


def test_payout_begins_where_the_line_first_passes_the_onset_speed() -> None:
    (cycle,) = cycles_of(profile(REST, *CYCLE))
    assert cycle.onset == pytest.approx(5.0 + 0.03 / 0.45, abs=EARLY)
    assert cycle.payout_end == pytest.approx(5.0 + 12.0 - 0.03 / 0.9, abs=EARLY)


def test_hold_lies_between_payout_and_haul_in() -> None:
    (cycle,) = cycles_of(profile(REST, *CYCLE))
    assert cycle.haul_in is not None
    assert cycle.hold == (cycle.payout_end, cycle.haul_in[0])
    assert cycle.haul_in == pytest.approx((21.0 + 0.03 / 1.2, 30.0 - 0.03 / 1.2), abs=EARLY)


@pytest.mark.parametrize("seed", range(5))
def test_noise_about_the_threshold_starts_no_payout(seed: int) -> None:
    creeping = profile((1.0, 0.028), (60.0, 0.028), (1.0, 0.0), REST, *CYCLE)
    (cycle,) = cycles_of(creeping, noise=0.01, seed=seed)
    assert cycle.onset == pytest.approx(62.0 + 5.0 + 0.07, abs=0.15)  # the noise is three times a sensor's


def test_crane_creep_apart_from_the_payout_is_no_part_of_it() -> None:
    v = profile((1.0, 0.05), (10.0, 0.05), (1.0, 0.0), REST, *CYCLE)
    (cycle,) = cycles_of(v)
    assert cycle.onset == pytest.approx(17.0 + 0.07, abs=EARLY)


def test_a_stop_belongs_to_the_payout() -> None:
    v = profile(
        REST, (2.0, 0.9), (4.0, 0.9), (0.5, 0.0), (3.0, 0.0), (1.0, 0.9), (5.0, 0.9), (1.0, 0.0), HOLD, *HAUL_IN, REST
    )
    (cycle,) = cycles_of(v)
    assert cycle.payout_end == pytest.approx(5.0 + 16.5, abs=0.1)


def test_a_short_reversal_belongs_to_the_payout() -> None:
    back = ((0.5, 0.0), (0.3, -0.3), (1.0, -0.3), (0.3, 0.0), (1.0, 0.9))
    v = profile(REST, (2.0, 0.9), (4.0, 0.9), *back, (5.0, 0.9), (1.0, 0.0), HOLD, *HAUL_IN, REST)
    (cycle,) = cycles_of(v)
    assert cycle.payout_end == pytest.approx(5.0 + 15.1, abs=0.1)


def test_a_short_bounce_belongs_to_the_haul_in() -> None:
    bounce = ((1.0, -1.2), (3.0, -1.2), (0.5, 0.3), (0.5, 0.3), (0.5, -1.2), (4.0, -1.2), (1.0, 0.0))
    v = profile(REST, *PAYOUT, HOLD, *bounce, REST, *CYCLE)
    cycles = cycles_of(v)
    assert len(cycles) == 2
    assert cycles[0].haul_in is not None
    assert cycles[0].haul_in[1] - cycles[0].haul_in[0] == pytest.approx(10.5, abs=0.1)


def test_an_aborted_payout_that_is_hauled_in_is_a_cycle_of_its_own() -> None:
    aborted = ((2.0, 0.9), (1.0, 0.9), (1.0, 0.0), HOLD, (1.0, -1.2), (0.8, -1.2), (1.0, 0.0), REST)
    assert len(cycles_of(profile(REST, *CYCLE, *aborted, *CYCLE))) == 3


def test_every_cycle_is_found_in_its_order() -> None:
    cycles = cycles_of(profile(REST, *CYCLE, *CYCLE, (3600.0, 0.0), *CYCLE), noise=0.004)
    assert [round(c.onset) for c in cycles] == [5, 35 + 0, 65 + 3600]


def test_a_log_that_begins_in_a_payout_says_so() -> None:
    v = profile(REST, *CYCLE, *CYCLE)[int(9.0 / DT) :]
    cycles = cycles_of(v)
    assert [c.begins_inside for c in cycles] == [True, False]
    assert cycles[0].onset == 0.0


@pytest.mark.parametrize("into", [19.0, 24.0])
def test_what_a_log_begins_with_after_its_payout_is_no_cycle(into: float) -> None:
    assert len(cycles_of(profile(REST, *CYCLE, *CYCLE)[int(into / DT) :])) == 1


def test_a_log_that_ends_in_a_payout_says_so() -> None:
    v = profile(REST, *CYCLE, *CYCLE)[: int((35.0 + 6.0) / DT)]
    cycles = cycles_of(v)
    assert [c.ends_inside for c in cycles] == [False, True]
    assert cycles[1].hold is None
    assert cycles[1].haul_in is None


def test_a_cycle_whose_haul_in_is_not_logged_is_held_to_the_end() -> None:
    v = profile(REST, *PAYOUT, HOLD)
    (cycle,) = cycles_of(v)
    assert cycle.haul_in is None
    assert cycle.hold == (cycle.payout_end, (v.size - 1) * DT)


def test_a_line_that_never_pays_out_has_no_cycle() -> None:
    assert cycles_of(profile((60.0, 0.0)), noise=0.004) == []
    assert cycles_of(profile(REST, *HAUL_IN)) == []


def test_a_haul_in_that_was_not_logged_still_parts_two_payouts() -> None:
    v = profile(REST, *CYCLE, *CYCLE)
    kept = np.ones(v.size, dtype=bool)
    kept[int(19.0 / DT) : int(31.0 / DT)] = False
    whole = run_of(v)
    t = whole.t[kept]
    gap = (t[int(19.0 / DT) - 1], t[int(19.0 / DT)])
    channels = {name: x[kept] for name, x in whole.channels.items()}
    run = Run("made", t, channels, 1 / DT, t.size, gaps={CLOCK: np.array([gap])})
    assert len(detect(run, smoothed_velocity(run, RULES), RULES)) == 2
