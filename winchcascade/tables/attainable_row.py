"""Attainable ranges of the efficiencies of one row of a published table, over all plausible payouts.

A row prints what its payouts put in and gave out, so their speed follows; how the line sped up, and from where, does not.
Every plausible payout that gives a printed power is simulated, over the window that energy and power imply, and reduced by
the same rules as a log. The tolerances of the numbers and sensors of the rig widen the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from statistics import median
from typing import Literal

import msgspec
import numpy as np

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.published_table import PublishedTable, Span, TableRow, load_text
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.nuisances import nuisances, shifted
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.rig.baseline import baseline
from winchcascade.rig.kernel import LineMotion
from winchcascade.rig.parts import Model, changed
from winchcascade.rig.simulate import motion_of, simulate_along
from winchcascade.tables.feasible import STAGES

COVERAGE = 2.0
"""Standard uncertainties that a limit allows: about 95 % (JCGM 100:2008, 6.3.3)."""

OWN = 1e-3
"""Uncertainty of the attainable range itself: it is taken from few payouts, with an effect from the middle one alone. [1]"""

WINDOWS = (0.2, 600.0)
"""Windows of payouts lie between these: anything else is a slip in the table. [s]"""

SPEEDS = (1.0, 0.5, 0.75, 1.25, 1.5)
"""Plateau speeds of a row without power and energy, as shares of the rated speed; the first is the middle one. [1]"""

Reduce = Callable[[Run, float | None], Mapping[str, float | None]]
"""Reduces a log over windows of a length [s], or by the rig's own rule without one, to its nine metrics, SI units."""

RATE = 25.0
"""Samples of a payout in a second. [Hz]"""

STEP = 1e-3
"""Step of these simulations: half of it changes no efficiency by more than 0.0001. [s]"""

REST, FLAT, BRAKE = 1.0, 0.5, 0.6
"""Before the ramp, between window and braking, and braking. [s]"""

RAMPS = (0.6, 0.25, 0.95)
"""How long the line speeds up, as shares of the window; the first is the middle one. [1]"""

OPEN_RAMPS = (3.0, 1.0, 6.0)
"""How long it does where no window is known. [s]"""

Shape = Literal["smooth", "straight"]
"""How the line speeds up: as 3 u^2 - 2 u^3, or evenly."""

STARTED = 1.0
"""Payout at the start where the haul-in before has left some of the line out. [m]"""

CLOSE = 2e-3
"""A printed power is met within this share, which moves no efficiency by 0.0001. [1]"""

NEAR, APART = 0.015, 0.25
"""Of two payouts whose powers are no further apart, and one of them as near to the printed one, a straight line gives the
efficiencies to 0.0001. Logarithms of powers. [1]"""

SLOPE = 1.85
"""Powers grow about with such a power of the speed. [1]"""

FASTEST = 20.0
"""No line is pulled faster. [m/s]"""

TRIES = 12


class Payout(msgspec.Struct, frozen=True):
    """One payout: how long the line speeds up [s] and by which curve, what is paid out at its start [m], the window [s] and the
    speed at which that begins [m/s].
    """

    ramp: float
    shape: Shape
    start: float
    window: float | None
    v_onset: float


class PayoutMetrics(msgspec.Struct, frozen=True):
    """The nine metrics of a model along a payout of some plateau speed [m/s], SI units."""

    speed: float
    metrics: Mapping[str, float | None]


class Target(msgspec.Struct, frozen=True):
    """A printed power or energy that a payout has to give, SI units."""

    metric: str
    value: float


def payouts(window: float | None, v_onset: float) -> tuple[Payout, ...]:
    """Payouts that are plausible for a window, the middle one first."""
    ramps = [window * share for share in RAMPS] if window is not None else OPEN_RAMPS
    kinds: tuple[tuple[Shape, float], ...] = (("smooth", 0.0), ("straight", 0.0), ("smooth", STARTED))
    return tuple(Payout(ramp, shape, start, window, v_onset) for shape, start in kinds for ramp in ramps)


