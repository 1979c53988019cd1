"""A log beside the simulation of a model along its line motion, and what is kept of that: curves, differences, loss budget."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.cascade import BUILT_IN
from winchcascade.core.errors import LogError, WinchcascadeError
from winchcascade.core.quantity import KGF
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Mask, Run, Signal
from winchcascade.reduction.bins import engaged, stored_by
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import Simulation

LONGEST = 200.0
"""Of a longer log its first complete cycles are simulated: as many as this holds, at half a millisecond a step. [s]"""

MAX_SAMPLES = 300_000
"""And no more samples than this, whatever the sampling rate."""

LEAD = 2.0
"""A part of a log begins before its first onset and ends after its last cycle by this. [s]"""

SLOWEST = 5.0
"""With a lower sampling rate a log does not show how the line starts and brakes. [Hz]"""


NAMED_EACH = 4
"""Numbers that a rig file lacks are named each if they are no more than this, else by their sections."""

NO_VELOCITY = "the log has no line velocity, which drives a simulation."


class LeftOut(msgspec.Struct, frozen=True):
    """The reason for which a log is not compared with a simulation, in one sentence."""

    why: str


class ModelComparison(msgspec.Struct, frozen=True):
    """A log and its simulation at the same stamps.

    `run` is the log, or of a long one the part that was simulated; `cycles` are the complete cycles in it, out of `total`.
    `payout`, `driven` and `haul_in`, (n,) each, select the samples of these cycles that count: of their payouts, of the part of
    these before braking while the clutch drives the generator, and of their haul-ins; bridged samples do not count. `changed`
    states what the model has beyond the rig file, nothing for the baseline.
    """

    run: Run
    rig: Rig
    cycles: tuple[CycleResult, ...]
    total: int
    simulation: Simulation
    payout: Mask
    driven: Mask
    haul_in: Mask
    changed: str = ""

    @property
    def rpm(self) -> Signal:
        """Generator speed that the line velocity gives while the clutch is engaged, 50 v / r_drum, (n,) [rpm]."""
        found: Signal = self.run.channels["velocity"] * (self.rig.rpm_per_velocity or 0.0)
        return found


def compare_with_baseline(reduction: Reduction) -> ModelComparison | LeftOut:
    """Simulate a log with the numbers of its rig file, without any effect, and lay both side by side."""
    from winchcascade.rig.baseline import NoModel, model_of

    if "velocity" not in reduction.run.channels:
        return LeftOut(NO_VELOCITY)
    model = model_of(reduction.rig)
    if not isinstance(model, NoModel):
        return compare(reduction, model)
    if not model.missing:
        return LeftOut(model.why)
    what, sections = ", ".join(map(str, model.missing)), dict.fromkeys(f"[{n.section}]" for n in model.missing)
    if len(model.missing) > NAMED_EACH:
        what = f"{len(model.missing)} numbers under {', '.join(sections)}"
    name = reduction.rig.name
    return LeftOut(f"the rig file of {name} lacks what a model needs: {what} (`winchcascade rig hsu2026` shows them).")


def compare(reduction: Reduction, model: Model, *, changed: str = "") -> ModelComparison | LeftOut:
    """Simulate any model along the line motion of a log, and lay both side by side.

    Parameters
    ----------
    changed : what the model has beyond the rig file, in words; nothing for the baseline
    """
    for holds, why in _obstacles(reduction):
        if holds:
            return LeftOut(why)
    run, cycles = _part(reduction)
    if not cycles:
        return LeftOut(f"no complete cycle ends within {LONGEST:g} s of its onset, the longest that is simulated.")
    from winchcascade.rig.simulate import simulate

    try:
        simulation = simulate(run, model)
    except WinchcascadeError as fault:
        return LeftOut(str(fault).removeprefix(f"{run.name}: "))
    if not all(np.isfinite(x).all() for x in simulation.run.channels.values()):
        return LeftOut("along this motion the model gives no finite numbers; check unit and scale of the velocity.")
    bridged = np.zeros(run.t.size, dtype=bool)
    for before, after in (gap for gaps in run.gaps.values() for gap in gaps):
        bridged[np.searchsorted(run.t, before, side="right") : np.searchsorted(run.t, after, side="left")] = True
    whole, plateaus = ~bridged, [c.summary.payout.plateau for c in cycles]
    return ModelComparison(
        run=run,
        rig=reduction.rig,
        cycles=cycles,
        total=len(reduction.complete),
        simulation=simulation,
        payout=_within(run.t, [(c.phases.onset, c.phases.payout_end) for c in cycles]) & whole,
        driven=engaged(run, [c.phases for c in cycles], plateaus, reduction.rig)
        & _within(run.t, before_braking(cycles))
        & whole,
        haul_in=_within(run.t, [c.phases.haul_in for c in cycles if c.phases.haul_in is not None]) & whole,
        changed=changed,
    )


def _obstacles(reduction: Reduction) -> tuple[tuple[bool, str], ...]:
    """Whether each reason holds for which a log cannot be simulated."""
    run = reduction.run
    return (
        ("velocity" not in run.channels, NO_VELOCITY),
        (run.load is None, "the load of the log is not known; give it by --load-ohm or in a campaign.toml."),
        (not reduction.complete, "the log has no complete cycle."),
        (
            run.fs < SLOWEST,
            f"the log has {run.fs:.3g} samples a second; with fewer than {SLOWEST:g} it does not show how the line starts.",
        ),
    )


def _part(reduction: Reduction) -> tuple[Run, tuple[CycleResult, ...]]:
    """The log with its complete cycles, or of a long one the first of them."""
    run, complete = reduction.run, reduction.complete
    longest = min(LONGEST, MAX_SAMPLES / run.fs)
    if run.t[-1] - run.t[0] <= longest:
        return run, complete
    begin = complete[0].phases.onset - LEAD
    cycles = tuple(c for c in complete if _end(c) + LEAD <= begin + longest)
    if not cycles:
        return run, ()
    rows = slice(*np.searchsorted(run.t, (begin, _end(cycles[-1]) + LEAD)).tolist())
    channels = {name: x[rows] for name, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[rows], channels=channels, samples=run.t[rows].size), cycles


def _end(cycle: CycleResult) -> float:
    """End of a cycle: of its haul-in, where the log holds it. [s]"""
    last = cycle.phases.haul_in or cycle.phases.hold or (0.0, cycle.phases.payout_end)
    return max(last[1], cycle.window.cutoff)


def before_braking(cycles: Sequence[CycleResult]) -> list[tuple[float, float]]:
    """From the onset of each payout to the start of its braking, to its end where it holds no plateau. [s]"""
    return [
        (c.phases.onset, c.phases.payout_end if c.summary.payout.plateau is None else c.summary.payout.plateau.braking)
        for c in cycles
    ]


def _within(t: Signal, spans: Sequence[tuple[float, float]]) -> Mask:
    """Samples that lie in any of some spans, both ends included, (n,)."""
    inside = np.zeros(t.size, dtype=bool)
    for begin, end in spans:
        inside[np.searchsorted(t, begin, side="left") : np.searchsorted(t, end, side="right")] = True
    return inside


MIN_BIN_SAMPLES = 3
"""Bins of fewer samples are left out, or of fewer than there are cycles."""

FAINT = 0.02
"""Nothing is divided by a mean below this share of the maximum: a ratio of two noises has no meaning."""

MAX_BINS = 40
"""Bins of displacement and of velocity, about at most."""

MAX_SPEED_BINS = 200
"""Bins of generator speed: where those of the rig file are more, they are made wider."""

_KGCM2 = KGF * 1e4
SPEED = "Generator speed (rpm)"


class Shown(NamedTuple):
    """How a quantity is shown: its title, its unit, what a caption states of its panel, the label of what it is drawn over, and
    a symbol for a bare axis.
    """

    title: str
    unit: str
    what: str
    over: str = SPEED
    symbol: str = ""


SHOWN = {
    "pressure_kgcm2": Shown(
        "Gas pressure, gauge", "kg/cm²", "gas pressure over displacement (haul-ins dashed)", "Line displacement (m)"
    ),
    "force_n": Shown(
        "Line tension", "N", "line tension over line velocity (haul-ins left of zero)", "Line velocity (m/s)"
    ),
    "power_gen_w": Shown("Power at the DC link", "W", "power at the DC link over generator speed"),
    "torque_nm": Shown("Torque of the PTO shaft", "N·m", "torque of the PTO shaft over generator speed"),
    "vdc_v": Shown("Voltage of the DC link", "V", "voltage of the DC link over generator speed"),
    "idc_a": Shown("Current of the DC link", "A", "current of the DC link over generator speed"),
    "resistance_ohm": Shown("Apparent resistance", "Ω", "apparent resistance Vdc / Idc over generator speed"),
    "loss_w": Shown(
        "Electrical-side loss",
        "W",
        "electrical-side loss P_mech − P_gen (Eq. 11 of Hsu et al. 2026) without stored energy over generator speed",
    ),
    "eta_gen": Shown(
        "Electrical-stage efficiency",
        "1",
        "efficiency of the electrical stage, mean P_gen over mean P_mech of each bin (Eq. 6) without stored energy over "
        "generator speed",
        symbol=r"$\eta_\mathrm{gen}$",
    ),
}
"""Curves by their name in written files, in the order of the paper's Figs 13 to 17."""

