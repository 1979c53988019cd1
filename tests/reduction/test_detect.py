"""Phases found on made motions; what a person would say of the profile is what must come out."""

from collections.abc import Sequence

import msgspec
import numpy as np
import pytest

from winchcascade.core.rig_file import Thresholds
from winchcascade.core.run import CLOCK, Run
from winchcascade.reduction.phases import Cycle, crossing, detect, smoothed_velocity

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


def without(v: np.ndarray, *spans: tuple[float, float], bridged: bool = False, displacement: bool = True) -> Run:
    """A motion whose samples between two instants are missing, or bridged by a straight line of the velocity."""
    whole = run_of(v)
    lost = np.zeros(v.size, dtype=bool)
    gaps = []
    for a, b in spans:
        lost |= (whole.t > a) & (whole.t < b)
        gaps.append((whole.t[whole.t <= a][-1], whole.t[whole.t >= b][0]))
    channels = {name: x for name, x in whole.channels.items() if displacement or name == "velocity"}
    if bridged:
        kept = np.ones(v.size, dtype=bool)
        channels = {name: np.interp(whole.t, whole.t[~lost], x[~lost]) for name, x in channels.items()}
        channels["displacement"] = whole.channels["displacement"]
    else:
        kept = ~lost
    known = {"velocity" if bridged else CLOCK: np.array(gaps)}
    return Run("made", whole.t[kept], {name: x[kept] for name, x in channels.items()}, 1 / DT, v.size, gaps=known)


def found_in(run: Run) -> list[Cycle]:
    return detect(run, smoothed_velocity(run, RULES), RULES)


@pytest.mark.parametrize("bridged", [False, True])
def test_a_gap_over_a_haul_in_from_plateau_to_plateau_parts_two_payouts(bridged: bool) -> None:
    """A straight line over the gap would go on paying out; the displacement tells that the line went back."""
    longer = ((2.0, 0.9), (20.0, 0.9), (1.0, 0.0), HOLD)
    run = without(profile(REST, *CYCLE, *longer), (14.0, 38.0), bridged=bridged)
    first, second = found_in(run)
    assert first.onset == pytest.approx(5.07, abs=EARLY)
    assert first.payout_end == pytest.approx(14.0, abs=1e-9)
    assert second.onset >= 37.9
    assert second.payout_end == pytest.approx(35.0 + 23.0 - 0.03, abs=EARLY)


@pytest.mark.parametrize("displacement", [True, False])
def test_a_gap_inside_a_payout_leaves_it_one(displacement: bool) -> None:
    (cycle,) = found_in(without(profile(REST, *CYCLE), (10.0, 12.5), displacement=displacement))
    assert cycle.onset == pytest.approx(5.07, abs=EARLY)
    assert cycle.payout_end == pytest.approx(17.0 - 0.03, abs=EARLY)


def test_a_log_that_begins_or_ends_with_a_gap_is_read() -> None:
    v = profile(REST, *CYCLE, (20.0, 0.0))
    for span in ((0.0, 3.0), (32.0, 50.0)):
        (cycle,) = found_in(without(v, span))
        assert cycle.onset == pytest.approx(5.07, abs=EARLY)


@pytest.mark.parametrize(("onward", "payouts"), [(2.0, 2), (4.5, 1)])
def test_a_reversal_joins_only_what_it_is_overtaken_by(onward: float, payouts: int) -> None:
    """Back 1.8 m after 9 m: joined if the line then goes on by more than half as much again."""
    back = ((0.2, -0.9), (1.8, -0.9), (0.2, 0.0))
    v = profile(REST, (1.0, 0.9), (9.0, 0.9), (0.2, 0.0), *back, (0.2, 0.9), (onward / 0.9, 0.9), (0.2, 0.0), HOLD)
    v = np.concatenate((v, profile(*HAUL_IN, (3.0, -1.2), (4.0, -1.2), (0.5, 0.0), REST)))
    assert len(cycles_of(v)) == payouts


def test_what_counts_as_creep_is_measured_against_the_payouts_top_speed() -> None:
    """Before the payout and along it, at 8 and at 14 % of its top speed: the first is creep, the second is not."""
    for speed, begin in ((0.072, 13.0), (0.126, 5.0)):
        v = profile(REST, (0.2, speed), (4.6, speed), (0.2, 0.0), (3.0, 0.0), *CYCLE)
        (cycle,) = cycles_of(v)
        assert cycle.onset == pytest.approx(begin + 0.06, abs=0.2)


