"""Results as pandas frames, with units in the names of the columns or in a column of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.cascade import field_of
from winchcascade.core.channels import CHANNELS, Channel
from winchcascade.core.quantity import si_unit
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Run
from winchcascade.reduction.run_record import reduction_record
from winchcascade.report.flat_rows import Row, finding_rows, table_rows, table_schema

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
    """Cycles, bins of generator speed, or findings of a reduction."""
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
    channels = given_rig("to_pandas", None, found.run.rig).known_channels
    return run_frame(found.run, channels).assign(
        speed_gen_rpm=found.rpm_gen, i_s_a=found.i_s, torque_em_nm=found.torque_em
    )


def record_frame(records: object) -> pd.DataFrame:
    """Records of a JSON as a frame, names of nested ones joined."""
    import pandas as pd

    return pd.json_normalize(msgspec.to_builtins(records), sep="_")


def run_findings_frame(run: Run) -> pd.DataFrame:
    """Findings of the checks of a log when it was read, a row for each."""
    return _frame(finding_rows(run), table_schema("findings"))


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
    from winchcascade.report.results.comparison_record import difference_record

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
