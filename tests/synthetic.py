"""Logs of invented payouts with a noise-free truth, written from the contract alone and from no
code of the package.

A `Scenario` becomes a `Motion` (exact velocity on a clock of 1 ms), the motion becomes `Signals`
(exact channels), the signals become a log (sampled, noisy, rounded) and, by the contract's words, a
`Truth`.

>>> scenario = SCENARIOS["smooth"]
>>> log = make_log(scenario, np.random.default_rng(1))
>>> len(truth(scenario).cycles)
3
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Signal = NDArray[np.float64]
Law = Callable[[Signal], tuple[Signal, Signal]]
"""Times since the start of a piece [s] to velocity [m/s] and acceleration [m/s2]."""
Phase = Literal["rest", "payout", "hold", "haul_in"]
Rule = Literal["auto", "payout"] | float
Place = tuple[Phase, int, float]
"""A moment: a phase, the number of its cycle from 0, and the part of the phase that has passed."""

STEP = 0.001
"""Of the noise-free clock [s]."""
ONSET_SPEED = 0.03
SMOOTHING_SAMPLES, SMOOTHING_RATE = 15, 25.0
"""A local quadratic over 15 samples of 40 ms: 0.6 s."""
REACH = 0.5 * SMOOTHING_SAMPLES / SMOOTHING_RATE + 0.05
"""How far beyond a phase its smoothed threshold can lie [s]; what smoothing does farther away
belongs to others.
"""


# ---------------------------------------------------------------------------- scenario and motion
@dataclass(frozen=True, slots=True)
class Scenario:
    """What the crane does and how it is logged; SI units, ramps as (shape, seconds), payouts as
    (travel, speed).

    `noise` and `zeros` scale the noise and the zero errors of all sensors; without noise a log is
    exact.
    """

    payouts: tuple[tuple[float, float], ...] = ((9.6, 0.86), (9.6, 0.85), (9.6, 0.83))
    ramp: tuple[str, float] = ("smoothstep", 4.0)
    brake: tuple[str, float] = ("smoothstep", 1.4)
    haul_speed: float = 1.25
    haul_ramp: tuple[str, float] = ("smoothstep", 1.4)
    haul_brake: tuple[str, float] = ("smoothstep", 0.7)
    rest: float = 5.0
    hold: float = 6.0
    idle: float = 0.0
    creep_rest: float = 0.0
    creep_hold: float = 0.0
    stop: float = 0.0
    reversal: float = 0.0
    interrupted_at: float = 0.5
    wave: float = 0.0
    wave_period: float = 3.0
    begin: Place | None = None
    end: Place | None = None
    load: float = 36.0
    rate: float = 25.0
    jitter: float = 0.0
    noise: float = 1.0
    zeros: float = 1.0
    clock_start: float = 0.0
    window: float = 5.0


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of motion under one law."""

    phase: Phase
    cycle: int
    law: Law
    duration: float


@dataclass(frozen=True, slots=True)
class Span:
    """The stretch [s] that the crane means as one phase: where a threshold is looked for, never
    its instant.
    """

    phase: Phase
    cycle: int
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Motion:
    """Noise-free motion: nodes 1 ms apart, farther apart only in long idling; t [s], x [m], v
    [m/s], a [m/s2].
    """

    t: Signal
    x: Signal
    v: Signal
    a: Signal
    spans: tuple[Span, ...]


def steady(v: float) -> Law:
    """Move at a constant velocity [m/s]."""
    return lambda s: (np.full_like(s, v), np.zeros_like(s))


def wavy(v: float, part: float, period: float) -> Law:
    """Wave slowly about a velocity [m/s] by a part of it [1]."""
    w = 2 * np.pi / period
    return lambda s: (v * (1 + part * np.sin(w * s)), v * part * w * np.cos(w * s))


def linear(v0: float, v1: float, seconds: float) -> Law:
    """Change velocity [m/s] at a constant rate: a kink at both ends."""
    slope = (v1 - v0) / seconds
    return lambda s: (v0 + slope * s, np.full_like(s, slope))


def smoothstep(v0: float, v1: float, seconds: float) -> Law:
    """Change velocity [m/s] by 3 u^2 - 2 u^3."""

    def law(s: Signal) -> tuple[Signal, Signal]:
        u = s / seconds
        return v0 + (v1 - v0) * u**2 * (3 - 2 * u), (v1 - v0) / seconds * 6 * u * (1 - u)

    return law


