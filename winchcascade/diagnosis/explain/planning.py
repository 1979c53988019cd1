"""How well planned runs distinguish two explanations of the same data, or determine numbers, and
the next run of a campaign.

A planned run is one trapezoid out and one back with the noise of the campaign. It is laid out as a
fit lays out any log, so that all nuisances of a fit take part. What the logs so far leave open is
their prior; the information of several runs adds up.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.errors import RigError
from winchcascade.core.integrate import white_noise
from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnosis_result import Experiment, NamedCause
from winchcascade.diagnosis.explain.planned_run import (
    PlannedRun,
    Prospect,
    Setting,
    prospect_of,
    simulated,
    usual,
)
from winchcascade.diagnosis.fit.covariance import joint_covariance
from winchcascade.diagnosis.fit.entries import LOAD
from winchcascade.diagnosis.fit.evidence import ROUNDING, Fit
from winchcascade.diagnosis.fit.marginal import WILD, are_together
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import freedom, varied
from winchcascade.diagnosis.judge.causes import swap
from winchcascade.diagnosis.verdict_limits import LAW
from winchcascade.rig.effects.effect import ActiveEffect
from winchcascade.rig.physics import RPM
from winchcascade.rig.simulate import Simulation

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.fit.search import Found


SPEEDS, LOADS = (0.6, 1.0), 5
"""Plateau speeds that are tried, as shares of the fastest at the load, and maximum number of
loads. [1]
"""


FEW, AWAY = 3, 2.0
"""Number of loads of a campaign below which other ones are tried, and the factor by which these
lie outside. [1]
"""


STEP = 0.02
"""Share of the plausible range of a field by which its derivative is taken. [1]"""


CLEAR = 3.0
"""Standard deviations at which two effects count as separated."""


PAIRS = 3
"""Maximum number of pairs of look-alikes for which a run is looked for, until one is found that
separates them.
"""


def _rated(rig: Rig, run: Simulation) -> float:
    """Share of the speed of a run at which the generator is within its rated speed and current,
    where these are stated. [1]
    """
    reached = (
        (rig.generator.speed_rated, float(np.max(run.rpm_gen)) / RPM),
        (rig.generator.i_rated, float(np.max(run.i_s))),
    )
    return min(
        [1.0, *(limit.value / most for limit, most in reached if limit is not None and most > 0.0)]
    )


# ---------------------------------------------------------------------------- what runs will tell
class Explanation(NamedTuple):
    """Effects that explain the logs so far, by name, the nuisances that go with them (n,), in units
    of their tolerance, and the covariance of the fields of the effects and then of the nuisances,
    (k + n, k + n).
    """

    effects: Mapping[str, ActiveEffect]
    nu: Signal
    covariance: Signal


def explanation_of(found: Found, fit: Fit) -> Explanation:
    """A fit as an explanation."""
    acting = fit.acting(found.problem.suspects)
    return Explanation(acting, fit.nu, joint_covariance(found, fit))


class Foreseen(NamedTuple):
    """What each of R planned runs will tell, beside unit priors of p numbers that are open.

    `information` (R, 1 + p, 1 + p) are what the blocks tell of another explanation and of the open
    numbers: the squared distance of the explanation, that of the numbers towards it, and their
    information. `root` (k + q, p) are fields of the explanation and nuisances of the runs over the
    open numbers.
    """

    information: Signal
    root: Signal

    def separation(self, chosen: Sequence[int]) -> float:
        """Standard deviations between the two explanations after some runs, to which the one has
        adapted.
        """
        information = self.information[list(chosen)].sum(axis=0)
        pull, known = information[1:, 0], np.eye(len(information) - 1) + information[1:, 1:]
        return math.sqrt(max(float(information[0, 0] - pull @ np.linalg.solve(known, pull)), 0.0))

    def variance(self, chosen: Sequence[int], gradient: Signal) -> Signal:
        """Variance of numbers after some runs, (m,), by their derivative over fields and
        nuisances, (k + q, m).
        """
        information, ways = self.information[list(chosen)].sum(axis=0), self.root.T @ gradient
        return np.asarray(
            np.sum(ways * np.linalg.solve(np.eye(len(ways)) + information[1:, 1:], ways), axis=0)
        )


def foresee(
    prospect: Prospect, known: Explanation, true: Explanation | None = None, scale: float = 1.0
) -> Foreseen:
    """What planned runs will tell an explanation: of its numbers, and of itself where another one
    is true.

    The zeros of the sensors, and by how much an effect deviates from its law, are those of the run
    alone: integrated out.

    Parameters
    ----------
    scale : square by which the noise exceeds its estimate [1]
    """
    runs, nu, acting = prospect.runs, prospect.carried @ known.nu, known.effects
    here = nu, [*acting.values()]
    fields = [
        (name, moved, step)
        for name, effect in acting.items()
        for moved, step in varied(effect.effect, np.array(effect.values), STEP)
    ]
    variants = [(nu, [*{**acting, name: moved}.values()]) for name, moved, _ in fields]
    there = runs.predictions_near(here, variants)
    at = runs.nearby(here).at
    by_field = _whitened(runs, (there - at[:, :, None]) / np.array([step for *_, step in fields]))
    columns = runs.columns(*here).usable()
    zero = np.array([n.kind == "zero" for n in runs.nuisances])
    carried = prospect.carried_beside(len(fields))
    new = ~(carried.any(axis=1) | np.append(np.zeros(len(fields), dtype=bool), zero))
    root = _root_of(carried @ known.covariance @ carried.T + np.diag(new.astype(np.float64)))
    open_ = by_field @ root[: len(fields)] + columns @ root[len(fields) :]
    nothing: tuple[Signal, list[Signal]] = at, []
    other, others = nothing if true is None else _beside(prospect, known, true)
    both = np.column_stack([runs.whiten(other - at), open_]) / math.sqrt(scale)
    laws = [*_of_laws(acting, [name for name, *_ in fields], by_field), *others]
    zeros = columns.local[:, zero[runs.simulated :]].toarray()
    own = np.column_stack([zeros, *(LAW * law for law in laws)]) / math.sqrt(scale)
    rows = [slice(len(CHANNELS) * one.start, len(CHANNELS) * one.stop) for one in runs.rows]
    return Foreseen(np.array([_integrated(both[one], own[one]) for one in rows]), root)


def _of_laws(
    acting: Mapping[str, ActiveEffect], owners: Sequence[str], by_field: Signal
) -> Iterator[Signal]:
    """What each effect with a law moves as a whole, whitened, (M * 5,), by the derivative over the
    fields of all, (M * 5, k).
    """
    for name, effect in acting.items():
        if effect.effect.entry is None:
            own = by_field[:, [owner == name for owner in owners]]
            yield own @ (np.array(effect.values) - freedom(effect.effect).absent)


def _beside(
    prospect: Prospect, known: Explanation, true: Explanation
) -> tuple[Signal, list[Signal]]:
    """Blocks of runs by the true explanation, (M, 5) in SI units, and what each of its effects with
    a law that the known one lacks moves there, whitened, (M * 5,).
    """
    runs, nu, acting = prospect.runs, prospect.carried @ true.nu, true.effects
    at = runs.predict(nu, [*acting.values()])
    moved = [
        at - runs.predict(nu, [one for one in acting.values() if one is not effect])
        for name, effect in acting.items()
        if name not in known.effects and effect.effect.entry is None
    ]
    return at, [_whitened(runs, one) for one in moved]


def _whitened(runs: Fitted, moved: Signal) -> Signal:
    """What moves blocks of runs, whitened, (M * 5, ...); nothing where it cannot be simulated."""
    whitened = runs.whiten(moved)
    return np.where(np.all(np.abs(whitened) < WILD, axis=0), whitened, 0.0)


def _integrated(columns: Signal, own: Signal) -> Signal:
    """Columns times each other, (k, k), where others, (n, q), with unit priors are integrated
    out.
    """
    across = own.T @ columns
    return np.asarray(
        columns.T @ columns - across.T @ np.linalg.solve(np.eye(own.shape[1]) + own.T @ own, across)
    )


def _root_of(covariance: Signal) -> Signal:
    """A root of a covariance, (k, p), of which some numbers may be known exactly."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(sd > 0.0, sd, 1.0)
    square, ways = np.linalg.eigh(covariance / np.outer(unit, unit))
    open_ = square > ROUNDING
    return np.asarray(sd[:, None] * ways[:, open_] * np.sqrt(square[open_]))


