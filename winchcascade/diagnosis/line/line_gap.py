"""Where the gap of a winch without a model lies: its power against that of the line, phase by phase."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_map import weigh
from winchcascade.diagnosis.line.line_closure import block_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.line.line_data import Part


class Row(msgspec.Struct, frozen=True):
    """The power in one phase over all cycles: measured minus line force times speed, block means [W].

    `noise` of a block, one standard deviation; standard uncertainties of the bias: `u_noise` of noise, `u_repeat` of how cycles
    repeat, NaN with one. `share` of all squares.
    """

    phase: str
    blocks: int
    bias: float
    rms: float
    noise: float
    u_noise: float
    u_repeat: float
    z: float
    share: float


def map_of(parts: Sequence[Part]) -> tuple[Row, ...]:
    """Map the gap: one row for each phase of which there are blocks."""
    means = [part.means(part.gap) for part in parts]
    cycle = np.concatenate([1000 * k + part.blocks.cycle for k, part in enumerate(parts)])
    phase = np.concatenate([part.blocks.phase for part in parts])
    count = np.concatenate([part.blocks.count for part in parts])
    mean = np.concatenate(means)
    whole = float(np.nansum(count * mean**2))
    rows = []
    for number, name in enumerate(PHASES):
        here = (phase == number) & np.isfinite(mean)
        if np.count_nonzero(here) < 2:
            continue
        noise = block_noise(parts, means, number)
        noise = noise if math.isfinite(noise) else float(np.std(mean[here]))
        share = float(np.sum(count[here] * mean[here] ** 2)) / max(whole, 1e-300)
        rows.append(_row(name, mean[here], cycle[here], noise, share))
    return tuple(rows)


def _row(name: str, mean: Signal, cycle: np.ndarray[tuple[int], np.dtype[np.intp]], noise: float, share: float) -> Row:
    by = weigh(mean, cycle, np.full(mean.size, noise), 0.0, np.zeros((mean.size, 1)))
    return Row(name, mean.size, by.bias, by.rms, by.noise, by.u_noise, by.u_repeat, by.z, share)


def worst(rows: Sequence[Row]) -> Row:
    """The phase that holds most of the squared gap."""
    return max(rows, key=lambda row: row.share)


def sentence(stage: str, rows: Sequence[Row]) -> str:
    """Where the gap lies, in one sentence."""
    row = worst(rows)
    side = "above" if row.bias > 0.0 else "below"
    return (
        f"{stage}: in {row.phase.replace('_', '-')} the measured power of the winch lies {abs(row.bias) / 1e3:.2g} kW {side} "
        f"line force times speed on average (z = {row.z:+.0f}), {row.rms / 1e3:.2g} kW rms; that phase holds "
        f"{100.0 * row.share:.0f} % of the squared gap."
    )
