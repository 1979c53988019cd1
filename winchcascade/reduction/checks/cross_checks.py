"""All cross-checks between the channels of a run whose phases are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.reduction.checks.lag import lag_findings
from winchcascade.reduction.checks.load import load_findings
from winchcascade.reduction.checks.phased_run import Phased
from winchcascade.reduction.checks.resolution import resolution_findings
from winchcascade.reduction.checks.sampling import Sampling, check_sampling
from winchcascade.reduction.checks.zeros import zero_findings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig, WindowRule
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.energies import Energies
    from winchcascade.reduction.phase_summary import PhaseSummary
    from winchcascade.reduction.phases import Cycle
    from winchcascade.reduction.windows import Plateau


def cross_checks(
    run: Run,
    rig: Rig,
    v_smooth: Signal,
    cycles: Sequence[Cycle],
    plateaus: Sequence[Plateau | None],
    summaries: Sequence[PhaseSummary],
    energies: Energies,
    rule: WindowRule,
) -> Sampling:
    """Compare channels with each other, with the stated load and with the rig, and the log with thinned ones.

    No channel is changed. The result holds all findings, and what thinning changes of the energies.

    Parameters
    ----------
    v_smooth : (n,) line velocity, smoothed [m/s]
    plateaus, summaries : of each cycle
    energies, rule : of the windows, and their rule
    """
    phased = Phased(run, rig, v_smooth, cycles, plateaus, summaries)
    sampling = check_sampling(run, rig, rule, cycles, plateaus, energies)
    findings = [*load_findings(phased), *lag_findings(phased), *zero_findings(phased), *sampling.findings]
    findings += resolution_findings(phased, energies)
    return Sampling(sampling.changes, tuple(findings))
