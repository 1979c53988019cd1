"""Logs of a winch without a model as one table: a row for each block, with its power and what each suspect adds to it.

The power of the shaft follows from the line by P = v (F - m dv/dt - F_0 sgn v - b v) - s |v F|. A force cell that reads
(1 + g) F + o gives F = (1 + h) F_read - o', with h = 1 / (1 + g) - 1 and o' = o / (1 + g). So measured power minus v F_read is
linear in m, F_0, b, s, h and o': the coefficients of a fit. The inertia takes m d(v^2 / 2)/dt, whose mean over a block is the
change of kinetic energy between its ends: no slope of the velocity has to be smoothed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.core.integrate import median
from winchcascade.core.run import CLOCK, Index, Mask, Run, Signal
from winchcascade.core.scales import motion_of_runs
from winchcascade.diagnosis.fit.block_means import Blocks, blocks_of, in_a_row
from winchcascade.rig.effects.effect import Display, Effect, Parameter
from winchcascade.rig.physics import REST

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.diagnosis_result import Entries
    from winchcascade.diagnosis.fit.suspects import Suspects

TAIL = 0.25
"""Beyond the plausible range of a field the probability falls by a factor e for each such share of the range. Assumed. [1]"""

POWER = "power_mech"
"""Channel in which a winch without a model shows its gap."""

NUMBERS = {
    "drum_inertia": ("mass_extra", "kg", Display("inertia, as a mass on the line", 1.0, "kg", signed=False)),
    "line_friction": ("force", "N", Display("constant friction", 1.0, "N", signed=False)),
    "line_drag": ("b_line", "N.s/m", Display("drag over speed", 1.0, "N·s/m", signed=False)),
}
"""Suspects whose number is in units of the line, as no drum is known: its name, unit and display."""

ACTING = (*NUMBERS, "load_proportional_loss", "force_gain", "force_zero")
"""Suspects that act between line and shaft."""

FAR = 100.0
"""Bound of a number in line units, as a multiple of what would take all power. [1]"""

FINER = 0.1
"""Length of the blocks of a winch, whose ramps take long, over those of a rig with a model. [1]"""

TOP = 0.9
"""Quantile of the magnitude of the line tension that a zero of its cell is compared with. [1]"""

MIN_BLOCKS = 30
"""Minimum number of blocks of a log: five for each coefficient."""


class LinePart(msgspec.Struct, frozen=True):
    """What one entry of a campaign takes of a log: its first and last cycle, and the number of samples in its blocks."""

    run: Run
    withheld: bool
    cycles: tuple[int, int]
    samples: int


class LineRows(msgspec.Struct, frozen=True):
    """Means over blocks of all parts in a row, (m,) each.

    `part` is the number of the part, `blocks` has phase and cycle (numbered so that no two parts share one), `own_cycle` the
    number of the cycle within its log, `t` the middle of the block on the clock of the log and `width` the time that it stands
    for [s]. `given` is line tension times speed and `gap` measured power minus that [W], `columns` (m, suspects) the power that
    one unit of each coefficient adds [W]. `motion` (m, 2) are line speed [m/s] and tension [N].
    """

    part: Index
    blocks: Blocks
    own_cycle: Index
    t: Signal
    width: Signal
    given: Signal
    gap: Signal
    columns: Signal
    motion: Signal

    def some(self, here: Mask) -> LineRows:
        """The rows that are `here`, (m,)."""
        blocks = Blocks(*(field[here] for field in msgspec.structs.astuple(self.blocks)))
        cut = {name: getattr(self, name)[here] for name in self.__struct_fields__ if name != "blocks"}
        return LineRows(blocks=blocks, **cut)


class Lines(msgspec.Struct, frozen=True):
    """All rows of a campaign, and the suspects with their numbers in units of the line."""

    suspects: Suspects
    parts: tuple[LinePart, ...]
    rows: LineRows

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the suspects, in the order of the columns."""
        return tuple(self.suspects)

    @property
    def withheld(self) -> Mask:
        """Rows that take part in neither choice nor fit, (m,)."""
        return np.array([part.withheld for part in self.parts])[self.rows.part]

    @property
    def fitted(self) -> LineRows:
        """Rows that take part in choice and fit."""
        return self.rows.some(~self.withheld)

    @property
    def judged(self) -> LineRows:
        """Rows that the causes are tested on: the withheld ones, or all where none is withheld."""
        return self.rows.some(self.withheld) if self.withheld.any() else self.rows

    @property
    def cycle_names(self) -> list[str]:
        """Name of every cycle of all parts in a row."""
        first = np.unique(self.rows.blocks.cycle, return_index=True)[1]
        parts = [self.parts[number].run.name for number in self.rows.part[first]]
        return [f"cycle {cycle} of {name}" for cycle, name in zip(self.rows.own_cycle[first], parts, strict=True)]