def drive(payout: Payout, speed: float, load: float) -> tuple[Run, LineMotion]:
    """A log of one payout (rest, ramp, plateau past the end of the window, braking) and the motion that drives a model."""
    u = np.linspace(0.0, 1.0, 101)
    onset = float(np.interp(payout.v_onset / speed, _rise(payout, u), u))
    run, motion = _unit(payout, math.ceil(10.0 * onset) / 10.0)
    channels = {
        "displacement": payout.start + speed * run.channels["displacement"],
        "velocity": speed * run.channels["velocity"],
    }
    return (
        msgspec.structs.replace(run, channels=channels, load=load, load_source="the table"),
        motion._replace(x=payout.start + speed * motion.x, v=speed * motion.v, a=speed * motion.a),
    )


def _rise(payout: Payout, u: Signal) -> Signal:
    """Speed along the ramp, 0 to 1 over 0 to 1."""
    return u if payout.shape == "straight" else u * u * (3.0 - 2.0 * u)


@lru_cache(maxsize=256)
def _unit(payout: Payout, onset: float) -> tuple[Run, LineMotion]:
    """Make a payout at 1 m/s, to which all motion is proportional; its window begins after such a share of the ramp."""
    flat = REST + max(payout.ramp, onset * payout.ramp + (payout.window or payout.ramp + 1.0)) + FLAT
    t = np.arange(0.0, flat + BRAKE + FLAT, 1.0 / RATE)
    v = _rise(payout, np.clip((t - REST) / payout.ramp, 0.0, 1.0)) * (1.0 - np.clip((t - flat) / BRAKE, 0.0, 1.0))
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) / RATE)))
    run = Run("a payout", t, {"displacement": x, "velocity": v}, RATE, t.size)
    return run, motion_of(run, STEP)


def measure(reduce: Reduce, model: Model, payout: Payout, speed: float, load: float) -> PayoutMetrics | None:
    """The metrics of a model along a payout; None where the model cannot follow it."""
    run, motion = drive(payout, speed, load)
    try:
        return PayoutMetrics(speed, reduce(simulate_along(run, model, motion).run, payout.window))
    except WinchcascadeError:
        return None


def meet(
    reduce: Reduce, model: Model, payout: Payout, load: float, target: Target, guess: float
) -> PayoutMetrics | None:
    """Find the plateau speed at which a payout gives a printed power or energy; None where none does.

    Parameters
    ----------
    guess : of the speed [m/s]
    """
    speed, before = guess, None
    for _ in range(TRIES):
        here = measure(reduce, model, payout, speed, load)
        if here is None:
            return None
        value = here.metrics[target.metric]
        if value is None or value <= 0.0:
            speed, before = 2.0 * speed, None
        else:
            miss, slope = math.log(target.value / value), SLOPE
            if abs(miss) < CLOSE:
                return here
            if before is not None and before[1].speed != speed:
                rise = math.log(value) - before[0]
                if abs(miss) < NEAR and abs(miss) < abs(rise) < APART:
                    return _between(before[1], here, miss / rise)
                slope = rise / (math.log(speed) - math.log(before[1].speed))
            before = (math.log(value), here)
            speed *= math.exp(min(max(miss / min(max(slope, 0.5), 4.0), -1.0), 1.0))
        if speed > FASTEST:
            return None
    return None


def _between(one: PayoutMetrics, other: PayoutMetrics, further: float) -> PayoutMetrics:
    """A point beyond the second by a share of the step from the first; efficiencies are straight enough over that."""
    pairs = {name: (one.metrics[name], value) for name, value in other.metrics.items()}
    return PayoutMetrics(
        other.speed + further * (other.speed - one.speed),
        {name: None if a is None or b is None else b + further * (b - a) for name, (a, b) in pairs.items()},
    )


