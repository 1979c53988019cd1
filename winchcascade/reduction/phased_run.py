"""A run whose phases are known: cycles, plateaus and payouts by the rules of the rig, and the integration windows of these."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.accuracy import part_uncertainty
from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import extremes, integrals, median
from winchcascade.core.rig_file import Rig, Thresholds, WindowRule
from winchcascade.core.run import Finding, Run, Signal
from winchcascade.reduction.phase_sources import find_cycles
from winchcascade.reduction.phases import Cycle, Plateau, check_cycles, find_plateau

MAX_CYCLES = 12
"""Maximum number of cycles that are checked: an even selection of those of a longer log. Faults of a sensor concern all."""


class Window(msgspec.Struct, frozen=True):
    """Integration window of one payout [s], and why it does not lie whole in the payout, where it does not."""

    onset: float
    cutoff: float
    fault: str | None = None


class PhasedRun(msgspec.Struct, frozen=True):
    """A run with the phases of those of its cycles that count.

    Parameters
    ----------
    rule : of the windows; `payout` where cycles are spans that are found in no motion
    v_smooth : (n,) line velocity, smoothed [m/s]; speed of the shaft [rad/s] or zero where that is unknown
    first : number of the first cycle that counts
    next_onset : of the payout that follows the last of the cycles [s], None if there is none
    plateaus, travel, speed_max : of each payout: its plateau, its travel [m] and its top smoothed speed [m/s]
    """

    run: Run
    rig: Rig
    rule: WindowRule
    v_smooth: Signal
    first: int
    cycles: Sequence[Cycle]
    next_onset: float | None
    plateaus: Sequence[Plateau | None]
    travel: Sequence[float]
    speed_max: Sequence[float]

    def chosen(self) -> list[int]:
        """Indices of the cycles that are checked."""
        n = len(self.cycles)
        return list(range(n)) if n <= MAX_CYCLES else np.linspace(0, n - 1, MAX_CYCLES).round().astype(int).tolist()

    def rows(self, start: float, end: float) -> slice:
        """Rows of the log from one instant to another."""
        t = self.run.t
        return slice(int(t.searchsorted(start)), int(t.searchsorted(end)))

    def u_gain(self, channel: str) -> float:
        """Standard uncertainty of a sensor's gain by its stated accuracy, 0 where none is stated. [1]"""
        return part_uncertainty(self.rig.sensors.get(channel), "gain")

    def u_zero(self, channel: str) -> float:
        """Standard uncertainty of a sensor's zero, 0 where none is stated. [SI unit of the channel]"""
        return part_uncertainty(self.rig.sensors.get(channel), "zero")


def find_phases(run: Run, rig: Rig, rule: WindowRule, cycles: tuple[int, int] | None = None) -> PhasedRun:
    """Find the cycles of a run and what their payouts were like.

    Parameters
    ----------
    rule : of the windows
    cycles : first and last cycle that count, numbered by payout; all by default

    Raises
    ------
    OptionError : the log has none of these cycles
    """
    found = find_cycles(run, rig)
    v_smooth, detected, by_motion = found.motion, found.cycles, rig.phases.by_motion
    if cycles is not None:
        check_cycles(cycles, detected, run.name)
    first, last = cycles or (1, len(detected))
    counted, following = detected[first - 1 : last], detected[last:]
    payouts = np.array([(c.onset, c.payout_end) for c in counted]).reshape(-1, 2)
    return PhasedRun(
        run=run,
        rig=rig,
        rule=rule if by_motion else "payout",
        v_smooth=v_smooth,
        first=first,
        cycles=counted,
        next_onset=following[0].onset if following else None,
        plateaus=[find_plateau(run.t, v_smooth, c, rig.thresholds) if by_motion else None for c in counted],
        travel=travel_in(run, payouts),
        speed_max=extremes(run.t, v_smooth, payouts)[1].tolist(),
    )