# --------------------------------------------------------------------- the next run of a campaign
def options_after(
    data: Fitted, found: Found, loads: Sequence[float] = (), speeds: Sequence[float] = ()
) -> tuple[Setting, list[PlannedRun]] | None:
    """Runs that may follow those of a campaign, each after all others; None where no log has a
    payout.

    At loads of the campaign, and where these are few at other ones, from the smallest to the
    largest, up to the fastest speed that was reached there and to the rating of the machine, where
    no other loads [ohm] or speeds [m/s] are named.
    """
    seen = usual(data)
    if seen is None:
        return None
    model, time = (
        data.model(found.best.nu, found.best.effects(found.problem.suspects)),
        data.scales.motion.time,
    )
    setting = Setting(
        data.rig, model, seen.length, time, data.logs[0].run.fs, _noise_of(data), data
    )
    run_at = {log.load for log in data.logs}
    finite = [load for load in run_at if load < math.inf]
    few = {math.inf, AWAY * max(finite), min(finite) / AWAY} if 0 < len(finite) < FEW else set()
    tried = sorted(loads) or sorted(run_at | few)
    evenly = (
        np.linspace(0.0, len(tried) - 1.0, min(len(tried), len(loads) or LOADS))
        .round()
        .astype(int)
        .tolist()
    )
    fastest = [PlannedRun(tried[k], seen.fastest_at(tried[k])) for k in evenly]
    if speeds:
        return setting, [
            PlannedRun(one.load, speed, place="last") for one in fastest for speed in speeds
        ]
    rated = [
        one.speed * _rated(data.rig, run)
        for one, run in zip(fastest, simulated(setting, fastest), strict=True)
    ]
    every = [
        (one.load, share * most)
        for one, most in zip(fastest, rated, strict=True)
        for share in SPEEDS
    ]
    return setting, [PlannedRun(*one, place="last") for one in every]


