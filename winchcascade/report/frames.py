"""Results as rows of tables, which Parquet files and pandas frames hold: units are in the names of
the columns or in a column of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from winchcascade.core.cascade import PAPER, Cascade, field_of
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.files import check_replaceable, write_whole
from winchcascade.core.quantity import si_unit
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Run
from winchcascade.core.store import make_one
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.reduction.run_record import (
    REDUCTION_SCHEMA,
    RunRecord,
    finding_record,
    reduction_record,
)

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from winchcascade.comparison.comparison_result import Comparison
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
    from winchcascade.reduction.campaign_record import CampaignReduction
    from winchcascade.reduction.reduction_result import Reduction
    from winchcascade.rig.simulate import Simulation


_PARAMETER = ("value", "low", "high")


def reduction_frame(reduction: Reduction, table: str) -> pd.DataFrame:
    """Cycles, bins of generator speed, findings, or samples of the channels of a reduction."""
    if table == "channels":
        return samples_frame(reduction)
    rows = table_rows(reduction.run.name, reduction_record(reduction))[table]
    return _frame(rows, table_schema(table, cascades=[reduction.rig.cascade]))


def campaign_frame(campaign: CampaignReduction, table: str) -> pd.DataFrame:
    """The runs of a campaign, or the cycles, bins or findings of all of them."""
    rows = [
        row for name, record in campaign.records.items() for row in table_rows(name, record)[table]
    ]
    return _frame(rows, table_schema(table, cascades=campaign.cascades))


def _frame(rows: list[Row], schema: pa.Schema) -> pd.DataFrame:
    """A frame with the columns of a schema, in its order and of its types, also without rows."""
    import pyarrow as pa

    found: pd.DataFrame = pa.Table.from_pylist(rows, schema=schema).to_pandas()
    return found


def run_frame(run: Run, channels: Mapping[str, Channel] = CHANNELS) -> pd.DataFrame:
    """Stamps [s] and channels of a log after the checks, a row for each sample.

    Parameters
    ----------
    channels : declarations of the channels, which hold their dimensions
    """
    import pandas as pd

    columns = {"time_s": run.t}
    for name, x in run.channels.items():
        unit = si_unit(channels[name].dimension) if name in channels else "1"
        short = "" if unit == "1" else unit.lower().replace("/", "p").replace(".", "")
        columns[f"{name}_{short}" if short else name] = x
    return pd.DataFrame(columns)


def simulation_frame(found: Simulation) -> pd.DataFrame:
    """What the sensors of a simulated log give, and what has no sensor: speed, current and
    torque of the generator.
    """
    return log_frame(found.run).assign(
        speed_gen_rpm=found.rpm_gen, i_s_a=found.i_s, torque_em_nm=found.torque_em
    )


def record_frame(records: object) -> pd.DataFrame:
    """Records of a JSON as a frame, names of nested ones joined."""
    import pandas as pd

    return pd.json_normalize(msgspec.to_builtins(records), sep="_")


def log_frame(run: Run, table: str = "channels") -> pd.DataFrame:
    """Channels of a log, or findings of its checks when it was read, a row for each."""
    if table == "findings":
        return _frame(finding_rows(run), table_schema("findings"))
    return run_frame(run, given_rig("to_pandas", None, run.rig).known_channels)


def samples_frame(reduction: Reduction) -> pd.DataFrame:
    """Channels and powers of the stages of every sample, its cycle and phase, and whether it lies
    in an integration window.

    Before the first onset, between cycles and after the last the cycle is missing and the phase is
    empty.
    """
    import pandas as pd

    run, rig = reduction.run, reduction.rig
    frame = run_frame(run, rig.known_channels)
    for stage in rig.cascade.stages:
        watts = stage.watts(run.channels, rig.r_drum)
        if watts is not None:
            frame[f"power_{stage.name}_w"] = watts
    cycle, phase = np.zeros(run.t.size, dtype=np.int64), np.full(run.t.size, "", dtype=object)
    inside = np.zeros(run.t.size, dtype=bool)
    for one in reduction.cycles:
        for name, span in one.phases.spans.items():
            if span is not None:
                here = slice(*np.searchsorted(run.t, span, side="left").tolist())
                cycle[here], phase[here] = one.cycle, name
        inside |= (run.t >= one.window.onset) & (run.t <= one.window.cutoff)
    frame["cycle"] = pd.Series(cycle, dtype="Int64").mask(cycle == 0)
    frame["phase"] = pd.Series(phase, dtype="str")
    frame["in_window"] = inside
    return frame


def _with_unit(row: Row, unit: str) -> Row:
    """A row with the unit of its numbers; its load as a number."""
    load = row.get("load_ohm")  # inf is a text in JSON
    return {**row, "unit": unit, "load_ohm": None if load is None else float(load)}


def _metric_unit(metric: str) -> str:
    """Unit of a metric or of the mean of a channel."""
    if metric.startswith("eta_"):
        return "1"
    if metric in CHANNELS:
        return si_unit(CHANNELS[metric].dimension)
    return "J" if metric.endswith("_j") else "W"


def comparison_frame(found: Comparison) -> pd.DataFrame:
    """A row for each difference of a comparison."""
    from winchcascade.report.results.comparison import difference_record

    rows = []
    for runs in found.runs:
        for one in runs.differences:
            ends = dict(zip(("low_95", "high_95"), one.interval or (None, None), strict=True))
            row = (
                {"run": runs.label, "load_ohm": runs.load, "metric": field_of(one.metric)}
                | difference_record(one)
                | ends
            )
            rows.append(_with_unit(row, _metric_unit(row["metric"])))
    return _frame(rows, table_schema("differences"))


def diagnosis_frame(found: DiagnosisResult, table: str) -> pd.DataFrame:
    """One table of a diagnosis, in a row for each number: causes, parts of metrics, places of
    the map, causes run by run.
    """
    from winchcascade.report.results.diagnosis_record import as_json, map_record

    if table == "map":
        rows = [
            _with_unit(place, si_unit(CHANNELS[place["channel"]].dimension))
            for place in map_record(found)
        ]
    elif table == "contributions":
        rows = [
            _with_unit(one | part, _metric_unit(one["metric"]))
            for one in as_json(found).get("contributions", [])
            for part in one["parts"] or [dict.fromkeys(("effect", "kind", *_PARAMETER))]
        ]
    else:
        parts = _numbers_of if table == "causes" else _run_by_run
        rows = [
            _with_unit(one, named.parameters[one["parameter"]].unit)
            for cause, named in zip(as_json(found)["causes"], found.causes, strict=True)
            for one in parts(cause)
        ]
    return _frame(rows, table_schema(table))


def _numbers_of(cause: Row) -> list[Row]:
    """A row for each number of a cause."""
    rivals = ", ".join(rival["effect"] for rival in cause["rivals"])
    return [
        {**cause, "parameter": name, "alternatives": rivals, **number}
        for name, number in cause["parameters"].items()
    ]


def _run_by_run(cause: Row) -> list[Row]:
    """A row for each run of a cause that is estimated run by run, by the first of its numbers."""
    return [
        {**one, "effect": cause["effect"], "parameter": next(iter(cause["parameters"]))}
        for one in cause.get("stability", [])
    ]


Row = dict[str, Any]
"""Values of a table by column."""

RUN_ENDS = ("", "_standard_uncertainty", "_low_95", "_high_95", "_max_deviation_percent")
"""What follows the name of a metric in the columns of the table of runs; the last is in percent."""

RUNS_MAX = 25
"""Columns of the table of runs at most: more do not fit on a screen; `runs_all` has all."""

_KINDS = {
    "eta": ("", "_standard_uncertainty", "_max_deviation_percent"),
    "energy": ("",),
    "power": ("",),
}
"""Kinds of metrics in the order of the table of runs, and what follows their names there."""

_METRICS = " ".join(FIELDS.values())
_BINNED = ("power_line_w", "power_mech_w", "power_gen_w", "torque_nm")
COLUMNS = {
    "runs": """run:str log:str load_ohm plateau_speed_mps rig:str window:str measured:bool
        cycles:int complete:int findings:int""",
    "runs_all": f"""run:str log:str load_ohm plateau_speed_mps sha256:str rig:str window:str measured:bool origin:str
        samples:int cycles:int complete:int findings:int
        {" ".join(f"{field}{end}" for field in FIELDS.values() for end in RUN_ENDS)}""",
    "cycles": f"""run:str log:str load_ohm cycle:int complete:bool onset_s cutoff_s duration_s {_METRICS}
        payout_begin_s payout_end_s hold_begin_s hold_end_s haul_in_begin_s haul_in_end_s
        payout_duration_s payout_travel_m payout_speed_max_mps
        plateau_begin_s plateau_braking_s plateau_speed_mps plateau_force_n plateau_torque_nm
        plateau_power_line_w plateau_power_mech_w plateau_power_gen_w
        hold_duration_s hold_force_n hold_torque_nm hold_pressure_kgcm2
        haul_in_duration_s haul_in_speed_max_mps haul_in_force_n haul_in_force_min_n haul_in_energy_line_j
        net_begin_s net_end_s net_travel_m net_reason:str""",
    "bins": f"""run:str log:str load_ohm rpm_low rpm_high count:int
        {" ".join(f"{name} {name}_standard_error" for name in _BINNED)} power_rotor_w power_spring_w power_capacitor_w""",
    "findings": """run:str log:str load_ohm kind:str channel:str start_s end_s count:int action:str message:str
        removed_share repair:str repair_applied:bool""",
    "causes": """effect:str label:str stage:str probability parameter:str value low high unit:str at_limit:str
        beyond_range:bool alternatives:str""",
    "contributions": """run:str load_ohm plateau_speed_mps metric:str as_given measured effect:str kind:str
        value low high unit:str""",
    "map": "file:str load_ohm channel:str phase:str blocks:int bias rms noise u_noise u_repeat "
    "u_tolerance unit:str z",
    "stability": "effect:str parameter:str run:str value low high unit:str reason:str",
    "differences": """run:str load_ohm metric:str a b difference relative low_95 high_95 standard_uncertainty
        degrees_of_freedom excludes_zero:bool repeatability sensors unit:str""",
}
"""Columns of each table, in order, with their types; those without are numbers."""


def table_schema(
    table: str, about: Mapping[str, str] | None = None, cascades: Iterable[Cascade] = ()
) -> pa.Schema:
    """Arrow schema of a table.

    Parameters
    ----------
    about : metadata of the table
    cascades : those of the rigs of the logs; metrics of their own stages come last
    """
    import pyarrow as pa

    kinds = {"str": pa.string(), "": pa.float64(), "int": pa.int64(), "bool": pa.bool_()}
    columns = COLUMNS[table].split()
    columns += (
        _metrics_of_runs(cascades)[: RUNS_MAX - len(columns)]
        if table == "runs"
        else _own(table, cascades)
    )
    fields = [
        (name, kinds[kind]) for name, _, kind in (column.partition(":") for column in columns)
    ]
    return pa.schema(fields, metadata=dict(about or {}))


def _metrics_of_runs(cascades: Iterable[Cascade]) -> list[str]:
    """Columns of the metrics in the table of runs: efficiencies with uncertainty and deviation,
    energies, powers.

    Those of the stages that the rigs have, of the paper's without a rig; of whole cycles only
    `runs_all` has them.
    """
    metrics = dict.fromkeys(m for cascade in list(cascades) or [PAPER] for m in cascade.metrics)
    return [
        f"{field_of(m)}{end}"
        for kind, ends in _KINDS.items()
        for m in metrics
        if m.startswith(f"{kind}_")
        for end in ends
    ]


def _own(table: str, cascades: Iterable[Cascade]) -> list[str]:
    """Columns of the metrics of stages of rig files in any other table."""
    own = sorted({m for cascade in cascades for m in cascade.metrics if m not in FIELDS})
    return [f"{field_of(m)}{end}" for m in own for end in _own_ends(table, m)]


def _own_ends(table: str, metric: str) -> tuple[str, ...]:
    """What follows the name of a metric of a stage of a rig file in the columns of a table."""
    binned = ("", "_standard_error") if metric.startswith("power") else ()
    ends: dict[str, tuple[str, ...]] = {"runs_all": RUN_ENDS, "cycles": ("",), "bins": binned}
    return ends.get(table, ())


# --------------------------------------------------------------------------- tables of reductions
def write_parquet(reduction: Reduction, folder: Path, *, force: bool = False) -> list[Path]:
    """Write cycles, bins and findings of one log as Parquet tables, with names and units as in the
    JSON.

    Raises
    ------
    OutputError : the folder cannot be made, or holds a file of that name that this tool did not
        write
    """
    import pyarrow as pa
    from pyarrow import parquet

    make_one(folder)
    stem = Path(reduction.run.name).name
    files = {table: folder / f"{stem}.{table}.parquet" for table in ("cycles", "bins", "findings")}
    for path in files.values():
        check_replaceable(path, force=force)
    run, cascade = reduction.run, reduction.rig.cascade
    about = {
        "schema": REDUCTION_SCHEMA,
        "log": run.name,
        "sha256": run.sha256,
        "rig": reduction.rig.name,
    }
    about |= {} if run.load is None else {"load_ohm": repr(run.load)}
    rows = table_rows(run.name, reduction_record(reduction))
    for table, path in files.items():
        content = pa.Table.from_pylist(rows[table], schema=table_schema(table, about, [cascade]))
        write_whole(path, partial(parquet.write_table, content), force=force)
    return list(files.values())


def table_rows(run: str, record: RunRecord) -> dict[str, list[Row]]:
    """Rows of the tables of one log from its record; an open circuit is inf ohm.

    Names beyond the schema of a table do no harm.
    """
    begin: Row = {"run": run, "log": record.log.path, "load_ohm": record.log.load}
    cycles, bins, findings = msgspec.to_builtins((record.cycles, record.bins, record.quality))
    runs = [begin | _flat_run(record)]
    return {
        "runs": runs,
        "runs_all": runs,
        "cycles": [begin | _flat_cycle(one) for one in cycles],
        "bins": [begin | one | one.get("stages", {}) for one in bins],
        "findings": [_flat_finding(begin, one) for one in findings],
    }


def _flat_run(record: RunRecord) -> Row:
    """A log in one row: means with their uncertainties, 95 % intervals and maximum deviations."""
    row: Row = {
        "plateau_speed_mps": record.plateau_speed,
        "sha256": record.log.sha256,
        "rig": record.rig_name,
        "window": record.window if isinstance(record.window, str) else f"{record.window:g}",
        "measured": record.data["measured"],
        "origin": record.data["origin"],
        "samples": record.log.samples,
        "cycles": len(record.cycles),
        "complete": sum(c.complete for c in record.cycles),
        "findings": len(record.quality),
    }
    u, deviation = record.standard_uncertainty, record.max_deviation_percent
    for field, mean in record.mean.items():
        values = (mean, u[field], *(record.interval_95[field] or (None, None)), deviation[field])
        row |= {f"{field}{end}": value for end, value in zip(RUN_ENDS, values, strict=True)}
    return row


def _flat_cycle(cycle: Row) -> Row:
    """A cycle in one row: nested names joined, phases as begin and end."""
    row = {**cycle, **cycle["window"], **cycle["numbers"]}
    for phase, span in cycle["phases"].items():
        row[f"{phase}_begin_s"], row[f"{phase}_end_s"] = span or (None, None)
    summary = cycle["phase_summary"]
    parts = {**summary, "plateau": summary["payout"]["plateau"], "net": cycle["net_span"]}
    for prefix in ("net", "payout", "plateau", "hold", "haul_in"):
        row |= {f"{prefix}_{name}": value for name, value in (parts[prefix] or {}).items()}
    return row


def _flat_finding(begin: Row, finding: Row) -> Row:
    """A finding in one row, with what it changed of the log."""
    repaired = finding["repaired"] or {}
    return (
        begin
        | finding
        | {"repair": repaired.get("what"), "repair_applied": repaired.get("applied")}
    )


def finding_rows(run: Run) -> list[Row]:
    """Rows of the table of findings of a log that is not reduced."""
    begin: Row = {"run": run.name, "log": run.path, "load_ohm": run.load}
    found = msgspec.to_builtins([finding_record(finding, run.samples) for finding in run.findings])
    return [_flat_finding(begin, one) for one in found]
