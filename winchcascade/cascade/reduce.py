"""One run to its cycles: phases, windows, energies, efficiencies, repeatability and bins."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.cascade.bins import TORQUE, Bin, bin_powers, engaged
from winchcascade.cascade.doubt import bridging_error, gaps_of, instant_error, window_of
from winchcascade.cascade.efficiency import Metrics, metrics
from winchcascade.cascade.power import STAGES, power, sources, stream
from winchcascade.cascade.repeatability import ensemble_mean, largest_deviation, total
from winchcascade.cascade.summary import PhaseSummary, summarise, travel_and_top
from winchcascade.errors import LogError, OptionError
from winchcascade.integrate import integrals
from winchcascade.order import median
from winchcascade.phases.detect import Cycle, detect, smoothed_velocity
from winchcascade.phases.window import Plateau, Window, find_plateau, find_window
from winchcascade.rigfile import Rig
from winchcascade.rigtoml import built_in
from winchcascade.run import Finding
from winchcascade.threads import side_by_side

if TYPE_CHECKING:
    from winchcascade.rigfile import WindowRule
    from winchcascade.run import Run, Signal


MOST_BINS = 20_000
"""More bins of generator speed than this are a slip in a rig file."""


class CycleResult(msgspec.Struct, frozen=True):
    """One cycle: its instants, its window, what its phases were like and its nine metrics."""

    cycle: int
    complete: bool
    phases: Cycle
    window: Window
    summary: PhaseSummary
    metrics: Metrics


class Reduction(msgspec.Struct, frozen=True):
    """What a log says about the rig: every cycle, their mean and repeatability, and powers over generator speed.

    `mean` and `max_deviation_percent` are over complete cycles; `total` sums their energies and gives ratios of sums.
    `quality` holds the findings of the log and of the reduction. `bridged` is, for each stage that has gaps, what bridging
    them could have changed of each cycle's energy [J].
    """

    run: Run
    rig: Rig
    window: WindowRule
    cycles: tuple[CycleResult, ...]
    mean: Metrics
    max_deviation_percent: Metrics
    total: Metrics
    bins: tuple[Bin, ...]
    quality: tuple[Finding, ...]
    bridged: Mapping[str, tuple[float, ...]] = msgspec.field(default_factory=dict)

    def __repr__(self) -> str:
        """One line instead of every number."""
        return f"Reduction({self.run.name!r}, {len(self.complete)} of {len(self.cycles)} cycles complete)"

    @property
    def complete(self) -> tuple[CycleResult, ...]:
        """The cycles that count."""
        return tuple(c for c in self.cycles if c.complete)


def window_rule(word: str | float) -> WindowRule:
    """Read a window rule: `auto`, `payout` or a length in seconds; OptionError for anything else.

    >>> window_rule("5.48")
    5.48
    """
    if word == "auto" or word == "payout":
        return word  # type: ignore[return-value]  # mypy does not narrow str to the literals by ==
    try:
        seconds = float(word)
    except ValueError:
        seconds = math.nan
    if not (0.0 < seconds < math.inf):
        raise OptionError(f"window {word!r}: expected auto, payout or a length in seconds above 0, such as 5.48.")
    return seconds


def reduce(
    run: Run,
    *,
    rig: Rig | None = None,
    window: str | float | None = None,
    cycles: tuple[int, int] | None = None,
) -> Reduction:
    """Reduce a run: find its cycles and integrate each one's powers over its window (Sec. 3.2).

    Parameters
    ----------
    rig : the rig that the run was measured on; the paper's by default
    window : "auto", "payout" or a length [s]; by default the rig's rule
    cycles : first and last cycle that count, numbered by payout; all by default

    Raises
    ------
    OptionError : a window rule that is none, or cycles that the log does not have

    Examples
    --------
    >>> from winchcascade.ingest.read import read_run
    >>> len(reduce(read_run("fixtures/campaign/r36ohm.csv"), window=5.48).cycles)
    3
    """
    rig = rig or built_in()
    rule = window_rule(rig.thresholds.window if window is None else window)
    v_smooth = smoothed_velocity(run, rig.thresholds)
    first, found = _chosen(detect(run, v_smooth, rig.thresholds), cycles, run.name)
    plateaus = [find_plateau(run.t, v_smooth, c, rig.thresholds) for c in found]
    payouts = travel_and_top(run, v_smooth, found)
    windows = _windows(run, found, plateaus, payouts, rule, rig)
    summaries, (energy, bins) = side_by_side(
        lambda: summarise(run, v_smooth, found, plateaus, payouts, rig),
        lambda: _energies_and_bins(run, v_smooth, found, plateaus, windows, rule, rig),
        samples=run.samples,
    )
    findings = _not_given(run, rig)
    results = _results(run, found, first, summaries, energy, findings)
    complete = [r.metrics for r in results if r.complete]
    whole = sum(r.window.cutoff - r.window.onset for r in results if r.complete)
    return Reduction(
        run=run,
        rig=rig,
        window=rule,
        cycles=tuple(results),
        mean=ensemble_mean(complete),
        max_deviation_percent=largest_deviation(complete),
        total=total(complete, whole, open_circuit=run.open_circuit),
        bins=bins,
        quality=(*run.findings, *findings),
        bridged=energy.bridged,
    )


def require_payouts(reduction: Reduction) -> None:
    """Refuse a log in which the line never pays out: LogError."""
    if not reduction.cycles:
        limits = reduction.rig.thresholds
        raise LogError(
            f"{reduction.run.name}: no payout found; expected the line to pay out more than {limits.stroke_min:g} m at more "
            f"than {limits.v_onset:g} m/s. Check name, unit and sign of the velocity column."
        )


def _chosen(cycles: list[Cycle], chosen: tuple[int, int] | None, log: str) -> tuple[int, list[Cycle]]:
    """Number of the first cycle that counts, and the cycles that do."""
    if chosen is None:
        return 1, cycles
    first, last = chosen
    if first > len(cycles):
        raise OptionError(
            f"{log}: cycles {first} to {last} are asked for, but it has {len(cycles)}; choose among those."
        )
    return first, cycles[first - 1 : last]


def _not_given(run: Run, rig: Rig) -> list[Finding]:
    """Why a stage has no power although its channel is there."""
    if "torque" not in run.channels or "power_mech" in run.channels or rig.r_drum is not None:
        return []
    message = f"torque alone gives no power: the rig {rig.name} has no drum radius (r_drum under [winch])"
    return [Finding("missing_channel", message, "metrics that need it are null", "torque")]


def _windows(
    run: Run,
    cycles: Sequence[Cycle],
    plateaus: Sequence[Plateau | None],
    payouts: Sequence[tuple[float, float]],
    rule: WindowRule,
    rig: Rig,
) -> list[Window]:
    """Windows by the rule; where payouts should be alike, one that was aborted is told from the others."""
    end = float(run.t[-1])
    windows = [
        find_window(c, p, top, end, rule, rig.thresholds)
        for c, p, (_, top) in zip(cycles, plateaus, payouts, strict=True)
    ]
    if rule == "payout":
        return windows
    windows = _apart(windows)
    whole = [travel for c, (travel, _) in zip(cycles, payouts, strict=True) if not c.begins_inside]
    usual = median(np.array(whole)) if whole else 0.0
    late = [w.cutoff > c.payout_end for c, w in zip(cycles, windows, strict=True) if not c.ends_inside]
    all_late = sum(late) > 0.5 * len(late)
    return [
        _unless_aborted(c, w, travel, usual, all_late, rig)
        for c, w, (travel, _) in zip(cycles, windows, payouts, strict=True)
    ]


def _apart(windows: Sequence[Window]) -> list[Window]:
    """A window that reaches into the next payout is no window of one cycle."""
    following = [*(w.onset for w in windows[1:]), math.inf][: len(windows)]
    return [
        Window(w.onset, w.cutoff, w.fault or "its window reaches into the next payout") if w.cutoff > after else w
        for w, after in zip(windows, following, strict=True)
    ]


def _unless_aborted(cycle: Cycle, window: Window, travel: float, usual: float, all_late: bool, rig: Rig) -> Window:
    if window.fault is not None or cycle.ends_inside:
        return window
    fault = None
    if travel < rig.thresholds.aborted_below * usual:
        fault = f"the payout is aborted after {travel:.2f} m, where others travel {usual:.2f} m"
    elif window.cutoff > cycle.payout_end and not all_late:
        fault = f"the payout ends {window.cutoff - cycle.payout_end:.2f} s before its window does"
    return Window(window.onset, window.cutoff, fault)


class _Energy(msgspec.Struct, frozen=True):
    """Windows with what is wrong with them, the energy of each stage in each, None for one not measured, and what gaps may
    have changed of it. [J]
    """

    windows: list[Window]
    joules: dict[str, list[float] | None]
    bridged: dict[str, tuple[float, ...]]


def _energies_and_bins(
    run: Run,
    v_smooth: Signal,
    cycles: Sequence[Cycle],
    plateaus: Sequence[Plateau | None],
    windows: Sequence[Window],
    rule: WindowRule,
    rig: Rig,
) -> tuple[_Energy, tuple[Bin, ...]]:
    energy = _energies(run, v_smooth, windows, rule, rig)
    counted = [(c, p) for c, p, w in zip(cycles, plateaus, energy.windows, strict=True) if w.fault is None]
    return energy, _bins(run, counted, rig)


def _energies(run: Run, v_smooth: Signal, windows: Sequence[Window], rule: WindowRule, rig: Rig) -> _Energy:
    """Integrate each stage's power over each window; gaps that make an energy uncertain become the window's fault."""
    spans = np.array([(w.onset, w.cutoff) for w in windows]).reshape(-1, 2)
    joules: dict[str, list[float] | None] = {}
    bridged: dict[str, tuple[float, ...]] = {}
    faults: dict[int, str] = {}
    moved = _cutoff_error(run, v_smooth, spans, rule, rig)
    for stage in STAGES:
        watts = stream(run.channels, stage, rig.r_drum)
        if watts is None:
            joules[stage] = None
            continue
        joule = integrals(run.t, watts, spans)
        joules[stage] = joule.tolist()
        gaps = gaps_of(run, sources(run.channels, stage))
        if len(gaps):
            bridged[stage] = tuple(_doubt(run, gaps, spans, joule, moved, stage, rig, faults).tolist())
    named = [Window(w.onset, w.cutoff, w.fault or faults.get(k)) for k, w in enumerate(windows)]
    return _Energy(named, joules, bridged)


def _cutoff_error(run: Run, v_smooth: Signal, spans: Signal, rule: WindowRule, rig: Rig) -> Signal:
    """What gaps may move each cutoff, by moving the onset or the plateau that it hangs on, (k,) [s]."""
    if rule == "payout":
        return np.zeros(len(spans))
    return instant_error(run, v_smooth, spans[:, 0] if isinstance(rule, float) else spans[:, 1] - rig.thresholds.settle)


def _doubt(
    run: Run,
    gaps: Signal,
    spans: Signal,
    joule: Signal,
    moved: Signal,
    stage: str,
    rig: Rig,
    faults: dict[int, str],
) -> Signal:
    """Name the windows in which a gap is too long, or in which bridging could change the energy by too much.

    Returns what it could change of each energy, (k,) [J].
    """
    limits = rig.thresholds
    for begin, end in gaps[gaps[:, 1] - gaps[:, 0] > limits.gap_max]:
        for k in np.flatnonzero((spans[:, 0] < end) & (spans[:, 1] > begin)).tolist():
            faults.setdefault(k, f"a gap of {end - begin:.2f} s lies in its window (E_{stage})")
    watts = power(run.channels, stage, rig.r_drum)
    assert watts is not None
    which = window_of(gaps, spans)
    inside = which >= 0
    square = (moved * np.interp(spans[:, 1], run.t, watts)) ** 2  # gaps err independently of each other
    np.add.at(square, which[inside], bridging_error(run.t, watts, gaps[inside]) ** 2)
    changed: Signal = np.sqrt(square)
    share = changed / np.maximum(np.abs(joule), 1e-9)
    for k in np.flatnonzero(share > limits.gap_energy_max).tolist():
        faults.setdefault(k, f"bridging its gaps could change E_{stage} by {min(share[k], 9.99):.1%}")
    return changed


def _results(
    run: Run,
    cycles: Sequence[Cycle],
    first: int,
    summaries: Sequence[PhaseSummary],
    energy: _Energy,
    findings: list[Finding],
) -> list[CycleResult]:
    results = []
    odd: dict[str, list[tuple[int, float]]] = {}
    for k, (cycle, window, summary) in enumerate(zip(cycles, energy.windows, summaries, strict=True)):
        joules = {f"energy_{stage}": None if column is None else column[k] for stage, column in energy.joules.items()}
        values, no_efficiency = metrics(joules, window.cutoff - window.onset, open_circuit=run.open_circuit)
        for name, value in no_efficiency.items():
            odd.setdefault(name, []).append((first + k, value))
        if window.fault is not None:
            findings.append(_incomplete(run, first + k, window, window.fault))
        results.append(CycleResult(first + k, window.fault is None, cycle, window, summary, values))
    findings += [_no_efficiency(name, places) for name, places in odd.items()]
    return results


def _incomplete(run: Run, number: int, window: Window, fault: str) -> Finding:
    return Finding(
        "incomplete_cycle",
        f"cycle {number} is incomplete: {fault}",
        "listed, left out of the mean",
        start=window.onset,
        end=window.cutoff,
        removed=int(np.searchsorted(run.t, window.cutoff) - np.searchsorted(run.t, window.onset)),
    )


def _no_efficiency(name: str, places: Sequence[tuple[int, float]]) -> Finding:
    number, value = max(places, key=lambda place: abs(place[1] - 0.5))
    return Finding(
        "out_of_range",
        f"{name} is no efficiency in {len(places)} cycle{'s' if len(places) > 1 else ''} ({value:.3f} in cycle {number}); "
        f"check unit, gain and sign of what it is made of",
        "not reported",
        count=len(places),
    )


def _bins(run: Run, counted: Sequence[tuple[Cycle, Plateau | None]], rig: Rig) -> tuple[Bin, ...]:
    """Bins over the payouts of the complete cycles; none where the speed of the generator is unknown."""
    rpm_per_velocity = rig.rpm_per_velocity
    if rpm_per_velocity is None:
        return ()
    speeds = run.channels["velocity"]
    most = float(np.max(np.abs(speeds))) * rpm_per_velocity / rig.thresholds.rpm_bin
    if most > MOST_BINS:
        raise OptionError(
            f"{run.name}: {most:.3g} bins of {rig.thresholds.rpm_bin:g} rpm; expected at most {MOST_BINS}. Check gear_ratio, "
            f"r_drum and rpm_bin of the rig {rig.name}, and the unit of the velocity."
        )
    driven = engaged(run, [c for c, _ in counted], [p for _, p in counted], rig)
    powers = {stage: stream(run.channels, stage, rig.r_drum) for stage in STAGES}
    powers[TORQUE] = run.channels["torque"].__getitem__ if TORQUE in run.channels else None
    return bin_powers(run.channels["velocity"], rpm_per_velocity, driven, powers, rig.thresholds.rpm_bin)
