"""Logs of a winch without a model: which samples count, cycle by cycle, and how each suspect changes the power.

The power of the shaft follows from the line by P = v (F - m dv/dt - F_0 sgn v - b v) - s |v F|, as `rig.stages.line_power` has
it but for the share s of the tension that is lost. A force cell that reads (1 + g) F + o gives F = (1 + h) F_read - o', with
h = 1 / (1 + g) - 1 and o' = o / (1 + g). So measured power minus v F_read is linear in m, F_0, b, s, h and o': the coefficients
of a fit.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.core.integrate import median
from winchcascade.core.run import CLOCK, Index, Run, Signal
from winchcascade.diagnosis.block_means import Blocks, blocks_of, in_a_row, stretches_of
from winchcascade.diagnosis.solve import Bounds
from winchcascade.reduction.phases import detect, smoothed_velocity
from winchcascade.rig.stages import acceleration, line_power

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.diagnosis_result import Entries
    from winchcascade.diagnosis.suspects import Suspects

TAIL = 0.25
"""Beyond the plausible range of a field the probability falls by a factor e for each such share of the range. Assumed. [1]"""

POWER = "power_mech"
"""Channel in which a winch without a model shows its gap."""

NUMBERS = {
    "drum_inertia": ("mass_extra", "kg"),
    "line_friction": ("force", "N"),
    "line_drag": ("b_line", "N.s/m"),
    "load_proportional_loss": ("share", "1"),
    "force_gain": ("gain_error", "relative"),
    "force_zero": ("offset", "N"),
}
"""Suspects that act between line and shaft: the number that is reported of each, in line units as no drum is known."""

SPANS = (0.1, 0.2, 0.3, 0.4)
"""Spans of samples that are tried for the slope of the velocity; a longer one smooths out fast motion. [s]"""

EVERYWHERE = 0.9
"""A span serves if it gives a slope at this share of the stamps."""

MIN_SAMPLES = 100
"""Minimum number of samples: fewer do not determine six coefficients."""

RANGED = ("load_proportional_loss", "force_gain", "force_zero")
"""Suspects whose number is a field of the catalogue, and its range that of the field."""

LONGEST_STEP = 2.0
"""Maximum time that a sample stands for, in steps of the log: a longer gap is not bridged. [1]"""

AGAINST = -0.2
"""Correlation of power and line tension times speed below which one of them has the other sign."""


class CyclePart(msgspec.Struct, frozen=True):
    """The cycles of one log that one entry of a campaign names.

    `here` (k,) are the samples of `run` that count, `cycle` (k,) the payout each belongs to, `phase` (k,) an index of `PHASES`,
    `width` (k,) the time that each stands for [s], `gap` (k,) the measured power minus line tension times speed [W], `columns`
    (k, suspects) the predicted power per unit of each coefficient.
    """

    run: Run
    withheld: bool
    here: Index
    cycle: Index
    phase: Index
    width: Signal
    gap: Signal
    columns: Signal
    blocks: Blocks

    @property
    def line_power(self) -> Signal:
        """Line tension times speed at the samples that count, (k,) [W]."""
        found: Signal = (self.run.channels["force"] * self.run.channels["velocity"])[self.here]
        return found

    def means(self, x: Signal) -> Signal:
        """Mean over each block of values at the samples that count, (m,); NaN where half of a block is missing."""
        whole, known = np.zeros(self.run.t.size), np.zeros(self.run.t.size)
        whole[self.here], known[self.here] = x, 1.0
        share = self.blocks.mean(known)
        return np.where(share > 0.5, self.blocks.mean(whole) / np.maximum(share, 0.5), np.nan)


class Lines(msgspec.Struct, frozen=True):
    """All parts of a campaign. `names` of the suspects, `bounds` (suspects,) those of their coefficients.

    The inner bounds are what is plausible. The slope of the velocity is that of a local quadratic over the samples within
    `span`, one of the `spans` that differ [s].
    """

    names: tuple[str, ...]
    bounds: Bounds
    parts: tuple[CyclePart, ...]
    span: float
    spans: tuple[float, ...]

    @property
    def fitted(self) -> tuple[CyclePart, ...]:
        """Parts that take part in choice and fit."""
        return tuple(part for part in self.parts if not part.withheld)

    @property
    def judged(self) -> tuple[CyclePart, ...]:
        """Parts that the causes are tested on: the withheld ones, or all where none is withheld."""
        return tuple(part for part in self.parts if part.withheld) or self.parts


def lines_of(entries: Entries, rig: Rig, suspects: Suspects) -> Lines:
    """Take the samples that count out of logs; the slope of the velocity is over the shortest span.

    Raises
    ------
    LogError, CampaignError : a log lacks a channel, or an entry the cycles that it names
    OptionError : no suspect acts between line and shaft
    """
    names = tuple(name for name in NUMBERS if name in suspects)
    if not names:
        raise OptionError(
            f"none of the suspects ({', '.join(suspects)}) acts between line and shaft, all that this rig has; suspect "
            f"{', '.join(NUMBERS)}."
        )
    gaps = [measured_power(run, rig) - line_power(run) for run in entries.runs]
    spans, parts, cycles = spans_of(entries.runs[0]), [], entries.cycles or [None] * len(gaps)
    for k, (run, gap, asked) in enumerate(zip(entries.runs, gaps, cycles, strict=True)):
        here, cycle, phase = _samples(run, rig, gap, asked)
        columns = columns_of(run, names, spans[0])
        here = here[np.isfinite(columns[here]).all(axis=1)]
        _check_part(run, gap, here, asked, int(cycle.max()))
        blocks, width = blocks_of(run, rig, asked), _widths(run)
        own = (cycle[here], phase[here], width[here], gap[here], columns[here])
        parts.append(CyclePart(run, k in entries.withheld, here, *own, blocks))
    _check_overlap(parts)
    return Lines(names, _bounds(suspects, names, parts), tuple(parts), spans[0], spans)


def _widths(run: Run) -> Signal:
    """Time that each sample stands for, (n,): half of the steps on either side, a lost row counting as a step. [s]"""
    return np.minimum(np.gradient(run.t), LONGEST_STEP * median(np.diff(run.t)))


def _bounds(suspects: Suspects, names: Sequence[str], parts: Sequence[CyclePart]) -> Bounds:
    """Bounds of the coefficients, the inner ones of what is plausible.

    No loss is a source of power. In units of the line no range of an inertia, a friction or a drag is known beforehand: at most
    it takes as much power as the winch has.
    """
    power = np.concatenate([part.gap + line_power(part.run)[part.here] for part in parts if not part.withheld])
    columns = np.vstack([part.columns for part in parts if not part.withheld])
    largest = np.linalg.norm(power) / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    rows = []
    for name, most in zip(names, largest.tolist(), strict=True):
        field = suspects[name].fields[0]
        if name == "force_gain":
            low, high, first, last = (1.0 / (1.0 + g) - 1.0 for g in (field.high, field.low, *field.possible[::-1]))
        elif name in RANGED:
            low, high, (first, last) = field.low, field.high, field.possible
        else:
            low, high, first, last = 0.0, most, 0.0, math.inf
        rows.append((first, last, low, high, 0.0 if math.isinf(last) else 1.0 / (TAIL * (high - low))))
    return Bounds(*np.array(rows).T.copy())


def reported_number(name: str, coefficient: float) -> float:
    """Number that is reported of a coefficient; F_read = (1 + g) F reverses h = 1 / (1 + g) - 1.

    >>> round(reported_number("force_gain", -0.2), 12), reported_number("line_drag", 300.0)
    (0.25, 300.0)
    """
    return -coefficient / (1.0 + coefficient) if name == "force_gain" else coefficient


def with_span(lines: Lines, span: float) -> Lines:
    """The same samples with the slope of the velocity over another span [s]."""
    runs = {id(part.run): part.run for part in lines.parts}
    columns = {key: columns_of(run, lines.names, span) for key, run in runs.items()}
    parts = (msgspec.structs.replace(part, columns=columns[id(part.run)][part.here]) for part in lines.parts)
    return msgspec.structs.replace(lines, parts=tuple(parts), span=span)


def measured_power(run: Run, rig: Rig) -> Signal:
    """Mechanical power of the winch, (n,) [W].

    Raises
    ------
    LogError : the log lacks line tension, velocity or power
    """
    for channel, what in (("force", "line tension"), ("velocity", "line velocity")):
        if channel not in run.channels:
            raise LogError(
                f"{run.name}: no {what}; a rig without a model ({rig.name}) is diagnosed from line tension, velocity and "
                "mechanical power, so log it, or name its column under [columns] in the rig file."
            )
    found = BUILT_IN["mech"].watts(run.channels, rig.r_drum)
    if found is None:
        raise LogError(
            f"{run.name}: no mechanical power of the winch, nor a torque with a drum radius in the rig file; a rig without a "
            f"model ({rig.name}) is diagnosed from line tension, velocity and mechanical power, so log it."
        )
    return found


def _samples(run: Run, rig: Rig, gap: Signal, asked: tuple[int, int] | None) -> tuple[Index, Index, Index]:
    """Samples at which line tension, velocity and power were logged, (k,), and payout (from 1) and phase of every one, (n,).

    The slope of the velocity needs samples on either side, so those next to a gap of the velocity do not count.
    """
    good, half_width = np.isfinite(gap), 0.5 * width_of(run, SPANS[-1])
    for channel, margin in {CLOCK: half_width, "velocity": half_width, "force": 0.0, POWER: 0.0, "torque": 0.0}.items():
        for a, b in run.gaps.get(channel, np.zeros((0, 2))).tolist():
            good &= ~((run.t > a - margin) & (run.t < b + margin))
    stretches = stretches_of(run, detect(run, smoothed_velocity(run, rig.thresholds), rig.thresholds))
    begins = np.array([stretch[0] for stretch in stretches[1:]])
    number = np.searchsorted(begins, run.t, side="right")
    cycle = np.maximum(np.array([stretch[3] for stretch in stretches])[number], 1)  # rest before the first is its own
    if asked is not None:
        good &= (cycle >= asked[0]) & (cycle <= asked[1])
    return np.flatnonzero(good), cycle, np.array([stretch[2] for stretch in stretches])[number]


def _check_part(run: Run, gap: Signal, here: Index, asked: tuple[int, int] | None, cycles: int) -> None:
    """Reject too few samples, and a power whose sign, or that of the force, is the other one."""
    if here.size < MIN_SAMPLES:
        what = "the log" if asked is None else f"cycles {asked[0]} to {asked[1]}"
        raise CampaignError(
            f"{run.name}: {what} holds {here.size} samples of line tension, velocity and power, and {MIN_SAMPLES} are needed; "
            f"the log has {cycles} cycles."
        )
    given = line_power(run)[here]
    size = float(np.linalg.norm(gap[here] + given) * np.linalg.norm(given))
    correlation = float(np.dot(gap[here] + given, given)) / size if size > 0.0 else 0.0
    if correlation < AGAINST:
        raise LogError(
            f"{run.name}: the mechanical power has the other sign: it is negative where line tension times velocity is "
            f"positive (correlation {correlation:.2f}); it must be positive while the line drives the winch, so change its "
            "sign."
        )


def _check_overlap(parts: Sequence[CyclePart]) -> None:
    """Reject samples that are named twice: in two fits they would count twice, and a fit must not use withheld data."""
    for one, other in combinations(parts, 2):
        both = np.intersect1d(one.cycle, other.cycle)
        if both.size and one.run.sha256 == other.run.sha256 and one.run.name == other.run.name:
            raise CampaignError(
                f"{one.run.name}: cycle {int(both[0])} is named by two runs of the campaign; give each cycle once, "
                "either to the fit or withheld."
            )


def beside(run: Run, span: float) -> int:
    """Samples on either side of one that a span takes in, one at least."""
    return max(int(span / (2.0 * median(np.diff(run.t))) + 0.01), 1)


def width_of(run: Run, span: float) -> float:
    """Width of the local quadratic that takes in the samples within a span. [s]

    It ends half a sample beyond the last one, so that rounded stamps do not decide which samples it takes in.
    """
    return (2.0 * beside(run, span) + 0.5) * median(np.diff(run.t))


def spans_of(run: Run) -> tuple[float, ...]:
    """Spans of samples that give different slopes, and one at nearly every stamp; the longest where none does. [s]"""
    step, v = median(np.diff(run.t)), run.channels["velocity"]
    spans = sorted({round(2.0 * beside(run, span) * step, 6) for span in SPANS})
    known = {span: float(np.mean(np.isfinite(acceleration(run.t, v, width_of(run, span))))) for span in spans}
    return tuple(span for span, share in known.items() if share > EVERYWHERE) or tuple(spans[-1:])


def columns_of(run: Run, names: Sequence[str], span: float) -> Signal:
    """What one unit of each coefficient adds to the power that the line gives, (n, suspects) [W]; NaN without a slope."""
    given = line_power(run)
    made: dict[str, Callable[[], Signal]] = {
        "drum_inertia": lambda: line_power(run, mass_extra=1.0, width=width_of(run, span)) - given,
        "line_friction": lambda: line_power(run, force=1.0) - given,
        "line_drag": lambda: line_power(run, b_line=1.0) - given,
        "load_proportional_loss": lambda: -np.abs(given),
        "force_gain": lambda: given,
        "force_zero": lambda: -run.channels["velocity"],
    }
    return np.column_stack([made[name]() for name in names])


def block_means_of(parts: Sequence[CyclePart], x: Sequence[Signal]) -> tuple[Blocks, Signal]:
    """Blocks of all parts in a row, and the means over them of what is given at the samples that count, (m,)."""
    means = [part.means(own) for part, own in zip(parts, x, strict=True)]
    return in_a_row([part.blocks for part in parts]), np.concatenate(means)