def lines_of(entries: Entries, rig: Rig, suspects: Suspects) -> Lines:
    """Take the blocks that count out of logs.

    Raises
    ------
    LogError, CampaignError : a log lacks a channel, or an entry the cycles that it names
    OptionError : no suspect acts between line and shaft
    """
    names = tuple(name for name in ACTING if name in suspects)
    if not names:
        raise OptionError(
            f"none of the suspects ({', '.join(suspects)}) acts between line and shaft, all that this rig has; suspect "
            f"{', '.join(ACTING)}."
        )
    cycles, parts, tables = entries.cycles or [None] * len(entries.runs), list[LinePart](), list[LineRows]()
    for k, (run, asked) in enumerate(zip(entries.runs, cycles, strict=True)):
        table = _rows_of(run, rig, names, asked, k)
        if table.t.size < MIN_BLOCKS:
            raise CampaignError(
                f"{run.name}: {table.t.size} blocks of samples hold line tension, velocity and power in the cycles that count, "
                f"and {MIN_BLOCKS} are needed; name more cycles or use a longer log."
            )
        ends = int(table.own_cycle.min()), int(table.own_cycle.max())
        parts.append(LinePart(run, k in entries.withheld, ends, int(table.blocks.count.sum())))
        tables.append(table)
    rest = [name for name in LineRows.__struct_fields__ if name != "blocks"]
    rows = LineRows(
        blocks=in_a_row([table.blocks for table in tables]),
        **{name: np.concatenate([getattr(table, name) for table in tables]) for name in rest},
    )
    fitted = rows.some(~np.array([part.withheld for part in parts])[rows.part])
    if not (np.any(fitted.gap + fitted.given) and np.all(np.any(fitted.columns, axis=0))):
        raise LogError(
            f"{parts[0].run.name}: line speed, line tension or mechanical power is 0 throughout the cycles of the fit; "
            "a diagnosis needs a winch at work, so choose other cycles or check the columns."
        )
    return Lines(_in_line_units(suspects, names, fitted), tuple(parts), rows)


def _rows_of(run: Run, rig: Rig, names: Sequence[str], asked: tuple[int, int] | None, number: int) -> LineRows:
    """Block means of one log; a block counts where at least half of its samples were logged."""
    power = measured_power(run, rig)
    v, f = run.channels["velocity"], run.channels["force"]
    good, step = np.isfinite(power), median(np.diff(run.t))
    for channel in (CLOCK, "velocity", "force", POWER, "torque"):
        for a, b in run.gaps.get(channel, np.zeros((0, 2))).tolist():
            good &= ~((run.t > a - step) & (run.t < b + step))
    scale = motion_of_runs([run])
    made = power_columns(run.t, v, f, scale.speed)
    blocks = blocks_of(run, rig, FINER * scale.ramp, asked)
    known = blocks.mean(good.astype(np.float64))
    signals = [run.t, v * f, power - v * f, v, f, *(made[name] for name in names)]
    means = np.array([blocks.mean(np.where(good, x, 0.0)) for x in signals])[:, known > 0.5] / known[known > 0.5]
    width = blocks.count * blocks.mean(np.minimum(np.gradient(run.t), 2.0 * step))  # not that of a gap
    own = np.maximum(blocks.cycle, 1)[known > 0.5]  # rest before the first payout belongs to its cycle
    kept = Blocks(*(field[known > 0.5] for field in msgspec.structs.astuple(blocks)))
    kept, (t, given, gap) = msgspec.structs.replace(kept, cycle=own), means[:3]
    return LineRows(
        np.full(kept.size, number), kept, own, t, width[known > 0.5], given, gap, means[5:].T, means[3:5].T
    )  # fmt: skip


