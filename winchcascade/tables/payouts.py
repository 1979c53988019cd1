"""Attainable ranges of the efficiencies of one row of a published table, over all plausible
payouts.

A row prints what its payouts put in and gave out, so their speed follows; how the line sped up, and
from where, does not. Every plausible payout that gives a printed power is simulated, over the
window that energy and power imply, and reduced by the same rules as a log. The tolerances of the
numbers and sensors of the rig widen the interval.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from statistics import median
from typing import Literal

import msgspec
import numpy as np

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run
from winchcascade.core.scales import motion_of_runs, scales_of
from winchcascade.diagnosis.fit.nuisances import nuisances
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.reduction.reduce import first_metrics
from winchcascade.rig.baseline import baseline
from winchcascade.rig.kernel import LineMotion
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import motion_of, simulate_along
from winchcascade.tables.feasible import STAGES
from winchcascade.tables.published_table import PublishedTable, Span, TableRow

OWN = 1e-3
"""Uncertainty of the attainable range itself: it is taken from few payouts, with an effect from
the middle one alone. [1]
"""

WINDOWS = (0.2, 600.0)
"""Windows of payouts lie between these: anything else is a slip in the table. [s]"""

RATE = 25.0
"""Samples of a payout in a second. [Hz]"""

STEP = 1e-3
"""Step of these simulations: half of it changes no efficiency by more than 0.0001. [s]"""

REST, FLAT, BRAKE = 1.0, 0.5, 0.6
"""Before the ramp, between window and braking, and braking. [s]"""

ONSET_MAX = 0.5
"""Share of the ramp before which the window begins: the onset speed is far below that of any
payout. [1]
"""

RAMPS = (0.6, 0.25, 0.95)
"""How long the line speeds up, as shares of the window; the first is the middle one. [1]"""

USUAL_WINDOW = 6.0
"""Window by which ramps are made where the table gives none, about that of the paper. [s]"""

STARTED = 1.0
"""Payout at the start where the haul-in before has left some of the line out. [m]"""

CLOSE = 2e-3
"""A printed power is met within this share, which moves no efficiency by 0.0001. [1]"""

NEAR, APART = 0.015, 0.25
"""Of two payouts whose powers are no further apart, and one of them as near to the printed one, a
straight line gives the efficiencies to 0.0001. Logarithms of powers. [1]"""

SLOPE = 1.85
"""Powers grow about with such a power of the speed. [1]"""

FASTEST = 20.0
"""No line is pulled faster. [m/s]"""

TRIES = 12


class Payout(msgspec.Struct, frozen=True):
    """One payout: how long the line speeds up [s], as 3 u^2 - 2 u^3 or evenly, what is paid out at
    its start [m], and the window [s], None for the rule of the rig.
    """

    ramp: float
    shape: Literal["smooth", "straight"]
    start: float
    window: float | None


class PayoutMetrics(msgspec.Struct, frozen=True):
    """The nine metrics of a model along a payout of some plateau speed [m/s], SI units."""

    speed: float
    metrics: Mapping[str, float | None]


class Cell(msgspec.Struct, frozen=True):
    """One efficiency of a row beside its attainable range. [1]

    `printed` stands for every value within `allowed` of it: rounding, the error of the mean of so
    few cycles, and `OWN`. `derived` marks one that is not printed itself but the ratio of two
    printed energies or powers. `nominal` is that of the middle payout, `low` and `high` are the
    ends over all payouts and the tolerances, each number off by one standard uncertainty; `u` is
    what these add at either end.
    """

    metric: str
    printed: float
    allowed: float
    derived: bool
    nominal: float
    low: float
    high: float
    u: float

    @property
    def gap(self) -> float:
        """How far the printed value lies above (positive) or below (negative) the attainable
        range; 0 within it. [1]
        """
        return max(self.printed - self.high, 0.0) + min(self.printed - self.low, 0.0)

    @property
    def outside(self) -> bool:
        """Whether what is allowed does not bridge the gap."""
        return abs(self.gap) > self.allowed


class AttainableRow(msgspec.Struct, frozen=True):
    """One row: its window [s] (None: by the rig's rule), the plateau speeds that its powers imply
    [m/s], its efficiencies.

    `payout` is the middle one, `speed` its plateau [m/s]; a change of the model keeps to `target`,
    a printed power or energy.
    """

    load: float
    window: float | None
    speeds: Span
    cells: tuple[Cell, ...]
    payout: Payout
    speed: float
    target: tuple[str, float]


class NotJudged(msgspec.Struct, frozen=True):
    """A row that cannot be held against the rig, and why."""

    load: float
    reason: str


# ------------------------------------------------------------------------------------- one payout
def payouts(window: float | None) -> list[Payout]:
    """Payouts that are plausible for a window, the middle one first."""
    ramps = [share * (window or USUAL_WINDOW) for share in RAMPS]
    kinds: tuple[tuple[Literal["smooth", "straight"], float], ...] = (
        ("smooth", 0.0), ("straight", 0.0), ("smooth", STARTED),
    )  # fmt: skip
    return [Payout(ramp, shape, start, window) for shape, start in kinds for ramp in ramps]


@lru_cache(maxsize=256)
def _at_unit_speed(payout: Payout) -> tuple[Run, LineMotion]:
    """A payout at 1 m/s, to which all motion is proportional: rest, ramp, plateau past the end
    of the window, braking.
    """
    flat = (
        REST
        + max(payout.ramp, ONSET_MAX * payout.ramp + (payout.window or payout.ramp + 1.0))
        + FLAT
    )
    t = np.arange(0.0, flat + BRAKE + FLAT, 1.0 / RATE)
    u = np.clip((t - REST) / payout.ramp, 0.0, 1.0)
    v = (u if payout.shape == "straight" else u * u * (3.0 - 2.0 * u)) * (
        1.0 - np.clip((t - flat) / BRAKE, 0.0, 1.0)
    )
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) / RATE)))
    run = Run("a payout", t, {"displacement": x, "velocity": v}, RATE, t.size)
    return run, motion_of(run, STEP, motion_of_runs([run]))


def simulated(model: Model, payout: Payout, speed: float, load: float) -> Run:
    """The log that a model gives along a payout."""
    run, motion = _at_unit_speed(payout)
    channels = {
        "displacement": payout.start + speed * run.channels["displacement"],
        "velocity": speed * run.channels["velocity"],
    }
    run = msgspec.structs.replace(run, channels=channels, load=load, load_source="the table")
    along = motion._replace(
        x=payout.start + speed * motion.x, v=speed * motion.v, a=speed * motion.a
    )
    return simulate_along(run, model, along).run


def measure(
    rig: Rig, model: Model, payout: Payout, speed: float, load: float
) -> PayoutMetrics | None:
    """The metrics of a model along a payout, by the rules of any log; None where the model
    cannot follow it.
    """
    try:
        return PayoutMetrics(
            speed, first_metrics(simulated(model, payout, speed, load), rig, payout.window)
        )
    except WinchcascadeError:
        return None


def meet(
    rig: Rig, model: Model, payout: Payout, load: float, target: tuple[str, float], guess: float
) -> PayoutMetrics | None:
    """Find the plateau speed at which a payout gives a printed power or energy; None where none
    does.

    Parameters
    ----------
    target : metric and its value, SI units
    guess : of the speed [m/s]
    """
    (metric, wanted), speed, before = target, guess, None
    for _ in range(TRIES):
        here = measure(rig, model, payout, speed, load)
        if here is None or speed > FASTEST:
            return None
        value = here.metrics[metric]
        if value is None or value <= 0.0:
            speed, before = 2.0 * speed, None
            continue
        miss, slope = math.log(wanted / value), SLOPE
        if abs(miss) < CLOSE:
            return here
        if before is not None:
            rise = math.log(value / (before.metrics[metric] or value))
            if abs(miss) < NEAR and abs(miss) < abs(rise) < APART:
                return _between(before, here, miss / rise)
            slope = rise / math.log(speed / before.speed)
        before = here
        speed *= math.exp(min(max(miss / min(max(slope, 0.5), 4.0), -1.0), 1.0))
    return None


def _between(one: PayoutMetrics, other: PayoutMetrics, further: float) -> PayoutMetrics:
    """A point beyond the second by a share of the step from the first; efficiencies are straight
    enough over that.
    """
    pairs = {name: (one.metrics[name], value) for name, value in other.metrics.items()}
    return PayoutMetrics(
        other.speed + further * (other.speed - one.speed),
        {
            name: None if a is None or b is None else b + further * (b - a)
            for name, (a, b) in pairs.items()
        },
    )


# ---------------------------------------------------------------------------------- one table row
def attainable_row(
    table: PublishedTable, row: TableRow, window: float | None, rig: Rig, scatter: float
) -> AttainableRow | NotJudged:
    """Simulate every plausible payout of one row, and hold its efficiencies against them.

    Parameters
    ----------
    window : of the row [s]; None for the rig's own rule
    scatter : maximum deviation of a cycle's efficiency from the mean, as a share of it [1]
    """
    load = math.inf if row.load is None else row.load
    printed, targets = printed_efficiencies(row), _targets(row)
    if not printed:
        return NotJudged(
            load,
            "it prints no efficiency that its load has, nor two energies or powers to make one of",
        )
    if window is not None and not WINDOWS[0] <= window <= WINDOWS[1]:
        return NotJudged(
            load, f"energy over power gives a window of {window:.3g} s, which no payout has"
        )
    if not targets:
        return NotJudged(
            load, "it prints no power or energy, so that the speed of the line is unknown"
        )
    points = [point for payout in payouts(window) for point in _points(rig, load, payout, targets)]
    middle, whole = points[0], [point for point in points if point is not None]
    if middle is None:
        metric, value = targets[0]
        return NotJudged(
            load,
            f"no payout of this rig gives the printed {metric} of {value:.5g}, whatever its speed",
        )
    u = _standard_uncertainties(rig, load, payouts(window)[0], middle)
    cells = []
    for eta, (span, derived) in printed.items():
        value, found = (
            0.5 * (span.low + span.high),
            [x for point in whole if (x := point.metrics[eta]) is not None],
        )
        by_scatter = (
            value * scatter / math.sqrt(table.cycles or 1)
        )  # 2 u: the maximum deviation counts as two of a cycle
        slack = 0.5 * (span.high - span.low) + by_scatter + OWN
        nominal = middle.metrics[eta] or 0.0
        cells.append(
            Cell(
                eta,
                value,
                slack,
                derived,
                nominal,
                min(found) - u[eta],
                max(found) + u[eta],
                u[eta],
            )
        )
    speeds = Span(min(point.speed for point in whole), max(point.speed for point in whole))
    return AttainableRow(
        load, window, speeds, tuple(cells), payouts(window)[0], middle.speed, targets[0]
    )


def printed_efficiencies(row: TableRow) -> dict[str, tuple[Span, bool]]:
    """Efficiencies that a row prints, or that follow from two of its energies or powers; in open
    circuit eta_trans alone.

    Each with the interval of its rounding, and whether it is the ratio of two other cells. [1]
    """
    spans, found = row.spans, {}
    for eta, pair in RATIOS.items():
        kinds = ([name.replace("energy", kind) for name in pair] for kind in ("energy", "power"))
        ratios = [
            spans[o].over(spans[i])
            for o, i in kinds
            if o in spans and i in spans and spans[i].low > 0.0
        ]
        span = spans[eta] if eta in spans else ratios[0] if ratios else None
        if span is not None and (row.load != math.inf or eta == "eta_trans"):
            found[eta] = (span, eta not in spans)
    return found


def row_windows(table: PublishedTable) -> tuple[list[float | None], tuple[str, ...]]:
    """Window of each row [s], from its energies and powers; a row without one takes that of the
    others, with a note.
    """
    known: list[float | None] = []
    for spans in (row.spans for row in table.rows):
        pairs = (
            (spans[f"energy_{s}"], spans[f"power_{s}"])
            for s in STAGES
            if {f"energy_{s}", f"power_{s}"} <= set(spans)
        )
        known.append(
            next(((e.low + e.high) / (p.low + p.high) for e, p in pairs if p.low > 0.0), None)
        )
    lengths = [
        seconds for seconds in known if seconds is not None and WINDOWS[0] <= seconds <= WINDOWS[1]
    ]
    lacking = [row.name for row, seconds in zip(table.rows, known, strict=True) if seconds is None]
    if not lacking:
        return known, ()
    if not lengths:
        return known, (
            "no window follows from the table: the rig's own rule is taken, with ramps of a "
            "window of 6 s",
        )
    usual = median(lengths)
    note = (
        f"no window follows for {', '.join(lacking)}: {usual:.4g} s is taken, as in the other rows"
    )
    return [usual if seconds is None else seconds for seconds in known], (note,)


def _targets(row: TableRow) -> list[tuple[str, float]]:
    """Powers that a row prints, or energies where it prints none; in open circuit the DC link
    gives none.
    """
    middles = {name: 0.5 * (span.low + span.high) for name, span in row.spans.items()}
    stages = STAGES[:2] if row.load == math.inf else STAGES
    powers, energies = (
        [
            (name, middles[name])
            for stage in stages
            if middles.get(name := f"{kind}_{stage}", 0.0) > 0.0
        ]
        for kind in ("power", "energy")
    )
    return powers or energies


def _points(
    rig: Rig, load: float, payout: Payout, targets: Sequence[tuple[str, float]]
) -> list[PayoutMetrics | None]:
    """One payout at the speeds at which it gives each of the printed powers."""
    guess, points = 1.0, list[PayoutMetrics | None]()
    for target in targets:
        points.append(point := meet(rig, baseline(rig), payout, load, target, guess))
        guess = guess if point is None else point.speed
    return points


def _standard_uncertainties(
    rig: Rig, load: float, payout: Payout, middle: PayoutMetrics
) -> dict[str, float]:
    """Standard uncertainty of each efficiency by the rig's numbers and its sensors, each moved
    by its own. [1]
    """
    square = dict.fromkeys(RATIOS, 0.0)
    for model in _within_tolerance(rig, simulated(baseline(rig), payout, middle.speed, load)):
        found = measure(rig, model, payout, middle.speed, load) or middle
        for metric in RATIOS:
            here, there = middle.metrics[metric], found.metrics[metric]
            if here is not None and there is not None:
                square[metric] += (there - here) ** 2
    return {metric: math.sqrt(value) for metric, value in square.items()}


def _within_tolerance(rig: Rig, run: Run) -> Iterator[Model]:
    """The model with one number at a time changed by one standard uncertainty; the time at which
    channels are read moves no energy.
    """
    nominal = baseline(rig)
    for number in nuisances(rig, [run], scales_of(rig, motion_of_runs([run]))):
        model = number.apply(nominal, number.sd) if number.kind != "law" else nominal
        if model != nominal:
            yield model
