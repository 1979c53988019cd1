"""Where the cycles of a log come from, as a rig file states it."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from winchcascade.core.campaign_file import Ranges, check_ranges
from winchcascade.core.toml_file import Positive, ShareOfAll

PhaseSource = Literal[
    "velocity", "displacement", "speed", "column", "ranges", "waves", "steps", "rows", "whole"
]
"""What the cycles of a log are found in."""

_Label = Annotated[str, Meta(pattern=r"\S")] | int | float


class PhaseRule(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    rename={"source": "from", "ranges": "ranges_s", "step_min": "step_min_s", "settle": "settle_s"},
):
    """Where cycles come from, and the thresholds of the sources that need one; each default with
    its reason.
    """

    source: PhaseSource = "velocity"
    column: str = ""
    """Column of labels, with `column`."""
    payout: tuple[_Label, ...] = ()
    """Its values in payout,"""
    haul_in: tuple[_Label, ...] = ()
    """and in haul-in."""
    ranges: Ranges = ()
    """Begin and end of each cycle on the clock of the log, with `ranges`. [s]"""
    rpm_onset: Positive = math.nan
    """The shaft turns from this speed on, with `speed`, `steps` and with `waves` of a shaft: above
    ripple and noise of usual encoders, below any operating point; by default a share of its top
    speed in the log. [rpm]"""
    turns_min: Positive = 0.25
    """Motions that turn the shaft less are no payout, with `speed`; an angle has no dimension: on
    any drum, a rope that is let out by less than twice its radius. [rev]"""
    step_min: Positive = 2.0
    """A step lasts at least this long beyond its settling, with `steps`: some revolutions at 100
    rpm. [s]
    """
    settle: Annotated[float, Meta(ge=0.0, lt=1e9)] = 0.5
    """What is left out at the beginning of each step: speed controllers and filters settle
    within it. [s]
    """
    speed_band: ShareOfAll = 0.02
    """Width of the band in which the speed of a step stays, as a share of the largest speed of the
    log: ripple of speed controllers is below one per cent, steps of a test plan are farther apart.
    [1]"""
    torque_band: ShareOfAll = 0.10
    """The same of the torque: cogging and brakes make it less steady. [1]"""

    def __post_init__(self) -> None:
        """Reject a source without what it needs: ValueError."""
        check_ranges(self.ranges)
        if self.source == "column" and not (self.column and self.payout):
            raise ValueError(
                'from = "column" needs the column and its values in payout; add column = "..." '
                'and payout = ["..."].'
            )

    @property
    def omega_onset(self) -> float:
        """Speed from which on the shaft turns. [rad/s]"""
        return self.rpm_onset * math.pi / 30.0

    @property
    def by_motion(self) -> bool:
        """Whether payouts are found in a motion, and windows set by the rule of the rig; else a
        window is its whole cycle.
        """
        return self.source in ("velocity", "displacement", "speed")

    @property
    def repeats(self) -> bool:
        """Whether cycles repeat one motion, so that they show a repeatability; steps and
        stretches do not.
        """
        return self.source not in ("steps", "rows", "whole")
