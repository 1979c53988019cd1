"""Summary of a result for a notebook: its heading and its main table, by the templates of the reports."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.campaign_reduction import CampaignReduction
from winchcascade.report.publish import table_html

if TYPE_CHECKING:
    from winchcascade.report.table_model import Table


def summary_html(result: Reduction | DiagnosisResult | CampaignReduction | Comparison) -> str:
    """The heading and the main table of a result as HTML without scripts; every text is escaped."""
    return table_html(_heading(result), _table(result))


@singledispatch
def _heading(result: object) -> str:
    """What the result is of, in one line."""
    return repr(result)


@_heading.register(Comparison)
def _(result: Comparison) -> str:
    return f"{result.b.name} minus {result.a.name}: {len(result.runs)} runs"


@_heading.register(DiagnosisResult)
def _(result: DiagnosisResult) -> str:
    return f"Diagnosis of {result.title}: {result.verdict.replace('_', ' ')}"


@singledispatch
def _table(result: object) -> Table | None:
    """The main table of a result; None where it has none."""
    raise TypeError(f"no table of a {type(result).__name__}")


@_table.register(Reduction)
def _(result: Reduction) -> Table:
    from winchcascade.reduction.montecarlo import uncertainty
    from winchcascade.report.tables import cycles_table

    return cycles_table(result, uncertainty(result))


@_table.register(CampaignReduction)
def _(result: CampaignReduction) -> Table | None:
    from winchcascade.report.campaign import logs_efficiencies_table
    from winchcascade.report.campaign_record import runs_by_load

    runs = runs_by_load(result.summary.reduced)
    return logs_efficiencies_table(runs) if runs else None


@_table.register(Comparison)
def _(result: Comparison) -> Table | None:
    from winchcascade.report.comparison_report import differences_table
    from winchcascade.report.comparison_words import headline_metrics

    return differences_table("efficiencies", result, headline_metrics(result))


@_table.register(DiagnosisResult)
def _(result: DiagnosisResult) -> Table | None:
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.report.diagnosis_tables import causes_table

    assert isinstance(result, ModelDiagnosis | LineDiagnosis)  # there are no others
    return causes_table(result)
