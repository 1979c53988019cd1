"""Energies and efficiencies from the log of a winch-driven power take-off.

>>> from winchcascade import reduce
>>> round(reduce("fixtures/campaign/r36ohm.csv").mean.eta_trans, 2)
0.9
"""

from __future__ import annotations

from winchcascade.core.version import __version__

TYPE_CHECKING = False  # not from typing, whose import takes longer than all else before `main` answers an interrupt
if TYPE_CHECKING:
    from typing import Any

    from winchcascade.batch.compare_results import compare
    from winchcascade.batch.open_campaign import OpenedCampaign, open_campaign
    from winchcascade.comparison.comparison_result import Comparison
    from winchcascade.core.errors import LogError, OptionError, RigError, WinchcascadeError
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Finding, Run
    from winchcascade.diagnosis.handover.calibrate import Calibration, calibrate
    from winchcascade.ingest.read import read_run
    from winchcascade.reduction.bins import Bin
    from winchcascade.reduction.campaign_record import CampaignReduction
    from winchcascade.reduction.efficiency import Metrics
    from winchcascade.reduction.reduce import reduce
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
    from winchcascade.report.views import frame, plot, summary_html, write_report
    from winchcascade.rig.baseline import baseline, load_rig
    from winchcascade.rig.parts import Model
    from winchcascade.rig.simulate import Simulation, simulate
    from winchcascade.tables.audit import audit

__all__ = [
    "Bin",
    "Calibration",
    "CampaignReduction",
    "Comparison",
    "CycleResult",
    "Finding",
    "LogError",
    "Metrics",
    "Model",
    "OpenedCampaign",
    "OptionError",
    "Reduction",
    "Rig",
    "RigError",
    "Run",
    "Simulation",
    "Uncertainty",
    "WinchcascadeError",
    "__version__",
    "audit",
    "baseline",
    "calibrate",
    "compare",
    "frame",
    "load_rig",
    "open_campaign",
    "plot",
    "read_run",
    "reduce",
    "simulate",
    "summary_html",
    "uncertainty",
    "write_report",
]

_HOMES = {
    "Bin": "reduction.bins",
    "Calibration": "diagnosis.handover.calibrate",
    "CampaignReduction": "reduction.campaign_record",
    "Comparison": "comparison.comparison_result",
    "CycleResult": "reduction.reduction_result",
    "Finding": "core.run",
    "LogError": "core.errors",
    "Metrics": "reduction.efficiency",
    "Model": "rig.parts",
    "OpenedCampaign": "batch.open_campaign",
    "OptionError": "core.errors",
    "Reduction": "reduction.reduction_result",
    "Rig": "core.rig_file",
    "RigError": "core.errors",
    "Run": "core.run",
    "Simulation": "rig.simulate",
    "Uncertainty": "reduction.uncertainty",
    "WinchcascadeError": "core.errors",
    "audit": "tables.audit",
    "baseline": "rig.baseline",
    "calibrate": "diagnosis.handover.calibrate",
    "compare": "batch.compare_results",
    "frame": "report.views",
    "load_rig": "rig.baseline",
    "open_campaign": "batch.open_campaign",
    "plot": "report.views",
    "read_run": "ingest.read",
    "reduce": "reduction.reduce",
    "simulate": "rig.simulate",
    "summary_html": "report.views",
    "uncertainty": "reduction.uncertainty",
    "write_report": "report.views",
}


def __dir__() -> list[str]:
    """The public names, whether they are imported yet or not."""
    return list(__all__)


def __getattr__(name: str) -> Any:
    """Import a public name where it is first used, so that `winchcascade --help` waits for none
    of them.
    """
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module 'winchcascade' has no attribute {name!r}")
    return getattr(import_module(f"winchcascade.{_HOMES[name]}"), name)
