"""A rig as data: parts, sensors, columns and thresholds, as a rig file states them.

A rig may lack stages and sensors: what is absent is None or not listed, and the metrics that need
it are null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.errors import OptionError, check_type
from winchcascade.core.machine_parts import (
    DcLink,
    Drivetrain,
    Generator,
    Measure,
    Restoring,
    Winch,
    measures,
)
from winchcascade.core.phase_rule import PhaseRule
from winchcascade.core.quantity import Quantity
from winchcascade.core.toml_file import (
    Finite,
    NotNegative,
    Positive,
    Share,
    ShareOfAll,
    convert,
    struct_fields,
)

_Coverage = Annotated[float, Meta(ge=1.0, le=10.0)]


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
    accuracy_full_scale: Share | None = None
    accuracy_reading: Share | None = None
    coverage: _Coverage | None = None
    daq_full_scale: Share | None = None
    daq_reading: Share | None = None
    daq_coverage: _Coverage | None = None
    u_zero: NotNegative | None = None
    u_gain: Share | None = None
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
    reversal_max: ShareOfAll = 0.5
    """A reversal inside a payout takes back less than this share of it; a haul-in takes back
    more. [1]
    """
    creep_max: Share = 0.1
    """A motion apart that stays below this share of the payout's top speed is crane creep. [1]"""
    aborted_below: Share = 0.5
    """A payout that travels less than this share of the median is an aborted one (not with
    window `payout`). [1]
    """
    plateau_quantile: Share = 0.99
    plateau_band: Share = 0.90
    plateau_level: Share = 0.98
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
