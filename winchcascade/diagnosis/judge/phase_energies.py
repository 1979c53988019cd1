"""Signed energies by run, phase and stage: measured, by the model before and after, and how well
their difference is known.

The difference of an energy from that of the fit is linear in the noise of the blocks e, the
parameters of the fit and the discrepancy d of the model, which the fit knows as theta = S A' z. Of
blocks that take part in the fit, with weights a of the energy, b its derivative over the parameters
without the discrepancy, and c that over the discrepancy of unit variance, it has the variance

    u^2 = a' N a + c' c - b' S b,

as far as the fit follows the data; what does not take part adds 2 g' S b, with g its own derivative
over all parameters. The discrepancy has the size that the fit finds, as most rigs have less than
what is allowed of any. That of Vdc is that of Idc, as a load ties them. Of a power that is next to
nothing the products of the zeros and of the noise of both count, too.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.integrate import white_noise
from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.diagnosis_result import StageEnergy
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.covariance import discrepancy_found
from winchcascade.diagnosis.fit.evidence import inside_of
from winchcascade.diagnosis.fit.fit_set import STEP
from winchcascade.diagnosis.fit.fitted_log import RHO
from winchcascade.diagnosis.fit.marginal import Columns
from winchcascade.diagnosis.fit.nuisances import WITHOUT_ZERO, sensor_errors
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import varied
from winchcascade.diagnosis.verdict_limits import LAW

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.evidence import Fit
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.fit.suspects import Suspects

FACTORS = {"line": ("force", "velocity"), "mech": ("torque", "velocity"), "gen": ("vdc", "idc")}
"""Channels whose product is the power of each stage; the speed of the drum is that of the line
over its radius.
"""

IN_A_ROW = (1.0 + RHO) / (1.0 - RHO)
"""Variance of a sum over many blocks, the errors of which follow one another, over that of
independent ones. [1]
"""


class Known(NamedTuple):
    """What a fit leaves open of a campaign, about its best place.

    `moved` (M, 5, p) is what one unit of each of p parameters moves that is simulated, `covariance`
    (p + q, p + q) that of these and of the q nuisances that are not. `by_course` (courses, n) are
    standard deviations of the discrepancies of the model along each of their courses, 0 for all
    other nuisances, in units of their tolerances, and `scale` is the square by which the noise
    exceeds its estimate.
    """

    moved: Signal
    covariance: Signal
    by_course: Signal
    scale: float


def energies_of(data: Fitted, suspects: Suspects, fit: Fit) -> tuple[StageEnergy, ...]:
    """Energies of every run by phase; without stages that a run cannot give."""
    effects, nothing = fit.effects(suspects), np.zeros_like(fit.nu)
    skew, zeros, known = data.skew(fit.nu), data.zeros(fit.nu), _known(data, suspects, fit)
    models = [data.models(nothing, []), data.models(fit.nu, []), data.models(fit.nu, effects)]

    def of_run(k: int) -> list[StageEnergy]:
        log = data.logs[k]
        given = log.at_stamps(models[0][k], np.zeros_like(skew), zeros[k])
        fitted = [log.at_stamps(model[k], skew, zeros[k]) for model in models[1:]]
        return [
            one for stage in FACTORS for one in _of_stage(data, known, k, stage, (given, *fitted))
        ]

    several = all_at_once([partial(of_run, k) for k in range(len(data.logs))], data.sizes)
    return tuple(one for energies in several for one in energies)


def _known(data: Fitted, suspects: Suspects, fit: Fit) -> Known:
    """What a fit leaves open: its nuisances, and the fields of its effects that lie at no bound."""
    acting = fit.acting(suspects)
    effects = [*acting.values()]
    at = data.predict(fit.nu, effects)
    steps = [
        (acting | {name: moved}, step)
        for name in fit.names
        for moved, step in varied(suspects[name], fit.x[fit.place[name]], STEP)
    ]
    of_fields = [
        (one, step) for (one, step), inside in zip(steps, inside_of(fit), strict=True) if inside
    ]
    by_nuisance, by_field = data.tolerances(fit.nu, effects), np.zeros((*at.shape, len(of_fields)))
    there = data.predictions_near(
        (fit.nu, effects), [(fit.nu, [*one.values()]) for one, _ in of_fields]
    )
    for k, (_, step) in enumerate(of_fields):
        by_field[:, :, k] = (there[:, :, k] - at) / step
    moved = np.concatenate([by_field, by_nuisance], axis=2)
    prior = np.concatenate([fit.free.sd[inside_of(fit)] ** -2.0, np.ones(fit.nu.size)])
    information = Columns(data.whiten(moved), data.local).squared() / fit.scale
    first = by_field.shape[2]
    determined = 1.0 - np.diag(np.linalg.inv(information + np.diag(prior)))[first:]
    prior[first:] /= discrepancy_found(data, fit.nu, determined)
    courses = [n.kind == "discrepancy" and (math.isnan(n.load), n.course) for n in data.nuisances]
    along = [[own == course for own in courses] for course in dict.fromkeys(courses) if course]
    return Known(
        moved,
        np.linalg.inv(information + np.diag(prior)).astype(np.float64),
        np.array(along).reshape(-1, fit.nu.size) * prior[first:] ** -0.5,
        fit.scale,
    )


def _of_stage(
    data: Fitted, known: Known, k: int, stage: str, models: tuple[Signal, ...]
) -> list[StageEnergy]:
    """Energies of one stage of one run by phase.

    Parameters
    ----------
    models : (n, 5) channels of the run each, by the model of the rig file, by that of the fit
        without its effects and with them, SI units
    """
    log, (name, other) = data.logs[k], FACTORS[stage]
    run, blocks, column = log.run, log.course.blocks, CHANNELS.index(name)
    if not {name, other} <= run.channels.keys() or (stage == "gen" and math.isinf(log.load)):
        return []
    factor = run.channels[other] / (data.nominal.r_motion if stage == "mech" else 1.0)
    seconds = blocks.count / run.fs
    powers = [run.channels[name] * factor]
    powers += [
        x[:, column] * (x[:, CHANNELS.index(other)] if stage == "gen" else factor) for x in models
    ]
    joule = np.array([blocks.mean(power) * seconds for power in powers])
    weights = np.zeros((blocks.size, len(CHANNELS)))
    weights[:, column] = blocks.mean(factor) * seconds
    if stage == "gen":
        weights[:, CHANNELS.index(other)] = blocks.mean(run.channels[name]) * seconds
    zeros = [sensor_errors(data.rig.sensors.get(one))[1] for one in (name, other)]
    noises = [white_noise(run.channels[one]) for one in (name, other)]
    found = []
    for number, phase in enumerate(PHASES):
        here = blocks.phase == number
        if not here.any() or (phase == "hold" and stage != "gen"):
            continue
        measured, given, without, fitted = joule[:, here].sum(axis=1).tolist()
        variance = _variance(data, known, k, np.where(here[:, None], weights, 0.0))
        both = 0.0
        if stage == "gen":
            length, samples = float(seconds[here].sum()), float(blocks.count[here].sum())
            both = length * math.hypot(math.prod(zeros), math.prod(noises) / math.sqrt(samples))
        u = math.hypot(math.sqrt(variance), both, LAW * (fitted - without))
        found.append(
            StageEnergy(
                k, phase, stage, measured, given, fitted, u, int(np.unique(blocks.cycle[here]).size)
            )
        )
    return found


def _variance(data: Fitted, known: Known, k: int, weights: Signal) -> float:
    """Variance of the difference of an energy from that of the fit. [J^2]

    Parameters
    ----------
    weights : (m, 5) what one unit of each channel in each block adds to the energy
    """
    log, rows = data.logs[k], data.rows[k]
    taking = data.seen[rows] & (k not in data.withheld)
    each, shared = log.noise.own_total * weights, np.sum(log.noise.drive * weights, axis=1)
    noise = known.scale * IN_A_ROW * float(np.sum(each**2) + np.sum(shared**2))
    for name in WITHOUT_ZERO:
        noise += (
            sensor_errors(data.rig.sensors.get(name))[1]
            * float(weights[:, CHANNELS.index(name)].sum())
        ) ** 2
    cells = slice(len(CHANNELS) * rows.start, len(CHANNELS) * rows.stop)
    moved, locally = known.moved[rows], data.moved_locally[cells]
    inside, outside = (
        np.concatenate([np.tensordot(part, moved, axes=2), part.ravel() @ locally])
        for part in (np.where(taking, weights, 0.0), np.where(taking, 0.0, weights))
    )
    both = inside + outside
    by_nuisance = both[-known.by_course.shape[1] :]
    of_model = float(np.sum((known.by_course @ by_nuisance) ** 2))
    by_nuisance[known.by_course.any(axis=0)] = 0.0
    follows = known.covariance @ both
    return max(noise + of_model - float(both @ follows) + 2.0 * float(outside @ follows), noise)
