"""What is kept of a comparison with a simulation: curves, differences, budget and what an open circuit tells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.report.model_budget import Budget, budget_of
from winchcascade.report.model_curves import (
    Curve,
    Difference,
    curves_of,
    differences_of,
    kept,
    least_of,
    means,
    speed_width,
)
from winchcascade.report.model_data import before_braking

if TYPE_CHECKING:
    from winchcascade.report.model_data import Comparison

MOST_POINTS = 150
"""Samples of a regression that are kept to be drawn; of more an even selection."""

DAMPERS = (0.0, 0.5, 1.0, 1.5, 2.0)
"""The damper of a sweep over that of the rig (Fig. 11). [1]"""


class Sweep(msgspec.Struct, frozen=True):
    """Line force in bins of generator speed, logged and simulated with the rig's damper times each of `factors` [N]."""

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
    """All that the figures across logs need of one comparison; `why` says why there is none.

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
    curves: dict[str, Curve] = {}
    differences: dict[str, Difference] = {}
    budget: Budget | None = None
    sweep: Sweep | None = None
    regression: Regression | None = None


def account_of(comparison: Comparison) -> Account:
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
        rated=None if rated is None else rated.value * 30.0 / np.pi,
        gear=None if gear is None else gear.value,
        curves=curves_of(comparison),
        differences=differences_of(comparison),
        budget=budget_of(comparison),
        sweep=sweep_of(comparison) if run.open_circuit else None,
        regression=regression_of(comparison) if run.open_circuit else None,
    )


def sweep_of(comparison: Comparison) -> Sweep | None:
    """Simulate an open circuit with other dampers on the fast shaft (Fig. 11); None without a force or a damper."""
    from winchcascade.rig.simulate import simulate

    run, model, rows = comparison.run, comparison.simulation.model, comparison.driven
    nominal = model.drivetrain.b_rotor
    if "force" not in run.channels or nominal == 0.0 or not rows.any():
        return None
    forces = [run.channels["force"][rows]]
    for factor in DAMPERS:
        shaft = msgspec.structs.replace(model.drivetrain, b_rotor=factor * nominal)
        changed = msgspec.structs.replace(model, drivetrain=shaft)
        found = comparison.simulation if factor == 1.0 else simulate(run, changed)
        forces.append(found.run.channels["force"][rows])
    rpm, log, *simulated = means(comparison.rpm[rows], speed_width(comparison), *forces, least=least_of(comparison))
    return Sweep(kept(rpm), kept(log), DAMPERS, tuple(kept(x) for x in simulated), nominal)


def regression_of(comparison: Comparison) -> Regression | None:
    """Fit the back-EMF constant of an open circuit above 1000 rpm (Fig. 12); None where the log does not carry it."""
    from winchcascade.diagnosis.calibrate import back_emf_of

    model = comparison.simulation.model
    try:
        fit = back_emf_of(comparison.run, comparison.rig, before_braking(comparison.cycles))
    except LogError:
        return None
    even = np.linspace(0, fit.rpm.size - 1, min(fit.rpm.size, MOST_POINTS)).round().astype(np.intp)
    rpm, v_ll, v_dc = (kept(x[even]) for x in (fit.rpm, fit.v_ll, fit.vdc))
    return Regression(rpm, v_ll, v_dc, fit.k_e, fit.low, fit.high, fit.r2, fit.rpm.size, model.generator.k_e)
