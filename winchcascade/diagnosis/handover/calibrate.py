"""Calibrate a rig from an open circuit: back-EMF constant, viscous loss, screw friction, what is
indistinguishable (Sec. 4.2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.accuracy import open_circuit_current
from winchcascade.core.arguments import CYCLES, check_arguments
from winchcascade.core.errors import LogError, RigError, check_type
from winchcascade.core.integrate import median
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.core.quantity import Quantity, find_unit, si_unit
from winchcascade.core.rig_file import ModelAccuracy, Rig
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Run, Signal
from winchcascade.core.scales import motion_of_runs, scales_of
from winchcascade.core.viewed import Viewed
from winchcascade.diagnosis.fit.marginal import huber, weights
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.nuisances import (
    before_calibration,
    nuisances,
    quantity_of,
    sensor_errors,
    with_quantity,
)
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.backemf import COVERED, BackEmf, back_emf
from winchcascade.rig.baseline import baseline

FREED = {("drivetrain", "b_rotor"): 0.5, ("restoring", "mu_screw"): 0.5}
"""Numbers that are found from the line tension, by section and name, and their prior width as a
share of the value: wide enough to have no effect. A rig without a screw has no friction of it."""

FOUND_FROM = {"force": "line tension", "torque": "torque", "pressure": "pressure"}
"""Channels that they are found from: those before the machine."""

TIED = ("drivetrain", "eta_mesh")
"""In open circuit the mesh efficiency acts with the viscous loss and the inertia as one quotient:
it is held to its tolerance.
"""

MESH_TOLERANCE = 0.01
"""Standard uncertainty of a mesh efficiency for which the rig file gives none. [1]"""

REDUCED = 0.5
"""The log determines a number if its uncertainty is below this share of the width that the fit
leaves it.
"""

HELD_TOGETHER = 0.866
"""Correlation of the errors of two numbers above which they cannot be distinguished: to know one
would halve the uncertainty of the other."""

STRAINED = 4.0
"""Move of a nuisance, in its tolerances, beyond which the fit does not keep to its prior."""

ROUNDS = 30
"""Maximum number of steps of the fit."""

SETTLED = 0.03
"""The fit has converged when no number moves by more than this share of its standard
uncertainty.
"""


class Number(msgspec.Struct, frozen=True):
    """One calibrated number of the rig: value, 95 % interval and standard uncertainty `u` in its SI
    unit.

    `before` is the number before any calibration and `u_before` its standard uncertainty, infinite
    where none is stated; `how` is the method. `new`: the log determines it, so that a rig file
    takes it over; a diagnosis starts from the number before.
    """

    section: str
    name: str
    unit: str
    before: float
    u_before: float
    value: float
    u: float
    how: str

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval."""
        return self.value - COVERED * self.u

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval."""
        return self.value + COVERED * self.u

    @property
    def new(self) -> bool:
        """Whether the log determines the number, or its prior does."""
        if (self.section, self.name) == TIED:
            return False
        freed = FREED.get((self.section, self.name))
        return freed is None or self.u < REDUCED * freed * abs(self.before)


class Strain(msgspec.Struct, frozen=True):
    """Something known to a tolerance that the fit moves by more of them than chance does: `by`
    tolerances, signed. [1]
    """

    name: str
    by: float


class FittedBlocks(msgspec.Struct, frozen=True):
    """Means over blocks of the log and of the fit: generator speed `rpm` (m,), `phase` (m,) as an
    index of `PHASES`, and of the channels of `CHANNELS`, SI units, `measured` (m, 5), NaN where
    there is none, and `fitted` (m, 5). `damper` (m,) is the torque of the viscous loss, at the
    PTO shaft [N m], `displacement` (m,) that of the line, where the rig has no gas [m].
    """

    rpm: Signal
    phase: NDArray[np.intp]
    measured: Signal
    fitted: Signal
    damper: Signal
    displacement: Signal | None = None


class Calibration(Viewed, frozen=True):
    """Numbers of a rig from an open-circuit log, the regression of the back-EMF, and what cannot be
    distinguished.

    Parameters
    ----------
    run, rig : the log, and the rig as its file states it
    numbers : each that was found, with its value before, standard uncertainty and 95 % interval
    regression : back-EMF over generator speed
    together : sentences on numbers that an open circuit cannot distinguish
    misfit : mean square of the residuals of force, torque and pressure, in units of their noise;
        about 1 where viscous loss and screw explain the log [1]
    strained : tolerances that the fit exceeds
    settled : the fit converged; its numbers are no result otherwise
    payouts : those that were used, each from its onset to the start of its braking [s]
    blocks : block means of the log and of the fit
    """

    run: Run
    rig: Rig
    numbers: tuple[Number, ...]
    regression: BackEmf
    together: tuple[str, ...]
    misfit: float
    strained: tuple[Strain, ...]
    settled: bool
    payouts: tuple[tuple[float, float], ...]
    blocks: FittedBlocks

    def __repr__(self) -> str:
        """One line instead of every number."""
        found = (
            f"{n.name} = {n.value:.5g} {n.unit}".removesuffix(" 1") for n in self.numbers if n.new
        )
        return f"Calibration({self.rig.name!r}, {', '.join(found)})"


def calibrate(
    run: Run, rig: Rig | None = None, *, cycles: tuple[int, int] | None = None
) -> Calibration:
    """Calibrate a rig from an open-circuit log (Sec. 4.2).

    The back-EMF constant is a regression on the DC voltage; viscous loss and screw friction follow
    from line tension, torque and pressure, fitted with everything else that is known to a tolerance
    only: precharge, gas volume, piston area, gains, zeros, dry friction. The start is the rig
    before any calibration, so that the result does not depend on an earlier one.

    Parameters
    ----------
    rig : to be calibrated; by default the one that the run was read with
    cycles : first and last cycle that count, numbered by payout; by default those of the run's
        campaign

    Raises
    ------
    LogError : the log is no open circuit, delivers power, lacks force or voltage, or has no
        complete payout with a plateau
    RigError : the rig file lacks numbers of the model, or an estimate of those to be found
    OptionError : something else than a run or a rig
    """
    check_type("calibrate", run, Run, "read_run(log)")
    check_arguments("calibrate", ("cycles", cycles, CYCLES))
    rig = with_thresholds(given_rig("calibrate", rig, run.rig), [run])
    cycles = run.cycles if cycles is None else cycles
    payouts = _payouts(run, rig, cycles)
    before = before_calibration(rig)
    freed = _freed(before)
    regression = back_emf_of(run, freed, payouts)
    how, u = (
        f"regression of Vdc above {regression.rpm_min:.4g} rpm, R2 = {regression.r2:.5f}",
        regression.high - regression.k_e,
    )
    k_e = _number(before, ("generator", "k_e"), "V/rpm", regression.k_e, u / COVERED, how)
    known = Quantity(value=k_e.value, unit=k_e.unit, source=k_e.how, u=k_e.u)
    exact = msgspec.structs.replace(freed, model=ModelAccuracy(discrepancy=0.0))
    data = Fitted([run], with_quantity(exact, "generator", "k_e", known), [cycles])
    value, covariance, misfit, settled = _posterior(data)
    at = [k for k, n in enumerate(data.nuisances) if (n.section, n.name) in (*FREED, TIED)]
    strained = (
        Strain(str(n), float(x)) for k, (n, x) in enumerate(zip(data.nuisances, value, strict=True))
        if abs(x) > STRAINED and k not in at
    )  # fmt: skip
    return Calibration(
        run=run,
        rig=rig,
        numbers=(k_e, *_fitted(before, data, at, value, covariance)),
        regression=regression,
        together=tuple(_together(data, covariance, at, regression)),
        misfit=misfit,
        strained=tuple(strained),
        settled=settled,
        payouts=payouts,
        blocks=_blocks(data, value),
    )


def _payouts(run: Run, rig: Rig, cycles: tuple[int, int] | None) -> tuple[tuple[float, float], ...]:
    """Payouts of the complete cycles of an open circuit, from the onset to the start of braking
    [s].

    Rejects a log that is not stated as an open circuit, that lacks the line tension, or whose Idc
    is more than the bleed resistance takes.
    """
    if run.load is None or not math.isinf(run.load) or "force" not in run.channels:
        wrong = (
            "its load is unknown" if run.load is None else f"a log with a load of {run.load:g} ohm"
        )
        wrong = "no line tension, which the losses are found from" if run.open_circuit else wrong
        raise LogError(
            f"{run.name}: {wrong}; a calibration needs an open circuit with line tension and Vdc. "
            f"Choose such a log; "
            "--load-ohm inf, or load_ohm = inf in the campaign.toml beside it, states that no "
            "load was connected."
        )
    reduction = reduce(run, rig=rig, cycles=cycles)
    plateaus = [(cycle.phases.onset, cycle.summary.payout.plateau) for cycle in reduction.complete]
    payouts = tuple((onset, plateau.braking) for onset, plateau in plateaus if plateau is not None)
    if not payouts:
        raise LogError(
            f"{run.name}: none of {len(reduction.cycles)} payouts is complete and holds a "
            f"plateau, which a calibration needs; "
            "`winchcascade reduce` lists what is wrong with each."
        )
    if {"vdc", "idc"} <= run.channels.keys():
        moving = np.logical_or.reduce([(run.t >= begin) & (run.t < end) for begin, end in payouts])
        voltage, current = (median(run.channels[name][moving]) for name in ("vdc", "idc"))
        if current > (maximum := open_circuit_current(rig, abs(voltage))):
            raise LogError(
                f"{run.name}: stated as an open circuit, but it delivers {voltage * current:.3g} "
                f"W (Idc {current:.4g} A, at "
                f"most {maximum:.2g} A expected). Choose a log without load, or check Idc."
            )
    return payouts


def back_emf_of(run: Run, rig: Rig, payouts: Sequence[tuple[float, float]]) -> BackEmf:
    """The regression of the back-EMF, its uncertainties with what is open of the rig and of the Vdc
    sensor.

    The capacitor above all: on a ramp it takes a current whose drop in the bridge looks like a lag
    of Vdc.

    Raises
    ------
    LogError : no Vdc, or too few samples above `rpm_min` with a conducting bridge
    """
    gain, zero = sensor_errors(rig.sensors.get("vdc"))
    found = back_emf(run, baseline(rig), payouts, u_gain=gain)
    zeroed = msgspec.structs.replace(
        run, channels={**run.channels, "vdc": run.channels["vdc"] + zero}
    )
    scales = scales_of(rig, motion_of_runs([run]))
    open_numbers = (n for n in nuisances(rig, [run], scales) if n.kind == "rig" and n.name != "k_e")
    moved = [
        back_emf(zeroed, baseline(rig), payouts),
        *(back_emf(run, n.apply(baseline(rig), n.sd), payouts) for n in open_numbers),
    ]
    u = math.hypot(found.u_fit, found.u_sensor, *(one.k_e - found.k_e for one in moved))
    u_lag = math.hypot(found.u_lag, *(one.lag - found.lag for one in moved))
    return msgspec.structs.replace(
        found, low=found.k_e - COVERED * u, high=found.k_e + COVERED * u, u_lag=u_lag
    )


def _number(
    rig: Rig, place: tuple[str, str], unit: str, value: float, u: float, how: str
) -> Number:
    """A number beside that of the rig before."""
    before = quantity_of(rig, *place)
    u_before = math.inf if before is None or before.u is None else before.u
    number = Number(
        *place, unit, math.nan if before is None else before.value, u_before, value, u, how
    )
    kept = "rig file: an open circuit does not determine it"
    return number if number.new else msgspec.structs.replace(number, how=kept)


def _fitted(
    before: Rig, data: Fitted, at: Sequence[int], nu: Signal, covariance: Signal
) -> Iterator[Number]:
    """Numbers of the rig from a fit, by their places among the nuisances."""
    *first, last = (what for name, what in FOUND_FROM.items() if name in data.logs[0].run.channels)
    how = f"{', '.join(first)} and {last}" if first else last
    for k in at:
        n = data.nuisances[k]
        place, unit = (n.section, n.name), find_unit(n.unit)
        rig, freed = data.rig if place == TIED else before, quantity_of(data.rig, *place)
        value = (0.0 if freed is None else freed.value) + n.sd * float(nu[k])
        si = n.unit if unit is None else si_unit(unit.dimension)
        yield _number(rig, place, si, value, n.sd * math.sqrt(covariance[k, k]), how)


def _freed(rig: Rig) -> Rig:
    """The rig with wide priors for what is to be found, and a tolerance of the mesh efficiency."""
    for section, name in (*FREED, TIED):
        number = quantity_of(rig, section, name)
        if number is not None:
            if (section, name) in FREED and number.value == 0.0:
                raise RigError(
                    f"rig {rig.name}: {name} under [{section}] is 0; a calibration starts from an "
                    f"estimate, give one."
                )
            wide = FREED.get((section, name), 0.0) * abs(number.value) or number.u or MESH_TOLERANCE
            rig = with_quantity(rig, section, name, msgspec.structs.replace(number, u=wide))
    return rig


def _posterior(data: Fitted) -> tuple[Signal, Signal, float, bool]:
    """Nuisances in units of their prior width, (n,), their covariance, the misfit, and whether the
    fit converged; from the channels before the machine.
    """
    used = np.array([channel in FOUND_FROM for channel in CHANNELS], dtype=np.float64)
    nu = np.zeros(len(data.nuisances))
    for _ in range(ROUNDS):
        z = data.whiten((data.measured - data.predict(nu, [])) * used)
        columns, w = data.columns(nu, [], used, serves=0.0), weights(z)
        curve, slope = (
            columns.masked(np.sqrt(w)).squared() + np.eye(nu.size),
            columns.onto(w * z) - nu,
        )
        inverse = np.asarray(np.linalg.inv(curve), dtype=np.float64)
        step = inverse @ slope
        nu, settled = nu + step, bool(np.all(np.abs(step) < SETTLED * np.sqrt(np.diag(inverse))))
        if settled:
            break
    misfit = 2.0 * huber(z) / max(int(np.count_nonzero(z)), 1)
    return nu, max(misfit, 1.0) * inverse, misfit, settled


def _blocks(data: Fitted, nu: Signal) -> FittedBlocks:
    """The blocks of the log and of the fit."""
    log, model = data.logs[0], data.model(nu, [])
    shaft = model.drivetrain
    omega = log.course.blocks.mean(log.run.channels["velocity"]) / model.r_motion * shaft.gear
    damper = np.where(omega > 0.0, shaft.gear / shaft.eta_mesh * shaft.b_rotor * omega, 0.0)
    rpm, phase = omega * 30.0 / math.pi, log.course.blocks.phase
    measured = np.where(data.seen, data.measured, math.nan)
    displacement = (
        None if model.restoring.has_gas else log.course.blocks.mean(log.course.displacement)
    )
    return FittedBlocks(rpm, phase, measured, data.predict(nu, []), damper, displacement)


def _together(
    data: Fitted, covariance: Signal, at: Sequence[int], regression: BackEmf
) -> Iterator[str]:
    """What the log cannot distinguish; the back-EMF constant is read through the gain of the Vdc
    sensor alone.
    """
    of_the_gain = -regression.u_sensor * COVERED / (regression.high - regression.k_e)
    if abs(of_the_gain) > HELD_TOGETHER:
        yield f"k_e and gain of vdc ({of_the_gain:+.2f})"
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    for k in at:
        for j, n in enumerate(data.nuisances):
            if j != k and (j not in at or j > k) and abs(correlation[k, j]) > HELD_TOGETHER:
                yield f"{data.nuisances[k]} and {n} ({correlation[k, j]:+.2f})"
