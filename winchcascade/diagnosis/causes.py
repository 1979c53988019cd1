"""How sure each cause is, what its numbers are, and which suspects explain the same data as well."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Alternative, NamedCause, Reported, Spot
from winchcascade.diagnosis.evidence import Fit, fit_set
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.selection import Found, Names, evidence_of
from winchcascade.diagnosis.solve import quadratic, weights
from winchcascade.diagnosis.suspects import Suspects, freedom, with_values

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted

AS_GOOD = 3.0
"""A set is a rival while its evidence falls short of the best by less than this: odds of twenty to one."""

TRIED = 3
"""So many rivals of each cause are refitted at most."""

RIVALS = 2
"""So many rivals of each cause are named at most."""

LAW = 0.01
"""No rig follows an effect's law exactly: how well what the effect does is known at best, a standard uncertainty as a share of
it. Assumed; about what twins that follow laws of their own scatter by."""

COVERED = 1.96
"""Standard deviations on either side of a 95 % interval."""


def causes_of(data: Fitted, suspects: Suspects, found: Found) -> tuple[NamedCause, ...]:
    """Every cause of the best set, most important first."""
    best = found.best
    swapped = {name: _rivals(data, suspects, found, name) for name in best.names}
    everything = {**found.fits, **{fit.names: fit for fits in swapped.values() for fit in fits}}
    chance = probabilities(everything, found.scale)
    causes = []
    for name in best.names:
        without = tuple(n for n in best.names if n != name)
        weight = found.linear.best(without)[0] - found.linear.best(best.names)[0]
        causes.append(
            NamedCause(
                effect=name,
                stage=suspects[name].stage,
                probability=sum(p for names, p in chance.items() if name in names),
                parameters=parameters_of(data, suspects, best, name, found.scale),
                rivals=tuple(_named(data, best, fit, chance) for fit in swapped[name])[:RIVALS],
                weight=weight,
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def probabilities(fits: dict[Names, Fit], scale: float) -> dict[Names, float]:
    """Posterior probability of each set among those that were fitted."""
    evidence = {tuple(sorted(names)): evidence_of(fit, scale) for names, fit in fits.items()}
    top = max(evidence.values())
    odds = {names: math.exp(max(e - top, -700.0)) for names, e in evidence.items()}
    total = sum(odds.values())
    return {names: p / total for names, p in odds.items()}


def parameters_of(data: Fitted, suspects: Suspects, fit: Fit, name: str, scale: float) -> dict[str, Reported]:
    """What is reported of one cause, with 95 % intervals; fields at a bound count as known, and a law as far as `LAW` says."""
    effect = suspects[name]
    place = _place(fit, name)
    values = fit.values[fit.names.index(name)]
    covariance = covariance_of(data, fit, scale)[place, place]
    value, absent = (with_values(effect, x).reported for x in (values, freedom(effect).absent))
    gradient = np.zeros(values.size)
    for k in range(values.size):
        step = 1e-3 * float(fit.high[place][k] - fit.low[place][k])
        step = -step if values[k] + step > fit.high[place][k] else step
        moved = values.copy()
        moved[k] += step
        gradient[k] = (with_values(effect, moved).reported - value) / step
    u = math.hypot(math.sqrt(max(float(gradient @ covariance @ gradient), 0.0)), LAW * abs(value - absent))
    return {effect.parameter: Reported(value, value - COVERED * u, value + COVERED * u, effect.unit)}


def covariance_of(data: Fitted, fit: Fit, scale: float) -> Signal:
    """Covariance of all fields of a fit, (k, k): what its data leave, nuisances included; 0 for fields at a bound.

    Residuals of one phase of a cycle are no independent numbers, whatever whitening did: a field varies at least by what the
    scores of these phases add up to (Liang and Zeger 1986).
    """
    x = np.concatenate(fit.values)
    eps = 1e-9 * (fit.high - fit.low)
    inside = np.flatnonzero((x > fit.low + eps) & (x < fit.high - eps))
    covariance = np.zeros((x.size, x.size))
    if inside.size:
        within = np.ix_(inside, inside)
        inverse = np.linalg.pinv(fit.curve[within], hermitian=True)
        own, together = scale * np.diag(inverse), np.diag(inverse @ _scattered(data, fit)[within] @ inverse)
        grown = np.sqrt(np.maximum(together / np.maximum(own, 1e-300), 1.0))
        covariance[within] = scale * inverse * np.outer(grown, grown)
    return covariance


def _scattered(data: Fitted, fit: Fit) -> Signal:
    """Scatter of the objective's slope over a fit's fields, (k, k): of phases of cycles, and of the nuisances' priors."""
    j_phi = np.hstack([fit.columns[name] for name in fit.names])
    w = weights(fit.z)
    back = quadratic(fit.z, w, fit.j_nu, j_phi, fit.nu).back
    scores = (w * fit.z)[:, None] * (j_phi - fit.j_nu @ back)
    blocks = [log.course.blocks for log in data.logs]
    stretch = np.cumsum(np.concatenate([~b.joined for b in blocks]).astype(np.intp)) - 1
    total = np.zeros((int(stretch[-1]) + 1, j_phi.shape[1]))
    np.add.at(total, np.repeat(stretch, len(CHANNELS)), scores)
    told = total[np.any(total != 0.0, axis=1)]
    if told.shape[0] < FEW:
        return np.zeros((j_phi.shape[1],) * 2)
    scattered: Signal = told.shape[0] / (told.shape[0] - 1.0) * told.T @ told + back.T @ back
    return scattered


