"""What the checks over phases compare, and what each gives: a fault by its name, with the numbers that its words need."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import CERTAIN
from winchcascade.core.run import Signal
from winchcascade.reduction.energies import Energies
from winchcascade.reduction.phase_summary import PhaseSummary, PlateauSummary
from winchcascade.reduction.phased_run import PhasedRun, span_end
from winchcascade.reduction.reduction_result import CycleResult

REPORTED = 0.005
"""Smallest error of an energy that is reported, by its sampling, a resolution or a step of a channel. [1]"""

MIN_COMPARED = 20
"""Smallest number of samples that shows how two channels depend on each other. [1]"""

Span = tuple[float, float]
"""Begin and end on the clock of the log. [s]"""


class Fault(NamedTuple):
    """One fault, by its name in the table of words.

    `values` fill the words as they are; those of `read` are of the channel [SI] and get its unit. `places` are by default the
    number of `spans`, which are in order of time.
    """

    name: str
    channel: str | None = None
    values: Mapping[str, object] = {}
    read: Mapping[str, float] = {}
    spans: Sequence[Span] = ()
    places: int | None = None


class OperatingPoints(NamedTuple):
    """Vdc [V] and Idc [A] on k plateaus or cycles: means and their standard errors by noise, (2, k) each; spans, plateaus."""

    mean: Signal
    error: Signal
    spans: Sequence[Span]
    plateaus: Sequence[PlateauSummary | None]


class PhasedLog(msgspec.Struct, frozen=True, dict=True):
    """A log with its phases, their summaries, the energies, what thinning changes of them, and the metrics of its cycles.

    `thinned` are relative changes of the energy of each stage in each whole cycle, (5, k); empty where the sampling is fine.
    """

    phased: PhasedRun
    summaries: Sequence[PhaseSummary]
    energies: Energies
    thinned: Mapping[str, Signal]
    results: Sequence[CycleResult]

    def samples(self, channel: str, spans: Sequence[Span]) -> Signal:
        """Samples of a channel in some spans; none of a channel that the log lacks."""
        x = self.phased.run.channels.get(channel)
        parts = [] if x is None else [x[self.phased.rows(begin, end)] for begin, end in spans if end > begin]
        return np.concatenate(parts) if parts else np.empty(0)

    def zero_limit(self, channel: str) -> float:
        """Zero of a channel that its accuracy does not explain, 0 where none is stated. [SI unit of the channel]"""
        return CERTAIN * self.phased.u_zero(channel)

    @cached_property
    def points(self) -> OperatingPoints:
        """Vdc and Idc on the plateau of each checked cycle; with a stated load also over a cycle that is found in no motion."""
        phased, by_motion = self.phased, self.phased.rig.phases.by_motion
        channels = phased.run.channels
        chosen = [(phased.cycles[k], self.summaries[k].payout.plateau) for k in phased.chosen()]
        if not {"vdc", "idc"} <= channels.keys() or (phased.run.load is None and not by_motion):
            chosen = []
        found = []
        for cycle, plateau in chosen:
            span = (plateau.begin, plateau.braking) if plateau else (cycle.onset, span_end(cycle, phased.rig))
            both = np.array([channels[name][phased.rows(*span)] for name in ("vdc", "idc")])
            if both.size and (plateau is not None or not by_motion):
                noise = (
                    np.std(np.diff(both), axis=1) / math.sqrt(2.0 * both.shape[1]) if both.shape[1] > 1 else np.zeros(2)
                )
                found.append((both.mean(axis=1), noise, span, plateau))
        means, errors, spans, plateaus = zip(*found, strict=True) if found else ((), (), (), ())
        return OperatingPoints(np.reshape(means, (-1, 2)).T, np.reshape(errors, (-1, 2)).T, spans, plateaus)
