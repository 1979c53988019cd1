"""Signed energies by run, phase and stage: measured, by the model before and after, and how well their difference is known."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import StageEnergy
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.verdict_limits import LAW

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.search import Fit
    from winchcascade.diagnosis.suspects import Suspects

FACTORS = {"line": ("force", "velocity"), "mech": ("torque", "velocity"), "gen": ("vdc", "idc")}
"""Channels whose product is the power of each stage; the speed of the drum is that of the line over its radius."""


def energies_of(data: Fitted, suspects: Suspects, fit: Fit) -> tuple[StageEnergy, ...]:
    """Energies of every run by phase; stages that a run cannot give are left out.

    Their uncertainties are of noise, zeros, the discrepancy of the model and the laws of the causes.
    """
    given = data.models(np.zeros_like(fit.nu), [])
    fitted, skew, zeros = data.models(fit.nu, fit.effects(suspects)), data.skew(fit.nu), data.zeros(fit.nu)

    def of_run(k: int) -> list[StageEnergy]:
        log = data.logs[k]
        before, after = (
            log.at_stamps(model, late, zeros[k]) for model, late in ((given[k], np.zeros_like(skew)), (fitted[k], skew))
        )
        return [one for stage in FACTORS for one in _of_stage(data, k, stage, before, after)]

    several = all_at_once([partial(of_run, k) for k in range(len(data.logs))], data.sizes)
    return tuple(one for own in several for one in own)


def _of_stage(data: Fitted, k: int, stage: str, before: Signal, after: Signal) -> list[StageEnergy]:
    """Energies of one stage of one run by phase.

    Parameters
    ----------
    before, after : (n, 5) channels of the run by the model of the rig file and of the fit, SI units
    """
    log, (name, other) = data.logs[k], FACTORS[stage]
    run, blocks, column = log.run, log.course.blocks, CHANNELS.index(name)
    if not {name, other} <= run.channels.keys() or (stage == "gen" and math.isinf(log.load)):
        return []
    factor = run.channels[other] / (data.nominal.r_motion if stage == "mech" else 1.0)
    seconds = blocks.count / run.fs
    powers = [run.channels[name] * factor]
    powers += [x[:, column] * (x[:, CHANNELS.index(other)] if stage == "gen" else factor) for x in (before, after)]
    joule = np.array([blocks.mean(power) * seconds for power in powers])
    # Uncertainties of a block: what those of a channel move, the other factor as logged.
    moved = {column: np.abs(blocks.mean(factor)) * seconds}
    if stage == "gen":
        moved[CHANNELS.index(other)] = np.abs(blocks.mean(run.channels[name])) * seconds
    columns, weights = list(moved), np.array(list(moved.values()))
    u_zero = data.zeros(np.ones(len(data.nuisances)))[k, columns]
    sd = data.rig.model.discrepancy / math.sqrt(log.courses.shape[2])
    noise = np.linalg.norm(weights * log.noise.logged[:, columns].T, axis=0)
    model = np.sum(weights * sd * np.linalg.norm(log.courses[:, columns], axis=2).T, axis=0)
    found = []
    for number, phase in enumerate(PHASES):
        here = blocks.phase == number
        if not here.any() or (phase == "hold" and stage != "gen"):
            continue
        measured, given, fitted = joule[:, here].sum(axis=1).tolist()
        parts = (
            np.linalg.norm(noise[here]),
            np.sum(model[here]),
            np.sum((u_zero @ weights)[here]),
            LAW * (fitted - given),
        )
        u = float(np.linalg.norm(parts))
        found.append(StageEnergy(k, phase, stage, measured, given, fitted, u, int(np.unique(blocks.cycle[here]).size)))
    return found
