"""What to test next: the load and the speed that would best tell the leading cause from its strongest rival."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Run
from winchcascade.diagnosis.block_means import PHASES, blocks_of
from winchcascade.diagnosis.diagnosis_result import Experiment
from winchcascade.diagnosis.evidence import Fit
from winchcascade.diagnosis.predict import CHANNELS, Course
from winchcascade.diagnosis.suspects import Suspects, freedom

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.rig.parts import Model

SPEEDS = (0.5, 1.0, 1.3)
"""Plateau speeds that are tried, as shares of the fastest of the campaign."""

RAMP, HOLD, REST = 1.5, 4.0, 2.0
"""Ramp of a planned payout, hold and rest before it [s]."""

BACK = 0.6
"""Haul-in of a planned cycle, as a share of its payout's speed."""


def plan(data: Fitted, suspects: Suspects, best: Fit, rival: Fit, separates: tuple[str, str]) -> Experiment:
    """Choose the run in which two fits of the same data differ most beyond noise, tolerances and what the rival could adapt."""
    speed, length = _usual(data)
    loads = sorted({log.load for log in data.logs})
    tried = list(dict.fromkeys([loads[0], loads[len(loads) // 2], loads[-1]]))
    options = [(load, share * speed) for load in tried for share in SPEEDS]
    scores = all_at_once([partial(_score, data, suspects, best, rival, load, v, length) for load, v in options])
    z, (load, v) = max(zip(scores, options, strict=True), key=lambda pair: pair[0])
    return Experiment("cycle", v, separates, z, load=load, length=length)


def _usual(data: Fitted) -> tuple[float, float]:
    """Fastest plateau [m/s] and median length of a payout [m] of the campaign."""
    fastest, lengths = 0.0, []
    for log in data.logs:
        blocks = log.course.blocks
        fastest = max(fastest, float(np.quantile(log.run.channels["velocity"], 0.97)))
        x = np.interp(log.run.t, log.course.motion.t, log.course.motion.x)
        for cycle in np.unique(blocks.cycle[blocks.phase == 0]):
            own = (blocks.cycle == cycle) & (blocks.phase == 0)
            lengths.append(float(x[blocks.stop[own][-1] - 1] - x[blocks.start[own][0]]))
    return fastest, float(np.median(lengths)) if lengths else 1.0


def _planned(load: float, speed: float, length: float, fs: float) -> Run:
    """A run of one trapezoid out and one back, without noise."""
    out, back = max(length / speed - RAMP, 0.5), max(length / (BACK * speed) - RAMP, 0.5)
    corners = np.cumsum([0.0, REST, RAMP, out, RAMP, HOLD, RAMP, back, RAMP, REST])
    v = np.array([0.0, 0.0, speed, speed, 0.0, 0.0, -BACK * speed, -BACK * speed, 0.0, 0.0])
    t = np.arange(0.0, corners[-1], 1.0 / fs)
    velocity = np.interp(t, corners, v)
    return Run(name="planned", t=t, channels={"velocity": velocity}, fs=fs, samples=t.size, load=load)


def _score(data: Fitted, suspects: Suspects, best: Fit, rival: Fit, load: float, speed: float, length: float) -> float:
    """Significance with which one planned cycle tells the fits apart. [sigma]"""
    run = _planned(load, speed, length, data.logs[0].run.fs)
    blocks = blocks_of(run, data.rig)
    course = Course(run, blocks)
    one, other = (data.model(fit.nu, fit.effects(suspects)) for fit in (best, rival))
    predicted = course.predict(other)
    sd = _noise(data, blocks.phase)
    z = ((course.predict(one) - predicted) / sd).ravel()
    columns = [((course.predict(m) - predicted) / sd).ravel() for m in _moved(data, suspects, rival)]
    for k, name in enumerate(CHANNELS):
        gain = np.zeros_like(predicted)
        gain[:, k] = predicted[:, k] * max(
            (n.sd for n in data.nuisances if n.kind == "gain" and n.name == name), default=0.0
        )
        zero = np.zeros_like(predicted)
        zero[:, k] = max((n.sd for n in data.nuisances if n.kind == "zero" and n.name == name), default=0.0)
        columns += [(gain / sd).ravel(), (zero / sd).ravel()]
    j = np.column_stack(columns)
    own = [((course.predict(m) - predicted) / sd).ravel() / step for m, step in _fields_moved(data, suspects, rival)]
    j = np.column_stack([j, *own])
    prior = np.eye(j.shape[1])
    if own:
        prior[-len(own) :, -len(own) :] = rival.curve + np.diag((rival.high - rival.low) ** -2.0)
    pull = j.T @ z
    left = float(z @ z - pull @ np.linalg.solve(j.T @ j + prior, pull))
    return math.sqrt(max(left, 0.0))


def _moved(data: Fitted, suspects: Suspects, fit: Fit) -> Sequence[Model]:
    """Models with one number of the rig moved by its tolerance each."""
    models = []
    for k, n in enumerate(data.nuisances):
        if n.kind == "rig":
            nu = fit.nu.copy()
            nu[k] += 1.0
            models.append(data.model(nu, fit.effects(suspects)))
    return models


def _fields_moved(data: Fitted, suspects: Suspects, fit: Fit) -> Sequence[tuple[Model, float]]:
    """Models with one field of the fit moved a little each, and by how much."""
    moved = []
    for i, (name, values) in enumerate(zip(fit.names, fit.values, strict=True)):
        free = freedom(suspects[name])
        for k in range(values.size):
            step = 0.02 * float(free.high[k] - free.low[k])
            step = -step if values[k] + step > free.high[k] else step
            x = values.copy()
            x[k] += step
            changed = (*fit.values[:i], x, *fit.values[i + 1 :])
            one = msgspec.structs.replace(fit, values=changed)
            moved.append((data.model(one.nu, one.effects(suspects)), step))
    return moved


def _noise(data: Fitted, phase: NDArray[np.intp]) -> Signal:
    """Noise of planned blocks, (m, 5): the median of the campaign's in the same phase; inf where a channel tells nothing."""
    sd = np.full((phase.size, len(CHANNELS)), math.inf)
    for p in range(len(PHASES)):
        for k in range(len(CHANNELS)):
            own = np.concatenate(
                [log.noise.total[log.noise.seen[:, k] & (log.course.blocks.phase == p), k] for log in data.logs]
            )
            if own.size:
                sd[phase == p, k] = float(np.median(own))
    return sd
