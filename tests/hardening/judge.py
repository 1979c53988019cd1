"""What a corruption did to the numbers of a log, and whether a finding reports it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from base_logs import TIME, Log, Signal, base
from reasons import Reason, Reasoning

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.run import Finding
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import Metrics, ensemble_mean
from winchcascade.reduction.reduce import reduce, require_payouts
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.rig.open_rig import load_rig

ENERGIES = ("energy_line", "energy_mech", "energy_gen")
EFFICIENCIES = ("eta_trans", "eta_gen", "eta_pto")
ENERGY_BAR, EFFICIENCY_BAR = 0.005, 0.005
"""Largest change that needs no report: a share of an energy, and an efficiency."""

NEAR = 10.0
"""Cycles whose onsets lie this near each other are the same one; onsets are at least 35 s apart. [s]"""

AROUND = 2.0
"""A finding this near to the damage points to its time. [s]"""

NO_POINTER = {"unknown_column", "incomplete_cycle"}
"""Kinds of findings that point to no damage of a channel; an incomplete cycle is judged by its own cycle."""


@dataclass(frozen=True)
class Outcome:
    """What became of a corruption: what it moved beyond the bar, and who reports it ("" if nobody does).

    `reason` is why one log cannot show it, None if that is unknown or not needed.
    """

    beyond: tuple[str, ...]
    reported: str
    reason: Reason | None = None

    @property
    def silent(self) -> bool:
        """Whether a number moved beyond the bar and nothing reports it."""
        return bool(self.beyond) and not self.reported


@dataclass(frozen=True)
class Damage:
    """One corruption: what was done, to which channels, and how it is read.

    `write` makes the file in a folder and gives its path. `spans` are times of the damage on the clock of the file [s];
    `true_stamps` gives, for the stamps of the file, the instants they belong to [s]. `unseen` gives
    the reason why one log cannot show it. `judge` replaces the usual comparison with the undamaged log.
    """

    log: Log
    what: str
    touched: frozenset[str]
    write: Callable[[Path], Path] | None = None
    spans: Sequence[tuple[float, float]] = ()
    true_stamps: tuple[Signal, Signal] | None = None
    unseen: Reasoning | None = None
    load: float | None = None
    stated_in_file: bool = False
    window: float | str | None = None
    rig: str = ""
    truth: Reduction | None = None
    always: str = ""
    judge: Callable[[Path], Outcome] | None = None
    notes: dict[str, str] = field(default_factory=dict)


def csv(log: Log, preamble: str = "") -> Callable[[Path], Path]:
    """Write a log as CSV into a folder."""

    def write(folder: Path) -> Path:
        path = folder / f"{log.name}.csv"
        path.write_text(log.text(preamble=preamble), encoding="utf-8")
        return path

    return write


_SCRATCH: list[Path] = []


def scratch(folder: Path) -> None:
    """Set the folder in which undamaged logs are written."""
    _SCRATCH[:] = [folder]


def undamaged(log: Log, window: float | str) -> Reduction:
    """Write a log in a folder of its own and reduce it."""
    folder = _SCRATCH[0] / "undamaged"
    folder.mkdir(exist_ok=True)
    return reduce(read_run(csv(log)(folder), load=log.load, rig=load_rig("hsu2026")), window=window)


@cache
def _truth(name: str, rate: float, window: float | str, names: tuple[str, ...]) -> Reduction:
    log = base(name, int(rate))
    return undamaged(log.without(*(log.columns.keys() - names)), window)


def truth(log: Log, window: float | str | None = None) -> Reduction:
    """Reduce the undamaged log with the columns that this one has."""
    return _truth(log.name, log.rate, log.window if window is None else window, tuple(log.columns))


def judged(damage: Damage, folder: Path) -> Outcome:
    """Read the damaged file on the real path and compare it with the undamaged log."""
    if damage.judge is not None:
        return damage.judge(folder)
    true = damage.truth or truth(damage.log, damage.window if damage.truth is None else None)
    assert damage.write is not None
    path = damage.write(folder)
    try:
        found = _reduced(damage, path, folder)
    except WinchcascadeError as fault:
        return Outcome((damage.always or "rejected",), f"rejected: {fault}")
    return compared(damage, true, found)


def _reduced(damage: Damage, path: Path, folder: Path) -> Reduction:
    rig = load_rig("hsu2026")
    if damage.rig:
        place = folder / "rig.toml"
        place.write_text(damage.rig, encoding="utf-8")
        rig = load_rig(place)
    load = damage.log.load if damage.load is None else damage.load
    run = read_run(path, rig=rig, load=None if damage.stated_in_file else load)
    found = reduce(run, window=damage.log.window if damage.window is None else damage.window)
    require_payouts(found)
    return found


def compared(damage: Damage, true: Reduction, found: Reduction) -> Outcome:
    """Compare two reductions cycle by cycle, and look for the findings that concern the damage."""
    beyond, lost = moved(true, found, damage.true_stamps)
    if damage.always:
        beyond = (damage.always, *beyond)
    findings = [f for f in new_findings(true, found) if concerns(f, damage)]
    if findings:
        return Outcome(beyond, "; ".join(f"{f.kind} {f.channel or ''}: {f.message}" for f in findings[:3]))
    if lost and set(beyond) - {damage.always} <= lost:
        return Outcome(beyond, next(iter(lost)))
    reason = damage.unseen(found) if beyond and damage.unseen is not None else None
    return Outcome(beyond, "", reason)


def new_findings(true: Reduction, found: Reduction) -> list[Finding]:
    """Findings that the undamaged log does not have."""
    known = {(f.kind, f.channel) for f in true.quality}
    return [f for f in found.quality if (f.kind, f.channel) not in known]


def concerns(finding: Finding, damage: Damage) -> bool:
    """Whether a finding points the operator to the channel, the time or the load that is damaged."""
    if finding.kind in NO_POINTER:
        return False
    touched = damage.touched
    if finding.kind == "coarse_sampling" and "rate" not in touched:
        return False  # an edge that damage makes is no coarse sampling; the finding would lead astray
    words = f"{finding.channel or ''} {finding.message}".casefold()
    if finding.channel is None or any(name in words for name in touched):
        return True
    if TIME in touched and finding.channel in ("velocity", "displacement"):
        return True
    if finding.start is None or finding.end is None:
        return False
    return any(finding.start - AROUND <= end and start <= finding.end + AROUND for start, end in damage.spans)


def moved(
    true: Reduction, found: Reduction, stamps: tuple[Signal, Signal] | None = None
) -> tuple[tuple[str, ...], set[str]]:
    """List what moved beyond the bar, and which of it is cycles that are reported as incomplete.

    The clock of a damaged file may be repaired or not: cycles are matched on both readings, and the better one counts.
    """
    one = _moved(true, found, None)
    return one if stamps is None else min(one, _moved(true, found, stamps), key=lambda result: len(result[0]))


def _moved(true: Reduction, found: Reduction, stamps: tuple[Signal, Signal] | None) -> tuple[tuple[str, ...], set[str]]:
    beyond: list[str] = []
    lost: set[str] = set()
    pairs: list[tuple[CycleResult, CycleResult]] = []
    left = list(found.cycles)
    for cycle in true.complete:
        near = [c for c in left if abs(_instant(c, stamps) - cycle.window.onset) < NEAR]
        if not near:
            beyond.append(f"cycle {cycle.cycle} lost")
            continue
        other = min(near, key=lambda c: abs(_instant(c, stamps) - cycle.window.onset))
        left.remove(other)
        if not other.complete:
            beyond.append(f"cycle {cycle.cycle} incomplete")
            lost.add(beyond[-1])
            continue
        pairs.append((cycle, other))
        beyond += [f"cycle {cycle.cycle} {text}" for text in _changes(cycle.metrics, other.metrics)]
    beyond += [f"extra cycle at {_instant(c, stamps):.1f} s" for c in left if c.complete]
    kept = ensemble_mean([cycle.metrics for cycle, _ in pairs])
    beyond += [f"mean {text}" for text in _changes(kept, found.mean)]
    return tuple(beyond), lost


def _instant(cycle: CycleResult, stamps: tuple[Signal, Signal] | None) -> float:
    onset = cycle.window.onset
    return onset if stamps is None else float(np.interp(onset, *stamps))


def _changes(true: Metrics, found: Metrics) -> list[str]:
    changes = []
    for name in (*ENERGIES, *EFFICIENCIES):
        old, new = getattr(true, name), getattr(found, name)
        if old is None:
            continue
        if new is None:
            changes.append(f"{name} missing")
        elif name in ENERGIES and abs(new - old) > ENERGY_BAR * abs(old):
            changes.append(f"{name} {100 * (new / old - 1):+.2f} %")
        elif name in EFFICIENCIES and abs(new - old) > EFFICIENCY_BAR:
            changes.append(f"{name} {new - old:+.4f}")
    return changes
