"""What a diagnosis by a model and one without have in common: what may be withheld, and when a gap is explained."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import check_held_out
from winchcascade.core.errors import CampaignError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.campaign_file import Cycles
    from winchcascade.core.run import Run

NAMED = 2
"""So many causes are named at most where much stays unexplained: more would be a crowd, none of them sure."""

MOSTLY = 0.9
"""Share of the gap that must be closed for a verdict of `explained` while something without structure remains."""

HALF = 0.5
"""With less closed and a structured remainder a gap is unexplained."""


def check_withheld(
    runs: Sequence[Run], cycles: Sequence[Cycles | None] | None, withheld: Sequence[int], title: str
) -> None:
    """Refuse to withhold all runs, or a log that takes part as another run too: CampaignError.

    Parameters
    ----------
    cycles : of each run, the first and last that count, None for all
    withheld : numbers of the runs
    title : of the campaign, for the sentence
    """
    if len(runs) <= len(set(withheld)):
        raise CampaignError("every run is withheld; a diagnosis needs at least one that takes part in the fit.")
    names, logs = [run.name for run in runs], [run.sha256 and f"{run.sha256}\0{run.table or ''}" for run in runs]
    check_held_out(names, logs, cycles or [None] * len(runs), withheld, title or "campaign")
