"""The energy of each stage in each window, and the windows in which gaps make it uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.cascade.doubt import bridging_error, gaps_of, instant_error, window_of
from winchcascade.cascade.power import STAGES, power, sources, stream
from winchcascade.integrate import integrals
from winchcascade.phases.window import Window

if TYPE_CHECKING:
    from winchcascade.rigfile import Rig, WindowRule
    from winchcascade.run import Run, Signal


class Energies(msgspec.Struct, frozen=True):
    """Windows with what is wrong with them, the energy of each stage in each, None for one not measured, and what gaps may
    have changed of it. [J]
    """

    windows: list[Window]
    joules: dict[str, list[float] | None]
    bridged: dict[str, tuple[float, ...]]


def integrate_energies(run: Run, v_smooth: Signal, windows: Sequence[Window], rule: WindowRule, rig: Rig) -> Energies:
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
        if len(gaps) and not (
            stage == "gen" and run.open_circuit
        ):  # no current flows, so that any of it is a large share
            bridged[stage] = tuple(_doubt(run, gaps, spans, joule, moved, stage, rig, faults).tolist())
    named = [Window(w.onset, w.cutoff, w.fault or faults.get(k)) for k, w in enumerate(windows)]
    return Energies(named, joules, bridged)


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
