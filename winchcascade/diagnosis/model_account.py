"""What is kept of a log beside its simulation: curves, differences, loss budget, and of an open circuit two fits."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import KGCM2
from winchcascade.diagnosis.calibrate import back_emf_of
from winchcascade.diagnosis.compared_curves import (
    ComparedCurve,
    curves_of,
    kept,
    means,
    minimum_of,
    speed_width,
)
from winchcascade.diagnosis.damper_curves import FACTORS, tensions
from winchcascade.diagnosis.loss_budget import LossBudget, budget_of
from winchcascade.diagnosis.model_comparison import ModelComparison, before_braking, compare_with_baseline
from winchcascade.reduction.reduction_result import Reduction

COMPARED = {"torque": 1.0, "vdc": 1.0, "idc": 1.0, "pressure": 1.0 / KGCM2, "force": 1.0}
"""Channels whose differences are kept, and the factor that turns SI units into kg/cm2 for the pressure."""

MAX_POINTS = 150
"""Maximum number of samples of a regression that are kept; of more an even selection."""


class ChannelDifference(msgspec.Struct, frozen=True):
    """Log minus simulation of one channel over the payouts: mean and root mean square, SI units or kg/cm2."""

    bias: float
    rms: float


class Sweep(msgspec.Struct, frozen=True):
    """Line tension in bins of generator speed, logged and simulated with the rig's damper times each of `factors` [N]."""

    rpm: tuple[float, ...]
    log: tuple[float, ...]
    factors: tuple[float, ...]
    simulated: tuple[tuple[float, ...], ...]
    nominal: float


class Regression(msgspec.Struct, frozen=True):
    """Back-EMF line to line, rms, over generator speed in open circuit, and its slope with 95 % interval [V/rpm].

    `v_dc` [V] is the DC voltage at the same samples, `reference` the back-EMF constant of the rig file [V/rpm].
    """

    rpm: tuple[float, ...]
    v_ll: tuple[float, ...]
    v_dc: tuple[float, ...]
    slope: float
    low: float
    high: float
    r2: float
    points: int
    reference: float


class Account(msgspec.Struct, frozen=True, omit_defaults=True):
    """All that is kept of one comparison; `why` is the reason if there is none.

    `word` is what the log is called, `cycles` of `total` complete cycles are compared, `rated` is the generator's speed [rpm],
    `gear` its speed over that of the drum.
    """

    why: str = ""
    word: str = "log"
    rig: str = ""
    changed: str = ""
    open_circuit: bool = False
    cycles: int = 0
    total: int = 0
    rated: float | None = None
    gear: float | None = None
    curves: dict[str, ComparedCurve] = {}
    differences: dict[str, ChannelDifference] = {}
    budget: LossBudget | None = None
    sweep: Sweep | None = None
    regression: Regression | None = None


class Modelled(NamedTuple):
    """A comparison with what is kept of it; without one the account gives the reason."""

    comparison: ModelComparison | None
    account: Account


def modelled(reduction: Reduction) -> Modelled:
    """Compare a log with the model that its rig file gives."""
    found = compare_with_baseline(reduction)
    if isinstance(found, ModelComparison):
        return Modelled(found, account_of(found))
    return Modelled(None, Account(why=found.why, word=reduction.run.origin.word))


def account_of(comparison: ModelComparison) -> Account:
    """Put together what is kept of a comparison."""
    run, rig = comparison.run, comparison.rig
    rated, gear = rig.generator.speed_rated, rig.drivetrain.gear_ratio
    return Account(
        word=run.origin.word,
        rig=rig.name,
        changed=comparison.changed,
        open_circuit=run.open_circuit,
        cycles=len(comparison.cycles),
        total=comparison.total,
        rated=None if rated is None else rated.value * 30.0 / math.pi,
        gear=None if gear is None else gear.value,
        curves=curves_of(comparison),
        differences=differences_of(comparison),
        budget=budget_of(comparison),
        sweep=sweep_of(comparison) if run.open_circuit else None,
        regression=regression_of(comparison) if run.open_circuit else None,
    )


def differences_of(comparison: ModelComparison) -> dict[str, ChannelDifference]:
    """Log minus simulation over the payouts, channel by channel; torque and Idc not in open circuit."""
    run, model, rows = comparison.run.channels, comparison.simulation.run.channels, comparison.payout
    left_out = ("torque", "idc") if comparison.run.open_circuit else ()
    apart = {
        name: (run[name][rows] - model[name][rows]) * factor
        for name, factor in COMPARED.items()
        if name in run and name not in left_out and rows.any()
    }
    return {name: ChannelDifference(float(np.mean(x)), float(np.sqrt(np.mean(x**2)))) for name, x in apart.items()}


def sweep_of(comparison: ModelComparison) -> Sweep | None:
    """Simulate an open circuit with other dampers on the fast shaft (Fig. 11); None without a force channel or a damper."""
    run, model, rows = comparison.run, comparison.simulation.model, comparison.driven
    if "force" not in run.channels or model.drivetrain.b_rotor == 0.0 or not rows.any():
        return None
    forces = [force[rows] for force in (run.channels["force"], *tensions(run, model, comparison.simulation))]
    rpm, log, *simulated = means(comparison.rpm[rows], speed_width(comparison), *forces, minimum=minimum_of(comparison))
    return Sweep(kept(rpm), kept(log), FACTORS, tuple(kept(x) for x in simulated), model.drivetrain.b_rotor)


def regression_of(comparison: ModelComparison) -> Regression | None:
    """Fit the back-EMF constant of an open circuit above 1000 rpm (Fig. 12); None where the log does not carry it."""
    try:
        fit = back_emf_of(comparison.run, comparison.rig, before_braking(comparison.cycles))
    except LogError:
        return None
    even = np.linspace(0, fit.rpm.size - 1, min(fit.rpm.size, MAX_POINTS)).round().astype(np.intp)
    rpm, v_ll, v_dc = (kept(x[even]) for x in (fit.rpm, fit.v_ll, fit.vdc))
    reference = comparison.simulation.model.generator.k_e
    return Regression(rpm, v_ll, v_dc, fit.k_e, fit.low, fit.high, fit.r2, fit.rpm.size, reference)
