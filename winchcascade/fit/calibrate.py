"""Calibrate a rig from an open circuit: back-EMF constant, damper and screw friction, and what cannot be told apart (Sec. 4.2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.errors import LogError
from winchcascade.fit.campaign import Fitted
from winchcascade.fit.nuisances import sensor_errors
from winchcascade.fit.predict import CHANNELS
from winchcascade.fit.solve import huber, quadratic, weights
from winchcascade.quantity import Quantity
from winchcascade.rig.backemf import BackEmf, back_emf

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from winchcascade.rigfile import Rig
    from winchcascade.run import Run, Signal

FREED = {("drivetrain", "b_rotor"): 0.5, ("restoring", "mu_screw"): 0.5}
"""Numbers that are found from the line force, by section and name, and their prior width as a share of the value: wide enough
to say nothing."""

TIED = ("drivetrain", "eta_mesh")
"""In open circuit the mesh efficiency acts with the damper and the inertia as one quotient: it is held to its tolerance."""

MESH_TOLERANCE = 0.01
"""Standard uncertainty of a mesh efficiency for which the rig file gives none. [1]"""

COVERED = 1.96
"""Standard uncertainties on either side of a 95 % interval."""

TOLD_APART = 0.5
"""A number whose uncertainty stays above this share of what was known before says nothing new."""

HELD_TOGETHER = 0.9
"""Two numbers whose errors are correlated by more than this cannot be told apart."""

ROUNDS = 6


class Number(msgspec.Struct, frozen=True):
    """One calibrated number of the rig: value, 95 % interval and standard uncertainty `u` in its SI unit.

    `before` is what the rig file said, `how` how it was found. `new` tells that the log says more of it than was known.
    """

    section: str
    name: str
    unit: str
    before: float
    value: float
    low: float
    high: float
    u: float
    new: bool
    how: str


class Calibration(msgspec.Struct, frozen=True):
    """What an open-circuit log says of a rig: its numbers, the regression of the back-EMF, and what is held together."""

    run: Run
    rig: Rig
    numbers: tuple[Number, ...]
    regression: BackEmf
    together: tuple[str, ...]


def calibrate(run: Run, rig: Rig, payouts: Sequence[tuple[float, float]]) -> Calibration:
    """Calibrate a rig from an open-circuit log (Sec. 4.2).

    The back-EMF constant is a regression on the DC voltage; damper and screw friction follow from line force, torque and
    pressure, fitted with everything else that is known to a tolerance only: precharge, gas volume, piston area, gains, zeros.

    Parameters
    ----------
    payouts : from the onset of each payout to the start of its braking [s]

    Raises
    ------
    LogError : the log is no open circuit, or lacks force or voltage
    """
    if run.load is not None and not math.isinf(run.load):
        raise LogError(
            f"{run.name}: a log with a load of {run.load:g} ohm; a calibration needs an open circuit: choose that log, or "
            "give --load-ohm inf if no load was connected."
        )
    if "force" not in run.channels:
        raise LogError(f"{run.name}: no line force, which damper and screw friction are found from; log it.")
    run = msgspec.structs.replace(run, load=math.inf)
    data = Fitted([run], _freed(rig))
    gain, _ = sensor_errors(rig.sensors.get("vdc"))
    regression = back_emf(run, data.nominal, payouts, u_gain=gain)
    value, covariance = _posterior(data)
    emf = regression.k_e
    k_e_before = rig.generator.k_e
    numbers = [
        Number(
            "generator",
            "k_e",
            "V/rpm",
            math.nan if k_e_before is None else k_e_before.value,
            emf,
            regression.low,
            regression.high,
            (regression.high - emf) / COVERED,
            new=True,
            how=f"regression above 1000 rpm, R2 = {regression.r2:.5f}",
        )
    ]
    wanted = [*FREED, TIED]
    at = [k for k, n in enumerate(data.nuisances) if (n.section, n.name) in wanted]
    for k in at:
        n = data.nuisances[k]
        before = getattr(getattr(rig, n.section), n.name).value
        u = n.sd * math.sqrt(covariance[k, k])
        found = before + n.sd * value[k]
        new = math.sqrt(covariance[k, k]) < TOLD_APART
        how = "line force, torque and pressure" if new else "as given: an open circuit says no more of it"
        numbers.append(
            Number(n.section, n.name, n.unit, before, found, found - COVERED * u, found + COVERED * u, u, new, how)
        )
    return Calibration(run, rig, tuple(numbers), regression, tuple(_together(data, covariance, at)))


def _freed(rig: Rig) -> Rig:
    """The rig with wide priors for what is to be found, and a tolerance of the mesh efficiency."""
    for (section, name), share in FREED.items():
        rig = _with_tolerance(rig, section, name, lambda q, share=share: share * abs(q.value))
    return _with_tolerance(rig, *TIED, lambda q: q.tolerance or MESH_TOLERANCE)


def _with_tolerance(rig: Rig, section: str, name: str, width: Callable[[Quantity], float]) -> Rig:
    part = getattr(rig, section)
    number: Quantity | None = getattr(part, name)
    if number is None:
        return rig
    wide = msgspec.structs.replace(number, tolerance=width(number))
    return msgspec.structs.replace(rig, **{section: msgspec.structs.replace(part, **{name: wide})})


def _posterior(data: Fitted) -> tuple[Signal, Signal]:
    """Nuisances in units of their prior width, (n,), and their covariance, from what the machine's side does not see."""
    seen = np.ones((data.measured.shape[0], len(CHANNELS)))
    seen[:, [CHANNELS.index("vdc"), CHANNELS.index("idc")]] = 0.0
    nu = np.zeros(len(data.nuisances))
    q = None
    for _ in range(ROUNDS):
        at = data.predict(nu, [])
        z = data.whiten((data.measured - at) * seen)
        columns = data.nuisance_columns(nu, [], at, seen)
        q = quadratic(z, weights(z), columns, np.zeros((z.size, 0)), nu)
        nu = nu + q.own
        if float(np.max(np.abs(q.own))) < SETTLED:
            break
    assert q is not None
    scale = max(2.0 * huber(z) / max(int(np.count_nonzero(z)), 1), 1.0)
    return nu, np.linalg.inv(q.inner) * scale


SETTLED = 1e-3
"""Nuisances have settled when none moves by more than this share of its prior width."""


def _together(data: Fitted, covariance: Signal, at: Sequence[int]) -> Iterator[str]:
    """Sentences on what the log cannot tell apart."""
    sd = np.sqrt(np.diag(covariance))
    for k in at:
        for j, n in enumerate(data.nuisances):
            correlation = covariance[k, j] / (sd[k] * sd[j])
            if j != k and (j not in at or j > k) and abs(correlation) > HELD_TOGETHER:
                yield f"{data.nuisances[k]} and {n} ({correlation:+.2f})"
