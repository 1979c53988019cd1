"""Powers over generator speed: means in bins of 100 rpm while the clutch is engaged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.cascade import Stream
from winchcascade.core.integrate import BLOCK
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phase_summary import PlateauSummary
from winchcascade.reduction.phases import Cycle, Plateau

TORQUE = "torque"
"""Key of the torque of the PTO shaft among the quantities that a bin averages."""


STORES = ("rotor", "spring", "capacitor")
"""Where energy is stored between the torque sensor and the load while the speed changes: the spring is that of the shaft."""

STORED_WITHIN = 0.2
"""Width over which a signal is smoothed before its change is taken: short against a braking of half a second. What remains of
the noise averages out in a bin, as its changes add up to the difference of the ends. [s]"""


class Bin(msgspec.Struct, frozen=True):
    """One bin of generator speed [rpm]: samples in it, and of each stage's power mean and standard error [W].

    `torque` is averaged in the same way [N m]. `stored` are the mean powers that go into `STORES` while the speed changes [W]:
    the difference of the powers of shaft and DC link less these is a loss. The standard error is s/sqrt(n) of the samples as
    if they were independent; it is None for a single sample.
    """

    rpm_low: float
    rpm_high: float
    count: int
    power: Mapping[str, float | None]
    standard_error: Mapping[str, float | None]
    torque: float | None = None
    torque_standard_error: float | None = None
    stored: Mapping[str, float | None] = {}

    def __getattr__(self, name: str) -> float | None:
        """Mean power of a stage as an attribute, such as `power_line`, as of `Metrics`; None for one that is not known. [W]

        >>> Bin(100.0, 200.0, 7, {"line": 50.0}, {"line": 1.5}).power_line
        50.0
        """
        if name.startswith("power_"):
            return self.power.get(name.removeprefix("power_"))
        raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")


def engaged(run: Run, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | PlateauSummary | None], rig: Rig) -> Mask:
    """Find the samples of the payouts in which the clutch drives the generator, (n,).

    When the drum slows the rotor runs on alone and the torque of the PTO shaft is zero. So from an onset the clutch counts
    as engaged until the torque has risen, and from then on wherever there is torque; without a torque channel until
    braking begins. Bridged samples are left out.
    """
    driven = np.zeros(run.t.size, dtype=bool)
    clutch, torque = rig.drivetrain.one_way_clutch, run.channels.get("torque")
    ends = [
        plateau.braking if clutch and torque is None and plateau is not None else cycle.payout_end
        for cycle, plateau in zip(cycles, plateaus, strict=True)
    ]
    begins, stops = run.t.searchsorted([cycle.onset for cycle in cycles]), run.t.searchsorted(ends, side="right")
    for first, last in zip(begins.tolist(), stops.tolist(), strict=True):
        driven[first:last] = True
        if clutch and torque is not None and first < last:
            pulls = torque[first:last] >= rig.thresholds.tau_engaged
            rising = int(pulls.argmax())  # 0 where nothing pulls
            driven[first + rising : last] = pulls[rising:]
    for before, after in all_gaps(run, rig.cascade.channels):
        driven[np.searchsorted(run.t, before, side="right") : np.searchsorted(run.t, after, side="left")] = False
    return driven


def generator_speed(run: Run, rig: Rig) -> tuple[Signal, float] | None:
    """A signal and the factor that turns it into the speed of the generator in rpm; None where that speed is unknown.

    The line velocity gives it while the clutch is engaged, where drum radius and gear ratio are known, else the logged speed of
    the shaft.
    """
    per_velocity, gear = rig.rpm_per_velocity, rig.drivetrain.gear_ratio
    if per_velocity is not None and "velocity" in run.channels:
        return run.channels["velocity"], per_velocity
    if "speed" in run.channels:
        return run.channels["speed"], (1.0 if gear is None else gear.value) * 30.0 / math.pi
    return None


def storing(t: Signal, x: Signal, constant: float) -> Signal:
    """Power into a store of the energy constant x^2 / 2.

    J omega domega/dt of a rotor, tau dtau/dt / k of a spring, C V dV/dt of a capacitor.

    Parameters
    ----------
    t, x : (n,) stamps [s] and the signal
    constant : J [kg m2], 1 / k [rad/(N m)] or C [F], for the unit of the signal

    Returns
    -------
    (n,) powers, negative where the store gives energy back [W]

    Examples
    --------
    >>> t = np.linspace(0.0, 5.0, 101)
    >>> storing(t, 3.0 * t, 2.0).round(6)[50]  # 2 times 7.5 times 3
    np.float64(45.0)
    """
    if t.size < 2:
        return np.zeros_like(x)
    smooth = local_quadratic(t, x, STORED_WITHIN)
    found: Signal = constant * smooth * np.gradient(smooth, t)
    return found


def stored_powers(run: Run, rig: Rig) -> dict[str, Signal]:
    """Powers that go into `STORES`, (n,), by the numbers that the rig file states. [W]"""
    stated = rig.drivetrain.inertia_rotor, rig.drivetrain.k_shaft, rig.dc_link.c_dc
    return stored_by(run, rig, *(None if number is None else number.value for number in stated))


def stored_by(
    run: Run, rig: Rig, inertia: float | None, k_shaft: float | None, c_dc: float | None
) -> dict[str, Signal]:
    """Powers that go into `STORES`, (n,), of those whose signal is logged and whose number is known. [W]

    Parameters
    ----------
    rig : drum radius and gear ratio
    inertia : of the rotor [kg m2]
    k_shaft : stiffness of the shaft [N m/rad]
    c_dc : capacitance of the DC link [F]
    """
    found, speed, channels = {}, generator_speed(run, rig), run.channels
    if speed is not None and inertia is not None:
        signal, rpm = speed
        found["rotor"] = storing(run.t, signal, inertia * (rpm * math.pi / 30.0) ** 2)
    if TORQUE in channels and k_shaft:
        found["spring"] = storing(run.t, channels[TORQUE], 1.0 / k_shaft)
    if "vdc" in channels and c_dc is not None:
        found["capacitor"] = storing(run.t, channels["vdc"], c_dc)
    return found


def bin_powers(
    speed: Signal,
    rpm: float,
    driven: Mask,
    powers: Mapping[str, Stream | None],
    width: float,
) -> tuple[Bin, ...]:
    """Average each power in bins of generator speed; bins without a sample are left out.

    Parameters
    ----------
    speed, rpm : (n,) signal, and the factor that turns it into generator speed [rpm]
    driven : (n,) samples that count
    powers : of each stage, as a function of the rows of the log, None for one that is not measured [W]; under `TORQUE`
        the torque [N m], under the names of `STORES` what is stored [W]
    width : of a bin [rpm]
    """
    if not driven.any():
        return ()
    per = rpm / width
    ends = np.array([speed.min(initial=np.inf, where=driven), speed.max(initial=-np.inf, where=driven)])
    low, high = sorted(np.floor(ends * per).astype(np.intp).tolist())
    count = np.zeros(high - low + 1, dtype=np.intp)
    sums = {name: (x, np.zeros((2, count.size))) for name, x in powers.items() if x is not None}
    for start in range(0, driven.size, BLOCK):
        part = slice(start, start + BLOCK)
        rows = np.flatnonzero(driven[part])
        number = np.floor(speed[part][rows] * per).astype(np.intp) - low
        count += np.bincount(number, minlength=count.size)
        for stream, total in sums.values():
            x = stream(part)[rows]
            total[0] += np.bincount(number, weights=x, minlength=count.size)
            total[1] += np.bincount(number, weights=x * x, minlength=count.size)
    none = [None] * count.size
    columns = {name: _mean_and_error(sums[name][1], count) if name in sums else (none, none) for name in powers}
    bins = []
    samples = count.tolist()
    for k in np.flatnonzero(count).tolist():
        mean = {name: means[k] for name, (means, _) in columns.items()}
        error = {name: errors[k] if samples[k] > 1 else None for name, (_, errors) in columns.items()}
        torque, torque_error = mean.pop(TORQUE, None), error.pop(TORQUE, None)
        stored = {name: mean.pop(name, None) for name in STORES}
        error = {name: u for name, u in error.items() if name in mean}
        edges = (low + k) * width, (low + k + 1) * width
        bins.append(Bin(*edges, samples[k], mean, error, torque, torque_error, stored))
    return tuple(bins)


def _mean_and_error(sums: Signal, count: Index) -> tuple[list[float], list[float]]:
    """Mean and standard error of a power in each bin, from the sums of its samples and of their squares."""
    n = np.maximum(count, 1)
    mean, square = sums / n
    error = np.sqrt(np.maximum(square - mean * mean, 0.0) / np.maximum(n - 1, 1))
    return mean.tolist(), error.tolist()
