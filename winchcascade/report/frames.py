"""Results as rows of tables, units in the names of the columns: Parquet tables, and pandas frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from msgspec import UNSET
from msgspec.structs import asdict

from winchcascade.core.cascade import Cascade, field_of
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.errors import OptionError, check_choice
from winchcascade.core.files import check_replaceable, write_whole
from winchcascade.core.quantity import KGF, si_unit
from winchcascade.core.run import Run, Units
from winchcascade.core.store import make_one
from winchcascade.diagnosis.diagnosis_result import NamedCause
from winchcascade.reduction.efficiency import FIELDS, Metrics
from winchcascade.reduction.energies import NetSpan
from winchcascade.reduction.phase_summary import HaulInSummary, PlateauSummary
from winchcascade.reduction.run_record import (
    REDUCTION_SCHEMA,
    BinRecord,
    CycleRecord,
    FindingRecord,
    HoldRecord,
    PhasesRecord,
    RunRecord,
    WindowRecord,
)
from winchcascade.report.records import bin_record, cycle_record, finding_record

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from numpy.typing import NDArray

    from winchcascade.comparison.comparison_result import Comparison
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
    from winchcascade.reduction.reduction_result import Reduction


Row = dict[str, object]
"""Values of a table by column."""


def parquet_files(folder: Path, log: str) -> dict[str, Path]:
    """The Parquet files of one log in a folder, by table."""
    stem = Path(log).name
    return {table: folder / f"{stem}.{table}.parquet" for table in ("cycles", "bins", "findings")}


def write_parquet(reduction: Reduction, folder: Path, *, force: bool = False) -> list[Path]:
    """Write cycles, bins and findings of one log as Parquet tables, with names and units as in the JSON.

    Raises
    ------
    OutputError : the folder cannot be made, or holds a file of that name that this tool did not write
    """
    from pyarrow import parquet

    make_one(folder, "another")
    files = parquet_files(folder, reduction.run.name)
    for path in files.values():
        check_replaceable(path, force=force)
    run, cascade = reduction.run, reduction.rig.cascade
    about = {"schema": REDUCTION_SCHEMA, "log": run.name, "sha256": run.sha256, "rig": reduction.rig.name}
    about |= {} if run.load is None else {"load_ohm": repr(run.load)}
    rows = reduction_rows(reduction)
    for table, path in files.items():
        content = arrow_table(rows[table], table_schema(table, about, [cascade]))
        write_whole(path, lambda part, content=content: parquet.write_table(content, part), force=force)  # type: ignore[misc]
    return list(files.values())


def reduction_rows(reduction: Reduction) -> dict[str, list[Row]]:
    """Rows of the tables `cycles`, `bins` and `findings` of a reduction; an open circuit is inf ohm."""
    run, cascade = reduction.run, reduction.rig.cascade
    begin: Row = {"run": run.name, "log": run.path, "load_ohm": run.load}
    return {
        "cycles": [begin | _flat_cycle(cycle_record(c, Metrics(), cascade)) for c in reduction.cycles],
        "bins": [begin | _flat_bin(bin_record(b, cascade)) for b in reduction.bins],
        "findings": [begin | _flat_finding(finding_record(f, run.samples)) for f in reduction.quality],
    }


def table_schema(table: str, about: Mapping[str, str], cascades: Iterable[Cascade] = ()) -> pa.Schema:
    """Arrow schema of one of the tables `runs`, `cycles`, `bins` and `findings`; each row begins with run, log and load.

    Parameters
    ----------
    about : metadata of the table
    cascades : those of the rigs of the logs; metrics of their own stages come last
    """
    columns: dict[str, type] = {"run": str, "log": str, "load_ohm": float, **_COLUMNS[table]}
    own = {m for cascade in cascades for m in cascade.metrics if m not in FIELDS}
    columns |= {f"{field_of(m)}{end}": float for m in sorted(own) for end in _own_ends(table, m)}
    return arrow_schema(columns, about)


def arrow_schema(columns: Mapping[str, type], about: Mapping[str, str] | None = None) -> pa.Schema:
    """Arrow schema of columns of texts, numbers and truth values, with metadata."""
    import pyarrow as pa

    kinds = {str: pa.string(), float: pa.float64(), int: pa.int64(), bool: pa.bool_()}
    return pa.schema([pa.field(name, kinds[kind]) for name, kind in columns.items()], metadata=dict(about or {}))


def arrow_table(rows: Sequence[Row], schema: pa.Schema) -> pa.Table:
    """Arrow table of rows with the columns of `arrow_schema`; what a row lacks is null.

    Arrow's own conversion of lists imports pandas, which takes as long as the tables of hundreds of logs.
    """
    import pyarrow as pa

    arrays = [_arrow_array(_column(rows, field.name), field.type) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)


def _column(rows: Sequence[Row], name: str) -> list[Any]:
    """Values of a column, None where a row has none."""
    try:
        return list(map(itemgetter(name), rows))
    except KeyError:
        return [row.get(name) for row in rows]


def _arrow_array(values: Sequence[Any], kind: pa.DataType) -> pa.Array:
    """Array of texts, numbers or truth values by the buffers of Arrow's columnar format; None is null."""
    import pyarrow as pa

    missing, dense = None, values
    if None in values:
        missing = pa.py_buffer(_bits(np.array([value is not None for value in values])))
        nothing: Any = "" if pa.types.is_string(kind) else 0
        dense = [nothing if value is None else value for value in values]
    if pa.types.is_string(kind):
        texts = [text.encode() for text in dense]
        buffers = [np.cumsum([0, *map(len, texts)], dtype=np.int32).tobytes(), b"".join(texts)]
    else:
        numbers = np.array(dense, dtype=kind.to_pandas_dtype())
        buffers = [_bits(numbers) if pa.types.is_boolean(kind) else numbers.tobytes()]
    return pa.Array.from_buffers(kind, len(values), [missing, *map(pa.py_buffer, buffers)])


