"""Relations between the channels of a log and its motion: at which lag each channel follows what it
depends on.

Every relation is a law y = f(x) without a fitted model of the machine. Displacement is the integral
of the velocity. The generator voltage is a function of the speed of the rotor. Torque, and a line
tension without one, is such a function and the acceleration times an inertia: that of the rotor,
and that of the charge in the DC capacitor. Line tension follows the torque, and the current the
voltage. The rotor is behind the line by the twist of the loaded shaft, and Vdc by R C of its
source."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.integrate import largest, median_and_error
from winchcascade.core.quantity import TURN
from winchcascade.core.run import Mask
from winchcascade.ingest.checks.witnesses import SETTLES
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.checks.shifted_fit import (
    Known,
    Payouts,
    Sums,
    on_grids,
    rate_of,
    shifted,
    sums_of,
)
from winchcascade.reduction.efficiency import SMALLEST
from winchcascade.reduction.reduction_result import Relation

WIDE = 2.0
"""Half width of a 95 % interval in standard uncertainties (GUM G.6.6). [1]"""

REACH = 4.0
"""Largest lag that is sought, as a share of the width that smooths the velocity, as all times here:
half of a payout of two ramps and a plateau, each of some widths, stays compared. [1]"""

TIME_CONSTANT = SETTLES / 5.0
"""Largest time constant of a rotor on its shaft, or of a DC link: five of them pass before powers
have settled. [1]"""

UNKNOWN_MACHINE = TIME_CONSTANT * math.sqrt(2.0 / 3.0)
"""Standard uncertainty of a delay where the rig file lacks stiffness of the shaft or DC capacitor:
two time constants, each anywhere from nothing to the largest. [1]"""

OF_DELAY = 0.25
"""Standard uncertainty of a delay by physics, as a share of it: 10 % of the capacitor, and a
commutation that grows with the speed from nothing, taken at top speed (0.5 / sqrt(12), and as much
for the ramps). [1]"""

OF_INERTIA = 0.15
"""Standard uncertainty of an inertia of the rig file in a law: 10 % of the capacitor and its source
beside the rotor, line and chain beside the drum. A log that contradicts it is fitted without. [1]"""

CUT_OFF = 0.1
"""Share of a braking in which the bridge may be cut off. The back-EMF falls with the speed, evenly
over a braking of time T, and Vdc at most by its own size over R C: the bridge cuts off where R C / T
of the speed are left. [1]"""

HOLDS = 0.03
"""A law holds if the standard deviation of the residual is less than this share of the range of the
channel. White noise alone has at least a sixth of its range. Of 196 fits in clean logs of drawn
machines nine in ten leave less than 0.02, and none between that and 0.03; the others ring, or their
clutch is open. [1]"""

SAME_TIME = TIME_CONSTANT
"""Smallest lag that is reported: a smaller one may be a time constant that the rig file does not
state. [1]"""

INERTIA = 1.5 * TIME_CONSTANT
"""The same of torque and tension behind the motion, which an inertia moves, too: the rotor of the
paper turns 24 ms of torque ahead at 18 ohm, and 39 ms at 36 ohm. [1]"""

ENGAGEMENT = 0.02
"""Standard uncertainty of the lag of torque or tension behind the motion, as a share of the width
that smooths the velocity: their acceleration has one weight in the law, and the inertia of rotor,
mesh and capacitor changes with the current. Without it, the lags of 34 logs of the shipped and the
labelled campaigns, whose channels share one clock, have 0.019 (rms). The lags of the other laws are
below the uncertainties of their fits, there and in 60 logs of drawn machines. [1]"""


class Law(NamedTuple):
    """One row of the table: y, x, name of the law, its columns, how many of these are no motion,
    what it leaves out as a share of the range of y [1], the least lag that is reported [1], the
    standard uncertainty of a lag beyond that of the fit [1], and whether x is the speed of the
    rotor."""

    y: str
    x: str
    law: str
    columns: tuple[str, ...]
    beside: int = 0
    left_out: float = 0.0
    least: float = SAME_TIME
    u: float = 0.0
    rotor: bool = False


CUBIC = 0.004
"""What a cubic leaves out of torque or voltage, as a share of their range: 0.00015 of the paper's
machine at any load in a slow ramp, and room for what its model leaves out, such as flux that rolls
off with the current. [1]"""

SPEED = ("v", "v2", "v3")

LAWS = (
    Law("displacement", "velocity", "integral", ("time", "travel"), beside=1),
    Law("vdc", "velocity", "speed", SPEED, left_out=CUBIC, rotor=True),
    Law("idc", "vdc", "load", ("vdc",)),
    Law("torque", "velocity", "engagement", (*SPEED, "a"), left_out=CUBIC, least=INERTIA, u=ENGAGEMENT, rotor=True),
    Law("force", "torque", "transmission", ("rest", "friction", "torque", "torque2", "a"), beside=1, left_out=CUBIC),
    Law(
        "force", "velocity", "engagement", ("rest", "friction", *SPEED, "a"),
        beside=1, left_out=CUBIC, least=INERTIA, u=ENGAGEMENT, rotor=True,
    ),
)  # fmt: skip
"""The table. Of two rows with the same y the first one counts whose x the log has."""

OF_TORQUE = next(law for law in LAWS if law.y == "torque")
"""The row that is estimated first: the twist of the shaft is in proportion to the torque."""


def relations_of(log: PhasedLog) -> tuple[Relation, ...]:
    """Estimate the relations of a log once, over the checked payouts whose onset it holds."""
    found: dict[str, Relation] = {}
    payouts = payouts_of(log) if log.rig.phases.by_motion else None
    if payouts is None:
        return ()
    twisted, laws = (
        _twist(log, payouts, 0.0),
        [law for law in LAWS if {law.y, law.x} <= payouts.signals.keys()],
    )
    first = list({law.y: law for law in reversed(laws)}.values())
    sums = _sums(log, payouts, first, payouts.inside)
    torque = _estimate(log, payouts, sums, OF_TORQUE, known=twisted)
    # Its rate is that of another time, if the lag is more than its own uncertainty.
    if twisted and (torque is None or abs(torque.lag) > max(payouts.step, WIDE * torque.u)):
        twisted = torque is not None
        _twist(log, payouts, torque.lag if torque is not None else None)
        sums = _sums(log, payouts, first, payouts.inside)
        torque = _estimate(log, payouts, sums, OF_TORQUE, known=twisted)
    for law in laws:
        if law.y not in found:
            of_law = sums if law in sums else _sums(log, payouts, [law], payouts.inside)
            relation = (
                torque if law is OF_TORQUE else _estimate(log, payouts, of_law, law, known=twisted)
            )
            if relation is not None:
                found[law.y] = relation
    return tuple(found.values())


def _sums(log: PhasedLog, payouts: Payouts, laws: Sequence[Law], inside: Mask) -> dict[Law, Sums]:
    """Sums of some laws over the points inside."""
    if not laws:
        return {}
    reach = REACH * log.rig.thresholds.smoothing
    return dict(
        zip(
            laws,
            sums_of(payouts, [(law.y, law.columns) for law in laws], inside, reach),
            strict=True,
        )
    )


def _twist(log: PhasedLog, payouts: Payouts, late: float | None) -> bool:
    """Give the rotor laws the speed of the rotor: that of the line without the rate at which the
    loaded shaft winds up. False where torque or stiffness of the shaft are unknown.

    Parameters
    ----------
    late : by which the torque was recorded late [s]; None where that is unknown, and the rotor
        turns with the line
    """
    stiffness, radius, torque = (
        log.rig.drivetrain.k_shaft,
        log.rig.r_drum,
        payouts.signals.get("torque"),
    )
    rotor, known = (
        payouts.signals["velocity"],
        torque is not None and stiffness is not None and radius is not None,
    )
    if torque is not None and stiffness is not None and radius is not None and late is not None:
        points = np.arange(torque.shape[1])
        placed = (
            np.array([np.interp(points + late / payouts.step, points, row) for row in torque])
            if late
            else torque
        )
        rotor = rotor - radius / stiffness.value * rate_of(placed, payouts.step)
    acceleration = rate_of(rotor, payouts.step)
    payouts.signals.update(
        {"v": rotor, "v2": rotor * rotor, "v3": rotor * rotor * rotor, "a": acceleration}
    )
    return known


def late(log: PhasedLog, relations: Sequence[Relation]) -> Iterator[Fault]:
    """Channels that were recorded late, each with those that share its lag; no channel is shifted.

    A lag of the velocity behind the displacement is taken out of what follows it.
    """
    known = {r.y: r for r in relations}
    motion = known.get("displacement")
    moved = motion.lag if motion is not None and motion.deviates else 0.0
    spans = [(c.onset, c.payout_end) for c in (log.phased.cycles[k] for k in log.phased.chosen())]
    for relation in relations:
        partner = relation.law in ("integral", "load", "transmission")
        lag = relation.lag - (0.0 if partner else moved)
        if not msgspec.structs.replace(relation, lag=lag).deviates:
            continue
        behind, early = (
            (relation.y, relation.x) if lag > 0.0 or not partner else (relation.x, relation.y)
        )
        group = [r.y for r in relations if r.x == behind and not r.deviates and not partner]
        values = {
            "group": " and ".join([behind, *group]),
            "early": early,
            "seconds": abs(lag),
            "side": "behind" if partner or lag > 0.0 else "ahead of",
            "u": relation.u,
            "low": abs(lag) - WIDE * relation.u,
            "high": abs(lag) + WIDE * relation.u,
            "least": relation.least,
        }
        yield Fault("late", behind, spans, values)


def payouts_of(log: PhasedLog) -> Payouts | None:
    """The payouts on their grids, with all that the laws need; in open circuit up to the braking,
    where the clutch opens. None where the log holds no velocity, or no onset."""
    phased, run, width, idle = log.phased, log.run, log.rig.thresholds.smoothing, log.idles
    names = (
        "velocity",
        "displacement",
        "torque",
        "force",
        "pressure",
        *(() if idle else ("vdc", "idc")),
    )
    spans = []
    for k in phased.chosen() if "velocity" in run.channels else ():
        cycle, plateau = phased.cycles[k], phased.plateaus[k]
        if not cycle.begins_inside:
            braking = plateau.braking if plateau is not None else cycle.payout_end
            spans.append((cycle.onset, braking, braking if idle else cycle.payout_end))
    channels = {name: run.channels[name] for name in names if name in run.channels}
    payouts = on_grids(run.t, channels, np.array(spans), REACH * width, width) if spans else None
    if payouts is not None:
        _complete(payouts, log.rig.thresholds.v_onset)
    return payouts


def _complete(payouts: Payouts, v_onset: float) -> None:
    """Add what laws are made of: that of a rotor that turns with the line, travel, square of the
    torque, and what a line at rest depends on.

    Parameters
    ----------
    v_onset : speed at which a payout begins [m/s]
    """
    s, v = payouts.signals, payouts.signals["velocity"]
    s["time"] = payouts.t
    s["friction"] = v / (
        np.abs(v) + v_onset
    )  # of the restoring module, which reverses at the onset
    s["travel"] = (np.cumsum(v, axis=1) - 0.5 * v) * payouts.step
    if "displacement" in s:  # from where the line is at the onset
        onset = payouts.inside.argmax(axis=1)[:, None]
        s["travel"] += np.take_along_axis(s["displacement"] - s["travel"], onset, axis=1)
    s["rest"] = s[next(name for name in ("pressure", "displacement", "time") if name in s)]
    if "torque" in s:
        s["torque2"] = s["torque"] ** 2


def _estimate(
    log: PhasedLog, payouts: Payouts, sums: Mapping[Law, Sums], law: Law, *, known: bool
) -> Relation | None:
    """Lag of one relation; None where its channel is noise, or follows the law at no lag."""
    width = log.rig.thresholds.smoothing
    machine = {"torque", "vdc"} & log.run.channels.keys()
    if law not in sums or (
        law.rotor and not machine
    ):  # a winch that reels by its own motor sets the tension before it moves
        return None
    inertia = INERTIAS[law.y, law.law](log) if (law.y, law.law) in INERTIAS else None
    reach = REACH * width
    shift = None
    held = law.rotor and _holds_voltage(log)
    for inside in (payouts.unbraked,) if held else (payouts.inside, payouts.unbraked):
        if inside is payouts.unbraked:  # the clutch opens in the braking, and the rotor runs on
            sums = _sums(log, payouts, [law], inside)
        shift = shifted(
            sums[law], payouts.step, beside=law.beside, left_out=law.left_out, known=inertia
        )
        if shift is not None and shift.misfit < HOLDS:
            break
    if shift is None or shift.misfit > HOLDS or abs(shift.lag) > reach - payouts.step:
        return None
    delay, u = _delay(log, law.y, known=known) if law.rotor else (0.0, 0.0)
    interval = 1.0 / log.run.fs
    u_sampled = interval / math.sqrt(12.0) * min(interval / max(log.ramp, SMALLEST), 1.0)
    u_law, least = math.hypot(u, law.u * width, u_sampled), max(law.least * width, interval)
    gain, u_gain = _gain(log, law)
    return Relation(
        law.y,
        law.x,
        law.law,
        shift.lag - delay,
        math.hypot(shift.u, u_law),
        u_law,
        least,
        gain,
        u_gain,
    )


def _gain(log: PhasedLog, law: Law) -> tuple[float | None, float | None]:
    """Travel of the displacement over that of the velocity, or Idc over Vdc / R, and its standard
    uncertainty; else None."""
    load, motion = log.run.load, log.motion_gain
    if law.law == "integral" and motion is not None:
        return 1.0 / motion.gain, motion.u_gain / motion.gain**2
    if law.law == "load" and load is not None and log.points.spans:
        v_dc, i_dc = log.points.mean
        return median_and_error(i_dc * load / v_dc)
    return None, None


def _of_rotor(log: PhasedLog) -> Known | None:
    """Torque per acceleration of the line: of the rotor, and of the charge of the DC capacitor;
    None where unknown.

    The current that charges the capacitor takes the torque that the load takes for the same
    current."""
    train, radius, capacity = log.rig.drivetrain, log.rig.r_drum, log.rig.dc_link.c_dc
    if train.inertia_rotor is None or train.gear_ratio is None or radius is None:
        return None
    mesh = train.eta_mesh.value if train.eta_mesh is not None else 1.0
    weight = train.inertia_rotor.value * train.gear_ratio.value**2 / radius / mesh
    volts, amperes = (log.run.channels.get(name) for name in ("vdc", "idc"))
    if capacity is not None and volts is not None and not log.idles and amperes is not None:
        per_ampere = largest(log.run.channels["torque"]) / max(largest(amperes), SMALLEST)
        weight += capacity.value * largest(volts) / log.top_speed * per_ampere
    return Known(weight, OF_INERTIA * weight)


def _of_drum(log: PhasedLog) -> Known | None:
    """Line tension per acceleration of the line by the inertia of the drum; None where that is
    unknown."""
    inertia, radius = log.rig.winch.inertia, log.rig.r_drum
    if inertia is None or radius is None or inertia.value <= 0.0:
        return None
    weight = inertia.value / radius**2
    return Known(weight, OF_INERTIA * weight)


INERTIAS = {("torque", "engagement"): _of_rotor, ("force", "transmission"): _of_drum}
"""What the weight of the acceleration is in a law."""


def _delay(log: PhasedLog, channel: str, *, known: bool) -> tuple[float, float]:
    """Delay of a channel behind the rotor by the charge of the capacitor, and its uncertainty, to
    which a rotor that rings adds what it may be behind the line. [s]"""
    delay, resistance, capacity = 0.0, _source(log), log.rig.dc_link.c_dc
    if channel == "vdc":
        known = known and capacity is not None and resistance is not None
        if capacity is not None and resistance is not None:
            delay = capacity.value * resistance
    rings = 0.0 if log.rotor_frequency is None else log.overshoot / log.rotor_frequency
    unknown = not known or log.idles
    machine = UNKNOWN_MACHINE * log.rig.thresholds.smoothing if unknown else OF_DELAY * delay
    return delay, math.hypot(machine, rings)


def _holds_voltage(log: PhasedLog) -> bool:
    """Whether the capacitor holds its voltage in more than a share of the shortest braking, while
    the bridge is cut off."""
    capacity, load = log.rig.dc_link.c_dc, log.run.load
    if capacity is None or load is None or log.idles:
        return False
    brakings = [
        cycle.payout_end - plateau.braking
        for cycle, plateau in zip(log.phased.cycles, log.phased.plateaus, strict=True)
        if plateau is not None
    ]
    return load * capacity.value > CUT_OFF * min(brakings, default=math.inf)


def _source(log: PhasedLog) -> float | None:
    """Resistance of machine, bridge and load that charges the capacitor: copper, commutation, and
    load beside them. [ohm]"""
    machine, radius, gear = log.rig.generator, log.rig.r_drum, log.rig.drivetrain.gear_ratio
    if (
        machine.r_s is None
        or machine.l_s is None
        or machine.pole_pairs is None
        or radius is None
        or gear is None
    ):
        return None
    omega = log.top_speed / radius * gear.value * machine.pole_pairs.value
    source = 2.0 * machine.r_s.value + 6.0 / TURN * omega * machine.l_s.value
    load = log.run.load
    return source if load is None or math.isinf(load) else source * load / (source + load)
