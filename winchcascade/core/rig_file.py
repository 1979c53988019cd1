"""A rig as data: geometry, sensors, columns, thresholds and tolerances, as a rig file states them.

A rig may lack stages and sensors: what is absent is None or not listed, and the metrics that need it are null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import msgspec

from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.phase_rule import PhaseRule
from winchcascade.core.quantity import Quantity
from winchcascade.core.run import CHANNELS, Channel


class Sensor(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One sensor: range, resolution and accuracy; in the file in its own `unit`, here in SI units.

    `accuracy_full_scale` is a share of the end of the range that is farther from zero, `accuracy_reading` of the reading;
    what is stated adds up. Accuracies are limits, or with `coverage` expanded uncertainties of that coverage factor. `daq_...`
    are the same of the acquisition system, which adds an error of its own. `u_zero` and `u_gain` are standard uncertainties of
    zero and gain of a sensor that was calibrated in place.
    """

    unit: str
    instrument: str = ""
    low: float | None = None
    high: float | None = None
    resolution: float | None = None
    accuracy: float | None = None
    accuracy_full_scale: float | None = None
    accuracy_reading: float | None = None
    coverage: float | None = None
    daq_full_scale: float | None = None
    daq_reading: float | None = None
    daq_coverage: float | None = None
    u_zero: float | None = None
    u_gain: float | None = None
    source: str = ""


Side = Literal["drum", "shaft", "generator"]
"""Where a speed of rotation is measured."""


class Column(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a log keeps a channel: the name of its column, or its number from 1 on, and the unit if the log does not name it.

    A unit in the log's header is used instead of this one, unless `override` is set. `side` is the place at which a speed
    of rotation is measured; drum and shaft turn alike while the clutch is engaged, the generator faster by the gear ratio.
    """

    name: str = ""
    unit: str | None = None
    override: bool = False
    number: int | None = None
    side: Side | None = None


class Winch(msgspec.Struct, frozen=True):
    """The drum that the tether turns."""

    r_drum: Quantity | None = None
    inertia: Quantity | None = None


class Restoring(msgspec.Struct, frozen=True):
    """Screw, piston and gas-charged accumulator that keep the tether taut."""

    lead: Quantity | None = None
    lead_angle: Quantity | None = None
    half_angle: Quantity | None = None
    mu_screw: Quantity | None = None
    area_piston: Quantity | None = None
    p_precharge: Quantity | None = None
    volume_gas: Quantity | None = None


class Drivetrain(msgspec.Struct, frozen=True):
    """Clutch, shaft, gear and fast shaft between drum and generator.

    `one_way_clutch` is None where the file does not state it: the model then has one, and bins hold whole payouts.
    """

    gear_ratio: Quantity | None = None
    eta_mesh: Quantity | None = None
    b_rotor: Quantity | None = None
    k_shaft: Quantity | None = None
    c_shaft: Quantity | None = None
    inertia_rotor: Quantity | None = None
    one_way_clutch: bool | None = None


class Generator(msgspec.Struct, frozen=True):
    """Permanent-magnet machine and its diode bridge."""

    pole_pairs: Quantity | None = None
    k_e: Quantity | None = None
    r_s: Quantity | None = None
    l_s: Quantity | None = None
    v_diode: Quantity | None = None
    speed_rated: Quantity | None = None
    i_rated: Quantity | None = None


class DcLink(msgspec.Struct, frozen=True):
    """Capacitor, bleed resistance and load behind the bridge."""

    c_dc: Quantity | None = None
    r_bleed: Quantity | None = None
    load_tolerance_percent: float = 0.0


class Thresholds(msgspec.Struct, frozen=True):
    """What decides where a phase, a window and a finding begins. SI units; defaults are the published rules."""

    window: str = "auto"
    v_onset: float = 0.03
    """Payout begins where the smoothed line velocity first exceeds this (Sec. 3.2). [m/s]"""
    smoothing: float = 0.6
    """Width of the local quadratic that smooths the line velocity for detection. [s]"""
    stroke_min: float = 0.2
    """Motions that travel less are no payout. [m]"""
    reversal_max: float = 0.5
    """A reversal inside a payout takes back less than this share of it; a haul-in takes back more. [1]"""
    creep_max: float = 0.1
    """A motion apart that stays below this share of the payout's top speed is crane creep. [1]"""
    aborted_below: float = 0.5
    """A payout that travels less than this share of the median is an aborted one (not with window `payout`). [1]"""
    plateau_quantile: float = 0.99
    plateau_band: float = 0.90
    plateau_level: float = 0.98
    plateau_hold: float = 0.2
    """The plateau begins where the velocity stays above its level for this long. [s]"""
    settle: float = 0.5
    """The window `auto` ends this long after the plateau begins. [s]"""
    tau_engaged: float = 2.0
    """With less torque on the PTO shaft than this the shaft runs free: zero and noise of the torque sensor. [N m]"""
    rpm_bin: float = 100.0
    """Width of a bin of generator speed (Sec. 3.2). [rpm]"""
    gap_max: float = 1.0
    """A longer gap inside a window makes its cycle incomplete. [s]"""
    gap_energy_max: float = 0.005
    """So does a gap whose bridging could change an energy by more than this share. [1]"""


class ModelAccuracy(msgspec.Struct, frozen=True):
    """How closely the model can follow any rig, and from which size on a cause matters.

    The model against an independent simulation with a switched circuit: means of phases within 0.08 % of their level, blocks
    scatter by 0.1 to 0.4 %.
    """

    discrepancy: float = 0.002
    """Standard deviation of a channel from the model, as a share of its plateau in the log; more data do not average it. [1]"""
    relevant_efficiency: float = 0.001
    """A cause that changes no efficiency by so much, [1]"""
    relevant_share: float = 0.003
    """and the mean of no channel in a phase by this share of its plateau, is listed as minor. [1]"""


class EffectNumber(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Value of one field of an effect that a rig file states, with the ends of its 95 % interval where they are known.

    `value`, `low` and `high` are in SI units; `unit` is that of the file, "" for the unit of the catalogue.
    """

    value: float
    unit: str = ""
    source: str = ""
    low: float | None = None
    high: float | None = None


class StatedEffect(msgspec.Struct, frozen=True):
    """An effect that a rig file states: the values of its fields by name, and the logs that they come from."""

    fields: Mapping[str, EffectNumber]
    logs: tuple[str, ...] = ()


class Rig(msgspec.Struct, frozen=True):
    """One rig, numbers in SI units. `columns` names columns of logs that the table of names does not contain.

    `channels` are those of the rig's own, beside the built-in ones.
    `effects` are those of the catalogue that the rig is known to have; they belong to its model. `note` is shown with every
    reduction: a remark on the rig for its readers.
    """

    name: str
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
    sample_rate: float | None = None
    thresholds: Thresholds = Thresholds()
    model: ModelAccuracy = ModelAccuracy()
    phases: PhaseRule = PhaseRule()
    path: str = ""

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


WindowRule = Literal["auto", "payout", "whole"] | float
"""Where the integration window ends: after the plateau begins, with the payout, or a fixed time after the onset [s]; `whole`
where cycles are spans that are found in no motion."""