def minimum_jerk(v0: float, v1: float, seconds: float) -> Law:
    """Change velocity [m/s] by 10 u^3 - 15 u^4 + 6 u^5."""

    def law(s: Signal) -> tuple[Signal, Signal]:
        u = s / seconds
        return v0 + (v1 - v0) * u**3 * (10 - 15 * u + 6 * u**2), (v1 - v0) / seconds * 30 * u**2 * (
            1 - u
        ) ** 2

    return law


def lag(v0: float, v1: float, seconds: float) -> Law:
    """Approach a velocity [m/s] with a first-order lag of one eighth of the duration."""
    tau = seconds / 8

    def law(s: Signal) -> tuple[Signal, Signal]:
        left = np.exp(-s / tau)
        return v1 + (v0 - v1) * left, (v1 - v0) / tau * left

    return law


RAMPS: Mapping[str, Callable[[float, float, float], Law]] = {
    "linear": linear,
    "smoothstep": smoothstep,
    "minimum_jerk": minimum_jerk,
    "lag": lag,
}


def nodes(duration: float) -> Signal:
    """Place the nodes of a piece, its end excluded [s]: 1 ms, and 1 s in the middle of a stretch
    above 60 s.
    """
    if duration <= 60:
        return np.arange(round(duration / STEP), dtype=np.float64) * STEP
    return np.concatenate(
        (nodes(20.0), np.arange(20.0, duration - 20.0), duration - 20.0 + nodes(20.0))
    )


def travel(pieces: Sequence[Piece]) -> float:
    """Integrate the velocity over pieces [m]."""
    total = 0.0
    for piece in pieces:
        s = np.append(nodes(piece.duration), piece.duration)
        total += float(np.trapezoid(piece.law(s)[0], s))
    return total


def velocity_at(law: Law, seconds: float) -> float:
    """Give the velocity some time after the start of a piece [m/s]."""
    return float(law(np.array([seconds]))[0][0])


def ramp(phase: Phase, cycle: int, shape: tuple[str, float], v0: float, v1: float) -> Piece:
    """Make a ramp between two velocities [m/s]."""
    return Piece(phase, cycle, RAMPS[shape[0]](v0, v1, shape[1]), shape[1])


def interruption(scenario: Scenario, cycle: int, before: float, after: float) -> list[Piece]:
    """Make the stop or the short reversal in mid-payout between two velocities [m/s], if there
    is one.
    """
    if scenario.stop > 0:
        low, seconds = 0.0, scenario.stop
    elif scenario.reversal > 0:
        low, seconds = -0.2, scenario.reversal / 0.2
    else:
        return []
    return [
        ramp("payout", cycle, ("smoothstep", 1.0), before, low),
        Piece("payout", cycle, steady(low), round(seconds, 3)),
        ramp("payout", cycle, ("smoothstep", 1.2), low, after),
    ]


def payout(scenario: Scenario, cycle: int, length: float, speed: float) -> list[Piece]:
    """Make one payout of a length [m] at a speed [m/s]."""
    up = ramp("payout", cycle, scenario.ramp, scenario.creep_rest, speed)
    down = ramp("payout", cycle, scenario.brake, speed, scenario.creep_hold)
    middle = interruption(scenario, cycle, speed, speed)
    seconds = (length - travel([up, *middle, down])) / speed
    first = round(scenario.interrupted_at * seconds if middle else seconds, 3)
    law = wavy(speed, scenario.wave, scenario.wave_period)
    flat = [Piece("payout", cycle, law, first)]
    if middle:
        flat += interruption(scenario, cycle, velocity_at(law, first), speed)
        flat.append(Piece("payout", cycle, law, round(seconds - first, 3)))
    return [
        up,
        *flat,
        ramp(
            "payout",
            cycle,
            scenario.brake,
            velocity_at(law, flat[-1].duration),
            scenario.creep_hold,
        ),
    ]


