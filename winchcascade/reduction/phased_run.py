"""A run whose phases are known: cycles, plateaus and payouts by the rules of the rig, and the
integration windows of these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.accuracy import part_uncertainty
from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import extremes, integrals, median, values_at
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.core.rig_file import Rig, WindowRule
from winchcascade.core.run import Finding, Run, Signal
from winchcascade.reduction.phase_sources import find_cycles
from winchcascade.reduction.phases import Cycle, Plateau, check_cycles, find_plateau

MAX_CYCLES = 12
"""Maximum number of cycles that are checked: an even selection of those of a longer log. Faults
of a sensor concern all.
"""


SHORTEST = 2.0
"""Minimum length of a window in sampling intervals: its ends are interpolated, and fewer samples
would be only ends.
"""

TOP_OF_PLATEAU = 1.03
"""A payout cut by the end of the log has reached its plateau if its top speed exceeds the
plateau's by no more than this.
"""


class Window(msgspec.Struct, frozen=True):
    """Integration window of one payout [s], and why it does not lie whole in the payout, where
    it does not.
    """

    onset: float
    cutoff: float
    fault: str | None = None


class PhasedRun(msgspec.Struct, frozen=True):
    """A run with the phases of those of its cycles that count.

    Parameters
    ----------
    rule : of the windows; `payout` where cycles are spans that are found in no motion
    v_smooth : (n,) line velocity, smoothed [m/s]; speed of the shaft [rad/s] or zero where that is
        unknown
    first : number of the first cycle that counts
    next_onset : of the payout that follows the last of the cycles [s], None if there is none
    plateaus, travel, speed_max : of each payout: its plateau, its travel [m] and its top smoothed
        speed [m/s]
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
        return (
            list(range(n))
            if n <= MAX_CYCLES
            else np.linspace(0, n - 1, MAX_CYCLES).round().astype(int).tolist()
        )

    def rows(self, start: float, end: float) -> slice:
        """Rows of the log from one instant to another."""
        t = self.run.t
        return slice(int(t.searchsorted(start)), int(t.searchsorted(end)))

    def u_gain(self, channel: str) -> float:
        """Standard uncertainty of a sensor's gain by its stated accuracy, 0 where none is
        stated. [1]
        """
        return part_uncertainty(self.rig.sensors.get(channel), "gain")

    def u_zero(self, channel: str) -> float:
        """Standard uncertainty of a sensor's zero, 0 where none is stated. [SI unit of the
        channel]
        """
        return part_uncertainty(self.rig.sensors.get(channel), "zero")


def find_phases(
    run: Run, rig: Rig, rule: WindowRule, cycles: tuple[int, int] | None = None
) -> PhasedRun:
    """Find the cycles of a run and what their payouts were like.

    Parameters
    ----------
    rule : of the windows
    cycles : first and last cycle that count, numbered by payout; all by default

    Raises
    ------
    OptionError : the log has none of these cycles
    """
    rig = with_thresholds(rig, [run])
    detected, v_smooth = find_cycles(run, rig)
    by_motion = rig.phases.by_motion
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
        plateaus=[
            find_plateau(run.t, v_smooth, c, rig.thresholds) if by_motion else None for c in counted
        ],
        travel=travel_in(run, payouts),
        speed_max=extremes(run.t, v_smooth, payouts)[1].tolist(),
    )


def travel_in(run: Run, spans: Signal) -> list[float]:
    """Net travel of the line in each span, (k, 2) [s], from the displacement, else the integral of
    the velocity; NaN where both are unknown. [m]
    """
    if "displacement" in run.channels:
        begin, end = values_at(run.t, run.channels["displacement"], np.asarray(spans).T)
        travel = end - begin
    elif "velocity" in run.channels:
        travel = integrals(run.t, run.channels["velocity"].__getitem__, spans)
    else:
        travel = np.full(len(spans), math.nan)
    return [float(metres) for metres in travel]


def find_windows(phased: PhasedRun) -> list[Window]:
    """Windows by the rule; where payouts should be alike, one that was aborted is distinguished
    from the others.

    A cycle that is a span is its own window.
    """
    rig, fs, found = phased.rig, phased.run.fs, []
    alike, usual = rig.phases.by_motion and phased.rule != "payout", _usual_travel(phased)
    following = [*(cycle.onset for cycle in phased.cycles[1:]), math.inf]
    for k, (cycle, after, travel) in enumerate(
        zip(phased.cycles, following, phased.travel, strict=False)
    ):
        if rig.phases.by_motion:
            window = find_window(phased, k)
        else:
            cut = cycle.begins_inside or cycle.ends_inside
            window = Window(
                cycle.onset,
                span_end(cycle, rig),
                "the log begins or ends inside it" if cut else None,
            )
        length, late = window.cutoff - window.onset, window.cutoff - cycle.payout_end
        ended, short = (
            alike and not cycle.ends_inside,
            length * fs < SHORTEST and rig.phases.source != "rows",
        )
        odd = {
            f"its window of {length:.3g} s is shorter than two samples, which are {1.0 / fs:.3g} s apart": short,
            "its window reaches into the next payout": alike and window.cutoff > after,
            f"the payout is aborted after {travel:.2f} m, where others travel {usual:.2f} m": ended
            and travel < rig.thresholds.aborted_below * usual,
            f"the payout ends {late:.2f} s before its window does": ended
            and late > _detection_slack(phased),
        }
        fault = window.fault or next((text for text, is_odd in odd.items() if is_odd), None)
        found.append(Window(window.onset, window.cutoff, fault))
    return found