HAUL_IN = "pressure_haul_in_kgcm2"
"""Curve of the pressure while the line is hauled in, drawn beside that of the payouts."""

_LOADED = ("power_gen_w", "torque_nm", "idc_a", "resistance_ohm", "loss_w", "eta_gen")
"""Curves without a meaning in open circuit, where only the bleed carries a current."""

COMPARED = {
    "torque": ("N·m", 1.0),
    "vdc": ("V", 1.0),
    "idc": ("A", 1.0),
    "pressure": ("kg/cm²", 1.0 / _KGCM2),
    "force": ("N", 1.0),
}
"""Channels whose differences are reported: unit, and the factor that turns SI units into it."""


class ComparedCurve(msgspec.Struct, frozen=True):
    """Means of log and simulation over the same samples, bin by bin.

    `x` are the middles of the bins of generator speed, and means of displacement and velocity.
    """

    x: tuple[float, ...]
    log: tuple[float, ...]
    simulated: tuple[float, ...]


class ChannelDifference(msgspec.Struct, frozen=True):
    """Log minus simulation of one channel over the payouts: mean and root mean square, in the unit of `COMPARED`."""

    bias: float
    rms: float


# ------------------------------------------------------------------------------------------------------------ the bins
def means(x: Signal, width: float, *columns: Signal, minimum: int) -> tuple[Signal, ...]:
    """Average columns in bins of x, and give the middles of the bins before them; bins of few samples are left out.

    >>> import numpy as np
    >>> [c.tolist() for c in means(np.array([1.0, 2.0, 12.0]), 10.0, np.array([3.0, 5.0, 9.0]), minimum=2)]
    [[5.0], [4.0]]
    """
    if x.size == 0:
        return tuple(np.empty(0) for _ in range(1 + len(columns)))
    number = np.floor(x / width).astype(np.int64)
    low = int(number.min())
    count = np.bincount(number - low)
    full = np.flatnonzero(count >= max(minimum, 1))
    middles: Signal = (full + low).astype(np.float64) * width + 0.5 * width
    return (middles, *(np.bincount(number - low, weights=y)[full] / count[full] for y in columns))