def _bits(values: NDArray[np.bool_]) -> bytes:
    """Truth values as Arrow keeps them, eight in a byte, the first in the lowest bit."""
    return np.packbits(values, bitorder="little").tobytes()


def table_rows(run: str, record: RunRecord) -> dict[str, list[Row]]:
    """Rows of the tables `runs`, `cycles`, `bins` and `findings` of one log from its record; an open circuit is inf ohm."""
    log = record.log
    begin: Row = {"run": run, "log": log.path, "load_ohm": math.inf if log.open_circuit else log.load_ohm}
    return {
        "runs": [begin | _flat_run(record)],
        "cycles": [begin | _flat_cycle(c) for c in record.cycles],
        "bins": [begin | _flat_bin(b) for b in record.bins],
        "findings": [begin | _flat_finding(f) for f in record.quality],
    }


def _flat_run(record: RunRecord) -> Row:
    """A log in one row: means with their uncertainties, 95 % intervals and largest deviations."""
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
    mean, u, deviation = record.mean, record.standard_uncertainty, record.max_deviation_percent
    intervals = record.interval_95
    if record.stages is not UNSET:
        own = record.stages
        mean, u, deviation = mean | own.mean, u | own.standard_uncertainty, deviation | own.max_deviation_percent
        intervals = intervals | own.interval_95
    for field in mean:
        values = (mean[field], u[field], *(intervals[field] or (None, None)), deviation[field])
        row |= {f"{field}{end}": value for end, value in zip(RUN_ENDS, values, strict=True)}
    return row


def _flat_cycle(record: CycleRecord) -> Row:
    """A cycle in one row: nested names joined, phases as begin and end; names beyond the schema of the table do no harm."""
    own = asdict(record)
    row: Row = {name: own[name] for name in ("cycle", "complete", *FIELDS.values())} | asdict(record.window)
    row |= {} if record.stages is UNSET else record.stages
    for phase, span in asdict(record.phases).items():
        row[f"{phase}_begin_s"], row[f"{phase}_end_s"] = span or (None, None)
    summary = record.phase_summary
    parts = {"net": record.net_span, "payout": summary.payout, "plateau": summary.payout.plateau, "hold": summary.hold}
    for prefix, part in {**parts, "haul_in": summary.haul_in}.items():
        row |= {f"{prefix}_{name}": value for name, value in (msgspec.to_builtins(part) or {}).items()}
    return row


def _flat_finding(record: FindingRecord) -> Row:
    """A finding in one row."""
    own: Row = asdict(record)
    repaired = record.repaired
    return own | ({} if repaired is None else {"repair": repaired.what, "repair_applied": repaired.applied})


def _flat_bin(record: BinRecord) -> Row:
    """A bin in one row."""
    own = asdict(record)
    stages = own.pop("stages")
    return own | ({} if stages is UNSET else stages)


def _own_ends(table: str, metric: str) -> Sequence[str]:
    """What follows the name of a metric of a stage of a rig file in the columns of a table."""
    ends = {"runs": RUN_ENDS, "cycles": ("",), "bins": ("", "_standard_error") if metric.startswith("power") else ()}
    return ends.get(table, ())


