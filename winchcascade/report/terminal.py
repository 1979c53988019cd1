"""A reduction as a table for the terminal, in plain text: a table library would cost more time than the reduction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.efficiency import METRICS, NET_METRICS
from winchcascade.reduction.montecarlo import stated_uncertainty
from winchcascade.report.report_model import TableColumn
from winchcascade.report.text_table import listing, plain_cell, wrapped
from winchcascade.report.wording import decisive, label, net_reasons, not_known

if TYPE_CHECKING:
    from pathlib import Path

    from winchcascade.core.run import Finding
    from winchcascade.reduction.efficiency import Metrics
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.reduction.uncertainty import Budget
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
    lines += listing(_PHASES, reduction.cycles, most=_MOST_CYCLES, more=_MORE, used=True)
    return "\n".join([*lines, "", *_uncertainty(known), *_findings(reduction)]) + "\n"


def _metrics(m: Metrics, names: Iterable[str], energy: int, eta: int) -> list[str]:
    """Texts of metrics, energies and efficiencies with so many decimals."""
    values = asdict(m)
    return [plain_cell(values[name], eta if name.startswith("eta") else energy) for name in names]


def _metric(name: str, energy: int, cycle: CycleResult) -> str:
    return _metrics(cycle.metrics, [name], energy, 3)[0]


def _columns(reduction: Reduction, names: Sequence[str]) -> list[TableColumn[CycleResult]]:
    """The number of a cycle, then its metrics."""
    energy = _decimals(reduction)
    return [
        TableColumn("cycle", of=label),
        *(
            TableColumn(
                name.replace("energy", "E"),
                "" if name.startswith("eta") else "J",
                of=partial(_metric, name, energy),
            )
            for name in names
        ),
    ]


def _results(reduction: Reduction, uncertainties: Metrics) -> list[str]:
    """Energies and efficiencies of the windows."""
    energy, complete, names = _decimals(reduction), len(reduction.complete), (*METRICS[:3], *METRICS[6:])
    columns = _columns(reduction, names)
    columns.insert(1, TableColumn("window", "s", 2, of=lambda c: c.window.cutoff - c.window.onset))
    below = []
    if not complete:
        below.append(["no mean: no complete cycle", *[""] * (len(columns) - 1)])
    if complete:
        below.append([f"mean of {complete}", "", *_metrics(reduction.mean, names, energy, 3)])
    if complete > 1:
        below.append(["largest dev. %", "", *_metrics(reduction.max_deviation_percent, names, 2, 2)])
    if any(value is not None for value in asdict(uncertainties).values()):
        below.append(["std. uncertainty", "", *_metrics(uncertainties, names, energy, 4)])
    if complete > 1 and reduction.window == "payout":  # windows differ in length, so sums show what a mean does not
        below.append(["all together", "", *_metrics(reduction.total, names, energy, 3)])
    return listing(columns, reduction.cycles, most=_MOST_CYCLES, more=_MORE, below=below, used=True)


def _net(reduction: Reduction, uncertainties: Metrics) -> list[str]:
    """Energies of whole cycles, from onset to next onset, and why some cycles have none."""
    energy, lines = _decimals(reduction), []
    counted = [c for c in reduction.complete if c.metrics.energy_net is not None]
    if any(c.metrics.energy_net is not None for c in reduction.cycles):
        below = []
        if counted:
            below.append([f"mean of {len(counted)}", *_metrics(reduction.mean, NET_METRICS, energy, 3)])
        if len(counted) > 1:
            below.append(["largest dev. %", *_metrics(reduction.max_deviation_percent, NET_METRICS, 2, 2)])
        if uncertainties.energy_net is not None:
            below.append(["std. uncertainty", *_metrics(uncertainties, NET_METRICS, energy, 4)])
        columns = _columns(reduction, NET_METRICS)
        lines = listing(columns, reduction.cycles, most=_MOST_CYCLES, more=_MORE, below=below, used=True)
    reasons = net_reasons(reduction.cycles)
    for sentence in reasons[:_MOST_REASONS]:
        lines += wrapped(f"no net energy, {sentence}", width=_WIDTH)
    if len(reasons) > _MOST_REASONS:
        lines.append(f"  ... {len(reasons) - _MOST_REASONS} more reasons, all in --json")
    return lines


_PHASES: tuple[TableColumn[CycleResult], ...] = (
    TableColumn("cycle", of=label),
    TableColumn("onset", "s", 2, of=lambda c: c.window.onset),
    TableColumn("payout", "s", 2, of=lambda c: c.summary.payout.duration),
    TableColumn("hold", "s", 2, of=lambda c: None if c.summary.hold is None else c.summary.hold.duration),
    TableColumn("haul-in", "s", 2, of=lambda c: None if c.summary.haul_in is None else c.summary.haul_in.duration),
    TableColumn("travel", "m", 2, of=lambda c: c.summary.payout.travel),
    TableColumn(
        "plateau", "m/s", 3, of=lambda c: None if (plateau := c.summary.payout.plateau) is None else plateau.speed
    ),
    TableColumn("P_line", "W", of=lambda c: c.metrics.power_line),
    TableColumn("P_mech", "W", of=lambda c: c.metrics.power_mech),
    TableColumn("P_gen", "W", of=lambda c: c.metrics.power_gen),
)


def _title(reduction: Reduction) -> list[str]:
    run, rig = reduction.run, reduction.rig
    seconds = float(run.t[-1] - run.t[0])
    table = "" if run.table is None else f", table {one_line(run.table)!r}"
    first = f"{one_line(run.name)}{table}: {run.samples} samples at {run.fs:.6g} Hz, {_duration(seconds)}"
    window = reduction.window if isinstance(reduction.window, str) else f"{reduction.window:g} s from the onset"
    drum = "" if rig.r_drum is None else f" (drum radius {rig.r_drum:g} m)"
    parts = [_load(reduction), f"rig {one_line(rig.name)}{drum}", f"window {window}"]
    lines = [first, "; ".join(part for part in parts if part)]
    lines += [f"campaign: {one_line(run.about)}"] if run.about else []
    lines += wrapped(f"data: {origin_words([run.origin])}", width=_WIDTH)
    lines += [f"rig note: {one_line(rig.note)}"] if rig.note else []
    return lines


def _load(reduction: Reduction) -> str:
    run = reduction.run
    if run.load is None:
        return "load unknown" if "vdc" in run.channels else ""
    return f"{'open circuit' if math.isinf(run.load) else f'load {run.load:g} ohm'} ({one_line(run.load_source)})"


def _duration(seconds: float) -> str:
    if seconds < 600:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _decimals(reduction: Reduction) -> int:
    """Decimals of the energies: none for hundreds of joules and more, else as many as give three digits."""
    joules = [abs(e) for m in METRICS[:3] if (e := getattr(reduction.mean, m)) is not None]
    largest = max(joules, default=0.0)
    return 0 if largest >= 100 or largest == 0 else min(2 - math.floor(math.log10(largest)), 9)


def _uncertainty(known: Budget) -> list[str]:
    """What decides the uncertainty of the efficiencies, and what is not known of it."""
    sentences = [*decisive(known), *not_known(known)]
    return wrapped(f"uncertainty: {'; '.join(sentences)}", width=_WIDTH) if sentences else []


def _findings(reduction: Reduction) -> list[str]:
    quality, samples = reduction.quality, reduction.run.samples
    if not quality:
        return ["findings: none"]
    lines = [f"findings: {len(quality)}"]
    for finding in quality[:_MOST_FINDINGS]:
        lines += wrapped(_finding(finding, samples), "  ", width=_WIDTH)
    if len(quality) > _MOST_FINDINGS:
        lines.append(f"  ... {len(quality) - _MOST_FINDINGS} more, all in --json")
    return lines


def _finding(finding: Finding, samples: int) -> str:
    where = ""
    if finding.start is not None and finding.end is not None and finding.kind != "incomplete_cycle":
        same = finding.end - finding.start < 0.005
        where = f" at {finding.start:.2f} s" if same else f" from {finding.start:.2f} to {finding.end:.2f} s"
    cost = f", {_share(finding.removed / samples)} of the samples" if finding.removed and samples else ""
    return one_line(f"{finding.kind}: {finding.message}{where}; {finding.action}{cost}")


def _share(share: float) -> str:
    return f"{share:.2%}" if share >= 0.0001 else "less than 0.01%"


def simulation_text(simulation: Simulation, out: Path) -> str:
    """Where the line's energy went in a simulation, until its largest, and where the log is."""
    run, energy = simulation.run, simulation.energy
    most = int(energy["line"].argmax())
    line = float(energy["line"][most])
    load = "open circuit" if run.open_circuit else f"load {run.load:g} ohm"
    lines = [
        f"{one_line(run.name)}: simulated at {load}, {run.samples} samples, {_duration(float(run.t[-1] - run.t[0]))}",
        "",
    ]
    shares = {name: float(joule[most]) for name, joule in energy.items() if abs(joule[most]) >= 5e-4 * abs(line)}
    rows = [("energy", "J", "share"), *((n, f"{e:.0f}", f"{e / line:.1%}" if line else "-") for n, e in shares.items())]
    lines += [f"{name:<12}{joule:>9}{share:>9}" for name, joule, share in rows]
    return "\n".join([*lines, "", f"log: {out}"]) + "\n"