def minimum_of(comparison: ModelComparison) -> int:
    """Samples that a bin must have: as many as there are cycles, `MIN_BIN_SAMPLES` at most."""
    return min(MIN_BIN_SAMPLES, len(comparison.cycles))


def speed_width(comparison: ModelComparison) -> float:
    """Width of the bins of generator speed: that of the rig file, unless it makes too many. [rpm]"""
    rpm = comparison.rpm[comparison.driven]
    return max(comparison.rig.thresholds.rpm_bin, round_width(float(np.ptp(rpm)) if rpm.size else 0.0, MAX_SPEED_BINS))


def round_width(extent: float, maximum: int = MAX_BINS) -> float:
    """Width of bins of which no more than a given number cover an extent: 1, 2 or 5 times a power of ten.

    >>> round_width(10.0), round_width(2.2)
    (0.5, 0.1)
    """
    raw = max(extent, 1e-9) / maximum
    power_of_ten = 10.0 ** np.floor(np.log10(raw))
    return next(float(round(k * power_of_ten, 12)) for k in (1, 2, 5, 10) if k * power_of_ten >= raw * (1 - 1e-9))


def ratio(above: Signal, below: Signal) -> Signal:
    """One column of means over another, not a number where the lower is faint, (n,)."""
    strong = below > FAINT * np.max(below, initial=0.0)
    found: Signal = np.divide(above, below, out=np.full(below.size, np.nan), where=strong)
    return found


# ---------------------------------------------------------------------------------------------------------- the curves
class Abscissa(NamedTuple):
    """What curves are drawn over, (n,), the samples that count, (n,), and the width of a bin.

    A curve has the mean of each bin as its abscissa, or the middle of the bin if `middles` is set.
    """

    x: Signal
    rows: NDArray[np.bool_]
    width: float
    middles: bool = False