MOTION = ("velocity", "displacement")
"""Channels of the motion of the line."""


def _noise_of(data: Fitted) -> dict[str, float]:
    """Noise of a sample of each channel of a campaign that makes its blocks as uncertain as they
    are, SI units.
    """
    moves = {
        name: [white_noise(log.run.channels[name]) for log in data.logs if name in log.run.channels]
        for name in MOTION
    }
    found = {name: float(np.median(each)) for name, each in moves.items() if each}
    for k, name in enumerate(CHANNELS):
        each = [
            log.noise.own[log.noise.seen[:, k], k]
            * np.sqrt(log.course.blocks.count[log.noise.seen[:, k]])
            for log in data.logs
        ]
        if any(one.size for one in each):
            found[name] = float(np.median(np.concatenate(each)))
    return found


Pairs = list[tuple[str, str]]
"""Pairs of a cause and a look-alike."""


def listed(found: Found, causes: Sequence[NamedCause]) -> tuple[Pairs, Pairs]:
    """Pairs that a page lists: those that runs may distinguish, and those of which the logs know
    one combination alone.

    Whether a load of one run is wrong is checked on the rig, not by a run.
    """
    suspects, pairs = (
        found.problem.suspects,
        [(one.effect, other.effect) for one in causes for other in one.look_alikes],
    )
    pairs = [pair for pair in pairs if all(suspects[name].name != LOAD for name in pair)]
    together = [pair for pair in pairs if are_together(found.problem.exclusive, *pair)]
    return [pair for pair in pairs if pair not in together], together


def plan_run(data: Fitted, found: Found, causes: Sequence[NamedCause]) -> Experiment | None:
    """Choose the run in which a cause and its look-alike differ most beyond what is uncertain and
    what the latter can adapt.

    The pair is the first listed one that a run separates clearly. Without any listed, it is the
    leading cause and the physical suspect with the most evidence in its place. There is none where
    the best fit is so wrong that its rig could not make the runs.
    """
    pairs = listed(found, causes)[0][:PAIRS] or _unlisted(found, causes)
    try:
        choice = options_after(data, found) if pairs else None
        prospect = None if choice is None else prospect_of(*choice)
    except RigError:
        return None
    if choice is None or prospect is None:
        return None
    setting, options = choice
    best: tuple[float, PlannedRun, tuple[str, str]] | None = None
    for pair in pairs:
        foreseen = foresee_pair(prospect, found, pair)
        z, k = max((foreseen.separation([k]), -k) for k in range(len(options)))
        if best is None or z > best[0]:
            best = z, options[-k], pair
        if z > CLEAR:
            break
    assert best is not None
    z, run, pair = best
    drifts = any(found.problem.suspects[name].over_runs is not None for name in pair)
    again = next((log.run.name for log in data.logs if log.load == run.load), "") if drifts else ""
    return Experiment(
        "cycle",
        run.speed,
        pair,
        z,
        load=run.load,
        length=setting.length,
        time=setting.time,
        repeats=again,
    )


def _unlisted(found: Found, causes: Sequence[NamedCause]) -> Pairs:
    """The leading cause that a run can test, and the physical suspect with the most evidence in
    its place.
    """
    suspects, best = found.problem.suspects, found.best.names
    lead = next((one.effect for one in causes if suspects[one.effect].name != LOAD), None)
    if lead is None:
        return []
    others = [name for name in suspects if name not in best and suspects[name].stage != "entry"]
    others = [name for name in others if not are_together(found.problem.exclusive, lead, name)]
    swaps = {name: swap(best, lead, name) for name in others}
    rated = found.expansion.rated(swaps.values())
    near = max(swaps, key=lambda name: rated[swaps[name]], default=None)
    return [] if near is None else [(lead, near)]


def foresee_pair(prospect: Prospect, found: Found, pair: tuple[str, str]) -> Foreseen:
    """What runs will tell of two effects, one in place of the other, where the better one is
    true and the other adapts.
    """
    others = tuple(name for name in found.best.names if name not in pair)
    better, other = sorted((found.fit((*others, name)) for name in pair), key=lambda fit: fit.loss)
    return foresee(
        prospect, explanation_of(found, other), explanation_of(found, better), found.scale
    )
