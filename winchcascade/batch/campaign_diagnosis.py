"""Diagnose a campaign and write its predictions: by the model of its rig or, without one, by
laws of its stages.
"""

from __future__ import annotations

from datetime import UTC
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_file import Campaign, CampaignRun, load_campaign
from winchcascade.core.campaign_settings import listed_settings
from winchcascade.core.errors import CampaignError, OptionError, RigError, WinchcascadeError
from winchcascade.core.files import write_content, write_whole
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.core.quantity import UNITS
from winchcascade.core.rig_toml import first_named
from winchcascade.diagnosis.campaign_entries import Entries, withheld_numbers
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.handover.rig_text import corrected_rig, corrected_rig_text
from winchcascade.diagnosis.own_simulation import beside_own_simulation
from winchcascade.diagnosis.simulation_at_stamps import on_the_logs
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis, diagnose_stages
from winchcascade.ingest.read import read_by, read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.baseline import NoModel, load_rig, model_of
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.simulate import simulate, write_log, write_simulated

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.fit.suspects import Suspects

    Prediction = tuple[str, str, Callable[..., None]]
    """Folder and log of a prediction, and what writes its file."""


HEADER = "Time (s),Cycle,Predicted {} (W)"
"""Header of the files of predictions, by which this tool recognises its own files."""


def read_logs(
    campaign: Campaign, rig: Rig, on_progress: Callable[[str], None], *, loads: bool
) -> list[Run]:
    """Read the log of each entry, once where several entries share it.

    Parameters
    ----------
    loads : every entry needs a load, as the model of the rig simulates it; without a model none
        counts
    """
    read: list[tuple[CampaignRun, Run]] = []
    runs = []
    for number, entry in enumerate(campaign.runs, 1):
        log = replace(
            entry, load=entry.load if loads else None, cycles=None, ranges=(), withheld=False,
            window=None, simulated=None,
        )  # fmt: skip
        run = next((run for other, run in read if other == log), None)
        if run is None:
            on_progress(f"reading {entry.file.name} ({number} of {len(campaign.runs)})")
            settings = listed_settings(campaign, log, rig)
            run = _as_listed(_checked(read_by(entry.file, settings)), entry)
            read.append((log, run))
        if loads and run.load is None:
            raise CampaignError(
                f"{campaign.path}: run {number} ({entry.file.name}) has no load; a diagnosis "
                f"simulates it, so give load_ohm."
            )
        runs.append(run)
    return runs


def _checked(run: Run) -> Run:
    """A log with the findings of the checks that need its cycles, too."""
    try:
        return replace(run, findings=reduce(run).quality)
    except WinchcascadeError:  # a log without cycles is rejected where it is diagnosed
        return run


def _as_listed(run: Run, entry: CampaignRun) -> Run:
    """A log with the time and the temperature that the campaign states; they count before those
    of the log.
    """
    if entry.started is not None:
        since = entry.started if entry.started.tzinfo else entry.started.replace(tzinfo=UTC)
        run = replace(run, started=since.timestamp())
    if entry.temperature is not None:
        run = replace(run, temperature=entry.temperature + UNITS["degC"].offset)
    return run


def with_simulations(campaign: Campaign, folder: Path) -> Campaign:
    """A campaign whose own simulations are the files of a folder with the names of its logs.

    Raises
    ------
    OptionError : the folder does not exist, or lacks the file of a log
    """
    if not folder.is_dir():
        raise OptionError(
            f"--simulated {folder}: no such folder; expected a folder with one simulation for "
            f"each log."
        )
    missing = [
        entry.file.name for entry in campaign.runs if not (folder / entry.file.name).is_file()
    ]
    if missing:
        raise OptionError(
            f"--simulated {folder}: no file {', '.join(dict.fromkeys(missing))}; expected one "
            f"simulation for each log of "
            f"{campaign.path}, with the name of the log. To use other names, give simulated = "
            f'"FILE" beside file there.'
        )
    runs = tuple(replace(entry, simulated=folder / entry.file.name) for entry in campaign.runs)
    return replace(campaign, runs=runs)


