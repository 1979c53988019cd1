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
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import CERTAIN, open_circuit_current
from winchcascade.core.integrate import largest, median_and_error, white_noise
from winchcascade.core.quantity import TURN
from winchcascade.core.run import Signal
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.checks.shifted_fit import Known, Payout, on_grid, shifted
from winchcascade.reduction.efficiency import SMALLEST
from winchcascade.reduction.reduction_result import Relation

WIDE = 2.0
"""Half width of a 95 % interval in standard uncertainties (GUM G.6.6). [1]"""

REACH = 4.0
"""Largest lag that is sought, as a share of the width that smooths the velocity, as all times here.
[1]"""


UNKNOWN_MACHINE = 7 / 60
"""The same where the rig file lacks stiffness of the shaft or DC capacitor: a rotor lags by up to
half of the width. [1]"""

OF_DELAY = 0.25
"""Standard uncertainty of a delay by physics, as a share of it. [1]"""

OF_INERTIA = 0.15
"""Standard uncertainty of the inertia of rotor and capacitor together: 10 % of the capacitor, and
its source. [1]"""

FOLLOWS = 0.1
"""A signal follows a law if the residual is less than this share of what its columns beside the
motion leave. [1]"""

OF_DRUM = 0.5
"""Standard uncertainty of the inertia between force cell and torque sensor: line and chain move
with the drum. [1]"""

HOLDS = 0.03
"""A law holds if the residual is less than this share of the range of the channel: a quarter of it
noise of the channel. [1]"""

SAME_TIME = 1 / 6
"""Smallest lag that is reported: energies change by more than 0.5 %. [1]"""

INERTIA = 1 / 4
"""The same of torque and tension behind the motion: an inertia of five times its stated value moves
them by a tenth. [1]"""


class Law(NamedTuple):
    """One row of the table: y, x, name of the law, its columns, how many of these are no motion,
    what it leaves out as a share of the range of y [1], the least lag that is reported [1], the
    standard uncertainty of a lag by what the law leaves out [1], and whether x is the speed of the
    rotor."""

    y: str
    x: str
    law: str
    columns: tuple[str, ...]
    beside: int = 0
    left_out: float = 0.0
    least: float = SAME_TIME
    u: float = 1 / 300
    rotor: bool = False


CUBIC = 0.004
"""What a cubic leaves out of torque or voltage of a machine with commutation, as a share of their
range. [1]"""

SPEED = ("v", "v2", "v3")

LAWS = (
    Law("displacement", "velocity", "integral", ("time", "travel"), beside=1),
    Law("vdc", "velocity", "speed", SPEED, left_out=CUBIC, u=1 / 120, rotor=True),
    Law("idc", "vdc", "load", ("vdc",)),
    Law("torque", "velocity", "engagement", (*SPEED, "a"), left_out=CUBIC, least=INERTIA, u=1 / 40, rotor=True),
    Law("force", "torque", "transmission", ("rest", "friction", "torque", "torque2", "a"), beside=1, left_out=CUBIC, u=1 / 120),
    Law(
        "force", "velocity", "engagement", ("rest", "friction", *SPEED, "a"),
        beside=1, left_out=CUBIC, least=INERTIA, u=1 / 40, rotor=True,
    ),
)  # fmt: skip
"""The table. Of two rows with the same y the first one counts whose x the log has."""


def relations_of(log: PhasedLog) -> tuple[Relation, ...]:
    """Estimate the relations of a log once, over the checked payouts whose onset it holds."""
    found: dict[str, Relation] = {}
    payouts = payouts_of(log) if log.rig.phases.by_motion else []
    twisted = _twist(log, payouts)
    for law in LAWS if payouts else ():
        if law.y not in found and {law.y, law.x} <= payouts[0].signals.keys():
            relation = _estimate(log, payouts, law, known=twisted)
            if relation is not None:
                found[law.y] = relation
    return tuple(found.values())