def haul_in(scenario: Scenario, cycle: int, length: float) -> list[Piece]:
    """Make one haul-in of a length [m]."""
    speed = -scenario.haul_speed
    up = ramp("haul_in", cycle, scenario.haul_ramp, scenario.creep_hold, speed)
    down = ramp("haul_in", cycle, scenario.haul_brake, speed, scenario.creep_rest)
    seconds = (-length - travel([up, down])) / speed
    return [up, Piece("haul_in", cycle, steady(speed), round(seconds, 3)), down]


def pieces_of(scenario: Scenario) -> list[Piece]:
    """Lay out the whole motion."""
    pieces = [Piece("rest", -1, steady(scenario.creep_rest), scenario.rest)]
    for cycle, (length, speed) in enumerate(scenario.payouts):
        outward = payout(scenario, cycle, length, speed)
        outward.append(Piece("hold", cycle, steady(scenario.creep_hold), scenario.hold))
        last = cycle == len(scenario.payouts) - 1
        seconds = scenario.rest + (0.0 if last else scenario.idle)
        pieces += [*outward, *haul_in(scenario, cycle, travel(outward))]
        pieces.append(Piece("rest", cycle, steady(scenario.creep_rest), seconds))
    return pieces


def spans_of(pieces: Sequence[Piece]) -> tuple[Span, ...]:
    """Join neighbouring pieces of one phase."""
    spans: list[Span] = []
    now = 0.0
    for piece in pieces:
        end = now + piece.duration
        if spans and (spans[-1].phase, spans[-1].cycle) == (piece.phase, piece.cycle):
            spans[-1] = replace(spans[-1], end=end)
        else:
            spans.append(Span(piece.phase, piece.cycle, now, end))
        now = end
    return tuple(spans)


def moment(spans: Sequence[Span], place: Place) -> float:
    """Give the instant of a place [s], rounded to 0.2 s so that logs of 10 and 25 Hz end on it."""
    phase, cycle, part = place
    span = next(span for span in spans if (span.phase, span.cycle) == (phase, cycle))
    return round(5 * (span.start + part * (span.end - span.start))) / 5


def join(pieces: Sequence[Piece]) -> Motion:
    """Put pieces on one clock and integrate the velocity."""
    starts = np.concatenate(([0.0], np.cumsum([piece.duration for piece in pieces])))
    t = np.concatenate(
        [start + nodes(piece.duration) for start, piece in zip(starts, pieces, strict=False)]
    )
    laws = [piece.law(nodes(piece.duration)) for piece in pieces]
    v = np.concatenate([law[0] for law in laws])
    a = np.concatenate([law[1] for law in laws])
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))
    return Motion(t, x, v, a, spans_of(pieces))


def motion(scenario: Scenario) -> Motion:
    """Make the noise-free motion that the log covers, on the log's own clock."""
    whole = join(pieces_of(scenario))
    start = moment(whole.spans, scenario.begin) if scenario.begin else 0.0
    end = moment(whole.spans, scenario.end) if scenario.end else float(whole.t[-1])
    inside = (whole.t > start - STEP / 2) & (whole.t < end + STEP / 2)
    shift = scenario.clock_start - start
    spans = tuple(
        replace(span, start=span.start + shift, end=span.end + shift) for span in whole.spans
    )
    return Motion(whole.t[inside] + shift, whole.x[inside], whole.v[inside], whole.a[inside], spans)


# --------------------------------------------------------------------------------------- channels
R_DRUM, GEAR, LEAD, AREA, VOLUME = 0.13, 50.0, 0.010, 7850e-6, 4.0e-3
KGCM2, ATMOSPHERE, PRECHARGE = 98066.5, 101325.0, 20.5
ETA_SCREW_OUT, ETA_SCREW_IN, FRICTION_SPEED = 0.683, 0.540, 0.01
K_E, R_S, L_S, DIODES, B_ROTOR, ETA_MESH, J_ROTOR, J_DRUM = (
    0.0620,
    0.61,
    3.35e-3,
    1.4,
    7.5e-4,
    0.95,
    6.26e-4,
    0.3,
)
BLEEDER = 4500.0
"""What an open circuit is taken as [ohm]."""
RUN_DOWN = 0.3
"""Time constant with which a rotor runs down after the clutch has let go [s]."""


@dataclass(frozen=True, slots=True)
class Signals:
    """Noise-free channels on the nodes of a motion; SI, pressure is gauge [Pa]."""

    t: Signal
    displacement: Signal
    velocity: Signal
    pressure: Signal
    force: Signal
    torque: Signal
    vdc: Signal
    idc: Signal


