"""How well planned runs distinguish two explanations of the same data, and the run that best distinguishes the leading cause
from its strongest alternative.

A planned run is one trapezoid out and one back with the noise of the campaign. The information of several runs adds up.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.block_means import PAYOUT, PHASES, blocks_of
from winchcascade.diagnosis.causes import swap
from winchcascade.diagnosis.diagnosis_result import Experiment, NamedCause
from winchcascade.diagnosis.entries import LOAD, same_in_logs
from winchcascade.diagnosis.marginal import are_together
from winchcascade.diagnosis.predict import CHANNELS, Course
from winchcascade.diagnosis.suspects import varied

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.search import Fit, Found
    from winchcascade.rig.parts import Model

SPEEDS = (0.5, 1.0, 1.3)
"""Plateau speeds that are tried, as shares of the fastest of the campaign at the load."""

RAMP, HOLD, REST, BACK, SHORTEST = 0.15, 0.4, 0.2, 0.6, 0.01
"""Ramps of a planned run, hold after its payout, rests before and after, over the time of a stroke; its haul-in as a share
of the payout speed, and the shortest plateau or ramp over that time. [1]"""


class Explanations(NamedTuple):
    """Two explanations of the same data as models, and the other with one number moved after the other.

    Of the other, `tolerances` moves numbers of the rig by one tolerance each and `fields` those of its effects, each by a step.
    """

    best: Model
    other: Model
    tolerances: Sequence[Model]
    fields: Sequence[tuple[Model, float]]


class Distinction(msgspec.Struct, frozen=True):
    """How runs distinguish two explanations, in whitened blocks: squared distance `apart`, and over what may adapt, fields
    last, the `pull` (k,) towards the first and the `information` (k, k), both beside the priors.
    """

    apart: float
    pull: Signal
    information: Signal

    def __add__(self, other: Distinction) -> Distinction:
        """That of these and of further runs."""
        return Distinction(self.apart + other.apart, self.pull + other.pull, self.information + other.information)

    def separation(self, precision: Signal) -> float:
        """Standard deviations between the two explanations after adaptation.

        Parameters
        ----------
        precision : (p, p) what is known of the fields without these runs; all else has unit priors
        """
        prior = np.eye(self.pull.size)
        prior[self.pull.size - len(precision) :, self.pull.size - len(precision) :] = precision
        adapted = self.pull @ np.linalg.solve(self.information + prior, self.pull)
        return math.sqrt(max(self.apart - float(adapted), 0.0))


def plan_run(data: Fitted, found: Found, causes: Sequence[NamedCause]) -> Experiment | None:
    """Choose the run in which a cause and its alternative differ most beyond noise, tolerances and what the latter can adapt.

    The cause is the first with an alternative that a run could distinguish from it, else the leading one, whose alternative is
    then the physical suspect with the most evidence in its place. A wrong load of one run is checked on the rig, not by a run.
    """
    suspects = found.problem.suspects
    others = [name for name in suspects if name not in found.best.names and suspects[name].stage != "entry"]
    causes = [cause for cause in causes if suspects[cause.effect].name != LOAD]
    seen = usual(data)

    def alike(one: str, other: str) -> bool:
        return are_together(found.problem.exclusive, one, other) or same_in_logs(one, other)

    if not causes or not others or seen is None:
        return None
    apart = {cause.effect: [r.effect for r in cause.look_alikes if suspects[r.effect].name != LOAD] for cause in causes}
    apart = {name: [other for other in rivals if not alike(name, other)] for name, rivals in apart.items()}
    drifting = [
        cause for cause in causes if cause.stability and any(t.along == "order" for t in cause.stability.trends)
    ]
    lead = next((cause for cause in causes if apart[cause.effect]), (drifting or causes)[0])
    near = apart[lead.effect][:1] or [name for name in others if not alike(lead.effect, name)]
    if not near:
        return None
    other = max(near, key=lambda r: found.expansion.rated(swap(found.best.names, lead.effect, r)))
    fit = found.fit(swap(found.best.names, lead.effect, other))
    loads = sorted({log.load for log in data.logs})
    tried = dict.fromkeys([loads[0], loads[len(loads) // 2], loads[-1]])
    options = [(load, share * seen.fastest_at(load)) for load in tried for share in SPEEDS]
    repeats = bool(drifting) or (suspects[lead.effect].over_runs is None) != (suspects[other].over_runs is None)
    if repeats:  # a light load again, after all others
        options = [(load, seen.fastest_at(load)) for load in loads[-2:]]
    both = {load: explanations_of(data, found, (found.best, fit), load) for load, _ in options}
    precision = fit.curve + np.diag(fit.free.sd**-2.0)
    each = all_at_once(
        [
            partial(
                distinction_of,
                data,
                both[load],
                planned(load, v, seen.length, data.scales.motion.time, data.logs[0].run.fs),
            )
            for load, v in options
        ]
    )
    scores = [one.separation(precision) for one in each]
    z, (load, v) = max(zip(scores, options, strict=True), key=lambda pair: pair[0])
    again = next(log.run.name for log in data.logs if log.load == load) if repeats else ""
    time = data.scales.motion.time
    pair = (lead.effect, other)
    return Experiment("cycle", v, pair, z, load=load, length=seen.length, time=time, repeats=again)


def explanations_of(data: Fitted, found: Found, fits: tuple[Fit, Fit], load: float) -> Explanations:
    """The better and the other fit of the same logs in a run with a load [ohm] that is made after all others."""
    known = [data.order.heat[k] for k, log in enumerate(data.logs) if log.load == load]
    heat = float(np.mean(known or data.order.heat))
    suspects, (best, fit) = found.problem.suspects, fits
    one = np.eye(fit.nu.size)
    effects = fit.effects(suspects)
    fields = []
    for name, effect in zip(fit.names, effects, strict=True):
        for moved, step in varied(suspects[name], fit.x[fit.place[name]], 0.02):
            model = data.model_after(fit.nu, [moved if other is effect else other for other in effects], heat)
            fields.append((model, step))
    return Explanations(
        best=data.model_after(best.nu, best.effects(suspects), heat),
        other=data.model_after(fit.nu, effects, heat),
        tolerances=[
            data.model_after(fit.nu + one[k], effects, heat) for k, n in enumerate(data.nuisances) if n.kind == "rig"
        ],
        fields=fields,
    )


class Usual(NamedTuple):
    """Payouts of a campaign: fastest plateau at each load [ohm: m/s], median travel [m] and median time of a ramp [s]."""

    fastest: dict[float, float]
    length: float
    ramp: float

    def fastest_at(self, load: float) -> float:
        """Fastest plateau of the logs at a load, or at that whose current is nearest to it. [m/s]"""
        return self.fastest[min(self.fastest, key=lambda other: abs(1.0 / other - 1.0 / load))]


PLATEAU, WITHIN_RAMP = 0.97, (0.05, 0.95)
"""Quantile of the velocity of a payout that is the speed of its plateau, and shares of that between which its ramp is timed."""


def usual(data: Fitted) -> Usual | None:
    """The usual payout of a campaign; None where no log has one."""
    fastest: dict[float, float] = {}
    lengths, ramps = [], []
    for log in [log for k, log in enumerate(data.logs) if k not in data.withheld]:
        blocks, velocity = log.course.blocks, log.run.channels["velocity"]
        for cycle in np.unique(blocks.cycle[blocks.phase == PAYOUT]):
            own = np.flatnonzero((blocks.cycle == cycle) & (blocks.phase == PAYOUT))
            span = slice(blocks.start[own[0]], blocks.stop[own[-1]])
            v, x, t = velocity[span], log.course.displacement[span], log.run.t[span]
            top = float(np.quantile(v, PLATEAU))
            begins, reached = (int(np.argmax(v >= share * top)) for share in WITHIN_RAMP)
            fastest[log.load] = max(fastest.get(log.load, 0.0), top)
            lengths.append(float(x[-1] - x[0]))
            ramps.append(float(t[reached] - t[begins]) / (WITHIN_RAMP[1] - WITHIN_RAMP[0]))
    if not fastest:
        return None
    shortest = SHORTEST * data.scales.motion.time
    return Usual(fastest, float(np.median(lengths)), max(float(np.median(ramps)), shortest))


def cycle_of(speed: float, length: float, time: float) -> tuple[Signal, Signal]:
    """Corners of one trapezoid out and one back, (10,): stamps [s] and velocities [m/s].

    Parameters
    ----------
    speed : of the plateau [m/s]
    length : of the payout [m]; one shorter than its ramps need reaches the speed for an instant
    time : of a stroke at the top speed of the campaign [s]
    """
    back, ramp, rest = BACK * speed, RAMP * time, REST * time
    out, home = (max(length / v - ramp, SHORTEST * time) for v in (speed, back))
    t = np.cumsum([0.0, rest, ramp, out, ramp, HOLD * time, ramp, home, ramp, rest])
    return t, np.array([0.0, 0.0, speed, speed, 0.0, 0.0, -back, -back, 0.0, 0.0])


def planned(load: float, speed: float, length: float, time: float, rate: float) -> Run:
    """A run of one such cycle, without noise.

    Parameters
    ----------
    time, rate : of a stroke at the top speed of the campaign [s], and samples a second [Hz]
    """
    corners = cycle_of(speed, length, time)
    t = np.arange(0.0, corners[0][-1], 1.0 / rate)
    return Run(name="planned", t=t, channels={"velocity": np.interp(t, *corners)}, fs=rate, samples=t.size, load=load)


def distinction_of(data: Fitted, both: Explanations, run: Run) -> Distinction:
    """How a planned run distinguishes two explanations; the zeros of its sensors are its own."""
    scale = data.scales.motion
    course = Course(run, blocks_of(run, data.rig, scale.ramp), data.logs[0].course.step, scale)
    predicted = course.predict(both.other)
    moves = [course.predict(model) - predicted for model in both.tolerances]
    zeros: list[Signal] = []
    for k, name in enumerate(CHANNELS):
        for kind, size, several in (("gain", predicted[:, k], moves), ("zero", np.ones(len(predicted)), zeros)):
            sd = max((n.sd for n in data.nuisances if n.kind == kind and n.name == name), default=0.0)
            several.append(np.zeros_like(predicted))
            several[-1][:, k] = sd * size
    moves += [(course.predict(model) - predicted) / step for model, step in both.fields]
    noise = _planned_noise(data, course.blocks.phase)
    z, j, own = (
        np.column_stack([(x / noise).ravel() for x in several])
        for several in ([course.predict(both.best) - predicted], moves, zeros)
    )
    shrink = np.linalg.inv(np.eye(own.shape[1]) + own.T @ own)  # the zeros are integrated out

    def joint(one: Signal, other: Signal) -> Signal:
        return np.asarray(one.T @ other - (one.T @ own) @ shrink @ (own.T @ other))

    return Distinction(float(joint(z, z)[0, 0]), joint(j, z)[:, 0], joint(j, j))


def _planned_noise(data: Fitted, phase: NDArray[np.intp]) -> Signal:
    """Noise of planned blocks, (m, 5): the median of the campaign in the same phase; inf where a channel has no information."""
    sd = np.full((phase.size, len(CHANNELS)), math.inf)
    for p in range(len(PHASES)):
        for k in range(len(CHANNELS)):
            own = data.noise[data.seen[:, k] & (data.blocks.phase == p), k]
            if own.size:
                sd[phase == p, k] = float(np.median(own))
    return sd