def read_simulations(
    campaign: Campaign, rig: Rig, logs: Sequence[Run], on_progress: Callable[[str], None]
) -> list[Run] | None:
    """Read the own simulation of each run, None where the campaign lists none.

    Raises
    ------
    CampaignError : some runs have a simulation and others have none, or a file does not exist
    LogError : a simulation cannot be read
    """
    if all(entry.simulated is None for entry in campaign.runs):
        return None
    runs = []
    for number, (entry, log) in enumerate(zip(campaign.runs, logs, strict=True), 1):
        place = f"{campaign.path}: run {number} ({entry.file.name})"
        if entry.simulated is None:
            raise CampaignError(
                f'{place} has no simulation, but others have one; expected simulated = "FILE" in '
                f"every run. "
                "Add it, or remove the others."
            )
        if not entry.simulated.is_file():
            raise CampaignError(
                f"{place}: no file {entry.simulated}; expected the simulation of this run, so "
                f"check its path."
            )
        on_progress(
            f"reading {entry.simulated.name} of your simulation ({number} of {len(campaign.runs)})"
        )
        table = entry.sheet if entry.simulated.suffix == entry.file.suffix else None
        runs.append(
            read_run(
                entry.simulated, rig=rig, load=log.load, table=table, simulated=True, campaign=False
            )
        )
    return runs


