"""The back-EMF constant from an open circuit: a regression with bleed, capacitor and bridge
(Sec. 4.2).
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.run import Run, Signal
from winchcascade.core.scales import motion_of_runs
from winchcascade.core.smooth import local_quadratic
from winchcascade.rig.bridge import back_emfs
from winchcascade.rig.line_velocity import SMOOTHING
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import RPM

SLOW_SHARE = 0.28
"""The regression begins at this share of the largest speed of the log: 1000 rpm of the 3570 rpm
of the paper (Sec. 4.2). [1]
"""

BLOCK = 1.03
"""Length of a block of time whose samples share their error, over the ramp: noise of the
smoothed velocity, gusts. [1]
"""

COVERED = 1.96
"""Half-width of a 95 % interval in standard uncertainties."""

MIN_SAMPLES = 25
"""Minimum number of samples of a regression."""


class BackEmf(msgspec.Struct, frozen=True):
    """Back-EMF constant of an open circuit, line to line, rms [V/rpm], with its 95 % interval.

    `u_fit` is the standard uncertainty of the fit, `u_sensor` that of the gain of the voltage
    sensor [V/rpm]; `lag` [s] is how late Vdc is recorded, with its standard uncertainty `u_lag`.
    `rpm`, `v_ll` and `vdc`, (n,) each, are the samples that were fitted: generator speed, back-EMF
    that follows from the DC side [V], and measured DC voltage [V]. `eq8` is the constant by Eq. 8
    alone, without bleed and commutation [V/rpm]; `rpm_min` where the fit begins [rpm].
    """

    k_e: float
    low: float
    high: float
    r2: float
    u_fit: float
    u_sensor: float
    lag: float
    u_lag: float
    eq8: float
    rpm_min: float
    rpm: Signal
    v_ll: Signal
    vdc: Signal


def rpm_min(rpm: Signal) -> float:
    """Generator speed from which a regression takes the samples of a log, whose speeds are given,
    (n,). [rpm]

    >>> rpm_min(np.array([0.0, 100.0]))
    28.0
    """
    return round(SLOW_SHARE * float(np.max(rpm)), 9)


def back_emf(
    run: Run, model: Model, payouts: Sequence[tuple[float, float]], *, u_gain: float = 0.0
) -> BackEmf:
    """Fit the back-EMF constant to an open-circuit log above a share of its largest speed.

    While the bridge conducts, it carries the currents of bleed and capacitor. The back-EMF that
    gives them, commutation and diodes included, is proportional to the speed. Samples in which the
    capacitor holds its voltage against a falling speed contain nothing of the machine; the given
    payouts exclude braking. A lag of Vdc is fitted beside the constant, since on a ramp it looks
    like a smaller one.

    Parameters
    ----------
    payouts : from the onset of each payout to the start of its braking, on the clock of the log [s]
    u_gain : relative standard uncertainty of the gain of the Vdc sensor [1]

    Raises
    ------
    LogError : no Vdc, or too few samples above that speed with a conducting bridge
    """
    if "vdc" not in run.channels:
        raise LogError(
            f"{run.name}: no DC voltage, which a back-EMF constant is fitted to; log Vdc."
        )
    vdc, ramp = run.channels["vdc"], motion_of_runs([run]).ramp
    speed = local_quadratic(run.t, run.channels["velocity"], SMOOTHING * ramp)
    bleed, current = dc_currents(run, model, vdc, ramp)
    rpm = speed / model.r_motion * model.drivetrain.gear * RPM
    begin = rpm_min(rpm)
    used = (rpm > begin) & (current > 0.5 * bleed)
    used &= np.logical_or.reduce([(run.t >= begin) & (run.t <= end) for begin, end in payouts])
    if np.count_nonzero(used) < MIN_SAMPLES:
        raise LogError(
            f"{run.name}: {np.count_nonzero(used)} samples above {begin:.4g} rpm in which the "
            f"bridge conducts; a back-EMF constant needs at least {MIN_SAMPLES}: pay out faster, "
            "or for longer."
        )
    slope, rpm, vdc = np.gradient(rpm, run.t)[used], rpm[used], vdc[used]
    v_ll, _ = back_emfs(model.generator, rpm / RPM, vdc, current[used])
    k_e, u_fit, lag, u_lag, r2 = _through_zero(run.t[used] / (BLOCK * ramp), rpm, slope, v_ll)
    u = math.hypot(u_fit, k_e * u_gain)
    return BackEmf(
        k_e=k_e,
        low=k_e - COVERED * u,
        high=k_e + COVERED * u,
        r2=r2,
        u_fit=u_fit,
        u_sensor=k_e * u_gain,
        lag=lag,
        u_lag=u_lag,
        eq8=float(
            np.sum(rpm * (vdc + 2.0 * model.generator.v_diode)) / (math.sqrt(2.0) * np.sum(rpm**2))
        ),
        rpm_min=begin,
        rpm=rpm,
        v_ll=v_ll,
        vdc=vdc,
    )


def dc_currents(run: Run, model: Model, vdc: Signal, ramp: float) -> tuple[Signal, Signal]:
    """Current of the bleed, and the sum of the currents of bleed and capacitor, from the
    smoothed DC voltage, (n,) each [A].
    """
    smooth = local_quadratic(run.t, vdc, SMOOTHING * ramp)
    bleed: Signal = smooth / model.dc_link.r_bleed
    return bleed, bleed + model.dc_link.c_dc * np.gradient(smooth, run.t)


def _through_zero(
    t: Signal, rpm: Signal, slope: Signal, v_ll: Signal
) -> tuple[float, float, float, float, float]:
    """Least squares of v_ll = k_e (rpm - lag d rpm/dt): k_e and its standard uncertainty, lag and
    its own, and R2.

    The times are in blocks. Errors within a block are correlated, so the covariance is that of
    clustered residuals (Liang and Zeger 1986).
    """
    design = np.column_stack([rpm, -slope])
    fitted, *_ = np.linalg.lstsq(design, v_ll, rcond=None)
    residual = v_ll - design @ fitted
    block = np.floor(t - t[0]).astype(np.intp)
    scores = np.zeros((int(block[-1]) + 1, 2))
    np.add.at(scores, block, design * residual[:, None])
    bread = np.linalg.inv(design.T @ design)
    filled = np.unique(block).size
    covariance = bread @ (scores.T @ scores) @ bread * filled / max(filled - 2, 1)
    k_e, r2 = (
        float(fitted[0]),
        1.0 - float(residual @ residual) / float(np.sum((v_ll - np.mean(v_ll)) ** 2)),
    )
    return (
        k_e,
        math.sqrt(covariance[0, 0]),
        float(fitted[1]) / k_e,
        math.sqrt(covariance[1, 1]) / k_e,
        r2,
    )
