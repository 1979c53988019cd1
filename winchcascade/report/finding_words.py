"""Findings of the logs and of the own simulations that a diagnosis used, in sentences and as a record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from winchcascade.core.run import Finding, Run
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult


def simulations_of(found: DiagnosisResult) -> tuple[Run, ...]:
    """The own simulations that logs were compared with; none without them."""
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    return () if own is None else own.runs


def finding_records(run: Run) -> list[dict[str, Any]]:
    """Findings of one file for JSON."""
    return [{"kind": f.kind, "channel": f.channel, "message": f.message} for f in run.findings]


def finding_words(found: DiagnosisResult) -> list[str]:
    """A sentence on each kind of finding of each channel, with its first file; columns that were not read are left out.

    >>> from types import SimpleNamespace as Of
    >>> log = Of(name="a.csv", findings=[Finding("stuck", "idc holds one value", "", "idc")])
    >>> finding_words(Of(runs=[log, Of(name="b.csv", findings=[])]))
    ['1 of 2 logs, stuck: idc holds one value (a.csv).']
    """
    runs = list({run.name: run for run in found.runs}.values())
    return [*_sentences(runs, "log"), *_sentences(simulations_of(found), "simulation")]


def _sentences(runs: Sequence[Run], called: str) -> list[str]:
    alike: dict[tuple[str, str | None], dict[str, Finding]] = {}
    for run in runs:
        for finding in run.findings:
            if finding.kind != "unknown_column":
                alike.setdefault((finding.kind, finding.channel), {}).setdefault(run.name, finding)
    return [
        f"{len(files)} of {len(runs)} {called}{'s' * (len(runs) > 1)}, {kind}: {finding.message} ({file})"
        f"{f'; {finding.action}' if finding.action else ''}."
        for (kind, _), files in alike.items()
        for file, finding in list(files.items())[:1]
    ]