def diagnose_listed(
    campaign: Campaign,
    suspects: Suspects,
    *,
    rig: str | None = None,
    loads: Sequence[float] = (),
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis | StageDiagnosis:
    """Diagnose the logs that a campaign lists, by a model or, of a rig for which none can be made,
    by laws of its stages.

    Parameters
    ----------
    rig : a rig file or a name, in place of the campaign's own
    loads : of the runs to withhold; by default those that the campaign marks [ohm]

    Raises
    ------
    WinchcascadeError : something of the input cannot be used; the message names it
    """
    the_rig = first_named(rig, campaign.rig, read=load_rig)
    model = model_of(the_rig)
    runs = read_logs(campaign, the_rig, on_progress, loads=not isinstance(model, NoModel))
    the_rig = with_thresholds(the_rig, runs)
    cycles = [entry.cycles for entry in campaign.runs]
    marked = [entry.withheld for entry in campaign.runs]
    if isinstance(model, NoModel):
        _check_without_model(campaign, the_rig, runs, model, loads)
        withheld = [k for k, held in enumerate(marked) if held]
        entries = Entries(runs, cycles, withheld, campaign.name)
        return diagnose_stages(entries, the_rig, suspects, seed=seed, on_progress=on_progress)
    withheld = withheld_numbers(loads, runs, marked)
    simulations = read_simulations(campaign, the_rig, runs, on_progress)
    if simulations is not None:
        simulations = on_the_logs(simulations, runs, the_rig, cycles)
    windows = [entry.window for entry in campaign.runs]
    found = diagnose(
        runs, the_rig, suspects, title=campaign.name, cycles=cycles, windows=windows,
        withheld=withheld, seed=seed, on_progress=on_progress,
    )  # fmt: skip
    if simulations is None:
        return found
    return beside_own_simulation(found, simulations, windows=windows, on_progress=on_progress)


def _check_without_model(
    campaign: Campaign, rig: Rig, runs: Sequence[Run], model: NoModel, loads: Sequence[float]
) -> None:
    """Reject what only a diagnosis by a model can use, and a rig of which no stage is known."""
    if any(entry.simulated is not None for entry in campaign.runs):
        raise CampaignError(
            f"{campaign.path}: a simulation of your own is compared by the model of the rig, but "
            f"{model.why} Complete the rig "
            "file, or leave the simulation out."
        )
    stated = rig.sensors, rig.columns, *(run.channels for run in runs)
    if not rig.cascade.configured and not any("power_mech" in names for names in stated):
        raise RigError(model.why)
    if loads:
        raise OptionError(
            f"--withhold {loads[0]:g}: rig {rig.name} has no load; withhold cycles instead, by a "
            f"[[run]] with cycles and withheld = true in {campaign.path.name}."
        )


def diagnose_campaign(campaign_toml: Path, *, suspects: Suspects = EFFECTS) -> dict[str, object]:
    """Diagnose a campaign for a trial: the nested records of its JSON."""
    return as_json(diagnose_listed(load_campaign(campaign_toml), suspects))


def write_predictions(
    found: ModelDiagnosis | StageDiagnosis, folder: Path, *, force: bool = False
) -> list[Path]:
    """Write what is predicted of the data that the causes are judged on, in files named after their
    logs.

    With a model, the files are simulated logs of every withheld log: `before` by the rig as given,
    or the own simulation at the stamps of the log, `after` by a fit to the other logs. Neither
    contains the zeros of the sensors of that log. Without a model, the files are the power of the
    judged cycles: `before` is what goes in, `after` is predicted by a fit to the other cycles. They
    are means over blocks; what does not count is left out. Of several stages each has a file.

    Raises
    ------
    OutputError : a file cannot be written, or is not this tool's own and `force` does not allow to
        replace it
    """
    predictions = _powers(found) if isinstance(found, StageDiagnosis) else _simulated(found)
    written = []
    for side, log, write in predictions:
        (folder / side).mkdir(parents=True, exist_ok=True)
        written.append(folder / side / f"{Path(log).stem}.csv")
        write(written[-1], force=force)
    return written


def _simulated(found: ModelDiagnosis) -> Iterator[Prediction]:
    """Simulated logs of the withheld runs, without and with the causes."""
    data, own = found.data, found.own_simulation
    for k, fit in found.closure.predictions.items() if found.closure is not None else ():
        run, after = data.logs[k].run, data.models(fit.nu, fit.effects(found.suspects))[k]
        if own is None:
            yield "before", run.name, partial(write_log, simulate(run, data.nominal))
        else:
            yield "before", run.name, partial(write_simulated, own.runs[k])
        yield "after", run.name, partial(write_log, simulate(run, after))


def _powers(found: StageDiagnosis) -> Iterator[Prediction]:
    """Power of the judged cycles of each stage by log: middles of the blocks [s], cycles and
    power [W] in order of time.
    """
    if found.closure is None:
        return
    rows, data = found.closure.rows, found.data
    predicted = {"before": rows.given, "after": rows.given + rows.gap - found.closure.after}
    names = np.array([part.run.name for part in data.parts])[rows.part]
    for (side, power), (number, path) in product(predicted.items(), enumerate(data.paths)):
        table, stage = np.column_stack([rows.t, rows.own_cycle, power]), path.out.name
        header = HEADER.format("mechanical power" if stage == "mech" else f"power of {stage}")
        of_stage = rows.path == number
        for name in np.unique(names[of_stage]).tolist():
            here = np.flatnonzero(of_stage & (names == name))
            ordered = table[here[np.argsort(rows.t[here])]]
            log = name if len(data.paths) == 1 else f"{Path(name).stem}_{stage}.csv"
            yield side, log, partial(_write_power, header, ordered)


def _write_power(header: str, rows: Signal, path: Path, *, force: bool) -> None:
    formats = ["%.6f" if rows[-1, 0] < 1e6 else "%.3f", "%d", "%.9g"]
    write_whole(
        path,
        lambda part: np.savetxt(part, rows, fmt=formats, delimiter=",", header=header, comments=""),
        force=force,
    )


def write_corrected_rig(
    found: ModelDiagnosis | StageDiagnosis, path: Path, *, force: bool = False
) -> bool:
    """Write the rig file of a campaign with the named causes; False, and no file, where no named
    cause belongs in a rig file.

    Raises
    ------
    OptionError : the rig has no model that could be corrected
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
        to replace it
    RigError : the rig file cannot be read again, or states an effect in a way that cannot be
        replaced
    """
    if isinstance(found, StageDiagnosis):
        raise OptionError(
            f"--write {path}: no model can be made of rig {found.rig.name}, so none can be "
            f"corrected; leave --write out, or "
            "add the numbers that the rig file lacks."
        )
    if corrected_rig(found) == found.data.rig:
        return False
    write_content(path, corrected_rig_text(found), force=force)
    return True