def rotor_speed(t: Signal, v: Signal) -> Signal:
    """Follow the drum or run down alone, whichever is faster; as line velocity [m/s]."""
    log_drum = np.log(np.maximum(v, 1e-9))
    start = t[0]
    return np.asarray(
        np.exp(np.maximum.accumulate(log_drum + (t - start) / RUN_DOWN) - (t - start) / RUN_DOWN)
    )


def electrical(u: Signal, load: float) -> tuple[Signal, Signal]:
    """Give Vdc [V] and Idc [A] of the textbook bridge at a rotor speed [m/s of line]; inf ohm is
    the bleeder alone.
    """
    load = min(load, BLEEDER)
    omega = GEAR * u / R_DRUM
    source = np.maximum(1.35 * K_E * omega * 30 / np.pi - DIODES, 0.0)
    inner = 2 * R_S + 3 / np.pi * 2 * omega * L_S
    idc = source / (load + inner)
    return idc * load, idc


def gas_force(pressure: Signal, v: Signal) -> Signal:
    """Give the gas force at the line with the screw's friction against the motion [N]."""
    way = np.tanh(v / FRICTION_SPEED)
    friction = np.where(way > 0, 1 + way * (1 / ETA_SCREW_OUT - 1), 1 + way * (1 - ETA_SCREW_IN))
    return np.asarray(pressure * AREA * LEAD / (2 * np.pi * R_DRUM) * friction)


def shaft_torque(v: Signal, a: Signal, u: Signal, idc: Signal) -> Signal:
    """Give the torque behind the clutch [N m]: none while the rotor overruns, fading with the
    drum's slowing.
    """
    generator = 1.35 * K_E * 30 / np.pi * idc + B_ROTOR * GEAR * u / R_DRUM
    fading = np.clip(1 + RUN_DOWN * np.minimum(a, 0) / np.maximum(v, 1e-6), 0, 1)
    inertia = GEAR * J_ROTOR / R_DRUM * np.maximum(a, 0)
    engaged = (v > 1e-9) & (v >= u * (1 - 1e-6))
    return np.where(engaged, GEAR / ETA_MESH * (generator * fading + inertia), 0.0)


def signals(moved: Motion, load: float) -> Signals:
    """Derive the channels of the rig from its motion."""
    gas = (
        (PRECHARGE * KGCM2 + ATMOSPHERE)
        * VOLUME
        / (VOLUME - AREA * LEAD * moved.x / (2 * np.pi * R_DRUM))
    )
    u = rotor_speed(moved.t, moved.v)
    vdc, idc = electrical(u, load)
    torque = shaft_torque(moved.v, moved.a, u, idc)
    force = gas_force(gas - ATMOSPHERE, moved.v) + torque / R_DRUM + J_DRUM / R_DRUM**2 * moved.a
    return Signals(
        moved.t, moved.x, moved.v, gas - ATMOSPHERE, np.maximum(force, 0), torque, vdc, idc
    )


# ---------------------------------------------------------------------------------------- the log
@dataclass(frozen=True, slots=True)
class Sensor:
    """A column: header, unit [SI per unit], noise, zero error (both one standard deviation),
    resolution, decimals.
    """

    header: str
    unit: float
    noise: float
    zero: float
    resolution: float
    decimals: int


SENSORS: Mapping[str, Sensor] = {
    "displacement": Sensor("Displacement (m)", 1.0, 0.0, 0.0, 0.0001, 4),
    "velocity": Sensor("Velocity (m/s)", 1.0, 0.004, 0.0, 0.002, 3),
    "pressure": Sensor("Pressure (kg/cm2)", KGCM2, 0.012, 0.03, 0.001, 3),
    "force": Sensor("Force (N)", 1.0, 5.0, 2.0, 1.96, 1),
    "torque": Sensor("Torque (N.m)", 1.0, 0.4, 0.3, 0.01, 2),
    "vdc": Sensor("Vdc (V)", 1.0, 0.35, 0.0, 0.01, 2),
    "idc": Sensor("Idc (A)", 1.0, 0.02, 0.005, 0.001, 3),
}


