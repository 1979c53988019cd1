"""Efficiencies from energies, cycle by cycle, their mean over the cycles and the largest deviation from it."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

METRICS = (
    "energy_line", "energy_mech", "energy_gen", "power_line", "power_mech", "power_gen", "eta_trans", "eta_gen", "eta_pto",
)  # fmt: skip
"""The nine metrics of a cycle: energies [J], mean powers over the window [W] and efficiencies [1]."""

RATIOS = {
    "eta_trans": ("energy_mech", "energy_line"),
    "eta_gen": ("energy_gen", "energy_mech"),
    "eta_pto": ("energy_gen", "energy_line"),
}
"""Each efficiency: what comes out over what goes in (Eq. 6)."""


NET_METRICS = ("energy_payout", "energy_returned", "energy_net", "energy_gen_cycle", "eta_net")
"""Metrics of a whole cycle, which do not depend on the window: line energy of the payout, line energy returned in haul-in, net
line energy from onset to next onset, energy at the DC link over the same span [J], and the ratio of the last two [1]."""

NET_RATIOS = {"eta_net": ("energy_gen_cycle", "energy_net")}

ALL_METRICS = METRICS + NET_METRICS
ALL_RATIOS = RATIOS | NET_RATIOS


FIELDS = {
    name: name + ("_j" if name.startswith("energy") else "_w" if name.startswith("power") else "")
    for name in ALL_METRICS
}
"""The metrics of windows and of whole cycles as written files call them: with their unit."""


class Metrics(msgspec.Struct, frozen=True, rename=FIELDS):
    """The nine metrics of a cycle or of many, and those of whole cycles; None for what a log cannot give."""

    energy_line: float | None = None
    energy_mech: float | None = None
    energy_gen: float | None = None
    power_line: float | None = None
    power_mech: float | None = None
    power_gen: float | None = None
    eta_trans: float | None = None
    eta_gen: float | None = None
    eta_pto: float | None = None
    energy_payout: float | None = None
    energy_returned: float | None = None
    energy_net: float | None = None
    energy_gen_cycle: float | None = None
    eta_net: float | None = None


NOTHING = 1e-9
"""An energy below this counts as zero: no sensor of a winch can distinguish it from zero. [J]"""

IDLE = 0.2
"""A machine that delivers a smaller share of its energy than this runs as in an open circuit, whatever load is stated: its
losses decide every ratio. [1]"""


def ratio(out: float | None, into: float | None) -> float | None:
    """What comes out over what goes in; None if either is unknown or nothing goes in.

    >>> ratio(3.0, 4.0), ratio(1.0, 0.0)
    (0.75, None)
    """
    if out is None or into is None or into <= NOTHING:
        return None
    return out / into


def is_efficiency(value: float) -> bool:
    """Whether a ratio of energies can be called an efficiency: no stage gives out more than it takes in."""
    return 0.0 <= value <= 1.0


def runs_idle(delivered: Sequence[float | None]) -> bool:
    """Whether a machine runs as in an open circuit, by the share of the energy that it delivers in each cycle, None if unknown.

    >>> runs_idle([0.1, None, 0.2]), runs_idle([None])
    (True, False)
    """
    mean = _mean([share for share in delivered if share is not None] or None)
    return mean is not None and mean < IDLE


def metrics(
    energy: dict[str, float | None], duration: float, *, open_circuit: bool
) -> tuple[Metrics, dict[str, float]]:
    """Put one cycle's metrics together (Eqs 5 and 6).

    Parameters
    ----------
    energy : energy_line, energy_mech, energy_gen over the window [J]; other metrics are taken over
    duration : length of the window [s]
    open_circuit : nothing is delivered, so eta_gen and eta_pto are no efficiencies of the machine

    Returns
    -------
    the metrics, and the ratios that are no efficiency and therefore None in them, by name
    """
    values = dict(energy)
    for stage in ("line", "mech", "gen"):
        joule = energy[f"energy_{stage}"]
        values[f"power_{stage}"] = None if joule is None or duration <= 0 else joule / duration
    odd = {}
    for name, (out, into) in RATIOS.items():
        value = None if open_circuit and name != "eta_trans" else ratio(energy[out], energy[into])
        if value is not None and not is_efficiency(value):
            odd[name], value = value, None
        values[name] = value
    return Metrics(**values), odd


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
    sums = {name: None if column is None else float(sum(column)) for name, column in _columns(cycles).items()}
    found, _ = metrics(sums, duration, open_circuit=open_circuit)
    return msgspec.structs.replace(found, eta_net=ratio(sums["energy_gen_cycle"], sums["energy_net"]))


def _columns(cycles: Sequence[Metrics]) -> dict[str, list[float] | None]:
    """Each metric of the cycles that have it, None if none has, or, but for net energies, if any has it not."""
    given = {m: [value for cycle in cycles if (value := getattr(cycle, m)) is not None] for m in ALL_METRICS}
    return {m: x if x and (m in NET_METRICS or len(x) == len(cycles)) else None for m, x in given.items()}


def _mean(column: list[float] | None) -> float | None:
    return None if column is None else float(sum(column)) / len(column)


def _deviation(column: list[float] | None) -> float | None:
    mean = _mean(column)
    if column is None or mean is None or len(column) < 2 or mean == 0:
        return None
    return 100.0 * max(abs(value - mean) for value in column) / abs(mean)
