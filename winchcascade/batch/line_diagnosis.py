"""A campaign of a rig without a model: its logs, its diagnosis from line force, speed and power, and what that predicts."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnose.line.campaign import LineDiagnosis, diagnose_line
from winchcascade.errors import OptionError
from winchcascade.files import write_whole
from winchcascade.ingest.read import read_run

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from winchcascade.campaign import Campaign
    from winchcascade.diagnose.line.closure import Judged
    from winchcascade.rigfile import Rig
    from winchcascade.run import Run, Signal

HEADER = "Time (s),Cycle,Predicted mechanical power (W)"
"""Of the files of predictions, by which this tool knows them for its own."""


def read_logs(campaign: Campaign, rig: Rig, tell: Callable[[str], None]) -> list[Run]:
    """Read the log of each entry, once where several entries share it."""
    read: dict[tuple[Path, str | None], Run] = {}
    for number, entry in enumerate(campaign.runs, 1):
        if (entry.file, entry.sheet) not in read:
            tell(f"reading {entry.file.name} ({number} of {len(campaign.runs)})")
            run = read_run(entry.file, rig=rig, about=campaign.title, origin=entry.origin, table=entry.sheet)
            read[entry.file, entry.sheet] = run
    return [read[entry.file, entry.sheet] for entry in campaign.runs]


def diagnose_logs(
    campaign: Campaign,
    runs: Sequence[Run],
    rig: Rig,
    suspects: Mapping[str, type],
    loads: Sequence[float],
    seed: int,
    tell: Callable[[str], None],
) -> LineDiagnosis:
    """Diagnose the logs of a campaign, as `read_logs` gives them.

    Raises
    ------
    OptionError : `loads` are to be withheld, which no such rig has
    CampaignError, LogError : something else cannot be used; the message says what
    """
    if loads:
        raise OptionError(
            f"--withhold {loads[0]:g}: rig {rig.name} has no load; withhold cycles instead, by a [[run]] with cycles and "
            f"withheld = true in {campaign.path.name}."
        )
    return diagnose_line(
        runs,
        rig,
        suspects,
        title=campaign.name,
        cycles=[entry.cycles for entry in campaign.runs],
        withheld=[k for k, entry in enumerate(campaign.runs) if entry.withheld],
        seed=seed,
        tell=tell,
    )


def write_line_predictions(found: LineDiagnosis, folder: Path, *, force: bool = False) -> list[Path]:
    """Write the power that is predicted of the judged cycles, one file for each log: `before`, line force times speed, and
    `after`, by a fit that did not know them. Stamps are those of the log; samples that do not count are left out.

    Raises
    ------
    OutputError : a file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    if found.judged is None:
        return []
    written = []
    for side in ("before", "after"):
        (folder / side).mkdir(parents=True, exist_ok=True)
        for name, rows in _predicted(found.judged, side).items():
            path = folder / side / f"{name.rpartition('.')[0] or name}.csv"
            write_whole(path, partial(_fill, rows), force=force)
            written.append(path)
    return written


def _predicted(judged: Judged, side: str) -> dict[str, Signal]:
    """Stamps [s], cycles and predicted power [W] of each log, (k, 3) by its name, in order of time."""
    found: dict[str, list[Signal]] = {}
    for part, after in zip(judged.parts, judged.after, strict=True):
        given = part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]
        predicted = given if side == "before" else given + part.gap - after
        rows = np.column_stack([part.run.t[part.here], part.cycle.astype(np.float64), predicted])
        found.setdefault(part.run.name, []).append(rows)
    return {name: np.vstack(rows)[np.argsort(np.vstack(rows)[:, 0], kind="stable")] for name, rows in found.items()}


def _fill(rows: Signal, path: Path) -> None:
    stamps = "%.6f" if rows[-1, 0] < 1e6 else "%.3f"
    np.savetxt(path, rows, fmt=[stamps, "%d", "%.9g"], delimiter=",", header=HEADER, comments="")
