"""A reduction as a table for the terminal, in plain text: a table library would cost more time than the reduction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING

from winchcascade.core.plain_text import one_line
from winchcascade.reduction.montecarlo import stated_uncertainty
from winchcascade.report.screen import toned
from winchcascade.report.sheet import Limit, TableColumn
from winchcascade.report.text_table import (
    at_most,
    data_lines,
    headed,
    joined,
    listing,
    metric_steps,
    plain_cell,
    wrapped,
)
from winchcascade.report.wording import (
    decisive,
    label,
    load_words,
    measured_load_words,
    net_reasons,
    not_known,
    of_phase,
    span_word,
    window_words,
)

if TYPE_CHECKING:
    from winchcascade.core.run import Finding, Run
    from winchcascade.reduction.efficiency import Metrics
    from winchcascade.reduction.reduction_result import CycleResult, Reduction

_PIPED = 80
"""Columns of a sentence in a pipe. [characters]"""

_CYCLES = Limit(20, "cycles more, all in --json and --parquet")
_MAX_FINDINGS = 12
_MAX_REASONS = 3


def reduction_text(reduction: Reduction) -> str:
    """Energies and efficiencies of the cycles, their mean, largest deviation and uncertainty, the phases and the findings.

    First those of the windows, then those of whole cycles. Mean powers are those of the window; a cycle in brackets is
    incomplete and not in the mean. In a pipe at most 80 columns wide for a crane trial.
    """
    known, uncertainties = stated_uncertainty(reduction)
    lines = [*_title(reduction), "", *_results(reduction, uncertainties), "", *_net(reduction, uncertainties)]
    lines += [""] if lines[-1] else []
    watts = _decimals(reduction, "power")
    powers: list[TableColumn[CycleResult]] = [
        TableColumn(f"P_{stage}", "W", watts, of=attrgetter(f"metrics.power_{stage}"))
        for stage in reduction.rig.cascade.names
    ]
    inner = [column.name for column in powers[:-1]]
    length: TableColumn[CycleResult] = TableColumn("length", "s", 2, of=partial(of_phase, "payout", "duration"))
    phases = _PHASES if span_word(reduction) == "payout" else (*_PHASES[:2], length, *_PHASES[3:])
    lines += listing([*phases, *powers], reduction.cycles, _CYCLES, used=True, omit=[*_LESS, *inner])
    if reduction.rig.phases.source == "waves":
        from winchcascade.reduction.wave_energies import wave_energies
        from winchcascade.report.wave_text import wave_lines

        lines += ["", *wave_lines(wave_energies(reduction))]
    parts = ", ".join(f"{metric} {share:.0%} {name}" for metric, share, name in decisive(known))
    sentences = [*([f"most of the variance: {parts}"] if parts else []), *not_known(known)]
    lines += ["", *(wrapped(f"uncertainty: {'; '.join(sentences)}", piped=_PIPED) if sentences else [])]
    quality = reduction.quality
    lines.append(f"findings: {toned(f'{len(quality)}', 'warning') if quality else toned('none', 'good')}")
    blocks = [
        headed(
            wrapped(_finding(finding, reduction.run.samples), "  ", _PIPED),
            finding.kind,
            "contradiction" if finding.kind in _CONTRADICTIONS else "warning",
        )
        for finding in quality
    ]
    return joined([*lines, *at_most(blocks, _MAX_FINDINGS, "more, all in --json", "  ")])


_CYCLE: TableColumn[CycleResult] = TableColumn("cycle", of=label)


def _results(reduction: Reduction, uncertainties: Metrics) -> list[str]:
    """Energies and efficiencies of the windows."""
    cascade, n = reduction.rig.cascade, len(reduction.complete)
    names = (*cascade.energies, *cascade.ratios)
    window: TableColumn[CycleResult] = TableColumn("window", "s", 2, of=lambda c: c.window.cutoff - c.window.onset)
    below = [] if n else [["no mean: no complete cycle", *[""] * (len(names) + 1)]]
    below += _means(reduction, uncertainties, names, n, [""])
    if n > 1 and reduction.window in ("payout", "whole"):  # windows differ in length, so sums show what a mean does not
        below.append(["all together", "", *_texts(reduction.total, names, _decimals(reduction), 3)])
    lines = listing(
        [_CYCLE, window, *_columns(reduction, names)],
        reduction.cycles,
        _CYCLES,
        below=below,
        used=True,
        omit=["window", *metric_steps(cascade.energies, cascade.ratios)],
    )
    return [*lines, *_both_ways(reduction)]


def _both_ways(reduction: Reduction) -> list[str]:
    """Stages whose power changes its direction: what flows with the cascade and against it."""
    digits = _decimals(reduction)
    return [
        f"{stage}: {plain_cell(forth, digits)} J with the cascade, {plain_cell(back, digits)} J against it"
        for stage, (forth, back) in reduction.both_ways.items()
        if min(forth, -back) >= 0.5 * 10.0**-digits
    ]


def _net(reduction: Reduction, uncertainties: Metrics) -> list[str]:
    """Energies of whole cycles, from onset to next onset, and why some cycles have none."""
    lines: list[str] = []
    names = reduction.rig.cascade.net_metrics
    if not names:
        return lines
    if any(c.metrics.energy_net is not None for c in reduction.cycles):
        n = sum(c.metrics.energy_net is not None for c in reduction.complete)
        below = _means(reduction, uncertainties, names, n, [])
        lines += listing(
            [_CYCLE, *_columns(reduction, names)], reduction.cycles, _CYCLES, below=below, used=True, omit=_LESS_NET
        )
    reasons = [wrapped(f"no net energy, {sentence}", piped=_PIPED) for sentence in net_reasons(reduction.cycles)]
    return lines + at_most(reasons, _MAX_REASONS, "more reasons, all in --json", "  ")


def _columns(reduction: Reduction, names: Sequence[str]) -> list[TableColumn[CycleResult]]:
    """Metrics of a cycle, energies and efficiencies."""
    energy = _decimals(reduction)
    return [
        TableColumn(name, "", 3, of=attrgetter(f"metrics.{name}"))
        if name.startswith("eta")
        else TableColumn(name.replace("energy", "E"), "J", energy, of=attrgetter(f"metrics.{name}"))
        for name in names
    ]


def _means(
    reduction: Reduction, uncertainties: Metrics, names: Sequence[str], n: int, lead: list[str]
) -> list[list[str]]:
    """Rows below those of the cycles: the mean of n of them, the largest deviation and the uncertainty.

    Parameters
    ----------
    lead : cells between the names of the rows and the metrics
    """
    energy, repeats = _decimals(reduction), reduction.rig.phases.repeats
    rows = (
        (f"mean of {n}", n > 0 and repeats, reduction.mean, energy, 3),
        ("largest dev. %", n > 1 and repeats, reduction.max_deviation_percent, 2, 2),
        (
            "std. uncertainty",
            repeats and any(uncertainties[name] is not None for name in names),
            uncertainties,
            energy,
            4,
        ),
    )
    return [[name, *lead, *_texts(m, names, *decimals)] for name, wanted, m, *decimals in rows if wanted]


def _texts(m: Metrics, names: Sequence[str], energy: int, eta: int) -> list[str]:
    """Texts of metrics, energies and efficiencies with a given number of decimals."""
    return [plain_cell(m[name], eta if name.startswith("eta") else energy) for name in names]


_PHASES: tuple[TableColumn[CycleResult], ...] = (
    _CYCLE,
    TableColumn("onset", "s", 2, of=lambda c: c.window.onset),
    TableColumn("payout", "s", 2, of=partial(of_phase, "payout", "duration")),
    TableColumn("hold", "s", 2, of=partial(of_phase, "hold", "duration")),
    TableColumn("haul-in", "s", 2, of=partial(of_phase, "haul_in", "duration")),
    TableColumn("travel", "m", 2, of=partial(of_phase, "payout", "travel")),
    TableColumn("speed", "rpm", 1, of=partial(of_phase, "point", "rpm_shaft")),
    TableColumn("torque", "N.m", 3, of=partial(of_phase, "point", "torque")),
    TableColumn("plateau", "m/s", 3, of=partial(of_phase, "plateau", "speed")),
)


_LESS = ("hold", "haul-in", "onset", "payout")
"""Columns of the phases that are left out first, before powers of inner stages."""

_LESS_NET = ("E_returned", "E_payout", "E_gen_cycle")
"""Columns of whole cycles that are left out first."""

_CONTRADICTIONS = {"load_mismatch", "unit_conflict", "speed_mismatch", "clock_mismatch", "origin_conflict"}
"""Findings of which two statements contradict each other."""


def _title(reduction: Reduction) -> list[str]:
    run, rig = reduction.run, reduction.rig
    table = "" if run.table is None else f", table {one_line(run.table)!r}"
    drum = "" if rig.r_drum is None else f" (drum radius {rig.r_drum:g} m)"
    parts = [_load(reduction), f"rig {one_line(rig.name)}{drum}", f"window {window_words(reduction.window)}"]
    return [
        *wrapped(f"{run.name}{table}: {run.samples} samples at {run.fs:.6g} Hz, {_duration(run)}", piped=None),
        *wrapped("; ".join(part for part in parts if part), piped=None),
        *(wrapped(f"campaign: {run.about}", piped=None) if run.about else []),
        *data_lines([run.origin], _PIPED),
        *(wrapped(f"rig note: {rig.note}", piped=None) if rig.note else []),
    ]


def _load(reduction: Reduction) -> str:
    run = reduction.run
    unknown = "load unknown" if "vdc" in run.channels else ""
    known = f"{load_words(run.load, 'ohm', before='load ')} ({one_line(run.load_source)})"
    texts = (unknown if run.load is None else known, measured_load_words(reduction.measured_load, "ohm"))
    return ", ".join(text for text in texts if text)


def _duration(run: Run) -> str:
    seconds = float(run.t[-1] - run.t[0])
    if seconds < 600:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _decimals(reduction: Reduction, kind: str = "energy") -> int:
    """Decimals of the energies or powers: none for hundreds and more, else as many as give three digits."""
    means = (reduction.mean[f"{kind}_{stage}"] for stage in reduction.rig.cascade.names)
    largest = max((abs(mean) for mean in means if mean is not None), default=0.0)
    return 0 if largest >= 100 or largest == 0 else min(2 - math.floor(math.log10(largest)), 9)


def _finding(finding: Finding, samples: int) -> str:
    where = ""
    if finding.start is not None and finding.end is not None and finding.kind != "incomplete_cycle":
        same = finding.end - finding.start < 0.005
        where = f" at {finding.start:.2f} s" if same else f" from {finding.start:.2f} to {finding.end:.2f} s"
    share = finding.lost_share(samples)
    cost = f", {share:.2%} of the samples" if share >= 0.0001 else ", less than 0.01% of the samples" if share else ""
    return one_line(f"{finding.kind}: {finding.message}{where}; {finding.action}{cost}")