def test_the_haul_in_has_creep_of_its_own() -> None:
    v = profile(REST, *PAYOUT, HOLD, (0.2, -0.06), (3.0, -0.06), (0.2, 0.0), (2.0, 0.0), *HAUL_IN, REST)
    (cycle,) = cycles_of(v)
    assert cycle.haul_in is not None
    assert cycle.haul_in[0] == pytest.approx(17.0 + 4.0 + 5.4 + 0.025, abs=0.1)


def test_a_crossing_lies_on_the_line_between_two_samples() -> None:
    t, v = np.array([0.0, 1.0, 3.0, 4.0]), np.array([0.0, 0.2, 0.6, 0.6])
    assert crossing(t, v, 1, 0.05) == pytest.approx(0.25)
    assert crossing(t, v, 2, 0.3) == pytest.approx(1.5)
    assert crossing(t, v, 2, 0.1) == 1.0
    assert crossing(t, v, 2, 0.9) == 3.0
    assert crossing(t, v, 3, 0.3) == 4.0
    assert (crossing(t, v, 0, 0.3), crossing(t, v, -1, 0.3), crossing(t, v, 4, 0.3)) == (0.0, 0.0, 4.0)


def test_a_haul_in_that_follows_at_once_is_one() -> None:
    v = profile(REST, (2.0, 0.9), (9.0, 0.9), (0.04, -1.2), (8.0, -1.2), (1.0, 0.0), REST)
    (cycle,) = cycles_of(v)
    assert cycle.payout_end == pytest.approx(16.0, abs=0.1)
    assert cycle.haul_in == pytest.approx((16.0, 25.0), abs=0.1)


JOG = ((0.2, 0.1), (0.6, 0.1), (0.2, 0.0))
"""8 cm at 0.1 m/s: too fast for creep, too short for a payout."""


@pytest.mark.parametrize("rest", [3.0, 60.0])
@pytest.mark.parametrize("jogs", [1, 4])
def test_jogs_long_before_the_payout_are_no_part_of_it(rest: float, jogs: int) -> None:
    (cycle,) = cycles_of(profile(REST, *(*JOG, (rest, 0.0)) * jogs, *CYCLE), noise=0.004)
    assert cycle.onset == pytest.approx(5.0 + jogs * (1.0 + rest) + 0.07, abs=EARLY)


def test_a_jog_that_the_payout_follows_at_once_belongs_to_it() -> None:
    (cycle,) = cycles_of(profile(REST, *JOG, (1.0, 0.0), *CYCLE))
    assert cycle.onset == pytest.approx(5.0 + 0.06, abs=EARLY)


def test_a_jog_long_after_payout_and_haul_in_is_no_part_of_them() -> None:
    back = tuple((seconds, -speed) for seconds, speed in JOG)
    (cycle,) = cycles_of(profile(REST, *PAYOUT, HOLD, *JOG, HOLD, *HAUL_IN, REST, *back, REST))
    assert cycle.payout_end == pytest.approx(17.0 - 0.03, abs=EARLY)
    assert cycle.haul_in == pytest.approx((26.0, 35.0), abs=0.1)


def test_a_payout_made_of_jogs_alone_begins_with_the_first() -> None:
    (cycle,) = cycles_of(profile(REST, *(*JOG, (3.0, 0.0)) * 8))
    assert cycle.onset == pytest.approx(5.0 + 0.06, abs=EARLY)
    assert cycle.payout_end == pytest.approx(5.0 + 7 * 4.0 + 0.94, abs=EARLY)


def test_a_stop_after_a_travel_of_its_own_belongs_to_the_payout_however_long() -> None:
    (cycle,) = cycles_of(profile(REST, (0.5, 0.5), (1.0, 0.5), (0.5, 0.0), (30.0, 0.0), *CYCLE))
    assert cycle.onset == pytest.approx(5.0 + 0.03, abs=EARLY)


def test_a_payout_of_which_a_gap_hides_all_but_jogs_is_found() -> None:
    jog = ((0.2, 0.3), (0.3, 0.3), (0.2, 0.0))
    v = profile((5.0, 0.0), *jog, (12.0, 0.0), *jog, (5.0, 0.0), (1.0, -0.7), (2.0, -0.7), (1.0, 0.0), (2.0, 0.0))
    run = run_of(v)
    hidden = (9.5, 13.5)
    moved = run.channels["displacement"] + np.interp(run.t, hidden, (0.0, 1.0))
    holed = msgspec.structs.replace(
        run, channels={"velocity": v, "displacement": moved}, gaps={CLOCK: np.array([hidden])}
    )
    (cycle,) = detect(holed, smoothed_velocity(holed, Thresholds()), Thresholds())
    assert cycle.onset < 6.0
    assert cycle.payout_end > 17.0