@dataclass(frozen=True, slots=True)
class Log:
    """What the logger wrote: stamps [s] and columns in the units of their headers."""

    t: Signal
    columns: Mapping[str, Signal]
    decimals: tuple[int, ...]


def stamps(scenario: Scenario, start: float, end: float, rng: np.random.Generator) -> Signal:
    """Stamp the rows [s]: even, or off by up to `jitter` of a period, as written in the file."""
    count = int((end - start) * scenario.rate + 1e-6) + 1
    wander = scenario.jitter * rng.uniform(-1, 1, count)
    wander[[0, -1]] = 0.0
    return np.round(start + (np.arange(count) + wander) / scenario.rate, stamp_decimals(scenario))


def stamp_decimals(scenario: Scenario) -> int:
    """Tell how many decimals the stamps of a log have."""
    return 4 if scenario.jitter else 3 if scenario.rate > 100 else 2


def read_out(exact: Signal, sensor: Sensor, scenario: Scenario, rng: np.random.Generator) -> Signal:
    """Read a signal with a sensor; without noise it reads exactly."""
    value = exact / sensor.unit
    if scenario.noise == 0:
        return value
    value = value + scenario.zeros * scenario.noise * sensor.zero * rng.standard_normal()
    value = value + scenario.noise * sensor.noise * rng.standard_normal(value.size)
    return np.asarray(np.round(value / sensor.resolution) * sensor.resolution)


def make_log(scenario: Scenario, rng: np.random.Generator) -> Log:
    """Log a scenario."""
    exact = signals(motion(scenario), scenario.load)
    t = stamps(scenario, float(exact.t[0]), float(exact.t[-1]), rng)
    columns = {
        sensor.header: read_out(np.interp(t, exact.t, getattr(exact, name)), sensor, scenario, rng)
        for name, sensor in SENSORS.items()
    }
    decimals = tuple(sensor.decimals if scenario.noise else 9 for sensor in SENSORS.values())
    return Log(t, columns, (stamp_decimals(scenario), *decimals))


def write_csv(log: Log, path: Path) -> None:
    """Write a log with the headers of the example."""
    header = ",".join(("Time (s)", *log.columns))
    table = np.column_stack((log.t, *log.columns.values()))
    formats = [f"%.{decimals}f" for decimals in log.decimals]
    np.savetxt(path, table, fmt=formats, delimiter=",", header=header, comments="")


# -------------------------------------------------------------------------------------- the truth
METRICS = (
    *("energy_line_j", "energy_mech_j", "energy_gen_j"),
    *("power_line_w", "power_mech_w", "power_gen_w"),
    *("eta_trans", "eta_gen", "eta_pto"),
)
Metrics = Mapping[str, float | None]
Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class CycleTruth:
    """One cycle by the contract's words; instants on the log's clock [s], metrics as in the
    JSON.
    """

    complete: bool
    payout: Interval
    hold: Interval | None
    haul_in: Interval | None
    plateau: Interval | None
    plateau_speed: float
    window: Interval
    metrics: Metrics
    summary: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def onset(self) -> float:
        """When the payout begins [s]."""
        return self.window[0]

    @property
    def cutoff(self) -> float:
        """When the window ends [s]."""
        return self.window[1]


@dataclass(frozen=True, slots=True)
class Truth:
    """All cycles of a log, with means and largest deviations [%] over the complete ones."""

    cycles: tuple[CycleTruth, ...]
    mean: Metrics
    max_deviation_percent: Metrics


@dataclass(frozen=True, slots=True)
class Detection:
    """The velocity that thresholds are applied to: stamps [s] and velocity [m/s]."""

    t: Signal
    v: Signal


def detection(exact: Signals, *, smoothed: bool) -> Detection:
    """Take the exact velocity, or its 25 Hz samples smoothed by a local quadratic over 0.6 s."""
    if not smoothed:
        return Detection(exact.t, exact.velocity)
    t = np.arange(exact.t[0], exact.t[-1] + STEP / 2, 1 / SMOOTHING_RATE)
    return Detection(t, savgol_filter(np.interp(t, exact.t, exact.velocity), SMOOTHING_SAMPLES, 2))