RUN_ENDS = ("", "_standard_uncertainty", "_low_95", "_high_95", "_max_deviation_percent")
"""What follows the name of a metric in the columns of the table of runs; the last is in percent."""


def _floats(record: type[msgspec.Struct], prefix: str = "") -> dict[str, type]:
    """Columns of the numbers of a record."""
    return {f"{prefix}{name}": float for name in record.__struct_encode_fields__}


_COLUMNS: dict[str, dict[str, type]] = {
    "runs": {
        **{"plateau_speed_mps": float, "sha256": str, "rig": str, "window": str, "measured": bool, "origin": str},
        **dict.fromkeys(("samples", "cycles", "complete", "findings"), int),
        **{f"{field}{end}": float for field in FIELDS.values() for end in RUN_ENDS},
    },
    "cycles": {
        **{"cycle": int, "complete": bool},
        **_floats(WindowRecord),
        **dict.fromkeys(FIELDS.values(), float),
        **{f"{phase}_{end}_s": float for phase in PhasesRecord.__struct_fields__ for end in ("begin", "end")},
        **{f"payout_{name}": float for name in ("duration_s", "travel_m", "speed_max_mps")},
        **_floats(PlateauSummary, "plateau_"),
        **_floats(HoldRecord, "hold_"),
        **_floats(HaulInSummary, "haul_in_"),
        **_floats(NetSpan, "net_"),
        "net_reason": str,
    },
    "bins": {**{k: float for k in _floats(BinRecord) if k != "stages"}, "count": int},
    "findings": {
        **{"kind": str, "channel": str, "start_s": float, "end_s": float, "count": int, "action": str, "message": str},
        **{"removed_share": float, "repair": str, "repair_applied": bool},
    },
}
"""Names and types of the columns of each table, in order."""


REDUCTION_TABLES = ("cycles", "bins", "findings", "channels")
CAMPAIGN_TABLES = ("runs", "cycles", "bins", "findings")
_COMPARED: dict[str, type] = {
    **{"run": str, "load_ohm": float, "metric": str, "a": float, "b": float, "difference": float, "relative": float},
    **dict.fromkeys(("low_95", "high_95", "standard_uncertainty", "degrees_of_freedom"), float),
    **{"excludes_zero": bool, "repeatability": float, "sensors": float, "unit": str},
}

DIAGNOSIS_TABLES = ("causes", "contributions", "map", "stability")

_DISPLAY = {
    "Pa": ("kg/cm2", 1.0 / (KGF * 1e4)),
    "rad/s": ("rpm", 30.0 / math.pi),
    "m3/s": ("L/min", 6e4),
}
"""Units that are shown in place of those of SI, with the factor to them."""

_SHORT = {"kg/cm2": "kgcm2", "L/min": "lpm", "1": ""}
"""Units in names of columns that are not their letters alone."""

_PARAMETER = dict.fromkeys(("value", "low", "high"), float)
_CAUSES: dict[str, type] = {
    **{"effect": str, "label": str, "stage": str, "probability": float, "parameter": str},
    **_PARAMETER,
    **{"unit": str, "at_limit": str, "beyond_range": bool, "alternatives": str},
}
_CONTRIBUTIONS: dict[str, type] = {
    **{"run": str, "load_ohm": float, "plateau_speed_mps": float, "metric": str, "as_given": float, "measured": float},
    **{"effect": str, "kind": str},
    **_PARAMETER,
    "unit": str,
}
_PLACES: dict[str, type] = {
    **{"file": str, "load_ohm": float, "channel": str, "phase": str, "blocks": int},
    **dict.fromkeys(("bias", "rms", "noise", "u_noise", "u_repeat", "u_tolerance"), float),
    **{"unit": str, "z": float},
}
_STABILITY: dict[str, type] = {
    **{"effect": str, "parameter": str, "run": str}, **_PARAMETER, "unit": str, "reason": str,
}  # fmt: skip


def run_frame(run: Run, units: Units = "si", channels: Mapping[str, Channel] = CHANNELS) -> pd.DataFrame:
    """Stamps [s] and channels of a log after the checks, a row for each sample.

    Parameters
    ----------
    channels : declarations of the channels, which hold their dimensions
    """
    import pandas as pd

    _check_units(units)
    columns = {"time_s": run.t}
    for name, x in run.channels.items():
        unit, factor = _shown(si_unit(channels[name].dimension) if name in channels else "1", units)
        short = _SHORT.get(unit, unit.lower().replace("/", "p").replace(".", ""))
        columns[(f"{name}_{short}" if short else name)] = x * factor
    return pd.DataFrame(columns)


