"""The order of the runs of a campaign, and what follows it: heat that a machine keeps, and time
that passes.
"""

from __future__ import annotations

import math
from functools import lru_cache

import msgspec
import numpy as np
from numpy.typing import NDArray


class RunOrder(msgspec.Struct, frozen=True):
    """When the runs of a campaign were made.

    `begins` are their beginnings, from that of the first run made, in units of their median spacing
    [1]; `heat` the mean square of the DC current of each over the mean of all, 0 where no current
    is known [1]; `temperature` that of the machine in each, empty where it is not known of all [K].
    Shares are those of the first `made` runs, of all where it is None: a run that is only planned
    does not change them.
    """

    begins: tuple[float, ...]
    heat: tuple[float, ...]
    temperature: tuple[float, ...] = ()
    made: int | None = None

    def with_run(self, heat: float) -> RunOrder:
        """The same runs and one more after them, at the usual spacing; its temperature follows
        from the time constant.
        """
        return RunOrder(
            (*self.begins, max(self.begins) + 1.0),
            (*self.heat, heat),
            made=self.made or len(self.heat),
        )


class RunPlace(msgspec.Struct, frozen=True):
    """One run of a campaign: the order of all runs, and its number there from 0."""

    order: RunOrder
    number: int


@lru_cache(maxsize=512)
def warming(order: RunOrder, time_constant: float, by_current: float) -> tuple[float, ...]:
    """Rise of the temperature of a machine above its first run, over the largest such rise, of each
    run [1].

    The temperature follows the heat of the runs by a first order: what each run has brought fades
    with `time_constant`, half of a run's own heat counts in it. Where temperatures are known, the
    rise is theirs.

    Parameters
    ----------
    time_constant : in units of the median spacing of the runs [1]
    by_current : share of the heat that follows the square of the current; the rest is alike in all
        runs [1]

    >>> [round(rise, 6) for rise in warming(RunOrder((0.0, 1.0, 2.0), (0.0, 1.0, 2.0)), 1e9, 0.0)]
    [0.0, 0.5, 1.0]
    """
    level = (
        np.array(order.temperature)
        if order.temperature
        else _level(order, time_constant, by_current)
    )
    rise = level - level[int(np.argmin(order.begins))]
    largest = float(np.max(np.abs(rise[: order.made]), initial=0.0))
    return tuple((rise / largest).tolist()) if largest > 0.0 else (0.0,) * rise.size


def _level(order: RunOrder, time_constant: float, by_current: float) -> NDArray[np.float64]:
    """Temperature in each run above that of the surroundings, in units of what one run of mean
    heat brings. [1]
    """
    begins, brought = np.array(order.begins), 1.0 - by_current + by_current * np.array(order.heat)
    age = begins[:, None] - begins[None, :]
    kept = np.where(
        age > 0.0, np.exp(-np.maximum(age, 0.0) / time_constant), 0.5 * np.eye(begins.size)
    )
    return np.asarray(kept @ brought)


def lasting_heat(order: RunOrder, time_constant: float, by_current: float) -> float:
    """Heat of a run, repeated for ever at the usual spacing, that keeps the machine as warm as in
    the warmest of some runs. [1]

    Parameters
    ----------
    time_constant, by_current : as for `warming`

    All that a run brings is gone by the next one:

    >>> lasting_heat(RunOrder((0.0, 1.0, 2.0), (1.0, 1.0, 1.0)), 1e-2, 1.0)
    1.0
    """
    lasting = 0.5 + 1.0 / math.expm1(1.0 / time_constant)
    brought = float(np.max(_level(order, time_constant, by_current))) / lasting
    return max((brought - 1.0 + by_current) / by_current, 0.0) if by_current > 0.0 else math.inf


def passed(order: RunOrder) -> tuple[float, ...]:
    """Time that has passed at each run since the first, over that at the last. [1]

    >>> passed(RunOrder((0.0, 1.0, 4.0), (0.0, 0.0, 0.0)))
    (0.0, 0.25, 1.0)
    """
    span = max(order.begins[: order.made])
    return tuple(begin / span if span > 0.0 else 0.0 for begin in order.begins)


def order_of(
    begins: tuple[float | None, ...],
    squares: tuple[float, ...],
    temperature: tuple[float | None, ...],
) -> RunOrder:
    """Order of some runs.

    Parameters
    ----------
    begins : of each run, seconds on a common clock; unless all are known and differ, the runs were
        made in their order [s]
    squares : mean square of the DC current of each run [A2]
    temperature : of the machine in each run [K]
    """
    known = [begin for begin in begins if begin is not None]
    if len(known) == len(begins) and len(set(known)) == len(known):
        spacing = float(np.median(np.diff(sorted(known)))) if len(known) > 1 else 1.0
        at = tuple((begin - min(known)) / spacing for begin in known)
    else:
        at = tuple(float(number) for number in range(len(begins)))
    mean = math.fsum(squares) / len(squares)
    heat = tuple(square / mean if mean > 0.0 else 0.0 for square in squares)
    warm = tuple(x for x in temperature if x is not None)
    return RunOrder(at, heat, warm if len(warm) == len(begins) else ())
