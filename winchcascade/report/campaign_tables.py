"""Tables of a campaign as rows of texts: the paper's Table 2 with uncertainty, repeatability, logs and what is wrong."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from msgspec.structs import replace

from winchcascade.core.campaign_file import KINDS, origin_from
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.efficiency import FIELDS, METRICS, NET_METRICS
from winchcascade.report.digits import number, percent, places, stated, uncertain
from winchcascade.report.report_model import Cell, Table, TableColumn, make_table, rows_of
from winchcascade.report.tables import DECIMALS, SYMBOL, UNIT, metrics_note

Run = Mapping[str, Any]
"""One log of a campaign's summary."""

MOST_RUNS = 150
"""Logs that a table lists; of more the first and the last half of that."""


def load_of(run: Run) -> float | None:
    """Load of a run, inf for an open circuit, None for none or an unknown one. [ohm]"""
    return math.inf if run["open_circuit"] else run["load_ohm"]


def load_text(run: Run) -> str:
    """Load of a run as a text."""
    load = load_of(run)
    return "–" if load is None else "open circuit" if math.isinf(load) else f"{load:g}"


def count_of(run: Run) -> int:
    """Number of findings of a run; of a summary by version 0.1.0, which lists kinds alone, the number of kinds."""
    return int(run.get("finding_count", len(run["findings"])))


def by_load(runs: Sequence[Run]) -> list[Run]:
    """Runs in falling order of their loads, as the paper lists them; open circuit first, unknown ones last."""
    return sorted(runs, key=lambda run: -(load if (load := load_of(run)) is not None else -1.0))


def window_text(run: Run) -> str:
    """Rule of the integration window of a run: a word, or the fixed length in seconds."""
    window = run["window"]
    return window if isinstance(window, str) else f"{window:g}"


