"""Powers over generator speed: means in bins of 100 rpm while the clutch is engaged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.cascade import Stream
from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import largest
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phase_summary import PlateauSummary
from winchcascade.reduction.phases import Cycle, Plateau

MAX_BINS = 20_000
"""Maximum number of bins of generator speed: more show an error in a rig file."""

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
    """Power into a store of the energy constant x^2 / 2, (n,), negative where the store gives energy back. [W]

    J omega domega/dt of a rotor, tau dtau/dt / k of a spring, C V dV/dt of a capacitor.

    Parameters
    ----------
    t, x : (n,) stamps [s] and the signal
    constant : J [kg m2], 1 / k [rad/(N m)] or C [F], for the unit of the signal

    Examples
    --------
    >>> t = np.linspace(0.0, 5.0, 101)
    >>> storing(t, 3.0 * t, 2.0).round(6)[50]  # 2 times 7.5 times 3
    np.float64(45.0)
    """
    if t.size < 2:
        return np.zeros_like(x)
    smooth = local_quadratic(t, x, STORED_WITHIN)
    return np.asarray(constant * smooth * np.gradient(smooth, t))


def stored_powers(run: Run, rig: Rig, *numbers: float | None) -> dict[str, Signal]:
    """Powers that go into `STORES`, (n,), of those whose signal is logged and whose number is known. [W]

    Parameters
    ----------
    numbers : inertia of the rotor [kg m2], stiffness of the shaft [N m/rad], capacitance of the DC link [F]; by default those
        of the rig file
    """
    stated = rig.drivetrain.inertia_rotor, rig.drivetrain.k_shaft, rig.dc_link.c_dc
    inertia, k_shaft, c_dc = numbers or (None if number is None else number.value for number in stated)
    found, speed, channels = {}, generator_speed(run, rig), run.channels
    if speed is not None and inertia is not None:
        signal, rpm = speed
        found["rotor"] = storing(run.t, signal, inertia * (rpm * math.pi / 30.0) ** 2)
    if TORQUE in channels and k_shaft:
        found["spring"] = storing(run.t, channels[TORQUE], 1.0 / k_shaft)
    if "vdc" in channels and c_dc is not None:
        found["capacitor"] = storing(run.t, channels["vdc"], c_dc)
    return found


def bins_of(run: Run, rig: Rig, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | None]) -> tuple[Bin, ...]:
    """Bins over the payouts of some cycles; none where the speed of the generator is unknown.

    Raises
    ------
    OptionError : the rig file makes more than `MAX_BINS`
    """
    found = generator_speed(run, rig)
    if found is None:
        return ()
    speed, rpm = found
    maximum = largest(speed) * rpm / rig.thresholds.rpm_bin
    if maximum > MAX_BINS:
        raise OptionError(
            f"{run.name}: {maximum:.3g} bins of {rig.thresholds.rpm_bin:g} rpm; expected at most {MAX_BINS}. Check gear_ratio, "
            f"r_drum and rpm_bin of the rig {rig.name}, and the unit of the velocity."
        )
    averaged: dict[str, Stream | None] = {s.name: s.stream(run.channels, rig.r_drum) for s in rig.cascade.stages}
    averaged[TORQUE] = run.channels[TORQUE].__getitem__ if TORQUE in run.channels else None
    averaged |= {store: watts.__getitem__ for store, watts in stored_powers(run, rig).items()}
    return bin_powers(speed, rpm, engaged(run, cycles, plateaus, rig), averaged, rig.thresholds.rpm_bin)


def bin_powers(
    speed: Signal, rpm: float, driven: Mask, powers: Mapping[str, Stream | None], width: float
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
    rows = np.flatnonzero(driven)
    if rows.size == 0:
        return ()
    number = np.floor(speed[rows] * (rpm / width)).astype(np.intp)
    low = int(number.min())
    number -= low
    count = np.bincount(number)
    n = np.maximum(count, 1)
    mean: dict[str, list[float]] = {}
    error: dict[str, list[float]] = {}
    for name, stream in powers.items():
        if stream is not None:
            x = stream(rows)
            average, square = np.bincount(number, x) / n, np.bincount(number, x * x) / n
            mean[name] = average.tolist()
            error[name] = np.sqrt(np.maximum(square - average * average, 0.0) / np.maximum(n - 1, 1)).tolist()
    stages = [name for name in powers if name not in (TORQUE, *STORES)]
    bins = []
    for k, samples in enumerate(count.tolist()):
        if samples:
            of = {name: x[k] for name, x in mean.items()}
            u = {name: x[k] for name, x in error.items()} if samples > 1 else {}
            powers_of, errors_of = ({name: found.get(name) for name in stages} for found in (of, u))
            stored = {store: of.get(store) for store in STORES}
            edges = (low + k) * width, (low + k + 1) * width
            bins.append(Bin(*edges, samples, powers_of, errors_of, of.get(TORQUE), u.get(TORQUE), stored))
    return tuple(bins)
