"""The report of any result in one call: the ending of the name decides between a page and a PDF."""

from __future__ import annotations

from pathlib import Path

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.arguments import FLAG, PATH, check_arguments
from winchcascade.core.errors import OptionError
from winchcascade.diagnosis.calibrate import Calibration
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.reduction.campaign_reduction import CampaignReduction
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.rig.simulate import Simulation
from winchcascade.tables.audit import Audit
from winchcascade.tables.check import Check
from winchcascade.tables.point_audit import PointAudit

Result = (
    Reduction | DiagnosisResult | CampaignReduction | Comparison | Calibration | Check | Audit | PointAudit | Simulation
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
    from winchcascade.report.report_files import report_of

    check_arguments("write_report", ("path", path, PATH), ("force", force, FLAG))
    path = Path(path)
    ending = path.suffix.casefold()
    if ending not in (".html", ".pdf"):
        raise OptionError(f"{path}: no ending of a report; expected a name that ends in .html or .pdf.")
    report = report_of(result)
    publish(report, html=path if ending == ".html" else None, pdf=path if ending == ".pdf" else None, force=force)
    return path
