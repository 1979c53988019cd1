"""Which runs to make: those that separate two effects, or that determine a metric well enough, by
the derivatives of a fit.

Before a campaign the rig file with its tolerances is all that is known; after one, what its
diagnosis left open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.viewed import Viewed
from winchcascade.design.operating import (
    PLACE,
    QUANTITIES,
    path_of,
    planned_cycle,
    points,
    require_positive,
)
from winchcascade.diagnosis.explain.planned_run import (
    RAMP,
    SEED,
    PlannedRun,
    Prospect,
    Setting,
    prospect_of,
)
from winchcascade.diagnosis.explain.planning import (
    CLEAR,
    Explanation,
    Foreseen,
    explanation_of,
    foresee,
    foresee_pair,
    listed,
    options_after,
)
from winchcascade.diagnosis.fit.covariance import predictive_covariance
from winchcascade.diagnosis.fit.suspects import freedom, with_values
from winchcascade.diagnosis.handover.posterior import OF_THE_RIG, RigPosterior, posterior_of_rig
from winchcascade.rig.baseline import baseline
from winchcascade.rig.simulate import check_travel
from winchcascade.rig.steps import RESOLVED, rate_of_the_rotor

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.explain.planned_run import Place
    from winchcascade.diagnosis.fit.suspects import Suspects

MOST = 12
"""Runs of a plan that is not limited."""

MOST_OPTIONS = 100
"""Maximum number of runs among which a plan chooses: so many are simulated at once."""

DRAWS = 200
"""Random plans of the same length that a plan is compared with."""

HALF = 0.5
"""Share of the plausible range that an effect is taken to have before a campaign. [1]"""

SAMPLES = 250.0
"""Samples of a stroke at the top speed in a planned campaign. [1]"""


class RunPlan(Viewed, frozen=True, kw_only=True):
    """Runs in the order in which they help most, and what is expected.

    Before a campaign the lightest comes once more at the end, as a machine that warms shows there.

    `measure` is what counts: `z` of the separation of `pair` or `u` of `metric`; `expected` is its
    value after each run, `before` that without any, `wanted` that to be reached, `random` the mean
    over random plans of the same length, `random_share` the share of these that reach what is
    wanted. `together` are pairs that the diagnosis lists and no run can separate: the logs know
    their numbers as one combination alone.
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
    together: tuple[tuple[str, str], ...] = ()

    @property
    def reached(self) -> bool:
        """Whether the plan reaches what is wanted, or nothing has to be run for it."""
        return _better(self.measure, (self.before, *self.expected)[-1], self.wanted)


class Basis(NamedTuple):
    """What a plan begins from: how runs are made, those to choose from, and what a diagnosis
    found, None before any run.
    """

    title: str
    setting: Setting
    options: Sequence[PlannedRun]
    found: ModelDiagnosis | None = None


def after(
    found: ModelDiagnosis, loads: Sequence[float] = (), speeds: Sequence[float] = ()
) -> Basis:
    """Begin from a diagnosis: loads of its runs, and up to their fastest speed at the load, unless
    others are named.

    Raises
    ------
    OptionError : a speed that is none, or no log has a payout
    """
    _require(loads, speeds)
    options = options_after(found.data, found.found, loads, speeds)
    if options is None:
        raise OptionError(f"{found.title}: no log has a payout; expected one at least.")
    return _checked(Basis(found.title, *options, found))


def before(rig: Rig, loads: Sequence[float], speeds: Sequence[float], length: float) -> Basis:
    """Begin from a rig file, before any run is made.

    Parameters
    ----------
    loads, speeds : that the rig can be run at [ohm, m/s]
    length : of a payout [m]

    Raises
    ------
    OptionError : no load or no speed, a speed or a length that is none, or runs that are too long
        or too many
    RigError : the rig has no model
    LogError : a length that the gas or the drum does not allow
    """
    if not loads or not speeds:
        raise OptionError(
            f"plan for rig {rig.name}: expected --loads OHM,... and --speeds MPS,..., as no run "
            f"is made yet."
        )
    _require(loads, speeds)
    require_positive("--length", [length])
    time, model = length / max(speeds), baseline(rig)
    shortest = RESOLVED / rate_of_the_rotor(model, max(speeds))
    if RAMP * time < shortest:
        raise OptionError(
            f"--length {length:g}: the line speeds up in {RAMP * time:.2g} s; expected "
            f"{shortest:.2g} s at least."
        )
    check_travel(f"--length {length:g}", model.physics, 0.0, length)
    options = [PlannedRun(load, speed) for load in sorted(loads) for speed in sorted(speeds)]
    return _checked(
        Basis(rig.title or rig.name, Setting(rig, model, length, time, SAMPLES / time), options)
    )


