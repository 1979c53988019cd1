"""A reduction as a table for the terminal, in plain text: a table library would cost more time than the reduction."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.efficiency import METRICS, NET_METRICS
from winchcascade.reduction.montecarlo import stated_uncertainty
from winchcascade.report.wording import decisive, net_reasons, not_known

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
_RESULTS = (
    ("cycle", "window", "E_line", "E_mech", "E_gen", "eta_trans", "eta_gen", "eta_pto"),
    ("", "s", "J", "J", "J", "", "", ""),
)
_NET = (
    ("cycle", "E_payout", "E_returned", "E_net", "E_gen_cycle", "eta_net"),
    ("", "J", "J", "J", "J", ""),
)
_MOST_REASONS = 3
_PHASES = (
    ("cycle", "onset", "payout", "hold", "haul-in", "travel", "plateau", "P_line", "P_mech", "P_gen"),
    ("", "s", "s", "s", "s", "m", "m/s", "W", "W", "W"),
)


def reduction_text(reduction: Reduction) -> str:
    """Energies and efficiencies of the cycles, their mean, largest deviation and uncertainty, the phases and the findings.

    First those of the windows, then those of whole cycles. Mean powers are those of the window; a cycle in brackets is
    incomplete and not in the mean. At most 80 columns wide for a crane trial.
    """
    cycles, (known, stated) = reduction.cycles, stated_uncertainty(reduction)
    lines = [*_title(reduction), ""]
    lines += [
        *_table(_RESULTS, cycles, partial(_result_row, energy=_decimals(reduction)), _summary_rows(reduction, stated)),
        "",
    ]
    lines += _net(reduction, stated)
    lines += _table(_PHASES, cycles, _phase_row, [])
    return "\n".join([*lines, "", *_uncertainty(known), *_findings(reduction)]) + "\n"


def _table(
    head: tuple[tuple[str, ...], ...],
    cycles: Sequence[CycleResult],
    row: Callable[[CycleResult], tuple[str, ...]],
    below: Sequence[tuple[str, ...]],
) -> list[str]:
    """A table of cycles under a head of two lines; of many cycles the first and the last."""
    few = len(cycles) <= _MOST_CYCLES
    half = _MOST_CYCLES // 2
    shown = cycles if few else [*cycles[:half], *cycles[-half:]]
    lines = _aligned([*head, *(row(c) for c in shown), *below])
    if not few:
        lines.insert(len(head) + half, f"... {len(cycles) - _MOST_CYCLES} cycles more, all in --json and --parquet ...")
    return lines


def _summary_rows(reduction: Reduction, stated: Metrics) -> list[tuple[str, ...]]:
    complete = len(reduction.complete)
    rows = []
    if not complete:
        rows.append(("no mean: no complete cycle", *[""] * (len(_RESULTS[0]) - 1)))
    if complete:
        rows.append(_metrics_row(f"mean of {complete}", "", reduction.mean, energy=_decimals(reduction), eta=3))
    if complete > 1:
        rows.append(_metrics_row("largest dev. %", "", reduction.max_deviation_percent, energy=2, eta=2))
    if any(getattr(stated, m) is not None for m in METRICS):
        rows.append(_metrics_row("std. uncertainty", "", stated, energy=_decimals(reduction), eta=4))
    if complete > 1 and reduction.window == "payout":  # windows differ in length, so sums tell what a mean does not
        rows.append(_metrics_row("all together", "", reduction.total, energy=_decimals(reduction), eta=3))
    return rows


def _net(reduction: Reduction, stated: Metrics) -> list[str]:
    """Energies of whole cycles, from onset to next onset, and why some cycles have none."""
    import textwrap

    digits, lines = _decimals(reduction), []
    counted = [c for c in reduction.complete if c.metrics.energy_net is not None]
    if any(c.metrics.energy_net is not None for c in reduction.cycles):
        row = partial(_net_row, energy=digits)
        below = [row(f"mean of {len(counted)}", reduction.mean, eta=3)] if counted else []
        below += [row("largest dev. %", reduction.max_deviation_percent, energy=2, eta=2)] if len(counted) > 1 else []
        below += [row("std. uncertainty", stated, eta=4)] if stated.energy_net is not None else []
        lines += [*_table(_NET, reduction.cycles, lambda c: row(_label(c), c.metrics, eta=3), below)]
    reasons = net_reasons(reduction.cycles)
    for sentence in reasons[:_MOST_REASONS]:
        lines += textwrap.wrap(f"no net energy, {sentence}", _WIDTH, subsequent_indent="  ", break_on_hyphens=False)
    lines += (
        [f"  ... {len(reasons) - _MOST_REASONS} more reasons, all in --json"] if len(reasons) > _MOST_REASONS else []
    )
    return [*lines, ""]


def _net_row(name: str, m: Metrics, *, energy: int, eta: int) -> tuple[str, ...]:
    return (name, *(_number(getattr(m, n), eta if n == "eta_net" else energy) for n in NET_METRICS))


def _title(reduction: Reduction) -> list[str]:
    import textwrap

    run, rig = reduction.run, reduction.rig
    seconds = float(run.t[-1] - run.t[0])
    table = "" if run.table is None else f", table {one_line(run.table)!r}"
    first = f"{one_line(run.name)}{table}: {run.samples} samples at {run.fs:.6g} Hz, {_duration(seconds)}"
    window = reduction.window if isinstance(reduction.window, str) else f"{reduction.window:g} s from the onset"
    drum = "" if rig.r_drum is None else f" (drum radius {rig.r_drum:g} m)"
    parts = [_load(reduction), f"rig {one_line(rig.name)}{drum}", f"window {window}"]
    lines = [first, "; ".join(part for part in parts if part)]
    lines += [f"campaign: {one_line(run.about)}"] if run.about else []
    lines += textwrap.wrap(f"data: {one_line(origin_words([run.origin]))}", _WIDTH, subsequent_indent="  ")
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


def _label(cycle: CycleResult) -> str:
    return f"{cycle.cycle}" if cycle.complete else f"({cycle.cycle})"


def _decimals(reduction: Reduction) -> int:
    """Decimals of the energies: none for hundreds of joules and more, else as many as give three digits."""
    joules = [abs(e) for m in METRICS[:3] if (e := getattr(reduction.mean, m)) is not None]
    largest = max(joules, default=0.0)
    return 0 if largest >= 100 or largest == 0 else min(2 - math.floor(math.log10(largest)), 9)


def _result_row(cycle: CycleResult, *, energy: int) -> tuple[str, ...]:
    window = f"{cycle.window.cutoff - cycle.window.onset:.2f}"
    return _metrics_row(_label(cycle), window, cycle.metrics, energy=energy, eta=3)


def _metrics_row(name: str, window: str, m: Metrics, *, energy: int, eta: int) -> tuple[str, ...]:
    return (
        name,
        window,
        *(_number(value, energy) for value in (m.energy_line, m.energy_mech, m.energy_gen)),
        *(_number(value, eta) for value in (m.eta_trans, m.eta_gen, m.eta_pto)),
    )


def _phase_row(cycle: CycleResult) -> tuple[str, ...]:
    payout, hold, haul_in = cycle.summary.payout, cycle.summary.hold, cycle.summary.haul_in
    return (
        _label(cycle),
        f"{cycle.window.onset:.2f}",
        f"{payout.duration:.2f}",
        _number(None if hold is None else hold.duration, 2),
        _number(None if haul_in is None else haul_in.duration, 2),
        f"{payout.travel:.2f}",
        _number(None if payout.plateau is None else payout.plateau.speed, 3),
        *(_number(p, 0) for p in (cycle.metrics.power_line, cycle.metrics.power_mech, cycle.metrics.power_gen)),
    )


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns under each other, numbers to the right; a column without any entry is left out."""
    used = [k for k in range(len(rows[0])) if k == 0 or any(row[k] not in ("", "-") for row in rows[2:])]
    width = {k: max(len(row[k]) for row in rows) for k in used}
    return [
        "  ".join(row[k].ljust(width[k]) if k == 0 else row[k].rjust(width[k]) for k in used).rstrip() for row in rows
    ]


def _uncertainty(known: Budget) -> list[str]:
    """What decides the uncertainty of the efficiencies, and what is not known of it."""
    import textwrap

    sentences = [*decisive(known), *not_known(known)]
    return textwrap.wrap(f"uncertainty: {'; '.join(sentences)}", _WIDTH, subsequent_indent="  ") if sentences else []


def _findings(reduction: Reduction) -> list[str]:
    import textwrap

    quality, samples = reduction.quality, reduction.run.samples
    if not quality:
        return ["findings: none"]
    lines = [f"findings: {len(quality)}"]
    for finding in quality[:_MOST_FINDINGS]:
        lines += textwrap.wrap(_finding(finding, samples), _WIDTH, initial_indent="  ", subsequent_indent="    ")
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
