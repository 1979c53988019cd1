"""The first payout of a clean log to its nine metrics, by the rules of `reduce` and no more: for thousands of simulations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import integrals
from winchcascade.reduction.efficiency import METRICS, metrics
from winchcascade.reduction.energies import STAGES, stream
from winchcascade.reduction.phases import detect, smoothed_velocity
from winchcascade.reduction.reduce import window_rule
from winchcascade.reduction.windows import find_plateau, find_window

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run


def first_metrics(run: Run, rig: Rig, window: float | None = None) -> dict[str, float | None]:
    """Metrics of a log's first payout, all None where it has none or where its window is not whole.

    A ratio above 1 is given as it is: a bent model has to be told by how much it is wrong.

    Parameters
    ----------
    window : length [s]; by default the rig's rule
    """
    v_smooth = smoothed_velocity(run, rig.thresholds)
    found = detect(run, v_smooth, rig.thresholds)[:1]
    for cycle in found:
        plateau = find_plateau(run.t, v_smooth, cycle, rig.thresholds)
        rule = window_rule(rig.thresholds.window if window is None else window)
        span = find_window(cycle, plateau, float(v_smooth.max()), float(run.t[-1]), rule, rig.thresholds)
        if span.fault is None:
            ends = np.array([[span.onset, span.cutoff]])
            streams = {stage: stream(run.channels, stage, rig.r_drum) for stage in STAGES}
            energy = {
                f"energy_{stage}": None if watts is None else float(integrals(run.t, watts, ends)[0])
                for stage, watts in streams.items()
            }
            got, odd = metrics(energy, span.cutoff - span.onset, open_circuit=run.open_circuit)
            return {name: odd.get(name, getattr(got, name)) for name in METRICS}
    return dict.fromkeys(METRICS)