def _twist(log: PhasedLog, payouts: Sequence[Payout]) -> bool:
    """Give the rotor laws the speed of the rotor: that of the line without the rate at which the
    loaded shaft winds up.

    The torque itself is placed by its own law first. False where torque or stiffness of the shaft
    are unknown."""
    stiffness, radius, width = log.rig.drivetrain.k_shaft, log.rig.r_drum, log.rig.thresholds.smoothing
    law = next(law for law in LAWS if law.y == "torque")
    if not payouts or "torque" not in payouts[0].signals or stiffness is None or radius is None:
        return False
    columns = [_columns(p, law) for p in payouts]
    shift = shifted(payouts, columns, "torque", reach=REACH * width, beside=0, left_out=CUBIC, known=_of_rotor(log))
    if shift is None or shift.residual > FOLLOWS:
        return False
    late = shift.lag - wound(log)
    for p in payouts:
        torque = np.interp(p.t + late, p.t, p.signals["torque"])
        _complete(
            p,
            p.signals["velocity"] - radius / stiffness.value * np.gradient(torque, p.step),
            log.rig.thresholds.v_onset,
        )
    return True


def idles(log: PhasedLog) -> bool:
    """Whether no load takes a current, so that the rotor runs on when the line slows down."""
    v_dc, i_dc = (log.run.channels.get(name) for name in ("vdc", "idc"))
    if v_dc is None or i_dc is None:
        return log.idle
    return log.run.open_circuit or largest(i_dc) <= open_circuit_current(log.rig, largest(v_dc))


def _columns(payout: Payout, law: Law) -> Signal:
    return np.array([payout.signals[name][payout.inside] for name in law.columns])


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
        behind, early = (relation.y, relation.x) if lag > 0.0 or not partner else (relation.x, relation.y)
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


def payouts_of(log: PhasedLog) -> list[Payout]:
    """The payouts on their grids, with all that the laws need; in open circuit up to the braking,
    where the clutch opens."""
    phased, run, width = log.phased, log.run, log.rig.thresholds.smoothing
    names = ("velocity", "displacement", "torque", "force", "pressure", *(() if idles(log) else ("vdc", "idc")))
    channels = {name: run.channels[name] for name in names if name in run.channels}
    found = []
    for k in phased.chosen() if "velocity" in channels else ():
        cycle, plateau = phased.cycles[k], phased.plateaus[k]
        if not cycle.begins_inside:
            braking = plateau.braking if plateau is not None else cycle.payout_end
            span = cycle.onset, braking, braking if idles(log) else cycle.payout_end
            payout = on_grid(run.t, channels, span, (REACH + 1.0) * width, width)
            if payout is not None and payout.inside.size:
                _complete(payout, payout.signals["velocity"], log.rig.thresholds.v_onset)
                found.append(payout)
    return found


def _complete(payout: Payout, rotor: Signal, v_onset: float) -> None:
    """Add what laws are made of: powers of the speed of the rotor and of the torque, acceleration,
    travel, and what a line at rest depends on.

    Parameters
    ----------
    rotor : (n,) its speed at the line [m/s]
    v_onset : speed at which a payout begins [m/s]
    """
    s, v = payout.signals, payout.signals["velocity"]
    s |= {"v": rotor, "v2": rotor**2, "v3": rotor**3, "a": np.gradient(rotor, payout.step), "time": payout.t}
    s["friction"] = v / (np.abs(v) + v_onset)  # of the restoring module, which reverses at the onset
    s["travel"] = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1])))) * payout.step
    s["rest"] = s[next(name for name in ("pressure", "displacement", "time") if name in s)]
    if "torque" in s:
        s["torque2"] = s["torque"] ** 2


