"""A rig as data: geometry, sensors, columns, thresholds and uncertainties, as a rig file states
them.

A rig may lack stages and sensors: what is absent is None or not listed, and the metrics that need
it are null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from numbers import Real
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from winchcascade.core.campaign_file import Ranges, check_ranges
from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.errors import OptionError, check_type
from winchcascade.core.quantity import Quantity
from winchcascade.core.toml_file import convert, struct_fields

PhaseSource = Literal[
    "velocity", "displacement", "speed", "column", "ranges", "waves", "steps", "rows", "whole"
]
"""What the cycles of a log are found in."""

_Label = Annotated[str, Meta(pattern=r"\S")] | int | float
NotNegative = Annotated[float, Meta(ge=0.0, le=1e15)]
Positive = Annotated[float, Meta(gt=0.0, le=1e15)]
_ShareOfAll = Annotated[float, Meta(gt=0.0, le=1.0)]
Finite = Annotated[float, Meta(ge=-1e15, le=1e15)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Coverage = Annotated[float, Meta(ge=1.0, le=10.0)]


class PhaseRule(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    rename={"source": "from", "ranges": "ranges_s", "step_min": "step_min_s", "settle": "settle_s"},
):
    """Where cycles come from, and the thresholds of the sources that need one; each default with
    its reason.
    """

    source: PhaseSource = "velocity"
    column: str = ""
    """Column of labels, with `column`."""
    payout: tuple[_Label, ...] = ()
    """Its values in payout,"""
    haul_in: tuple[_Label, ...] = ()
    """and in haul-in."""
    ranges: Ranges = ()
    """Begin and end of each cycle on the clock of the log, with `ranges`. [s]"""
    rpm_onset: Positive = math.nan
    """The shaft turns from this speed on, with `speed`, `steps` and with `waves` of a shaft: above
    ripple and noise of usual encoders, below any operating point; by default a share of its top
    speed in the log. [rpm]"""
    turns_min: Positive = 0.25
    """Motions that turn the shaft less are no payout, with `speed`; an angle has no dimension: on
    any drum, a rope that is let out by less than twice its radius. [rev]"""
    step_min: Positive = 2.0
    """A step lasts at least this long beyond its settling, with `steps`: some revolutions at 100
    rpm. [s]
    """
    settle: Annotated[float, Meta(ge=0.0, lt=1e9)] = 0.5
    """What is left out at the beginning of each step: speed controllers and filters settle
    within it. [s]
    """
    speed_band: _ShareOfAll = 0.02
    """Width of the band in which the speed of a step stays, as a share of the largest speed of the
    log: ripple of speed controllers is below one per cent, steps of a test plan are farther apart.
    [1]"""
    torque_band: _ShareOfAll = 0.10
    """The same of the torque: cogging and brakes make it less steady. [1]"""

    def __post_init__(self) -> None:
        """Reject a source without what it needs: ValueError."""
        check_ranges(self.ranges)
        if self.source == "column" and not (self.column and self.payout):
            raise ValueError(
                'from = "column" needs the column and its values in payout; add column = "..." '
                'and payout = ["..."].'
            )

    @property
    def omega_onset(self) -> float:
        """Speed from which on the shaft turns. [rad/s]"""
        return self.rpm_onset * math.pi / 30.0

    @property
    def by_motion(self) -> bool:
        """Whether payouts are found in a motion, and windows set by the rule of the rig; else a
        window is its whole cycle.
        """
        return self.source in ("velocity", "displacement", "speed")

    @property
    def repeats(self) -> bool:
        """Whether cycles repeat one motion, so that they show a repeatability; steps and
        stretches do not.
        """
        return self.source not in ("steps", "rows", "whole")


class Measure(msgspec.Struct, frozen=True):
    """What a number of a rig file measures, as an annotation of its field, and the type of possible
    values in SI units: beyond them no rig is known, and the unit or the number is wrong.
    """

    dimension: str
    si: Any = NotNegative


class Sensor(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One sensor: range, resolution and accuracy; in the file in its own `unit`, here in SI units.

    `accuracy_full_scale` is a share of the end of the range that is farther from zero,
    `accuracy_reading` of the reading; what is stated adds up. Accuracies are limits, or with
    `coverage` expanded uncertainties of that coverage factor. `daq_...` are the same of the
    acquisition system, which adds an error of its own. `u_zero` and `u_gain` are standard
    uncertainties of zero and gain of a sensor that was calibrated in place with its acquisition
    system; each replaces the accuracies. `u_lag` is that of its delay behind the velocity [s], 0
    for channels of one logger; it replaces what a log shows of the delay.
    """

    unit: str
    instrument: str = ""
    low: Finite | None = None
    high: Finite | None = None
    resolution: NotNegative | None = None
    accuracy: NotNegative | None = None
    accuracy_full_scale: _Share | None = None
    accuracy_reading: _Share | None = None
    coverage: _Coverage | None = None
    daq_full_scale: _Share | None = None
    daq_reading: _Share | None = None
    daq_coverage: _Coverage | None = None
    u_zero: NotNegative | None = None
    u_gain: _Share | None = None
    u_lag: NotNegative | None = None
    source: str = ""

    def __post_init__(self) -> None:
        """Reject a range that is none, and shares of a full scale that is not stated:
        ValueError.
        """
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError(
                f"low {self.low:g} is not below high {self.high:g}; correct the range."
            )
        for key in ("accuracy_full_scale", "daq_full_scale"):
            if getattr(self, key) is not None and not self.full_scale:
                raise ValueError(f"{key} has no full scale; give the range as high = ... too.")

    @property
    def full_scale(self) -> float:
        """End of the range that is farther from zero; 0 where none is stated. [SI unit of the
        channel]
        """
        return max(abs(self.low or 0.0), abs(self.high or 0.0))