def reduction_frame(reduction: Reduction, table: str, units: Units = "si") -> pd.DataFrame:
    """One table of a reduction: its cycles, its bins of generator speed, its findings, or the samples of its channels."""
    check_choice("to_pandas", table, REDUCTION_TABLES, "table")
    _check_units(units)
    if table == "channels":
        return _samples(reduction, units)
    schema = table_schema(table, {}, [reduction.rig.cascade])
    return _with_units(_frame(reduction_rows(reduction)[table], schema), units)


def campaign_frame(
    records: Mapping[str, RunRecord], table: str, units: Units = "si", cascades: Collection[Cascade] = ()
) -> pd.DataFrame:
    """One table of a campaign: its runs, or the cycles, bins or findings of all of them.

    Parameters
    ----------
    records : by the names of the runs
    cascades : those of the rigs of the runs
    """
    check_choice("to_pandas", table, CAMPAIGN_TABLES, "table")
    _check_units(units)
    rows = [row for name, record in records.items() for row in table_rows(name, record)[table]]
    return _with_units(_frame(rows, table_schema(table, {}, cascades)), units)


def diagnosis_frame(found: DiagnosisResult, table: str, units: Units = "si") -> pd.DataFrame:
    """One table of a diagnosis, in a row for each number: causes, contributions, places of the map, or causes run by run.

    A load of an open circuit is inf. The unit of the numbers of a row is in its column `unit`.
    """
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.report.results.diagnosis_record import as_json, map_record

    assert isinstance(found, ModelDiagnosis | LineDiagnosis)  # there are no others
    check_choice("to_pandas", table, DIAGNOSIS_TABLES, "table")
    _check_units(units)
    tables: dict[str, tuple[dict[str, type], Callable[[], list[dict[str, Any]]]]] = {
        "map": (_PLACES, lambda: _place_rows(map_record(found), units)),
        "causes": (_CAUSES, lambda: _cause_rows(as_json(found)["causes"], found, units)),
        "stability": (_STABILITY, lambda: _stability_rows(as_json(found)["causes"], found, units)),
        "contributions": (
            _CONTRIBUTIONS,
            lambda: _contribution_rows(as_json(found).get("contributions", []), units),
        ),
    }
    columns, rows_of_table = tables[table]
    found_rows = rows_of_table()
    loads = ({"load_ohm": float(row["load_ohm"])} if row.get("load_ohm") is not None else {} for row in found_rows)
    return _frame([row | load for row, load in zip(found_rows, loads, strict=True)], arrow_schema(columns))


def comparison_frame(found: Comparison, units: Units = "si") -> pd.DataFrame:
    """A row for each difference of a comparison; the unit of its numbers is in its column `unit`."""
    from winchcascade.report.results.comparison_record import difference_rows_of

    _check_units(units)
    numbers = ("a", "b", "difference", "low_95", "high_95", "standard_uncertainty", "repeatability", "sensors")
    rows = [_in_unit(row, numbers, *_metric_unit(row["metric"], units)) for row in difference_rows_of(found)]
    return _frame(rows, arrow_schema(_COMPARED))


def _check_units(units: str) -> None:
    if units not in ("si", "display"):
        raise OptionError(f"to_pandas(units={units!r}): no such units; expected 'si' or 'display'.")


def _frame(rows: Sequence[Mapping[str, object]], schema: Any) -> pd.DataFrame:
    """A frame with the columns of a schema, in its order and of its types, also without rows."""
    import pyarrow as pa

    found: pd.DataFrame = pa.Table.from_pylist(list(rows), schema=schema.remove_metadata()).to_pandas()
    return found


def _shown(unit: str, units: Units) -> tuple[str, float]:
    """The unit in which numbers are given, and the factor from that of SI."""
    return _DISPLAY.get(unit, (unit, 1.0)) if units == "display" else (unit, 1.0)


def _with_units(frame: pd.DataFrame, units: Units) -> pd.DataFrame:
    """Efficiencies in percent where units of display are wanted; a deviation is in percent already."""
    if units == "si":
        return frame
    ratios = [name for name in frame.columns if name.startswith("eta_") and not name.endswith(RUN_ENDS[-1])]
    ends = {name: next((end for end in RUN_ENDS[1:] if name.endswith(end)), "") for name in ratios}
    frame[ratios] = 100.0 * frame[ratios]
    return frame.rename(columns={name: f"{name.removesuffix(end)}_percent{end}" for name, end in ends.items()})


