"""The JSON of a reduction: written by `reduce` and `batch`, read by `check` and `compare`.

It joins a `Reduction` and its `Uncertainty`. `RunRecord` declares of it what other commands read:
other entries are not looked at, and what earlier versions lack has a default.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import UNSET, UnsetType

from winchcascade.core.campaign_file import origin_record
from winchcascade.core.cascade import PAPER, Cascade
from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes
from winchcascade.core.quantity import si_unit
from winchcascade.core.run import Finding
from winchcascade.core.version import __version__
from winchcascade.reduction.bins import STORES, TORQUE, Bin
from winchcascade.reduction.efficiency import ALL_METRICS, named, ratio
from winchcascade.reduction.energies import NetSpan
from winchcascade.reduction.phase_summary import PhaseSummary, mean_plateau_speed
from winchcascade.reduction.reduction_result import Reduction, Relation
from winchcascade.reduction.uncertainty import Uncertainty, shares, uncertainty
from winchcascade.reduction.wave_energies import WaveEnergies, waves_of

REDUCTION_SCHEMA: Literal["winchcascade/reduction/1"] = "winchcascade/reduction/1"

MAX_SPANS = 100
"""Maximum number of places of a repair in the record."""

Interval95 = tuple[float, float]
"""Ends of a 95 % interval, in the unit of its metric."""

Numbers = dict[str, float | None]
"""Numbers of metrics by their names in written files; None for one that does not exist."""

NotNegative = dict[str, Annotated[float, msgspec.Meta(ge=0.0)] | None]
"""As `Numbers`, for uncertainties and deviations."""


# ----------------------------------------------------------------------------------- what is read
class LogRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The log of a run; `simulated` is null for a log that was not simulated."""

    path: str
    table: str | None = None
    sha256: str
    samples: int
    load_ohm: Annotated[float, msgspec.Meta(gt=0.0)] | None
    open_circuit: bool
    simulated: bool | None

    @property
    def load(self) -> float | None:
        """The load, inf for an open circuit, None for none or an unknown one. [ohm]"""
        return math.inf if self.open_circuit else self.load_ohm


class FindingRecord(msgspec.Struct, frozen=True):
    """One finding, with the share of the log's samples that it removed and what it changed, null
    for nothing.

    `repaired` is what was changed and how many samples (0: none was taken out), in how many places,
    the times of the first `MAX_SPANS` of them, and whether it was `applied`: false where repairs
    are off.
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
    """One cycle with begin and end of its phases, their summary, its window, its metrics and their
    standard uncertainties. [s]

    `sensors_by_limits` is as in `UncertaintyRecord`.
    """

    cycle: int
    complete: bool
    phases: dict[str, tuple[float, float] | None]
    phase_summary: PhaseSummary
    window: dict[str, float]
    net_span: NetSpan | None = None
    numbers: Numbers
    standard_uncertainty: Numbers
    sensors_by_limits: Numbers = {}


class BudgetRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One row of the budget of the sensors. The row of the bridged gaps has no part, basis and
    standard uncertainty.

    `basis` is what the error is known by: a sensor has either that of its calibration in place or
    those of its accuracy.
    """

    source: str
    part: str | None = None
    basis: str | None = None
    standard_uncertainty: float | None = None
    contribution: Numbers


class UncertaintyRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Parts of the uncertainty of the means.

    `sensors_by_limits` is, for a check of a printed table, what the accuracies of the sensors that
    are calibrated in place would leave of the means; empty without such sensors.
    """

    sensors: Numbers
    sensors_by_limits: Numbers = {}
    repeatability: Numbers
    budget: tuple[BudgetRecord, ...] = ()
    without_accuracy: tuple[str, ...]


class StagesRecord(msgspec.Struct, frozen=True):
    """Stages that a rig file configures, and of which channels the power of each is made, null
    where the log lacks them.
    """

    order: tuple[str, ...]
    power: dict[str, str | None]


MEANS = ("mean", "max_deviation_percent", "standard_uncertainty", "interval_95", "total")
"""Entries of the JSON that hold numbers of the metrics; those of configured stages stand under
`stages`.
"""


class RunRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The reduction of one log, schema `winchcascade/reduction/1`; numbers that do not exist are
    null.

    `rig` was a name alone in earlier versions. `cycles_from` is the source of cycles of the rig
    file, unset for the line velocity.
    """

    schema: Literal["winchcascade/reduction/1"]
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
    relations: tuple[Relation, ...] = ()
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
        return mean_plateau_speed(
            cycle.phase_summary.payout for cycle in self.cycles if cycle.complete
        )


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
        return _record(msgspec.json.decode(content, type=dict[str, Any]))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(
            f"{where}: is no JSON of a reduction ({fault}); expected the schema "
            f"{REDUCTION_SCHEMA}, as `winchcascade "
            "reduce LOG --json FILE` writes. Reduce its log again."
        ) from None