def travel_in(run: Run, spans: Signal) -> list[float]:
    """Net travel of the line in each span, (k, 2) [s], from the displacement, else the integral of the velocity; NaN where
    both are unknown. [m]
    """
    displacement = run.channels.get("displacement")
    if displacement is None and "velocity" not in run.channels:
        return [math.nan] * len(spans)
    if displacement is None:
        return list(map(float, integrals(run.t, run.channels["velocity"].__getitem__, spans)))
    return list(map(float, np.diff(np.interp(spans, run.t, displacement), axis=1)[:, 0]))


STEADY = 1.03
"""A payout cut by the end of the log has reached its plateau if its top speed exceeds the plateau's by no more than this."""


def find_window(
    cycle: Cycle, plateau: Plateau | None, top_speed: float, log_end: float, rule: WindowRule, thresholds: Thresholds
) -> Window:
    """Set the integration window of a payout by the rule (Sec. 3.2).

    Parameters
    ----------
    top_speed : largest smoothed velocity of the payout [m/s]
    log_end : last stamp [s]
    rule : "auto" ends `settle` after the plateau begins, never past braking; "payout" with the payout; a number that
        many seconds after the onset
    """
    if cycle.begins_inside:
        return Window(cycle.onset, cycle.payout_end, "the log begins inside the payout, so its onset is unknown")
    if rule == "payout":
        fault = "the log ends inside the payout" if cycle.ends_inside else None
        return Window(cycle.onset, cycle.payout_end, fault)
    if rule != "auto":
        late = cycle.onset + float(rule) - log_end
        fault = f"the log ends {late:.2f} s before the window does" if late > 0.0 else None
        return Window(cycle.onset, min(cycle.onset + float(rule), log_end), fault)
    if plateau is None:
        return Window(cycle.onset, cycle.payout_end, "the payout never holds a plateau speed")
    settled = plateau.begin + thresholds.settle
    early = cycle.ends_inside and (settled > cycle.payout_end or top_speed > STEADY * plateau.speed)
    fault = "the log ends before the payout has settled on its plateau" if early else None
    return Window(cycle.onset, min(settled, plateau.braking), fault)


def find_windows(phased: PhasedRun) -> list[Window]:
    """Windows by the rule; where payouts should be alike, one that was aborted is distinguished from the others."""
    if not phased.rig.phases.by_motion:
        return [_whole_span(phased, cycle) for cycle in phased.cycles]
    end, usual = float(phased.run.t[-1]), _usual_travel(phased)
    following = [*(c.onset for c in phased.cycles[1:]), math.inf]
    found = []
    for k, (cycle, plateau, top) in enumerate(zip(phased.cycles, phased.plateaus, phased.speed_max, strict=True)):
        window = find_window(cycle, plateau, top, end, phased.rule, phased.rig.thresholds)
        fault = window.fault or _fault(phased, k, window, following[k], usual)
        found.append(msgspec.structs.replace(window, fault=fault))
    return found


def whole_cycles(phased: PhasedRun) -> Signal:
    """Begin and end of each whole cycle, (k, 2): from onset to next onset or end of the log, or of a span its own. [s]"""
    ends = [*(c.onset for c in phased.cycles[1:]), phased.next_onset or float(phased.run.t[-1])]
    if not phased.rig.phases.by_motion:
        ends = [span_end(c, phased.rig) for c in phased.cycles]
    return np.array([(c.onset, end) for c, end in zip(phased.cycles, ends, strict=False)]).reshape(-1, 2)


def span_end(cycle: Cycle, rig: Rig) -> float:
    """End of a cycle that is a span: of a wave with its negative half, of a labelled cycle that of its payout. [s]"""
    return cycle.haul_in[1] if rig.phases.source == "waves" and cycle.haul_in is not None else cycle.payout_end


SHORTEST = 2.0
"""Minimum length of a window in sampling intervals: its ends are interpolated, and fewer samples would be only ends."""


