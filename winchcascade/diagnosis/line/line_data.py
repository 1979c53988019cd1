"""What a log must hold to be diagnosed without a model, and which of its samples count."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.core.integrate import median
from winchcascade.core.run import CLOCK
from winchcascade.diagnosis.block_means import Blocks, blocks_of
from winchcascade.diagnosis.suspects import freedom
from winchcascade.reduction.energies import power
from winchcascade.reduction.phases import detect, smoothed_velocity
from winchcascade.rig.stages import acceleration, line_power

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal

    Index = NDArray[np.intp]

AGAINST = -0.2
"""Power and line force times speed that are correlated below this run against each other: one has the other sign."""


def measured_power(run: Run, rig: Rig) -> Signal:
    """Mechanical power of the winch, (n,) [W].

    Raises
    ------
    LogError : the log lacks line force or power, or they run against each other
    """
    for channel, what in (("force", "line force"), ("velocity", "line velocity")):
        if channel not in run.channels:
            raise LogError(
                f"{run.name}: no {what}; a rig without a model ({rig.name}) is diagnosed from line force, velocity and "
                "mechanical power, so log it, or name its column under [columns] in the rig file."
            )
    found = power(run.channels, "mech", rig.r_drum)
    if found is None:
        raise LogError(
            f"{run.name}: no mechanical power of the winch, nor a torque with a drum radius in the rig file; a rig without a "
            f"model ({rig.name}) is diagnosed from line force, velocity and mechanical power, so log it."
        )
    return found


def good_samples(run: Run, reach: float) -> NDArray[np.bool_]:
    """Samples in which line force, velocity and power were logged, (n,); beside a gap of the velocity none has a slope.

    Parameters
    ----------
    reach : half of the width over which the slope is taken [s]
    """
    good = np.ones(run.t.size, dtype=bool)
    for channel, gaps in run.gaps.items():
        beside = reach if channel in (CLOCK, "velocity") else 0.0
        if channel in (CLOCK, "velocity", "force", "power_mech", "torque"):
            for a, b in gaps.tolist():
                good &= ~((run.t > a - beside) & (run.t < b + beside))
    return good


def check_sign(run: Run, gap: Signal, here: Index) -> None:
    """Refuse a power that runs against line force times speed: its sign, or that of the force, is the other one."""
    given = line_power(run)[here]
    together = float(np.dot(gap + given, given))
    size = float(np.linalg.norm(gap + given) * np.linalg.norm(given))
    if size > 0.0 and together / size < AGAINST:
        raise LogError(
            f"{run.name}: the mechanical power has the other sign: it is negative where line force times velocity is positive "
            f"(correlation {together / size:.2f}); it must be positive while the line drives the winch, so turn that column."
        )


if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.suspects import Suspects

POWER = "power_mech"
"""The channel in which a winch without a model shows its gap."""

NUMBERS = {
    "drum_inertia": ("mass_extra", "kg"),
    "line_friction": ("force", "N"),
    "line_drag": ("b_line", "N.s/m"),
    "force_gain": ("gain_error", "relative"),
    "force_zero": ("offset", "N"),
}
"""Suspects that act between line and shaft: the number that is reported of each, in line units as no drum is known."""

SPANS = (0.1, 0.2, 0.3, 0.4)
"""Spans of samples that are tried for the slope of the velocity; a longer one blurs what the winch does. [s]"""

EVERYWHERE = 0.9
"""A span serves if it gives a slope at this share of the stamps."""

FEWEST = 100
"""Fewer samples that count tell nothing of five suspects."""


class CyclePart(msgspec.Struct, frozen=True):
    """The cycles of one log that one entry of a campaign names.

    `here` (k,) are the samples of `run` that count, `cycle` (k,) the payout each belongs to, `gap` (k,) the measured power
    minus line force times speed [W], `columns` (k, suspects) what one unit of each coefficient adds to the predicted power [W].
    """

    run: Run
    withheld: bool
    here: Index
    cycle: Index
    gap: Signal
    columns: Signal
    blocks: Blocks

    def means(self, x: Signal) -> Signal:
        """Mean over each block of what is given at the samples that count, (m,); NaN where half of a block is missing."""
        whole, known = np.zeros(self.run.t.size), np.zeros(self.run.t.size)
        whole[self.here], known[self.here] = x, 1.0
        share = self.blocks.mean(known)
        mean: Signal = np.where(share > 0.5, self.blocks.mean(whole) / np.maximum(share, 0.5), np.nan)
        return mean


class Lines(msgspec.Struct, frozen=True):
    """All parts of a campaign. `names` of the suspects, `low` and `high` (suspects,) bound their coefficients.

    The slope of the velocity is that of a local quadratic over the samples within `span`, one of the `spans` that differ [s].
    """

    names: tuple[str, ...]
    low: Signal
    high: Signal
    parts: tuple[CyclePart, ...]
    span: float
    spans: tuple[float, ...]

    @property
    def fitted(self) -> tuple[CyclePart, ...]:
        """Parts that take part in choice and fit."""
        return tuple(part for part in self.parts if not part.withheld)

    @property
    def judged(self) -> tuple[CyclePart, ...]:
        """Parts on which the causes are judged: the withheld ones, or all where none is."""
        return tuple(part for part in self.parts if part.withheld) or self.parts


def names_of(suspects: Suspects) -> tuple[str, ...]:
    """Suspects that act between line and shaft.

    Raises
    ------
    OptionError : none does
    """
    found = tuple(name for name in NUMBERS if name in suspects)
    if not found:
        raise OptionError(
            f"none of the suspects ({', '.join(suspects)}) acts between line and shaft, all that this rig has; suspect "
            f"{', '.join(NUMBERS)}."
        )
    return found


def bounds_of(suspects: Suspects, names: Sequence[str]) -> tuple[Signal, Signal]:
    """Bounds of the coefficients, (suspects,) each: none takes power from nowhere, a sensor errs within the catalogue."""
    low, high = np.zeros(len(names)), np.full(len(names), math.inf)
    for k, name in enumerate(names):
        if name == "force_gain":
            free = freedom(suspects[name])
            low[k], high[k] = 1.0 / (1.0 + free.high[0]) - 1.0, 1.0 / (1.0 + free.low[0]) - 1.0
        elif name == "force_zero":
            free = freedom(suspects[name])
            low[k], high[k] = free.low[0], free.high[0]
    return low, high


def beside(run: Run, span: float) -> int:
    """Samples on either side of one that a span takes in, one at least."""
    return max(int(span / (2.0 * median(np.diff(run.t))) + 0.01), 1)


def width_of(run: Run, span: float) -> float:
    """Width of the local quadratic that takes in the samples within a span. [s]

    It lies half a sample beyond what it takes in, so that stamps that are rounded do not decide which these are.
    """
    return (2.0 * beside(run, span) + 0.5) * median(np.diff(run.t))


def spans_of(run: Run) -> tuple[float, ...]:
    """Spans of samples that give different slopes, and one at nearly every stamp; the longest where none does. [s]"""
    step = median(np.diff(run.t))
    spans = sorted({round(2.0 * beside(run, span) * step, 6) for span in SPANS})
    v = run.channels["velocity"]
    known = {span: float(np.mean(np.isfinite(acceleration(run.t, v, width_of(run, span))))) for span in spans}
    return tuple(span for span, share in known.items() if share > EVERYWHERE) or tuple(spans[-1:])


def columns_of(run: Run, names: Sequence[str], width: float) -> Signal:
    """What one unit of each coefficient adds to the power that the line gives, (n, suspects) [W]; NaN without a slope."""
    v, given = run.channels["velocity"], line_power(run)
    made = {
        "drum_inertia": lambda: line_power(run, mass_extra=1.0, width=width) - given,
        "line_friction": lambda: line_power(run, force=1.0) - given,
        "line_drag": lambda: line_power(run, b_line=1.0) - given,
        "force_gain": lambda: given,
        "force_zero": lambda: -v,
    }
    return np.column_stack([made[name]() for name in names])


def lines_of(
    runs: Sequence[Run],
    rig: Rig,
    suspects: Suspects,
    cycles: Sequence[tuple[int, int] | None],
    withheld: Sequence[int],
) -> Lines:
    """Take the samples that count out of logs; the slope of the velocity is over the shortest span.

    Parameters
    ----------
    cycles : of each run, the first and last cycle that count, None for all
    withheld : numbers of runs that take part in neither choice nor fit

    Raises
    ------
    LogError, CampaignError : a log lacks a channel, or an entry the cycles that it names
    """
    names = names_of(suspects)
    low, high = bounds_of(suspects, names)
    for run in runs:
        measured_power(run, rig)
    spans = spans_of(runs[0])
    parts = [
        _part(run, rig, names, asked, spans[0], withheld=k in withheld)
        for k, (run, asked) in enumerate(zip(runs, cycles, strict=True))
    ]
    _check_overlap(parts)
    return Lines(names, low, high, tuple(parts), spans[0], spans)


def with_span(lines: Lines, span: float) -> Lines:
    """The same samples with the slope of the velocity over another span [s]."""
    parts: list[CyclePart] = []
    found: dict[int, Signal] = {}
    for part in lines.parts:
        key = id(part.run)
        if key not in found:
            found[key] = columns_of(part.run, lines.names, width_of(part.run, span))
        parts.append(msgspec.structs.replace(part, columns=found[key][part.here]))
    return msgspec.structs.replace(lines, parts=tuple(parts), span=span)


def _part(
    run: Run, rig: Rig, names: Sequence[str], asked: tuple[int, int] | None, span: float, *, withheld: bool
) -> CyclePart:
    gap = measured_power(run, rig) - line_power(run)
    columns = columns_of(run, names, width_of(run, span))
    cycle = cycles_of(run, rig)
    usable = good_samples(run, 0.5 * width_of(run, SPANS[-1])) & np.isfinite(gap) & np.isfinite(columns).all(axis=1)
    if asked is not None:
        usable &= (cycle >= asked[0]) & (cycle <= asked[1])
    here = np.flatnonzero(usable)
    if here.size < FEWEST:
        what = "the log" if asked is None else f"cycles {asked[0]} to {asked[1]}"
        raise CampaignError(
            f"{run.name}: {what} holds {here.size} samples of line force, velocity and power, and {FEWEST} are needed; the log "
            f"has {int(cycle.max())} cycles."
        )
    check_sign(run, gap[here], here)
    return CyclePart(run, withheld, here, cycle[here], gap[here], columns[here], blocks_of(run, rig, asked))


def cycles_of(run: Run, rig: Rig) -> Index:
    """Payout that each sample belongs to, (n,) from 1; what comes before the first one belongs to it."""
    onsets = [cycle.onset for cycle in detect(run, smoothed_velocity(run, rig.thresholds), rig.thresholds)]
    return np.maximum(np.searchsorted(np.array(onsets), run.t, side="right"), 1)


def _check_overlap(parts: Sequence[CyclePart]) -> None:
    """Refuse samples that are named twice: in two fits they would count twice, and a fit must not know what is withheld."""
    for k, one in enumerate(parts):
        for other in parts[:k]:
            if one.run.sha256 == other.run.sha256 and one.run.name == other.run.name:
                both = np.intersect1d(one.cycle, other.cycle)
                if both.size:
                    raise CampaignError(
                        f"{one.run.name}: cycle {int(both[0])} is named by two runs of the campaign; give each cycle once, "
                        "either to the fit or withheld."
                    )
