"""The run that would best distinguish the leading cause from its strongest alternative."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.block_means import PHASES, blocks_of
from winchcascade.diagnosis.causes import are_confused, swap
from winchcascade.diagnosis.diagnosis_result import Experiment, NamedCause
from winchcascade.diagnosis.entries import LOAD, same_in_logs
from winchcascade.diagnosis.predict import CHANNELS, Course
from winchcascade.diagnosis.suspects import varied

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.search import Fit, Found
    from winchcascade.rig.parts import Model

SPEEDS = (0.5, 1.0, 1.3)
"""Plateau speeds that are tried, as shares of the fastest of the campaign."""

RAMP, HOLD, REST = 1.5, 4.0, 2.0
"""Ramp of a planned payout, hold and rest before it [s]."""

BACK = 0.6
"""Haul-in of a planned cycle, as a share of the speed of its payout."""


class _Explanations(NamedTuple):
    """Two explanations of the same data as models, and the other with one number moved after the other.

    Of the other, `tolerances` moves numbers of the rig by one tolerance each and `fields` those of its effects, each by a step;
    `precision` (k, k) is the information of the data on these fields.
    """

    best: Model
    other: Model
    tolerances: Sequence[Model]
    fields: Sequence[tuple[Model, float]]
    precision: Signal


def plan_run(data: Fitted, found: Found, causes: Sequence[NamedCause]) -> Experiment | None:
    """Choose the run in which a cause and its alternative differ most beyond noise, tolerances and what the latter can adapt.

    The cause is the first with an alternative that a run could distinguish from it, else the leading one, whose alternative is
    then the physical suspect with the most evidence in its place. A wrong load of one run is checked on the rig, not by a run.
    """
    suspects = found.problem.suspects
    others = [name for name in suspects if name not in found.best.names and suspects[name].stage != "entry"]
    causes = [cause for cause in causes if suspects[cause.effect].name != LOAD]
    if not causes or not others:
        return None
    apart = {cause.effect: [r.effect for r in cause.look_alikes if suspects[r.effect].name != LOAD] for cause in causes}
    apart = {
        name: [other for other in rivals if not same_in_logs(suspects, name, other)] for name, rivals in apart.items()
    }
    drifting = [
        cause for cause in causes if cause.stability and any(t.along == "order" for t in cause.stability.trends)
    ]
    lead = next((cause for cause in causes if apart[cause.effect]), (drifting or causes)[0])
    near = apart[lead.effect][:1] or [name for name in others if not same_in_logs(suspects, lead.effect, name)]
    if not near:
        return None
    other = max(near, key=lambda r: found.expansion.rated(swap(found.best.names, lead.effect, r)))
    fit = found.fit(swap(found.best.names, lead.effect, other))
    speed, length = _usual(data)
    loads = sorted({log.load for log in data.logs})
    tried = dict.fromkeys([loads[0], loads[len(loads) // 2], loads[-1]])
    options = [(load, share * speed) for load in tried for share in SPEEDS]
    repeats = bool(drifting) or are_confused(data, suspects[lead.effect], suspects[other])
    if repeats:  # a light load again, after all others
        options = [(load, speed) for load in loads[-2:]]
    both = {load: _explanations(data, found, fit, load) for load, _ in options}
    scores = all_at_once([partial(_score, data, both[load], _planned(load, v, length, data)) for load, v in options])
    z, (load, v) = max(zip(scores, options, strict=True), key=lambda pair: pair[0])
    again = next(log.run.name for log in data.logs if log.load == load) if repeats else ""
    return Experiment("cycle", v, (lead.effect, other), z, load=load, length=length, repeats=again)


def _explanations(data: Fitted, found: Found, fit: Fit, load: float) -> _Explanations:
    """Two explanations in a run with a load that is made after all others."""
    heat = float(np.mean([data.order.heat[k] for k, log in enumerate(data.logs) if log.load == load]))
    suspects, best, one = found.problem.suspects, found.best, np.eye(fit.nu.size)
    effects = fit.effects(suspects)
    fields = []
    for name, effect in zip(fit.names, effects, strict=True):
        for moved, step in varied(suspects[name], fit.x[fit.place[name]], 0.02):
            model = data.model_after(fit.nu, [moved if other is effect else other for other in effects], heat)
            fields.append((model, step))
    return _Explanations(
        best=data.model_after(best.nu, best.effects(suspects), heat),
        other=data.model_after(fit.nu, effects, heat),
        tolerances=[
            data.model_after(fit.nu + one[k], effects, heat) for k, n in enumerate(data.nuisances) if n.kind == "rig"
        ],
        fields=fields,
        precision=fit.curve + np.diag(fit.free.sd**-2.0),
    )


def _usual(data: Fitted) -> tuple[float, float]:
    """Fastest plateau [m/s] and median length of a payout [m] of the campaign."""
    fastest = max(float(np.quantile(log.run.channels["velocity"], 0.97)) for log in data.logs)
    lengths = []
    for log in data.logs:
        blocks, x = log.course.blocks, log.course.displacement
        for cycle in np.unique(blocks.cycle[blocks.phase == 0]):
            own = np.flatnonzero((blocks.cycle == cycle) & (blocks.phase == 0))
            lengths.append(float(x[blocks.stop[own[-1]] - 1] - x[blocks.start[own[0]]]))
    return max(fastest, 0.0), float(np.median(lengths)) if lengths else 1.0


def _planned(load: float, speed: float, length: float, data: Fitted) -> Run:
    """A run of one trapezoid out and one back, without noise."""
    out, back = max(length / speed - RAMP, 0.5), max(length / (BACK * speed) - RAMP, 0.5)
    corners = np.cumsum([0.0, REST, RAMP, out, RAMP, HOLD, RAMP, back, RAMP, REST])
    v = np.array([0.0, 0.0, speed, speed, 0.0, 0.0, -BACK * speed, -BACK * speed, 0.0, 0.0])
    fs = data.logs[0].run.fs
    t = np.arange(0.0, corners[-1], 1.0 / fs)
    velocity = np.interp(t, corners, v)
    return Run(name="planned", t=t, channels={"velocity": velocity}, fs=fs, samples=t.size, load=load)


def _score(data: Fitted, both: _Explanations, run: Run) -> float:
    """Significance with which a planned run distinguishes two explanations. [sigma]"""
    course = Course(run, blocks_of(run, data.rig), data.logs[0].course.step)
    predicted = course.predict(both.other)
    moves = [course.predict(model) - predicted for model in both.tolerances]
    for k, name in enumerate(CHANNELS):
        for kind, size in (("gain", predicted[:, k]), ("zero", 1.0)):
            sd = max((n.sd for n in data.nuisances if n.kind == kind and n.name == name), default=0.0)
            moves.append(np.zeros_like(predicted))
            moves[-1][:, k] = sd * size
    moves += [(course.predict(model) - predicted) / step for model, step in both.fields]
    noise = _planned_noise(data, course.blocks.phase)
    z, j = (
        ((course.predict(both.best) - predicted) / noise).ravel(),
        np.column_stack([(x / noise).ravel() for x in moves]),
    )
    prior, own = np.eye(j.shape[1]), len(both.fields)
    prior[j.shape[1] - own :, j.shape[1] - own :] = both.precision
    pull = j.T @ z
    return math.sqrt(max(float(z @ z - pull @ np.linalg.solve(j.T @ j + prior, pull)), 0.0))


def _planned_noise(data: Fitted, phase: NDArray[np.intp]) -> Signal:
    """Noise of planned blocks, (m, 5): the median of the campaign in the same phase; inf where a channel has no information."""
    sd = np.full((phase.size, len(CHANNELS)), math.inf)
    for p in range(len(PHASES)):
        for k in range(len(CHANNELS)):
            own = data.noise[data.seen[:, k] & (data.blocks.phase == p), k]
            if own.size:
                sd[phase == p, k] = float(np.median(own))
    return sd
