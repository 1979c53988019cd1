"""Which runs to make: those that separate two effects, or that determine a metric well enough, by the derivatives of a fit.

Before a campaign the rig file with its tolerances is all that is known; after one, what its diagnosis left open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial, reduce
from operator import add
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import all_at_once
from winchcascade.core.viewed import Viewed
from winchcascade.design.operating import PLACE, QUANTITIES, path_of, planned_cycle, points, require_positive
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.planning import RAMP, SPEEDS, Explanations, distinction_of, explanations_of, planned, usual
from winchcascade.diagnosis.posterior import OF_THE_RIG, RigPosterior, posterior_of_rig
from winchcascade.diagnosis.suspects import freedom, varied, with_values
from winchcascade.rig.baseline import baseline
from winchcascade.rig.simulate import READ, simulate

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect, Effect
    from winchcascade.rig.parts import Model

MOST = 12
"""Runs of a plan that is not limited."""

CLEAR = 3.0
"""Standard deviations at which two effects count as separated."""

DRAWS, SEED = 200, 1
"""Random plans of the same length that a plan is compared with, and their seed."""

HALF = 0.5
"""Share of the plausible range that an effect is taken to have before a campaign. [1]"""

SAMPLE_NOISE = 0.002
"""Noise of a sample before a campaign, as a share of the largest value of the channel in the run. Assumed. [1]"""

SAMPLES = 250.0
"""Samples of a stroke at the top speed in a planned campaign. [1]"""


Place = Literal["first", "any", "last"]
"""When a run is made: with a machine that is cold, at any time, or after all other runs."""


class PlannedRun(msgspec.Struct, frozen=True):
    """A run to be made: load [ohm], speed of the plateau [m/s], number of cycles, and its place among the runs."""

    load: float
    speed: float
    cycles: int = 1
    place: Place = "any"


class RunPlan(Viewed, frozen=True, kw_only=True):
    """Runs in the order in which they help most, and what is expected.

    Before a campaign the lightest comes once more at the end, as a machine that warms shows there.

    `measure` is what counts: `z` of the separation of `pair` or `u` of `metric`; `expected` is its value after each run,
    `before` that without any, `wanted` that to be reached, `random` the mean over random plans of the same length,
    `random_share` the share of these that reach what is wanted.
    """

    title: str
    rig: str
    runs: tuple[PlannedRun, ...]
    measure: str
    pair: tuple[str, str] | None
    metric: str | None
    before: float
    expected: tuple[float, ...]
    wanted: float
    random: float
    random_share: float
    length: float

    @property
    def reached(self) -> bool:
        """Whether the plan reaches what is wanted, or nothing has to be run for it."""
        return _better(self.measure, (self.before, *self.expected)[-1], self.wanted)


class Basis(NamedTuple):
    """What a plan begins from: logs of the rig, made or simulated, and the best effects with the nuisances they go with."""

    title: str
    rig: Rig
    data: Fitted
    found: ModelDiagnosis | None
    options: Sequence[PlannedRun]
    length: float


def after(found: ModelDiagnosis, loads: Sequence[float] = (), speeds: Sequence[float] = ()) -> Basis:
    """Begin from a diagnosis: loads of its runs, and up to 1.3 times their fastest speed at the load, unless others are named.

    Raises
    ------
    OptionError : a speed that is none, or no log has a payout
    """
    _require(loads, speeds)
    seen = usual(found.data)
    if seen is None:
        raise OptionError(f"{found.title}: no log has a payout; expected one at least.")
    at_loads = sorted(loads or {log.load for log in found.data.logs})
    options = [
        PlannedRun(load, speed, place="last")
        for load in at_loads
        for speed in speeds or [share * seen.fastest_at(load) for share in SPEEDS]
    ]
    return Basis(found.title, found.rig, found.data, found, options, seen.length)


def before(rig: Rig, loads: Sequence[float], speeds: Sequence[float], length: float) -> Basis:
    """Begin from a rig file, before any run is made.

    Parameters
    ----------
    loads, speeds : that the rig can be run at [ohm, m/s]
    length : of a payout [m]

    Raises
    ------
    OptionError : no load or no speed, a speed or a length that is none
    RigError : the rig has no model
    """
    if not loads or not speeds:
        raise OptionError(
            f"plan for rig {rig.name}: expected --loads OHM,... and --speeds MPS,..., as no run is made yet."
        )
    _require(loads, speeds)
    require_positive("--length", [length])
    model, rng, time = baseline(rig), np.random.default_rng(SEED), length / max(speeds)
    runs = []
    for load in sorted(loads):
        motion = planned(load, max(speeds), length, time, SAMPLES / time)
        run = simulate(motion, model).run
        noise = {name: SAMPLE_NOISE * float(np.max(np.abs(run.channels[name]))) for name in READ}
        channels = {name: x + rng.normal(0.0, noise.get(name, 0.0), x.size) for name, x in run.channels.items()}
        runs.append(msgspec.structs.replace(run, name=f"{load:g} ohm", channels=channels, simulated=False, rig=rig))
    options = [PlannedRun(load, speed) for load in sorted(loads) for speed in sorted(speeds)]
    return Basis(rig.title or rig.name, rig, Fitted(runs, rig), None, options, length)


def _require(loads: Sequence[float], speeds: Sequence[float]) -> None:
    """Raise OptionError for speeds, and loads but open circuits, that are not finite and above 0."""
    require_positive("--loads", [load for load in loads if load != math.inf])
    require_positive("--speeds", speeds)


# ------------------------------------------------------------------------------------------------------ two explanations
def separate(
    basis: Basis, pair: tuple[str, str], suspects: Suspects, most: int = MOST, wanted: float = CLEAR
) -> RunPlan:
    """Plan runs that separate two effects.

    Raises
    ------
    OptionError : an effect is no suspect of this rig, or both are the same
    """
    if len(set(pair)) < len(pair):
        raise OptionError(f"--separate {' '.join(pair)}: expected two effects.")
    for name in pair:
        if name not in suspects:
            raise OptionError(f"--separate {' '.join(pair)}: {name} is no suspect of rig {basis.rig.name}.")
    if basis.found is not None:
        make, precision = _after_pair(basis, pair)
    else:
        make, precision = _before_pair(basis, [suspects[name].at(basis.data.scales) for name in pair])
        if any(suspects[name].over_runs is not None for name in pair):
            cold_or_warm: Sequence[Place] = ("first", "last")
            each = [msgspec.structs.replace(one, place=place) for one in basis.options for place in cold_or_warm]
            basis = basis._replace(options=each)
    both = {key: make(*key) for key in {(option.load, option.place) for option in basis.options}}
    rate = basis.data.logs[0].run.fs
    jobs = [
        partial(
            distinction_of,
            basis.data,
            both[one.load, one.place],
            planned(one.load, one.speed, basis.length, basis.data.scales.motion.time, rate),
        )
        for one in basis.options
    ]
    distinctions = all_at_once(jobs)

    def z_of(chosen: Sequence[int]) -> float:
        return reduce(add, [distinctions[k] for k in chosen]).separation(precision) if chosen else 0.0

    return _greedy(basis, z_of, "z", most, wanted, pair=pair)


Making = Callable[[float, Place], Explanations]
"""The two explanations in a run at a load [ohm] and a place."""


def _after_pair(basis: Basis, pair: tuple[str, str]) -> tuple[Making, Signal]:
    """The two explanations of the logs that a diagnosis fits, one effect in place of the other, the better one first."""
    assert basis.found is not None
    found = basis.found.found
    others = tuple(name for name in found.best.names if name not in pair)
    fits = [found.fit(tuple(sorted((*others, name)))) for name in pair]
    best, other = sorted(fits, key=lambda fit: fit.loss)
    precision = other.curve + np.diag(other.free.sd**-2.0)
    return lambda load, _: explanations_of(basis.data, found, (best, other), load), precision


def _before_pair(basis: Basis, effects: Sequence[Effect]) -> tuple[Making, Signal]:
    """The first effect at half of its plausible range, and the second, which adapts.

    One that changes from run to run is absent in a first run.
    """
    first, second = effects
    free, other = freedom(first), freedom(second)
    away = np.where(free.high - free.absent >= free.absent - free.low, free.high, free.low)
    acting = with_values(first, free.absent + HALF * (away - free.absent))
    data, nothing = basis.data, np.zeros(len(basis.data.nuisances))
    one = np.eye(nothing.size)

    def explained(_load: float, place: Place) -> Explanations:
        def model(effects: Sequence[ActiveEffect], nu: Signal = nothing) -> Model:
            return data.model(nu, effects) if place == "first" else data.model_after(nu, effects, 1.0)

        return Explanations(
            best=model([acting]),
            other=model([]),
            tolerances=[model([], one[k]) for k, n in enumerate(data.nuisances) if n.kind == "rig"],
            fields=[(model([moved]), step) for moved, step in varied(second, other.absent, 0.02)],
        )

    return explained, np.diag(other.sd**-2.0)


# ------------------------------------------------------------------------------------------------- the metric of a design
def determine(basis: Basis, metric: str, wanted: float, most: int = MOST) -> RunPlan:
    """Plan runs after which a metric is known to a standard uncertainty, at every load at the fastest speed planned for it.

    Raises
    ------
    OptionError : no such metric, or open circuits alone
    """
    if metric not in QUANTITIES:
        raise OptionError(f"--uncertainty {metric}: no such metric; expected {', '.join(QUANTITIES)}.")
    if not 0.0 < wanted < math.inf:
        raise OptionError(
            f"--uncertainty {metric}={wanted:g}: expected METRIC=X with X above 0, such as eta_pto=0.002."
        )
    fastest = {one.load: one.speed for one in sorted(basis.options, key=lambda one: one.speed) if one.load != math.inf}
    if not fastest:
        raise OptionError(f"--uncertainty {metric}: expected a finite load at least among --loads.")
    posterior = posterior_of_rig(basis.found) if basis.found is not None else _of_rig_file(basis)
    sd = np.sqrt(np.diag(posterior.covariance))
    open_ = np.flatnonzero(sd > 0.0)
    best, moved = posterior.model(), [posterior.model(posterior.best + way) for way in np.diag(sd)[open_]]
    time, rate = basis.data.scales.motion.time, basis.data.logs[0].run.fs
    runs = [planned(one.load, one.speed, basis.length, time, rate) for one in basis.options]
    distinctions = all_at_once(
        [partial(distinction_of, basis.data, Explanations(best, best, moved, ()), run) for run in runs]
    )
    paths = {load: path_of(planned_cycle(speed, basis.length, RAMP * time), best) for load, speed in fastest.items()}
    values = [points([best, *moved], [path], [load])[:, 0, 0, PLACE[metric]] for load, path in paths.items()]
    slopes = np.transpose([value[1:] - value[0] for value in values])
    prior = np.linalg.pinv(posterior.covariance[np.ix_(open_, open_)] / np.outer(sd[open_], sd[open_]))

    def u_of(chosen: Sequence[int]) -> float:
        information = prior
        if chosen:
            information = prior + _of_numbers(np.sum([distinctions[k].information for k in chosen], axis=0), open_.size)
        return math.sqrt(float(np.max(np.sum(slopes * np.linalg.solve(information, slopes), axis=0))))

    return _greedy(basis, u_of, "u", most, wanted, metric=metric)


def _of_rig_file(basis: Basis) -> RigPosterior:
    """The rig of its file with its tolerances, as nothing else is known."""
    numbers = tuple(n for n in basis.data.nuisances if n.kind in OF_THE_RIG)
    covariance = np.diag([n.sd**2 for n in numbers])
    return RigPosterior(basis.data.nominal.physics, numbers, (0.0,) * len(numbers), (), covariance)


def _of_numbers(information: Signal, count: int) -> Signal:
    """Information of all runs on the numbers of the rig, the gains of the sensors, with unit priors, integrated out."""
    own, gains = information[:count, :count], information[count:, count:] + np.eye(len(information) - count)
    across = information[:count, count:]
    return np.asarray(own - across @ np.linalg.solve(gains, across.T))


# ---------------------------------------------------------------------------------------------------------------- choice
def _better(measure: str, one: float, other: float) -> bool:
    return one >= other if measure == "z" else one <= other


def _greedy(
    basis: Basis,
    value_of: Callable[[Sequence[int]], float],
    measure: str,
    most: int,
    wanted: float,
    *,
    pair: tuple[str, str] | None = None,
    metric: str | None = None,
) -> RunPlan:
    """Add the run that helps most until what is wanted is reached; a run may come again."""
    options, best = range(len(basis.options)), max if measure == "z" else min
    chosen: list[int] = []
    expected = [value_of(chosen)]
    while len(chosen) < most and not _better(measure, expected[-1], wanted):
        values = [value_of([*chosen, k]) for k in options]
        chosen.append(int(values.index(best(values))))
        expected.append(best(values))
    rng = np.random.default_rng(SEED)
    draws = [value_of(rng.integers(len(options), size=len(chosen)).tolist()) for _ in range(DRAWS)] if chosen else []
    runs = [basis.options[k] for k in chosen]
    if 0 < len(runs) < most and all(run.place == "any" for run in runs):
        lightest = max(chosen, key=lambda k: basis.options[k].load)
        expected.append(value_of([*chosen, lightest]))
        runs.append(msgspec.structs.replace(basis.options[lightest], place="last"))
    return RunPlan(
        title=basis.title,
        rig=basis.rig.name,
        runs=tuple(runs),
        measure=measure,
        pair=pair,
        metric=metric,
        before=expected[0],
        expected=tuple(expected[1:]),
        wanted=wanted,
        random=float(np.mean(draws)) if draws else expected[0],
        random_share=float(np.mean([_better(measure, value, wanted) for value in draws])) if draws else 1.0,
        length=basis.length,
    )
