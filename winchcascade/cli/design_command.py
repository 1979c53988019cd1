"""`winchcascade design`: other loads, speeds and motions with the rig that a diagnosis leaves."""

from __future__ import annotations

import math
from pathlib import Path

from winchcascade.cli.options import (
    EVALUATION,
    INPUT,
    OUTPUTS,
    argument,
    named_number,
    numbers,
    option,
    with_options,
)
from winchcascade.cli.outputs import NO_OUTPUTS, REPORT, Outputs, given_command, present
from winchcascade.cli.progress import status_line
from winchcascade.core.jobs import use_threads


@with_options(
    "json",
    *REPORT,
    "csv",
    source=argument("CAMPAIGN|DIAGNOSIS.json", "The campaign, which is diagnosed first, or the "
                                               "JSON of its diagnosis."),
    motion=option("--motion", "LOG|FILE", "The motion: a log, a profile, or a table of speed_mps "
                                          "and cycles_per_year.", INPUT),
    loads=option("--loads", "OHM,...", "Loads of the map [ohm]; by default those of the campaign.", EVALUATION),
    speeds=option("--speeds", "MPS,...", "Line speeds of the map [m/s]; by default up to the "
                                         "fastest logged.", EVALUATION),
    csv=option("--csv", "FILE", "Write the schedule for a controller: speeds, load, domain and "
                                "verdict.", OUTPUTS),
)  # fmt: skip
def design_command(
    source: Path,
    rig: str | None = None,
    motion: Path | None = None,
    loads: str | None = None,
    speeds: str | None = None,
    current_limit: float = math.inf,
    speed_limit: float = math.inf,
    tension_limit: float = math.inf,
    threads: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Predict other loads and speeds with the corrected rig, schedule the load, and value the
    repair of each cause.

    Every value has a 95 % interval; points that the logs do not cover and points over a limit are
    flagged. A diagnosis whose gap is unexplained is rejected, unless --force is given.
    """
    use_threads(threads)
    from winchcascade.batch.campaign_design import corrected_by, motions_of
    from winchcascade.design.design import check_options, design
    from winchcascade.design.design_result import Limits
    from winchcascade.report.results.design_report import design_record, design_report, schedule_csv

    outputs.check([source, motion, rig])
    at_loads, at_speeds = numbers("--loads", loads), numbers("--speeds", speeds)
    limits = Limits(current_limit, speed_limit, tension_limit)
    check_options(at_loads, at_speeds, limits)
    cycle, sea = motions_of(motion)
    with status_line(f"designing with {source.name}") as on_progress:
        posterior, tested = corrected_by(source, rig, on_progress, force=outputs.force)
        on_progress("predicting other loads and speeds")
        found = design(
            posterior,
            tested,
            motion=cycle,
            sea=sea,
            loads=at_loads,
            speeds=at_speeds,
            limits=limits,
        )
    present(
        lambda: design_report(found, command=given_command()),
        outputs,
        record=lambda: design_record(found),
        texts={"csv": lambda: schedule_csv(found)},
        name="design",
    )


@with_options(
    "json",
    *REPORT,
    source=argument("CAMPAIGN|RIG", "The campaign, which is diagnosed first, or before any run a "
                                    "rig file or a built-in rig."),
    runs=option("--runs", "N", "Plan N runs at most; 12 by default.", EVALUATION, minimum=1),
    separate=option("--separate", "EFFECT EFFECT", "Separate two effects; by default a cause and "
                                                   "its look-alike.", EVALUATION),
    uncertainty=option("--uncertainty", "METRIC=X", "Determine a metric to this standard "
                                                    "uncertainty.", EVALUATION),
    loads=option("--loads", "OHM,...", "Loads that can be run [ohm], inf for an open circuit.", EVALUATION),
    speeds=option("--speeds", "MPS,...", "Line speeds that can be run [m/s].", EVALUATION),
    length=option("--length", "M", "Travel of a payout before any run is made; 10 m by default.", EVALUATION),
)  # fmt: skip
def plan_command(
    source: Path,
    rig: str | None = None,
    runs: int | None = None,
    separate: tuple[str, str] | None = None,
    uncertainty: str | None = None,
    loads: str | None = None,
    speeds: str | None = None,
    length: float = 10.0,
    threads: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Plan the runs that separate two effects, or that determine a metric to a wanted uncertainty.

    Runs stand in the order in which they help most, each with what is expected after it, beside
    random runs of the same number.
    """
    use_threads(threads)
    from winchcascade.batch.campaign_design import planned_from
    from winchcascade.design.operating import require_positive
    from winchcascade.report.results.plan_report import plan_record, plan_report

    outputs.check([source, rig])
    wanted = named_number(uncertainty) if uncertainty else None
    at_loads, at_speeds = numbers("--loads", loads), numbers("--speeds", speeds)
    require_positive("--speeds", at_speeds)
    with status_line(f"planning for {source.name}") as on_progress:
        found = planned_from(
            source, rig, separate=separate, uncertainty=wanted, most=runs, loads=at_loads, speeds=at_speeds, length=length,
            on_progress=on_progress,
        )  # fmt: skip
    present(
        lambda: plan_report(found, command=given_command()),
        outputs,
        record=lambda: plan_record(found),
        name="plan",
    )