def first_above(t: Signal, y: Signal, level: float, low: float, high: float) -> float | None:
    """Give the first instant in [low, high] at which y is above a level, interpolated; None if
    it never is.
    """
    above = np.flatnonzero((t >= low) & (t <= high) & (y > level))
    if above.size == 0:
        return None
    i = int(above[0])
    if i == 0 or y[i - 1] > level:
        return float(t[i])
    return float(t[i - 1] + (level - y[i - 1]) / (y[i] - y[i - 1]) * (t[i] - t[i - 1]))


def last_above(t: Signal, y: Signal, level: float, low: float, high: float) -> float | None:
    """Give the last instant in [low, high] at which y is above a level, interpolated; None if it
    never is.
    """
    mirrored = first_above(-t[::-1], y[::-1], level, -high, -low)
    return None if mirrored is None else -mirrored


def plateau(seen: Detection, start: float, end: float) -> tuple[float, Interval | None]:
    """Give the plateau's speed [m/s], and its beginning and the start of braking [s]."""
    inside = (seen.t >= start) & (seen.t <= end)
    t, v = seen.t[inside], seen.v[inside]
    speed = float(np.median(v[v > 0.9 * np.percentile(v, 99)]))
    low = v < 0.98 * speed
    # Stretches at or above the level lie between neighbouring samples below it.
    edges = np.concatenate(([-1], np.flatnonzero(low), [v.size]))
    for left, right in pairwise(edges):
        if right - left > 1 and t[right - 1] - t[left + 1] >= 0.2 - STEP / 2:
            begin = t[left + 1]
            if left >= 0:
                begin = t[left] + (0.98 * speed - v[left]) / (v[left + 1] - v[left]) * (
                    t[left + 1] - t[left]
                )
            return speed, (float(begin), float(t[~low][-1]))
    return speed, None


def cutoff(
    rule: Rule, onset: float, end: float, flat: Interval | None, log_end: float
) -> tuple[float, bool]:
    """Give the window's end by a rule [s], and whether the log shows it."""
    if rule == "payout":
        return end, end < log_end - STEP / 2
    if isinstance(rule, float | int):
        return min(onset + rule, log_end), onset + rule <= log_end + STEP / 2
    if flat is None:
        return end, False
    wanted, braking = flat[0] + 0.5, flat[1]
    seen = wanted <= log_end if end >= log_end - STEP / 2 else True
    return min(wanted, braking), seen


def integral(t: Signal, y: Signal, window: Interval) -> float:
    """Integrate by trapezia between two interpolated ends."""
    inside = (t > window[0]) & (t < window[1])
    t_in = np.concatenate(([window[0]], t[inside], [window[1]]))
    return float(np.trapezoid(np.interp(t_in, t, y), t_in))


def time_mean(t: Signal, y: Signal, window: Interval) -> float:
    """Average over a stretch of time."""
    return integral(t, y, window) / (window[1] - window[0])


def powers(exact: Signals) -> dict[str, Signal]:
    """Give the three powers (Eqs 2-4) [W]."""
    mech = exact.torque * exact.velocity / R_DRUM
    return {"line": exact.force * exact.velocity, "mech": mech, "gen": exact.vdc * exact.idc}


def metrics(exact: Signals, window: Interval, *, open_circuit: bool) -> Metrics:
    """Give the nine metrics over one window."""
    energy = {name: integral(exact.t, power, window) for name, power in powers(exact).items()}
    seconds = window[1] - window[0]
    values: dict[str, float | None] = {f"energy_{name}_j": value for name, value in energy.items()}
    values |= {f"power_{name}_w": value / seconds for name, value in energy.items()}
    values["eta_trans"] = energy["mech"] / energy["line"]
    values["eta_gen"] = None if open_circuit else energy["gen"] / energy["mech"]
    values["eta_pto"] = None if open_circuit else energy["gen"] / energy["line"]
    return values


