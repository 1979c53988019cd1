"""What a corrected rig gives at other loads and speeds, which load suits which speed, and what
each cause costs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.viewed import Viewed
from winchcascade.design.operating import (
    PLACE,
    Motion,
    Path,
    path_of,
    planned_cycle,
    points,
    require_positive,
)
from winchcascade.diagnosis.handover.posterior import Band, RigPosterior, Tested
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.verdict_limits import LAW
from winchcascade.rig.best_load import largest_at
from winchcascade.rig.physics import RPM

if TYPE_CHECKING:
    from winchcascade.core.run import Mask, Signal

SPEEDS, SLOWEST = 7, 0.3
"""Number of line speeds of a map, and the slowest as a share of the fastest of the campaign. [1]"""

BANDS = 6
"""Number of bands of generator speed of a schedule."""

CANDIDATES = 41
"""Number of loads, evenly spaced in their logarithm, among which a schedule looks for the best;
between them by a parabola.
"""

Criterion = Literal["power", "efficiency"]

CycleAt = Callable[[float], Motion]
"""A cycle of the line at a speed of its plateau. [m/s]"""

METRIC: Mapping[Criterion, str] = {"power": "p_gen_w", "efficiency": "eta_pto"}
"""What a schedule makes largest."""


JOULES_PER_KWH = 3.6e6
"""Energy of one kWh. [J]"""


class Limits(msgspec.Struct, frozen=True):
    """What no operating point may exceed: stator current, rms [A], speed of the generator [rpm],
    line tension [N], and the DC current, rms over a cycle, that heats the machine [A].
    """

    current: float = math.inf
    speed: float = math.inf
    tension: float = math.inf
    heating: float = math.inf

    def exceeded(self, found: Signal) -> list[str]:
        """Which limits a point with these quantities exceeds."""
        return [
            name
            for name, (quantity, _) in LIMITED.items()
            if found[PLACE[quantity]] > getattr(self, name)
        ]


LIMITED = {
    "current": ("i_s_a", "A"), "speed": ("rpm", "rpm"), "tension": ("force_n", "N"), "heating": ("i_dc_rms_a", "A (DC, rms)"),
}  # fmt: skip
"""Quantity of an operating point that each limit concerns, with its unit."""

NO_LIMITS = Limits()
"""Every operating point is allowed."""


class OperatingPoint(msgspec.Struct, frozen=True):
    """What the rig does at a load [ohm] and a line speed [m/s]; `exceeds` names the limits that
    it is beyond.
    """

    load: float
    speed: float
    values: dict[str, Band]
    within_domain: bool
    exceeds: tuple[str, ...]


class Scheduled(msgspec.Struct, frozen=True):
    """The best load [ohm] for a band of generator speed [rpm], its gain over the best fixed load
    [1], and why there is none.

    `within_domain` is whether the logs cover the load there, `gain_within_domain` whether they
    cover the fixed load, too.
    """

    rpm_low: float
    rpm_high: float
    speed: float
    criterion: Criterion
    load: float | None
    gain: Band | None
    within_domain: bool = True
    gain_within_domain: bool = True
    reason: str = ""


class Repair(msgspec.Struct, frozen=True):
    """What the rig would do at the same motion without an effect: deliver more energy for each
    cycle [J] and, where the motions have a number in a year, for a year [kWh], and take less from
    the line for each cycle [J].
    """

    effect: str
    per_cycle: Band
    per_year: Band | None
    saved: Band
    within_domain: bool


class Share(msgspec.Struct, frozen=True):
    """A motion of a sea, and how often it comes in a year; NaN where that is not stated."""

    motion: Motion
    per_year: float = math.nan


class Design(Viewed, frozen=True, kw_only=True):
    """Maps, schedules and repairs of a corrected rig at one motion; `fixed` are the best fixed
    loads by criterion [ohm].

    `repaired_at` is the load at which the repairs are valued [ohm]. Only effects that are causes
    have repairs.
    """

    tested: Tested
    motion: str
    limits: Limits
    rows: tuple[OperatingPoint, ...]
    schedule: tuple[Scheduled, ...]
    fixed: dict[Criterion, float]
    repairs: tuple[Repair, ...]
    repaired_at: float


class Explanation:
    """A corrected rig by one fit: models by which its operating points have uncertainties, of its
    posterior and of its laws.

    What an effect does in the logs is known as the posterior has it, whatever its law: how well the
    law is known counts beyond these logs, and for the rig without the effect.

    `moved` are the best model and it moved along every direction of the posterior, `repaired` the
    same without each effect that acts, `laws` how well the law of each is known [1], and `each` are
    `moved` and the best models without each effect.
    """

    def __init__(self, posterior: RigPosterior) -> None:
        self.moved, self.weight = posterior.models(), posterior.weight
        self.laws = {
            one.effect.name: max(LAW, one.effect.law_u)
            for one in posterior.effects
            if one.effect.entry is None
        }
        self.repaired = {name: posterior.models(name) for name in self.laws}
        self.each = [*self.moved, *(models[0] for models in self.repaired.values())]

    def u(self, found: Signal, covered: Mask | np.bool_) -> Signal:
        """Standard uncertainty of what `each` gives, (models, ...): by the posterior and, where the
        logs do not cover it, by the laws of the effects.
        """
        changes, count = np.moveaxis(found[1:] - found[0], 0, -1), len(self.moved) - 1
        posterior = np.linalg.norm(changes[..., :count], axis=-1)
        laws = np.linalg.norm(changes[..., count:] * [*self.laws.values()], axis=-1)
        return np.asarray(np.hypot(posterior, np.where(covered, 0.0, laws)))


class CorrectedRig:
    """A corrected rig whose operating points have bands: a mixture over the explanations that the
    logs do not distinguish.

    `moved` are the models of the best one, `causes` the effects that a repair is valued of.
    """

    def __init__(self, posterior: RigPosterior, tested: Tested) -> None:
        self.tested = tested
        self.explanations = [Explanation(one) for one in posterior.members]
        self.weights = np.array([one.weight for one in self.explanations])
        self.moved = self.explanations[0].moved
        self.causes = [
            name for name in self.explanations[0].repaired if name in tested.judgement.causes
        ]

    def path(self, motion: Motion) -> Path:
        """A motion as the rig takes it, with its payouts as the reduction of the logs finds
        them.
        """
        return path_of(motion, self.moved[0], self.tested.rules)

    def bands(self, paths: Sequence[Path], loads: Sequence[float]) -> Signal:
        """Quantities along each motion at each load, low and high ends of their bands, (3,
        motions, loads, quantities).
        """
        found = [points(one.each, paths, loads) for one in self.explanations]
        covered = self.covers(paths, found[0][0])[:, :, None]
        return self._mixture(
            [
                (every[0], one.u(every, covered))
                for one, every in zip(self.explanations, found, strict=True)
            ]
        )

    def _mixture(self, each: Sequence[tuple[Signal, Signal]]) -> Signal:
        """The value of the best explanation and the 95 % interval over all, (3, ...), of the
        value and u of each.
        """
        values, u = (np.array(several) for several in zip(*each, strict=True))
        return np.stack([values[0], *mixed(self.weights, values, u)])

    def gain(self, path: Path, load: float, fixed: float, metric: str) -> tuple[Band, bool]:
        """How much larger a metric is with a load than with a fixed one [1], and whether the logs
        cover both.
        """
        found = [points(one.each, [path], [load, fixed]) for one in self.explanations]
        covered, each = self.covers([path], found[0][0]).all(), []
        u_ratio = self.tested.u_ratio([load], [fixed])
        for one, every in zip(self.explanations, found, strict=True):
            with_load, with_fixed = every[:, 0, :, PLACE[metric]].T
            gains = with_load / with_fixed - 1.0
            u = np.hypot(one.u(gains, covered), u_ratio * (1.0 + gains[0]))
            each.append((gains[0], u))
        return Band(*self._mixture(each).tolist()), bool(covered)

    def covers(self, paths: Sequence[Path], found: Signal) -> Mask:
        """Whether the logs cover quantities along some motions, (motions, loads) of (motions,
        loads, quantities).
        """
        speed = np.repeat([path.speed for path in paths], found.shape[1])
        current, force = (found[:, :, PLACE[name]].ravel() for name in ("i_dc_a", "force_n"))
        covered = self.tested.covers(speed, current, force)
        return np.asarray(covered, dtype=np.bool_).reshape(found.shape[:2])

    def worth(self, name: str, shares: Sequence[Share], load: float) -> Repair:
        """What a repair brings over some motions at a load; nothing by an explanation without the
        effect.

        It is within the domain if the logs cover the rig with the effect and the repaired one.
        """
        paths = [self.path(share.motion) for share in shares]
        several = [one for one in self.explanations if name in one.repaired]
        repaired, acting = (
            [points(models, paths, [load]) for models in of]
            for of in ([one.repaired[name] for one in several], [one.moved for one in several])
        )
        number = np.array([share.per_year for share in shares])
        yearly = bool(np.all(np.isfinite(number)))
        weights = number / number.sum() if yearly else np.full(len(shares), 1.0 / len(shares))

        def change(quantity: str, per: float = 1.0) -> Band:
            each = {}
            for one, without, within in zip(several, repaired, acting, strict=True):
                own = per * (without - within)[:, :, 0, PLACE[quantity]] @ weights
                law = one.laws[name] * own[0]
                each[one] = own[0], np.hypot(np.linalg.norm(own[1:] - own[0]), law)
            nothing = np.float64(0.0), np.float64(0.0)
            value, low, high = self._mixture(
                [each.get(one, nothing) for one in self.explanations]
            ).tolist()
            if len(several) < len(self.explanations):
                return Band(value, min(low, 0.0), max(high, 0.0))
            return Band(value, low, high)

        per_year = change("e_gen_j", float(number.sum()) / JOULES_PER_KWH) if yearly else None
        covered = all(self.covers(paths, found[0][0]).all() for found in (acting, repaired))
        return Repair(name, change("e_gen_j"), per_year, change("e_line_j", -1.0), covered)


def mixed(weights: Signal, values: Signal, u: Signal) -> tuple[Signal, Signal]:
    """Ends of the 95 % interval of a mixture of normals, (...) each.

    Parameters
    ----------
    weights : (m,) of the normals, 1 in sum
    values, u : (m, ...) mean and standard deviation of each

    Examples
    --------
    >>> low, high = mixed(np.ones(1), np.array([5.0]), np.array([1.0]))
    >>> float(low), float(high)
    (3.04, 6.96)
    """
    from scipy.special import ndtr

    ends = []
    for side in (-COVERED, COVERED):
        of_each = values + side * u
        low, high = of_each.min(axis=0), of_each.max(axis=0)
        for _ in range(HALVED if len(weights) > 1 else 0):
            middle = 0.5 * (low + high)
            below = np.tensordot(
                weights, ndtr((middle - values) / np.maximum(u, TINY)), axes=1
            ) < ndtr(side)
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        ends.append(0.5 * (low + high))
    return ends[0], ends[1]


HALVED, TINY = 40, 1e-300
"""Number of times that the span of an end of an interval is halved, and a standard deviation for
what has none. [1]
"""


def check_options(loads: Sequence[float], speeds: Sequence[float], limits: Limits) -> None:
    """Reject a load, a speed or a limit that is none: OptionError."""
    stated = {
        f"--{name}-limit": [limit]
        for name in LIMITED
        if (limit := getattr(limits, name)) != math.inf
    }
    for option, numbers in {"--loads": loads, "--speeds": speeds, **stated}.items():
        require_positive(option, numbers)


def design(
    posterior: RigPosterior,
    tested: Tested,
    *,
    motion: Motion | None = None,
    sea: Sequence[tuple[float, float]] = (),
    loads: Sequence[float] = (),
    speeds: Sequence[float] = (),
    limits: Limits = NO_LIMITS,
) -> Design:
    """Design with a corrected rig.

    Parameters
    ----------
    motion : a cycle of the line, which other speeds make faster or slower; by default the usual
        cycle of the campaign
    sea : speeds of the payouts of a year with their numbers, over which repairs are valued; by
        default one cycle at the fastest speed
    loads, speeds : of the map; by default those of the campaign [ohm], and `SPEEDS` up to its
        fastest [m/s]
    limits : that no operating point may exceed; where the diagnosis found that the machine warms,
        also the current of its warmest run

    Raises
    ------
    OptionError : a load, a speed or a limit that is none
    """
    check_options(loads, speeds, limits)
    if tested.warm is not None:
        limits = msgspec.structs.replace(limits, heating=min(limits.heating, tested.warm))
    rig = CorrectedRig(posterior, tested)
    at_loads = sorted(loads) or list(tested.loads)
    if not at_loads:
        raise OptionError(f"{tested.title}: no run has a load; name some by --loads OHM,...")

    def cycle_at(speed: float) -> Motion:
        return (
            planned_cycle(speed, tested.length, tested.ramp)
            if motion is None
            else motion.at_speed(speed)
        )

    top = tested.speed if motion is None else motion.speed
    at_speeds = sorted(speeds) or np.linspace(SLOWEST * top, top, SPEEDS).tolist()
    rows = _map(rig, cycle_at, at_speeds, at_loads, limits)
    span = (at_speeds[0] if len(at_speeds) > 1 else SLOWEST * at_speeds[0], at_speeds[-1])
    searched = _searched(rig, cycle_at, span, at_loads)
    schedules = {criterion: _schedule(rig, searched, limits, criterion) for criterion in METRIC}
    fixed = schedules["efficiency"][1]
    load = at_loads[-1] if math.isnan(fixed) else fixed
    valued = [Share(cycle_at(speed), number) for speed, number in sea] or [
        Share(cycle_at(at_speeds[-1]))
    ]
    return Design(
        tested=tested,
        motion="usual cycle of the campaign" if motion is None else "motion as given",
        limits=limits,
        rows=tuple(rows),
        schedule=tuple(one for scheduled, _ in schedules.values() for one in scheduled),
        fixed={criterion: fixed for criterion, (_, fixed) in schedules.items()},
        repairs=tuple(
            sorted(
                (rig.worth(name, valued, load) for name in rig.causes),
                key=lambda one: -one.per_cycle.value,
            )
        ),
        repaired_at=load,
    )


def _map(
    rig: CorrectedRig,
    cycle_at: CycleAt,
    speeds: Sequence[float],
    loads: Sequence[float],
    limits: Limits,
) -> list[OperatingPoint]:
    """Every load at every speed, with bands."""
    paths = [rig.path(cycle_at(speed)) for speed in speeds]
    bands = rig.bands(paths, loads)
    best, rows = bands[0], []
    covered = rig.covers(paths, best)
    bands[:, :, :, PLACE["rpm"]] = best[:, :, PLACE["rpm"]]
    for i, speed in enumerate(speeds):
        for j, load in enumerate(loads):
            values = {name: Band(*bands[:, i, j, k].tolist()) for name, k in PLACE.items()}
            exceeded = tuple(limits.exceeded(best[i, j]))
            rows.append(OperatingPoint(load, speed, values, bool(covered[i, j]), exceeded))
    return rows


class Searched(NamedTuple):
    """Loads that are tried in bands of line speed: ends of the bands, (n + 1,) [m/s], the motion in
    the middle of each, the loads, (k,) [ohm], and their quantities in the middle and at the fast
    end, (n, k, quantities).
    """

    edges: Signal
    paths: list[Path]
    loads: Signal
    middle: Signal
    end: Signal


def _searched(
    rig: CorrectedRig, cycle_at: CycleAt, span: tuple[float, float], loads: Sequence[float]
) -> Searched:
    """Try loads between the smallest and the largest of some [ohm] in bands of a span of line
    speed [m/s].
    """
    model, edges = rig.moved[0], np.linspace(*span, BANDS + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    paths, fastest = (
        [rig.path(cycle_at(float(speed))) for speed in speeds] for speeds in (middles, edges[1:])
    )
    tried = np.geomspace(min(loads), max(loads), CANDIDATES if len(set(loads)) > 1 else 1)
    middle, end = (points([model], each, tried.tolist())[0] for each in (paths, fastest))
    return Searched(edges, paths, tried, middle, end)


def _schedule(
    rig: CorrectedRig, searched: Searched, limits: Limits, criterion: Criterion
) -> tuple[list[Scheduled], float]:
    """The best load in the middle of each band, allowed up to its end, and the best fixed load
    of all bands [ohm].
    """
    model, metric = rig.moved[0], PLACE[METRIC[criterion]]
    edges, paths, candidates, found, reached = searched
    middles = 0.5 * (edges[1:] + edges[:-1])
    allowed = np.array([[not limits.exceeded(one) for one in row] for row in reached])
    values = np.where(allowed, found[:, :, metric], -math.inf)
    usable = allowed.any(axis=1)  # a band without an allowed load has no fixed one either
    in_all = np.where(
        allowed[usable].all(axis=0) & usable.any(), found[usable, :, metric].sum(axis=0), -math.inf
    )
    fixed = float(candidates[int(np.argmax(in_all))])
    rpm = model.drivetrain.gear / model.winch.r_drum * RPM
    scheduled = []
    for k, path in enumerate(paths):
        ends = float(edges[k] * rpm), float(edges[k + 1] * rpm)
        if not allowed[k].any():
            which = ", ".join(limits.exceeded(reached[k, -1]))
            scheduled.append(
                Scheduled(
                    *ends,
                    float(middles[k]),
                    criterion,
                    None,
                    None,
                    False,
                    False,
                    f"every load exceeds the {which} limit",
                )
            )
            continue
        load = largest_at(candidates, values[k])
        inside = bool(rig.covers([path], points([model], [path], [load])[0]).all())
        gain: tuple[Band | None, bool] = None, False
        if np.isfinite(in_all).any():
            gain = rig.gain(path, load, fixed, METRIC[criterion])
        scheduled.append(
            Scheduled(*ends, float(middles[k]), criterion, load, gain[0], inside, gain[1])
        )
    return scheduled, fixed if np.isfinite(in_all).any() else math.nan
