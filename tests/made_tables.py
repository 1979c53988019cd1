"""Tables by load that tests make: texts of table files from numbers."""

from collections.abc import Mapping, Sequence

from winchcascade.reduction.efficiency import METRICS
from winchcascade.tables.published_table import PublishedTable
from winchcascade.tables.table_file import parse_table

Units = Mapping[str, tuple[str, int, float]]
"""Unit, decimals and factor to SI by metric, or by the first word of metrics."""

PLAIN: Units = {"energy": ("J", 0, 1.0), "power": ("W", 0, 1.0), "eta": ("1", 3, 1.0)}


def unit_of_metric(units: Units, metric: str) -> tuple[str, int, float]:
    """Unit, decimals and factor of a metric."""
    return units.get(metric) or units[metric.partition("_")[0]]


def table_text(rows: Sequence[Mapping[str, float]], units: Units = PLAIN, entries: str = "") -> str:
    """A table file; rows hold `load_ohm` and metrics in SI units, which are rounded as printed."""
    lines = ['title = "made"', 'source = "none"', entries, "[columns]"]
    for metric in METRICS:
        unit, decimals, _ = unit_of_metric(units, metric)
        lines.append(f'{metric} = {{ unit = "{unit}", decimals = {decimals} }}')
    for row in rows:
        lines += ["[[row]]", f"load_ohm = {row['load_ohm']}"]
        for metric in (name for name in row if name != "load_ohm"):
            _, decimals, factor = unit_of_metric(units, metric)
            lines.append(f"{metric} = {round(row[metric] / factor, decimals)}")
    return "\n".join(lines) + "\n"


def made_table(
    rows: Sequence[Mapping[str, float]], units: Units = PLAIN, entries: str = ""
) -> PublishedTable:
    """A table of such rows."""
    return parse_table(table_text(rows, units, entries), "made.toml", name="made")