def _whole_span(phased: PhasedRun, cycle: Cycle) -> Window:
    """Window of a cycle that is a span: all of it."""
    end = span_end(cycle, phased.rig)
    length, fs = end - cycle.onset, phased.run.fs
    cut = cycle.begins_inside or cycle.ends_inside
    fault = "the log begins or ends inside it" if cut else None
    if length * fs < SHORTEST and phased.rig.phases.source != "rows":
        fault = f"its window of {length:.3g} s is shorter than two samples, which are {1.0 / fs:.3g} s apart"
    return Window(cycle.onset, end, fault)


def _fault(phased: PhasedRun, k: int, window: Window, after: float, usual: float) -> str | None:
    """Why a window is too short for the course of a power, or does not hold one payout like the others.

    Parameters
    ----------
    k : index of the cycle
    after : onset of the next payout [s]
    usual : travel of the other payouts [m]
    """
    length, fs, cycle, travel = window.cutoff - window.onset, phased.run.fs, phased.cycles[k], phased.travel[k]
    if length * fs < SHORTEST:
        return f"its window of {length:.3g} s is shorter than two samples, which are {1.0 / fs:.3g} s apart"
    if phased.rule == "payout":
        return None
    if window.cutoff > after:
        return "its window reaches into the next payout"
    late = window.cutoff - cycle.payout_end
    if not cycle.ends_inside and travel < phased.rig.thresholds.aborted_below * usual:
        return f"the payout is aborted after {travel:.2f} m, where others travel {usual:.2f} m"
    if not cycle.ends_inside and late > _detection_slack(phased):
        return f"the payout ends {late:.2f} s before its window does"
    return None


def check_lengths(phased: PhasedRun, windows: Sequence[Window]) -> list[Finding]:
    """Report payouts that end before a window of fixed length does.

    Raises
    ------
    OptionError : that is so for more than half of the payouts that are seen whole and not aborted
    """
    if not isinstance(phased.rule, float):
        return []
    minimum = phased.rig.thresholds.aborted_below * _usual_travel(phased)
    whole = [
        (c, w)
        for c, w, travel in zip(phased.cycles, windows, phased.travel, strict=True)
        if not c.begins_inside and not c.ends_inside and travel >= minimum
    ]
    late = [(c, w) for c, w in whole if w.cutoff - c.payout_end > _detection_slack(phased)]
    if not late:
        return []
    maximum = max(w.cutoff - c.payout_end for c, w in late)
    found = f"{len(late)} of {len(whole)} payouts end before their window of {phased.rule:g} s does, by up to {maximum:.2f} s"
    lengths = [c.payout_end - c.onset for c, _ in whole]
    fits = math.floor(100.0 * min(lengths)) / 100.0
    if 2 * len(late) > len(whole):
        raise OptionError(
            f"{phased.run.name}: {found}, so that it holds hold or haul-in; the payouts last {min(lengths):.2f} to "
            f"{max(lengths):.2f} s. Give a window of at most {fits:.2f} s, or the rule auto or payout."
        )
    return [
        Finding(
            "window_beyond_payout",
            f"{found}; a window of {fits:.2f} s fits into all of them",
            "those cycles are left out of the mean",
            start=late[0][1].onset,
            end=late[-1][1].cutoff,
            count=len(late),
        )
    ]


def _usual_travel(phased: PhasedRun) -> float:
    """Median travel of the payouts whose onset the log holds; 0 without any. [m]"""
    whole = [travel for c, travel in zip(phased.cycles, phased.travel, strict=True) if not c.begins_inside]
    return median(np.array(whole)) if whole else 0.0


def _detection_slack(phased: PhasedRun) -> float:
    """By how much the end of a payout may be found too early: half the smoothing, or one sample of a slower log. [s]"""
    return max(0.5 * phased.rig.thresholds.smoothing, 1.0 / phased.run.fs)