def read_results(results: Mapping[str, Path]) -> Iterator[tuple[str, RunRecord]]:
    """Results of logs, JSON files, one after the other, with the names of the logs."""
    for name, path in results.items():
        yield name, run_record(path.read_bytes(), name)


def reduction_record(reduction: Reduction, found: Uncertainty | None = None) -> RunRecord:
    """What other commands read of the JSON of a reduction."""
    return _record(reduction_entries(reduction, found))


def _record(entries: dict[str, Any]) -> RunRecord:
    """The record of the entries of a JSON; numbers of configured stages join the others, those of a
    cycle stand together.

    Raises
    ------
    msgspec.ValidationError : they are not those of a reduction
    """
    stages, cycles = entries.get("stages"), entries.get("cycles")
    if isinstance(stages, dict):
        pairs = {name: (entries.get(name), stages.get(name)) for name in MEANS}
        entries = entries | {
            k: a | b for k, (a, b) in pairs.items() if isinstance(a, dict) and isinstance(b, dict)
        }
    if isinstance(cycles, list):
        entries = entries | {
            "cycles": [_with_numbers(one) if isinstance(one, dict) else one for one in cycles]
        }
    return msgspec.convert(entries, RunRecord)


def _with_numbers(cycle: dict[str, Any]) -> dict[str, Any]:
    """The entries of a cycle with the numbers of its metrics together."""
    numbers = {
        name: number
        for name, number in cycle.items()
        if name.startswith(("energy_", "power_", "eta_"))
    }
    stages = cycle.get("stages")
    return cycle | {"numbers": numbers | stages if isinstance(stages, dict) else numbers}


# -------------------------------------------------------------------------------- what is written
def reduction_json(reduction: Reduction, found: Uncertainty | None = None) -> bytes:
    """The reduction of one log as JSON, schema `winchcascade/reduction/1`, with its uncertainty,
    made here if not given.
    """
    return json_bytes(reduction_entries(reduction, found))


def reduction_entries(reduction: Reduction, found: Uncertainty | None = None) -> dict[str, Any]:
    """Entries of the JSON of a reduction with its uncertainty, made here if not given."""
    found = found or uncertainty(reduction)
    run, rig, known, measured = reduction.run, reduction.rig, found.budget, reduction.measured_load
    cascade, names = rig.cascade, tuple(dict.fromkeys((*ALL_METRICS, *rig.cascade.metrics)))
    *means, (total, sums) = _means(reduction, found).items()
    record = {
        "schema": REDUCTION_SCHEMA,
        "version": __version__,
        "data": origin_record(run.origin),
        "log": {
            **{name: getattr(run, name) for name in ("path", "table", "sha256", "samples")},
            "fs_hz": run.fs,
            "load_ohm": None if run.open_circuit else run.load,
            "load_source": run.load_source,
            "load_measured_ohm": measured and measured.ohm,
            "load_measured_u_ohm": measured and measured.u,
            "open_circuit": run.open_circuit,
            "simulated": run.simulated or None,
            "about": run.about or None,
            "repairs": run.repairs,
        },
        "rig": {"name": rig.name, "assumed": rig.assumed, "r_drum_m": rig.r_drum},
        "window": reduction.window,
        "quality": [finding_record(finding, run.samples) for finding in reduction.quality],
        "cycles": [
            {
                "cycle": cycle.cycle,
                "complete": cycle.complete,
                "phases": cycle.phases.spans,
                "phase_summary": cycle.summary,
                "window": {
                    "onset_s": cycle.window.onset,
                    "cutoff_s": cycle.window.cutoff,
                    "duration_s": round(cycle.window.cutoff - cycle.window.onset, 9),
                },
                "net_span": cycle.net,
                **named(cycle.metrics),
                "standard_uncertainty": named(u, names),
                "sensors_by_limits": named(by_limits, names) if by_limits else {},
                **({"stages": named(cycle.metrics, cascade.metrics)} if cascade.configured else {}),
            }
            for cycle, u, by_limits in zip(
                reduction.cycles, known.cycles, known.cycles_by_limits, strict=True
            )
        ],
        **dict(means),
        "uncertainty": {
            "sensors": named(known.sensors, names),
            "sensors_by_limits": named(known.by_limits, names) if known.by_limits else {},
            "repeatability": named(known.repeatability, names),
            "interval_95_sensors": named(found.interval_95_sensors, names),
            "degrees_of_freedom": named(
                known.freedom, names
            ),  # JSON writes null for an infinite number
            "budget": _budget(reduction, found, names),
            "taken_as_exact": known.exact,
            "without_accuracy": known.unknown,
            "undetermined": [*named(dict.fromkeys(known.undetermined), known.undetermined)],
        },
        total: sums,
        "relations": reduction.relations,
        "bins": [_bin(one, cascade) for one in reduction.bins],
    }
    if cascade.configured:
        record["stages"] = _stages(reduction, found)
    if rig.phases.source != "velocity":
        record["cycles_from"] = rig.phases.source
    waves = waves_of(reduction)
    return record if waves is None else record | {"waves": waves}


