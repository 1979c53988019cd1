"""A Monte Carlo of the sensors' errors (JCGM 101:2008): it confirms the budget, and gives the 95 % intervals.

The sensors' limits are rectangular, and often one of them decides: then 95 % lie within 0.95 of the limit, where the
GUM's factor of 1.96 standard uncertainties would give 1.13 of it.

The errors are drawn from the points of a lattice that is shifted at random (Korobov 1959; Cranley and Patterson 1976). They
fill the space of the errors evenly, so that 8191 of them determine an interval better than 20 000 independent draws.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import ErrorSource
from winchcascade.core.arguments import SEED_NUMBER, Expected, check_arguments, is_number
from winchcascade.core.errors import check_type
from winchcascade.core.run import Index, Signal
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import (
    R_DRUM,
    SAMPLING,
    Budget,
    ErrorModel,
    budget,
    error_model,
    sampling_limit,
)

SEED = 20260
"""Seed of the shift of the lattice unless another is given, so that the same log gives the same interval."""

DRAWS = 8191
"""Default number of draws of all errors, a prime; the ends of an interval are then known to 1 % of its width."""

MIN_DRAWS = 100
"""Smallest number of draws: the ends of an interval are then known to 10 % of its width."""

_DRAWS = Expected(
    f"a whole number from {MIN_DRAWS} to 10 million. The default is {DRAWS}",
    lambda draws: is_number(draws) and MIN_DRAWS <= draws <= 1e7 and draws % 1 == 0,
)

MULTIPLIER = 3483
"""Place of one of 8191 draws among the strata of an error over that of the error before it: of 400 multipliers one with the
smallest errors of the intervals of 150 sums of 2 to 12 errors, rectangular and normal, with and without Student's. [1]"""

MULTIPLIERS = 16
"""Number of multipliers among which that of another number of draws is searched."""

DIMENSIONS = 8
"""Number of errors for which a multiplier is searched; few logs have more that matter."""

MAX_FREEDOM = 10_000
"""Degrees of freedom from which Student's distribution counts as normal: its 97.5 % quantile is then within 0.02 %."""

GRID = 1 << 14
"""Points at which a distribution is integrated: neighbouring ones are 1/50 of a standard deviation apart or closer."""

MAX_CYCLES = 250
"""Of more cycles an even selection is drawn for ratios: the sensors' errors act on all of them nearly alike."""

LINEAR_WITHIN = 0.02
"""Where the standard uncertainties of Monte Carlo and budget differ by more than this share, the Monte Carlo's is stated. Fewer
draws than 8191 may differ by more: the share grows with the inverse of the square root of their number."""

INNER = 1.5
"""Part of a distribution in which no end of an interval is sought, in standard deviations on either side of the mean: 6.7 % of
a rectangular or a normal distribution lie beyond either side of it, and more of Student's."""

SMALL = 0.1
"""Errors that change no energy by more than this share act linearly to within a percent."""

Method = Literal["gum", "monte_carlo"]


class Interval(msgspec.Struct, frozen=True):
    """Ends of a 95 % interval, in the unit of the metric."""

    low: float
    high: float


class Uncertainty(msgspec.Struct, frozen=True):
    """Uncertainty of the means of a reduction: the budget, the Monte Carlo and what is stated of them.

    `standard` is what is stated: the budget's standard uncertainty where the Monte Carlo confirms it, else the Monte
    Carlo's (`method`). `interval_95` holds the mean over cycles of this kind, sensors and repeatability together;
    `interval_95_sensors` the mean of these very cycles, sensors alone.
    """

    budget: Budget
    seed: int
    draws: int
    drawn: Metrics
    standard: Metrics
    method: Mapping[str, Method]
    interval_95: Mapping[str, Interval]
    interval_95_sensors: Mapping[str, Interval]


