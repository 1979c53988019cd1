"""Waveforms that were sampled apart, brought onto the clock of one of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

WHOLE = 0.01
"""A shift that is this close to a whole number of samples is one. [samples]"""

TRIM_REPORTED = 1.0
"""Longest stretch that may be cut from the ends without a finding. [s]"""


class Waveform(msgspec.Struct, frozen=True):
    """The stamps ``start + k * step`` of a channel. [s]"""

    step: float
    start: float


def shared(clocks: Iterable[Waveform | None]) -> Waveform | None:
    """Find the clock of most channels, the finer one of two alike."""
    counts = Counter(clock for clock in clocks if clock is not None)
    return max(counts, key=lambda clock: (counts[clock], -clock.step), default=None)


def alike(clocks: Sequence[Waveform]) -> bool:
    """Whether clocks tick together: their steps are the same and they start less than a step apart."""
    steps, starts = [clock.step for clock in clocks], [clock.start for clock in clocks]
    return max(steps) - min(steps) <= WHOLE * min(steps) and max(starts) - min(starts) <= min(steps)


def overlap(some: Sequence[tuple[Waveform, int]], others: Sequence[tuple[Waveform, int]]) -> bool:
    """Whether two sets of waveforms, each with its number of samples, were sampled at the same time."""
    begin = max(min(clock.start for clock, _ in tracks) for tracks in (some, others))
    end = min(max(clock.start + clock.step * (n - 1) for clock, n in tracks) for tracks in (some, others))
    return begin <= end


def common_stamps(
    path: Path, reference: Waveform, tracks: Sequence[tuple[Waveform, int]]
) -> tuple[Signal, tuple[Finding, ...]]:
    """Find the stamps of the reference clock at which every channel was sampled, and report what lies outside. [s]

    Raises
    ------
    LogError
        there is no such stamp
    """
    begins = [clock.start for clock, _ in tracks]
    ends = [clock.start + clock.step * (length - 1) for clock, length in tracks]
    first = np.ceil((max(begins) - reference.start) / reference.step - WHOLE)
    last = np.floor((min(ends) - reference.start) / reference.step + WHOLE)
    if not np.isfinite([*begins, *ends, first, last]).all():
        raise LogError(
            f"{path.name}: one channel begins at {max(begins):g} s and another ends at {min(ends):g} s; times that a clock can "
            "have were expected; check their wf_start_time, wf_start_offset and wf_increment."
        )
    if last < first:
        raise LogError(
            f"{path.name}: one channel begins at {max(begins):.3f} s and another ends at {min(ends):.3f} s; channels "
            "that overlap in time were expected; check their wf_start_time and wf_start_offset."
        )
    t = reference.start + reference.step * np.arange(int(first), int(last) + 1, dtype=np.float64)
    trimmed = max(ends) - min(begins) - (t[-1] - t[0])
    if trimmed <= TRIM_REPORTED:
        return t, ()
    lost = round(trimmed / reference.step)
    message = (
        f"the channels begin or end apart: {lost} samples between {min(begins):.3f} and {max(ends):.3f} s are not in "
        "every one"
    )
    action = f"left out what lies outside {t[0]:.3f} to {t[-1]:.3f} s"
    return t, (Finding("dropped_samples", message, action, count=lost, removed=lost),)


def at(t: Signal, values: Signal, clock: Waveform, step: float) -> Signal:
    """Take a channel at stamps of another clock: its own samples where they coincide, else interpolated. [s]"""
    shift = (t[0] - clock.start) / clock.step
    whole = round(shift)
    drift = abs(clock.step - step) * len(t) / step
    if abs(shift - whole) <= WHOLE and drift <= WHOLE:
        return values[whole : whole + len(t)]
    return np.interp(t, clock.start + clock.step * np.arange(len(values)), values)
