"""The record of a reduction, which is the content of its JSON: written by `reduce` and `batch`, read by `check` and `compare`.

Versions before the present one lack some of it: what has a default here.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import msgspec
from msgspec import UNSET, UnsetType

from winchcascade.core.errors import OptionError
from winchcascade.core.run import Repairs
from winchcascade.reduction.energies import NetSpan
from winchcascade.reduction.phase_summary import PhaseSummary, mean_plateau_speed
from winchcascade.reduction.wave_energies import WaveEnergies

REDUCTION_SCHEMA: Literal["winchcascade/reduction/1"] = "winchcascade/reduction/1"

Interval95 = tuple[float, float]
"""Ends of a 95 % interval, in the unit of its metric."""

Numbers = dict[str, float | None]
"""Numbers of metrics by their names in written files; None for one that does not exist."""

NotNegative = dict[str, Annotated[float, msgspec.Meta(ge=0.0)] | None]
"""As `Numbers`, for uncertainties and deviations."""


class LogRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The log of a run: where it is, what it holds, its stated load, and Vdc / Idc as measured with its standard uncertainty.

    `simulated` is null for a log that was not simulated.
    """

    path: str
    table: str | None = None
    sha256: str
    samples: int
    fs_hz: float
    load_ohm: Annotated[float, msgspec.Meta(gt=0.0)] | None
    load_source: str
    load_measured_ohm: float | None = None
    load_measured_u_ohm: float | None = None
    open_circuit: bool
    simulated: bool | None
    about: str | None
    repairs: Repairs = "on"

    @property
    def load(self) -> float | None:
        """The load, inf for an open circuit, None for none or an unknown one. [ohm]"""
        return math.inf if self.open_circuit else self.load_ohm


MAX_SPANS = 100
"""Maximum number of places of a repair in the record."""


class FindingRecord(msgspec.Struct, frozen=True):
    """One finding, with the share of the log's samples that it removed and what it changed, null for nothing.

    `repaired` is what was changed and how many samples (0: none was taken out), in how many places, the times of the first
    `MAX_SPANS` of them, and whether it was `applied`: false where repairs are off.
    """

    kind: str
    channel: str | None
    start_s: float | None
    end_s: float | None
    count: int
    action: str
    message: str
    removed_share: float
    repaired: dict[str, Any] | None = None


class CycleRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One cycle with begin and end of its phases, their summary, its window, its metrics and their standard uncertainties. [s]

    `sensors_by_limits` is as in `UncertaintyRecord`.
    """

    cycle: int
    complete: bool
    phases: dict[str, tuple[float, float] | None]
    phase_summary: PhaseSummary
    window: dict[str, float]
    net_span: NetSpan | None = None
    energy_line_j: float | None
    energy_mech_j: float | None
    energy_gen_j: float | None
    power_line_w: float | None
    power_mech_w: float | None
    power_gen_w: float | None
    eta_trans: float | None
    eta_gen: float | None
    eta_pto: float | None
    energy_payout_j: float | None = None
    energy_returned_j: float | None = None
    energy_net_j: float | None = None
    energy_gen_cycle_j: float | None = None
    eta_net: float | None = None
    standard_uncertainty: Numbers
    sensors_by_limits: Numbers = {}
    stages: Numbers | UnsetType = UNSET

    @property
    def numbers(self) -> Numbers:
        """Metrics of the cycle by their names, those of configured stages among them."""
        own = {name: getattr(self, name) for name in _METRICS}
        return own | (self.stages or {})


_METRICS = tuple(name for name in CycleRecord.__struct_fields__ if name.startswith(("energy_", "power_", "eta_")))
"""Fields of a cycle that are metrics."""


class BudgetRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One row of the budget: in the SI unit of the channel, or relative for a gain; shares are of the mean's variance.

    `basis` is what the error is known by: a sensor has either that of its calibration in place or those of its accuracy.
    The row of the bridged gaps has a contribution and a share alone.
    """

    source: str
    part: str | UnsetType = UNSET
    unit: str | UnsetType = UNSET
    distribution: str | UnsetType = UNSET
    basis: str | UnsetType = UNSET
    limit: float | UnsetType | None = UNSET
    standard_uncertainty: float | UnsetType = UNSET
    origin: str | UnsetType | None = msgspec.field(name="from", default=UNSET)
    contribution: Numbers
    share: Numbers


