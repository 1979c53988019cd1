"""Sections that the report of a diagnosis has with and without a model of the rig."""

from __future__ import annotations

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_tables as tables
from winchcascade.report.report_model import Block, Section, section


def where_section(found: ModelDiagnosis | LineDiagnosis, *blocks: Block | None) -> Section:
    """Where the gap lies."""
    return section(
        "where", "Where a gap was looked for" if found.verdict == "no_gap" else "Where the gap lies", *blocks
    )


def which_section(found: ModelDiagnosis | LineDiagnosis, *blocks: Block | None) -> Section:
    """Causes, what was compared to find them, and alternative explanations."""
    heading = "Which causes, and how sure" if found.causes else "What was tried"
    return section("which", heading, tables.causes_table(found), *blocks, tables.rivals_table(found))
