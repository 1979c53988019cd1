"""A reduction as a table for the terminal, in plain text: a table library would cost more time than the reduction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.montecarlo import stated_uncertainty
from winchcascade.report.report_model import TableColumn
from winchcascade.report.text_table import at_most, listing, plain_cell, wrapped
from winchcascade.report.wording import decisive, label, load_words, net_reasons, not_known, of_phase, window_words

if TYPE_CHECKING:
    from pathlib import Path

    from winchcascade.core.run import Finding, Run
    from winchcascade.reduction.efficiency import Metrics
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.rig.simulate import Simulation

_WIDTH = 80
_MOST_CYCLES = 20
_MOST_FINDINGS = 12
_MOST_REASONS = 3
_MORE = "cycles more, all in --json and --parquet"


def reduction_text(reduction: Reduction) -> str:
    """Energies and efficiencies of the cycles, their mean, largest deviation and uncertainty, the phases and the findings.

    First those of the windows, then those of whole cycles. Mean powers are those of the window; a cycle in brackets is
    incomplete and not in the mean. At most 80 columns wide for a crane trial.
    """
    known, uncertainties = stated_uncertainty(reduction)
    lines = [*_title(reduction), "", *_results(reduction, uncertainties), "", *_net(reduction, uncertainties), ""]
    watts = _decimals(reduction, "power")
    powers: list[TableColumn[CycleResult]] = [
        TableColumn(f"P_{stage}", "W", watts, of=attrgetter(f"metrics.power_{stage}"))
        for stage in reduction.rig.cascade.names
    ]
    lines += listing([*_PHASES, *powers], reduction.cycles, most=_MOST_CYCLES, more=_MORE, used=True)
    if reduction.rig.phases.source == "waves":
        lines += ["", *_waves(reduction)]
    parts = ", ".join(f"{metric} {share:.0%} {name}" for metric, share, name in decisive(known))
    sentences = [*([f"most of the variance: {parts}"] if parts else []), *not_known(known)]
    lines += ["", *(wrapped(f"uncertainty: {'; '.join(sentences)}", width=_WIDTH) if sentences else [])]
    quality = [_finding(finding, reduction.run.samples) for finding in reduction.quality]
    lines.append(f"findings: {len(quality) or 'none'}")
    blocks = [wrapped(text, "  ", width=_WIDTH) for text in quality]
    return "\n".join([*lines, *at_most(blocks, _MOST_FINDINGS, "more, all in --json", "  ")]) + "\n"


def _waves(reduction: Reduction) -> list[str]:
    from winchcascade.reduction.wave_energies import wave_energies
    from winchcascade.report.wave_text import wave_lines

    return wave_lines(wave_energies(reduction))


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
    columns = [_CYCLE, window, *_columns(reduction, names)]
    lines = listing(columns, reduction.cycles, most=_MOST_CYCLES, more=_MORE, below=below, used=True)
    return [*lines, *_both_ways(reduction)]


def _both_ways(reduction: Reduction) -> list[str]:
    """Stages whose power changes its direction: what flows with the cascade and against it."""
    digits = _decimals(reduction)
    return [
        f"{stage}: {plain_cell(forth, digits)} J with the cascade, {plain_cell(back, digits)} J against it"
        for stage, (forth, back) in reduction.both_ways.items()
        if forth > 0.0 > back
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
        columns = [_CYCLE, *_columns(reduction, names)]
        lines += listing(columns, reduction.cycles, most=_MOST_CYCLES, more=_MORE, below=below, used=True)
    reasons = [wrapped(f"no net energy, {sentence}", width=_WIDTH) for sentence in net_reasons(reduction.cycles)]
    return lines + at_most(reasons, _MOST_REASONS, "more reasons, all in --json", "  ")


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
            repeats and any(getattr(uncertainties, name) is not None for name in names),
            uncertainties,
            energy,
            4,
        ),
    )
    return [[name, *lead, *_texts(m, names, *decimals)] for name, wanted, m, *decimals in rows if wanted]


def _texts(m: Metrics, names: Sequence[str], energy: int, eta: int) -> list[str]:
    """Texts of metrics, energies and efficiencies with so many decimals."""
    return [plain_cell(getattr(m, name), eta if name.startswith("eta") else energy) for name in names]


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


def _title(reduction: Reduction) -> list[str]:
    run, rig = reduction.run, reduction.rig
    table = "" if run.table is None else f", table {one_line(run.table)!r}"
    drum = "" if rig.r_drum is None else f" (drum radius {rig.r_drum:g} m)"
    parts = [_load(reduction), f"rig {one_line(rig.name)}{drum}", f"window {window_words(reduction.window)}"]
    return [
        f"{one_line(run.name)}{table}: {run.samples} samples at {run.fs:.6g} Hz, {_duration(run)}",
        "; ".join(part for part in parts if part),
        *([f"campaign: {one_line(run.about)}"] if run.about else []),
        *wrapped(f"data: {origin_words([run.origin])}", width=_WIDTH),
        *([f"rig note: {one_line(rig.note)}"] if rig.note else []),
    ]


def _load(reduction: Reduction) -> str:
    run = reduction.run
    if run.load is None:
        return "load unknown" if "vdc" in run.channels else ""
    return f"{load_words(run.load, 'ohm', before='load ')} ({one_line(run.load_source)})"


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
    share = finding.removed / samples if samples else 0.0
    cost = f", {share:.2%} of the samples" if share >= 0.0001 else ", less than 0.01% of the samples" if share else ""
    return one_line(f"{finding.kind}: {finding.message}{where}; {finding.action}{cost}")


def simulation_text(simulation: Simulation, out: Path) -> str:
    """Where the line's energy went in a simulation, until its largest, and where the log is."""
    run, energy = simulation.run, simulation.energy
    most = int(energy["line"].argmax())
    line = float(energy["line"][most])
    load = load_words(run.load, "ohm", before="load ")
    shares = {name: float(joule[most]) for name, joule in energy.items() if abs(joule[most]) >= 5e-4 * abs(line)}
    rows = [("energy", "J", "share"), *((n, f"{e:.0f}", f"{e / line:.1%}" if line else "-") for n, e in shares.items())]
    lines = [f"{one_line(run.name)}: simulated at {load}, {run.samples} samples, {_duration(run)}", ""]
    lines += [f"{name:<12}{joule:>9}{share:>9}" for name, joule, share in rows]
    return "\n".join([*lines, "", f"log: {out}"]) + "\n"
