"""A campaign of a rig without a model: its logs, its diagnosis from line force, speed and power, and what that predicts."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import CampaignError, OptionError, RigError
from winchcascade.core.files import write_whole
from winchcascade.core.rig_toml import DEFAULT_RIG, load_rig
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose, withheld_numbers
from winchcascade.diagnosis.line.line_data import POWER
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis, diagnose_line
from winchcascade.ingest.read import read_run
from winchcascade.report.diagnosis_record import as_json
from winchcascade.rig.parts import NoModel, model_of
from winchcascade.rig.simulate import simulate
from winchcascade.rig.simulated_log import write_log

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from winchcascade.core.campaign_file import Campaign
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.line.line_closure import LineClosure
    from winchcascade.diagnosis.suspects import Suspects


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


def _predicted(judged: LineClosure, side: str) -> dict[str, Signal]:
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


def diagnose_file(
    path: Path,
    suspects: Suspects,
    *,
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis:
    """Diagnose a campaign.toml, or the one in a folder, on its own rig; faults as `diagnose_listed`."""
    campaign = load_campaign(path)
    return diagnose_listed(campaign, load_rig(campaign.rig or DEFAULT_RIG), suspects, seed=seed, tell=tell)


def diagnose_listed(
    campaign: Campaign,
    rig: Rig,
    suspects: Suspects,
    *,
    loads: Sequence[float] = (),
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis:
    """Diagnose the logs that a campaign lists.

    Parameters
    ----------
    rig : for which a model can be made
    loads : of the runs to withhold; by default those that the campaign marks [ohm]

    Raises
    ------
    WinchcascadeError : something of the input cannot be used; the message says what
    """
    runs = []
    for number, entry in enumerate(campaign.runs, 1):
        tell(f"reading {entry.file.name} ({number} of {len(campaign.runs)})")
        run = read_run(entry.file, rig=rig, load=entry.load, origin=entry.origin, table=entry.sheet)
        if run.load is None:
            raise CampaignError(
                f"{campaign.path}: run {number} ({entry.file.name}) has no load; a diagnosis simulates it, so give load_ohm."
            )
        runs.append(run)
    return diagnose(
        runs,
        rig,
        suspects,
        title=campaign.name,
        cycles=[entry.cycles for entry in campaign.runs],
        withheld=withheld_numbers(loads, runs, [entry.withheld for entry in campaign.runs]),
        seed=seed,
        tell=tell,
    )


def diagnose_campaign(
    campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None
) -> dict[str, Any]:
    """Diagnose a campaign for a trial: JSON as a dict, predictions into a folder if one is given."""
    found = diagnose_file(campaign_toml, suspects, seed=seed)
    if predictions is not None:
        write_predictions(found, predictions)
    return as_json(found)


def write_predictions(found: ModelDiagnosis | LineDiagnosis, folder: Path, *, force: bool = False) -> list[Path]:
    """Write what is predicted of the data that the causes are judged on, in files named after their logs.

    With a model these are simulated logs of every withheld log: `before`, the rig as given, and `after`, by the fit without
    that log; zeros of its sensors are in neither. Without one they are the power of the judged cycles: `before`, line force
    times speed, and `after`, by a fit that did not know them; stamps are those of the log, samples that do not count are left
    out.

    Raises
    ------
    OutputError : a file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    line = isinstance(found, LineDiagnosis)
    if line and found.closure is None:
        return []
    written = []
    for side in ("before", "after"):
        (folder / side).mkdir(parents=True, exist_ok=True)
    if isinstance(found, LineDiagnosis):
        for side in ("before", "after"):
            for name, rows in {} if found.closure is None else _predicted(found.closure, side).items():
                written.append(folder / side / f"{_stem(name)}.csv")
                write_whole(written[-1], partial(_fill, rows), force=force)
        return written
    data = found.data
    for one in found.closure.predictions if found.closure is not None else ():
        run = data.logs[one.log].run
        nu = np.where([n.kind == "zero" for n in data.nuisances], 0.0, one.fit.nu)
        after = data.models(nu, one.fit.effects(found.suspects))[one.log]
        for side, model in (("before", data.nominal), ("after", after)):
            written.append(folder / side / f"{_stem(run.name)}.csv")
            write_log(simulate(run, model), written[-1], force=force)
    return written


def _stem(name: str) -> str:
    return name.rpartition(".")[0] or name


def diagnose_by_rig(
    campaign: Campaign,
    suspects: Suspects,
    *,
    rig: str | None = None,
    loads: Sequence[float] = (),
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis | LineDiagnosis:
    """Diagnose the logs that a campaign lists, by a model or, of a rig for which none can be made, from line and shaft alone.

    Parameters and faults as `diagnose_listed`, but for `rig`, which is a rig file or a name, before the campaign's own.
    """
    the_rig = load_rig(rig or campaign.rig or DEFAULT_RIG)
    model = model_of(the_rig)
    if isinstance(model, NoModel):
        runs = read_logs(campaign, the_rig, tell)
        if any(POWER in names for names in (the_rig.sensors, the_rig.columns, *(run.channels for run in runs))):
            if loads:
                raise OptionError(
                    f"--withhold {loads[0]:g}: rig {the_rig.name} has no load; withhold cycles instead, by a [[run]] with "
                    f"cycles and withheld = true in {campaign.path.name}."
                )
            return diagnose_line(
                runs,
                the_rig,
                suspects,
                title=campaign.name,
                cycles=[entry.cycles for entry in campaign.runs],
                withheld=[k for k, entry in enumerate(campaign.runs) if entry.withheld],
                seed=seed,
                tell=tell,
            )
        raise RigError(model.why)
    return diagnose_listed(campaign, the_rig, suspects, loads=loads, seed=seed, tell=tell)