FEW = 10
"""Fewer phases of cycles tell no scatter."""


def _place(fit: Fit, name: str) -> slice:
    ends = np.cumsum([0, *(x.size for x in fit.values)])
    k = fit.names.index(name)
    return slice(int(ends[k]), int(ends[k + 1]))


def _rivals(data: Fitted, suspects: Suspects, found: Found, name: str) -> list[Fit]:
    """Refits with another suspect in place of one cause that are about as good, best first."""
    kept = tuple(n for n in found.best.names if n != name)
    best = evidence_of(found.best, found.scale)
    about = found.linear.evidence(found.best.names, found.scale)
    others = {r: found.linear.evidence((*kept, r), found.scale) for r in suspects if r not in found.best.names}
    near = sorted((r for r in others if others[r] > about - 4.0 * AS_GOOD), key=lambda r: -others[r])[:TRIED]
    fits = []
    for r in near:
        names = tuple(sorted((*kept, r)))
        fit = found.fits.get(names) or fit_set(data, suspects, names, start=found.best, quick=True)
        if evidence_of(fit, found.scale) > best - AS_GOOD:
            fits.append(fit)
    return sorted(fits, key=lambda fit: -evidence_of(fit, found.scale))


def _named(data: Fitted, best: Fit, rival: Fit, chance: dict[Names, float]) -> Alternative:
    effect = next(n for n in rival.names if n not in best.names)
    return Alternative(effect, chance[tuple(sorted(rival.names))], _difference(data, best, rival))


def _difference(data: Fitted, best: Fit, rival: Fit) -> Spot | None:
    """Where two fits of the same data differ most; None where nothing that the logs measure tells them apart."""
    difference = (best.z - rival.z).reshape(-1, len(CHANNELS))
    most: Spot | None = None
    for rows, log in zip(data.rows, data.logs, strict=True):
        for k, channel in enumerate(CHANNELS):
            for phase, phase_name in enumerate(PHASES):
                here = difference[rows, k][log.course.blocks.phase == phase]
                size = float(np.sqrt(np.sum(here**2)))
                if size > (most.z if most else 0.0):
                    most = Spot(channel, phase_name, log.load, z=size)
    return most
