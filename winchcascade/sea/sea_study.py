"""A corrected rig in one sea or many: mean power with its band in each, energy of a year, loads
compared, what limits it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Signal
from winchcascade.core.viewed import Viewed
from winchcascade.diagnosis.handover.posterior import Band, RigPosterior
from winchcascade.diagnosis.handover.tested import NEAR, Tested
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.rig.best_load import largest_at
from winchcascade.rig.kernel import COLUMNS
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import check_travel
from winchcascade.sea.coupled import float_in_waves
from winchcascade.sea.hydrodynamics import Hydrodynamics
from winchcascade.sea.in_sea import (
    PEAKS,
    PLACE,
    QUANTITIES,
    Control,
    fixed,
    losses,
    run,
    with_ripple,
)
from winchcascade.sea.line_motion import FOLLOWER, FloatResponse, SeaPath, path_in_waves
from winchcascade.sea.wave_spectra import SeaState, Waves, realised

MINUTES, DRAWS = 20.0, 40
"""Length of each sea [min], as IEC TS 62600-100 has its records, and number of rigs drawn from
the posterior.
"""

BINS = (0.5, 1.0)
"""Bins of wave height [m] and period [s] of a power matrix (IEC TS 62600-100)."""

CANDIDATES = 15
"""Number of fixed loads, evenly spaced in their logarithm between those of the logs, among which
the best is searched; between them by a parabola.
"""

UNCOVERED = 0.05
"""Share of the time of payout beyond what the logs cover up to which a sea is within their domain.
[1]
"""

SEARCHED = 100.0
"""Length in peak periods of the sea over which the load of all seas is searched. [1]"""

SAMPLED = 20_000
"""Number of instants of a sea that are compared with what the logs cover."""

ENDS = (0.025, 0.975)
"""Ends of a 95 % interval. [1]"""

FROUDE = {"W": 3.5, "N": 3.0, "rpm": -0.5, "N.m": 4.0}
"""Powers of the scale by which quantities are scaled (Froude's law); electrical ones stay those
of the rig. [1]
"""


Body = FloatResponse | Hydrodynamics
"""What moves the line: the surface or a float of known response, or a float that the rig pulls."""


class Seas(msgspec.Struct, frozen=True):
    """Seas with the hours of each in a year (NaN where that is not stated), in full scale.

    Parameters
    ----------
    states : significant wave heights [m], peak periods [s], spectra
    hours : of each in a year [h]
    froude : scale of the seas over that of the rig [1]
    minutes : length of each [min]
    seed : from which phases and draws follow
    log : waves of a log in place of those of a spectrum
    """

    states: tuple[SeaState, ...]
    hours: tuple[float, ...]
    froude: float = 1.0
    minutes: float = MINUTES
    seed: int = 0
    log: Waves | None = None

    @property
    def yearly(self) -> bool:
        """Whether every sea has its hours."""
        return all(math.isfinite(hours) for hours in self.hours)

    def at_rig(self, k: int) -> tuple[SeaState, float]:
        """A sea at the scale of the rig, and its duration there [s]."""
        own, root = self.states[k], math.sqrt(self.froude)
        sea = msgspec.structs.replace(own, hs=own.hs / self.froude, tp=own.tp / root)
        return sea, 60.0 * self.minutes / root

    def waves(self, k: int) -> Waves:
        """The waves of a sea at the scale of the rig."""
        sea, duration = self.at_rig(k)
        if self.log is None:
            return realised(sea, duration, self.seed + k)
        return Waves(
            self.log.frequency * math.sqrt(self.froude), self.log.amplitude / self.froude, duration
        )


class InSea(msgspec.Struct, frozen=True):
    """What the rig gives in a sea.

    Parameters
    ----------
    hs, tp, hours : of the sea, in full scale [m, s, h]
    values : `QUANTITIES`, in full scale
    lost : mean power by each loss, in full scale [W]
    outside : share of the time of payout that the logs do not cover [1]
    exceeds : limits that are exceeded
    best_load : best fixed load of this sea [ohm]; NaN where it was not searched
    beyond : share of the time of payout that the logs do not cover by each other control [1]
    power : mean power at the DC link by each other control, in full scale [W]
    gain : relative gain of power over others, by the names of both, as `best_over_fixed`
    reason : why there is no result; empty where there is one
    """

    hs: float
    tp: float
    hours: float
    values: dict[str, Band] = {}
    lost: dict[str, float] = {}
    outside: float = math.nan
    exceeds: tuple[str, ...] = ()
    best_load: float = math.nan
    beyond: dict[str, float] = {}
    power: dict[str, Band] = {}
    gain: dict[str, Band] = {}
    reason: str = ""

    def covered(self, controls: str = "fixed") -> bool:
        """Whether the logs cover the sea by a control, or by both of which a gain is."""
        outside = {"fixed": self.outside} | self.beyond
        return all(outside[name] <= UNCOVERED for name in controls.split("_over_"))


class SeaStudy(Viewed, frozen=True, kw_only=True):
    """A corrected rig in some seas; `year` is its energy in one [MWh], None without hours, of
    `hours` with a result [h].
    """

    tested: Tested
    seas: Seas
    moved_by: str
    load: float
    schedule: Control | None
    limits: dict[str, float]
    payout: float
    draws: int
    rows: tuple[InSea, ...]
    year: Band | None
    hours: float


class Rig(NamedTuple):
    """A corrected rig in waves: the best model and drawn ones, each for seas that its logs cover
    and for those beyond, what the logs cover, what moves its line, limits [by `PEAKS`], and payout
    in still water [m].
    """

    models: list[tuple[Model, Model]]
    tested: Tested
    body: Body
    limits: Mapping[str, float]
    payout: float

    @property
    def best(self) -> Model:
        """The best model."""
        return self.models[0][0]

    def exceeded(self, row: Signal) -> tuple[str, ...]:
        """Limits that `QUANTITIES` of the best model exceed, (quantities,)."""
        return tuple(name for name, limit in self.limits.items() if row[PLACE[PEAKS[name]]] > limit)


def sea_study(
    posterior: RigPosterior,
    tested: Tested,
    seas: Seas,
    *,
    body: Body = FOLLOWER,
    moved_by: str = "the surface",
    load: float = math.nan,
    schedule: Control | None = None,
    compare: bool = False,
    limits: Mapping[str, float] = {},
    payout: float = math.nan,
    draws: int = DRAWS,
) -> SeaStudy:
    """Put a corrected rig under irregular waves.

    Parameters
    ----------
    body : what moves the line, and `moved_by` in words
    load : fixed load [ohm]; by default the best one for the energy of all seas
    schedule : of the load over the speed of the generator, which is compared with the fixed load
    compare : also search the best fixed load of each sea, within the limits
    limits : largest allowed values by the names of `PEAKS`
    payout : of the line in still water [m]; by default half of a usual payout of the logs
    draws : number of rigs drawn from the posterior

    Raises
    ------
    OptionError : a number that is none, no sea in which the rig has a result, or no load that is
        within the limits
    """
    if tested.warm is not None:
        limits = {**limits, "heating": min(limits.get("heating", math.inf), tested.warm)}
    best = posterior.model()
    models = [(best, best), *posterior.draws(draws, seas.seed)]
    still = 0.5 * tested.length if math.isnan(payout) else payout
    rig = Rig(models, tested, body, limits, still)
    numbers = range(len(seas.states))
    searched = [math.nan] * len(numbers)
    if math.isnan(load) or compare:
        load, searched = _searched(rig, seas, load, math.inf if compare or limits else SEARCHED)
    controls = {"fixed": fixed(load)} | ({} if schedule is None else {"schedule": schedule})
    jobs = [
        partial(
            _in_sea,
            rig,
            seas,
            k,
            controls | ({"best": fixed(best)} if compare and math.isfinite(best) else {}),
        )
        for k, best in zip(numbers, searched, strict=True)
    ]
    found = all_at_once(jobs)
    rows = tuple(row for row, _ in found)
    known = [k for k, row in enumerate(rows) if not row.reason]
    if not known:
        raise OptionError(f"no sea has a result: {rows[0].reason}")
    year = None
    if seas.yearly:
        hours = np.array([rows[k].hours for k in known])
        year = band_of(1e-6 * hours @ np.array([found[k][1] for k in known]))
    return SeaStudy(
        tested=tested,
        seas=seas,
        moved_by=moved_by,
        load=load,
        schedule=schedule,
        limits=dict(limits),
        payout=rig.payout,
        draws=draws,
        rows=rows,
        year=year,
        hours=sum(rows[k].hours for k in known),
    )


def band_of(values: Signal) -> Band:
    """The value of the best model and the 95 % interval of drawn ones, (1 + draws,): of 40, nearly
    their range.

    >>> band_of(np.array([3.0, *range(1, 40)]))
    Band(value=3.0, low=1.0, high=39.0)
    """
    if values.size < 3:
        return Band(float(values[0]), math.nan, math.nan)
    return Band(float(values[0]), *np.quantile(values[1:], ENDS, method="weibull").tolist())


def gain_of(gains: Signal, u_ratio: float) -> Band:
    """A relative gain of power by the best model and the drawn ones, (1 + draws,). [1]

    Parameters
    ----------
    u_ratio : standard uncertainty of the ratio of the powers beside that of the models, as a share
    """
    band = band_of(gains)
    half = COVERED * u_ratio * (1.0 + band.value)
    low, high = (math.hypot(end - band.value, half) for end in (band.low, band.high))
    return Band(band.value, band.value - low, band.value + high)


PathOf = Callable[[Model, Control], SeaPath]
"""The motion of the line with a model at a control; LogError where the rig has no room for it."""


def _moved(rig: Rig, seas: Seas, k: int) -> PathOf:
    """How a sea moves the line: alike with every model, unless the rig pulls at the float."""
    (sea, _), waves, body = seas.at_rig(k), seas.waves(k), rig.body
    name = f"{sea.hs:.3g} m, {sea.tp:.3g} s"
    if isinstance(body, Hydrodynamics):

        def pulled(model: Model, control: Control) -> SeaPath:
            own, _ = float_in_waves(model, waves, body, sea.tp, rig.payout, control)
            check_travel(name, model, float(np.min(own.motion.x)), float(np.max(own.motion.x)))
            return own

        return pulled
    path = path_in_waves(rig.best, waves, body, sea.tp, rig.payout)

    def given(model: Model, _: Control) -> SeaPath:
        check_travel(name, model, float(np.min(path.motion.x)), float(np.max(path.motion.x)))
        return path

    return given


def _searched(rig: Rig, seas: Seas, load: float, periods: float) -> tuple[float, list[float]]:
    """The load that is best for all seas, unless one is given, and the best of each [ohm], NaN
    where there is none.

    A sea in which every load exceeds a limit has no best load, and does not count for that of all.

    Parameters
    ----------
    periods : length of the search in each sea, in peak periods [1]

    Raises
    ------
    OptionError : no run has a load, or none is within the limits in all other seas
    """
    loads, numbers = rig.tested.loads, range(len(seas.states))
    if not loads:
        raise OptionError(f"{rig.tested.title}: no run has a load; name one by --load OHM.")
    tried = np.geomspace(min(loads), max(loads), CANDIDATES if len(loads) > 1 else 1)
    power = np.array(all_at_once([partial(_powers, rig, seas, k, tried, periods) for k in numbers]))
    usable = np.any(power > -math.inf, axis=1)
    best = [
        largest_at(tried, own) if ok else math.nan for own, ok in zip(power, usable, strict=True)
    ]
    if math.isnan(load) and usable.any():
        hours = np.array(seas.hours) if seas.yearly else np.ones(len(numbers))
        load = largest_at(tried, np.sum(hours[usable, None] * power[usable], axis=0))
    if math.isnan(load) and not np.isnan(power).all():
        raise OptionError(
            f"{rig.tested.title}: no load from {min(loads):g} to {max(loads):g} ohm keeps all seas "
            f"within the limits; loosen these, or name a load by --load OHM."
        )
    return load, best


def _powers(rig: Rig, seas: Seas, k: int, loads: Signal, periods: float) -> Signal:
    """Mean power at the DC link over the first part of a sea at some fixed loads, (k,); -inf
    where a limit is exceeded, NaN where there is none. [W]
    """
    path_of, model, found = _moved(rig, seas, k), rig.best, np.full(loads.size, -math.inf)
    for j, control in enumerate(map(fixed, loads.tolist())):
        try:
            path = path_of(model, control)
        except LogError:
            return np.full(loads.size, math.nan)
        row = run(model, path.until(periods * seas.at_rig(k)[0].tp), control)
        if not rig.exceeded(row):
            found[j] = row[PLACE["p_gen_w"]]
    return found


def _in_sea(rig: Rig, seas: Seas, k: int, controls: Mapping[str, Control]) -> tuple[InSea, Signal]:
    """A sea, and the mean power at the DC link with the best model and each drawn one, (1 +
    draws,) in full scale [W].
    """
    state, best = seas.states[k], rig.best
    row = InSea(state.hs, state.tp, seas.hours[k])
    path_of, found, beyond = _moved(rig, seas, k), dict[str, Signal](), dict[str, float]()
    try:
        for name, control in reversed(
            list(controls.items())
        ):  # losses are those of the fixed load, which is the first
            path = path_of(best, control)
            out = np.empty((path.motion.v.size, len(COLUMNS)))
            run(best, path, control, out)
            beyond[name] = outside_of(rig.tested, path, out)
            models = [pair[beyond[name] > UNCOVERED] for pair in rig.models]
            found[name] = np.array(
                [run(model, path_of(model, control), control) for model in models]
            )
    except LogError as fault:
        return msgspec.structs.replace(row, reason=str(fault)), np.zeros(len(rig.models))
    scale = np.array([seas.froude ** FROUDE.get(unit, 0.0) for unit in QUANTITIES.values()])
    power = {
        name: seas.froude ** FROUDE["W"] * values[:, PLACE["p_gen_w"]]
        for name, values in found.items()
    }
    main = with_ripple(found["fixed"])
    lost = losses(best, path, out)
    lost["copper"] += float(main[0, PLACE["ripple_w"]])
    row = msgspec.structs.replace(
        row,
        values={name: band_of(scale[j] * main[:, j]) for name, j in PLACE.items()},
        lost={name: seas.froude ** FROUDE["W"] * watt for name, watt in lost.items()},
        outside=beyond.pop("fixed"),
        beyond=beyond,
        exceeds=rig.exceeded(main[0]),
        best_load=controls["best"].loads[0] if "best" in controls else math.nan,
        power={name: band_of(own) for name, own in power.items() if name != "fixed"},
        gain={
            f"{one}_over_{other}": gain_of(
                power[one] / power[other] - 1.0,
                rig.tested.u_ratio(controls[one].loads, controls[other].loads),
            )
            for one, other in (("best", "fixed"), ("schedule", "fixed"), ("schedule", "best"))
            if one in power and other in power
        },
    )
    return row, power["fixed"]


def outside_of(tested: Tested, path: SeaPath, out: Signal) -> float:
    """Share of the time of payout in which speed, DC current, tension or payout is beyond what
    the logs cover. [1]
    """
    stride = max(1, (path.motion.v.size - path.first) // SAMPLED)
    some = slice(path.first, None, stride)
    v, x = path.motion.v[some], path.motion.x[some]
    pays = v > path.motion.rest
    idc, force = (out[some, COLUMNS.index(name)] for name in ("idc", "force"))
    slack = NEAR * tested.length
    covered = np.logical_and(
        tested.covers(v, idc, force), np.abs(x - 0.5 * tested.length) <= 0.5 * tested.length + slack
    )
    return float(np.mean(~covered[pays])) if pays.any() else 0.0
