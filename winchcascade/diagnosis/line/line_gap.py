"""Where the gap of a winch without a model lies: its power against that of the line, phase by phase."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_map import Place, weigh
from winchcascade.diagnosis.line.line_closure import block_noise
from winchcascade.diagnosis.line.line_data import POWER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.diagnosis.line.line_data import CyclePart


def map_of(parts: Sequence[CyclePart]) -> tuple[Place, ...]:
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
        by = weigh(mean[here], cycle[here], np.full(int(here.sum()), noise), 0.0, np.zeros((int(here.sum()), 1)))
        rows.append(Place(POWER, name, -1, None, int(here.sum()), share=share, **msgspec.structs.asdict(by)))
    return tuple(rows)


def worst(rows: Sequence[Place]) -> Place:
    """The phase that holds most of the squared gap."""
    return max(rows, key=lambda row: row.share)
