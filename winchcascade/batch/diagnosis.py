"""A campaign to its diagnosis and its outputs: by the model of its rig or, without one, from line force, speed and power."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from winchcascade.batch.line_diagnosis import diagnose_logs, read_logs, write_line_predictions
from winchcascade.batch.model_diagnosis import diagnose_listed, write_predictions
from winchcascade.diagnose.line.campaign import LineDiagnosis
from winchcascade.diagnose.line.record import as_json as line_json
from winchcascade.diagnose.record import as_json
from winchcascade.errors import RigError
from winchcascade.rig.model import baseline
from winchcascade.rigtoml import DEFAULT_RIG, load_rig

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from winchcascade.campaign import Campaign

POWER = "power_mech"
"""Channel without which a winch that has no model cannot be diagnosed."""


class Writes(Protocol):
    """Writes the report of a diagnosis as a page, as a PDF, or both."""

    def __call__(self, *, html: Path | None, pdf: Path | None, command: str, force: bool) -> None:
        """Write the files."""


class Outcome(NamedTuple):
    """A diagnosis and its outputs: JSON as a dict, the page for the terminal given the files, reports, and predictions."""

    record: dict[str, Any]
    text: Callable[[Sequence[Path | str]], str]
    write_reports: Writes
    write_predictions: Callable[[Path, bool], list[Path]]


def outcome(
    campaign: Campaign,
    suspects: Mapping[str, type],
    *,
    rig: str | None = None,
    loads: Sequence[float] = (),
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Diagnose the logs that a campaign lists, whatever their rig. Parameters and faults as `diagnose_listed`, but for `rig`,
    which is a rig file or a name, before the campaign's own.
    """
    the_rig = load_rig(rig or campaign.rig or DEFAULT_RIG)
    try:
        baseline(the_rig)
    except RigError:
        runs = read_logs(campaign, the_rig, tell)
        if not any(POWER in names for names in (the_rig.sensors, the_rig.columns, *(run.channels for run in runs))):
            raise
        return _of_line(diagnose_logs(campaign, runs, the_rig, suspects, loads, seed, tell))
    from winchcascade.report.diagnosis_text import diagnosis_text

    found = diagnose_listed(campaign, the_rig, suspects, loads=loads, seed=seed, tell=tell)

    def write_reports(*, html: Path | None, pdf: Path | None, command: str, force: bool) -> None:
        from winchcascade.report.diagnosis import write_diagnosis_reports

        write_diagnosis_reports(found, html=html, pdf=pdf, command=command, force=force)

    def predict(folder: Path, force: bool) -> list[Path]:
        return write_predictions(found, folder, force=force)

    return Outcome(as_json(found), partial(diagnosis_text, found), write_reports, predict)


def _of_line(found: LineDiagnosis) -> Outcome:
    from winchcascade.report.line_text import line_text

    def write_reports(*, html: Path | None, pdf: Path | None, command: str, force: bool) -> None:
        from winchcascade.report.line_diagnosis import write_line_reports

        write_line_reports(found, html=html, pdf=pdf, command=command, force=force)

    def predict(folder: Path, force: bool) -> list[Path]:
        return write_line_predictions(found, folder, force=force)

    return Outcome(line_json(found), partial(line_text, found), write_reports, predict)