def uncertainty(reduction: Reduction, *, seed: int = SEED, draws: int = DRAWS) -> Uncertainty:
    """State the uncertainty of the means of a reduction: budget by the GUM, intervals by a Monte Carlo.

    Each interval takes the sensors' errors and the mean's repeatability together; the latter is drawn from Student's
    distribution, as few cycles determine it only roughly (JCGM 101, 6.4.9). A single cycle does not show it, so its interval is
    that of the sensors alone.

    Parameters
    ----------
    seed : of the shift of the lattice
    draws : number of draws of all errors, 100 or more. The error of the ends of an interval is about inversely proportional
        to the square root of it, or smaller.

    Raises
    ------
    OptionError
        If `draws` is not a whole number of 100 or more, or `reduction` is something else.

    Examples
    --------
    >>> from winchcascade.reduction.reduce import reduce
    >>> from winchcascade.ingest.read import read_run
    >>> found = uncertainty(reduce(read_run("fixtures/campaign/r36ohm.csv"), window=5.48))
    >>> round(found.standard.eta_trans, 4), found.method["eta_trans"]
    (0.0019, 'gum')
    """
    check_type("uncertainty", reduction, Reduction, "reduce(run)")
    check_arguments("uncertainty", ("seed", seed, SEED_NUMBER), ("draws", draws, _DRAWS))
    draws = int(draws)
    model = error_model(reduction)
    known = budget(reduction, model)
    errors = 1 + len(model.sources) + len(model.stages)
    of_repeats, *strata = _strata_of(seed, draws, errors)
    spread = _spread(reduction, model, known, strata, seed, draws) if reduction.complete else {}
    repeats = {n: _student(draws, n - 1)[of_repeats] for n in {model.rows[metric].size for metric in spread} if n > 1}
    drawn, whole, alone = {}, {}, {}
    for metric, x in spread.items():
        scatter = known.repeatability[metric] or 0.0
        middle = float(x.sum()) / x.size
        about = x - middle
        sensors = math.sqrt(float(about @ about) / x.size)
        drawn[metric] = math.hypot(sensors, scatter)
        alone[metric] = whole[metric] = _interval(x, middle, sensors)
        if scatter:
            whole[metric] = _interval(scatter * repeats[model.rows[metric].size] + x, middle, drawn[metric])
    within = LINEAR_WITHIN * math.sqrt(max(1.0, DRAWS / draws))
    method: dict[str, Method] = {
        m: "gum" if abs(u - known.mean.value(m)) <= within * u else "monte_carlo" for m, u in drawn.items()
    }
    names = model.cascade.all_metrics
    stated = {m: known.mean[m] if way == "gum" else drawn[m] for m, way in method.items()}
    return Uncertainty(known, seed, draws, Metrics(drawn, names), Metrics(stated, names), method, whole, alone)


def stated_uncertainty(reduction: Reduction) -> tuple[Budget, Metrics]:
    """Budget and stated standard uncertainties of the means, without a Monte Carlo where it could only confirm them."""
    known = budget(reduction)
    return known, known.mean if known.reach <= SMALL else uncertainty(reduction).standard


def _strata(seed: int, draws: int, errors: int) -> tuple[Index, ...]:
    """For each of some errors, the stratum from which each draw takes it, of as many equally probable ones as draws."""
    rng = np.random.default_rng(seed)
    of_draws, step, multiplier, found = np.arange(draws), 1, _multiplier(draws), []
    for _ in range(errors):
        found.append((of_draws * step + rng.integers(draws)) % draws)
        step = step * multiplier % draws
    return tuple(found)


_kept_strata = lru_cache(maxsize=8)(_strata)
"""Strata of the default number of draws, which are the same for every log of a batch."""


def _strata_of(seed: int, draws: int, errors: int) -> tuple[Index, ...]:
    return (_kept_strata if draws == DRAWS else _strata)(seed, draws, errors)


