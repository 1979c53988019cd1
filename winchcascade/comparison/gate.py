"""Whether an efficiency drops by more than a limit: the estimate decides, its interval is stated
beside it.
"""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from winchcascade.comparison.compared_run import CompareError
from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.errors import OptionError

ROUNDING = 1e-12
"""What the arithmetic itself may add to a drop. [1]"""

Verdict = Literal[
    "beyond",
    "beyond_uncertain",
    "within",
    "within_uncertain",
    "no_interval_beyond",
    "no_interval_within",
]
"""Whether a drop is beyond the limit, and whether its interval contains drops of the other side
of the limit.
"""


class Drop(
    msgspec.Struct,
    frozen=True,
    rename={"load": "load_ohm", "value": "drop", "interval": "interval_95"},
):
    """Drop A - B of an efficiency of matched runs, with its 95 % interval; names in JSON are
    those of its record.
    """

    label: str
    load: float | None
    value: float
    interval: tuple[float, float] | None
    verdict: Verdict

    @property
    def fails(self) -> bool:
        """Whether the drop is larger than the limit."""
        return self.verdict in ("beyond", "beyond_uncertain", "no_interval_beyond")


class Gate(msgspec.Struct, frozen=True):
    """Drops of the efficiency of the whole cascade against a limit; `without` are runs that lack
    this efficiency.
    """

    metric: str
    limit: float
    drops: tuple[Drop, ...]
    without: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether no drop is larger than the limit."""
        return not self.failed

    @property
    def failed(self) -> tuple[Drop, ...]:
        """The drops that are larger than the limit."""
        return tuple(drop for drop in self.drops if drop.fails)


def check_limit(limit: float) -> None:
    """Reject a limit that is no difference of efficiencies; OptionError describes what is
    expected.
    """
    if not 0.0 <= limit < 1.0:
        raise OptionError(
            f"--max-drop {limit:g}: expected a difference of efficiencies from 0 up to 1; 0.01 is "
            f"one percentage point."
        )


def drop_gate(found: Comparison, limit: float) -> Gate:
    """Compare the drop of the efficiency of the whole cascade (eta_pto of the paper) of each
    matched run with a limit.

    The estimate decides: a drop fails that is larger than the limit, whatever its interval.

    Parameters
    ----------
    limit : absolute difference of efficiencies [1]

    Raises
    ------
    OptionError : a limit that is none
    CompareError : no matched run has this efficiency on both sides
    """
    check_limit(limit)
    drops, without = [], []
    for runs in found.runs:
        one = None if found.overall is None else runs.of(found.overall)
        if one is None:
            without.append(runs.label)
            continue
        ends = None if one.interval is None else (-one.interval[1], -one.interval[0])
        drops.append(
            Drop(runs.label, runs.load, -one.value, ends, _verdict(-one.value, ends, limit))
        )
    if found.overall is None or not drops:
        raise CompareError(
            "--max-drop: no matched run has "
            f"{found.overall or 'an efficiency of the whole cascade'} on both sides; expected one "
            "at least. Check the channels and the load of the logs, or leave --max-drop out."
        )
    return Gate(found.overall, limit, tuple(drops), tuple(without))


def _verdict(drop: float, ends: tuple[float, float] | None, limit: float) -> Verdict:
    beyond = drop > limit + ROUNDING
    if ends is None:
        return "no_interval_beyond" if beyond else "no_interval_within"
    low, high = ends
    exact = math.isclose(low, high, abs_tol=ROUNDING)
    if beyond:
        return "beyond" if exact or low > limit else "beyond_uncertain"
    return "within" if exact or high <= limit else "within_uncertain"
