"""A campaign as a table for the terminal, and where its files are."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from winchcascade.core.campaign_file import origin_from, origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report.campaign_tables import by_load, count_of, load_text, mixed_windows, window_text
from winchcascade.report.digits import stated, uncertain
from winchcascade.report.text_table import wrapped

MOST_RUNS = 20
"""Logs that are listed; of more the first and the last half of that."""

MOST_FAULTS = 10

WIDTH = 100

_HEAD = (
    "log",
    "load",
    "window",
    "cycles",
    "E_line",
    "E_mech",
    "E_gen",
    "eta_trans",
    "eta_gen",
    "eta_pto",
    "±",
    "findings",
)
_UNITS = ("", "ohm", "s", "", "J", "J", "J", "", "", "", "", "")
_METRICS = ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen", "eta_pto")


MOST_ALTERED = 5
"""Altered files that are named."""


def campaign_text(summary: Mapping[str, Any], out: Path, *, kept: int, altered: Sequence[str] = ()) -> str:
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


def _told(run: Mapping[str, Any]) -> str:
    """Name and fault of a log, the name once."""
    name, fault = one_line(run["name"]), one_line(run["fault"])
    return fault if name in fault.split(": ")[0] else f"{name}: {fault}"


def _kept(kept: int) -> str:
    return f", {kept} of them by an earlier call" if kept else ""


def _table(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    half = MOST_RUNS // 2
    many = len(runs) > MOST_RUNS
    rows = [_row(run) for run in ([*runs[:half], *runs[-half:]] if many else runs)]
    found = any(run["findings"] for run in runs)  # without any, the column of their numbers is left out
    cells = [row[: None if found else -1] for row in (_HEAD, _UNITS, *rows)]
    width = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        "  ".join(
            c.ljust(w) if k == 0 else c.rjust(w) for k, (c, w) in enumerate(zip(row, width, strict=True))
        ).rstrip()
        for row in cells
    ]
    if many:
        lines.insert(2 + half, f"... {len(runs) - MOST_RUNS} more, in the dataset ...")
    return lines


def _row(run: Mapping[str, Any]) -> tuple[str, ...]:
    values = [stated(run["mean"][FIELDS[m]], None, 3 if m.startswith("eta") else 0).replace("–", "-") for m in _METRICS]
    u = next(
        (run["standard_uncertainty"][m] for m in ("eta_pto", "eta_trans", "eta_gen") if run["mean"][m] is not None),
        None,
    )
    name = one_line(run["name"])
    name = name if len(name) <= 24 else f"{name[:12]}…{name[-11:]}"
    cycles = f"{run['complete']}" if run["complete"] == run["cycles"] else f"{run['complete']} of {run['cycles']}"
    found = f"! {count_of(run)}" if run["findings"] else "-"
    return (
        name,
        load_text(run).replace("–", "-"),
        window_text(run),
        cycles,
        *values,
        uncertain(u).replace("–", "-"),
        found,
    )


def _marked(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """The sentence on the rows that are marked: how many, and with which kinds of findings."""
    found = [run for run in runs if run["findings"]]
    kinds = ", ".join(sorted({kind for run in found for kind in run["findings"]}))
    text = f"! findings in {len(found)} of {len(runs)} logs, listed in each log's report and JSON: {kinds}"
    return textwrap.wrap(text, WIDTH, subsequent_indent="  ") if found else []


def _between(summary: Mapping[str, Any]) -> list[str]:
    """What is wrong with a log beside the others."""
    found = summary.get("between_logs", ())
    lines = []
    for one in found[:MOST_FAULTS]:
        text = one_line(f"{one['run']}: {one['kind']}: {one['message']}; {one['action']}")
        lines += textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="    ")
    return lines + ([f"  ... {len(found) - MOST_FAULTS} more, in the dataset"] if len(found) > MOST_FAULTS else [])


def _places(out: Path) -> list[str]:
    """Where the results are, those that exist."""
    named = [
        ("report", out / "campaign.html"), ("", out / "campaign.pdf"), ("workbook", out / "campaign.xlsx"),
        ("tables", out / "dataset"), ("each log", out / "runs"),
    ]  # fmt: skip
    return [f"{name + ':' if name else '':<10}{path}" for name, path in named if path.exists()]
