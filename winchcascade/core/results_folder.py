"""Names of the files in a folder of results: those of a campaign, of its diagnosis, and the page that lists all."""

from __future__ import annotations

INDEX = "index.html"
"""Page that lists what a folder of results holds."""

CAMPAIGN_RECORD, CAMPAIGN_PAGE, CAMPAIGN_WORKBOOK = "campaign.json", "campaign.html", "campaign.xlsx"
"""Record, report and tables of a whole campaign."""

CAMPAIGN_FILES = (CAMPAIGN_RECORD, CAMPAIGN_PAGE, "campaign.pdf", CAMPAIGN_WORKBOOK)
"""Files of a whole campaign, beside its dataset."""

DIAGNOSIS_RECORD = "diagnosis.json"
"""Record of the diagnosis of a campaign; it states how the other files were made, and is written last."""

DIAGNOSIS_FILES = ("diagnosis.html", "diagnosis.pdf", DIAGNOSIS_RECORD)
"""Files of a diagnosis."""
