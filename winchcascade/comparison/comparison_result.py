"""The result of a comparison: runs that two sides have in common, their differences, and what
limits them.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.differences import Difference
from winchcascade.core.viewed import Viewed

NoteKind = Literal[
    "windows", "motion", "data", "stages", "rigs", "same_log", "pooled", "repeatability",
    "accuracy", "shared_gains", "cycles",
]  # fmt: skip
"""What a note is about."""

MatchedBy = Literal["load", "file", "load_and_file", "only_log"]
"""How runs were matched."""


class ComparisonNote(msgspec.Struct, frozen=True):
    """What limits a comparison, with the runs that it concerns, and for each of them what is
    found there where runs differ.
    """

    kind: NoteKind
    message: str
    runs: tuple[str, ...] = ()
    details: tuple[str, ...] = ()

    @property
    def is_warning(self) -> bool:
        """Whether differences may be no differences of the rig."""
        return self.kind in ("windows", "motion", "stages", "same_log")


class ComparedSide(msgspec.Struct, frozen=True):
    """One side of a comparison: what it is called, and its logs."""

    name: str
    runs: tuple[ComparedRun, ...]


class MatchedRuns(msgspec.Struct, frozen=True):
    """Logs of both sides with one load, or with one name where loads are absent, and the
    differences of their means.

    `label` is the load or the name as a text.
    """

    label: str
    load: float | None
    a: tuple[ComparedRun, ...]
    b: tuple[ComparedRun, ...]
    differences: tuple[Difference, ...] = ()

    def of(self, metric: str) -> Difference | None:
        """Difference of a metric; None where a side does not have it."""
        return next((one for one in self.differences if one.metric == metric), None)


class Comparison(Viewed, frozen=True):
    """Differences B - A of energies, powers and efficiencies of matched runs, with 95 % intervals.

    Parameters
    ----------
    same_sensors : whether both sides share the gains of their sensors
    shared : sensors whose gains are shared; empty without `same_sensors`
    matched_by : how runs were matched
    metrics : those that both sides have, in the order of their cascade
    overall : efficiency of the whole cascade, None where the sides have no such efficiency in
        common
    alone_a, alone_b : runs without a partner
    """

    a: ComparedSide
    b: ComparedSide
    same_sensors: bool
    shared: tuple[str, ...]
    matched_by: MatchedBy
    metrics: tuple[str, ...]
    overall: str | None
    runs: tuple[MatchedRuns, ...]
    alone_a: tuple[ComparedRun, ...]
    alone_b: tuple[ComparedRun, ...]
    notes: tuple[ComparisonNote, ...]

    def __repr__(self) -> str:
        """One line instead of every number."""
        return f"Comparison({self.a.name!r}, {self.b.name!r}, {len(self.runs)} matched)"