def summarise(
    exact: Signals,
    out: Interval,
    hold: Interval | None,
    haul: Interval | None,
    flat: Interval | None,
) -> dict[str, dict[str, float]]:
    """Give the numbers of the JSON's phase summary, `plateau` beside the phases."""
    t, v = exact.t, exact.velocity
    x_ends = np.interp(out, t, exact.displacement)
    summary = {"payout": {"duration_s": out[1] - out[0], "travel_m": float(x_ends[1] - x_ends[0])}}
    summary["payout"]["speed_max_mps"] = float(np.abs(v[(t >= out[0]) & (t <= out[1])]).max())
    if flat and flat[1] > flat[0]:
        means = {"speed_mps": v, "force_n": exact.force, "torque_nm": exact.torque}
        means |= {f"power_{name}_w": power for name, power in powers(exact).items()}
        summary["plateau"] = {name: time_mean(t, y, flat) for name, y in means.items()}
    if hold:
        means = {
            "force_n": exact.force,
            "torque_nm": exact.torque,
            "pressure_kgcm2": exact.pressure / KGCM2,
        }
        summary["hold"] = {"duration_s": hold[1] - hold[0]} | {
            n: time_mean(t, y, hold) for n, y in means.items()
        }
    if haul:
        inside = (t >= haul[0]) & (t <= haul[1])
        summary["haul_in"] = {
            "duration_s": haul[1] - haul[0],
            "speed_max_mps": float(np.abs(v[inside]).max()),
            "force_n": time_mean(t, exact.force, haul),
            "force_min_n": float(exact.force[inside].min()),
            "energy_line_j": integral(t, powers(exact)["line"], haul),
        }
    return summary


def later_phases(
    seen: Detection, end: float, back: Span
) -> tuple[Interval | None, Interval | None]:
    """Give hold and haul-in after a payout's end, as far as the log goes [s]."""
    log_end = float(seen.t[-1])
    low, high = max(end, back.start - REACH), back.end + REACH
    start = first_above(seen.t, -seen.v, ONSET_SPEED, low, high)
    stop = last_above(seen.t, -seen.v, ONSET_SPEED, low, high)
    if start is None or stop is None:
        return ((end, log_end) if end < log_end else None), None
    return (end, start), (start, stop)


def cycle_truth(
    exact: Signals, seen: Detection, out: Span, back: Span, rule: Rule, load: float
) -> CycleTruth | None:
    """Apply the contract to one payout that the crane meant; None if the log shows nothing of
    it.
    """
    log_start, log_end = float(exact.t[0]), float(exact.t[-1])
    onset = first_above(seen.t, seen.v, ONSET_SPEED, out.start - REACH, out.end)
    end = last_above(seen.t, seen.v, ONSET_SPEED, out.start, out.end + REACH)
    if onset is None or end is None:
        return None
    end = log_end if end > seen.t[-1] - STEP / 2 else end
    speed, flat = plateau(seen, onset, end)
    stop, shown = cutoff(rule, onset, end, flat, log_end)
    hold, haul = later_phases(seen, end, back)
    values = metrics(exact, (onset, stop), open_circuit=np.isinf(load))
    summary = summarise(exact, (onset, end), hold, haul, flat)
    complete = shown and onset > log_start
    return CycleTruth(
        complete, (onset, end), hold, haul, flat, speed, (onset, stop), values, summary
    )


def spread(cycles: Sequence[CycleTruth]) -> tuple[Metrics, Metrics]:
    """Give means (Eq. 7) and largest deviations from them [%] over complete cycles."""
    mean: dict[str, float | None] = {}
    deviation: dict[str, float | None] = {}
    for name in METRICS:
        values = np.array(
            [c.metrics[name] for c in cycles if c.complete and c.metrics[name] is not None],
            dtype=float,
        )
        mean[name] = float(values.mean()) if values.size else None
        far = float(np.abs(values / values.mean() - 1).max() * 100) if values.size > 1 else None
        deviation[name] = far
    return mean, deviation


def truth(scenario: Scenario, *, rule: Rule = "auto", smoothed: bool = False) -> Truth:
    """Reduce the noise-free signals of a scenario by the contract's words.

    Parameters
    ----------
    rule : `auto`, `payout`, or the length of a fixed window [s]
    smoothed : thresholds on the smoothed 25 Hz velocity as the contract says, else on the exact
        velocity; energies are integrals of the exact signals in both
    """
    moved = motion(scenario)
    exact = signals(moved, scenario.load)
    seen = detection(exact, smoothed=smoothed)
    spans = {(span.phase, span.cycle): span for span in moved.spans}
    found = (
        cycle_truth(
            exact, seen, spans["payout", cycle], spans["haul_in", cycle], rule, scenario.load
        )
        for cycle in range(len(scenario.payouts))
    )
    cycles = tuple(cycle for cycle in found if cycle is not None)
    mean, deviation = spread(cycles)
    return Truth(cycles, mean, deviation)


