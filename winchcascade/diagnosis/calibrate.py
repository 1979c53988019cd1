"""The back-EMF constant of an open circuit, with what the rig file leaves open of the machine and of its DC link."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import open_circuit_current
from winchcascade.core.errors import LogError, RigError
from winchcascade.core.integrate import median
from winchcascade.core.quantity import Quantity, find_unit, si_unit
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.nuisances import nuisances, sensor_errors, shifted
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.solve import huber, quadratic, weights
from winchcascade.rig.backemf import COVERED, RPM_LEAST, BackEmf, back_emf
from winchcascade.rig.parts import baseline

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal


def back_emf_of(run: Run, rig: Rig, payouts: Sequence[tuple[float, float]]) -> BackEmf:
    """The regression of the back-EMF, its uncertainties with what the rig file leaves open of machine and DC link.

    The capacitor above all: on a ramp it takes a current whose drop in the bridge looks like a lag of Vdc.

    Raises
    ------
    LogError : no Vdc, or too few samples above 1000 rpm with a conducting bridge
    """
    gain, _ = sensor_errors(rig.sensors.get("vdc"))
    found = back_emf(run, baseline(rig), payouts, u_gain=gain)
    k_e = lag = 0.0
    for n in nuisances(rig, [run]):
        if n.kind == "rig" and n.section in ("generator", "dc_link") and n.name != "k_e":
            moved = back_emf(run, baseline(shifted(rig, {(n.section, n.name): n.sd})), payouts)
            k_e, lag = math.hypot(k_e, moved.k_e - found.k_e), math.hypot(lag, moved.lag - found.lag)
    u = math.hypot(found.u_fit, found.u_sensor, k_e)
    return msgspec.structs.replace(
        found, low=found.k_e - COVERED * u, high=found.k_e + COVERED * u, u_lag=math.hypot(found.u_lag, lag)
    )


FREED = {("drivetrain", "b_rotor"): 0.5, ("restoring", "mu_screw"): 0.5}
"""Numbers that are found from the line force, by section and name, and their prior width as a share of the value: wide enough
to say nothing."""

FOUND_FROM = ("force", "torque", "pressure")
"""Channels that they are found from."""

TIED = ("drivetrain", "eta_mesh")
"""In open circuit the mesh efficiency acts with the damper and the inertia as one quotient: it is held to its tolerance."""

MESH_TOLERANCE = 0.01
"""Standard uncertainty of a mesh efficiency for which the rig file gives none. [1]"""

TOLD_APART = 0.5
"""A number whose uncertainty stays above this share of what was known before says nothing new."""

HELD_TOGETHER = 0.9
"""Two numbers whose errors are correlated by more than this cannot be told apart."""

STRAINED = 4.0
"""A fit that moves something by more tolerances than this does not keep to what is known of it."""

ROUNDS = 30


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


class Strain(msgspec.Struct, frozen=True):
    """Something known to a tolerance that the fit moves by more of them than chance does: `by` tolerances, signed. [1]"""

    name: str
    by: float


class Calibration(msgspec.Struct, frozen=True):
    """What an open-circuit log says of a rig: its numbers, the regression of the back-EMF, and what is held together.

    `misfit` is the mean square of what force, torque and pressure leave, in units of their noise: about 1 where damper and
    screw are all that had to be found [1]. `strained` are the tolerances that the fit does not keep. `settled` tells that
    the fit came to rest; its numbers are no result otherwise.
    """

    run: Run
    rig: Rig
    numbers: tuple[Number, ...]
    regression: BackEmf
    together: tuple[str, ...]
    misfit: float
    strained: tuple[Strain, ...]
    settled: bool


def calibrate(
    run: Run, rig: Rig, payouts: Sequence[tuple[float, float]], *, cycles: tuple[int, int] | None = None
) -> Calibration:
    """Calibrate a rig from an open-circuit log (Sec. 4.2).

    The back-EMF constant is a regression on the DC voltage; damper and screw friction follow from line force, torque and
    pressure, fitted with everything else that is known to a tolerance only: precharge, gas volume, piston area, gains, zeros.

    Parameters
    ----------
    payouts : from the onset of each payout to the start of its braking [s]
    cycles : first and last cycle that count for damper and screw, numbered by payout; all by default

    Raises
    ------
    LogError : the log is no open circuit, delivers power, or lacks force or voltage
    RigError : the rig file lacks numbers of the model, or an estimate of those to be found
    """
    _require_open_circuit(run)
    _require_no_power(run, rig, payouts)
    freed = _freed(rig)
    regression = back_emf_of(run, freed, payouts)
    k_e = _back_emf_constant(rig, regression)
    data = Fitted([run], _with_number(freed, k_e), [cycles])
    value, covariance, misfit, settled = _posterior(data)
    at = [k for k, n in enumerate(data.nuisances) if (n.section, n.name) in (*FREED, TIED)]
    numbers = (k_e, *(_fitted(rig, data, k, value, covariance) for k in at))
    together = (*_with_the_gain(regression), *_together(data, covariance, at))
    strained = tuple(
        Strain(str(n), float(x))
        for k, (n, x) in enumerate(zip(data.nuisances, value, strict=True))
        if abs(x) > STRAINED and k not in at
    )
    return Calibration(run, rig, numbers, regression, together, misfit, strained, settled)


def _require_open_circuit(run: Run) -> None:
    if run.load is None:
        raise LogError(
            f"{run.name}: its load is unknown, and a calibration needs an open circuit; give --load-ohm inf if no load was "
            "connected, or list the log in a campaign.toml beside it with load_ohm = inf."
        )
    if not math.isinf(run.load):
        raise LogError(
            f"{run.name}: a log with a load of {run.load:g} ohm; a calibration needs an open circuit: choose that log, or "
            "give --load-ohm inf if no load was connected."
        )
    if "force" not in run.channels:
        raise LogError(f"{run.name}: no line force, which damper and screw friction are found from; log it.")


def _require_no_power(run: Run, rig: Rig, payouts: Sequence[tuple[float, float]]) -> None:
    """Reject a log whose Idc is more than the bleed resistance takes, whatever load is stated."""
    if "vdc" not in run.channels or "idc" not in run.channels:
        return
    moving = np.zeros(run.t.size, dtype=bool)
    for begin, end in payouts:
        moving[np.searchsorted(run.t, begin) : np.searchsorted(run.t, end)] = True
    if not moving.any():
        return
    voltage, current = (median(run.channels[name][moving]) for name in ("vdc", "idc"))
    most = open_circuit_current(rig, abs(voltage))
    if current > most:
        raise LogError(
            f"{run.name}: stated as an open circuit, but it delivers {voltage * current:.3g} W (Vdc {voltage:.4g} V, Idc "
            f"{current:.4g} A; expected at most {most:.2g} A). A calibration needs a log without load: choose that log, or "
            "check Idc."
        )


def _back_emf_constant(rig: Rig, regression: BackEmf) -> Number:
    before = rig.generator.k_e
    return Number(
        "generator",
        "k_e",
        "V/rpm",
        math.nan if before is None else before.value,
        regression.k_e,
        regression.low,
        regression.high,
        (regression.high - regression.k_e) / COVERED,
        new=True,
        how=f"regression of Vdc above {RPM_LEAST:g} rpm, R2 = {regression.r2:.5f}",
    )


def _fitted(rig: Rig, data: Fitted, k: int, value: Signal, covariance: Signal) -> Number:
    """A number of the rig from a fit, by its place among the nuisances."""
    n = data.nuisances[k]
    before: float = getattr(getattr(rig, n.section), n.name).value
    left = math.sqrt(covariance[k, k])
    found, u, new = before + n.sd * float(value[k]), n.sd * left, left < TOLD_APART
    how = _found_from(data.logs[0].run) if new else "as given: an open circuit says no more of it"
    unit = find_unit(n.unit)
    return Number(
        n.section,
        n.name,
        n.unit if unit is None else si_unit(unit.dimension),
        before,
        found,
        found - COVERED * u,
        found + COVERED * u,
        u,
        new,
        how,
    )


def _found_from(run: Run) -> str:
    """The channels that a number is found from, as a text."""
    *first, last = (f"line {name}" if name == "force" else name for name in FOUND_FROM if name in run.channels)
    return f"{', '.join(first)} and {last}" if first else last


def _freed(rig: Rig) -> Rig:
    """The rig with wide priors for what is to be found, and a tolerance of the mesh efficiency."""
    for (section, name), share in FREED.items():
        number: Quantity | None = getattr(getattr(rig, section), name)
        if number is not None and number.value == 0.0:
            raise RigError(
                f"rig {rig.name}: {name} under [{section}] is 0; a calibration starts from an estimate, give one."
            )
        rig = _with_tolerance(rig, section, name, share * abs(number.value) if number else 0.0)
    mesh: Quantity | None = getattr(getattr(rig, TIED[0]), TIED[1])
    return _with_tolerance(rig, *TIED, (mesh.tolerance if mesh else None) or MESH_TOLERANCE)


def _with_number(rig: Rig, n: Number) -> Rig:
    """The rig with a number as it was found, for what is found after it."""
    part = getattr(rig, n.section)
    found = msgspec.structs.replace(getattr(part, n.name), value=n.value, tolerance=n.u)
    return msgspec.structs.replace(rig, **{n.section: msgspec.structs.replace(part, **{n.name: found})})


def _with_tolerance(rig: Rig, section: str, name: str, tolerance: float) -> Rig:
    part = getattr(rig, section)
    number: Quantity | None = getattr(part, name)
    if number is None:
        return rig
    wide = msgspec.structs.replace(number, tolerance=tolerance)
    return msgspec.structs.replace(rig, **{section: msgspec.structs.replace(part, **{name: wide})})


def _posterior(data: Fitted) -> tuple[Signal, Signal, float, bool]:
    """Nuisances in units of their prior width, (n,), their covariance, the misfit, and whether the fit came to rest; from the
    channels before the machine.
    """
    seen = np.ones((data.measured.shape[0], len(CHANNELS)))
    seen[:, [CHANNELS.index("vdc"), CHANNELS.index("idc")]] = 0.0
    nu = np.zeros(len(data.nuisances))
    settled = False
    for _ in range(ROUNDS):
        at = data.predict(nu, [])
        z = data.whiten((data.measured - at) * seen)
        columns = data.nuisance_columns(nu, [], at, seen)
        columns[:, [n.kind == "law" for n in data.nuisances]] = 0.0  # the rig as its file has it, without dry friction
        q = quadratic(z, weights(z), columns, np.zeros((z.size, 0)), nu)
        nu = nu + q.own
        settled = float(np.max(np.abs(q.own))) < SETTLED
        if settled:
            break
    misfit = 2.0 * huber(z) / max(int(np.count_nonzero(z)), 1)
    return nu, np.asarray(max(misfit, 1.0) * np.linalg.inv(q.inner), dtype=np.float64), misfit, settled


SETTLED = 1e-3
"""Nuisances have settled when none moves by more than this share of its prior width."""


def _with_the_gain(regression: BackEmf) -> Iterator[str]:
    """The back-EMF constant is read through the gain of the Vdc sensor alone."""
    correlation = -regression.u_sensor * COVERED / (regression.high - regression.k_e)
    if abs(correlation) > HELD_TOGETHER:
        yield f"k_e and gain of vdc ({correlation:+.2f})"


def _together(data: Fitted, covariance: Signal, at: Sequence[int]) -> Iterator[str]:
    """Sentences on what the log cannot tell apart."""
    sd = np.sqrt(np.diag(covariance))
    for k in at:
        for j, n in enumerate(data.nuisances):
            correlation = covariance[k, j] / (sd[k] * sd[j])
            if j != k and (j not in at or j > k) and abs(correlation) > HELD_TOGETHER:
                yield f"{data.nuisances[k]} and {n} ({correlation:+.2f})"