def find_window(phased: PhasedRun, k: int) -> Window:
    """Set the integration window of a payout by the rule (Sec. 3.2).

    The rule "auto" ends `settle` after the plateau begins, never past braking; "payout" with the
    payout; a number that many seconds after the onset.
    """
    cycle, plateau, rule, log_end = (
        phased.cycles[k],
        phased.plateaus[k],
        phased.rule,
        float(phased.run.t[-1]),
    )
    end, fault = cycle.payout_end, None
    if cycle.begins_inside:
        fault = "the log begins inside the payout, so its onset is unknown"
    elif rule == "payout":
        fault = "the log ends inside the payout" if cycle.ends_inside else None
    elif isinstance(rule, float):
        late = cycle.onset + rule - log_end
        end, fault = (
            min(cycle.onset + rule, log_end),
            f"the log ends {late:.2f} s before the window does" if late > 0 else None,
        )
    elif plateau is None:
        fault = "the payout never holds a plateau speed"
    else:
        settled = plateau.begin + phased.rig.thresholds.settle
        end = min(settled, plateau.braking)
        if cycle.ends_inside and (
            settled > cycle.payout_end or phased.speed_max[k] > TOP_OF_PLATEAU * plateau.speed
        ):
            fault = "the log ends before the payout has settled on its plateau"
    return Window(cycle.onset, end, fault)


def whole_cycles(phased: PhasedRun) -> Signal:
    """Begin and end of each whole cycle, (k, 2): from onset to next onset, or of a span its own.
    [s]
    """
    if phased.rig.phases.by_motion:
        return onsets(phased)
    return np.array([(c.onset, span_end(c, phased.rig)) for c in phased.cycles]).reshape(-1, 2)


def onsets(phased: PhasedRun) -> Signal:
    """Onset of each cycle and onset of the next one, or the end of the log, (k, 2). [s]"""
    last = float(phased.run.t[-1]) if phased.next_onset is None else phased.next_onset
    ends = [*(c.onset for c in phased.cycles[1:]), last]
    return np.array([(c.onset, end) for c, end in zip(phased.cycles, ends, strict=False)]).reshape(
        -1, 2
    )


def span_end(cycle: Cycle, rig: Rig) -> float:
    """End of a cycle that is a span: of a wave with its negative half, of a labelled cycle that
    of its payout. [s]
    """
    return (
        cycle.haul_in[1]
        if rig.phases.source == "waves" and cycle.haul_in is not None
        else cycle.payout_end
    )


def check_lengths(phased: PhasedRun, windows: Sequence[Window]) -> list[Finding]:
    """Report payouts that end before a window of fixed length does.

    Raises
    ------
    OptionError : that is so for more than half of the payouts that are seen whole and not aborted
    """
    minimum = phased.rig.thresholds.aborted_below * _usual_travel(phased)
    whole = [
        (c, w)
        for c, w, travel in zip(phased.cycles, windows, phased.travel, strict=True)
        if not c.begins_inside and not c.ends_inside and travel >= minimum
    ]
    late = [(c, w) for c, w in whole if w.cutoff - c.payout_end > _detection_slack(phased)]
    if not late or not isinstance(phased.rule, float):
        return []
    maximum, lengths = (
        max(w.cutoff - c.payout_end for c, w in late),
        [c.payout_end - c.onset for c, _ in whole],
    )
    found = f"{len(late)} of {len(whole)} payouts end before their window of {phased.rule:g} s does, by up to {maximum:.2f} s"
    fits = f"a window of at most {math.floor(100.0 * min(lengths)) / 100.0:.2f} s fits into all of them"
    if 2 * len(late) > len(whole):
        raise OptionError(
            f"{phased.run.name}: {found}, so that it holds hold or haul-in; the payouts last "
            f"{min(lengths):.2f} to "
            f"{max(lengths):.2f} s, and {fits}; give one, or the rule auto or payout."
        )
    action, begin, end = (
        "those cycles are excluded from the mean",
        late[0][1].onset,
        late[-1][1].cutoff,
    )
    return [
        Finding(
            "window_beyond_payout",
            f"{found}; {fits}",
            action,
            start=begin,
            end=end,
            count=len(late),
        )
    ]


def _usual_travel(phased: PhasedRun) -> float:
    """Median travel of the payouts whose onset the log holds; 0 without any. [m]"""
    whole = [
        travel
        for c, travel in zip(phased.cycles, phased.travel, strict=True)
        if not c.begins_inside
    ]
    return median(np.array(whole)) if whole else 0.0


def _detection_slack(phased: PhasedRun) -> float:
    """By how much the end of a payout may be found too early: half the smoothing, or one sample
    of a slower log. [s]
    """
    return max(0.5 * phased.rig.thresholds.smoothing, 1.0 / phased.run.fs)
