"""Phases found on made motions; what a person would say of the profile is what must come out."""

from collections.abc import Sequence

import msgspec
import numpy as np
import pytest

from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import CLOCK, Run
from winchcascade.reduction.phases import Cycle, detect, smoothed_velocity

RULES = built_in().thresholds
DT = 0.04
EARLY = 0.1
"""What smoothing over 0.6 s may move an instant at a kink of the velocity. [s]"""

Piece = tuple[float, float]


def profile(*pieces: Piece) -> np.ndarray:
    """Velocity that goes in straight lines: (seconds, speed at the end) one after the other,
    from rest.
    """
    ends = np.cumsum([0.0, *(seconds for seconds, _ in pieces)])
    speeds = [0.0, *(speed for _, speed in pieces)]
    return np.interp(np.arange(0.0, ends[-1], DT), ends, speeds)


def run_of(v: np.ndarray, *, noise: float = 0.0, seed: int = 1) -> Run:
    t = np.arange(v.size, dtype=np.float64) * DT
    displacement = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * DT)))
    noisy = v + noise * np.random.default_rng(seed).normal(size=v.size)
    return Run("made", t, {"velocity": noisy, "displacement": displacement}, 1 / DT, v.size)


def found_in(run: Run) -> list[Cycle]:
    return detect(run, smoothed_velocity(run, RULES), RULES)


def cycles_of(*pieces: Piece, noise: float = 0.0, seed: int = 1) -> list[Cycle]:
    return found_in(run_of(profile(*pieces), noise=noise, seed=seed))


REST = (5.0, 0.0)
PAYOUT = ((2.0, 0.9), (9.0, 0.9), (1.0, 0.0))
HOLD = (4.0, 0.0)
HAUL_IN = ((1.0, -1.2), (7.0, -1.2), (1.0, 0.0))
CYCLE = (*PAYOUT, HOLD, *HAUL_IN, REST)
JOG = ((0.2, 0.1), (0.6, 0.1), (0.2, 0.0))
"""8 cm at 0.1 m/s: too fast for creep, too short for a payout."""
JOG_BACK = tuple((seconds, -speed) for seconds, speed in JOG)


STOP = ((2, 0.9), (4, 0.9), (0.5, 0), (3, 0), (1, 0.9), (5, 0.9), (1, 0), HOLD)
BACK = (
    (2, 0.9),
    (4, 0.9),
    (0.5, 0),
    (0.3, -0.3),
    (1, -0.3),
    (0.3, 0),
    (1, 0.9),
    (5, 0.9),
    (1, 0),
    HOLD,
)

INSTANTS = {
    "a cycle": ((REST, *CYCLE), 5.07, 16.97, (21.02, 29.98)),
    "creep before": (((1, 0.05), (10, 0.05), (1, 0), REST, *CYCLE), 17.07, 28.97, (33.02, 41.98)),
    "8 % of the top speed is creep": ((REST, (0.2, 0.072), (4.6, 0.072), (0.2, 0), (3, 0), *CYCLE), 13.06, 24.97, (29, 38)),
    "14 % is none": ((REST, (0.2, 0.126), (4.6, 0.126), (0.2, 0), (3, 0), *CYCLE), 5.06, 24.97, (29, 38)),
    "creep back": ((REST, *PAYOUT, HOLD, (0.2, -0.06), (3, -0.06), (0.2, 0), (2, 0), *HAUL_IN), 5.07, 16.97, (26.42, 35.4)),
    "a stop belongs to the payout": ((REST, *STOP, *HAUL_IN, REST), 5.07, 21.47, (25.5, 34.5)),
    "a short reversal belongs to it": ((REST, *BACK, *HAUL_IN, REST), 5.07, 20.07, (24.1, 33.1)),
    "no hold": ((REST, (2, 0.9), (9, 0.9), (0.04, -1.2), (8, -1.2), (1, 0), REST), 5.07, 16.0, (16, 25)),
    "a jog before": ((REST, *JOG, (3, 0), *CYCLE), 9.07, 20.97, (25.02, 34)),
    "jogs long before": ((REST, *(*JOG, (60, 0)) * 4, *CYCLE), 249.07, 260.97, (265, 274)),
    "a jog that the payout follows at once": ((REST, *JOG, (1, 0), *CYCLE), 5.06, 18.97, (23, 32)),
    "jogs after": ((REST, *PAYOUT, HOLD, *JOG, HOLD, *HAUL_IN, REST, *JOG_BACK, REST), 5.07, 16.97, (26, 35)),
    "jogs alone": ((REST, *(*JOG, (3, 0)) * 8), 5.06, 33.94, None),
    "a long stop after a travel": ((REST, (0.5, 0.5), (1, 0.5), (0.5, 0), (30, 0), *CYCLE), 5.03, 48.97, (53, 62)),
}  # fmt: skip
"""Motion, onset and end of its payout, and its haul-in. [s]"""


@pytest.mark.parametrize(
    ("pieces", "onset", "payout_end", "haul_in"), INSTANTS.values(), ids=INSTANTS
)
def test_a_cycle_is_found_with_its_instants(
    pieces: Sequence[Piece], onset: float, payout_end: float, haul_in: tuple[float, float] | None
) -> None:
    (cycle,) = cycles_of(*pieces)
    assert (cycle.onset, cycle.payout_end) == pytest.approx((onset, payout_end), abs=EARLY)
    assert cycle.haul_in == (None if haul_in is None else pytest.approx(haul_in, abs=EARLY))
    end = (profile(*pieces).size - 1) * DT if cycle.haul_in is None else cycle.haul_in[0]
    assert cycle.hold == pytest.approx((cycle.payout_end, end))


