"""Ensemble mean of the cycles and their largest deviation from it."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from winchcascade.cascade.efficiency import METRICS, NET_METRICS, Metrics, metrics, ratio


def ensemble_mean(cycles: Sequence[Metrics]) -> Metrics:
    """Mean of each metric over the cycles (Eq. 7); efficiencies are means of the cycles' ratios.

    A metric that any cycle cannot give has no mean: one over the rest would not be of the same cycles. Net energies are
    taken over the cycles that have them, as the last cycle of a log is seldom whole.

    >>> ensemble_mean([Metrics(eta_trans=0.5), Metrics(eta_trans=0.75)]).eta_trans
    0.625
    """
    return Metrics(**{name: _mean(column) for name, column in _columns(cycles).items()})


def largest_deviation(cycles: Sequence[Metrics]) -> Metrics:
    """Largest deviation of any cycle from the mean, in percent of the mean (Sec. 3.2); None for fewer than two. [%]"""
    return Metrics(**{name: _deviation(column) for name, column in _columns(cycles).items()})


def total(cycles: Sequence[Metrics], duration: float, *, open_circuit: bool) -> Metrics:
    """Summed energies, their mean powers over all windows together, and the ratios of the sums.

    Parameters
    ----------
    duration : length of all windows [s]
    """
    sums = {name: _sum(_column(cycles, name)) for name in METRICS[:3]}
    found = metrics(sums, duration, open_circuit=open_circuit)[0]
    nets = {name: _sum(_given(cycles, name)) for name in NET_METRICS[:-1]}
    return msgspec.structs.replace(found, **nets, eta_net=ratio(nets["energy_gen_cycle"], nets["energy_net"]))


def _columns(cycles: Sequence[Metrics]) -> dict[str, list[float] | None]:
    return {m: _column(cycles, m) for m in METRICS} | {m: _given(cycles, m) for m in NET_METRICS}


def _given(cycles: Sequence[Metrics], name: str) -> list[float] | None:
    """One metric of the cycles that have it, None if none has."""
    return [value for cycle in cycles if (value := getattr(cycle, name)) is not None] or None


def _column(cycles: Sequence[Metrics], name: str) -> list[float] | None:
    """One metric of all cycles, None unless every cycle gives it."""
    column: list[float] = []
    for cycle in cycles:
        value = getattr(cycle, name)
        if value is None:
            return None
        column.append(value)
    return column or None


def _sum(column: list[float] | None) -> float | None:
    return None if column is None else float(sum(column))


def _mean(column: list[float] | None) -> float | None:
    return None if column is None else float(sum(column)) / len(column)


def _deviation(column: list[float] | None) -> float | None:
    mean = _mean(column)
    if column is None or mean is None or len(column) < 2 or mean == 0:
        return None
    return 100.0 * max(abs(value - mean) for value in column) / abs(mean)
