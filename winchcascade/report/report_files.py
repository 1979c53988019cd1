"""Where the files of a report are written, and which function makes the report of a result."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.errors import OptionError

if TYPE_CHECKING:
    from winchcascade.diagnosis.calibrate import Calibration
    from winchcascade.reduction.campaign_reduction import CampaignReduction
    from winchcascade.reduction.reduction_result import Reduction
    from winchcascade.report.content import Report as Stated
    from winchcascade.report.sheet import Report


class ReportFiles(msgspec.Struct, frozen=True):
    """Files of a report: the page, the PDF, and folders for its figures and its tables; None for what is not wanted."""

    html: Path | None = None
    pdf: Path | None = None
    figures: Path | None = None
    tables: Path | None = None

    @property
    def by_option(self) -> dict[str, Path | None]:
        """The files by the options of the command line that name them."""
        return {f"--{name}": path for name, path in msgspec.structs.asdict(self).items()}

    @property
    def wanted(self) -> bool:
        """Whether anything is to be written."""
        return any(path is not None for path in self.by_option.values())


_MAKERS = {
    "Audit": "results.audits:audit_report",
    "Calibration": "report_files:_of_calibration",
    "CampaignReduction": "report_files:_of_campaign",
    "Check": "results.checks:check_report",
    "Comparison": "results.comparison:comparison_report",
    "DiagnosisResult": "results.diagnosis:diagnosis_report",
    "PointAudit": "results.audits:audit_report",
    "Reduction": "report_files:_of_reduction",
    "Simulation": "results.simulation:simulation_report",
}
"""What makes the report of a result, by the name of its class: a result that is made has imported its own modules alone."""


def report_of(result: object, *, command: str = "") -> Report:
    """Make the report of a result.

    Parameters
    ----------
    command : as it was given, to be given again
    """
    maker = next((_MAKERS[kind.__name__] for kind in type(result).__mro__ if kind.__name__ in _MAKERS), None)
    if maker is None:
        raise OptionError(
            f"write_report: {type(result).__name__} has no report; expected the result of reduce, compare, calibrate, "
            "simulate, audit, or of open_campaign(...).reduce(), .diagnose() or .check()."
        )
    report: Report = resolve_name(f"winchcascade.report.{maker}")(result, command=command)
    return report


def _of_calibration(result: Calibration, *, command: str) -> Stated:
    from winchcascade.diagnosis.damper_curves import damper_curves
    from winchcascade.report.figures.style import house_style
    from winchcascade.report.results.calibration import calibration_report, fit_blocks

    with house_style():
        return calibration_report(result, fit_blocks(result, damper_curves(result)), command=command)


def _of_reduction(result: Reduction, *, command: str) -> Stated:
    from winchcascade.reduction.montecarlo import uncertainty
    from winchcascade.report.results.drawn_reduction import drawn_report

    return drawn_report(result, uncertainty(result), command=command)


def _of_campaign(result: CampaignReduction, *, command: str) -> Report:
    from winchcascade.reduction.wave_record import campaign_waves
    from winchcascade.report.campaign import campaign_report

    waves = campaign_waves(result.records.items())
    return campaign_report(result.summary, result.bins, linked=False, command=command, waves=waves)