@cache
def _multiplier(draws: int) -> int:
    """Multiplier of the lattice of a number of draws: of some candidates the one with the smallest mean square error.

    The square of the error of a shifted lattice for smooth functions is the mean of a product over its dimensions, with the
    Bernoulli polynomial of degree 2 of each coordinate (Sloan and Joe 1994). A multiplier without a common factor with the
    number of draws puts one draw into each stratum of every error.
    """
    if draws == DRAWS:
        return MULTIPLIER
    candidates: list[int] = [
        k for k in np.random.default_rng(draws).permutation(np.arange(2, draws)).tolist() if math.gcd(k, draws) == 1
    ]
    of_draws = np.arange(draws)

    def square_error(multiplier: int) -> float:
        product, step = np.ones(draws), 1
        for _ in range(DIMENSIONS):
            x = of_draws * step % draws / draws
            product *= 1.0 + math.pi**2 * (x * x - x + 1.0 / 6.0)
            step = step * multiplier % draws
        return float(product.mean())

    return min(candidates[:MULTIPLIERS], key=square_error)


def _rectangular(draws: int) -> Signal:
    """Middle of each stratum of the rectangular distribution from -1 to 1."""
    return (2.0 * np.arange(draws) + 1.0) / draws - 1.0


@cache
def _student(draws: int, freedom: int = MAX_FREEDOM) -> Signal:
    """Middle of each stratum of Student's distribution; of many degrees of freedom, of the normal distribution.

    The angle whose tangent is t / sqrt(freedom) has a density in proportion to the power freedom - 1 of its cosine.
    """
    freedom = min(freedom, MAX_FREEDOM)
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, GRID + 1)
    density = np.cos(angle) ** (freedom - 1)
    share = np.append(0.0, np.cumsum(density[1:] + density[:-1]))
    middles = (np.arange(draws) + 0.5) / draws
    quantiles: Signal = np.sqrt(freedom) * np.tan(np.interp(middles * share[-1], share, angle))
    return quantiles


def _interval(x: Signal, middle: float, spread: float) -> Interval:
    """Interval that leaves 2.5 % of the draws on either side.

    Only the draws in the tails are put in order, unless these hold less than 2.5 % of all.

    Parameters
    ----------
    middle, spread : mean and standard deviation of the draws, roughly
    """
    k = round(0.025 * x.size)
    low, high = x.compress(x < middle - INNER * spread), x.compress(x > middle + INNER * spread)
    if min(low.size, high.size) <= k:
        low = high = x
    return Interval(float(np.partition(low, k)[k]), float(np.partition(high, high.size - 1 - k)[high.size - 1 - k]))


def _spread(
    reduction: Reduction, model: ErrorModel, known: Budget, strata: Sequence[Index], seed: int, draws: int
) -> dict[str, Signal]:
    """Means of the metrics for drawn errors, (draws,) each; nothing for a metric without an accuracy."""
    ratios = model.cascade.all_ratios
    drawn = _draw(model, strata, seed, draws)
    spread = {}
    for metric in model.cascade.all_metrics:
        if known.mean[metric] is None:
            continue
        rows = model.rows[metric]
        if metric in ratios:
            out, into = (drawn[name.removeprefix("energy_")] for name in ratios[metric])
            spread[metric] = _ratio(out, into, rows, reduction.mean.value(metric))
        else:
            kind, name = metric.split("_", 1)
            spread[metric] = drawn[name].mean(rows, model.stages[name].t[rows] if kind == "power" else None)
    return spread


class _Drawn(msgspec.Struct, frozen=True):
    """Energies of a stage for drawn errors: those as reduced and `parts`, (k, m), times `weights`, (m, draws), all times
    `factor`. [J]

    The parts are those integrals of the stage that an error acts on, and what a relative error of the sampling changes of its
    energy. The weights are made of the zeros, the factor of the gains and of the gaps.
    """

    energy: Signal
    parts: Signal
    weights: Signal
    factor: Signal

    def mean(self, rows: Index, per: Signal | None = None) -> Signal:
        """Mean over some cycles, (draws,), each divided by something of its own."""
        energy, parts = self.energy[rows], self.parts[rows]
        if per is not None:
            energy, parts = energy / per, parts / per[:, None]
        found: Signal = np.dot(parts.sum(axis=0) / rows.size, self.weights) + float(energy.sum()) / rows.size
        return found * self.factor

    def without_factor(self, cycle: int) -> Signal:
        """Energy of one cycle, (draws,), to be multiplied by the factor. [J]"""
        return np.asarray(self.energy[cycle] + np.dot(self.parts[cycle], self.weights))  # quicker than @ for few parts


