"""The report of any result in one call: the ending of the name decides between a page and a PDF."""

from __future__ import annotations

from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.errors import OptionError
from winchcascade.diagnosis.calibrate import Calibration
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.campaign_reduction import CampaignReduction
from winchcascade.rig.simulate import Simulation
from winchcascade.tables.audit import Audit
from winchcascade.tables.check import Check
from winchcascade.tables.point_audit import PointAudit

if TYPE_CHECKING:
    from winchcascade.report.report_model import Report

Result = (
    Reduction | DiagnosisResult | CampaignReduction | Comparison | Calibration | Check | Audit | PointAudit | Simulation
)
"""What has a report."""


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
    report = _report_of(result)
    publish(report, html=path if ending == ".html" else None, pdf=path if ending == ".pdf" else None, force=force)
    return path


@singledispatch
def _report_of(result: object) -> Report:
    """The report of a result."""
    raise OptionError(
        f"write_report: a {type(result).__name__} has no report; expected the result of reduce, compare, calibrate, simulate, "
        "audit, or of open_campaign(...).reduce(), .diagnose() or .check()."
    )


@_report_of.register(Reduction)
def _(result: Reduction) -> Report:
    from winchcascade.reduction.montecarlo import uncertainty
    from winchcascade.report.document import make_report

    return make_report(result, uncertainty(result))


@_report_of.register(CampaignReduction)
def _(result: CampaignReduction) -> Report:
    from winchcascade.report.campaign import campaign_report
    from winchcascade.report.campaign_waves import campaign_waves

    return campaign_report(result.summary, result.bins, linked=False, waves=campaign_waves(result.records.items()))


@_report_of.register(Comparison)
def _(result: Comparison) -> Report:
    from winchcascade.report.comparison_report import make_comparison_report

    return make_comparison_report(result)


@_report_of.register(DiagnosisResult)
def _(result: DiagnosisResult) -> Report:
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.report.diagnosis import make_diagnosis_report

    assert isinstance(result, ModelDiagnosis | LineDiagnosis)  # there are no others
    return make_diagnosis_report(result)


@_report_of.register(Calibration)
def _(result: Calibration) -> Report:
    from winchcascade.report.calibration_sheet import calibration_report

    return calibration_report(result)


@_report_of.register(Check)
def _(result: Check) -> Report:
    from winchcascade.report.check_report import check_report

    return check_report(result)


@_report_of.register(Audit)
def _(result: Audit) -> Report:
    from winchcascade.report.audit_report import audit_report

    return audit_report(result)


@_report_of.register(PointAudit)
def _(result: PointAudit) -> Report:
    from winchcascade.report.audit_report import point_audit_report

    return point_audit_report(result)


@_report_of.register(Simulation)
def _(result: Simulation) -> Report:
    from winchcascade.report.simulation_report import simulation_report

    return simulation_report(result)
