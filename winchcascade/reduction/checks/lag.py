"""Lags between channels that follow one motion, by regression on ramps.

Two channels y and x that follow each other give `y(t) = a + b x(t - lag)`, and to first order
`y = a + b x - b lag dx/dt`. A regression of y on x and its slope therefore gives the lag, to a few milliseconds where the line
starts and stops. A lag that is found is applied and the regression repeated, until it is the whole lag.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import msgspec
import numpy as np

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.channels import CHANNELS
from winchcascade.core.run import Finding, Signal
from winchcascade.reduction.checks.load import losses
from winchcascade.reduction.phased_run import PhasedRun

SAME_TIME = 0.1
"""Smallest lag that is reported between channels without a physical lag: energies change by more than 0.5 %. [s]"""

OF_THE_ROTOR = 0.25
"""The same between torque and electrical power: rotor, capacitor and filters of the meters lag by up to 0.2 s. [s]"""

OF_THE_MACHINE = 0.35
"""The same between velocity and Vdc: as above, and a back-EMF that falls with the current changes Vdc like 0.15 s. [s]"""

CERTAIN = 5.0
"""Smallest lag that is reported, in standard uncertainties."""

SETTLED = 0.6
"""Time after the onset from which the force is compared: before, the friction of the restoring module reverses. [s]"""

BESIDE = 0.5
"""Time before the onset and after the payout that is compared with the ramps. [s]"""

SLOPE = 0.2
"""Time on either side over which slopes are taken, or one sample where samples are farther apart. [s]"""

MIN_SAMPLES = 20
"""Smallest number of samples for a regression."""

EXPLAINS = 0.5
"""A lag explains a difference between two channels if the residual is less than this share of its mean square."""

SINGULAR = 1e-9
"""Share of a signal that must remain beside the others, so that its weight is known."""

ROUNDS = 4
"""Number of times a lag is applied and found anew."""

FAR = (-4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0)
"""Lags from which the search starts where the signals do not follow each other without one. [s]"""

FOLLOWS = 0.1
"""Two signals follow each other if the residual is less than this share of the variance."""


class _Pair(msgspec.Struct, frozen=True):
    """Two signals of one payout, each (n,), stamps [s], and what else the second depends on, (n,) each."""

    t: Signal
    x: Signal
    y: Signal
    beside: tuple[Signal, ...]


class _Lag(msgspec.Struct, frozen=True):
    """Lag of the second signal of a pair behind the first [s], and the residual as a share of its variance [1].

    `without` is the residual without a lag [1]. `scale` over the root of the number of independent samples is the
    standard uncertainty [s]; `rows` are the signals of the regression, scaled to length one.
    """

    seconds: float
    residual: float
    scale: float
    without: float
    rows: Signal


Pairing = Callable[["PhasedRun", int], "_Pair | None"]


def lag_findings(phased: PhasedRun) -> list[Finding]:
    """Report channels that were recorded late against each other; no channel is shifted."""
    cycles = [k for k in phased.chosen() if not phased.cycles[k].begins_inside]
    findings = []
    for x, y, limit, pairing in _compared(phased):
        limit = max(limit, 1.0 / phased.run.fs)
        if any(_suspicious(pairing(phased, k), limit) for k in {*cycles[:1], *cycles[-1:]}):
            found = [(k, lag) for k in cycles if (lag := lag_of(pairing(phased, k), limit)) is not None]
            if found:
                findings.append(_finding(phased, x, y, found, limit))
    return findings


def _compared(phased: PhasedRun) -> Iterator[tuple[str, str, float, Pairing]]:
    """Pairs of channels that a log has, and the lag that physics gives them at most [s]."""
    channels = phased.run.channels
    if "displacement" in channels:
        yield "displacement", "velocity", SAME_TIME, _motion
    if "vdc" in channels and "idc" in channels and not phased.run.open_circuit:
        yield "vdc", "idc", SAME_TIME, _electrical
        if "torque" in channels:
            yield "torque", "Vdc x Idc", OF_THE_ROTOR, _shaft
        yield "velocity", "vdc", OF_THE_MACHINE, _machine
    if "torque" in channels and "force" in channels:
        yield "torque", "force", SAME_TIME, _line


def _motion(phased: PhasedRun, k: int) -> _Pair:
    """Displacement, and the integral of the velocity, whose zero makes it drift."""
    rows = _payout(phased, k)
    t, v = phased.run.t[rows], phased.run.channels["velocity"][rows]
    travel = np.concatenate((np.zeros(min(1, t.size)), np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))
    return _Pair(t, phased.run.channels["displacement"][rows], travel, (t,))


def _electrical(phased: PhasedRun, k: int) -> _Pair:
    """Vdc and Idc at a resistor."""
    rows, channels = _payout(phased, k), phased.run.channels
    return _Pair(phased.run.t[rows], channels["vdc"][rows], channels["idc"][rows], ())


def _shaft(phased: PhasedRun, k: int) -> _Pair | None:
    """Power of the shaft while the clutch drives, and the one that DC link, known losses and known storage need."""
    run, rig = phased.run, phased.rig
    mech = BUILT_IN["mech"].stream(run.channels, rig.r_drum)
    rows = _driven(phased, k, -BESIDE)
    t, v_dc, i_dc = run.t[rows], run.channels["vdc"][rows], run.channels["idc"][rows]
    if mech is None or t.size < MIN_SAMPLES:
        return None
    omega = phased.v_smooth[rows] * ((rig.rpm_per_velocity or 0.0) * math.pi / 30.0)
    needed = v_dc * i_dc + losses(rig, i_dc, omega)
    capacity, inertia = rig.dc_link.c_dc, rig.drivetrain.inertia_rotor
    slopes = np.gradient(np.array([v_dc, omega]), t, axis=1)
    for part, x, slope in zip((capacity, inertia), (v_dc, omega), slopes, strict=True):
        if part is not None:
            needed += part.value * x * slope
    return _Pair(t, mech(rows), needed, ())


def _machine(phased: PhasedRun, k: int) -> _Pair:
    """Velocity and Vdc while the clutch drives."""
    rows = _driven(phased, k, -BESIDE)
    return _Pair(phased.run.t[rows], phased.v_smooth[rows], phased.run.channels["vdc"][rows], ())


def _line(phased: PhasedRun, k: int) -> _Pair:
    """Torque and line tension while the line pays out; the rest of the force grows with the displacement."""
    rows, channels = _driven(phased, k, SETTLED), phased.run.channels
    along = channels.get("displacement", phased.run.t)[rows]
    return _Pair(phased.run.t[rows], channels["torque"][rows], channels["force"][rows], (along,))


def _payout(phased: PhasedRun, k: int) -> slice:
    """Rows of a payout and of the time beside it."""
    return phased.rows(phased.cycles[k].onset - BESIDE, phased.cycles[k].payout_end + BESIDE)


def _driven(phased: PhasedRun, k: int, after: float) -> slice:
    """Rows of a payout from so long after the onset [s] to the start of braking."""
    plateau, cycle = phased.plateaus[k], phased.cycles[k]
    return phased.rows(cycle.onset + after, cycle.payout_end if plateau is None else plateau.braking)


def _suspicious(pair: _Pair | None, limit: float) -> bool:
    """Whether one regression for one payout shows half a lag to report, or signals that do not follow each other."""
    first = None if pair is None else _regress(pair, 0.0)
    return pair is not None and (first is None or first.residual > FOLLOWS or abs(first.seconds) > 0.5 * limit)


def lag_of(pair: _Pair | None, limit: float) -> _Lag | None:
    """Lag of the second signal behind the first; None if it is below a limit, uncertain, or explains no difference."""
    if pair is None:
        return None
    first = _regress(pair, 0.0)
    follows = first is not None and first.residual < FOLLOWS
    tried = [one for one in (first, *(() if follows else (_regress(pair, far) for far in FAR))) if one is not None]
    found = min(tried, key=lambda one: one.residual, default=None)
    if found is None:
        return None
    for _ in range(ROUNDS):
        again = _regress(pair, found.seconds)
        if again is None:
            return None
        step, found = again.seconds - found.seconds, again
        if abs(step) < 0.05 * limit:
            break
    if first is not None and first.residual < found.residual:  # a filter delays as its slope does, without a shift
        found = first
    explains = found.residual < EXPLAINS * (1.0 if first is None else first.without)
    certain = abs(found.seconds) >= limit and abs(found.seconds) > CERTAIN * _standard_uncertainty(found)
    return found if certain and explains else None


def _regress(pair: _Pair, applied: float) -> _Lag | None:
    """Lag by one regression after a lag has been applied; None where the signals do not rise together."""
    rows = _aligned(pair, applied)
    if rows is None:
        return None
    rows -= np.einsum("ij->i", rows)[:, None] / rows.shape[1]
    size = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    if not size.all():
        return None
    rows /= size[:, None]
    product = np.einsum("ij,kj->ik", rows, rows).tolist()  # not by BLAS, whose first call takes longer than all of this
    (xx, xs, *_, xy), (_, ss, *_, sy), *_, (*_, yy) = _without(product, range(2, len(product) - 1))
    if min(xx, ss) < SINGULAR:
        return None
    by_x, by_xy = xx - xs * xs / ss, xy - xs * sy / ss  # what remains without the slope
    by_slope, by_sy, by_y = ss - xs * xs / xx, sy - xs * xy / xx, yy - xy * xy / xx  # and without the signal
    if min(by_x, by_slope) < SINGULAR or by_xy <= 0.0:
        return None
    weight = by_sy / by_slope
    residual = max(by_y - weight * by_sy, 0.0)
    per = float(size[0] / size[1]) * by_x / by_xy
    return _Lag(applied - per * weight, residual, per * math.sqrt(residual / by_slope), by_y, rows)


def _aligned(pair: _Pair, applied: float) -> Signal | None:
    """First signal and its slope, both late by the lag, what stands beside, and the second signal, as rows of a matrix."""
    span = float(pair.t[-1] - pair.t[0]) if pair.t.size else 0.0
    half = max(1, round(SLOPE * (pair.t.size - 1) / max(span, 1e-9)))
    if pair.t.size < MIN_SAMPLES + 2 * half:
        return None
    t = pair.t[half:-half]
    x, *others = (signal[half:-half] for signal in (pair.x, *pair.beside, pair.y))
    slope = (pair.x[2 * half :] - pair.x[: -2 * half]) / (pair.t[2 * half :] - pair.t[: -2 * half])
    if applied == 0.0:
        return np.array([x, slope, *others])
    kept = (t - applied >= t[0]) & (t - applied <= t[-1])
    if np.count_nonzero(kept) < MIN_SAMPLES:
        return None
    before = t[kept] - applied
    return np.array([np.interp(before, t, x), np.interp(before, t, slope), *(signal[kept] for signal in others)])


def _without(product: list[list[float]], columns: Sequence[int]) -> list[list[float]]:
    """Products of what remains of some signals when others, by their number, are regressed out."""
    for k in columns:
        pivot = product[k]
        if pivot[k] >= SINGULAR:
            product = [[a - row[k] * b / pivot[k] for a, b in zip(row, pivot, strict=True)] for row in product]
    return product


def _standard_uncertainty(found: _Lag) -> float:
    """Standard uncertainty of a lag: its residual is correlated from sample to sample, so that fewer of them count. [s]"""
    columns, y = found.rows[:-1], found.rows[-1]
    residual = y - np.linalg.lstsq(columns.T, y, rcond=None)[0] @ columns
    following = float(residual[1:] @ residual[:-1]) / max(float(residual @ residual), 1e-30)
    return found.scale * math.sqrt(max((1.0 + following) / max(1.0 - following, 1e-3), 1.0) / y.size)


def _finding(phased: PhasedRun, x: str, y: str, found: list[tuple[int, _Lag]], limit: float) -> Finding:
    largest = max((lag for _, lag in found), key=lambda lag: abs(lag.seconds))
    u = max(_standard_uncertainty(largest), 0.001)
    late, early = (y, x) if largest.seconds > 0 else (x, y)
    return Finding(
        "channel_lag",
        f"{late} is {abs(largest.seconds):.2f} s behind {early} (standard uncertainty {u:.3f} s); expected "
        f"less than {limit:.2g} s",
        "reported and kept; powers take both at one time: check filters and clocks of their loggers",
        late if late in CHANNELS else None,
        phased.cycles[found[0][0]].onset,
        phased.cycles[found[-1][0]].payout_end,
        len(found),
    )