class Cell(msgspec.Struct, frozen=True):
    """One efficiency of a row beside its attainable range. [1]

    `printed` stands for every value within `allowed` of it: rounding, the error of the mean of so few cycles, and `OWN`.
    `derived` marks one that is not printed itself but the ratio of two printed energies or powers. `nominal` is that of the
    middle payout, `low` and `high` are the ends over all payouts and the tolerances, each number off by one standard
    uncertainty; `u` is what these add at either end.
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
        """How far the printed value lies above (positive) or below (negative) the attainable range; 0 within it. [1]"""
        return max(self.printed - self.high, 0.0) + min(self.printed - self.low, 0.0)

    @property
    def outside(self) -> bool:
        """Whether what is allowed does not bridge the gap."""
        return abs(self.gap) > self.allowed


class AttainableRow(msgspec.Struct, frozen=True):
    """One row: its window [s] (None: by the rig's rule), the plateau speeds that its powers imply [m/s], its efficiencies.

    `payout` is the middle one, `speed` its plateau [m/s]; a change of the model keeps to `target`, if the row prints one.
    """

    load: float
    window: float | None
    speeds: Span
    cells: tuple[Cell, ...]
    payout: Payout
    speed: float
    target: Target | None


class NotJudged(msgspec.Struct, frozen=True):
    """A row, or a cell of it, that cannot be held against the rig, and why."""

    load: float
    reason: str


def bounds_of_row(
    table: PublishedTable, row: TableRow, window: float | None, rig: Rig, reduce: Reduce, scatter: float
) -> AttainableRow | NotJudged:
    """Simulate every plausible payout of one row, and hold its efficiencies against them.

    Parameters
    ----------
    window : of the row [s]; None for the rig's own rule
    scatter : largest deviation of a cycle's efficiency from the mean, as a share of it [1]
    """
    wanted = printed_efficiencies(table, row)
    if not wanted:
        return NotJudged(
            row.load,
            "it prints no eta_trans, all that is an efficiency there"
            if math.isinf(row.load)
            else "it prints no efficiency, nor two energies or powers to make one of",
        )
    if window is not None and not WINDOWS[0] <= window <= WINDOWS[1]:
        return NotJudged(row.load, f"energy over power gives a window of {window:.3g} s, which is no payout's")
    kinds, targets = payouts(window, rig.thresholds.v_onset), _targets(table, row)
    if not targets and rated_speed(rig) is None:
        return NotJudged(
            row.load, "it prints no power or energy, and the rig file no speed_rated, so the line's speed is unknown"
        )
    points = [point for kind in kinds for point in _points(reduce, rig, row.load, kind, targets)]
    middle, whole = points[0], [point for point in points if point is not None]
    if middle is None:
        printed = "efficiencies at its rated speed"
        if targets:
            unit = "W" if targets[0].metric.startswith("power") else "J"
            printed = f"{targets[0].metric} of {targets[0].value:.5g} {unit}, whatever its speed"
        return NotJudged(row.load, f"no payout of this rig gives the printed {printed}")
    u = _standard_uncertainties(reduce, rig, row.load, kinds[0], middle)
    speeds = Span(min(point.speed for point in whole), max(point.speed for point in whole))
    cells = []
    for eta, (span, derived) in wanted.items():
        printed_eta, found = 0.5 * (span.low + span.high), [v for p in whole if (v := p.metrics[eta]) is not None]
        by_scatter = COVERAGE * printed_eta * standard_error(scatter, table.cycles)
        cells.append(
            Cell(
                metric=eta,
                printed=printed_eta,
                allowed=0.5 * (span.high - span.low) + by_scatter + OWN,
                derived=derived,
                nominal=middle.metrics[eta] or 0.0,
                low=min(found) - u[eta],
                high=max(found) + u[eta],
                u=u[eta],
            )
        )
    return AttainableRow(
        row.load, window, speeds, tuple(cells), kinds[0], middle.speed, targets[0] if targets else None
    )


def standard_error(scatter: float, cycles: int | None) -> float:
    """Standard uncertainty of the mean of some cycles, as a share: their largest deviation counts as two of a cycle. [1]

    >>> round(standard_error(0.025, 3), 4)
    0.0072
    """
    return 0.5 * scatter / math.sqrt(cycles or 1)


def printed_efficiencies(table: PublishedTable, row: TableRow) -> dict[str, tuple[Span, bool]]:
    """Efficiencies that a row prints, or that follow from two of its energies or powers; in open circuit eta_trans alone.

    Each with the interval of its rounding, and whether it is the ratio of two other cells. [1]
    """
    spans, found = table.spans(row), {}
    for eta, (out, into) in RATIOS.items():
        ratios = [
            spans[part].over(spans[of])
            for part, of in ((out, into), (out.replace("energy", "power"), into.replace("energy", "power")))
            if part in spans and of in spans and spans[of].low > 0.0
        ]
        span = spans[eta] if eta in spans else ratios[0] if ratios else None
        if span is not None and (not math.isinf(row.load) or eta == "eta_trans"):
            found[eta] = (span, eta not in spans)
    return found


def row_windows(table: PublishedTable) -> tuple[dict[float, float | None], tuple[str, ...]]:
    """Window of each row [s], from its energies and powers; a row without one takes that of the others, with a note."""
    known = {row.load: _window(table.spans(row)) for row in table.rows}
    lengths = [seconds for seconds in known.values() if seconds is not None]
    lacking = [load_text(load) for load, seconds in known.items() if seconds is None]
    if not lacking:
        return known, ()
    if not lengths:
        return known, ("no window follows from the table: the rig's own rule is taken, after ramps of 1 to 6 s",)
    usual = median(lengths)
    note = f"no window follows for {', '.join(lacking)}: {usual:.4g} s is taken, as in the other rows"
    return {load: usual if seconds is None else seconds for load, seconds in known.items()}, (note,)


def _window(spans: Mapping[str, Span]) -> float | None:
    for stage in STAGES:
        energy, power = spans.get(f"energy_{stage}"), spans.get(f"power_{stage}")
        if energy is not None and power is not None and power.low > 0.0:
            return (energy.low + energy.high) / (power.low + power.high)
    return None


def _targets(table: PublishedTable, row: TableRow) -> list[Target]:
    """Powers that a row prints, or energies where it prints none; in open circuit the DC link gives none."""
    spans = table.spans(row)
    middles = {name: 0.5 * (spans[name].low + spans[name].high) for name in spans}
    stages = STAGES[:2] if math.isinf(row.load) else STAGES
    powers, energies = (
        [
            Target(name, middles[name])
            for name in (f"{kind}_{stage}" for stage in stages)
            if middles.get(name, 0.0) > 0.0
        ]
        for kind in ("power", "energy")
    )
    return powers or energies


def _points(
    reduce: Reduce, rig: Rig, load: float, payout: Payout, targets: Sequence[Target]
) -> list[PayoutMetrics | None]:
    """One payout at the speeds at which it gives each of the printed powers, without any at shares of the rated speed."""
    model, guess = baseline(rig), rated_speed(rig) or 1.0
    points: list[PayoutMetrics | None] = []
    for target in targets:
        points.append(point := meet(reduce, model, payout, load, target, guess))
        guess = guess if point is None else point.speed
    for share in () if targets else SPEEDS:
        point = measure(reduce, model, payout, share * guess, load)
        points.append(None if point is None or point.metrics["eta_trans"] is None else point)
    return points


def rated_speed(rig: Rig) -> float | None:
    """Line speed at which the generator turns as rated; None where the rig file does not state it. [m/s]"""
    rated, rpm = rig.generator.speed_rated, rig.rpm_per_velocity
    return None if rated is None or rpm is None else rated.value * 30.0 / math.pi / rpm


def _standard_uncertainties(
    reduce: Reduce, rig: Rig, load: float, payout: Payout, middle: PayoutMetrics
) -> dict[str, float]:
    """Standard uncertainty of each efficiency by the rig's numbers and its sensors, each moved by its own. [1]"""
    square = dict.fromkeys(RATIOS, 0.0)
    run, motion = drive(payout, middle.speed, load)
    for model in _within_tolerance(rig, simulate_along(run, baseline(rig), motion).run):
        found = measure(reduce, model, payout, middle.speed, load) or middle
        for metric in RATIOS:
            here, there = middle.metrics[metric], found.metrics[metric]
            if here is not None and there is not None:
                square[metric] += (there - here) ** 2
    return {metric: math.sqrt(value) for metric, value in square.items()}


def _within_tolerance(rig: Rig, run: Run) -> Iterator[Model]:
    """The model with one number at a time changed by one standard uncertainty; the time at which channels are read moves no
    energy.
    """
    nominal = baseline(rig)
    for number in nuisances(rig, [run]):
        model = nominal
        if number.kind == "rig":
            model = baseline(shifted(rig, {(number.section, number.name): number.sd}))
        elif number.kind in ("load", "gain", "zero"):
            model = changed(nominal, number.path, "add", number.sd)
        if model != nominal:
            yield model
