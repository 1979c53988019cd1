"""What effects do beyond changing the number of each field: laws of several numbers, and changes
from run to run.
"""

import math
import operator
from itertools import accumulate
from typing import TypedDict

from winchcascade.core.run import Signal
from winchcascade.core.scales import Scales
from winchcascade.rig.effects.effect import InRun, Law, Report, ScaledReport, Together, Values
from winchcascade.rig.effects.run_order import RunPlace, passed, warming
from winchcascade.rig.parts import Model, changed, rolloff_curve, with_part

SLOW = 5.0 / 3.0
"""Speed of the line at which the larger friction near standstill is reported, over that at which a
payout begins: logs show it there, but not at rest. [1]"""

AT_10_A = 10.0 / 5.16
"""Stator current at which the roll-off is reported, over the rated one: 10 A of the machine of
the paper. [1]
"""

LEAK = 1e-3
"""Share of the conductance of the bleed resistor that remains where a simulation has none. [1]"""


# -------------------------------------------------------------------------------------- generator
def share_at_knots(lost: Values) -> Values:
    """Share of k_e that remains at the stator currents of `ROLLOFF_KNOTS` beyond the first; it
    never rises. [1]

    >>> share_at_knots((0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5))
    (1.0, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.45)
    """
    return tuple(accumulate((1.0 - share for share in lost), operator.mul))


def share_of_k_e(lost: Values, current: Signal | float) -> Signal:
    """Share of k_e that remains at some stator currents over the rated one, by a monotone cubic
    between the knots. [1]
    """
    return rolloff_curve(share_at_knots(lost))(current)


def _rolled_off(model: Model, lost: Values) -> Model:
    rolloff = tuple(
        a * b for a, b in zip(model.generator.rolloff, share_at_knots(lost), strict=True)
    )
    return with_part(model, "generator", rolloff=rolloff)


def _lost_twice(first: Values, second: Values) -> Values:
    return tuple(1.0 - (1.0 - a) * (1.0 - b) for a, b in zip(first, second, strict=True))


def _left_at_10_a(lost: Values) -> float:
    return float(share_of_k_e(lost, AT_10_A))


def _warm_in_run(values: Values, place: RunPlace) -> Values:
    k_e, r_s, time_constant, by_current = values
    rise = warming(place.order, time_constant, by_current)[place.number]
    return k_e * rise, r_s * rise, time_constant, by_current


# ----------------------------------------------------------------------------------------- clutch
def _dragging(model: Model, values: Values) -> Model:
    shaft, (torque, share) = model.drivetrain, values
    clutch_drag, coast_drag = shaft.clutch_drag + torque, shaft.coast_drag + torque * share
    return with_part(model, "drivetrain", clutch_drag=clutch_drag, coast_drag=coast_drag)


def _dragging_more(first: Values, second: Values) -> Values:
    both = first[0] + second[0]
    return both, (first[0] * first[1] + second[0] * second[1]) / both if both else second[1]


# -------------------------------------------------------------------------------------- line, gas
def _sticking(model: Model, values: Values) -> Model:
    """Add friction near standstill to line and seals; what the model has of it already fades at
    the mean of both speeds.
    """
    winch, gas, (torque, _, seals) = model.winch, model.restoring, values
    before = max(
        winch.stribeck + gas.stribeck, 0.0
    )  # below zero where a fit moves it within its tolerance
    _, speed, _ = _stickier((before, winch.stribeck_speed, 0.0), values)
    model = with_part(model, "restoring", stribeck=gas.stribeck + torque * seals)
    return with_part(
        model, "winch", stribeck=winch.stribeck + torque * (1.0 - seals), stribeck_speed=speed
    )


def _stickier(first: Values, second: Values) -> Values:
    """Two frictions near standstill together: torques add, speed and share of the seals by the
    share of each torque.
    """
    both = first[0] + second[0]
    share = second[0] / both if both > 0.0 else 0.0
    return both, *(a + share * (b - a) for a, b in zip(first[1:], second[1:], strict=True))


def _at_slow_speed(scales: Scales, values: Values) -> float:
    torque, speed, _ = values
    return torque * math.exp(-((SLOW * scales.onset / speed) ** 2))


def _heated(model: Model, values: Values) -> Model:
    """Raise the exponent; where the gas of the model heats already, it cools by the mean of both
    times.
    """
    exponent, cooling = hotter((model.restoring.exponent, model.restoring.cooling), values)
    return with_part(model, "restoring", exponent=exponent, cooling=cooling)


def hotter(first: Values, second: Values) -> Values:
    """Exponent [1] and cooling [s] of two heats of a gas together: exponents add, times by the
    share of each.

    >>> hotter((1.25, 4.0), (1.25, 8.0)), hotter((1.2, 4.0), (1.0, 6.0))
    ((1.5, 6.0), (1.2, 4.0))
    """
    (n, cooling), (more, other) = first, second
    both = n - 1.0 + more - 1.0
    share = (more - 1.0) / both if both > 0.0 else 1.0
    return n + (more - 1.0), cooling + share * (other - cooling)


def _leaked_in_run(values: Values, place: RunPlace) -> Values:
    return (values[0] * passed(place.order)[place.number],)


# ----------------------------------------------------------------- wrong entries, simplifications
def _ratio(values: Values) -> float:
    return 1.0 + values[0]


def shared_radius(model: Model, values: Values) -> Model:
    """Another radius with which the logger computes the motion too: the angle of the drum stays."""
    other = changed(model, "winch.r_drum", "scale", values[0])
    return changed(other, "sensors.motion_scale", "compound", 1.0 / (1.0 + values[0]) - 1.0)


def _without_bleed(model: Model, values: Values) -> Model:
    return with_part(model, "dc_link", r_bleed=model.dc_link.r_bleed / max(1.0 - values[0], LEAK))


def _isothermal(model: Model, values: Values) -> Model:
    exponent = model.restoring.exponent
    return with_part(model, "restoring", exponent=exponent - values[0] * (exponent - 1.0))


class Acts(TypedDict, total=False):
    """Functions of an effect, as `Effect` has them."""

    law: Law
    together: Together
    reported_from: Report
    reported_at: ScaledReport
    over_runs: InRun


ACTS: dict[str, Acts] = {
    "ke_rolloff": {"law": _rolled_off, "together": _lost_twice, "reported_from": _left_at_10_a},
    "heating": {"over_runs": _warm_in_run},
    "clutch_drag": {"law": _dragging, "together": _dragging_more},
    "stribeck": {"law": _sticking, "together": _stickier, "reported_at": _at_slow_speed},
    "gas_polytropic": {"law": _heated, "together": hotter},
    "gas_loss": {"over_runs": _leaked_in_run},
    "encoder_scale": {"reported_from": _ratio},
    "k_e_convention": {"reported_from": _ratio},
    "r_s_convention": {"reported_from": _ratio},
    "l_s_convention": {"reported_from": _ratio},
    "no_bleed": {"law": _without_bleed},
    "isothermal_gas": {"law": _isothermal},
}
"""Functions of the effects that have any, by name."""
