"""A campaign in a library call: reduce, diagnose, check and report it as the commands do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from winchcascade.batch.plan import Plan, make_plan
from winchcascade.core.arguments import (
    FLAG,
    LOADS,
    NAMES,
    PATH,
    PATH_OR_NONE,
    PROCESSES,
    SEED_NUMBER,
    check_arguments,
)
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import check_type
from winchcascade.core.files import check_ending
from winchcascade.core.jobs import Workers
from winchcascade.core.store import CAMPAIGN_PAGE, CAMPAIGN_RECORD, INDEX
from winchcascade.core.viewed import LateModule
from winchcascade.reduction.campaign_record import CampaignReduction
from winchcascade.reduction.reduce import window_rule

if TYPE_CHECKING:
    from winchcascade.diagnosis import diagnose
    from winchcascade.diagnosis.stages import diagnose_stages
    from winchcascade.tables import check, published_table, table_file
else:
    diagnose = LateModule("winchcascade.diagnosis.diagnose")
    diagnose_stages = LateModule("winchcascade.diagnosis.stages.diagnose_stages")
    check = LateModule("winchcascade.tables.check")
    published_table = LateModule("winchcascade.tables.published_table")
    table_file = LateModule("winchcascade.tables.table_file")


def open_campaign(
    path: str | Path, *, rig: str | Path | None = None, window: str | float | None = None
) -> OpenedCampaign:
    """Open a campaign: a campaign.toml, the folder that holds one, or a folder of logs. Nothing is
    read but the campaign file.

    Parameters
    ----------
    rig : a rig file or the name of a built-in rig, in place of that of the campaign
    window : a rule or a length of the integration windows [s], in place of those of the campaign

    Raises
    ------
    CampaignError : the campaign file cannot be used
    OptionError : there is no campaign and no log
    """
    check_arguments("open_campaign", ("path", path, PATH), ("rig", rig, PATH_OR_NONE))
    window = None if window is None else window_rule(window)
    rig = None if rig is None else str(rig)
    return OpenedCampaign(Path(path), make_plan([str(path)], rig=rig, window=window), rig)


class OpenedCampaign(msgspec.Struct, frozen=True):
    """A campaign with what its calls have in common.

    Parameters
    ----------
    path : of its file, or of the folder of logs
    plan : its logs with their settings
    rig : a rig file or the name of a built-in rig in place of its own
    """

    path: Path
    plan: Plan
    rig: str | None = None

    def __repr__(self) -> str:
        """One line instead of every setting."""
        return f"OpenedCampaign({self.plan.title!r}, {len(self.plan.work)} runs)"

    def reduce(self, *, jobs: int = 1) -> CampaignReduction:
        """Reduce every log. A log that cannot be used is listed with its fault in the result.

        Parameters
        ----------
        jobs : processes; a script that uses several must guard its start by `if __name__ ==
            "__main__"`

        Raises
        ------
        OptionError : no further process can be started
        """
        from winchcascade.batch.reductions import reduce_campaign

        check_arguments("reduce", ("jobs", jobs, PROCESSES))
        return reduce_campaign(self.plan, Workers(jobs))

    def diagnose(
        self,
        *,
        suspects: Sequence[str] = (),
        withhold: Sequence[float] = (),
        simulated: str | Path | None = None,
        seed: int = 0,
    ) -> diagnose.ModelDiagnosis | diagnose_stages.StageDiagnosis:
        """Find out why logs and model differ.

        Parameters
        ----------
        suspects : effects that may be named; the whole catalogue by default
        withhold : loads of the runs that take part in neither choice nor fit [ohm]
        simulated : folder of your own simulations, files with the names of the logs
        seed : of the resampling of cycles

        Raises
        ------
        WinchcascadeError : something of the input cannot be used; the message names it
        """
        from winchcascade.batch.campaign_diagnosis import diagnose_listed, with_simulations
        from winchcascade.rig.effects.catalogue import suspected

        check_arguments(
            "diagnose",
            ("suspects", suspects, NAMES),
            ("withhold", withhold, LOADS),
            ("simulated", simulated, PATH_OR_NONE),
            ("seed", seed, SEED_NUMBER),
        )
        listed = load_campaign(self.path)
        if simulated is not None:
            listed = with_simulations(listed, Path(simulated))
        return diagnose_listed(listed, suspected(suspects), rig=self.rig, loads=withhold, seed=seed)

    def check(
        self,
        table: published_table.PublishedTable | str | Path,
        *,
        factors: check.Factors | None = None,
        jobs: int = 1,
    ) -> check.Check:
        """Reduce every log and compare the results with a published table, cell by cell.

        Parameters
        ----------
        table : a table, a table file, or the name of a built-in table
        factors : on the parts of every tolerance, 1 if not given; `SAME_LOGS` for a table that was
            made from these logs

        Raises
        ------
        LogError : a log of the campaign cannot be used
        CheckError : no log belongs to a row of the table
        """
        from winchcascade.batch.results import campaign_results, check_results

        check_arguments("check", ("jobs", jobs, PROCESSES))
        if factors is not None:
            check_type("check, factors", factors, check.Factors, "winchcascade.tables.check")
        opened = table_file.load_table(table)
        return check_results(campaign_results(self.plan, jobs), opened, factors)

    def report(self, path: str | Path, *, jobs: int = 1, force: bool = False) -> list[Path]:
        """Reduce every log and write the report of the campaign; the files that were written, that
        of the campaign first.

        Parameters
        ----------
        path : a page (.html) or a PDF (.pdf) of the campaign alone; else a folder, which gets what
            `winchcascade batch` writes: a page for the campaign and for each log, the results as
            JSON and the tables as Parquet

        Raises
        ------
        OptionError : another ending of a file, or no further process can be started
        OutputError : the files cannot be written, or are not this tool's own and `force` does not
            allow to replace them
        """
        from winchcascade.batch.run_batch import DATASET, REPORTS, Products, run_batch
        from winchcascade.report.render.report_files import ENDINGS
        from winchcascade.report.views import write_report

        check_arguments(
            "report", ("path", path, PATH), ("jobs", jobs, PROCESSES), ("force", force, FLAG)
        )
        path = Path(path)
        if path.suffix and not path.is_dir():
            check_ending(path, ENDINGS)
            return [write_report(self.reduce(jobs=jobs), path, force=force)]
        batch = run_batch(
            self.plan, path, Products(REPORTS["html"]), workers=Workers(jobs), force=force
        )
        runs = [
            path / "runs" / f"{name}.{ending}"
            for name in batch.results
            for ending in ("html", "json")
        ]
        return [
            *(path / name for name in (CAMPAIGN_PAGE, INDEX, CAMPAIGN_RECORD)),
            *runs,
            *(path / name for name in DATASET),
        ]
