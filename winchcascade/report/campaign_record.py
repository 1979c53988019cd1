"""The text of a campaign in a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from msgspec import UNSET

from winchcascade.core.cascade import Cascade, field_of
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.best_load import motion_words
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    FailedLog,
    LogSummary,
    cascade_of,
    runs_by_load,
    unlike_motion,
    window_rules,
)
from winchcascade.reduction.wave_record import waves_from_record
from winchcascade.report.content import Note, Report
from winchcascade.report.digits import stated, uncertain
from winchcascade.report.screen import toned
from winchcascade.report.sheet import Limit, TableColumn
from winchcascade.report.text_table import at_most, data_lines, headed, joined, listing, metric_steps, wrapped
from winchcascade.report.wording import load_text

LISTED_RUNS = Limit(20, "more, in the dataset")
"""Logs that are listed; of more the first and the last half of that."""

MAX_FAULTS = 10

MAX_ALTERED = 5
"""Altered files that are named."""


def window_text(run: LogSummary) -> str:
    """Rule of the integration window of a log: a word, or the fixed length in seconds."""
    return run.window if isinstance(run.window, str) else f"{run.window:g}"


def has_speeds(runs: Sequence[LogSummary]) -> bool:
    """Whether the plateau speed of any log is known."""
    return any(run.plateau_speed_mps is not None for run in runs)


def mixed_windows(runs: Sequence[LogSummary]) -> str:
    """Report that logs have windows of several rules; empty if they have one."""
    rules = sorted(window_rules(runs).items(), key=lambda item: -len(item[1]))
    named = ", ".join(
        f"{rule} in {len(found)} ({one_line(found[0].name)}{', …' * (len(found) > 1)})" for rule, found in rules
    )
    text = f"{len(rules)} rules: {named}. Energies, powers and efficiencies of different rules cannot be compared."
    return text if len(rules) > 1 else ""


# -------------------------------------------------------------------------------------------------------- the terminal
def campaign_text(campaign: CampaignRecord, out: Path, *, kept: int, altered: Sequence[str] = ()) -> str:
    """Means of every log of a campaign, what failed, and where the results are.

    Parameters
    ----------
    kept : logs that an earlier call had done already
    altered : files of an earlier call that did not match their digest
    """
    runs = runs_by_load(campaign.reduced)
    mixed, unlike = mixed_windows(runs), unlike_motion(runs)
    earlier = f", {kept} of them by an earlier call" if kept else ""
    lines = [
        *wrapped(f"{campaign.title}: {len(runs)} of {len(campaign.runs)} logs reduced{earlier}", piped=None),
        *(data_lines([run.origin for run in runs]) if runs else []),
        "",
        *([*_table(runs), *_marked(runs), *_between(campaign), ""] if runs else []),
        *([*headed(wrapped(f"note: windows of {mixed}"), "note", "warning"), ""] if mixed else []),
        *([*headed(wrapped(f"note: {motion_words(*unlike)}."), "note", "warning"), ""] if unlike else []),
    ]
    if campaign.waves is not UNSET:
        from winchcascade.report.render.terminal import terminal_text
        from winchcascade.report.results.waves import wave_section

        waves = wave_section(waves_from_record(campaign.waves))
        left_out = [Note(text, "Left out") for text in campaign.waves.left_out]
        lines += [
            *terminal_text(Report("Waves", "Waves of all logs", points=left_out, sections=[waves])).splitlines(),
            "",
        ]
    lines += [*altered_lines(altered), *_fault_lines(campaign, out)]
    named = [
        ("index", out / "index.html"),
        ("report", out / "campaign.html"), ("", out / "campaign.pdf"), ("workbook", out / "campaign.xlsx"),
        ("record", out / "campaign.json"), ("tables", out / "dataset"), ("each log", out / "runs"),
    ]  # fmt: skip
    lines += [f"{name + ':' if name else '':<10}{path}" for name, path in named if path.exists()]
    return joined(lines)


def fault_text(campaign: CampaignRecord, out: Path) -> str:
    """Logs that could not be reduced, and why."""
    return joined(_fault_lines(campaign, out))


def _fault_lines(campaign: CampaignRecord, out: Path) -> list[str]:
    return at_most(
        [headed(wrapped(f"failed: {named_fault(run)}", piped=None), "failed", "contradiction") for run in campaign.failed],
        MAX_FAULTS, f"more failed, all in {out / 'campaign.json'}",
    )  # fmt: skip


def altered_lines(altered: Sequence[str]) -> list[str]:
    """One line that names files which were changed after they were made, and so were made again; none if there are none."""
    more = f" and {len(altered) - MAX_ALTERED} more" if len(altered) > MAX_ALTERED else ""
    names = ", ".join(map(one_line, altered[:MAX_ALTERED]))
    return (
        wrapped(f"made again, as the content did not match the digest of the earlier call: {names}{more}", piped=None)
        if altered
        else []
    )


def named_fault(run: FailedLog) -> str:
    """Name and fault of a log, the name once."""
    name, fault = one_line(run.name), one_line(run.fault)
    return fault if name in fault.split(": ")[0] else f"{name}: {fault}"


def _table(runs: Sequence[LogSummary]) -> list[str]:
    cascade = cascade_of(runs)
    metrics = [
        TableColumn(m.replace("energy", "E"), "J" if m.startswith("energy") else "", of=partial(_mean, m))
        for m in (*cascade.energies, *cascade.ratios)
    ]
    columns = [
        *_LOG[:2],
        *([_SPEED] if has_speeds(runs) else []),
        *_LOG[2:],
        *metrics,
        TableColumn("±", of=partial(_uncertainty, cascade)),
        *_FINDINGS,
    ]
    return listing(
        columns if any(run.findings for run in runs) else columns[:-1],
        runs,
        LISTED_RUNS,
        omit=["window", "cycles", *metric_steps(cascade.energies, cascade.ratios), f"E_{cascade.names[-1]}", "±"],
    )


def _name(run: LogSummary) -> str:
    name = one_line(run.name)
    return name if len(name) <= 24 else f"{name[:12]}…{name[-11:]}"


def _mean(metric: str, run: LogSummary) -> str:
    return stated(run.mean.get(field_of(metric)), None, 3 if metric.startswith("eta") else 0).replace("–", "-")


def _uncertainty(cascade: Cascade, run: LogSummary) -> str:
    """Standard uncertainty of the first efficiency that has a mean: of the whole cascade, else of a stage."""
    u, mean = run.standard_uncertainty, run.mean
    names = (cascade.overall, *cascade.neighbours)
    given = next((u[name] for name in names if mean.get(name) is not None), None)
    return uncertain(given).replace("–", "-")


_LOG: tuple[TableColumn[LogSummary], ...] = (
    TableColumn("log", of=_name),
    TableColumn("load", "ohm", of=lambda run: load_text(run.load)),
    TableColumn("window", "s", of=window_text),
    TableColumn(
        "cycles", of=lambda run: f"{run.complete}" + ("" if run.complete == run.cycles else f" of {run.cycles}")
    ),
)
_SPEED: TableColumn[LogSummary] = TableColumn(
    "plateau", "m/s", of=lambda run: stated(run.plateau_speed_mps, None, 3).replace("–", "-")
)
_FINDINGS: tuple[TableColumn[LogSummary], ...] = (
    TableColumn("findings", of=lambda run: toned(f"! {run.finding_count}", "warning") if run.findings else "-"),
)


def _marked(runs: Sequence[LogSummary]) -> list[str]:
    """The sentence on the rows that are marked: how many, and with which kinds of findings."""
    found = [run for run in runs if run.findings]
    kinds = ", ".join(sorted({kind for run in found for kind in run.findings}))
    return (
        headed(
            wrapped(f"! findings in {len(found)} of {len(runs)} logs, listed in each log's report and JSON: {kinds}"),
            "!",
            "warning",
        )
        if found
        else []
    )


def _between(campaign: CampaignRecord) -> list[str]:
    """Findings of single logs beside the others."""
    texts = (one_line(f"{name}: {found.kind}: {found.message}; {found.action}") for name, found in campaign.between)
    return at_most([wrapped(text, "  ") for text in texts], MAX_FAULTS, "more, in the dataset", indent="  ")
