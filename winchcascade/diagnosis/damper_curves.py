"""The line tension of an open circuit beside simulations with several dampers of the fast shaft (Sec. 4.2, Fig. 11)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import RigError
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.model_comparison import LEAD, LONGEST, between
from winchcascade.diagnosis.nuisances import with_quantity
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import Model, with_part
from winchcascade.rig.simulate import simulate

if TYPE_CHECKING:
    from winchcascade.diagnosis.calibrate import Calibration

FACTORS = (0.0, 0.5, 1.0, 1.5, 2.0)
"""Dampers that are simulated, over the calibrated one. [1]"""


class DamperCurves(msgspec.Struct, frozen=True):
    """The first payout of a calibration, and its line tension as simulated with several dampers of the fast shaft.

    `run` is the log from before the onset [s] to the next one. `dampers` [N m s/rad] are `FACTORS` times the calibrated one;
    `forces`, (n,) each [N], are the simulated tensions, `rms` [N] their root mean square differences from the log in payout.
    """

    run: Run
    onset: float
    dampers: tuple[float, ...]
    forces: tuple[Signal, ...]
    rms: tuple[float, ...]


def calibrated_rig(calibration: Calibration) -> Rig:
    """The rig with the numbers that the log determines."""
    rig = calibration.rig
    for n in calibration.numbers:
        if n.new:
            rig = with_quantity(rig, n.section, n.name, Quantity(n.value, n.unit, n.how, n.u))
    return rig


def damper_curves(calibration: Calibration) -> DamperCurves | None:
    """Simulate the first payout with the calibrated rig and other dampers; None where no rig can have its numbers."""
    if not calibration.settled:
        return None
    (onset, braking), *others = calibration.payouts
    run = between(calibration.run, onset - LEAD, min([onset + LONGEST, *(begin - LEAD for begin, _ in others)]))
    try:
        model = baseline(calibrated_rig(calibration))
        if model.drivetrain.b_rotor <= 0.0:
            return None
        forces = tuple(_tension(run, model, factor) for factor in FACTORS)
    except RigError:
        return None
    dampers = tuple(factor * model.drivetrain.b_rotor for factor in FACTORS)
    payout, log = (run.t >= onset) & (run.t <= braking), run.channels["force"]
    rms = tuple(float(np.sqrt(np.mean((force - log)[payout] ** 2))) for force in forces)
    return DamperCurves(run, onset, dampers, forces, rms)


def _tension(run: Run, model: Model, factor: float) -> Signal:
    """Line tension simulated with a multiple of the damper of a model, (n,). [N]"""
    other = with_part(model, "drivetrain", b_rotor=factor * model.drivetrain.b_rotor)
    return simulate(run, other).run.channels["force"]