def window_rules(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Runs by the rule of their windows: auto, payout, or a fixed length."""
    found: dict[str, list[Run]] = {}
    for run in runs:
        found.setdefault(run["window"] if isinstance(run["window"], str) else "fixed length", []).append(run)
    return found


def mixed_windows(runs: Sequence[Run]) -> str:
    """Report that runs have windows of several rules; empty if they have one."""
    rules = sorted(window_rules(runs).items(), key=lambda item: -len(item[1]))
    if len(rules) < 2:
        return ""
    named = ", ".join(
        f"{rule} in {len(found)} ({one_line(found[0]['name'])}{', …' * (len(found) > 1)})" for rule, found in rules
    )
    return f"{len(rules)} rules: {named}. Energies, powers and efficiencies of different rules cannot be compared."


def comparable(runs: Sequence[Run]) -> list[list[int]]:
    """Places of the runs that may be joined by a line: those of one window rule and of one kind of data."""
    found: dict[object, list[int]] = {}
    for rule, members in window_rules(runs).items():
        for run in members:
            found.setdefault((rule, origin_from(run).measured), []).append(runs.index(run))
    return list(found.values())


_LOG: TableColumn[Run] = TableColumn("Log", text=True, of=lambda run: run["name"])
_LOAD: TableColumn[Run] = TableColumn("Load", "Ω", of=lambda run: load_text(run))
_WINDOW: TableColumn[Run] = TableColumn("Window", "s", of=lambda run: window_text(run))


def _given(runs: Sequence[Run], metrics: Iterable[str], part: str = "mean") -> list[str]:
    """Metrics that any of the runs has."""
    return [m for m in metrics if any(run[part][FIELDS[m]] is not None for run in runs)]


def _metric_columns(metrics: Iterable[str]) -> list[TableColumn[Run]]:
    """Means of metrics with their standard uncertainties."""
    return [TableColumn(SYMBOL[m], UNIT[m], of=partial(_with_uncertainty, m)) for m in metrics]


def _rows(columns: Sequence[TableColumn[Run]], runs: Sequence[Run]) -> list[tuple[Cell, ...]]:
    return rows_of(columns, runs, most=MOST_RUNS, more="more, in the dataset")


def energies_table(runs: Sequence[Run]) -> Table:
    """Mean energies and powers of every run with their standard uncertainties (the layout of Table 2)."""
    given = _given(runs, [f"{kind}_{stage}" for stage in ("line", "mech", "gen") for kind in ("energy", "power")])
    cycles: TableColumn[Run] = TableColumn("Cycles", of=lambda run: run["complete"])
    columns = [_LOG, _LOAD, _WINDOW, cycles, *_metric_columns(given)]
    caption = "Mean energies over the integration window and mean powers in it, ± standard uncertainty."
    table = make_table("energies", caption, columns, _rows(columns, runs), note=metrics_note(given).strip())
    return replace(table, links=_links(runs))


def efficiencies_table(runs: Sequence[Run]) -> Table:
    """Mean efficiencies of every run with their standard uncertainties and 95 % intervals."""
    given = _given(runs, METRICS[6:])
    columns = [_LOG, _LOAD, _WINDOW]
    for m, column in zip(given, _metric_columns(given), strict=True):
        columns += [column, TableColumn("95 % interval", of=partial(_interval, m))]
    return make_table(
        "efficiencies",
        "Efficiencies: means of the cycles' ratios, ± standard uncertainty, and 95 % intervals.",
        columns,
        _rows(columns, runs),
        note=metrics_note(given)
        + "Errors of the sensors are common to all runs with the same sensors, so differences between loads are better "
        "known than each value.",
    )


def net_table(runs: Sequence[Run]) -> Table | None:
    """Net energies of whole cycles of every run, means with their standard uncertainties; None where no run has any."""
    given = _given(runs, NET_METRICS)
    if not given:
        return None
    columns = [_LOG, _LOAD, *_metric_columns(given)]
    return make_table(
        "net",
        "Whole cycles: line energy of the payout, line energy returned in haul-in, and net line energy from onset to "
        "next onset, ± standard uncertainty.",
        columns,
        _rows(columns, runs),
        note="These energies do not depend on the integration window. "
        + ("η_net = E_gen, cycle / E_net. " if "eta_net" in given else "")
        + "The report of each log states why it has none; in open circuit they are not evaluated.",
    )


def repeatability_table(runs: Sequence[Run]) -> Table | None:
    """Largest deviation of any cycle from the mean, for every run; None where no run has two cycles."""
    several = [run for run in runs if run["complete"] > 1]
    given = _given(several, METRICS, "max_deviation_percent")
    if not given:
        return None
    columns = [_LOG, _LOAD, TableColumn("Cycles", of=lambda run: run["complete"])]
    columns += [TableColumn(SYMBOL[m], "%", 2, of=partial(_deviation, m)) for m in given]
    caption = "Repeatability: largest deviation of any cycle from the mean of its run, in percent of the mean."
    return make_table("repeatability", caption, columns, _rows(columns, several))


def logs_table(runs: Sequence[Run]) -> Table:
    """Every log: its cycles, and what was found wrong with it."""
    columns: list[TableColumn[Run]] = [
        _LOG,
        _LOAD,
        _WINDOW,
        TableColumn("Data", text=True, of=lambda run: KINDS[origin_from(run).measured]),
        TableColumn("Complete cycles", of=lambda run: f"{run['complete']} of {run['cycles']}"),
        TableColumn("Data lost", "%", of=lambda run: percent(run["removed_share"], 2)),
        TableColumn("Findings", text=True, of=_findings),
    ]
    caption = "Logs: complete cycles, share of the samples that findings took out, number and kinds of findings."
    return replace(make_table("logs", caption, columns, _rows(columns, runs)), links=_links(runs))


def _findings(run: Run) -> str:
    kinds = ", ".join(kind.replace("_", " ") for kind in run["findings"])
    return f"{count_of(run)}: {kinds}" if kinds else "none"


def between_table(found: Sequence[Run]) -> Table | None:
    """Findings that a log has beside the others; None if there is none."""
    columns: list[TableColumn[Run]] = [
        TableColumn("Log", text=True, of=lambda one: one["run"]),
        TableColumn("Finding", text=True, of=lambda one: f"{one['kind'].replace('_', ' ')}: {one['message']}"),
        TableColumn("What to do", text=True, of=lambda one: one["action"]),
    ]
    caption = "Logs that lie apart from the others. The data are kept; the operator decides."
    return make_table("between", caption, columns, rows_of(columns, found[:MOST_RUNS])) if found else None


def faults_table(failed: Sequence[Run]) -> Table | None:
    """Logs that could not be used, each with its sentence; None if there is none."""
    columns = [_LOG, TableColumn("Why", text=True, of=lambda run: run["fault"])]
    caption = "Logs that could not be used."
    return make_table("faults", caption, columns, rows_of(columns, failed[:MOST_RUNS])) if failed else None


def _with_uncertainty(metric: str, run: Run) -> str:
    value, u = run["mean"][FIELDS[metric]], run["standard_uncertainty"][FIELDS[metric]]
    text = stated(value, u, DECIMALS[metric])
    return text if value is None or not u else f"{text} ± {uncertain(u)}"


def _deviation(metric: str, run: Run) -> float | None:
    value: float | None = run["max_deviation_percent"][FIELDS[metric]]
    return value


def _interval(metric: str, run: Run) -> str:
    ends, u = run["interval_95"][FIELDS[metric]], run["standard_uncertainty"][FIELDS[metric]]
    return "–" if ends is None or not u else f"{number(ends[0], places(u))} to {number(ends[1], places(u))}"


def _links(runs: Sequence[Run]) -> tuple[str, ...]:
    """Addresses of the logs' own reports, none where there are too many rows to keep them apart."""
    from urllib.parse import quote

    if len(runs) > MOST_RUNS:
        return ()
    return tuple(f"runs/{quote(run['name'])}.html" for run in runs)
