"""A Monte Carlo of the sensors' errors (JCGM 101:2008): it confirms the budget, and gives the 95 % intervals.

The sensors' limits are rectangular, and often one of them decides: then 95 % lie within 0.95 of the limit, where the
GUM's factor of 1.96 standard uncertainties would give 1.13 of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import msgspec
import numpy as np

from winchcascade.core.run import Index, Signal
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import (
    R_DRUM,
    SAMPLING,
    Budget,
    ErrorModel,
    StageEnergy,
    budget,
    error_model,
    sampling_limit,
)

SEED = 20260
"""Seed of the draws unless another is given, so that the same log gives the same interval."""

DRAWS = 20_000
"""Draws of all errors; the ends of an interval are then known to 0.5 % of its width, to 2 % where few cycles decide it."""

BLOCK = 4096
"""Draws that are made at a time."""

MOST_CYCLES = 250
"""Of more cycles an even selection is drawn for ratios: the sensors' errors act on all of them nearly alike."""

LINEAR_WITHIN = 0.02
"""Where the standard uncertainties of Monte Carlo and budget differ by more than this share, the Monte Carlo's is stated;
with few draws by more than chance makes them differ."""

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
    seed, draws : of the Monte Carlo

    Examples
    --------
    >>> from winchcascade.reduction.reduce import reduce
    >>> from winchcascade.ingest.read import read_run
    >>> found = uncertainty(reduce(read_run("fixtures/campaign/r36ohm.csv"), window=5.48))
    >>> round(found.standard.eta_trans, 4), found.method["eta_trans"]
    (0.0048, 'gum')
    """
    model = error_model(reduction)
    known = budget(reduction, model)
    rng = np.random.default_rng(seed)
    spread = _spread(reduction, model, known, rng, draws) if reduction.complete else {}
    student = {1: np.zeros(draws)}
    drawn, whole, alone = {}, {}, {}
    for metric, x in spread.items():
        scatter = known.repeatability[metric] or 0.0
        drawn[metric] = float(np.hypot(np.std(x), scatter))
        n = model.rows[metric].size
        if n not in student:
            student[n] = rng.standard_t(n - 1, draws)
        whole[metric] = _interval(student[n] * scatter + x)
        alone[metric] = _interval(x) if scatter else whole[metric]
    within = max(LINEAR_WITHIN, 3.0 / np.sqrt(draws))
    method: dict[str, Method] = {
        m: "gum" if abs(u - known.mean.value(m)) <= within * u else "monte_carlo" for m, u in drawn.items()
    }
    stated = {m: known.mean[m] if way == "gum" else drawn[m] for m, way in method.items()}
    return Uncertainty(known, seed, draws, Metrics(drawn), Metrics(stated), method, whole, alone)


def stated_uncertainty(reduction: Reduction) -> tuple[Budget, Metrics]:
    """Budget and stated standard uncertainties of the means, without a Monte Carlo where it could only confirm them."""
    known = budget(reduction)
    return known, known.mean if known.reach <= SMALL else uncertainty(reduction).standard


def _interval(x: Signal) -> Interval:
    """Interval that leaves 2.5 % of the draws on either side; puts the draws into another order."""
    k = round(0.025 * x.size)
    x.partition((k, x.size - 1 - k))
    return Interval(float(x[k]), float(x[x.size - 1 - k]))


def _spread(
    reduction: Reduction, model: ErrorModel, known: Budget, rng: np.random.Generator, draws: int
) -> dict[str, Signal]:
    """Means of the metrics for drawn errors, (draws,) each; nothing for a metric without an accuracy."""
    ratios = model.cascade.all_ratios
    spread = {m: np.empty(draws) for m in model.cascade.all_metrics if known.mean[m] is not None}
    for start in range(0, draws, BLOCK):  # blocks that stay in the cache of the processor
        part = slice(start, min(start + BLOCK, draws))
        drawn = _draw(model, rng, part.stop - start)
        for metric, x in spread.items():
            rows = model.rows[metric]
            if metric in ratios:
                out, into = (drawn[name.removeprefix("energy_")] for name in ratios[metric])
                x[part] = _ratio(out, into, rows, reduction.mean.value(metric))
            else:
                kind, name = metric.split("_", 1)
                per = model.stages[name].t[rows, None] if kind == "power" else 1.0
                x[part] = (drawn[name].parts[rows] / per).mean(axis=0) @ drawn[name].weights * drawn[name].factor
    return spread


class _Drawn(msgspec.Struct, frozen=True):
    """Energies of a stage for drawn errors: `parts`, (k, 5), times `weights`, (5, draws), times `factor`. [J]

    The parts are the integrals of the stage, and what a relative error of the sampling changes of its energy. The weights are
    made of the zeros, the factor of the gains and of the gaps.
    """

    stage: StageEnergy
    parts: Signal
    weights: Signal
    factor: Signal | float


def _draw(model: ErrorModel, rng: np.random.Generator, draws: int) -> dict[str, _Drawn]:
    """Energies that channels without errors would have given, (1 + gain) x + zero being read of x."""
    errors: dict[tuple[str, str], Signal] = {}
    for s in model.sources:
        drawn_error = s.u * rng.standard_normal(draws) if s.limit is None else rng.uniform(-s.limit, s.limit, draws)
        errors[s.channel, s.part] = errors.get((s.channel, s.part), 0.0) + drawn_error  # sensor and acquisition system
    limit = sampling_limit(model.stages) or 1.0
    drawn = {}
    for name, stage in model.stages.items():
        rows = model.rows[f"energy_{name}"]
        energy = abs(float(np.sum(stage.energy[rows])))
        share = float(np.sqrt(np.sum(stage.bridged[rows] ** 2) / 3.0)) / energy if energy > 0 else 0.0
        factor = 1.0 + share * rng.standard_normal(draws) if share > 0 else 1.0  # by what bridged gaps may have changed
        for channel in (stage.first, stage.second or "", R_DRUM if stage.by_radius else ""):
            factor = factor / (1.0 + errors.get((channel, "gain"), 0.0))
        zero_x, zero_y = (errors.get((channel or "", "zero"), 0.0) for channel in (stage.first, stage.second))
        weights = np.empty((5, draws))
        for row, weight in enumerate((1.0, -zero_y, -zero_x, zero_x * zero_y)):
            weights[row] = stage.scale * weight
        weights[4] = errors.get((SAMPLING, "gain"), 0.0)
        parts = np.column_stack((stage.xy, stage.x, stage.y, stage.t, stage.sampled / limit))
        drawn[name] = _Drawn(stage, parts, weights, factor)
    return drawn


def _ratio(out: _Drawn, into: _Drawn, rows: Index, mean: float) -> Signal:
    """Mean of the ratios of the cycles for each draw, about their reduced mean."""
    chosen = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_CYCLES)).round().astype(int)]
    total = np.zeros(out.weights.shape[1])
    for k in chosen.tolist():
        total += (out.parts[k] @ out.weights) / (into.parts[k] @ into.weights)
    nominal = float(np.mean(out.stage.energy[chosen] / into.stage.energy[chosen]))
    drawn: Signal = total / len(chosen) * (out.factor / into.factor) + (mean - nominal)
    return drawn
