"""A campaign as a table for the terminal, and where its files are."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from winchcascade.core.campaign_file import origin_from, origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report.campaign_tables import Run, by_load, count_of, load_text, mixed_windows, window_text
from winchcascade.report.digits import stated, uncertain
from winchcascade.report.report_model import TableColumn
from winchcascade.report.text_table import listing, wrapped

MOST_RUNS = 20
"""Logs that are listed; of more the first and the last half of that."""

MOST_FAULTS = 10

_METRICS = ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen", "eta_pto")


MOST_ALTERED = 5
"""Altered files that are named."""


def campaign_text(summary: Run, out: Path, *, kept: int, altered: Sequence[str] = ()) -> str:
    """Means of every log of a campaign, what failed, and where the results are.

    Parameters
    ----------
    summary : the campaign's record, schema `winchcascade/campaign/1`
    kept : logs that an earlier call had done already
    altered : files of an earlier call that did not match their digest
    """
    runs = by_load([run for run in summary["runs"] if run["fault"] is None])
    failed = [run for run in summary["runs"] if run["fault"] is not None]
    lines = [f"{one_line(summary['title'])}: {len(runs)} of {len(summary['runs'])} logs reduced" + _kept(kept), ""]
    if runs:
        lines[1:1] = wrapped(f"data: {one_line(origin_words([origin_from(run) for run in runs]))}")
        lines += [*_table(runs), *_marked(runs), *_between(summary), ""]
    mixed = mixed_windows(runs)
    lines += [*wrapped(f"note: windows of {mixed}"), ""] if mixed else []
    lines += altered_lines(altered)
    lines += [f"failed: {_told(run)}" for run in failed[:MOST_FAULTS]]
    if len(failed) > MOST_FAULTS:
        lines.append(f"... {len(failed) - MOST_FAULTS} more failed, all in {out / 'campaign.json'}")
    return "\n".join([*lines, *_places(out)]) + "\n"


def altered_lines(altered: Sequence[str]) -> list[str]:
    """One line that names files which were changed after they were made, and so were made again; none if there are none."""
    if not altered:
        return []
    more = f" and {len(altered) - MOST_ALTERED} more" if len(altered) > MOST_ALTERED else ""
    names = ", ".join(map(one_line, altered[:MOST_ALTERED]))
    return [f"made again, as the content did not match the digest of the earlier call: {names}{more}"]


def _told(run: Run) -> str:
    """Name and fault of a log, the name once."""
    name, fault = one_line(run["name"]), one_line(run["fault"])
    return fault if name in fault.split(": ")[0] else f"{name}: {fault}"


def _kept(kept: int) -> str:
    return f", {kept} of them by an earlier call" if kept else ""


def _table(runs: Sequence[Run]) -> list[str]:
    columns = _COLUMNS if any(run["findings"] for run in runs) else _COLUMNS[:-1]
    return listing(columns, runs, most=MOST_RUNS, more="more, in the dataset")


def _name(run: Run) -> str:
    name = one_line(run["name"])
    return name if len(name) <= 24 else f"{name[:12]}…{name[-11:]}"


def _cycles(run: Run) -> str:
    return f"{run['complete']}" if run["complete"] == run["cycles"] else f"{run['complete']} of {run['cycles']}"


def _mean(metric: str, run: Run) -> str:
    value = run["mean"][FIELDS[metric]]
    return stated(value, None, 3 if metric.startswith("eta") else 0).replace("–", "-")


def _uncertainty(run: Run) -> str:
    """Standard uncertainty of the efficiency that says most."""
    given = [m for m in ("eta_pto", "eta_trans", "eta_gen") if run["mean"][m] is not None]
    return uncertain(run["standard_uncertainty"][given[0]] if given else None).replace("–", "-")


_COLUMNS: tuple[TableColumn[Run], ...] = (
    TableColumn("log", of=_name),
    TableColumn("load", "ohm", of=lambda run: load_text(run).replace("–", "-")),
    TableColumn("window", "s", of=window_text),
    TableColumn("cycles", of=_cycles),
    *(
        TableColumn(m.replace("energy", "E"), "J" if m.startswith("energy") else "", of=partial(_mean, m))
        for m in _METRICS
    ),
    TableColumn("±", of=_uncertainty),
    TableColumn("findings", of=lambda run: f"! {count_of(run)}" if run["findings"] else "-"),
)


def _marked(runs: Sequence[Run]) -> list[str]:
    """The sentence on the rows that are marked: how many, and with which kinds of findings."""
    found = [run for run in runs if run["findings"]]
    kinds = ", ".join(sorted({kind for run in found for kind in run["findings"]}))
    text = f"! findings in {len(found)} of {len(runs)} logs, listed in each log's report and JSON: {kinds}"
    return wrapped(text) if found else []


def _between(summary: Run) -> list[str]:
    """What is wrong with a log beside the others."""
    found = summary.get("between_logs", ())
    lines = []
    for one in found[:MOST_FAULTS]:
        text = one_line(f"{one['run']}: {one['kind']}: {one['message']}; {one['action']}")
        lines += wrapped(text, "  ")
    return lines + ([f"  ... {len(found) - MOST_FAULTS} more, in the dataset"] if len(found) > MOST_FAULTS else [])


def _places(out: Path) -> list[str]:
    """Where the results are, those that exist."""
    named = [
        ("report", out / "campaign.html"), ("", out / "campaign.pdf"), ("workbook", out / "campaign.xlsx"),
        ("tables", out / "dataset"), ("each log", out / "runs"),
    ]  # fmt: skip
    return [f"{name + ':' if name else '':<10}{path}" for name, path in named if path.exists()]