def _require(loads: Sequence[float], speeds: Sequence[float]) -> None:
    """Raise OptionError for speeds, and loads but open circuits, that are not finite and above
    0.
    """
    require_positive("--loads", [load for load in loads if load != math.inf])
    require_positive("--speeds", speeds)


def _checked(basis: Basis) -> Basis:
    """A basis; OptionError for too many runs, or too long ones."""
    if len(basis.options) > MOST_OPTIONS:
        raise OptionError(
            f"--loads, --speeds: {len(basis.options)} runs; expected {MOST_OPTIONS} at most to "
            f"choose from."
        )
    setting, slowest = basis.setting, min(one.speed for one in basis.options)
    path_of(planned_cycle(slowest, setting.length, RAMP * setting.time), setting.model)
    return basis


# ------------------------------------------------------------------------------- two explanations
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
            raise OptionError(
                f"--separate {' '.join(pair)}: {name} is no suspect of rig "
                f"{basis.setting.rig.name}."
            )
    if basis.found is None:
        if any(suspects[name].over_runs is not None for name in pair):
            each = [
                msgspec.structs.replace(one, place=place)
                for one in basis.options
                for place in COLD_OR_WARM
            ]
            basis = basis._replace(options=each)
        prospect = prospect_of(basis.setting, basis.options)
        foreseen = _foreseen_before(prospect, pair, suspects)
    else:
        foreseen = foresee_pair(prospect_of(basis.setting, basis.options), basis.found.found, pair)
    return _greedy(basis, foreseen.separation, "z", most, wanted, pair=pair)


COLD_OR_WARM: tuple[Place, ...] = ("first", "last")
"""Places of runs that show what changes from run to run."""


def _foreseen_before(prospect: Prospect, pair: tuple[str, str], suspects: Suspects) -> Foreseen:
    """What runs will tell where the first effect acts at half of its plausible range, and the
    second adapts.
    """
    first, second = (suspects[name].at(prospect.runs.scales) for name in pair)
    free, other = freedom(first), freedom(second)
    away = np.where(free.high - free.absent >= free.absent - free.low, free.high, free.low)
    acting = with_values(first, free.absent + HALF * (away - free.absent))
    nothing = np.zeros(len(prospect.runs.nuisances))
    prior = np.diag(np.concatenate([other.sd**2, np.ones(nothing.size)]))
    absent = Explanation({pair[1]: with_values(second, other.absent)}, nothing, prior)
    return foresee(prospect, absent, absent._replace(effects={pair[0]: acting}))


# ------------------------------------------------------------------------- the metric of a design
def determine(basis: Basis, metric: str, wanted: float, most: int = MOST) -> RunPlan:
    """Plan runs after which a metric is known to a standard uncertainty, at every load at the
    fastest speed planned for it.

    The laws of the effects add nothing, as the runs cover the points.

    Raises
    ------
    OptionError : no such metric, or open circuits alone
    """
    if metric not in QUANTITIES:
        raise OptionError(
            f"--uncertainty {metric}: no such metric; expected {', '.join(QUANTITIES)}."
        )
    if not 0.0 < wanted < math.inf:
        raise OptionError(
            f"--uncertainty {metric}={wanted:g}: expected METRIC=X with X above 0, such as "
            f"eta_pto=0.002."
        )
    if all(one.load == math.inf for one in basis.options):
        raise OptionError(f"--uncertainty {metric}: expected a finite load at least among --loads.")
    prospect = prospect_of(basis.setting, basis.options)
    known = _known_of_the_rig(basis, prospect)
    foreseen = foresee(prospect, known.explanation, scale=known.scale)
    unit = np.linalg.norm(foreseen.root[known.places], axis=1)[:, None]
    change = _changes_of(metric, basis, known.posterior)
    gradient = np.zeros((len(foreseen.root), change.shape[1]))
    gradient[known.places] = np.divide(change, unit, out=np.zeros_like(change), where=unit > 0.0)

    def u_of(chosen: Sequence[int]) -> float:
        return math.sqrt(float(np.max(foreseen.variance(chosen, gradient))))

    return _greedy(basis, u_of, "u", most, wanted, metric=metric)


