"""One row of a published table held against a rig: the efficiencies that any plausible payout of that row reaches.

A row prints what its payouts put in and gave out, so their speed follows; how the line sped up, and from where, does not.
Every plausible payout that gives a printed power is simulated, over the window that energy and power imply, and reduced by
the same rules as a log. What the rig's numbers and sensors may be off widens the interval.
"""

from __future__ import annotations

import math
from statistics import median
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.published_table import Span, load_text
from winchcascade.diagnosis.nuisances import nuisances, shifted
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.rig.parts import baseline, changed
from winchcascade.rig.simulate import simulate_along
from winchcascade.tables.plausible_payouts import Payout, PayoutMetrics, Target, drive, measure, meet, payouts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from winchcascade.core.published_table import Row, Table
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run
    from winchcascade.rig.parts import Model
    from winchcascade.tables.plausible_payouts import Reduce

COVERAGE = 2.0
"""Standard uncertainties that a limit allows: about 95 % (JCGM 100:2008, 6.3.3)."""

OWN = 1e-3
"""The reach itself is known no better: few payouts are looked at, and with an effect the middle one alone. [1]"""

WINDOWS = (0.2, 600.0)
"""Windows of payouts lie between these: anything else is a slip in the table. [s]"""

SPEEDS = (1.0, 0.5, 0.75, 1.25, 1.5)
"""Plateau speeds of a row without power and energy, as shares of the rated speed; the first is the middle one. [1]"""


