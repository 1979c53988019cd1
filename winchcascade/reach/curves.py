"""How each efficiency of a table follows one field of a suspect: simulated at a few values, interpolated between."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Protocol

import msgspec
import numpy as np

from winchcascade.diagnose.suspects import Freedom, Suspect, freedom, with_values

if TYPE_CHECKING:
    from winchcascade.reach.bench import Bench
    from winchcascade.run import Signal

BEYOND = 4.0
"""Values are looked at up to this many times the plausible ones, where that is possible at all. [1]"""

NODES = (1.0, 0.5, 2.0, BEYOND)
"""Where a field is simulated, as shares of the way from absent to the end of what is plausible; the end itself first. [1]"""

FEW_NODES = (1.0, 2.0)
"""The same for each field of a suspect that has several: they are simulated together where it matters."""

SILENT = 2e-4
"""An effect that moves no efficiency by more than this at the end of what is plausible says nothing here. [1]"""

HELPS = 0.9
"""An effect is looked at beyond what is plausible if it leaves less than this share of what is out of reach, but some. [1]"""

GRID = 400
"""Intervals that a curve is laid out on."""


class Bounded(Suspect, Protocol):
    """A suspect that also says outside of which range a field has no physical meaning."""

    possible: ClassVar[dict[str, tuple[float, float]]]


Catalogue = Mapping[str, type[Bounded]]


class Curve(msgspec.Struct, frozen=True):
    """Efficiencies over one field, the others absent.

    `x` (n,) are even values, `ratio` (n, rows, 3) the logarithms of the efficiencies over those without the effect, `absent` is
    the value without it.
    """

    x: Signal
    ratio: Signal
    absent: float

    def at(self, values: Signal) -> Signal:
        """Logarithmic ratio at some values of the field, (n, rows, 3)."""
        place = np.clip((values - self.x[0]) / (self.x[1] - self.x[0]), 0.0, self.x.size - 1.0)
        before = np.minimum(place.astype(np.intp), self.x.size - 2)
        share = (place - before)[:, None, None]
        ratio: Signal = (1.0 - share) * self.ratio[before] + share * self.ratio[before + 1]
        return ratio

    def slope(self, value: float) -> Signal:
        """How the logarithmic ratio rises with the field at a value, (rows, 3)."""
        width = self.x[1] - self.x[0]
        before = min(max(int((value - self.x[0]) / width), 0), self.x.size - 2)
        rise: Signal = (self.ratio[before + 1] - self.ratio[before]) / width
        return rise


def field_curves(bench: Bench, kind: type[Bounded]) -> list[Curve | None]:
    """The curve of each field of a suspect, None for a field that alone moves nothing."""
    free = freedom(kind)
    return [_curve(bench, kind, free, k) for k in range(len(free.names))]


def reach_of(kind: type[Bounded]) -> tuple[Signal, Signal]:
    """Lowest and highest values that are looked at, (k,) each: `BEYOND` what is plausible, within what is possible."""
    free = freedom(kind)
    least, most = (np.array([kind.possible[name][end] for name in free.names]) for end in (0, 1))
    return (
        np.maximum(least, free.absent + BEYOND * (free.low - free.absent)),
        np.minimum(most, free.absent + BEYOND * (free.high - free.absent)),
    )


def _curve(bench: Bench, kind: type[Bounded], free: Freedom, k: int) -> Curve | None:
    nodes = {float(free.absent[k]): np.zeros(bench.printed.shape)}
    for end in (free.low[k], free.high[k]):
        if end != free.absent[k]:
            nodes |= _side(bench, kind, free, k, float(end))
    if len(nodes) == 1 or max(float(np.nanmax(np.abs(ratio))) for ratio in nodes.values()) < SILENT:
        return None
    from scipy.interpolate import PchipInterpolator

    at = np.array(sorted(nodes))
    x = np.linspace(at[0], at[-1], GRID + 1)
    ratio = PchipInterpolator(at, np.array([nodes[value] for value in at.tolist()]))(x)
    return Curve(x, ratio, float(free.absent[k]))


def _side(bench: Bench, kind: type[Bounded], free: Freedom, k: int, end: float) -> dict[float, Signal]:
    """Simulated nodes from absent to one end of what is plausible, and beyond it as long as that still may help."""
    found: dict[float, Signal] = {}
    helps, speeds = True, bench.speeds
    low, high = reach_of(kind)
    before = bench.excess_by_metric(bench.nominal)
    for share in NODES if len(free.names) == 1 else FEW_NODES:
        values = free.absent.copy()
        values[k] = min(max(values[k] + share * (end - values[k]), low[k]), high[k])
        if float(values[k]) in found:
            continue
        there = bent(bench, [with_values(kind, values)], bench.speeds + share * (speeds - bench.speeds))
        if there is None:
            continue
        eta, at = there
        ratio = np.where(np.isnan(bench.printed), 0.0, np.log(eta / bench.nominal))
        found[float(values[k])] = ratio
        if share == 1.0:
            speeds = at
            if float(np.max(np.abs(ratio))) < SILENT:
                break
        if share >= 1.0:
            after = bench.excess_by_metric(eta)
            helps = bool(np.any((after < HELPS * before) & (after > 0.0)))
        if share != 1.0 and not helps:
            break
    return found


def bent(bench: Bench, effects: Sequence[Suspect], speeds: Signal) -> tuple[Signal, Signal] | None:
    """Efficiencies with some effects, (rows, 3), and the speeds of the line; None where no model comes of them.

    Parameters
    ----------
    speeds : guesses, (rows,) [m/s]
    """
    model = bench.model
    for effect in effects:
        model = effect.bend(model)
    found = bench.efficiencies(model, speeds)
    return None if found is None or np.any(np.isnan(found[0]) & ~np.isnan(bench.printed)) else found
