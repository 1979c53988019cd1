"""Results as pandas frames: rows and columns of the JSON and of the Parquet tables, units in the names of the columns."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.core.errors import OptionError, check_choice
from winchcascade.core.quantity import KGF, si_unit
from winchcascade.core.run import CHANNELS, Channel, Run, Units
from winchcascade.report.rows import RUN_ENDS, arrow_schema, reduction_rows, table_rows, table_schema

if TYPE_CHECKING:
    import pandas as pd

    from winchcascade.comparison.comparison_result import Comparison
    from winchcascade.core.cascade import Cascade
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
    from winchcascade.reduction.reduction_result import Reduction
    from winchcascade.report.records import RunRecord

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
    **{"run": str, "load_ohm": float, "metric": str, "as_given": float, "measured": float, "effect": str, "kind": str},
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
    from winchcascade.report.diagnosis_record import as_json, map_record

    assert isinstance(found, ModelDiagnosis | LineDiagnosis)  # there are no others
    check_choice("to_pandas", table, DIAGNOSIS_TABLES, "table")
    _check_units(units)
    rows: Iterable[dict[str, Any]]
    if table == "map":
        rows, columns = _place_rows(map_record(found), units), _PLACES
    elif table == "causes":
        rows, columns = _cause_rows(as_json(found)["causes"], found, units), _CAUSES
    elif table == "stability":
        rows, columns = _stability_rows(as_json(found)["causes"], found, units), _STABILITY
    else:
        rows, columns = _contribution_rows(as_json(found).get("contributions", []), units), _CONTRIBUTIONS
    return _frame(
        [row | ({"load_ohm": float(row["load_ohm"])} if row.get("load_ohm") is not None else {}) for row in rows],
        arrow_schema(columns),
    )


def comparison_frame(found: Comparison, units: Units = "si") -> pd.DataFrame:
    """A row for each difference of a comparison; the unit of its numbers is in its column `unit`."""
    from winchcascade.report.comparison_text import difference_rows_of

    _check_units(units)
    numbers = ("a", "b", "difference", "low_95", "high_95", "standard_uncertainty", "repeatability", "sensors")
    rows = []
    for row in difference_rows_of(found):
        unit, factor = _metric_unit(row["metric"], units)
        rows.append({**row, **_scaled(row, numbers, factor), "unit": unit or "1"})
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
    names = {}
    for name in ratios:
        end = next((end for end in RUN_ENDS[1:] if name.endswith(end)), "")
        names[name] = f"{name.removesuffix(end)}_percent{end}"
        frame[name] = 100.0 * frame[name]
    return frame.rename(columns=names)


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


def _place_rows(places: Iterable[dict[str, Any]], units: Units) -> list[dict[str, Any]]:
    found = []
    for place in places:
        unit, factor = _shown(si_unit(CHANNELS[place["channel"]].dimension), units)
        numbers = _scaled(place, ("bias", "rms", "noise", "u_noise", "u_repeat", "u_tolerance"), factor)
        found.append(place | numbers | {"unit": unit})
    return found


def _contribution_rows(contributions: Iterable[dict[str, Any]], units: Units) -> list[dict[str, Any]]:
    """A row for each part; a metric without parts has one row without them."""
    found = []
    for one in contributions:
        unit, factor = _metric_unit(one["metric"], units)
        whole = one | _scaled(one, ("as_given", "measured"), factor) | {"unit": unit}
        parts = one["parts"] or [dict.fromkeys(("effect", "kind", *_PARAMETER))]
        found += [{**whole, **part, **_scaled(part, _PARAMETER, factor)} for part in parts]
    return found


def _metric_unit(metric: str, units: Units) -> tuple[str, float]:
    """Unit of a metric or of the mean of a channel, and the factor to it."""
    if metric.startswith("eta_"):
        return ("%", 100.0) if units == "display" else ("1", 1.0)
    if metric in CHANNELS:
        return _shown(si_unit(CHANNELS[metric].dimension), units)
    return ("J" if metric.endswith("_j") else "W"), 1.0


def _cause_rows(causes: Iterable[dict[str, Any]], found: DiagnosisResult, units: Units) -> list[dict[str, Any]]:
    """A row for each number of each cause."""
    rows = []
    for cause, named in zip(causes, found.causes, strict=True):
        alternatives = ", ".join(rival["effect"] for rival in cause["rivals"])
        for name, number in cause["parameters"].items():
            unit, factor = _cause_unit(found, named.effect, name, units)
            row = {**cause, "parameter": name, "alternatives": alternatives}
            rows.append({**row, **number, **_scaled(number, _PARAMETER, factor), "unit": unit})
    return rows


def _stability_rows(causes: Iterable[dict[str, Any]], found: DiagnosisResult, units: Units) -> list[dict[str, Any]]:
    """A row for each run of each cause that is estimated run by run, by the first of its numbers."""
    rows = []
    for cause, named in zip(causes, found.causes, strict=True):
        name = next(iter(cause["parameters"]))
        unit, factor = _cause_unit(found, named.effect, name, units)
        about = {"effect": cause["effect"], "parameter": name, "unit": unit}
        rows += [{**one, **_scaled(one, _PARAMETER, factor), **about} for one in cause.get("stability", [])]
    return rows


def _cause_unit(found: DiagnosisResult, effect: str, parameter: str, units: Units) -> tuple[str, float]:
    """Unit of a number of a cause, and the factor to it from that of the JSON."""
    named = next(cause for cause in found.causes if cause.effect == effect)
    unit = named.parameters[parameter].unit
    if units == "si":
        return unit, 1.0
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.report.cause_words import LINE_NUMBERS
    from winchcascade.report.gap_words import display_of

    how = LINE_NUMBERS[effect] if isinstance(found, LineDiagnosis) else display_of(effect, parameter, unit)
    return how.unit.strip(), how.factor