def quantities(comparison: ModelComparison, run: Run) -> dict[str, Signal]:
    """Channels and powers of the log or of its simulation that are compared, (n,) each by name.

    The loss is P_mech - P_gen (Eq. 11) less what goes into rotor, shaft and capacitor while the speed changes, with the numbers
    of the model: without this a machine that speeds up would seem to lose what it stores.
    """
    channels, model = run.channels, comparison.simulation.model
    names = (("torque_nm", "torque"), ("vdc_v", "vdc"), ("idc_a", "idc"), ("force_n", "force"))
    found = {name: channels[channel] for name, channel in names if channel in channels}
    if "pressure" in channels:
        found["pressure_kgcm2"] = found[HAUL_IN] = channels["pressure"] / _KGCM2
    powers = {f"power_{name}_w": BUILT_IN[name].watts(channels, comparison.rig.r_drum) for name in ("mech", "gen")}
    found |= {name: watt for name, watt in powers.items() if watt is not None}
    if found.keys() >= powers.keys():
        shaft = model.drivetrain
        stored = stored_by(run, comparison.rig, shaft.inertia_rotor, shaft.k_shaft, model.dc_link.c_dc)
        found["input_w"] = found["power_mech_w"] - stored["rotor"] - stored.get("spring", 0.0)
        found["output_w"] = found["power_gen_w"] + stored["capacitor"]
        found["loss_w"] = found["input_w"] - found["output_w"]
    return found


def abscissas(comparison: ModelComparison) -> dict[str, Abscissa]:
    """What each quantity is drawn over: displacement, out and back, velocity (Fig. 13a, b), or generator speed.

    Over speed only the samples count in which the clutch is engaged (Figs 13c and 14 to 17).
    """
    run, found = comparison.run.channels, {}
    v, x = run["velocity"], run.get("displacement")
    if x is not None:
        found["pressure_kgcm2"] = Abscissa(x, comparison.payout, round_width(float(np.ptp(x))))
        found[HAUL_IN] = found["pressure_kgcm2"]._replace(rows=comparison.haul_in)
    found["force_n"] = Abscissa(v, comparison.driven | comparison.haul_in, round_width(float(np.ptp(v))))
    if comparison.rig.rpm_per_velocity is not None:
        speed = Abscissa(comparison.rpm, comparison.driven, speed_width(comparison), middles=True)
        found |= dict.fromkeys(("torque_nm", "vdc_v", "idc_a", "power_gen_w", "input_w", "output_w", "loss_w"), speed)
    return found


def curves_of(comparison: ModelComparison) -> dict[str, ComparedCurve]:
    """Make the curves of Figs 13 to 17 that a log has the channels for; in open circuit those that mean something there."""
    log, simulated = (quantities(comparison, run) for run in (comparison.run, comparison.simulation.run))
    found: dict[str, tuple[Signal, ...]] = {}
    for name, (x, rows, width, middles) in abscissas(comparison).items():
        if name in log:
            columns = (column[rows] for column in (x, log[name], simulated[name]))
            middle, *binned = means(x[rows], width, *columns, minimum=minimum_of(comparison))
            found[name] = (middle if middles else binned[0], *binned[1:])
    for name, above, below in (("resistance_ohm", "vdc_v", "idc_a"), ("eta_gen", "output_w", "input_w")):
        if above in found and below in found:
            found[name] = (found[above][0], *map(ratio, found[above][1:], found[below][1:]))
    shown = {*SHOWN, HAUL_IN} - set(_LOADED if comparison.run.open_circuit else ())
    curves = {name: _curve(*columns) for name, columns in found.items() if name in shown}
    return {name: curve for name, curve in curves.items() if curve.x}


def _curve(x: Signal, log: Signal, simulated: Signal) -> ComparedCurve:
    whole = np.isfinite(log) & np.isfinite(simulated)
    return ComparedCurve(kept(x[whole]), kept(log[whole]), kept(simulated[whole]))


def kept(x: Signal) -> tuple[float, ...]:
    """Numbers to five significant digits, as they are kept with a result."""
    return tuple(float(f"{value:.5g}") for value in x.tolist())


