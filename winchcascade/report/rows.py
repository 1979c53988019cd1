"""Records as rows of tables: runs, cycles, bins and findings as Parquet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from msgspec import UNSET
from msgspec.structs import asdict

from winchcascade.core.cascade import Cascade, field_of
from winchcascade.core.files import check_replaceable, write_whole
from winchcascade.core.store import make_one
from winchcascade.reduction.efficiency import FIELDS, Metrics
from winchcascade.reduction.energies import NetSpan
from winchcascade.reduction.phase_summary import HaulInSummary, PlateauSummary
from winchcascade.report.records import (
    SCHEMA,
    BinRecord,
    CycleRecord,
    HoldRecord,
    PhasesRecord,
    RunRecord,
    WindowRecord,
    bin_record,
    cycle_record,
    finding_record,
)

if TYPE_CHECKING:
    import pyarrow as pa
    from numpy.typing import NDArray

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
    about = {"schema": SCHEMA, "log": run.name, "sha256": run.sha256, "rig": reduction.rig.name}
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
        "findings": [begin | asdict(finding_record(f, run.samples)) for f in reduction.quality],
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
        "findings": [begin | asdict(f) for f in record.quality],
    }


def _flat_run(record: RunRecord) -> Row:
    """A log in one row: means with their uncertainties, 95 % intervals and largest deviations."""
    row: Row = {
        "sha256": record.log.sha256,
        "rig": record.rig,
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
        low, high = intervals[field] or (None, None)
        values = (mean[field], u[field], low, high, deviation[field])
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
        **{"sha256": str, "rig": str, "window": str, "measured": bool, "origin": str},
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
        "removed_share": float,
    },
}
"""Names and types of the columns of each table, in order."""
