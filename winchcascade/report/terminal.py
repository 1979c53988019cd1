"""A reduction as a table for the terminal, in plain text: a table library would cost more time than the reduction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from winchcascade.cascade.efficiency import Metrics
    from winchcascade.cascade.reduce import CycleResult, Reduction
    from winchcascade.run import Finding

_MOST_CYCLES = 20
_MOST_FINDINGS = 12
_HEAD = ("cycle", "onset", "window", "payout", "hold", "haul-in", "travel", "plateau", "E_line", "E_mech", "E_gen",
         "P_line", "P_mech", "P_gen", "eta_trans", "eta_gen", "eta_pto")  # fmt: skip
_UNITS = ("", "s", "s", "s", "s", "s", "m", "m/s", "J", "J", "J", "W", "W", "W", "", "", "")


def reduction_text(reduction: Reduction) -> str:
    """Cycles, phases, efficiencies, their mean and largest deviation, and the findings, as lines of text."""
    cycles = reduction.cycles
    shown = cycles if len(cycles) <= _MOST_CYCLES else cycles[: _MOST_CYCLES // 2] + cycles[-_MOST_CYCLES // 2 :]
    rows = [_HEAD, _UNITS, *(_cycle_row(c) for c in shown)]
    complete = len(reduction.complete)
    if complete:
        rows.append(_row(f"mean of {complete}", reduction.mean, energy=0, power=0, eta=3))
    if complete > 1:
        rows.append(_row("largest dev. %", reduction.max_deviation_percent, energy=2, power=2, eta=2))
    if complete and _total_tells_more(reduction):
        rows.append(_row("all together", reduction.total, energy=0, power=0, eta=3))
    lines = [*_title(reduction), "", *_aligned(rows)]
    if len(shown) < len(cycles):
        lines.insert(
            -(len(rows) - 2 - _MOST_CYCLES // 2), f"  ... {len(cycles) - len(shown)} cycles more, all in --json ..."
        )
    if not cycles:
        lines = [*_title(reduction), "", "no payout found: the line never pays out at more than the onset speed"]
    return "\n".join([*lines, "", *_findings(reduction)]) + "\n"


def _title(reduction: Reduction) -> list[str]:
    run, rig = reduction.run, reduction.rig
    seconds = float(run.t[-1] - run.t[0])
    kind = "simulated log, " if run.simulated else ""
    first = f"{_plain(run.name)}: {kind}{run.samples} samples at {run.fs:.6g} Hz, {_duration(seconds)}"
    window = reduction.window if isinstance(reduction.window, str) else f"{reduction.window:g} s from the onset"
    return [first, f"load {_load(run.load, run.load_source)}; rig {_plain(rig.name)}; window {window}"]


def _load(load: float | None, source: str) -> str:
    if load is None:
        return "unknown (--load-ohm tells it)" if source == "unknown" else source
    return f"{'open circuit' if math.isinf(load) else f'{load:g} ohm'} ({_plain(source)})"


def _duration(seconds: float) -> str:
    if seconds < 600:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _plain(text: str) -> str:
    """Text from a file without the control characters that a terminal would obey."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _cycle_row(cycle: CycleResult) -> tuple[str, ...]:
    payout, hold, haul_in = cycle.summary.payout, cycle.summary.hold, cycle.summary.haul_in
    flat = payout.plateau
    row = _row(f"{cycle.cycle}" if cycle.complete else f"({cycle.cycle})", cycle.metrics, energy=0, power=0, eta=3)
    return (
        row[0],
        f"{cycle.window.onset:.2f}",
        f"{cycle.window.cutoff - cycle.window.onset:.2f}",
        f"{payout.duration:.2f}",
        _number(None if hold is None else hold.duration, 2),
        _number(None if haul_in is None else haul_in.duration, 2),
        f"{payout.travel:.2f}",
        _number(None if flat is None else flat.speed, 3),
        *row[8:],
    )


def _row(name: str, m: Metrics, *, energy: int, power: int, eta: int) -> tuple[str, ...]:
    return (
        name, *[""] * 7,
        _number(m.energy_line, energy), _number(m.energy_mech, energy), _number(m.energy_gen, energy),
        _number(m.power_line, power), _number(m.power_mech, power), _number(m.power_gen, power),
        _number(m.eta_trans, eta), _number(m.eta_gen, eta), _number(m.eta_pto, eta),
    )  # fmt: skip


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _total_tells_more(reduction: Reduction) -> bool:
    """Windows that follow the payout differ in length, so sums say what a mean of unlike cycles does not."""
    return reduction.window == "payout" and len(reduction.complete) > 1


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns under each other, numbers to the right; a column without any entry is left out."""
    used = [k for k in range(len(rows[0])) if k == 0 or any(row[k] not in ("", "-") for row in rows[2:])]
    width = {k: max(len(row[k]) for row in rows) for k in used}
    return [
        "  ".join(row[k].ljust(width[k]) if k == 0 else row[k].rjust(width[k]) for k in used).rstrip() for row in rows
    ]


def _findings(reduction: Reduction) -> list[str]:
    quality, samples = reduction.quality, reduction.run.samples
    if not quality:
        return ["findings: none"]
    lines = [f"findings: {len(quality)}"]
    lines += [f"  {_finding(f, samples)}" for f in quality[:_MOST_FINDINGS]]
    if len(quality) > _MOST_FINDINGS:
        lines.append(f"  ... {len(quality) - _MOST_FINDINGS} more, all in --json")
    return lines


def _finding(finding: Finding, samples: int) -> str:
    where = ""
    if finding.start is not None and finding.end is not None and finding.kind != "incomplete_cycle":
        same = finding.end - finding.start < 0.005
        where = f" at {finding.start:.2f} s" if same else f" from {finding.start:.2f} to {finding.end:.2f} s"
    cost = f", {_share(finding.removed / samples)} of the samples" if finding.removed and samples else ""
    return _plain(f"{finding.kind}: {finding.message}{where}; {finding.action}{cost}")


def _share(share: float) -> str:
    return f"{share:.2%}" if share >= 0.0001 else "less than 0.01%"
