"""Powers over generator speed: means in bins of 100 rpm while the clutch is engaged."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.integrate import BLOCK, ends_of, largest
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.core.smooth import local_quadratic
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phase_summary import PlateauSummary
from winchcascade.reduction.phases import Cycle, Plateau

MAX_BINS = 20_000
"""Maximum number of bins of generator speed: more show an error in a rig file."""

TORQUE = "torque"
"""Name of the torque of the PTO shaft among the quantities that a bin averages."""

STORES = ("rotor", "spring", "capacitor")
"""Where energy is stored between the torque sensor and the load while the speed changes: the
spring is that of the shaft.
"""

STORED_WITHIN = 1 / 3
"""Width over which a signal is smoothed before its change is taken, as a share of that which
smooths the velocity: short against a braking. What remains of the noise averages out in a bin, as
its changes add up to the difference of the ends. [1]"""

AT_ONCE = BLOCK // 8
"""Number of samples of which all powers are made at a time."""

BINS_MIN = 20
"""Minimum number of bins up to the maximum speed where the rig file states no width: the paper
has 32.
"""


class Bin(msgspec.Struct, frozen=True):
    """One bin of generator speed.

    Parameters
    ----------
    rpm_low, rpm_high : its ends [rpm]
    count : samples in it
    mean : by name, of the power of each stage [W], of the `TORQUE` [N m], and of the powers that go
        into `STORES` while the speed changes [W]; P_mech - P_gen less these is a loss
    standard_error : s/sqrt(n) of the same, as if samples were independent; a single sample has none
    """

    rpm_low: float
    rpm_high: float
    count: int
    mean: Mapping[str, float]
    standard_error: Mapping[str, float]


def engaged(
    run: Run, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | PlateauSummary | None], rig: Rig
) -> Mask:
    """Find the samples of the payouts in which the clutch drives the generator, (n,).

    When the drum slows the rotor runs on alone and the torque of the PTO shaft is zero. So from an
    onset the clutch counts as engaged until the torque has risen, and from then on wherever there
    is torque; without a torque channel until braking begins. Bridged samples are left out.
    """
    driven = np.zeros(run.t.size, dtype=bool)
    clutch, torque = rig.drivetrain.one_way_clutch, run.channels.get("torque")
    for cycle, plateau in zip(cycles, plateaus, strict=True):
        end = (
            plateau.braking
            if clutch and torque is None and plateau is not None
            else cycle.payout_end
        )
        rows = slice(
            int(run.t.searchsorted(cycle.onset)), int(run.t.searchsorted(end, side="right"))
        )
        driven[rows] = True
        if clutch and torque is not None:
            pulls = torque[rows] >= rig.thresholds.tau_engaged
            driven[rows] = pulls | ~np.logical_or.accumulate(pulls) if pulls.any() else pulls
    for before, after in all_gaps(run, rig.cascade.channels):
        driven[
            np.searchsorted(run.t, before, side="right") : np.searchsorted(
                run.t, after, side="left"
            )
        ] = False
    return driven


def generator_speed(run: Run, rig: Rig) -> tuple[Signal, float] | None:
    """A signal and the factor that turns it into the speed of the generator in rpm; None where that
    speed is unknown.

    The line velocity gives it while the clutch is engaged, where drum radius and gear ratio are
    known, else the logged speed of the shaft.
    """
    per_velocity, gear = rig.rpm_per_velocity, rig.drivetrain.gear_ratio
    if per_velocity is not None and "velocity" in run.channels:
        return run.channels["velocity"], per_velocity
    if "speed" in run.channels:
        return run.channels["speed"], (1.0 if gear is None else gear.value) * 30.0 / math.pi
    return None


def stored_powers(run: Run, rig: Rig, rows: Index, *numbers: float | None) -> dict[str, Signal]:
    """Powers that go into `STORES` in some rows of the log that rise, of those whose signal is
    logged and whose number is known. [W]

    J omega domega/dt of a rotor, tau dtau/dt / k of a spring, C V dV/dt of a capacitor; negative
    where it gives energy back. Each signal is smoothed before its slope is taken.

    Parameters
    ----------
    numbers : inertia of the rotor [kg m2], stiffness of the shaft [N m/rad], capacitance of the DC
        link [F]; by default those of the rig file
    """
    stated = rig.drivetrain.inertia_rotor, rig.drivetrain.k_shaft, rig.dc_link.c_dc
    inertia, k_shaft, c_dc = numbers or (
        None if number is None else number.value for number in stated
    )
    speed, rpm = generator_speed(run, rig) or (None, 0.0)
    stores = {
        "rotor": (speed, None if inertia is None else inertia * (rpm * math.pi / 30.0) ** 2),
        "spring": (run.channels.get(TORQUE), 1.0 / k_shaft if k_shaft else None),
        "capacitor": (run.channels.get("vdc"), c_dc),
    }
    known = {
        store: (signal, constant)
        for store, (signal, constant) in stores.items()
        if signal is not None and constant is not None
    }
    if not known or run.t.size < 2:
        return {}
    t, width = run.t, STORED_WITHIN * rig.thresholds.smoothing
    ends = t[rows[[0, -1]]] + (-width, width)  # what smooths the first and the last row
    begin, end = t.searchsorted(ends).tolist()
    part = slice(begin, end + 1)
    signals = np.array([signal[part] for signal, _ in known.values()])
    smooth = local_quadratic(t[part], signals, width)
    power = smooth * np.gradient(smooth, t[part], axis=1)
    power *= np.array([[constant] for _, constant in known.values()])
    return dict(zip(known, power[:, rows - begin], strict=True))


def bins_of(
    run: Run, rig: Rig, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | None]
) -> tuple[Bin, ...]:
    """Bins over the payouts of some cycles; none where the speed of the generator is unknown.

    Raises
    ------
    OptionError : the rig file makes more than `MAX_BINS`
    """
    found = generator_speed(run, rig)
    if found is None:
        return ()
    speed, rpm = found
    width = bin_width(rig, largest(speed) * rpm)
    if math.isnan(width):  # a shaft at rest has no bins
        return ()
    maximum = largest(speed) * rpm / width
    if maximum > MAX_BINS:
        raise OptionError(
            f"{run.name}: {maximum:.3g} bins of {width:g} rpm; expected at most {MAX_BINS}. Check "
            f"gear_ratio, "
            f"r_drum and rpm_bin of the rig {rig.name}, and the unit of the velocity."
        )
    streams = rig.cascade.streams(run.channels, rig.r_drum)
    streams |= {name: run.channels[name].__getitem__ for name in (TORQUE,) if name in run.channels}

    def averaged(rows: Index) -> dict[str, Signal]:
        found = {name: stream(rows) for name, stream in streams.items()}
        return found | stored_powers(run, rig, rows)

    return bin_powers(speed, rpm, engaged(run, cycles, plateaus, rig), averaged, width)


def bin_width(rig: Rig, rpm_top: float) -> float:
    """Width of the bins of generator speed up to a maximum speed: that of the rig file, else a
    round one. [rpm]

    >>> from winchcascade.core.rig_toml import parse_rig
    >>> direct = parse_rig('name = "d"', "d.toml")
    >>> bin_width(direct, 43.0), bin_width(direct, 3200.0)
    (2.0, 100.0)
    """
    if not math.isnan(rig.thresholds.rpm_bin) or not rpm_top > 0.0:
        return rig.thresholds.rpm_bin
    largest_width = rpm_top / BINS_MIN
    decade = 10.0 ** math.floor(math.log10(largest_width))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= largest_width)


def bin_powers(
    speed: Signal,
    rpm: float,
    driven: Mask,
    powers: Callable[[Index], Mapping[str, Signal]],
    width: float,
) -> tuple[Bin, ...]:
    """Average each power in bins of generator speed; bins without a sample are left out.

    Parameters
    ----------
    speed, rpm : (n,) signal, and the factor that turns it into generator speed [rpm]
    driven : (n,) samples that count
    powers : what is averaged, by name, in some rows of the log
    width : of a bin [rpm]
    """
    if not driven.any():
        return ()
    low, high = (math.floor(end * (rpm / width)) for end in ends_of(speed[driven]))
    count, names = np.zeros(high - low + 1, dtype=np.intp), list[str]()
    sums: list[Signal] = []
    for start in range(0, driven.size, AT_ONCE):
        rows = start + np.flatnonzero(driven[start : start + AT_ONCE])
        if rows.size:
            number = np.floor(speed[rows] * (rpm / width)).astype(np.intp) - low
            count += np.bincount(number, minlength=count.size)
            columns = powers(rows)
            names, x = [*columns], np.array([*columns.values()])
            cells = np.arange(2 * len(names))[:, None] * count.size + number
            both = np.concatenate((x, x * x)).ravel()
            added = np.bincount(cells.ravel(), both, 2 * len(names) * count.size)
            sums.append(added.astype(np.float64).reshape(2, len(names), count.size))
    total, squares = np.sum(sums, axis=0)
    n = np.maximum(count, 1)
    average = total / n
    error = np.sqrt(np.maximum(squares / n - average * average, 0.0) / np.maximum(n - 1, 1))
    bins = []
    for k in np.flatnonzero(count).tolist():
        mean, of_mean = (
            dict(zip(names, column[:, k].tolist(), strict=True)) for column in (average, error)
        )
        of_mean = of_mean if count[k] > 1 else {}
        bins.append(Bin((low + k) * width, (low + k + 1) * width, int(count[k]), mean, of_mean))
    return tuple(bins)
