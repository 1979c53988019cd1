"""The reductions of the runs of a campaign, as the library gives them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.cascade import Cascade
from winchcascade.core.late_module import LateModule
from winchcascade.core.run import Units
from winchcascade.reduction.campaign_record import CampaignRecord
from winchcascade.reduction.run_record import RunRecord

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib import axes
else:
    pd, axes = LateModule("pandas"), LateModule("matplotlib.axes")

CampaignTable = Literal["runs", "cycles", "bins", "findings"]
"""Tables of a campaign as frames."""

CampaignPlot = Literal["power", "efficiency", "speed"]
"""Plots of a campaign."""


class CampaignReduction(msgspec.Struct, frozen=True):
    """Reductions of the runs of a campaign.

    Parameters
    ----------
    summary : means of every run or why it has none, and findings of single runs beside the others
    records : the JSON of each run as a record, by its name
    cascades : of the rigs of the runs
    """

    summary: CampaignRecord
    records: Mapping[str, RunRecord]
    cascades: tuple[Cascade, ...] = ()

    def __repr__(self) -> str:
        """One line instead of every number."""
        return (
            f"CampaignReduction({self.summary.title!r}, {len(self.records)} of {len(self.summary.runs)} runs reduced)"
        )

    @property
    def faults(self) -> dict[str, str]:
        """Why runs could not be reduced, by their names."""
        return {run.name: run.fault for run in self.summary.failed}

    @property
    def bins(self) -> dict[str, list[dict[str, float]]]:
        """Means of the runs in bins of generator speed that are known, by name and unit."""
        return {
            name: [
                {k: x for k, x in msgspec.structs.asdict(item).items() if isinstance(x, float | int)}
                for item in record.bins
            ]
            for name, record in self.records.items()
        }

    def to_pandas(self, table: CampaignTable = "runs", units: Units = "si") -> pd.DataFrame:
        """One table as a frame with the columns of the dataset: a row for each run, or the cycles, bins or findings of all."""
        from winchcascade.report.frames import campaign_frame

        return campaign_frame(self.records, table, units, self.cascades)

    def plot(self, what: CampaignPlot, ax: axes.Axes | None = None) -> axes.Axes | NDArray[np.object_]:
        """Plot mean powers or efficiencies of the runs over their loads, or the power over generator speed; gives the Axes."""
        from winchcascade.report.plots import plot_campaign

        return plot_campaign(self, what, ax)

    def _repr_html_(self) -> str:
        """Efficiencies of the runs as a table, for notebooks."""
        from winchcascade.report.plots import summary_html

        return summary_html(self)
