"""What a design states: operating points, schedules of loads, repairs, and the limits of all."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import msgspec

from winchcascade.core.viewed import Viewed
from winchcascade.design.operating import PLACE, Motion
from winchcascade.diagnosis.handover.posterior import Band
from winchcascade.diagnosis.handover.tested import Tested

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

Criterion = Literal["power", "efficiency"]

METRIC: Mapping[Criterion, str] = {"power": "p_gen_w", "efficiency": "eta_pto"}
"""What a schedule makes largest."""


class Limits(msgspec.Struct, frozen=True):
    """What no operating point may exceed: stator current, rms [A], speed of the generator [rpm],
    line tension [N], and the DC current, rms over a cycle, that heats the machine [A].
    """

    current: float = math.inf
    speed: float = math.inf
    tension: float = math.inf
    heating: float = math.inf

    def exceeded(self, found: Signal) -> list[str]:
        """Which limits a point with these quantities exceeds."""
        return [
            name
            for name, (quantity, _) in LIMITED.items()
            if found[PLACE[quantity]] > getattr(self, name)
        ]


LIMITED = {
    "current": ("i_s_a", "A"), "speed": ("rpm", "rpm"), "tension": ("force_n", "N"), "heating": ("i_dc_rms_a", "A (DC, rms)"),
}  # fmt: skip
"""Quantity of an operating point that each limit concerns, with its unit."""

NO_LIMITS = Limits()
"""Every operating point is allowed."""


class OperatingPoint(msgspec.Struct, frozen=True):
    """What the rig does at a load [ohm] and a line speed [m/s]; `exceeds` names the limits that
    it is beyond.
    """

    load: float
    speed: float
    values: dict[str, Band]
    within_domain: bool
    exceeds: tuple[str, ...]


class Scheduled(msgspec.Struct, frozen=True):
    """The best load [ohm] for a band of generator speed [rpm], its gain over the best fixed load
    [1], and why there is none.

    `within_domain` is whether the logs cover the load there, `gain_within_domain` whether they
    cover the fixed load, too.
    """

    rpm_low: float
    rpm_high: float
    speed: float
    criterion: Criterion
    load: float | None
    gain: Band | None
    within_domain: bool = True
    gain_within_domain: bool = True
    reason: str = ""


class Repair(msgspec.Struct, frozen=True):
    """What the rig would do at the same motion without an effect: deliver more energy for each
    cycle [J] and, where the motions have a number in a year, for a year [kWh], and take less from
    the line for each cycle [J].
    """

    effect: str
    per_cycle: Band
    per_year: Band | None
    saved: Band
    within_domain: bool


class Share(msgspec.Struct, frozen=True):
    """A motion of a sea, and how often it comes in a year; NaN where that is not stated."""

    motion: Motion
    per_year: float = math.nan


class Design(Viewed, frozen=True, kw_only=True):
    """Maps, schedules and repairs of a corrected rig at one motion; `fixed` are the best fixed
    loads by criterion [ohm].

    `repaired_at` is the load at which the repairs are valued [ohm]. Only effects that are causes
    have repairs.
    """

    tested: Tested
    motion: str
    limits: Limits
    rows: tuple[OperatingPoint, ...]
    schedule: tuple[Scheduled, ...]
    fixed: dict[Criterion, float]
    repairs: tuple[Repair, ...]
    repaired_at: float
