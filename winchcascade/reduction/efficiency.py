"""Efficiencies from energies, cycle by cycle, their mean over the cycles and the largest
deviation from it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from winchcascade.core.cascade import PAPER, Cascade, field_of
from winchcascade.core.errors import OptionError

METRICS, NET_METRICS, ALL_METRICS = PAPER.metrics, PAPER.net_metrics, PAPER.all_metrics
"""Metrics of the paper's cascade: of windows, of whole cycles, and both."""

RATIOS = PAPER.ratios
"""Efficiencies of the paper's cascade: what comes out over what goes in (Eq. 6)."""

FIELDS = {name: field_of(name) for name in ALL_METRICS}
"""Metrics of the paper's cascade as written files call them: with their unit."""

NOTHING = 1e-12
"""An energy below this share of the largest one counts as zero: rounding of its integral. [1]"""

SMALLEST = 1e-300
"""Smallest divisor of floating-point numbers, whatever their unit."""

DELIVERED_IDLE = 0.2
"""A machine that delivers a smaller share of its energy than this runs as in an open circuit,
whatever load is stated: its losses decide every ratio. [1]"""

Value = TypeVar("Value")


class Metrics(dict[str, float | None]):
    """Metrics of a cycle or of many by name, such as `energy_line`; each is an attribute too.

    None for a metric that the log cannot give, also where it is not listed.

    Parameters
    ----------
    known : names of the metrics that there are besides those of the paper's cascade

    Examples
    --------
    >>> Metrics(eta_trans=0.9).eta_trans, Metrics().energy_net
    (0.9, None)
    """

    known: Collection[str] = ()

    def __init__(
        self,
        values: Mapping[str, float | None] | Iterable[tuple[str, float | None]] = (),
        known: Collection[str] = (),
        **named: float | None,
    ) -> None:
        super().__init__(values, **named)
        self.known = known

    def __missing__(self, name: str) -> None:
        """None for a metric that is not listed; OptionError, which names similar ones, for a
        name that is none of a metric.
        """
        if name not in ALL_METRICS and name not in self.known:
            from difflib import get_close_matches

            names = list(dict.fromkeys((*self, *self.known, *ALL_METRICS)))
            near = get_close_matches(str(name), names, n=3, cutoff=0.6) or names
            raise OptionError(f"no metric {name!r}; expected {' or '.join(near)}.")

    def __getattr__(self, name: str) -> float | None:
        """A metric by its name; AttributeError for a name that is none of a metric."""
        try:
            return self[name]
        except OptionError as fault:
            raise AttributeError(str(fault)) from None

    def value(self, name: str) -> float:
        """A metric that the log gives; OptionError for one that it does not give."""
        value = self[name]
        if value is None:
            raise OptionError(f"the log gives no {name}; its findings name what is missing.")
        return value


def named(
    of: Mapping[str, Value | None], names: Iterable[str] = ALL_METRICS
) -> dict[str, Value | None]:
    """What there is of some metrics by their names in written files, None for those that have none.

    >>> named({"energy_line": 3.0}, ["energy_line", "eta_pto"])
    {'energy_line_j': 3.0, 'eta_pto': None}
    """
    return {field_of(name): of.get(name) for name in names}


def ratio(out: float | None, into: float | None) -> float | None:
    """What comes out over what goes in; None if either is unknown or nothing goes in, beside what
    comes out.

    >>> ratio(3.0, 4.0), ratio(1.0, 0.0)
    (0.75, None)
    """
    return None if out is None or into is None or into <= NOTHING * abs(out) else out / into


def not_negative(value: float | None) -> float | None:
    """A ratio of energies, None for one below 0: power flows the other way there, and the ratio
    is no efficiency.
    """
    return None if value is None or value < 0.0 else value


def runs_idle(delivered: Sequence[float | None]) -> bool:
    """Whether a machine runs as in an open circuit, by the share of the energy that it delivers in
    each cycle, None if unknown.

    >>> runs_idle([0.1, None, 0.2]), runs_idle([None])
    (True, False)
    """
    known = [share for share in delivered if share is not None]
    return bool(known) and sum(known) / len(known) < DELIVERED_IDLE


def metrics(
    energy: Mapping[str, float | None],
    duration: float,
    *,
    open_circuit: bool,
    cascade: Cascade = PAPER,
    negative: bool = False,
) -> Metrics:
    """Put the metrics of one cycle together (Eqs 5 and 6).

    Parameters
    ----------
    energy : energies of the stages over the window by name [J]; other metrics are taken over
    duration : length of the window [s]
    open_circuit : nothing is delivered, so eta_gen and eta_pto are no efficiencies of the machine;
        nor is any ratio to an energy of exactly zero, as of a shaft at rest
    negative : keep ratios below 0 too, which are no efficiencies; one above 1 is a result with an
        uncertainty
    """
    values = Metrics(energy, cascade.all_metrics)
    for stage in cascade.names:
        joule = energy[f"energy_{stage}"]
        values[f"power_{stage}"] = None if joule is None or duration <= 0 else joule / duration
    for name, (out, into) in cascade.ratios.items():
        idle = energy[out] == 0.0 or (open_circuit and cascade.undelivered(name))
        value = None if idle else ratio(energy[out], energy[into])
        values[name] = value if negative else not_negative(value)
    return values


class Together(NamedTuple):
    """Metrics of several cycles together: their means (Eq. 7), those of efficiencies of the ratios
    of the cycles; the maximum deviation of any cycle in percent of the mean, None for fewer than
    two (Sec. 3.2); and sums, with the ratios of these.
    """

    mean: Metrics
    max_deviation_percent: Metrics
    total: Metrics


def together(
    cycles: Sequence[Metrics],
    duration: float,
    *,
    open_circuit: bool = False,
    cascade: Cascade = PAPER,
) -> Together:
    """Take the metrics of the complete cycles of a log together.

    A metric that any cycle cannot give has no mean: one over the rest would not be of the same
    cycles. Net energies are taken over the cycles that have them, as the last cycle of a log is
    seldom whole.

    Parameters
    ----------
    duration : of all windows [s]
    """
    names, sums, mean, deviation = cascade.all_metrics, Metrics(), Metrics(), Metrics()
    for name in names:
        x = [value for cycle in cycles if (value := cycle[name]) is not None]
        if x and (name in cascade.net_metrics or len(x) == len(cycles)):
            sums[name], average = sum(x), sum(x) / len(x)
            mean[name] = average
            if len(x) > 1 and average:
                deviation[name] = 100.0 * max(abs(value - average) for value in x) / abs(average)
    total = metrics(
        dict.fromkeys(names) | sums, duration, open_circuit=open_circuit, cascade=cascade
    )
    total.update(
        {
            name: ratio(sums.get(out), sums.get(into))
            for name, (out, into) in cascade.net_ratios.items()
        }
    )
    return Together(Metrics(dict.fromkeys(names) | mean, names), Metrics(deviation, names), total)
