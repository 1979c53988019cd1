"""The energies of a reduction as functions of the errors of its sensors.

A sensor reads (1 + gain) x + zero, both unknown but the same over the whole run, so neither
averages out over its cycles. As a power is a product of two channels, its energy for any errors
follows from four integrals, and nothing is integrated again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from functools import cache, cached_property
from itertools import accumulate, combinations
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import (
    Basis,
    ErrorSource,
    error_sources,
)
from winchcascade.core.cascade import Term
from winchcascade.core.integrate import Stretch, integrals_of, largest, slope_of
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.energies import SIGN, spans_of
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.timing import lag_sources

R_DRUM, SAMPLING = "r_drum", "sampling"
"""Sources of uncertainty that are no channels: the drum radius, where a rig file states one of it,
and what every second or third sample alone changes of an energy."""

TAKEN_AS_EXACT = ("velocity",)
"""Channels without a stated accuracy that count as exact: an encoder's counts have neither zero
nor gain error.
"""


Terms = tuple[tuple[tuple[str, ...], int], ...]
"""Channels of each term of a power, and the power of the stated drum radius that the term is
proportional to.
"""


class Integrated(NamedTuple):
    """Integrals of a stage over k spans: terms of its power; of what (x - zero_x)(y - zero_y) of each
    term multiplies out to, (r, k), without the zeros: of each subset of its channels the rest; and
    by channel what the spans lose per second by which it is late, (k,) each [W].
    """

    terms: Terms
    joules: Signal
    rates: dict[str, Signal]


class Energy(msgspec.Struct, frozen=True, dict=True):
    """One energy in k spans, as the sum of some integrals times `factors` that the errors of its
    channels decide.

    Parameters
    ----------
    integrals : (r, k), of the `integrands`, the change by thinning the log per unit of the error of
        the sampling, and that by each lag [J/s]
    t : (k,) length of the spans [s]
    gaps : (k,) standard uncertainty by bridged gaps, independent from span to span [J]
    """

    terms: Terms
    integrals: Signal
    t: Signal
    gaps: Signal

    @cached_property
    def joules(self) -> Signal:
        """Energies as reduced, (k,). [J]"""
        sizes = [len(_subsets(channels)) for channels, _ in self.terms]
        whole = accumulate(sizes[:-1], initial=0)  # of each term the product of all its channels
        return np.asarray(sum(self.integrals[row] for row in whole))

    @property
    def channels(self) -> set[str]:
        """Channels of all terms."""
        return {name for channels, _ in self.terms for name in channels}


def slopes(terms: Terms, sources: Sequence[ErrorSource]) -> Signal:
    """Change of the factor of each integral of an energy with each of m errors, (r, m), where there
    are none yet.

    An energy of channels without their errors has the factors (x - zero_x)(y - zero_y) /
    ((1 + gain_x)(1 + gain_y)) multiplied out. So a gain changes that of the product of all
    channels, and a zero that of the product without its channel. The integrals of the sampling and
    of each lag follow.
    """
    products = [(of, zeros, power) for of, power in terms for zeros in _subsets(of)]
    found = np.zeros((len(products) + 1 + sum(s.part == "lag" for s in sources), len(sources)))
    late = len(products)
    for k, source in enumerate(sources):
        if source.part == "lag":
            late += 1
            found[late, k] = 1.0
        elif source.channel == SAMPLING:
            found[len(products), k] = 1.0
        elif source.part == "zero":
            found[: len(products), k] = [
                -float(zeros == (source.channel,)) for _, zeros, _ in products
            ]
        else:
            found[: len(products), k] = [
                0.0 if zeros else -(power if source.channel == R_DRUM else of.count(source.channel))
                for of, zeros, power in products
            ]
    return found


@cache
def _subsets(channels: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The subsets of the channels of a term, from none to all of them."""
    return [some for size in range(len(channels) + 1) for some in combinations(channels, size)]


class ErrorModel(msgspec.Struct, frozen=True):
    """The measured energies by their names in the parts of the cascade, and the m sources of
    uncertainty of all spans.
    """

    energies: Mapping[str, Energy]
    sources: tuple[ErrorSource, ...]

    @property
    def lacking(self) -> dict[str, tuple[str, ...]]:
        """Channels of each energy for which the rig file states no accuracy, without those that
        count as exact.
        """
        stated = {source.channel for source in self.sources}.union(TAKEN_AS_EXACT)
        return {
            name: tuple(sorted(energy.channels - stated)) for name, energy in self.energies.items()
        }

    def changes(self) -> dict[str, Signal]:
        """Change of each energy with one standard uncertainty of each source, (m, k). [J]"""
        u = np.array([source.u for source in self.sources])
        of_terms = {
            terms: (slopes(terms, self.sources) * u).T
            for terms in {energy.terms for energy in self.energies.values()}
        }
        return {
            name: of_terms[energy.terms] @ energy.integrals
            for name, energy in self.energies.items()
        }


