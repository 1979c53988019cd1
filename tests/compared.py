"""Logs beside their simulations, as several tests of the report use them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.campaign_file import Origin
from winchcascade.diagnosis.explain.model_comparison import SimulatedLog, simulated_log
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal

FIXTURES = Path(__file__).parents[1] / "fixtures"
KGCM2 = 98066.5

LOGS: dict[str, tuple[str, float, float | str]] = {
    "18 ohm": ("r18ohm.csv", 18.0, 5.96),
    "open circuit": ("open_circuit.csv", math.inf, "auto"),
}
"""File, load [ohm] and window of logs that stand for all."""


def reduced(name: str, *, about: str = "", rig: Rig | None = None) -> Reduction:
    """One of `LOGS`, reduced, as if it were stated to be measured."""
    file, load, window = LOGS[name]
    run = read_run(
        FIXTURES / "campaign" / file, rig=rig, load=load, about=about, origin=Origin(True)
    )
    return reduce(run, rig=rig, window=window)


def compared(reduction: Reduction) -> SimulatedLog:
    """A log that can be simulated, beside its simulation."""
    found = simulated_log(reduction)
    assert isinstance(found, SimulatedLog)
    return found


def before_braking(comparison: SimulatedLog) -> list[int]:
    """Samples between onset and braking with torque, or before there is any, one by one."""
    run, torque = comparison.run, comparison.run.channels["torque"]
    found = []
    for c in comparison.cycles:
        assert c.summary.payout.plateau is not None
        pulled = False
        for k, t in enumerate(run.t.tolist()):
            if c.phases.onset <= t <= c.summary.payout.plateau.braking:
                pulled |= bool(torque[k] >= 2.0)
                if not pulled or torque[k] >= 2.0:
                    found.append(k)
    return found


def binned(rows: list[int], x: Signal, y: Signal, width: float, minimum: int) -> dict[float, float]:
    """Means of y in bins of x by the middles of the bins, one sample after the other."""
    bins: dict[int, list[float]] = {}
    for k in rows:
        bins.setdefault(math.floor(float(x[k]) / width), []).append(float(y[k]))
    return {
        (n + 0.5) * width: float(np.mean(ys))
        for n, ys in sorted(bins.items())
        if len(ys) >= minimum
    }