def _estimate(log: PhasedLog, payouts: Sequence[Payout], law: Law, *, known: bool) -> Relation | None:
    """Lag of one relation; None where its channel is noise, or follows the law at no lag."""
    width = log.rig.thresholds.smoothing
    machine = {"torque", "vdc"} & log.run.channels.keys()
    if law.rotor and not machine:  # a winch that reels by its own motor sets the tension before it moves
        return None
    if any(np.ptp(p.signals[law.y]) < 2.0 * CERTAIN * white_noise(log.run.channels[law.y]) for p in payouts[:1]):
        return None
    inertia = INERTIAS[law.y, law.law](log) if (law.y, law.law) in INERTIAS else None
    reach = REACH * width
    shift = None
    for some in (payouts, [p._replace(inside=p.inside[: p.braking]) for p in payouts]):
        columns = [_columns(p, law) for p in some]
        shift = shifted(some, columns, law.y, reach=reach, beside=law.beside, left_out=law.left_out, known=inertia)
        if shift is not None and shift.misfit < HOLDS:
            break  # else the clutch opens in the braking, and the rotor runs on
    if shift is None or shift.residual > FOLLOWS or shift.misfit > HOLDS or abs(shift.lag) > reach - payouts[0].step:
        return None
    delay, u = _delay(log, law.y, known=known) if law.rotor else (0.0, 0.0)
    u_law, least = math.hypot(u, law.u * width), max(law.least * width, 1.0 / log.run.fs)
    gain, u_gain = _gain(log, payouts, law)
    return Relation(law.y, law.x, law.law, shift.lag - delay, math.hypot(shift.u, u_law), u_law, least, gain, u_gain)


def _gain(log: PhasedLog, payouts: Sequence[Payout], law: Law) -> tuple[float | None, float | None]:
    """Travel of the displacement over that of the velocity, or Idc over Vdc / R, and its standard
    uncertainty; else None."""
    ratios, load = np.empty(0), log.run.load
    if law.law == "integral":
        ends = [(p.inside[[0, -1]], p.signals) for p in payouts]
        ratios = np.array([np.ptp(s["displacement"][k]) / np.ptp(s["travel"][k]) for k, s in ends])
    elif law.law == "load" and load is not None and log.points.spans:
        v_dc, i_dc = log.points.mean
        ratios = i_dc * load / v_dc
    return median_and_error(ratios) if ratios.size else (None, None)


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
    if capacity is not None and volts is not None and not idles(log) and amperes is not None:
        per_ampere = largest(log.run.channels["torque"]) / max(largest(amperes), SMALLEST)
        weight += capacity.value * largest(volts) / largest(log.phased.v_smooth) * per_ampere
    return Known(weight, OF_INERTIA * weight)


def _of_drum(log: PhasedLog) -> Known | None:
    """Line tension per acceleration of the line by the inertia of the drum; None where that is
    unknown."""
    inertia, radius = log.rig.winch.inertia, log.rig.r_drum
    if inertia is None or radius is None or inertia.value <= 0.0:
        return None
    weight = inertia.value / radius**2
    return Known(weight, OF_DRUM * weight)


INERTIAS = {("torque", "engagement"): _of_rotor, ("force", "transmission"): _of_drum}
"""What the weight of the acceleration is in a law."""


def _delay(log: PhasedLog, channel: str, *, known: bool) -> tuple[float, float]:
    """Delay of a channel behind the rotor by the charge of the capacitor, and its uncertainty.
    [s]"""
    delay, resistance, capacity = 0.0, _source(log), log.rig.dc_link.c_dc
    if channel == "vdc":
        known = known and capacity is not None and resistance is not None
        delay = capacity.value * resistance if capacity is not None and resistance is not None else 0.0
    return delay, OF_DELAY * delay if known and not idles(log) else UNKNOWN_MACHINE * log.rig.thresholds.smoothing


def wound(log: PhasedLog) -> float:
    """Time by which the twist of the loaded shaft delays the generator, 0 where torque or shaft are
    unknown. [s]"""
    stiffness, radius, torque = log.rig.drivetrain.k_shaft, log.rig.r_drum, log.run.channels.get("torque")
    if stiffness is None or radius is None or torque is None:
        return 0.0
    return largest(torque) / stiffness.value * radius / largest(log.phased.v_smooth)


def _source(log: PhasedLog) -> float | None:
    """Resistance of machine, bridge and load that charges the capacitor: copper, commutation, and
    load beside them. [ohm]"""
    machine, radius, gear = log.rig.generator, log.rig.r_drum, log.rig.drivetrain.gear_ratio
    if machine.r_s is None or machine.l_s is None or machine.pole_pairs is None or radius is None or gear is None:
        return None
    omega = largest(log.phased.v_smooth) / radius * gear.value * machine.pole_pairs.value
    source = 2.0 * machine.r_s.value + 6.0 / TURN * omega * machine.l_s.value
    load = log.run.load
    return source if load is None or math.isinf(load) else source * load / (source + load)
