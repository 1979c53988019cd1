"""What each cause costs in efficiency, load by load: the contributions of the runs as means over the runs of a load."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.diagnosis.contributions import leading_metric, loaded_part
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Contribution, DiagnosisResult, NamedCause


def load_costs(found: ModelDiagnosis, metric: str | None) -> list[Contribution]:
    """The split of an efficiency at every load, from the largest resistance to the smallest: means of its runs [%, points].

    The errors of runs of one load are mostly the same, so the bounds of a part are means too.
    """
    runs = loaded_part(found.contributions, metric)
    loads = sorted({run.load for run in runs if run.load is not None}, reverse=True)
    return [_mean_costs([run for run in runs if run.load == load]) for load in loads]


def _mean_costs(runs: Sequence[Contribution]) -> Contribution:
    """The first of some splits with the means of all, in percent."""

    def mean(alike: Sequence[object], name: str) -> float:
        return 100.0 * float(np.mean([getattr(one, name) for one in alike]))

    parts = tuple(
        msgspec.structs.replace(part[0], value=mean(part, "value"), low=mean(part, "low"), high=mean(part, "high"))
        for part in zip(*(run.parts for run in runs), strict=True)
    )
    return msgspec.structs.replace(
        runs[0], as_given=mean(runs, "as_given"), measured=mean(runs, "measured"), parts=parts
    )


def mean_costs(found: DiagnosisResult) -> Contribution | None:
    """The split of the leading efficiency, by which causes are ordered, as a mean over all runs with a load [%, points]."""
    given = found.contributions if isinstance(found, ModelDiagnosis) else ()
    runs = loaded_part(given, leading_metric(given))
    return _mean_costs(runs) if runs else None


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