# --------------------------------------------------------------------------------------------------------- differences
def differences_of(comparison: ModelComparison) -> dict[str, ChannelDifference]:
    """Log minus simulation over the payouts, channel by channel; torque and Idc not in open circuit."""
    run, model, rows = comparison.run.channels, comparison.simulation.run.channels, comparison.payout
    left_out = ("torque", "idc") if comparison.run.open_circuit else ()
    apart = {
        name: (run[name][rows] - model[name][rows]) * factor
        for name, (_, factor) in COMPARED.items()
        if name in run and name not in left_out and rows.any()
    }
    return {name: ChannelDifference(float(np.mean(x)), float(np.sqrt(np.mean(x**2)))) for name, x in apart.items()}


# ---------------------------------------------------------------------------------------------------------- the budget
class Group(NamedTuple):
    """Entries of `rig.simulate.LEDGER` that are shown together: `behind` the torque sensor, seen from the line, or before.

    `about` is what a note states of the group, where its name is not enough.
    """

    name: str
    behind: tuple[str, ...] = ()
    before: tuple[str, ...] = ()
    about: str = ""


GROUPS = {
    "dc": Group("DC link", ("dc",), about="delivered"),
    "diodes": Group("diodes", ("diodes",), about="drop of the bridge"),
    "copper": Group("copper", ("copper",), about="resistance of the stator"),
    "damper": Group("damper", ("damper",), about="viscous drag of the fast shaft"),
    "windage": Group("windage", ("windage",)),
    "friction": Group("friction", ("friction",)),
    "mesh": Group("mesh", ("mesh",), about="gear teeth"),
    "clutch": Group("clutch", ("clutch",)),
    "shaft": Group("shaft", ("shaft", "shaft_loss"), about="its spring and damping"),
    "capacitor": Group("capacitor", ("capacitor",), about="charge of the DC link"),
    "inertia": Group("inertia", ("rotor",), ("drum",), "rotor and drum still turning"),
    "line": Group("line losses", (), ("line_loss",), "between line and torque sensor"),
    "seal": Group("seal", (), ("seal",)),
    "screw": Group("screw", (), ("screw",), "friction of the ball screw"),
    "stored": Group("stored gas", (), ("gas",), "held by the accumulator when the window ends"),
}
"""Where the energy of the line goes, from the DC link back to the line. Inertia is of rotor and drum, shaft of spring and
damping, line losses arise between line and torque sensor."""

ALWAYS = ("stored", "screw", "line", "inertia", "mesh", "damper", "copper", "diodes", "dc")
"""Groups that a table shows in any case, from the line to the DC link; others only where there is something in them."""

NOTHING = 5e-4
"""A share of the energy of the line below this is not named. [1]"""


class LossBudget(msgspec.Struct, frozen=True):
    """Means over the windows of the compared cycles [J]: of the simulated line, and of each of `GROUPS`.

    `drum` is what of the inertia belongs to the drum. `log` holds the energies that the log gives, by stage: line, mech, gen.
    """

    line: float
    groups: dict[str, float]
    drum: float
    log: dict[str, float]

    @property
    def shares(self) -> dict[str, float]:
        """Each group over the line's energy. [1]"""
        return {name: joule / self.line for name, joule in self.groups.items()}

    @property
    def mech(self) -> float:
        """Simulated share of the line's energy that reaches the torque sensor. [1]"""
        return (sum(self.groups[name] for name, group in GROUPS.items() if group.behind) - self.drum) / self.line


def budget_of(comparison: ModelComparison) -> LossBudget | None:
    """Book the energy of the simulation between onset and cutoff of each compared cycle, as a mean over the cycles."""
    booked, t, open_circuit = comparison.simulation.energy, comparison.run.t, comparison.run.open_circuit
    ends = np.array([(c.window.onset, c.window.cutoff) for c in comparison.cycles]).T
    joule = {name: float(np.mean(np.diff(np.interp(ends, t, x), axis=0))) for name, x in booked.items()}
    if joule["line"] <= 0.0:
        return None
    log = {
        stage: [x for c in comparison.cycles if (x := c.metrics[f"energy_{stage}"]) is not None]
        for stage in (("line",) if open_circuit else ("line", "mech", "gen"))
    }
    return LossBudget(
        line=joule["line"],
        groups={name: sum(joule[entry] for entry in (*g.behind, *g.before)) for name, g in GROUPS.items()},
        drum=joule["drum"],
        log={stage: float(np.mean(values)) for stage, values in log.items() if len(values) == len(comparison.cycles)},
    )


# ----------------------------------------------------------------------------------------------------- an open circuit
MAX_POINTS = 150
"""Samples of a regression that are kept to be drawn; of more an even selection."""

