"""Signed energies by run, phase and stage: measured, by the model before and after, and how well their difference is known."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.block_means import PAYOUT, PHASES
from winchcascade.diagnosis.causes import LAW
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted, Log
    from winchcascade.diagnosis.search import Fit
    from winchcascade.diagnosis.suspects import Suspects
    from winchcascade.rig.parts import Model

FACTORS = {"line": ("force", "velocity"), "mech": ("torque", "velocity"), "gen": ("vdc", "idc")}
"""Channels whose product is the power of each stage; the speed of the drum is that of the line over its radius."""


class PhaseEnergy(msgspec.Struct, frozen=True):
    """Energy of one stage over one phase of one run, all its cycles, payout positive [J].

    `before` is that of the model of the rig file, `after` that of the fit, each with the zeros of the sensors of the run. `u`
    is the standard uncertainty of measured minus after: noise, zeros, the discrepancy of the model and the laws of the causes.
    `scale` is the energy of the stage in payout, of the line where it is larger, `cycles` the number of cycles.
    """

    run: int
    phase: str
    stage: str
    measured: float
    before: float
    after: float
    u: float
    scale: float
    cycles: int


class _Readings(NamedTuple):
    """Channels of one run at its stamps, (n, 5) each, SI units: by the model before and after."""

    before: Signal
    after: Signal


def energies_of(data: Fitted, suspects: Suspects, fit: Fit) -> tuple[PhaseEnergy, ...]:
    """Energies of every run; stages that a run cannot give are left out."""
    given = data.models(np.zeros_like(fit.nu), [])
    fitted, skew, zeros = data.models(fit.nu, fit.effects(suspects)), data.skew(fit.nu), data.zeros(fit.nu)

    def of_run(k: int) -> list[PhaseEnergy]:
        log = data.logs[k]
        readings = _Readings(_read(log, given[k], np.zeros_like(skew), zeros[k]), _read(log, fitted[k], skew, zeros[k]))
        return [one for stage in FACTORS for one in _of_stage(data, k, stage, readings)]

    several = all_at_once([partial(of_run, k) for k in range(len(data.logs))], data.sizes)
    return tuple(one for own in several for one in own)


def _read(log: Log, model: Model, skew: Signal, zeros: Signal) -> Signal:
    return log.course.at_stamps(log.course.on_grid(model, skew=skew)) + log.offset_at_stamps + zeros


def _of_stage(data: Fitted, k: int, stage: str, readings: _Readings) -> list[PhaseEnergy]:
    """Energies of one stage of one run by phase."""
    log, (name, other) = data.logs[k], FACTORS[stage]
    run, blocks, column = log.run, log.course.blocks, CHANNELS.index(name)
    if not {name, other} <= run.channels.keys() or (stage == "gen" and math.isinf(log.load)):
        return []
    radius = data.nominal.r_motion if stage == "mech" else 1.0
    seconds = blocks.count / run.fs
    factor = run.channels[other] / radius

    def joule(x: Signal, beside: Signal) -> Signal:
        """Energy of each block, (m,)."""
        return blocks.mean(x * beside) * seconds

    by_model = [
        joule(x[:, column], x[:, CHANNELS.index(other)] if stage == "gen" else factor)
        for x in (readings.before, readings.after)
    ]
    measured = joule(run.channels[name], factor)
    # Uncertainties: what a channel's own moves the energy of a block, the other factor as logged.
    both = [(column, np.abs(blocks.mean(factor)))]
    if stage == "gen":
        both.append((CHANNELS.index(other), np.abs(blocks.mean(run.channels[name]))))
    sd = data.rig.model.discrepancy / math.sqrt(log.courses.shape[2])
    zero = {n.name: n.sd for n in data.nuisances if n.kind == "zero" and n.log == k}
    columns, weights = [c for c, _ in both], np.array([weight * seconds for _, weight in both])
    noise = np.linalg.norm(weights * log.noise.logged[:, columns].T, axis=0)
    model = np.sum(weights * sd * np.linalg.norm(log.courses[:, columns], axis=2).T, axis=0)
    zeros = np.array([zero.get(CHANNELS[c], 0.0) for c in columns]) @ weights
    payout = blocks.phase == PAYOUT
    line = joule(run.channels["force"], run.channels["velocity"]) if "force" in run.channels else measured
    scale = max(abs(float(np.sum(x[payout]))) for x in (measured, line))
    found = []
    for number, phase in enumerate(PHASES):
        here = blocks.phase == number
        if not here.any() or (phase == "hold" and stage != "gen"):
            continue
        was, before, after = (float(np.sum(x[here])) for x in (measured, *by_model))
        u = math.hypot(
            float(np.linalg.norm(noise[here])),
            float(np.sum(model[here])),
            float(np.sum(zeros[here])),
            LAW * (after - before),
        )
        cycles = int(np.unique(blocks.cycle[here]).size)
        found.append(PhaseEnergy(k, phase, stage, was, before, after, u, scale, cycles))
    return found
