"""The record of a campaign as it is written, schema `winchcascade/campaign/1`."""

from __future__ import annotations

import msgspec
from msgspec import UNSET

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.version import __version__
from winchcascade.reduction.best_load import ranking_record
from winchcascade.reduction.campaign_record import CampaignRecord, window_rules

CAMPAIGN_SCHEMA = "winchcascade/campaign/1"


def campaign_json(campaign: CampaignRecord) -> dict[str, object]:
    """The record of a campaign with what compares its logs: kinds of windows, and the best load or why none is claimed."""
    rules = {rule: len(found) for rule, found in window_rules(campaign.reduced).items()}
    return {
        "schema": CAMPAIGN_SCHEMA,
        "version": __version__,
        "title": campaign.title,
        "data": origin_record(joint_origin([run.origin for run in campaign.reduced])),
        "windows": {"rules": rules, "mixed": len(rules) > 1},
        **ranking_record(campaign.reduced),
        "state": campaign.state,
        "runs": campaign.runs,
        **({} if campaign.waves is UNSET else {"waves": campaign.waves}),
        "between_logs": [{"run": name, **msgspec.structs.asdict(finding)} for name, finding in campaign.between],
    }