DAMPERS = (0.0, 0.5, 1.0, 1.5, 2.0)
"""The damper of a sweep over that of the rig (Fig. 11). [1]"""


class Sweep(msgspec.Struct, frozen=True):
    """Line tension in bins of generator speed, logged and simulated with the rig's damper times each of `factors` [N]."""

    rpm: tuple[float, ...]
    log: tuple[float, ...]
    factors: tuple[float, ...]
    simulated: tuple[tuple[float, ...], ...]
    nominal: float


class Regression(msgspec.Struct, frozen=True):
    """Back-EMF line to line, rms, over generator speed in open circuit, and its slope with 95 % interval [V/rpm].

    `v_dc` [V] is the DC voltage at the same samples, `reference` the back-EMF constant of the rig file [V/rpm].
    """

    rpm: tuple[float, ...]
    v_ll: tuple[float, ...]
    v_dc: tuple[float, ...]
    slope: float
    low: float
    high: float
    r2: float
    points: int
    reference: float


def sweep_of(comparison: ModelComparison) -> Sweep | None:
    """Simulate an open circuit with other dampers on the fast shaft (Fig. 11); None without a force channel or a damper."""
    from winchcascade.rig.simulate import simulate

    run, model, rows = comparison.run, comparison.simulation.model, comparison.driven
    nominal = model.drivetrain.b_rotor
    if "force" not in run.channels or nominal == 0.0 or not rows.any():
        return None
    forces = [run.channels["force"][rows]]
    for factor in DAMPERS:
        shaft = msgspec.structs.replace(model.drivetrain, b_rotor=factor * nominal)
        damped = msgspec.structs.replace(model, drivetrain=shaft)
        simulation = comparison.simulation if factor == 1.0 else simulate(run, damped)
        forces.append(simulation.run.channels["force"][rows])
    rpm, log, *simulated = means(comparison.rpm[rows], speed_width(comparison), *forces, minimum=minimum_of(comparison))
    return Sweep(kept(rpm), kept(log), DAMPERS, tuple(kept(x) for x in simulated), nominal)


def regression_of(comparison: ModelComparison) -> Regression | None:
    """Fit the back-EMF constant of an open circuit above 1000 rpm (Fig. 12); None where the log does not carry it."""
    from winchcascade.diagnosis.calibrate import back_emf_of

    model = comparison.simulation.model
    try:
        fit = back_emf_of(comparison.run, comparison.rig, before_braking(comparison.cycles))
    except LogError:
        return None
    even = np.linspace(0, fit.rpm.size - 1, min(fit.rpm.size, MAX_POINTS)).round().astype(np.intp)
    rpm, v_ll, v_dc = (kept(x[even]) for x in (fit.rpm, fit.v_ll, fit.vdc))
    return Regression(rpm, v_ll, v_dc, fit.k_e, fit.low, fit.high, fit.r2, fit.rpm.size, model.generator.k_e)


# --------------------------------------------------------------------------------------------------------- the account
class Account(msgspec.Struct, frozen=True, omit_defaults=True):
    """All that the figures across logs need of one comparison; `why` is the reason if there is none.

    `word` is what the log is called, `cycles` of `total` complete cycles are compared, `rated` is the generator's speed [rpm],
    `gear` its speed over that of the drum.
    """

    why: str = ""
    word: str = "log"
    rig: str = ""
    changed: str = ""
    open_circuit: bool = False
    cycles: int = 0
    total: int = 0
    rated: float | None = None
    gear: float | None = None
    curves: dict[str, ComparedCurve] = {}
    differences: dict[str, ChannelDifference] = {}
    budget: LossBudget | None = None
    sweep: Sweep | None = None
    regression: Regression | None = None


def account_of(comparison: ModelComparison) -> Account:
    """Put together what is kept of a comparison."""
    run, rig = comparison.run, comparison.rig
    rated, gear = rig.generator.speed_rated, rig.drivetrain.gear_ratio
    return Account(
        word=run.origin.word,
        rig=rig.name,
        changed=comparison.changed,
        open_circuit=run.open_circuit,
        cycles=len(comparison.cycles),
        total=comparison.total,
        rated=None if rated is None else rated.value * 30.0 / np.pi,
        gear=None if gear is None else gear.value,
        curves=curves_of(comparison),
        differences=differences_of(comparison),
        budget=budget_of(comparison),
        sweep=sweep_of(comparison) if run.open_circuit else None,
        regression=regression_of(comparison) if run.open_circuit else None,
    )
