"""The runs of a campaign that a diagnosis takes, and which of them are withheld."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.campaign_file import check_held_out
from winchcascade.core.errors import CampaignError, OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.campaign_file import Cycles
    from winchcascade.core.run import Run


class Entries(msgspec.Struct, frozen=True):
    """Runs of a campaign with its title; of each run the first and last cycle that count, None for
    all, and the numbers of the runs that take part in neither choice nor fit.
    """

    runs: Sequence[Run]
    cycles: Sequence[Cycles | None] | None = None
    withheld: Sequence[int] = ()
    title: str = ""

    def check_withheld(self) -> None:
        """Reject entries that are all withheld, or that withhold a log that takes part as
        another run: CampaignError.
        """
        if len(self.runs) <= len(set(self.withheld)):
            raise CampaignError(
                "every run is withheld; a diagnosis needs at least one that takes part in the fit."
            )
        names = [run.name for run in self.runs]
        logs = [run.sha256 and f"{run.sha256}\0{run.table or ''}" for run in self.runs]
        check_held_out(
            names, logs, self.cycles or [None] * len(names), self.withheld, self.title or "campaign"
        )


def withheld_numbers(
    loads: Sequence[float], runs: Sequence[Run], marked: Sequence[bool]
) -> list[int]:
    """Numbers of the runs to withhold: those of the loads that are named, else those that the
    campaign marks.

    Raises
    ------
    OptionError : no run has such a load
    """
    if not loads:
        return [k for k, mark in enumerate(marked) if mark]
    found: list[int] = []
    for load in loads:
        having = [
            k
            for k, run in enumerate(runs)
            if run.load is not None and math.isclose(run.load, load, rel_tol=1e-6)
        ]
        if not having:
            there = ", ".join(f"{run.load:g}" for run in runs if run.load is not None)
            raise OptionError(
                f"--withhold {load:g}: no run of the campaign has this load; it has {there} ohm."
            )
        found += having
    return sorted(set(found))
