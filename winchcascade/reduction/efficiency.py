"""Energies to efficiencies, one cycle at a time."""

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
"""An energy below this is none: no sensor of a winch tells it from zero. [J]"""


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


def metrics(
    energy: dict[str, float | None], duration: float, *, open_circuit: bool
) -> tuple[Metrics, dict[str, float]]:
    """Put one cycle's metrics together (Eqs 5 and 6).

    Parameters
    ----------
    energy : energy_line, energy_mech, energy_gen over the window [J]
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
    given = _given(cycles, name)
    return given if given is not None and len(given) == len(cycles) else None


def _sum(column: list[float] | None) -> float | None:
    return None if column is None else float(sum(column))


def _mean(column: list[float] | None) -> float | None:
    return None if column is None else float(sum(column)) / len(column)


def _deviation(column: list[float] | None) -> float | None:
    mean = _mean(column)
    if column is None or mean is None or len(column) < 2 or mean == 0:
        return None
    return 100.0 * max(abs(value - mean) for value in column) / abs(mean)
