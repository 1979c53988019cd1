"""A log and the simulation of a model along its line motion, at the same stamps."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.reduction.bins import engaged
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.rig.baseline import NoModel, model_of
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import Simulation, simulate

LONGEST = 200.0
"""Longest part of a log that is simulated: as many of its first complete cycles as it holds. [s]"""

MAX_SAMPLES = 300_000
"""Maximum number of samples that are simulated, whatever the sampling rate."""

LEAD = 2.0
"""A part of a log begins before its first onset and ends after its last cycle by this. [s]"""

SLOWEST = 5.0
"""With a lower sampling rate a log does not show how the line starts and brakes. [Hz]"""

NAMED_EACH = 4
"""Maximum of missing numbers of a rig file that are named each; of more the sections are named."""


class LeftOut(msgspec.Struct, frozen=True):
    """The reason for which a log is not compared with a simulation, in one sentence."""

    why: str


class ModelComparison(msgspec.Struct, frozen=True):
    """A log and its simulation at the same stamps.

    `run` is the log, or of a long one the part that was simulated; `cycles` are the complete cycles in it, out of `total`.
    `payout`, `driven` and `haul_in`, (n,) each, select the samples of these cycles that count: of their payouts, of the part of
    these before braking while the clutch drives the generator, and of their haul-ins; bridged samples do not count. `changed`
    states what the model has beyond the rig file, nothing for the baseline.
    """

    run: Run
    rig: Rig
    cycles: tuple[CycleResult, ...]
    total: int
    simulation: Simulation
    payout: Mask
    driven: Mask
    haul_in: Mask
    changed: str = ""

    @property
    def rpm(self) -> Signal:
        """Generator speed that the line velocity gives while the clutch is engaged, 50 v / r_drum, (n,) [rpm]."""
        found: Signal = self.run.channels["velocity"] * (self.rig.rpm_per_velocity or 0.0)
        return found


def compare_with_baseline(reduction: Reduction) -> ModelComparison | LeftOut:
    """Simulate a log with the numbers of its rig file, and the effects that it states."""
    model = model_of(reduction.rig)
    if not isinstance(model, NoModel):
        return compare(reduction, model)
    if "velocity" not in reduction.run.channels or not model.missing:
        return LeftOut(_obstacle(reduction) or model.why)
    what = ", ".join(map(str, model.missing))
    if len(model.missing) > NAMED_EACH:
        sections = dict.fromkeys(f"[{n.section}]" for n in model.missing)
        what = f"{len(model.missing)} numbers under {', '.join(sections)}"
    name = reduction.rig.name
    return LeftOut(f"the rig file of {name} lacks what a model needs: {what} (`winchcascade rig hsu2026` shows them).")


def compare(reduction: Reduction, model: Model, *, changed: str = "") -> ModelComparison | LeftOut:
    """Simulate any model along the line motion of a log.

    Parameters
    ----------
    changed : what the model has beyond the rig file, in words; nothing for the baseline
    """
    if obstacle := _obstacle(reduction):
        return LeftOut(obstacle)
    run, cycles = _part(reduction)
    if not cycles:
        return LeftOut(f"no complete cycle ends within {LONGEST:g} s of its onset, the longest that is simulated.")
    try:
        simulation = simulate(run, model)
    except WinchcascadeError as fault:
        return LeftOut(str(fault).removeprefix(f"{run.name}: "))
    if not all(np.isfinite(x).all() for x in simulation.run.channels.values()):
        return LeftOut("along this motion the model gives no finite numbers; check unit and scale of the velocity.")
    whole = ~_strictly_within(run.t, all_gaps(run, tuple(run.channels)))
    plateaus = [c.summary.payout.plateau for c in cycles]
    return ModelComparison(
        run=run,
        rig=reduction.rig,
        cycles=cycles,
        total=len(reduction.complete),
        simulation=simulation,
        payout=_within(run.t, [(c.phases.onset, c.phases.payout_end) for c in cycles]) & whole,
        driven=engaged(run, [c.phases for c in cycles], plateaus, reduction.rig)
        & _within(run.t, before_braking(cycles))
        & whole,
        haul_in=_within(run.t, [c.phases.haul_in for c in cycles if c.phases.haul_in is not None]) & whole,
        changed=changed,
    )


def _obstacle(reduction: Reduction) -> str:
    """The first reason for which a log cannot be simulated; empty for none."""
    run = reduction.run
    if "velocity" not in run.channels:
        return "the log has no line velocity, which drives a simulation."
    if run.load is None:
        return "the load of the log is not known; give it by --load-ohm or in a campaign.toml."
    if not reduction.complete:
        return "the log has no complete cycle."
    if run.fs < SLOWEST:
        return f"the log has {run.fs:.3g} samples a second; with fewer than {SLOWEST:g} it does not show how the line starts."
    return ""


def _part(reduction: Reduction) -> tuple[Run, tuple[CycleResult, ...]]:
    """The log with its complete cycles, or of a long one the first of them."""
    run, complete = reduction.run, reduction.complete
    longest = min(LONGEST, MAX_SAMPLES / run.fs)
    if run.t[-1] - run.t[0] <= longest:
        return run, complete
    begin = complete[0].phases.onset - LEAD
    cycles = tuple(c for c in complete if _end(c) + LEAD <= begin + longest)
    return (between(run, begin, _end(cycles[-1]) + LEAD), cycles) if cycles else (run, ())


def between(run: Run, begin: float, end: float) -> Run:
    """The part of a log between two instants. [s]"""
    rows = slice(*np.searchsorted(run.t, (begin, end)).tolist())
    channels = {name: x[rows] for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[rows], channels=channels, samples=run.t[rows].size)


def _end(cycle: CycleResult) -> float:
    """End of a cycle: of its haul-in, where the log holds it. [s]"""
    last = cycle.phases.haul_in or cycle.phases.hold or (0.0, cycle.phases.payout_end)
    return max(last[1], cycle.window.cutoff)


def before_braking(cycles: Sequence[CycleResult]) -> list[tuple[float, float]]:
    """From the onset of each payout to the start of its braking, to its end where it holds no plateau. [s]"""
    return [
        (c.phases.onset, c.phases.payout_end if c.summary.payout.plateau is None else c.summary.payout.plateau.braking)
        for c in cycles
    ]


def _within(t: Signal, spans: Sequence[tuple[float, float]]) -> Mask:
    """Samples that lie in any of some spans, both ends included, (n,)."""
    inside = np.zeros(t.size, dtype=bool)
    for begin, end in spans:
        inside[np.searchsorted(t, begin, side="left") : np.searchsorted(t, end, side="right")] = True
    return inside


def _strictly_within(t: Signal, gaps: Signal) -> Mask:
    """Samples that lie within any of some gaps, without their ends, (n,)."""
    inside = np.zeros(t.size, dtype=bool)
    for before, after in gaps:
        inside[np.searchsorted(t, before, side="right") : np.searchsorted(t, after, side="left")] = True
    return inside