@pytest.mark.parametrize("seed", range(3))
def test_noise_about_the_threshold_starts_no_payout(seed: int) -> None:
    (cycle,) = cycles_of(
        (1.0, 0.028), (60.0, 0.028), (1.0, 0.0), REST, *CYCLE, noise=0.01, seed=seed
    )
    assert cycle.onset == pytest.approx(
        62.0 + 5.0 + 0.07, abs=0.15
    )  # the noise is three times a sensor's
    assert cycles_of((60.0, 0.0), noise=0.004, seed=seed) == []


BOUNCE = ((1.0, -1.2), (3.0, -1.2), (0.5, 0.3), (0.5, 0.3), (0.5, -1.2), (4.0, -1.2), (1.0, 0.0))
ABORTED = ((2.0, 0.9), (1.0, 0.9), (1.0, 0.0), HOLD, (1.0, -1.2), (0.8, -1.2), (1.0, 0.0), REST)


def reversed_by(onward: float) -> tuple[Piece, ...]:
    """Back 1.8 m after 9 m, and then onward again. [m]"""
    back = ((0.2, -0.9), (1.8, -0.9), (0.2, 0.0))
    more = ((0.2, 0.9), (onward / 0.9, 0.9), (0.2, 0.0), HOLD)
    return (
        REST,
        (1.0, 0.9),
        (9.0, 0.9),
        (0.2, 0.0),
        *back,
        *more,
        *HAUL_IN,
        (3.0, -1.2),
        (4.0, -1.2),
        (0.5, 0.0),
        REST,
    )


@pytest.mark.parametrize(
    ("pieces", "onsets"),
    [
        ((REST, *CYCLE, *CYCLE, (3600.0, 0.0), *CYCLE), [5, 35, 3665]),
        ((REST, *PAYOUT, HOLD, *BOUNCE, REST, *CYCLE), [5, 37]),
        ((REST, *CYCLE, *ABORTED, *CYCLE), [5, 35, 51]),
        (reversed_by(2.0), [5, 17]),  # a reversal joins only what it is overtaken by
        (reversed_by(4.5), [5]),
        ((REST, *HAUL_IN), []),
    ],
)
def test_every_payout_is_found_in_its_order(pieces: Sequence[Piece], onsets: list[int]) -> None:
    assert [round(c.onset) for c in cycles_of(*pieces, noise=0.004)] == pytest.approx(onsets, abs=1)


@pytest.mark.parametrize(
    ("begin", "end", "begins", "ends"),
    [
        (9.0, 65.0, [True, False], [False, False]),
        (19.0, 65.0, [False], [False]),  # what a log begins with after its payout is no cycle
        (24.0, 65.0, [False], [False]),
        (0.0, 41.0, [False, False], [False, True]),
    ],
)
def test_a_log_that_begins_or_ends_in_a_payout_says_so(
    begin: float, end: float, begins: list[bool], ends: list[bool]
) -> None:
    cycles = found_in(run_of(profile(REST, *CYCLE, *CYCLE)[int(begin / DT) : int(end / DT)]))
    assert ([c.begins_inside for c in cycles], [c.ends_inside for c in cycles]) == (begins, ends)
    assert all(c.hold is None and c.haul_in is None for c in cycles if c.ends_inside)


def without(v: np.ndarray, span: Piece, *, bridged: bool = False, displacement: bool = True) -> Run:
    """A motion whose samples between two instants are missing, or bridged by a straight line of
    the velocity.
    """
    whole = run_of(v)
    lost = (whole.t > span[0]) & (whole.t < span[1])
    gap = np.array([(whole.t[whole.t <= span[0]][-1], whole.t[whole.t >= span[1]][0])])
    if bridged:
        velocity = np.interp(whole.t, whole.t[~lost], v[~lost])
        return msgspec.structs.replace(
            whole, channels={**whole.channels, "velocity": velocity}, gaps={"velocity": gap}
        )
    channels = {
        name: x[~lost] for name, x in whole.channels.items() if displacement or name == "velocity"
    }
    return Run("made", whole.t[~lost], channels, 1 / DT, v.size, gaps={CLOCK: gap})


@pytest.mark.parametrize("bridged", [False, True])
def test_a_gap_over_a_haul_in_from_plateau_to_plateau_parts_two_payouts(bridged: bool) -> None:
    """A straight line over the gap would go on paying out; the displacement shows that the line
    went back.
    """
    longer = ((2.0, 0.9), (20.0, 0.9), (1.0, 0.0), HOLD)
    first, second = found_in(without(profile(REST, *CYCLE, *longer), (14.0, 38.0), bridged=bridged))
    assert (first.onset, second.payout_end) == pytest.approx((5.07, 35.0 + 23.0 - 0.03), abs=EARLY)
    assert first.payout_end == pytest.approx(14.0, abs=1e-9)
    assert second.onset >= 37.9


def test_a_haul_in_that_a_gap_hides_still_parts_two_payouts() -> None:
    assert len(found_in(without(profile(REST, *CYCLE, *CYCLE), (19.0, 31.0)))) == 2
