"""Powers over generator speed: means in bins of 100 rpm while the clutch is engaged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.run import CLOCK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.phases.detect import Cycle
    from winchcascade.phases.window import Plateau
    from winchcascade.rigfile import Rig
    from winchcascade.run import Run, Signal

    Mask = NDArray[np.bool_]


class Bin(msgspec.Struct, frozen=True):
    """One bin of generator speed [rpm]: samples in it, and of each stage's power mean and standard error [W].

    The standard error is s/sqrt(n) of the samples as if they were independent; it is None for a single sample.
    """

    rpm_low: float
    rpm_high: float
    count: int
    power: Mapping[str, float | None]
    standard_error: Mapping[str, float | None]


def engaged(run: Run, cycles: Sequence[Cycle], plateaus: Sequence[Plateau | None], rig: Rig) -> Mask:
    """Tell the samples of the payouts in which the clutch drives the generator, (n,).

    When the drum slows the rotor runs on alone and the torque behind the clutch is zero. So from an onset the clutch counts
    as engaged until the torque has risen, and from then on wherever there is torque; without a torque channel until
    braking begins. Bridged samples are left out.
    """
    driven = np.zeros(run.t.size, dtype=bool)
    torque = run.channels.get("torque")
    for cycle, plateau in zip(cycles, plateaus, strict=True):
        first = int(np.searchsorted(run.t, cycle.onset, side="left"))
        last = int(np.searchsorted(run.t, cycle.payout_end, side="right"))
        if not rig.drivetrain.one_way_clutch:
            driven[first:last] = True
        elif torque is not None:
            pulls = torque[first:last] >= rig.thresholds.tau_engaged
            rising = int(np.argmax(pulls)) if pulls.any() else 0
            driven[first:last] = pulls
            driven[first : first + rising] = True
        else:
            braking = plateau.braking if plateau is not None else cycle.payout_end
            driven[first : int(np.searchsorted(run.t, braking, side="right"))] = True
    for name in (CLOCK, "velocity", "force", "torque", "power_mech", "vdc", "idc"):
        for before, after in run.gaps.get(name, ()):
            driven[np.searchsorted(run.t, before, side="right") : np.searchsorted(run.t, after, side="left")] = False
    return driven


def bin_powers(rpm: Signal, powers: Iterable[tuple[str, Signal | None]], width: float) -> tuple[Bin, ...]:
    """Average each power in bins of generator speed; bins without a sample are left out.

    Parameters
    ----------
    rpm : (n,) generator speed of the samples to be binned [rpm]
    powers : stage by stage its (n,) power, None for one that is not measured [W]
    width : of a bin [rpm]
    """
    if rpm.size == 0:
        return ()
    number = np.floor(rpm / width).astype(np.int64)
    low = int(number.min())
    number -= low
    count = np.bincount(number)
    found = [(stage, None if power is None else _mean_and_error(number, power, count)) for stage, power in powers]
    bins = []
    for k in np.flatnonzero(count).tolist():
        n = int(count[k])
        bins.append(
            Bin(
                (low + k) * width,
                (low + k + 1) * width,
                n,
                {stage: None if both is None else float(both[0][k]) for stage, both in found},
                {stage: None if both is None or n < 2 else float(both[1][k]) for stage, both in found},
            )
        )
    return tuple(bins)


def _mean_and_error(number: NDArray[np.int64], power: Signal, count: NDArray[np.intp]) -> tuple[Signal, Signal]:
    n = np.maximum(count, 1)
    mean: Signal = np.bincount(number, weights=power, minlength=count.size) / n
    square = np.bincount(number, weights=power * power, minlength=count.size) / n
    error: Signal = np.sqrt(np.maximum(square - mean * mean, 0.0) / np.maximum(n - 1, 1))
    return mean, error
