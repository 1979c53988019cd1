"""What each cause costs in efficiency, load by load: the contributions of the runs as means over the runs of a load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import msgspec

from winchcascade.diagnosis.contributions import leading_metric, loaded_part
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Contribution, ContributionPart, DiagnosisResult, NamedCause

T = TypeVar("T", Contribution, ContributionPart)

PERCENT = 100.0


def load_costs(found: ModelDiagnosis, metric: str | None) -> list[Contribution]:
    """The split of an efficiency at every load, from the largest resistance to the smallest: means of its runs [%, points].

    The errors of runs of one load are mostly the same, so the bounds of a part are means too.
    """
    runs = loaded_part(found.contributions, metric)
    loads = sorted({run.load for run in runs if run.load is not None}, reverse=True)
    return [_mean_costs([run for run in runs if run.load == load]) for load in loads]


def _mean_costs(runs: Sequence[Contribution]) -> Contribution:
    parts = tuple(_mean(alike, "value", "low", "high") for alike in zip(*(run.parts for run in runs), strict=True))
    return msgspec.structs.replace(_mean(runs, "as_given", "measured"), parts=parts)


def _mean(alike: Sequence[T], *fields: str) -> T:
    """The first of some contributions or parts with the means of some fields, in percent."""
    means = {name: PERCENT * sum(getattr(one, name) for one in alike) / len(alike) for name in fields}
    return msgspec.structs.replace(alike[0], **means)


def worst_costs(found: DiagnosisResult) -> Contribution | None:
    """The split of the leading efficiency at the load at which model and run differ most [%, points]; None without one."""
    if not isinstance(found, ModelDiagnosis):
        return None
    table = load_costs(found, leading_metric(found.contributions))
    return max(table, key=lambda one: abs(one.measured - one.as_given), default=None)


def cost_of(costs: Contribution | None, cause: NamedCause) -> float | None:
    """What a cause changes of an efficiency [points]; None where nothing can be said."""
    parts = () if costs is None else costs.parts
    return next((part.value for part in parts if part.effect == cause.effect), None)


def ranked_causes(found: DiagnosisResult) -> list[NamedCause]:
    """The causes, those that cost most of the leading efficiency first; without a model as they are."""
    costs = worst_costs(found)
    return sorted(found.causes, key=lambda cause: -abs(cost_of(costs, cause) or 0.0))
