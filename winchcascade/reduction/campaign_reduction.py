"""The reductions of the runs of a campaign, as the library gives them."""

from __future__ import annotations

from collections.abc import Mapping

from winchcascade.core.cascade import Cascade
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.campaign_record import CampaignRecord
from winchcascade.reduction.run_record import RunRecord


class CampaignReduction(Viewed, frozen=True):
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
            name: [{k: x for k, x in item.items() if isinstance(x, float | int)} for item in record.bins]
            for name, record in self.records.items()
        }