def power_columns(t: Signal, v: Signal, f: Signal, speed: float) -> dict[str, Signal]:
    """Power at the shaft that one unit of the coefficient of each suspect adds, (n,) each, from line speed and tension. [W]

    Parameters
    ----------
    speed : top speed of the line [m/s]
    """
    return {
        "drum_inertia": -np.gradient(0.5 * v**2, t),
        "line_friction": -v * np.tanh(v / (REST * speed)),
        "line_drag": -(v**2),
        "load_proportional_loss": -np.abs(v * f),
        "force_gain": v * f,
        "force_zero": -v,
    }


def measured_power(run: Run, rig: Rig) -> Signal:
    """Mechanical power of the winch, (n,) [W].

    Raises
    ------
    LogError : the log lacks line tension, velocity or power
    """
    power = BUILT_IN["mech"].watts(run.channels, rig.r_drum)
    wanted = {
        "no line tension": run.channels.get("force"),
        "no line velocity": run.channels.get("velocity"),
        "no mechanical power of the winch, nor a torque with a drum radius in the rig file": power,
    }
    for missing, found in wanted.items():
        if found is None:
            raise LogError(
                f"{run.name}: {missing}; a rig without a model ({rig.name}) is diagnosed from line tension, velocity and "
                "mechanical power, so log it, or name its column under [columns] in the rig file."
            )
    assert power is not None  # checked above
    return power


def coefficients_of(names: Sequence[str], numbers: Mapping[str, float]) -> Signal:
    """Coefficients of the columns of some suspects, (suspects,), for the numbers of some of them.

    >>> coefficients_of(("line_drag", "force_gain", "force_zero"), {"force_gain": 0.25, "force_zero": 50.0}).round(9).tolist()
    [0.0, -0.2, 40.0]
    """
    gain = 1.0 + numbers.get("force_gain", 0.0)
    made = {"force_gain": 1.0 / gain - 1.0, "force_zero": numbers.get("force_zero", 0.0) / gain}
    return np.array([made.get(name, numbers.get(name, 0.0)) for name in names])


def _in_line_units(suspects: Suspects, names: Sequence[str], rows: LineRows) -> dict[str, Effect]:
    """The suspects with the number that a winch without a drum has of each.

    No loss is a source of power. In units of the line no range of an inertia, a friction or a drag is known beforehand: at most
    it takes as much power as the winch has.
    """
    size = np.linalg.norm(rows.gap + rows.given) / np.maximum(np.linalg.norm(rows.columns, axis=0), 1e-300)
    found = {name: suspects[name] for name in names}
    if (zero := found.get("force_zero")) is not None:
        tension = float(np.quantile(np.abs(rows.motion[:, 1]), TOP))
        low, high = zero.fields[0].low, zero.fields[0].high
        own = {"low": tension * low, "high": tension * high, "share": (low, high)}
        field = msgspec.structs.replace(zero.fields[0], **own)
        found["force_zero"] = msgspec.structs.replace(zero, fields=(field,))
    for name, most in zip(names, size.tolist(), strict=True):
        if name in NUMBERS:
            number, unit, display = NUMBERS[name]
            fields = (Parameter(number, unit, 0.0, most, (0.0, FAR * most)),)
            own = {"fields": fields, "parameter": number, "unit": unit, "display": display, "law": None}
            found[name] = msgspec.structs.replace(found[name], **own)
    return found
