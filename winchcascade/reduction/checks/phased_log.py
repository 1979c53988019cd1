"""What the checks over phases compare, and what each gives: a fault by its name, with the
numbers that its words need.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import CERTAIN, open_circuit_current
from winchcascade.core.cascade import ELECTRICAL, Power
from winchcascade.core.integrate import largest, median
from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.ingest.checks.motion import MotionGain, Travel, gain_of
from winchcascade.reduction.efficiency import SMALLEST, ratio, runs_idle
from winchcascade.reduction.energies import Energies
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phase_summary import PhaseSummary
from winchcascade.reduction.phased_run import PhasedRun, span_end
from winchcascade.reduction.reduction_result import CycleResult

REPORTED = 0.005
"""Smallest error of an energy that is reported, by updates, a resolution or a step of a channel.
[1]
"""

MIN_COMPARED = 20
"""Smallest number of samples that shows how two channels depend on each other. [1]"""

Span = tuple[float, float]
"""Begin and end on the clock of the log. [s]"""


class Fault(NamedTuple):
    """One fault: its name in the table of words, the channel, the spans in order of time, and the
    values that fill the words.

    `places` are by default the number of the spans.
    """

    name: str
    channel: str | None
    spans: Sequence[Span]
    values: Mapping[str, object]
    places: int | None = None


class Rest(NamedTuple):
    """A rest before a payout or a hold after it, and the end of the motion before it that turned
    the rotor. [s]
    """

    begin: float
    end: float
    hold: bool
    last: float


class OperatingPoints(NamedTuple):
    """Vdc [V] and Idc [A] on k plateaus or cycles: means and their standard errors by noise, (2,
    k) each, and the spans.
    """

    mean: Signal
    error: Signal
    spans: list[Span]


class PhasedLog(msgspec.Struct, frozen=True, dict=True):
    """A log with its phases, their summaries, the energies, what thinning changes of them, and the
    metrics of its cycles.

    `thinned` are relative changes of the energy of each stage in each whole cycle, (5, k); empty
    where the sampling is fine.
    """

    phased: PhasedRun
    summaries: Sequence[PhaseSummary]
    energies: Energies
    thinned: Mapping[str, Signal]
    results: Sequence[CycleResult]

    @property
    def run(self) -> Run:
        """The log."""
        return self.phased.run

    @property
    def rig(self) -> Rig:
        """Its rig."""
        return self.phased.rig

    def samples(self, channel: str, spans: Sequence[Span]) -> Signal:
        """Samples of a channel in some spans; none of a channel that the log lacks."""
        x = self.run.channels.get(channel)
        if x is None or not spans:
            return np.empty(0)
        rows = self.run.t.searchsorted(np.array(spans)).tolist()
        return np.concatenate([x[first:last] for first, last in rows])

    def zero_limit(self, channel: str) -> float:
        """Zero of a channel that its accuracy does not explain, 0 where none is stated. [SI unit
        of the channel]
        """
        return CERTAIN * self.phased.u_zero(channel)

    @cached_property
    def complete(self) -> list[CycleResult]:
        """The cycles that count."""
        return [cycle for cycle in self.results if cycle.complete]

    @cached_property
    def idle(self) -> bool:
        """Whether the machine delivers next to nothing, so that its losses decide every ratio to
        what it delivers.
        """
        known = [
            name
            for name in self.rig.cascade.energies
            if all(c.metrics[name] is not None for c in self.complete)
        ]
        shares = [ratio(c.metrics[known[-1]], c.metrics[known[0]]) for c in self.complete if known]
        return self.run.open_circuit or runs_idle(shares)

    @cached_property
    def idles(self) -> bool:
        """Whether no load takes a current, so that the rotor runs on when the line slows down."""
        v_dc, i_dc = (self.run.channels.get(name) for name in ("vdc", "idc"))
        if v_dc is None or i_dc is None:
            return self.idle
        return self.run.open_circuit or largest(i_dc) <= open_circuit_current(
            self.rig, largest(v_dc)
        )

    @cached_property
    def rotor_frequency(self) -> float | None:
        """Natural frequency of the rotor on the shaft; None where the rig file lacks stiffness or
        inertia. [rad/s]
        """
        train = self.rig.drivetrain
        if train.k_shaft is None or train.inertia_rotor is None or train.gear_ratio is None:
            return None
        inertia = train.inertia_rotor.value * train.gear_ratio.value**2
        return math.sqrt(train.k_shaft.value / inertia) if inertia > 0.0 else None

    @cached_property
    def ramp(self) -> float:
        """Shortest time in which the line reaches a plateau, without what smoothing adds; infinite
        without one. [s]
        """
        ramps = [
            plateau.begin - cycle.onset
            for cycle, plateau in zip(self.phased.cycles, self.phased.plateaus, strict=True)
            if plateau is not None and not cycle.begins_inside
        ]
        return max(min(ramps, default=math.inf) - self.rig.thresholds.smoothing, 0.0)

    @cached_property
    def overshoot(self) -> float:
        """Largest share by which the rotor exceeds the speed of the line after a ramp; 1 where the
        frequency of the rotor is unknown. [1]

        Each end of a ramp of duration T makes the speed of the rotor swing by 1 / (omega T) of that
        of the line; a step at most doubles it.
        """
        omega = self.rotor_frequency
        return 1.0 if omega is None else min(2.0 / max(omega * self.ramp, SMALLEST), 1.0)

    @cached_property
    def top_speed(self) -> float:
        """Largest smoothed speed of the line. [m/s]"""
        return largest(self.phased.v_smooth)

    @cached_property
    def travel(self) -> Travel | None:
        """Measured velocity and displacement, without what was bridged; None where the log lacks
        one of them, or its clock is wrong.
        """
        run, both = self.run, ("velocity", "displacement")
        derived = any(
            f.channel == "velocity" if f.kind == "derived_channel" else f.start is None
            for f in run.findings
            if f.kind in ("derived_channel", "clock_mismatch")
        )
        if run.simulated or derived or not run.channels.keys() >= {*both}:
            return None
        v, x = (run.channels[name] for name in both)
        gaps = all_gaps(run, both)
        if len(gaps):
            v = v.copy()
            for begin, end in gaps.tolist():
                v[self.phased.rows(begin, end)][1:-1] = math.nan
        return Travel(run.t, v, x, 1.0 / run.fs)

    @cached_property
    def motion_gain(self) -> MotionGain | None:
        """Zero and gain of the velocity against the displacement."""
        return None if self.travel is None else gain_of(self.travel, self.rig.thresholds)

    @cached_property
    def powers(self) -> dict[str, Power]:
        """Power of each stage whose energy counts: not of what an idle machine delivers."""
        known = self.rig.cascade.powers(self.run.channels, self.rig.r_drum)
        joules = self.energies.joules
        return {
            name: power
            for name, power in known.items()
            if not (self.idle and name in ELECTRICAL)
            and max(joules[name] or [0.0]) > self.energies.nothing
        }

    @cached_property
    def points(self) -> OperatingPoints:
        """Vdc and Idc on the plateau of each checked cycle; with a stated load also over a cycle
        that is found in no motion.
        """
        phased, by_motion, channels = self.phased, self.rig.phases.by_motion, self.run.channels
        means, errors, spans = [], [], []
        if {"vdc", "idc"} <= channels.keys() and (self.run.load is not None or by_motion):
            for k in phased.chosen():
                cycle, plateau = phased.cycles[k], self.summaries[k].payout.plateau
                span = (
                    (plateau.begin, plateau.braking)
                    if plateau
                    else (cycle.onset, span_end(cycle, self.rig))
                )
                both = np.array([channels[name][phased.rows(*span)] for name in ("vdc", "idc")])
                if both.size and (plateau is not None or not by_motion):
                    n = both.shape[1]
                    means.append(both.mean(axis=1))
                    errors.append(
                        np.std(np.diff(both), axis=1) / math.sqrt(2.0 * n) if n > 1 else np.zeros(2)
                    )
                    spans.append(span)
        return OperatingPoints(np.reshape(means, (-1, 2)).T, np.reshape(errors, (-1, 2)).T, spans)

    @cached_property
    def rests(self) -> list[Rest]:
        """Rests before payouts and holds after them, in order of time, without what smoothing
        blurs; a one-way clutch is open in haul-in.

        Before the first payout the beginning of the log counts as the end of the motion, since the
        time before it is unknown.
        """
        phased, blur, found = self.phased, 0.5 * self.rig.thresholds.smoothing, []
        for k in phased.chosen():
            cycle, before = phased.cycles[k], phased.cycles[k - 1] if k else None
            if not cycle.begins_inside and (before is None or before.haul_in is not None):
                begin = (
                    float(self.run.t[0])
                    if before is None or before.haul_in is None
                    else before.haul_in[1]
                )
                turned = (
                    begin
                    if before is None or self.rig.drivetrain.one_way_clutch is False
                    else before.payout_end
                )
                found.append(Rest(begin + blur, cycle.onset - blur, False, turned))
            if cycle.hold is not None:
                found.append(
                    Rest(cycle.hold[0] + blur, cycle.hold[1] - blur, True, cycle.payout_end)
                )
        return found

    @cached_property
    def forces_at_rest(self) -> list[tuple[Rest, float, float]]:
        """Rests with the median line tension, and with the one that holds the gas without
        friction. [N]
        """
        part, radius, channels = self.rig.restoring, self.rig.r_drum, self.run.channels
        if (
            radius is None
            or part.lead is None
            or part.area_piston is None
            or "force" not in channels
            or not self.phased.u_zero("force")
        ):
            return []
        per_travel = (
            part.area_piston.value * part.lead.value / (2.0 * math.pi * radius)
        )  # of gas; force per pressure
        gauge, paid, found = channels.get("pressure"), channels.get("displacement"), []
        for rest in self.rests:
            rows, balanced = self.phased.rows(rest.begin, rest.end), 0.0
            if rows.stop - rows.start < MIN_COMPARED // 2:
                continue
            if gauge is not None:
                balanced = median(gauge[rows]) * per_travel
            elif paid is not None and part.p_precharge is not None and part.volume_gas is not None:
                left = 1.0 - per_travel * median(paid[rows]) / part.volume_gas.value
                filled = part.p_precharge.value + ATMOSPHERE
                balanced = (filled / left - ATMOSPHERE) * per_travel if left > 0.0 else 0.0
            if balanced > 0.0:
                found.append((rest, median(channels["force"][rows]), balanced))
        return found

    @cached_property
    def level(self) -> list[Span]:
        """Plateaus of the checked payouts. [s]"""
        plateaus = (self.phased.plateaus[k] for k in self.phased.chosen())
        return [(p.begin, p.braking) for p in plateaus if p is not None and p.braking > p.begin]

    @cached_property
    def level_rows(self) -> list[slice]:
        """Rows of these plateaus, of those that hold a sample."""
        rows = (self.phased.rows(*span) for span in self.level)
        return [of for of in rows if of.stop > of.start]

    @cached_property
    def level_means(self) -> dict[str, Signal]:
        """Means of each channel over these rows, (k,)."""
        return {
            name: np.array([x[rows].mean() for rows in self.level_rows])
            for name, x in self.run.channels.items()
        }
