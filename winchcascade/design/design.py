"""What a corrected rig gives at other loads and speeds, which load suits which speed, and what
each cause costs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.design.corrected_rig import CorrectedRig
from winchcascade.design.design_result import (
    LIMITED,
    METRIC,
    NO_LIMITS,
    Criterion,
    Design,
    Limits,
    OperatingPoint,
    Scheduled,
    Share,
)
from winchcascade.design.operating import (
    PLACE,
    Motion,
    Path,
    planned_cycle,
    points,
    require_positive,
)
from winchcascade.diagnosis.handover.posterior import Band, RigPosterior
from winchcascade.diagnosis.handover.tested import Tested
from winchcascade.rig.best_load import largest_at
from winchcascade.rig.physics import RPM

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

SPEEDS, SLOWEST = 7, 0.3
"""Number of line speeds of a map, and the slowest as a share of the fastest of the campaign. [1]"""

BANDS = 6
"""Number of bands of generator speed of a schedule."""

CANDIDATES = 41
"""Number of loads, evenly spaced in their logarithm, among which a schedule looks for the best;
between them by a parabola.
"""

CycleAt = Callable[[float], Motion]
"""A cycle of the line at a speed of its plateau. [m/s]"""


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
