"""Where the cycles of a log come from: the table [phases] of a rig file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from winchcascade.core.errors import RigError
from winchcascade.core.toml_text import Expected, check_keys, entries

PhaseSource = Literal["velocity", "displacement", "speed", "column", "ranges", "waves", "steps", "rows", "whole"]
"""What the cycles of a log are found in."""

MOTION_SOURCES = ("velocity", "displacement", "speed")
"""Sources in which payouts are found by a motion; the window of every other one is the whole span of its cycle."""

_Labels = Annotated[
    tuple[str | int | float, ...],
    Expected(
        'a list of values of the column, such as ["reel-out"]', lambda values: all(str(v).strip() for v in values)
    ),
]
Ranges = Annotated[
    tuple[tuple[float, float], ...],
    Expected("pairs of begin and end in seconds, such as [[10.0, 25.0]]", lambda pairs: all(a < b for a, b in pairs)),
]
"""Begin and end of cycles that are given by time. [s]"""

_Positive = Expected("a number above 0", lambda number: 0.0 < number < 1e9)
_Share = Expected("a share above 0 and up to 1, such as 0.02", lambda share: 0.0 < share <= 1.0)


class PhaseRule(
    msgspec.Struct,
    frozen=True,
    rename={"source": "from", "ranges": "ranges_s", "step_min": "step_min_s", "settle": "settle_s"},
):
    """Where cycles come from, and the thresholds of the sources that need one; each default with its reason."""

    source: Annotated[
        PhaseSource,
        Expected("velocity, displacement, speed, column, ranges, waves, steps, rows or whole"),
    ] = "velocity"
    column: Annotated[str, Expected("the name of a column")] = ""
    """Column of labels, with `column`."""
    payout: _Labels = ()
    """Its values in payout,"""
    haul_in: _Labels = ()
    """and in haul-in."""
    ranges: Ranges = ()
    """Begin and end of each cycle on the clock of the log, with `ranges`. [s]"""
    rpm_onset: Annotated[float, _Positive] = 5.0
    """The shaft turns from this speed on, with `speed`, `steps` and with `waves` of a shaft: above ripple and noise of usual
    encoders, below any operating point. [rpm]"""
    turns_min: Annotated[float, _Positive] = 0.25
    """Motions that turn the shaft less are no payout, with `speed`: 0.2 m on a drum of 0.13 m, as `stroke_min`. [rev]"""
    step_min: Annotated[float, _Positive] = 2.0
    """A step lasts at least this long beyond its settling, with `steps`: some revolutions at 100 rpm. [s]"""
    settle: Annotated[float, Expected("a number from 0 on", lambda number: 0.0 <= number < 1e9)] = 0.5
    """What is left out at the begin of each step: speed controllers and filters settle within it. [s]"""
    speed_band: Annotated[float, _Share] = 0.02
    """Width of the band in which the speed of a step stays, as a share of the largest speed of the log: ripple of speed
    controllers is below one per cent, steps of a test plan are farther apart. [1]"""
    torque_band: Annotated[float, _Share] = 0.10
    """The same of the torque: cogging and brakes make it less steady. [1]"""

    @property
    def by_motion(self) -> bool:
        """Whether payouts are found in a motion, and windows set by the rule of the rig."""
        return self.source in MOTION_SOURCES

    @property
    def repeats(self) -> bool:
        """Whether cycles repeat one motion, so that they show a repeatability; steps and stretches do not."""
        return self.source not in ("steps", "rows", "whole")


def phase_rule(raw: dict[str, Any], where: str) -> PhaseRule:
    """Read the table [phases]; RigError for a wrong entry or one that its source lacks.

    >>> phase_rule({"from": "waves"}, "rig.toml").source
    'waves'
    """
    known = [field.encode_name for field in msgspec.structs.fields(PhaseRule)]
    check_keys(raw, known, f"{where}: [phases] ", f"no entry of a rig file; expected {', '.join(known)}", RigError)
    rule = entries(raw, PhaseRule, f"{where}: [phases]", RigError)
    if rule.source == "column" and not (rule.column and rule.payout):
        raise RigError(
            f'{where}: [phases] from = "column" needs the column and its values in payout; add column = "..." and '
            'payout = ["..."].'
        )
    return rule