class UncertaintyRecord(msgspec.Struct, frozen=True, kw_only=True):
    """How the uncertainty of the means came about: its parts, the Monte Carlo, and the budget of the sensors.

    `sensors_by_limits` is, for a check of a printed table, what the accuracies of the sensors that are calibrated in place
    would leave of the means; empty without such sensors.
    """

    seed: int
    draws: int
    stated: dict[str, str | None]
    sensors: Numbers
    sensors_by_limits: Numbers = {}
    repeatability: Numbers
    monte_carlo: Numbers
    interval_95_sensors: dict[str, Interval95 | None]
    degrees_of_freedom: Numbers
    budget: tuple[BudgetRecord, ...] = ()
    taken_as_exact: tuple[str, ...]
    without_accuracy: tuple[str, ...]
    undetermined: tuple[str, ...]


class StagesRecord(msgspec.Struct, frozen=True):
    """Numbers of the stages that a rig file configures, by name.

    `power` states of which channels the power of a stage is made, null where the log does not have them; `efficiency` from
    which stage to which an efficiency leads. `energy_out_j` is what flows with the cascade in all complete cycles, from onset
    to next onset, `energy_back_j` what flows against it, negative. `efficiency_out` are the ratios of what flows with the
    cascade, `efficiency_back` those of what flows back, which comes in at the second stage.
    """

    order: tuple[str, ...]
    power: dict[str, str | None]
    efficiency: dict[str, tuple[str, str]]
    mean: Numbers
    max_deviation_percent: Numbers
    standard_uncertainty: Numbers
    interval_95: dict[str, Interval95 | None]
    total: Numbers
    energy_out_j: Numbers = {}
    energy_back_j: Numbers = {}
    efficiency_out: Numbers = {}
    efficiency_back: Numbers = {}


Part = Literal["mean", "max_deviation_percent", "standard_uncertainty", "total"]


class RunRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The reduction of one log, schema `winchcascade/reduction/1`; numbers that do not exist are null.

    `rig` was a name alone in earlier versions. `cycles_from` is the source of cycles of the rig file, unset for the line
    velocity.
    """

    schema: Literal["winchcascade/reduction/1"]
    version: str
    data: dict[str, bool | str | None] = {}
    log: LogRecord
    rig: dict[str, Any] | str
    window: str | float
    quality: tuple[FindingRecord, ...]
    cycles: tuple[CycleRecord, ...]
    mean: Numbers
    max_deviation_percent: NotNegative
    standard_uncertainty: NotNegative
    interval_95: dict[str, Interval95 | None]
    uncertainty: UncertaintyRecord
    total: Numbers
    bins: tuple[dict[str, Any], ...]
    stages: StagesRecord | UnsetType = UNSET
    cycles_from: str | UnsetType = UNSET
    waves: WaveEnergies | UnsetType = UNSET

    @property
    def rig_name(self) -> str:
        """Name of the rig."""
        return self.rig if isinstance(self.rig, str) else str(self.rig["name"])

    @property
    def plateau_speed(self) -> float | None:
        """Mean speed of the plateaus of the complete cycles, None where there is none. [m/s]"""
        return mean_plateau_speed(cycle.phase_summary.payout for cycle in self.cycles if cycle.complete)

    @property
    def intervals(self) -> dict[str, Interval95 | None]:
        """95 % intervals of the metrics by their names, those of configured stages among them."""
        return self.interval_95 | (self.stages.interval_95 if self.stages else {})

    def numbers(self, part: Part) -> Numbers:
        """Numbers of the metrics by their names, those of configured stages among them."""
        own: Numbers = getattr(self, part)
        return own | (getattr(self.stages, part) if self.stages else {})


def run_record(content: bytes, where: str) -> RunRecord:
    """Read the JSON of a reduction.

    Parameters
    ----------
    where : name of the log or of the file, for the sentence of a fault

    Raises
    ------
    OptionError : this is no reduction
    """
    try:
        return msgspec.json.decode(content, type=RunRecord)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(
            f"{where}: is no JSON of a reduction ({fault}); expected the schema {REDUCTION_SCHEMA}, as `winchcascade "
            "reduce LOG --json FILE` writes. Reduce its log again."
        ) from None