BASE = Scenario()
SCENARIOS: Mapping[str, Scenario] = {
    "smooth": BASE,
    "minimum_jerk": replace(BASE, ramp=("minimum_jerk", 3.0), brake=("minimum_jerk", 1.0)),
    "linear_ramp": replace(
        BASE, ramp=("linear", 2.0), brake=("linear", 0.8), haul_ramp=("linear", 1.0)
    ),
    "steep_linear": replace(
        BASE, ramp=("linear", 0.5), brake=("linear", 0.3), haul_ramp=("linear", 0.4)
    ),
    "lag_ramp": replace(BASE, ramp=("lag", 6.4), brake=("lag", 2.4), window=6.0),
    "slow_ramp": replace(BASE, ramp=("smoothstep", 6.0), window=7.0),
    "slow_linear_ramp": replace(BASE, ramp=("linear", 6.0), window=7.0),
    "heavy_load": replace(
        BASE, payouts=((9.6, 0.32), (9.6, 0.31), (9.6, 0.33)), load=4.5, window=5.96
    ),
    "open_circuit": replace(BASE, payouts=((9.6, 0.95),) * 3, load=float("inf")),
    "creep": replace(BASE, creep_rest=0.015, creep_hold=0.02, rest=8.0),
    "creep_back": replace(BASE, creep_rest=-0.01, creep_hold=-0.015),
    "stop": replace(BASE, stop=2.0),
    "long_early_stop": replace(BASE, stop=3.0, interrupted_at=0.25),
    "reversal": replace(BASE, reversal=0.3),
    "long_reversal": replace(BASE, reversal=0.4, interrupted_at=0.3),
    "wavy_1_percent": replace(BASE, wave=0.01, wave_period=2.0),
    "wavy_3_percent": replace(BASE, wave=0.03, wave_period=4.0),
    "wavy_3_percent_falling": replace(BASE, wave=-0.03, wave_period=4.0),
    "idle_for_hours": replace(BASE, payouts=((9.6, 0.85), (9.6, 0.84)), idle=2 * 3600.0),
    "creep_for_hours": replace(
        BASE, payouts=((9.6, 0.85), (9.6, 0.84)), idle=3600.0, creep_rest=0.0004
    ),
    "starts_in_payout": replace(BASE, begin=("payout", 0, 0.5)),
    "starts_in_hold": replace(BASE, begin=("hold", 0, 0.5)),
    "starts_in_haul_in": replace(BASE, begin=("haul_in", 0, 0.4)),
    "ends_in_ramp": replace(BASE, end=("payout", 2, 0.15)),
    "ends_in_payout": replace(BASE, end=("payout", 2, 0.6)),
    "ends_in_hold": replace(BASE, end=("hold", 2, 0.5)),
    "ends_in_haul_in": replace(BASE, end=("haul_in", 2, 0.5)),
    "differing_travel": replace(
        BASE, payouts=((9.6, 0.85), (6.5, 0.80), (8.0, 0.9), (9.9, 0.7)), window=4.5
    ),
    "aborted_payout": replace(
        BASE, payouts=((9.6, 0.85), (2.0, 0.6), (9.6, 0.84)), ramp=("smoothstep", 2.0)
    ),
    "short_hold_and_rest": replace(BASE, hold=1.2, rest=1.5),
    "ten_hertz": replace(BASE, rate=10.0),
    "hundred_hertz": replace(BASE, rate=100.0),
    "thousand_hertz": replace(BASE, rate=1000.0, payouts=((9.6, 0.86), (9.6, 0.85))),
    "uneven_stamps": replace(BASE, jitter=0.3),
    "noisy": replace(BASE, noise=2.0),
    "exact": replace(BASE, noise=0.0),
    "one_cycle": replace(BASE, payouts=((9.6, 0.85),)),
    "everything": replace(
        BASE,
        creep_rest=0.01,
        creep_hold=-0.015,
        wave=0.02,
        reversal=0.2,
        jitter=0.2,
        noise=1.5,
        load=18.0,
    ),
    "late_clock": replace(BASE, clock_start=1000.0),
}