class Known(NamedTuple):
    """What is known before the planned runs: an explanation with the square `scale` by which the
    noise exceeds its estimate, the numbers of the rig, and the `places` of these among the fields
    and nuisances of the explanation.
    """

    explanation: Explanation
    scale: float
    posterior: RigPosterior
    places: list[int]


def _known_of_the_rig(basis: Basis, prospect: Prospect) -> Known:
    """What a rig file with its tolerances, or a diagnosis, knows of the numbers of the rig."""
    nuisances = prospect.runs.nuisances
    numbers = [(j, n) for j, n in enumerate(nuisances) if n.kind in OF_THE_RIG]
    if basis.found is None:
        covariance = np.diag([n.sd**2 for _, n in numbers])
        stated, moves = prospect.runs.nominal.physics, (0.0,) * len(numbers)
        posterior = RigPosterior(stated, tuple(n for _, n in numbers), moves, (), covariance)
        unknown = Explanation({}, np.zeros(len(nuisances)), np.eye(len(nuisances)))
        return Known(unknown, 1.0, posterior, [j for j, _ in numbers])
    found, posterior = basis.found.found, posterior_of_rig(basis.found)
    explanation = explanation_of(found, found.best)._replace(
        covariance=predictive_covariance(basis.found.data, found)
    )
    fields = [
        k
        for name, effect in explanation.effects.items()
        if effect in posterior.effects
        for k in range(found.best.x.size)[found.best.place[name]]
    ]
    places = [*(found.best.x.size + j for j, _ in numbers), *fields]
    return Known(explanation, found.scale, posterior, places)


def _changes_of(metric: str, basis: Basis, posterior: RigPosterior) -> Signal:
    """Change of a metric at each load with a current, at the fastest speed planned for it, by a
    standard deviation of each number of a rig, (numbers, loads).
    """
    by_speed = sorted(basis.options, key=lambda one: one.speed)
    fastest = {one.load: one.speed for one in by_speed if one.load != math.inf}
    sd = np.sqrt(np.diag(posterior.covariance))
    best, moved = (
        posterior.model(),
        [posterior.model(posterior.best + way) for way in np.diag(sd)],
    )
    length, ramp = basis.setting.length, RAMP * basis.setting.time
    changes = []
    for load, speed in fastest.items():
        path = path_of(planned_cycle(speed, length, ramp), best, basis.setting.rig.thresholds)
        values = points([best, *moved], [path], [load])[:, 0, 0, PLACE[metric]]
        changes.append(values[1:] - values[0])
    return np.transpose(changes)


# ----------------------------------------------------------------------------------------- choice
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
    draws = (
        [value_of(rng.integers(len(options), size=len(chosen)).tolist()) for _ in range(DRAWS)]
        if chosen
        else []
    )
    runs = [basis.options[k] for k in chosen]
    if 0 < len(runs) < most and all(run.place == "any" for run in runs):
        lightest = max(chosen, key=lambda k: basis.options[k].load)
        expected.append(value_of([*chosen, lightest]))
        runs.append(msgspec.structs.replace(basis.options[lightest], place="last"))
    return RunPlan(
        title=basis.title,
        rig=basis.setting.rig.name,
        runs=tuple(runs),
        measure=measure,
        pair=pair,
        metric=metric,
        before=expected[0],
        expected=tuple(expected[1:]),
        wanted=wanted,
        random=float(np.mean(draws)) if draws else expected[0],
        random_share=float(np.mean([_better(measure, value, wanted) for value in draws]))
        if draws
        else 1.0,
        length=basis.setting.length,
        together=_together(basis.found),
    )


def _together(found: ModelDiagnosis | None) -> tuple[tuple[str, str], ...]:
    """Pairs of a diagnosis that no run separates, as all logs know them together."""
    return (
        () if found is None else tuple(listed(found.found, (*found.causes, *found.candidates))[1])
    )