class Cell(msgspec.Struct, frozen=True):
    """One efficiency of a row beside what the rig can reach. [1]

    `printed` stands for every value within `allowed` of it: rounding, what the mean of so few cycles may be off, and `OWN`.
    `derived` tells one that is not printed itself but the ratio of two printed energies or powers. `nominal` is that of the
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
        """How far the printed value lies above (positive) or below (negative) what can be reached; 0 within it. [1]"""
        return max(self.printed - self.high, 0.0) + min(self.printed - self.low, 0.0)

    @property
    def outside(self) -> bool:
        """Whether what is allowed does not bridge the gap."""
        return abs(self.gap) > self.allowed


class RowReach(msgspec.Struct, frozen=True):
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
    table: Table, row: Row, window: float | None, rig: Rig, reduce: Reduce, scatter: float
) -> RowReach | NotJudged:
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
    kinds, targets, rated = payouts(window, rig.thresholds.v_onset), _targets(table, row), rated_speed(rig)
    if not targets and rated is None:
        return NotJudged(
            row.load, "it prints no power or energy, and the rig file no speed_rated, to tell the line's speed"
        )
    speeds = [share * rated for share in SPEEDS] if rated is not None and not targets else []
    points = [
        point
        for kind in kinds
        for point in (_met(reduce, rig, row, kind, targets) if targets else _at_speeds(reduce, rig, row, kind, speeds))
    ]
    middle, whole = points[0], [point for point in points if point is not None]
    if middle is None:
        return NotJudged(row.load, f"no payout of this rig gives the printed {_told(targets)}")
    u = _standard_uncertainties(reduce, rig, row.load, kinds[0], middle)
    share = repeatability(scatter, table.cycles)
    cells = tuple(_cell(eta, wanted[eta], whole, u[eta], share) for eta in wanted)
    spread = Span(min(point.speed for point in whole), max(point.speed for point in whole))
    return RowReach(row.load, window, spread, cells, kinds[0], middle.speed, targets[0] if targets else None)


def _cell(metric: str, wanted: _Printed, points: Sequence[PayoutMetrics], u: float, scatter: float) -> Cell:
    """Hold one efficiency against all points, of which the first is that of the middle payout.

    Parameters
    ----------
    scatter : standard uncertainty of the printed mean by the scatter of its cycles, as a share [1]
    """
    found = [value for point in points if (value := point.metrics[metric]) is not None]
    return Cell(
        metric=metric,
        printed=wanted.value,
        allowed=wanted.rounding + COVERAGE * wanted.value * scatter + OWN,
        derived=wanted.derived,
        nominal=points[0].metrics[metric] or 0.0,
        low=min(found) - u,
        high=max(found) + u,
        u=u,
    )


def repeatability(scatter: float, cycles: int | None) -> float:
    """Standard uncertainty of the mean of some cycles, as a share: their largest deviation counts as two of a cycle. [1]

    >>> round(repeatability(0.025, 3), 4)
    0.0072
    """
    return 0.5 * scatter / math.sqrt(cycles or 1)


class _Printed(msgspec.Struct, frozen=True):
    """An efficiency of a row: value, half the width of its rounding, and whether it is the ratio of two other cells. [1]"""

    value: float
    rounding: float
    derived: bool


def printed_efficiencies(table: Table, row: Row) -> dict[str, _Printed]:
    """Efficiencies that a row prints, or that two of its energies or powers make; in open circuit eta_trans alone."""
    spans, found = table.spans(row), {}
    for eta, (out, into) in RATIOS.items():
        span, derived = spans.get(eta), False
        for part, of in ((out, into), (out.replace("energy", "power"), into.replace("energy", "power"))):
            if span is None and part in spans and of in spans and spans[of].low > 0.0:
                span, derived = Span(spans[part].low / spans[of].high, spans[part].high / spans[of].low), True
        if span is not None and (not math.isinf(row.load) or eta == "eta_trans"):
            found[eta] = _Printed(0.5 * (span.low + span.high), 0.5 * (span.high - span.low), derived)
    return found


def windows_of(table: Table) -> tuple[dict[float, float | None], tuple[str, ...]]:
    """Window of each row [s], from its energies and powers; of a row without one that of the others, which the notes tell."""
    known = {row.load: _window(table, row) for row in table.rows}
    lengths = [seconds for seconds in known.values() if seconds is not None]
    lacking = [load_text(load) for load, seconds in known.items() if seconds is None]
    if not lacking:
        return known, ()
    if not lengths:
        return known, ("no window follows from the table: the rig's own rule is taken, after ramps of 1 to 6 s",)
    usual = median(lengths)
    note = f"no window follows for {', '.join(lacking)}: {usual:.4g} s is taken, as in the other rows"
    return {load: usual if seconds is None else seconds for load, seconds in known.items()}, (note,)


def _window(table: Table, row: Row) -> float | None:
    spans = table.spans(row)
    for stage in ("line", "mech", "gen"):
        energy, power = spans.get(f"energy_{stage}"), spans.get(f"power_{stage}")
        if energy is not None and power is not None and power.low > 0.0:
            return (energy.low + energy.high) / (power.low + power.high)
    return None


def _targets(table: Table, row: Row) -> list[Target]:
    """Powers that a row prints, or energies where it prints none; in open circuit the DC link gives none."""
    spans = table.spans(row)
    for kind in ("power", "energy"):
        names = [f"{kind}_{stage}" for stage in ("line", "mech", "gen") if stage != "gen" or not math.isinf(row.load)]
        found = [Target(name, 0.5 * (spans[name].low + spans[name].high)) for name in names if name in spans]
        found = [target for target in found if target.value > 0.0]
        if found:
            return found
    return []


def _met(reduce: Reduce, rig: Rig, row: Row, kind: Payout, targets: list[Target]) -> list[PayoutMetrics | None]:
    """One payout at the speeds at which it gives each of the printed powers."""
    model, guess = baseline(rig), rated_speed(rig) or 1.0
    points: list[PayoutMetrics | None] = []
    for target in targets:
        point = meet(reduce, model, kind, row.load, target, guess)
        guess = guess if point is None else point.speed
        points.append(point)
    return points


def _at_speeds(reduce: Reduce, rig: Rig, row: Row, kind: Payout, speeds: list[float]) -> list[PayoutMetrics | None]:
    """One payout at some speeds, the middle one first."""
    model = baseline(rig)
    points: list[PayoutMetrics | None] = []
    for speed in speeds:
        metrics = measure(reduce, model, kind, speed, row.load)
        points.append(None if metrics is None or metrics["eta_trans"] is None else PayoutMetrics(speed, metrics))
    return points


def _told(targets: list[Target]) -> str:
    """A target for a sentence."""
    if not targets:
        return "efficiencies at its rated speed"
    unit = "W" if targets[0].metric.startswith("power") else "J"
    return f"{targets[0].metric} of {targets[0].value:.5g} {unit}, whatever its speed"


def rated_speed(rig: Rig) -> float | None:
    """Line speed at which the generator turns as rated; None where the rig file does not say. [m/s]"""
    rated, rpm = rig.generator.speed_rated, rig.rpm_per_velocity
    return None if rated is None or rpm is None else rated.value * 30.0 / math.pi / rpm


def _standard_uncertainties(
    reduce: Reduce, rig: Rig, load: float, payout: Payout, middle: PayoutMetrics
) -> dict[str, float]:
    """Standard uncertainty of each efficiency by the rig's numbers and its sensors, each moved by its own. [1]"""
    square = dict.fromkeys(RATIOS, 0.0)
    run, motion = drive(payout, middle.speed, load)
    run = simulate_along(run, baseline(rig), motion).run
    for model in _within_tolerance(rig, run):
        found = measure(reduce, model, payout, middle.speed, load)
        for metric in RATIOS:
            here, there = middle.metrics[metric], None if found is None else found[metric]
            if here is not None and there is not None:
                square[metric] += (there - here) ** 2
    return {metric: math.sqrt(value) for metric, value in square.items()}


def _within_tolerance(rig: Rig, run: Run) -> Iterator[Model]:
    """The model with one number at a time off by one standard uncertainty; when channels are read moves no energy."""
    nominal = baseline(rig)
    for number in nuisances(rig, [run]):
        model = nominal
        if number.kind == "rig":
            model = baseline(shifted(rig, {(number.section, number.name): number.sd}))
        elif number.kind in ("load", "gain", "zero"):
            model = changed(nominal, number.path, "add", number.sd)
        if model != nominal:
            yield model
