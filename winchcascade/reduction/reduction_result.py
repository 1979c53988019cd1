"""The result of a reduction: its cycles, their mean and repeatability, and powers over generator
speed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property

import msgspec

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.rig_file import Rig, WindowRule
from winchcascade.core.run import Finding, Run
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.bins import Bin
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.energies import NetSpan
from winchcascade.reduction.phase_summary import BothWays, PhaseSummary
from winchcascade.reduction.phased_run import Window
from winchcascade.reduction.phases import Cycle

REMAINS = 1.5
"""Standard uncertainties that a lag may be away from zero before its u grows with it: 13 % of
true zeros are farther. [1]
"""


class CycleResult(msgspec.Struct, frozen=True):
    """One cycle: its instants, its window, what its phases were like, its metrics, and its span
    from onset to onset.

    Parameters
    ----------
    cycle : its number in the log, from 1 on
    complete : whether it counts in means, deviations and bins
    phases : instants of onset, end of payout, hold and haul-in on the clock of the log [s]
    window : begin and end of the integration [s]
    summary : travel, plateau speed and durations of its phases
    metrics : energies [J], mean powers [W] and efficiencies [1] of the window and of the whole
        cycle, by name
    net : span of the whole cycle, or why it has none
    """

    cycle: int
    complete: bool
    phases: Cycle
    window: Window
    summary: PhaseSummary
    metrics: Metrics
    net: NetSpan


class MeasuredLoad(msgspec.Struct, frozen=True):
    """Vdc / Idc of a log with its standard uncertainty. [ohm]"""

    ohm: float
    u: float


RELATION = {
    "lag": "lag_s",
    "u": "lag_u_s",
    "u_law": "lag_u_law_s",
    "least": "lag_limit_s",
    "u_gain": "gain_u",
}
"""Names of the fields of a relation in written files."""


class Relation(msgspec.Struct, frozen=True, rename=RELATION):
    """How a channel y follows another one, x, by a law.

    Parameters
    ----------
    lag : of y behind x beyond what physics explains [s]
    u, u_law : its standard uncertainty, and what of that the logs of a rig share [s]
    least : smallest lag that is reported [s]
    gain, u_gain : y over what the law gives without a fit, and its standard uncertainty [1]; None
        where the law has no size
    """

    y: str
    x: str
    law: str
    lag: float
    u: float
    u_law: float
    least: float
    gain: float | None = None
    u_gain: float | None = None

    @property
    def deviates(self) -> bool:
        """Whether the lag is a finding."""
        return abs(self.lag) >= max(self.least, CERTAIN * self.u)

    @property
    def u_remaining(self) -> float:
        """Standard uncertainty of a channel that is not shifted: a lag that exceeds its u
        remains in what is reduced. [s]
        """
        return max(self.u, abs(self.lag) / REMAINS)


class Reduction(Viewed, frozen=True, dict=True):
    """Result of the reduction of a log: every cycle, their mean and repeatability, and powers over
    generator speed.

    Parameters
    ----------
    run, rig : the log that was reduced, and the rig that it was reduced with
    window : rule of the window, or its length [s]
    cycles : all of them, incomplete ones too
    mean : over complete cycles; of whole cycles over those complete ones that have net energies
    max_deviation_percent : maximum deviation of a complete cycle from the mean, of each metric [%]
    total : sums of the energies of complete cycles, and ratios of these sums
    bins : means over generator speed in complete cycles
    quality : findings of the log and of the reduction
    bridged : of each stage that has gaps, what bridging them could have changed of the energy of
        each cycle [J]
    sampled : where the sampling is not clearly fine, what every second or third sample alone
        changes of the energy [J]
    measured_load : Vdc / Idc, whatever load is stated
    relations : how its channels follow its motion
    """

    run: Run
    rig: Rig
    window: WindowRule
    cycles: tuple[CycleResult, ...]
    mean: Metrics
    max_deviation_percent: Metrics
    total: Metrics
    bins: tuple[Bin, ...]
    quality: tuple[Finding, ...]
    bridged: Mapping[str, tuple[float, ...]] = msgspec.field(default_factory=dict)
    sampled: Mapping[str, tuple[float, ...]] = msgspec.field(default_factory=dict)
    measured_load: MeasuredLoad | None = None
    relations: tuple[Relation, ...] = ()

    def __repr__(self) -> str:
        """One line instead of every number."""
        return f"Reduction({self.run.name!r}, {len(self.complete)} of {len(self.cycles)} cycles complete)"

    @property
    def both_ways(self) -> dict[str, BothWays]:
        """What flows with the cascade and against it, by stage, in all complete cycles together;
        nothing where cycles are found in a motion and no rig file states the stages. [J]
        """
        cycles = [
            c.summary.both_ways for c in self.complete if c.summary.both_ways is not msgspec.UNSET
        ]
        names = cycles[0] if cycles else ()
        return {
            n: BothWays(sum(c[n].positive for c in cycles), sum(c[n].negative for c in cycles))
            for n in names
        }

    @cached_property
    def complete(self) -> tuple[CycleResult, ...]:
        """The cycles that count."""
        return tuple(c for c in self.cycles if c.complete)

    @property
    def lost_share(self) -> float:
        """Share of the time of the log in which at least one channel was bridged. [1]"""
        step = 1.0 / self.run.fs
        lost, end = 0.0, -math.inf
        for a, b in sorted((a, b) for gaps in self.run.gaps.values() for a, b in gaps.tolist()):
            lost += max(0.0, b - max(a, end) - (step if a >= end else 0.0))
            end = max(end, b)
        return lost / max(float(self.run.t[-1] - self.run.t[0]), step)

    @property
    def extremes(self) -> tuple[CycleResult, CycleResult, str] | None:
        """Complete cycles of the highest and the lowest efficiency, and which; None where there
        are not two to compare.
        """
        cascade = self.rig.cascade
        for metric in (cascade.overall, *cascade.neighbours, *cascade.energies[:1]):
            known = [c for c in self.complete if c.metrics.get(metric) is not None]
            if len(known) > 1:
                ranked = sorted(known, key=lambda c: c.metrics.value(metric))
                return ranked[-1], ranked[0], metric
        return None