def _means(
    reduction: Reduction, found: Uncertainty, names: Collection[str] = ALL_METRICS
) -> dict[str, Any]:
    """Means over the cycles with what is known of them, and sums, of some metrics."""
    return {
        "mean": named(reduction.mean, names),
        "max_deviation_percent": named(reduction.max_deviation_percent, names),
        "standard_uncertainty": named(found.standard, names),
        "interval_95": named(found.interval_95, names),
        "total": named(reduction.total, names),
    }


def _stages(reduction: Reduction, found: Uncertainty) -> dict[str, Any]:
    """Numbers of the stages that a rig file configures.

    `energy_out_j` is what flows with the cascade in all complete cycles, from onset to next onset,
    `energy_back_j` what flows against it, negative. `efficiency_out` are the ratios of what flows
    with the cascade, `efficiency_back` those of what flows back, which comes in at the second
    stage.
    """
    run, rig, cascade = reduction.run, reduction.rig, reduction.rig.cascade
    powers = cascade.powers(run.channels, rig.r_drum)
    out = {name: both.positive for name, both in reduction.both_ways.items()}
    back = {name: -both.negative for name, both in reduction.both_ways.items()}
    delivered = {
        e: pair
        for e, pair in cascade.pairs.items()
        if not (run.open_circuit and cascade.undelivered(e))
    }
    return {
        "order": cascade.names,
        "power": {name: powers[name].text if name in powers else None for name in cascade.names},
        "efficiency": cascade.pairs,
        **_means(reduction, found, cascade.metrics),
        "energy_out_j": out,
        "energy_back_j": {name: -joule for name, joule in back.items()},
        "efficiency_out": {eta: ratio(out.get(b), out.get(a)) for eta, (a, b) in delivered.items()},
        "efficiency_back": {
            eta: ratio(back.get(a), back.get(b)) for eta, (a, b) in delivered.items()
        },
    }


def _budget(
    reduction: Reduction, found: Uncertainty, names: Collection[str]
) -> list[dict[str, Any]]:
    """Rows of the budget: in the SI unit of the channel, or relative for a gain; shares are of
    the mean's variance.
    """
    channels, mean, rows = reduction.rig.known_channels, found.budget.mean, []
    for row in found.budget.rows:
        of: dict[str, Any] = {"source": "bridged gaps"}
        if (source := row.source) is not None:
            of = {"source": source.channel, "part": source.part}
            units = {"gain": "1", "lag": "s"}
            of["unit"] = units.get(source.part) or si_unit(channels[source.channel].dimension)
            of |= {"distribution": source.shape, "basis": source.basis, "limit": source.limit}
            of |= {"standard_uncertainty": source.u, "from": source.origin}
        rows.append(
            of | {"contribution": named(row.of, names), "share": named(shares(row.of, mean), names)}
        )
    return rows


def finding_record(finding: Finding, samples: int) -> FindingRecord:
    """One finding of a log with a given number of samples."""
    repair, repaired = finding.repaired, None
    if repair is not None:
        repaired = {"what": repair.what, "applied": repair.applied, "samples": repair.samples}
        repaired |= {"places": len(repair.spans), "spans_s": repair.spans[:MAX_SPANS]}
    return FindingRecord(
        finding.kind, finding.channel, finding.start, finding.end, finding.count, finding.action, finding.message,
        finding.lost_share(samples), repaired,
    )  # fmt: skip


def _bin(of: Bin, cascade: Cascade) -> dict[str, Any]:
    """One bin of generator speed: mean powers and torque with their standard errors, and the powers
    that are stored meanwhile.

    Those go into the rotor, the spring of the shaft and the capacitor of the DC link while the
    speed changes, null where the rig file states no inertia, stiffness or capacitance. The loss
    between shaft and DC link is P_mech - P_gen less these.
    """

    row: dict[str, Any] = {"rpm_low": of.rpm_low, "rpm_high": of.rpm_high, "count": of.count}
    row |= _with_errors(of, (*PAPER.names, TORQUE))
    row |= {f"power_{store}_w": of.mean.get(store) for store in STORES}
    return row | ({"stages": _with_errors(of, cascade.names)} if cascade.configured else {})


def _with_errors(of: Bin, names: tuple[str, ...]) -> dict[str, float | None]:
    """Means of some quantities in a bin and their standard errors, as written files call them."""
    return {
        field: (of.standard_error if error else of.mean).get(name)
        for field, name, error in _fields(names)
    }


@cache
def _fields(names: tuple[str, ...]) -> list[tuple[str, str, bool]]:
    """Fields of some quantities of a bin: the name, the quantity, and whether it is the error."""
    written = {name: "torque_nm" if name == TORQUE else f"power_{name}_w" for name in names}
    ends = ("", False), ("_standard_error", True)
    return [(field + end, name, error) for name, field in written.items() for end, error in ends]
