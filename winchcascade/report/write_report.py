"""The report of any result in one call: the ending of the name decides between a page and a PDF."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from winchcascade.core.errors import OptionError

if TYPE_CHECKING:
    from winchcascade.comparison.comparison_result import Comparison
    from winchcascade.diagnosis.calibrate import Calibration
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
    from winchcascade.reduction.reduction_result import Reduction
    from winchcascade.report.campaign_reduction import CampaignReduction
    from winchcascade.report.report_model import Report
    from winchcascade.rig.simulate import Simulation
    from winchcascade.tables.audit import Audit
    from winchcascade.tables.check import Check
    from winchcascade.tables.point_audit import PointAudit

    Result = (
        Reduction
        | DiagnosisResult
        | CampaignReduction
        | Comparison
        | Calibration
        | Check
        | Audit
        | PointAudit
        | Simulation
    )


def write_report(result: Result, path: str | Path, *, force: bool = False) -> Path:
    """Write the report of a result of any command as a page (.html) or a PDF (.pdf).

    Parameters
    ----------
    force : replace a file that this tool did not write

    Raises
    ------
    OptionError : another ending, or a result that has no report
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    from winchcascade.report.publish import publish

    path = Path(path)
    ending = path.suffix.casefold()
    if ending not in (".html", ".pdf"):
        raise OptionError(f"{path}: no ending of a report; expected a name that ends in .html or .pdf.")
    report = report_of(result)
    publish(report, html=path if ending == ".html" else None, pdf=path if ending == ".pdf" else None, force=force)
    return path


_MAKERS = {
    "Audit": "audit_report:audit_report",
    "Calibration": "calibration_sheet:calibration_report",
    "CampaignReduction": "write_report:_of_campaign",
    "Check": "check_report:check_report",
    "Comparison": "comparison_report:make_comparison_report",
    "DiagnosisResult": "diagnosis:make_diagnosis_report",
    "PointAudit": "audit_report:point_audit_report",
    "Reduction": "write_report:_of_reduction",
    "Score": "trial_report:make_trial_report",
    "Simulation": "simulation_report:simulation_report",
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
            f"write_report: a {type(result).__name__} has no report; expected the result of reduce, compare, calibrate, "
            "simulate, audit, or of open_campaign(...).reduce(), .diagnose() or .check()."
        )
    report: Report = resolve_name(f"winchcascade.report.{maker}")(result, command=command)
    return report


def _of_reduction(result: Reduction, *, command: str) -> Report:
    from winchcascade.reduction.montecarlo import uncertainty
    from winchcascade.report.document import make_report

    return make_report(result, uncertainty(result), command=command)


def _of_campaign(result: CampaignReduction, *, command: str) -> Report:
    from winchcascade.report.campaign import campaign_report
    from winchcascade.report.campaign_waves import campaign_waves

    waves = campaign_waves(result.records.items())
    return campaign_report(result.summary, result.bins, linked=False, command=command, waves=waves)
