"""Records as rows of tables: runs, cycles, bins and findings as Parquet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, write_whole
from winchcascade.reduction.energies import STAGES
from winchcascade.report.records import FIELDS, SCHEMA, bin_record, cycle_record, finding_record

if TYPE_CHECKING:
    from winchcascade.reduction.reduction_result import Reduction


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
    import pyarrow as pa
    from pyarrow import parquet

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise OutputError(f"{folder}: the folder cannot be made ({fault.strerror}); choose another.") from None
    files = parquet_files(folder, reduction.run.name)
    for path in files.values():
        check_replaceable(path, force=force)
    run = reduction.run
    about = {"schema": SCHEMA, "log": run.name, "sha256": run.sha256, "rig": reduction.rig.name}
    about |= {} if run.load is None else {"load_ohm": repr(run.load)}
    rows: dict[str, list[dict[str, Any]]] = {
        "cycles": [_flat_cycle(cycle_record(c)) for c in reduction.cycles],
        "bins": [bin_record(b) for b in reduction.bins],
        "findings": [finding_record(f, run.samples) for f in reduction.quality],
    }
    for table, path in files.items():
        records = [{"run": run.name, "log": run.path, "load_ohm": run.load, **row} for row in rows[table]]
        content = pa.Table.from_pylist(records, schema=table_schema(table, about))
        write_whole(path, lambda part, content=content: parquet.write_table(content, part), force=force)  # type: ignore[misc]
    return list(files.values())


def table_schema(table: str, about: Mapping[str, str]) -> Any:
    """Arrow schema of one of the tables `runs`, `cycles`, `bins` and `findings`; each row begins with run, log and load."""
    import pyarrow as pa

    first = [pa.field("run", pa.string()), pa.field("log", pa.string()), pa.field("load_ohm", pa.float64())]
    return pa.schema(first + [pa.field(*column) for column in _COLUMNS[table]()], metadata=dict(about))


def table_rows(run: str, record: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Rows of the tables `runs`, `cycles`, `bins` and `findings` of one log from its JSON; an open circuit is inf ohm."""
    log = record["log"]
    begin = {"run": run, "log": log["path"], "load_ohm": math.inf if log["open_circuit"] else log["load_ohm"]}
    return {
        "runs": [begin | _flat_run(record)],
        "cycles": [begin | _flat_cycle(c) for c in record["cycles"]],
        "bins": [begin | b for b in record["bins"]],
        "findings": [begin | f for f in record["quality"]],
    }


def _flat_run(record: Mapping[str, Any]) -> dict[str, Any]:
    """A log in one row: means with their uncertainties, 95 % intervals and largest deviations."""
    row: dict[str, Any] = {
        "sha256": record["log"]["sha256"],
        "rig": record["rig"],
        "window": record["window"] if isinstance(record["window"], str) else f"{record['window']:g}",
        "measured": record["data"]["measured"],
        "origin": record["data"]["origin"],
        "samples": record["log"]["samples"],
        "cycles": len(record["cycles"]),
        "complete": sum(c["complete"] for c in record["cycles"]),
        "findings": len(record["quality"]),
    }
    for field in FIELDS.values():
        interval = record["interval_95"][field] or (None, None)
        row[field] = record["mean"][field]
        row[f"{field}_standard_uncertainty"] = record["standard_uncertainty"][field]
        row[f"{field}_low_95"], row[f"{field}_high_95"] = interval
        row[f"{field}_max_deviation_percent"] = record["max_deviation_percent"][field]
    return row


def _flat_cycle(record: Mapping[str, Any]) -> dict[str, Any]:
    """A cycle in one row: nested names joined, phases as begin and end."""
    row: dict[str, Any] = {"cycle": record["cycle"], "complete": record["complete"], **record["window"]}
    row |= {field: record[field] for field in FIELDS.values()}
    row |= {f"net_{name}": value for name, value in record["net_span"].items()}
    for phase, span in record["phases"].items():
        row[f"{phase}_begin_s"], row[f"{phase}_end_s"] = span if span is not None else (None, None)
    for phase, summary in record["phase_summary"].items():
        for name, value in (summary or {}).items():
            if name == "plateau":
                row |= {f"plateau_{key}": inner for key, inner in (value or {}).items()}
            else:
                row[f"{phase}_{name}"] = value
    return row


def _run_columns() -> list[tuple[str, Any]]:
    import pyarrow as pa

    text, count, number = pa.string(), pa.int64(), pa.float64()
    columns: list[tuple[str, Any]] = [("sha256", text), ("rig", text), ("window", text), ("measured", pa.bool_())]
    columns += [("origin", text)]
    columns += [(name, count) for name in ("samples", "cycles", "complete", "findings")]
    ends = ("", "_standard_uncertainty", "_low_95", "_high_95", "_max_deviation_percent")
    return columns + [(f"{field}{end}", number) for field in FIELDS.values() for end in ends]


def _cycle_columns() -> list[tuple[str, Any]]:
    import pyarrow as pa

    phases = ("payout", "hold", "haul_in")
    names = ["onset_s", "cutoff_s", "duration_s", *FIELDS.values()]
    names += [f"{phase}_{end}_s" for phase in phases for end in ("begin", "end")]
    names += ["payout_duration_s", "payout_travel_m", "payout_speed_max_mps"]
    names += [f"plateau_{n}" for n in ("begin_s", "braking_s", "speed_mps", "force_n", "torque_nm")]
    names += [f"plateau_power_{stage}_w" for stage in STAGES]
    names += [f"hold_{n}" for n in ("duration_s", "force_n", "torque_nm", "pressure_kgcm2")]
    names += [f"haul_in_{n}" for n in ("duration_s", "speed_max_mps", "force_n", "force_min_n", "energy_line_j")]
    names += [f"net_{n}" for n in ("begin_s", "end_s", "travel_m")]
    columns = [(name, pa.float64()) for name in names]
    return [("cycle", pa.int64()), ("complete", pa.bool_()), *columns, ("net_reason", pa.string())]


def _bin_columns() -> list[tuple[str, Any]]:
    import pyarrow as pa

    columns: list[tuple[str, Any]] = [("rpm_low", pa.float64()), ("rpm_high", pa.float64()), ("count", pa.int64())]
    for stage in STAGES:
        columns += [(f"power_{stage}_w", pa.float64()), (f"power_{stage}_w_standard_error", pa.float64())]
    return [*columns, ("torque_nm", pa.float64()), ("torque_nm_standard_error", pa.float64())]


def _finding_columns() -> list[tuple[str, Any]]:
    import pyarrow as pa

    text, number = pa.string(), pa.float64()
    return [
        ("kind", text), ("channel", text), ("start_s", number), ("end_s", number), ("count", pa.int64()),
        ("action", text), ("message", text), ("removed_share", number),
    ]  # fmt: skip


_COLUMNS = {"runs": _run_columns, "cycles": _cycle_columns, "bins": _bin_columns, "findings": _finding_columns}