def _samples(reduction: Reduction, units: Units) -> pd.DataFrame:
    """Channels and powers of the stages of every sample, its cycle and phase, and whether it lies in an integration window.

    Before the first onset, between cycles and after the last the cycle is missing and the phase is empty.
    """
    import pandas as pd

    run, rig = reduction.run, reduction.rig
    frame = run_frame(run, units, rig.known_channels)
    for stage in rig.cascade.stages:
        watts = stage.watts(run.channels, rig.r_drum)
        if watts is not None:
            frame[f"power_{stage.name}_w"] = watts
    cycle, phase = np.zeros(run.t.size, dtype=np.int64), np.full(run.t.size, "", dtype=object)
    inside = np.zeros(run.t.size, dtype=bool)
    for one in reduction.cycles:
        phases = one.phases
        spans = {"payout": (phases.onset, phases.payout_end), "hold": phases.hold, "haul_in": phases.haul_in}
        for name, span in spans.items():
            if span is not None:
                here = slice(*np.searchsorted(run.t, span, side="left").tolist())
                cycle[here], phase[here] = one.cycle, name
        inside |= (run.t >= one.window.onset) & (run.t <= one.window.cutoff)
    frame["cycle"] = pd.Series(cycle, dtype="Int64").mask(cycle == 0)
    frame["phase"] = pd.Series(phase, dtype="str")
    frame["in_window"] = inside
    return frame


def _scaled(row: Mapping[str, Any], names: Iterable[str], factor: float) -> dict[str, float | None]:
    """Numbers of a row in another unit."""
    return {name: None if row[name] is None else row[name] * factor for name in names if name in row}


def _in_unit(row: Mapping[str, Any], names: Iterable[str], unit: str, factor: float) -> dict[str, Any]:
    """A row with some of its numbers in another unit, which it states."""
    return {**row, **_scaled(row, names, factor), "unit": unit}


def _place_rows(places: Iterable[dict[str, Any]], units: Units) -> list[dict[str, Any]]:
    numbers = ("bias", "rms", "noise", "u_noise", "u_repeat", "u_tolerance")
    return [_in_unit(p, numbers, *_shown(si_unit(CHANNELS[p["channel"]].dimension), units)) for p in places]


def _contribution_rows(contributions: Iterable[dict[str, Any]], units: Units) -> list[dict[str, Any]]:
    """A row for each part; a metric without parts has one row without them."""
    numbers = ("as_given", "measured", *_PARAMETER)
    return [
        _in_unit(one | part, numbers, *_metric_unit(one["metric"], units))
        for one in contributions
        for part in one["parts"] or [dict.fromkeys(("effect", "kind", *_PARAMETER))]
    ]


def _metric_unit(metric: str, units: Units) -> tuple[str, float]:
    """Unit of a metric or of the mean of a channel, and the factor to it."""
    if metric.startswith("eta_"):
        return ("%", 100.0) if units == "display" else ("1", 1.0)
    if metric in CHANNELS:
        return _shown(si_unit(CHANNELS[metric].dimension), units)
    return ("J" if metric.endswith("_j") else "W"), 1.0


def _cause_rows(causes: Iterable[dict[str, Any]], found: DiagnosisResult, units: Units) -> list[dict[str, Any]]:
    """A row for each number of each cause."""
    return [
        _in_unit(
            {
                **cause,
                "parameter": name,
                "alternatives": ", ".join(rival["effect"] for rival in cause["rivals"]),
                **number,
            },
            _PARAMETER,
            *_cause_unit(found, named, name, units),
        )
        for cause, named in zip(causes, found.causes, strict=True)
        for name, number in cause["parameters"].items()
    ]


def _stability_rows(causes: Iterable[dict[str, Any]], found: DiagnosisResult, units: Units) -> list[dict[str, Any]]:
    """A row for each run of each cause that is estimated run by run, by the first of its numbers."""
    return [
        _in_unit(
            {**one, "effect": cause["effect"], "parameter": name}, _PARAMETER, *_cause_unit(found, named, name, units)
        )
        for cause, named in zip(causes, found.causes, strict=True)
        for name in [*cause["parameters"]][:1]
        for one in cause.get("stability", [])
    ]


def _cause_unit(found: DiagnosisResult, named: NamedCause, parameter: str, units: Units) -> tuple[str, float]:
    """Unit of a number of a cause, and the factor to it from that of the JSON."""
    unit = named.parameters[parameter].unit
    if units == "si":
        return unit, 1.0
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.report.diagnosis_names import LINE_NUMBERS, display_of

    effect = named.effect
    how = LINE_NUMBERS[effect] if isinstance(found, LineDiagnosis) else display_of(effect, parameter, unit)
    return how.unit.strip(), how.factor