def _draw(model: ErrorModel, strata: Sequence[Index], seed: int, draws: int) -> dict[str, _Drawn]:
    """Energies that channels without errors would have given, (1 + gain) x + zero being read of x.

    Parameters
    ----------
    strata : of each source, and then of each stage
    """
    of_gaps = iter(strata[len(model.sources) :])
    limit = sampling_limit(model.stages) or 1.0
    powers = tuple(
        _Power(stage.first, stage.second, stage.scale, stage.radius_power) for stage in model.stages.values()
    )
    weights = (_kept_weights if draws == DRAWS else _weights)(model.sources, powers, seed, draws)
    drawn = {}
    for (name, stage), power in zip(model.stages.items(), powers, strict=True):
        rows = model.rows[f"energy_{name}"]
        energy, bridged = abs(float(stage.energy[rows].sum())), stage.bridged[rows]
        share = math.sqrt(float(bridged @ bridged) / 3.0) / energy if energy > 0 else 0.0
        parts = np.column_stack((stage.x, stage.y, stage.t, stage.sampled / limit))
        used, weight, factor = weights[power]
        if share > 0.0:  # by what bridged gaps may have changed
            factor = factor * (1.0 + share * _student(draws)[next(of_gaps)])
        drawn[name] = _Drawn(stage.energy, parts[:, used], weight, factor)
    return drawn


class _Power(NamedTuple):
    """What an energy is the integral of, as of `StageEnergy`; several spans may share it."""

    first: str
    second: str | None
    scale: float
    radius_power: int


def _weights(
    sources: tuple[ErrorSource, ...], powers: tuple[_Power, ...], seed: int, draws: int
) -> dict[_Power, tuple[Index, Signal, Signal]]:
    """Weights and factor of each power for drawn errors, as `_Drawn` holds them, after the parts that have a weight."""
    errors: dict[tuple[str, str], Signal] = {}
    rectangular = _rectangular(draws)
    for s, stratum in zip(sources, _strata_of(seed, draws, 1 + len(sources))[1:], strict=True):
        drawn_error = s.u * _student(draws)[stratum] if s.limit is None else s.limit * rectangular[stratum]
        errors[s.channel, s.part] = errors.get((s.channel, s.part), 0.0) + drawn_error  # sensor and acquisition system
    found = {}
    for power in dict.fromkeys(powers):
        factor = (np.ones(draws) + errors.get((R_DRUM, "gain"), 0.0)) ** -power.radius_power
        for channel in (power.first, power.second or ""):
            factor = factor / (1.0 + errors.get((channel, "gain"), 0.0))
        zero_x, zero_y = (errors.get((channel or "", "zero"), 0.0) for channel in (power.first, power.second))
        weights = np.empty((4, draws))
        for row, weight in enumerate((-zero_y, -zero_x, zero_x * zero_y)):
            weights[row] = power.scale * weight
        weights[3] = errors.get((SAMPLING, "gain"), 0.0)
        used = np.flatnonzero(weights.any(axis=1))
        found[power] = used, weights[used], factor
    return found


_kept_weights = lru_cache(maxsize=4)(_weights)
"""Weights of the default number of draws, which are the same for all logs of a batch with the same sensors and channels."""


def _ratio(out: _Drawn, into: _Drawn, rows: Index, mean: float) -> Signal:
    """Mean of the ratios of the cycles for each draw, about their reduced mean."""
    if len(rows) > MAX_CYCLES:
        rows = rows[np.linspace(0, len(rows) - 1, MAX_CYCLES).round().astype(int)]
    total = np.zeros(out.weights.shape[1])
    for k in rows.tolist():
        total += out.without_factor(k) / into.without_factor(k)
    nominal = float((out.energy[rows] / into.energy[rows]).sum()) / len(rows)
    total *= out.factor / into.factor
    return total / len(rows) + (mean - nominal)
