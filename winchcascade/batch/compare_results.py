"""Compare two campaigns, batches, reductions or logs: load what each side is, and subtract the
means of matched runs.
"""

from __future__ import annotations

from pathlib import Path

from winchcascade.batch.log_settings import settings_of
from winchcascade.batch.results import load_results
from winchcascade.comparison.compare_sides import compare_sides
from winchcascade.comparison.compared_run import compared_run
from winchcascade.comparison.comparison_result import ComparedSide, Comparison
from winchcascade.core.arguments import FLAG, PROCESSES, Expected, check_arguments, is_path
from winchcascade.core.errors import OptionError
from winchcascade.ingest.read import read_by
from winchcascade.reduction.campaign_record import CampaignReduction
from winchcascade.reduction.reduce import reduce, require_payouts
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import RunRecord, reduction_record

Target = str | Path | Reduction | CampaignReduction
"""What a side may be: a path as on the command line, or a result."""

SIDE = Expected("a path, or what reduce or open_campaign(...).reduce() gives", is_path)

RESULTS = (".json", ".toml")
"""Endings of files that are no logs."""


def compare(a: Target, b: Target, *, same_sensors: bool = False, jobs: int = 1) -> Comparison:
    """Compare two sides, before and after a repair, say: differences B - A of matched runs with 95
    % intervals.

    Parameters
    ----------
    a, b : a campaign (folder or campaign.toml), the folder of a batch, a reduction's JSON, a log,
        or the result of `reduce` or of `open_campaign(...).reduce()`
    same_sensors : the same sensors and drum on both sides: the errors of their gains are common. By
        default those of A and B are independent.
    jobs : processes that reduce the logs of a campaign

    Raises
    ------
    WinchcascadeError : something of the input cannot be used, or nothing matches; the message names
        it

    Examples
    --------
    >>> found = compare("fixtures/campaign/r36ohm.csv", "fixtures/campaign/r36ohm.csv")
    >>> found.runs[0].of("eta_pto").value
    0.0
    """
    check_arguments("compare", ("same_sensors", same_sensors, FLAG), ("jobs", jobs, PROCESSES))
    return compare_sides(compared_side(a, jobs), compared_side(b, jobs), same_sensors=same_sensors)


def compared_side(target: Target, jobs: int = 1) -> ComparedSide:
    """Load one side of a comparison, or reduce its logs."""
    if isinstance(target, Reduction):
        name, records = target.run.name, {target.run.name: reduction_record(target)}
    elif isinstance(target, CampaignReduction):
        name, records = target.summary.title, dict(target.records)
    else:
        check_arguments("compare", ("side", target, SIDE))
        path = Path(target)
        found = _log(path) if _is_log(path) else load_results(path, jobs=jobs).records
        name, records = str(path), dict(found)
    if not records:
        raise OptionError(
            f"{name}: has no reduced log; expected one at least. Look at the faults of its logs."
        )
    return ComparedSide(name, tuple(compared_run(record, name) for name, record in records.items()))


def _is_log(path: Path) -> bool:
    return path.is_file() and path.suffix.casefold() not in RESULTS


def _log(path: Path) -> dict[str, RunRecord]:
    """Reduce a log as `reduce` does without options."""
    reduction = reduce(read_by(path, settings_of(path, rig=None, load_ohm=None, window=None)))
    require_payouts(reduction)
    return {path.name: reduction_record(reduction)}