Side = Literal["drum", "shaft", "generator"]
"""Where a speed of rotation is measured."""


class Column(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a log keeps a channel: the name of its column, or its number from 1 on, and the unit if
    the log does not name it.

    Of several names a log has one at most; a log with none of them is read as if the channel were
    not listed. A unit in the log's header is used instead of this one, unless `override` is set.
    `side` is the place at which a speed of rotation is measured; drum and shaft turn alike while
    the clutch is engaged, the generator faster by the gear ratio.
    """

    name: str | tuple[str, ...] = ""
    unit: str | None = None
    override: bool = False
    number: Annotated[int, Meta(ge=1, le=100_000)] | None = None
    side: Side | None = None

    def __post_init__(self) -> None:
        """Reject both or neither of name and number: ValueError."""
        if bool(self.names) == (self.number is not None):
            raise ValueError(
                'expected either name = "..." or number = ..., the place of the column from 1 on.'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names that the column may have; none where it is numbered."""
        stated = (self.name,) if isinstance(self.name, str) else self.name
        return tuple(name for name in stated if name.strip())


class Winch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The drum that the tether turns.

    `motion` is where displacement and velocity are measured: by an encoder on the drum, which
    counts radius times angle, or on the line itself. A velocity that a reduction makes of the speed
    of the shaft is of the drum in any case. `line_can_push` of a rod or a rack in its place: the
    force of the line then has both signs, and is never slack.
    """

    r_drum: Annotated[
        Quantity | None, Measure("length", Annotated[float, Meta(ge=1e-3, le=100.0)])
    ] = None
    inertia: Annotated[Quantity | None, Measure("inertia")] = None
    motion: Literal["drum", "line"] = "drum"
    line_can_push: bool = False


RestoringKind = Literal["gas_screw", "spring", "counterweight", "none"]
"""What keeps the tether taut."""

NUMBERS_OF: Mapping[RestoringKind, tuple[str, ...]] = {
    "gas_screw": (
        "lead",
        "lead_angle",
        "half_angle",
        "mu_screw",
        "area_piston",
        "p_precharge",
        "volume_gas",
    ),
    "spring": ("force", "stiffness"),
    "counterweight": ("mass",),
    "none": (),
}
"""Numbers that a model needs of each kind of restoring module."""

WITH_FRICTION: tuple[RestoringKind, ...] = ("spring", "counterweight")
"""Kinds that may state a friction; that of a screw is `mu_screw`."""


class Restoring(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What keeps the tether taut: screw, piston and gas-charged accumulator, a spring, a
    counterweight, or nothing.

    `force` of a spring at zero payout, its `stiffness` and the `friction` against the motion are
    those that the line feels.
    """

    kind: RestoringKind = "gas_screw"
    lead: Annotated[Quantity | None, Measure("lead", Positive)] = None
    lead_angle: Annotated[Quantity | None, Measure("angle")] = None
    half_angle: Annotated[Quantity | None, Measure("angle")] = None
    mu_screw: Annotated[Quantity | None, Measure("number")] = None
    area_piston: Annotated[Quantity | None, Measure("area", Positive)] = None
    p_precharge: Annotated[Quantity | None, Measure("pressure")] = None
    volume_gas: Annotated[Quantity | None, Measure("volume", Positive)] = None
    force: Annotated[Quantity | None, Measure("force")] = None
    stiffness: Annotated[Quantity | None, Measure("line_stiffness")] = None
    mass: Annotated[Quantity | None, Measure("force", Positive)] = (
        None  # by its weight: a kg is read as a kgf
    )
    friction: Annotated[Quantity | None, Measure("force")] = None

    def __post_init__(self) -> None:
        """Reject numbers of another kind: ValueError."""
        other = [
            name
            for name in measures(Restoring)
            if getattr(self, name) is not None and name not in self.own
        ]
        if other:
            raise ValueError(
                f"{', '.join(other)} of another kind of restoring module: kind is {self.kind}, "
                f"which has "
                f"{', '.join(self.own) or 'no number'}. State the kind, or remove what it does "
                f"not have."
            )

    @property
    def needed(self) -> tuple[str, ...]:
        """Numbers that a model needs."""
        return NUMBERS_OF[self.kind]

    @property
    def own(self) -> tuple[str, ...]:
        """Numbers that it may have."""
        return (*self.needed, "friction") if self.kind in WITH_FRICTION else self.needed

    @property
    def has_gas(self) -> bool:
        """Whether screw, piston and gas are there, and a pressure."""
        return self.kind == "gas_screw"


class Drivetrain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Clutch, shaft, gear and high-speed shaft between drum and generator.

    With the gear ratio 1 the machine is on the shaft of the drum. `one_way_clutch` is None where
    the file does not state it: the model then has one, and bins hold whole payouts.
    """

    gear_ratio: Annotated[
        Quantity | None, Measure("number", Annotated[float, Meta(ge=1e-3, le=1e5)])
    ] = None
    eta_mesh: Annotated[Quantity | None, Measure("number", _ShareOfAll)] = None
    b_rotor: Annotated[Quantity | None, Measure("damping")] = None
    k_shaft: Annotated[Quantity | None, Measure("stiffness")] = None
    c_shaft: Annotated[Quantity | None, Measure("damping")] = None
    inertia_rotor: Annotated[Quantity | None, Measure("inertia")] = None
    one_way_clutch: bool | None = None

    @property
    def direct(self) -> bool:
        """Whether there is no gear, so that its mesh efficiency is 1."""
        return (
            self.gear_ratio is not None and self.gear_ratio.value == 1.0 and self.eta_mesh is None
        )


class Generator(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Permanent-magnet machine and its diode bridge."""

    pole_pairs: Annotated[Quantity | None, Measure("number")] = None
    k_e: Annotated[Quantity | None, Measure("back_emf", Positive)] = None
    r_s: Annotated[Quantity | None, Measure("resistance")] = None
    l_s: Annotated[Quantity | None, Measure("inductance")] = None
    v_diode: Annotated[Quantity | None, Measure("voltage")] = None
    speed_rated: Annotated[Quantity | None, Measure("rotation")] = None
    i_rated: Annotated[Quantity | None, Measure("current")] = None


_LoadPercent = Annotated[float, Meta(ge=0.0, lt=1e9)]


class DcLink(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Capacitor, bleed resistance and load behind the bridge.

    The uncertainty of a load is one standard uncertainty or the +- limits of its maker, in percent
    of the load.
    """

    c_dc: Annotated[Quantity | None, Measure("capacitance")] = None
    r_bleed: Annotated[Quantity | None, Measure("resistance")] = None
    load_u_percent: _LoadPercent = 0.0
    load_limits_percent: _LoadPercent = 0.0

    def __post_init__(self) -> None:
        """Reject two uncertainties of a load: ValueError."""
        if self.load_u_percent and self.load_limits_percent:
            raise ValueError(
                "load_u_percent and load_limits_percent are both there; expected one of them."
            )

    @property
    def load_u(self) -> float:
        """Standard uncertainty of a load as a share of it; limits are those of a rectangular
        distribution. [1]
        """
        return (self.load_u_percent + self.load_limits_percent / math.sqrt(3.0)) / 100.0


class Thresholds(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What decides where a phase, a window and a finding begins. SI units; the shares are the
    published rules.

    A threshold with a dimension is NaN where the rig file does not state it; it follows the scales
    of a log once that is read (`core.log_thresholds`).
    """

    window: Literal["auto", "payout"] | Annotated[float, Meta(gt=0.0, lt=1e9)] = "auto"
    v_onset: Annotated[Positive, Measure("velocity")] = math.nan
    """Payout begins where the smoothed line velocity first exceeds this (Sec. 3.2). [m/s]"""
    smoothing: Annotated[Positive, Measure("time")] = math.nan
    """Width of the local quadratic that smooths the line velocity for detection. [s]"""
    stroke_min: Annotated[Positive, Measure("length")] = math.nan
    """Motions that travel less are no payout. [m]"""
    reversal_max: _ShareOfAll = 0.5
    """A reversal inside a payout takes back less than this share of it; a haul-in takes back
    more. [1]
    """
    creep_max: _Share = 0.1
    """A motion apart that stays below this share of the payout's top speed is crane creep. [1]"""
    aborted_below: _Share = 0.5
    """A payout that travels less than this share of the median is an aborted one (not with
    window `payout`). [1]
    """
    plateau_quantile: _Share = 0.99
    plateau_band: _Share = 0.90
    plateau_level: _Share = 0.98
    plateau_hold: Annotated[Positive, Measure("time")] = math.nan
    """The plateau begins where the velocity stays above its level for this long. [s]"""
    settle: Annotated[NotNegative, Measure("time")] = math.nan
    """The window `auto` ends this long after the plateau begins. [s]"""
    tau_engaged: Annotated[NotNegative, Measure("torque")] = math.nan
    """With less torque on the PTO shaft than this the shaft runs free: zero and noise of the
    torque sensor. [N m]
    """
    rpm_bin: Positive = math.nan
    """Width of a bin of generator speed (Sec. 3.2), by default a round one that makes 20 to 50
    bins. [rpm]
    """
    gap_max: Annotated[NotNegative, Measure("time")] = math.nan
    """A longer gap inside a window makes its cycle incomplete. [s]"""
    gap_energy_max: NotNegative = 0.005
    """So does a gap whose bridging could change an energy by more than this share. [1]"""


_ModelShare = Annotated[float, Meta(ge=0.0, le=0.5)]


class ModelAccuracy(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How closely the model can follow any rig, and from which size on a cause matters.

    The model against an independent simulation with a switched circuit: means of phases within 0.08
    % of their level, blocks scatter by 0.1 to 0.4 %.
    """

    discrepancy: _ModelShare = 0.002
    """Standard deviation of a channel from the model, as a share of its plateau in the log; more
    data do not average it. [1]
    """
    relevant_efficiency: _ModelShare = 0.001
    """A cause that changes no efficiency by so much, [1]"""
    relevant_share: _ModelShare = 0.003
    """and the mean of no channel in a phase by this share of its plateau, is listed as minor.
    [1]
    """


class EffectNumber(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Value of one field of an effect that a rig file states, with the ends of its 95 % interval
    where they are known.

    `value`, `low` and `high` are in SI units; `unit` is that of the file, "" for the unit of the
    catalogue.
    """

    value: Finite
    unit: str = ""
    source: str = ""
    low: Finite | None = None
    high: Finite | None = None


class StatedEffect(msgspec.Struct, frozen=True):
    """An effect that a rig file states: the values of its fields by name, and the logs that they
    come from.

    `of_a_sensor`: it stands under [sensors.errors], as it changes what is read of the rig, and not
    the rig.
    """

    fields: Mapping[str, EffectNumber]
    logs: tuple[str, ...] = ()
    of_a_sensor: bool = False

    def table(self, name: str) -> str:
        """Name of its table in the rig file."""
        return f"sensors.errors.{name}" if self.of_a_sensor else f"effects.{name}"


@cache
def measures(kind: type[msgspec.Struct]) -> dict[str, Measure]:
    """What the numbers of a part of a rig measure, by their names."""
    return {
        f.name: note
        for f in struct_fields(kind)
        for note in get_args(f.type)
        if isinstance(note, Measure)
    }


def _is_stated(value: object) -> bool:
    """Whether a threshold has a value that a file can state: NaN follows the log, and inf is
    never reached.
    """
    return not isinstance(value, float) or math.isfinite(value)


def _plain(value: object) -> object:
    """A number of any kind as one of Python; anything else as it is."""
    return float(value) if isinstance(value, Real) else value


class StatedLaw(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The number of a known law of a stage, in the SI unit of the law, with one standard
    uncertainty.
    """

    value: Annotated[float, Meta(ge=-1e30, le=1e30)]  # hydraulic numbers are large in SI units
    unit: str
    u: Annotated[float, Meta(ge=0.0, le=1e30)] = 0.0
    source: str = ""


class Rig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One rig, numbers in SI units. `columns` names columns of logs that the table of names does
    not contain.

    `channels` are those of the rig's own, beside the built-in ones. `effects` are those of the
    catalogue that the rig is known to have; they belong to its model. `laws` are known losses and
    stores between a stage and the one before it, by the name of the stage. `note` is shown with
    every reduction: a remark on the rig for its readers. `assumed`: it was taken because none was
    named. `inherited` are the numbers, as `generator.k_e`, that come from the rig it is based on.
    """

    name: Annotated[str, Meta(pattern=r"\S")]
    title: str = ""
    source: str = ""
    note: str = ""
    winch: Winch = Winch()
    restoring: Restoring = Restoring()
    drivetrain: Drivetrain = Drivetrain()
    generator: Generator = Generator()
    dc_link: DcLink = DcLink()
    sensors: Mapping[str, Sensor] = msgspec.field(default_factory=dict)
    columns: Mapping[str, Column] = msgspec.field(default_factory=dict)
    channels: Mapping[str, Channel] = msgspec.field(default_factory=dict)
    effects: Mapping[str, StatedEffect] = msgspec.field(default_factory=dict)
    cascade: Cascade = PAPER
    laws: Mapping[str, Mapping[str, StatedLaw]] = msgspec.field(default_factory=dict)
    sample_rate: float | None = None
    thresholds: Thresholds = Thresholds()
    model: ModelAccuracy = ModelAccuracy()
    phases: PhaseRule = PhaseRule()
    path: str = ""
    assumed: bool = False
    inherited: frozenset[str] = frozenset()

    def states(self, *paths: str) -> bool:
        """Whether some numbers, as `generator.k_e`, come from no rig that this one is based on."""
        return self.inherited.isdisjoint(paths)

    def __post_init__(self) -> None:
        """Reject parts and numbers of a rig that was made in Python, which no rig file may
        state: OptionError.
        """
        for name, kind in {**PARTS, "cascade": Cascade}.items():
            check_type(f"Rig, {name}", getattr(self, name), kind, "load_rig(name)")
        stated = {f.name: getattr(self.thresholds, f.name) for f in struct_fields(Thresholds)}
        convert(
            {name: _plain(x) for name, x in stated.items() if _is_stated(x)},
            Thresholds,
            "Rig, thresholds",
            OptionError,
        )
        check_type("Rig, sensors", self.sensors, Mapping, "load_rig(name)")
        for name, sensor in self.sensors.items():
            check_type(f"Rig, sensors {name}", sensor, Sensor, "load_rig(name)")
        for name, kind in PARTS.items():
            for number, measure in measures(kind).items() if kind is not Thresholds else ():
                value = getattr(getattr(self, name), number)
                if value is not None:
                    check_type(f"Rig, {name} {number}", value, Quantity, 'Quantity(0.13, "m")')
                    convert(
                        _plain(value.value),
                        measure.si,
                        f"Rig, {name} {number} in SI units",
                        OptionError,
                    )

    @property
    def known_channels(self) -> Mapping[str, Channel]:
        """Built-in channels, then those of the rig's own."""
        return {**CHANNELS, **self.channels} if self.channels else CHANNELS

    @property
    def r_drum(self) -> float | None:
        """Radius of the drum, None where it is not published. [m]"""
        return None if self.winch.r_drum is None else self.winch.r_drum.value

    @property
    def rpm_per_velocity(self) -> float | None:
        """Generator speed over line velocity while the clutch is engaged. [rpm s/m]"""
        gear = self.drivetrain.gear_ratio
        if self.r_drum is None or gear is None:
            return None
        return gear.value / self.r_drum * 30.0 / math.pi


PARTS: dict[str, Any] = {
    "winch": Winch, "restoring": Restoring, "drivetrain": Drivetrain, "generator": Generator, "dc_link": DcLink,
    "thresholds": Thresholds, "model": ModelAccuracy, "phases": PhaseRule,
}  # fmt: skip
"""Tables of a rig file that a struct declares whole."""

WindowRule = Literal["auto", "payout", "whole"] | float
"""Where the integration window ends: after the plateau begins, with the payout, or a fixed time
after the onset [s]; `whole` where cycles are spans that are found in no motion."""