def error_model(reduction: Reduction) -> ErrorModel:
    """Integrate what the energies of all cycles are made of, and list their sources of
    uncertainty.
    """
    rig, cycles = reduction.rig, reduction.cycles
    spans = spans_of(
        [c.window for c in cycles], [c.phases for c in cycles], [c.net for c in cycles]
    )
    every, nothing = np.concatenate([*spans.values()]), np.zeros(len(cycles))
    in_time = np.zeros(len(every))
    lags = lag_sources(reduction)
    of_stage = integrated(reduction, every, {name for _, moved in lags for name in moved})
    energies = {}
    for part, (stage, span) in rig.cascade.parts.items():
        if stage in of_stage and any(c.metrics[f"energy_{part}"] is not None for c in cycles):
            terms, joules, rates = of_stage[stage]
            late = [
                sum((rates[name] for name in moved if name in rates), start=in_time)
                for _, moved in lags
            ]
            first = [*spans].index(span) * len(cycles)
            here = slice(first, first + len(cycles))
            sign, bridged = SIGN.get(part, 1.0), reduction.bridged.get(part, nothing)
            rows = sign * joules[:, here], reduction.sampled.get(part, nothing)
            energies[part] = Energy(
                terms,
                np.vstack((*rows, *(sign * rate[here] for rate in late))),
                every[here, 1] - every[here, 0],
                np.array(bridged) / math.sqrt(3.0),
            )
    sources = errors_of_sensors(rig.sensors, energies)
    radius = rig.winch.r_drum
    on_radius = any(
        radius_power for energy in energies.values() for _, radius_power in energy.terms
    )
    if on_radius and radius is not None and radius.u:
        u = radius.u / radius.value
        basis: Basis = "limits" if radius.rectangular else "standard_uncertainty"
        limit = math.sqrt(3.0) * u if radius.rectangular else None
        sources.append(ErrorSource(R_DRUM, "gain", u, limit, radius.source, basis))
    sampling = -1 - len(lags)
    sums = [(abs(e.integrals[sampling].sum()), abs(e.joules.sum())) for e in energies.values()]
    least = NOTHING * max((float(joules) for _, joules in sums), default=0.0)
    if share := max(
        (float(thinned / joules) for thinned, joules in sums if joules > least), default=0.0
    ):
        origin = "reduction of every second and third sample"
        sources.append(
            ErrorSource(SAMPLING, "gain", share / math.sqrt(3.0), share, origin, "resampling")
        )
        for energy in energies.values():
            energy.integrals[sampling] /= share
    return ErrorModel(energies, (*sources, *(source for source, _ in lags)))


def integrated(
    reduction: Reduction, spans: Signal, late: Collection[str] = ()
) -> dict[str, Integrated]:
    """Integrate what the power of each measured stage is made of over k spans, (k, 2) [s].

    Parameters
    ----------
    late : channels that may be recorded late
    """
    run, rig = reduction.run, reduction.rig
    powers, on_drum = rig.cascade.powers(run.channels, rig.r_drum), _is_on_drum(run, rig)

    def stream(term: Term, without: Sequence[str], *more: Stretch) -> Stretch:
        factors = [run.channels[name].__getitem__ for name in term.channels if name not in without]
        scale = term.scale(rig.r_drum)
        return lambda part: math.prod(
            (x(part) for x in (*factors, *more)), start=np.full(run.t[part].shape, scale)
        )

    made_of = {}
    for stage, power in powers.items():
        products = [stream(t, zeros) for t in power.terms for zeros in _subsets(t.channels)]
        moved = [
            (name, stream(term, (name,), slope_of(run.t, run.channels[name])))
            for term in power.terms
            for name in term.channels
            if name in late
        ]
        made_of[stage] = products, moved
    streams = [
        x for products, moved in made_of.values() for x in (*products, *(y for _, y in moved))
    ]
    rows, found = iter(integrals_of(run.t, streams, spans)), dict[str, Integrated]()
    for stage, (products, moved) in made_of.items():
        # An encoder on the drum counts v = r omega: F v is proportional to r, tau v / r = tau omega
        # is not.
        terms = tuple(
            (t.channels, (on_drum and "velocity" in t.channels) - t.by_radius)
            for t in powers[stage].terms
        )
        joules, rates = np.array([next(rows) for _ in products]), dict[str, Signal]()
        for name, _ in moved:
            rates[name] = rates.get(name, 0.0) + next(rows)
        found[stage] = Integrated(terms, joules, rates)
    return found


def _is_on_drum(run: Run, rig: Rig) -> bool:
    """Whether the line velocity is the stated drum radius times the speed of the drum, and not
    measured on the line.
    """
    motion, speed = run.channels.get("velocity"), run.channels.get("speed")
    if rig.winch.motion == "drum" or motion is None or speed is None or rig.r_drum is None:
        return rig.winch.motion == "drum"
    return bool(np.allclose(motion, speed * rig.r_drum, rtol=1e-9, atol=1e-9 * largest(motion)))


def errors_of_sensors(
    sensors: Mapping[str, Sensor], energies: Mapping[str, Energy]
) -> list[ErrorSource]:
    """Errors of the sensors of all channels that some energies are made of."""
    channels = sorted(
        {name for energy in energies.values() for name in energy.channels} & sensors.keys()
    )
    return [source for name in channels for source in error_sources(name, sensors[name])]
