"""Stator current of the corrected model over the loads of a campaign, and the DC current that belongs to its rated value."""

from __future__ import annotations

import math

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.diagnosis.block_means import PAYOUT
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.kernel import constants

NEAR = 0.15
"""The rated DC current comes from blocks whose stator current is within this share of the rated one. [1]"""


def by_load(found: ModelDiagnosis) -> list[int]:
    """Numbers of the logs from the open circuit to the smallest resistance."""
    return sorted(range(len(found.data.logs)), key=lambda k: -found.data.logs[k].load)


def loaded(found: ModelDiagnosis) -> list[int]:
    """Numbers of the logs with a load, from the largest resistance to the smallest."""
    return [k for k in by_load(found) if math.isfinite(found.data.logs[k].load)]


def stator_current(found: ModelDiagnosis) -> tuple[Signal, Signal]:
    """Stator current of the model with the causes and logged DC current, over the payout blocks of all loads, (n,) each. [A]"""
    data, best = found.data, found.found.best
    models = data.models(best.nu, best.effects(found.suspects))
    pairs = [np.zeros((2, 0))]
    for k in loaded(found):
        log = data.logs[k]
        here = log.noise.seen[:, CHANNELS.index("idc")] & (log.course.blocks.phase == PAYOUT)
        stator = log.course.block_mean(log.course.electrical(constants(models[k], log.course.load), "i_s"))
        pairs.append(np.array([stator, log.measured[:, CHANNELS.index("idc")]])[:, here])
    stator, direct = np.concatenate(pairs, axis=1)
    return stator, direct


def rated_dc_current(found: ModelDiagnosis) -> float | None:
    """DC current at which the stator carries its rated current, in the middle of all loads; None where none comes near. [A]"""
    rated = found.rig.generator.i_rated
    if rated is None:
        return None
    stator, direct = stator_current(found)
    near = np.abs(stator / rated.value - 1.0) < NEAR
    return float(np.median(direct[near] * rated.value / stator[near])) if np.any(near) else None
