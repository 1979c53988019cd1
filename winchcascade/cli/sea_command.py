"""`winchcascade sea`: the rig that a diagnosis leaves under irregular waves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import asdict

from winchcascade.cli.options import (
    EVALUATION,
    INPUT,
    OUTPUTS,
    argument,
    numbers,
    option,
    with_options,
)
from winchcascade.cli.outputs import NO_OUTPUTS, REPORT, Outputs, given_command, present
from winchcascade.cli.progress import status_line
from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import use_threads

if TYPE_CHECKING:
    from winchcascade.diagnosis.handover.posterior import RigPosterior
    from winchcascade.diagnosis.handover.tested import Tested
    from winchcascade.sea.in_sea import Control


@with_options(
    "json",
    *REPORT,
    "csv",
    source=argument("CAMPAIGN|DIAGNOSIS.json", "The campaign, which is diagnosed first, or the "
                                               "JSON of its diagnosis."),
    hs=option("--hs", "M,...", "Significant wave heights [m]; each is taken with each period.", INPUT),
    tp=option("--tp", "S,...", "Peak periods [s].", INPUT),
    scatter=option("--scatter", "FILE", "A table of hs_m, tp_s and hours_per_year instead.", INPUT),
    motion=option("--motion", "LOG", "A log of the surface or the line instead: displacement or "
                                     "velocity over time.", INPUT),
    float_=option("--float", "FILE", "What moves the line: a response (CSV), or coefficients by "
                                     "Capytaine or BEMIO.", INPUT),
    gamma=option("--gamma", "X", "Peak enhancement of JONSWAP, 3.3 by default; 1 is "
                                 "Pierson-Moskowitz.", EVALUATION),
    bins=option("--bins", "M,S", "Bins of a scatter table; 0.5,1 by default.", EVALUATION),
    froude=option("--froude", "X", "Scale of the seas over that of the rig, by Froude's law; 1 by "
                                   "default.", EVALUATION),
    minutes=option("--minutes", "MIN", "Length of each sea [min]; 20 by default.", EVALUATION),
    payout=option("--payout", "M", "Payout in still water [m]; by default half of a usual one of "
                                   "the logs.", EVALUATION),
    load=option("--load", "OHM", "Load of all seas [ohm]; by default the best one for their "
                                 "energy.", EVALUATION),
    compare=option("--compare", "", "Compare with the best load of each sea and the schedule of "
                                    "`design`.", EVALUATION),
    draws=option("--draws", "N", "Draw N rigs for the bands; 40 by default.", EVALUATION, minimum=0),
    csv=option("--csv", "FILE", "Write the mean power of each sea with its band, domain and "
                                "verdict.", OUTPUTS),
)  # fmt: skip
def sea_command(
    source: Path,
    hs: str | None = None,
    tp: str | None = None,
    scatter: Path | None = None,
    motion: Path | None = None,
    float_: Path | None = None,
    rig: str | None = None,
    gamma: float = 3.3,
    bins: str | None = None,
    froude: float = 1.0,
    minutes: float = 20.0,
    payout: float = math.nan,
    load: float = math.nan,
    compare: bool = False,
    draws: int = 40,
    seed: int = 0,
    current_limit: float = math.inf,
    speed_limit: float = math.inf,
    tension_limit: float = math.inf,
    threads: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Put the corrected rig under irregular waves: mean power of each sea, energy of a year,
    losses, peaks.

    The line follows the surface, unless --float is given. Every value has a 95 % interval; motions
    that the logs do not cover and seas over a limit are flagged. A diagnosis whose gap is
    unexplained is rejected, unless --force is given.
    """
    use_threads(threads)
    from winchcascade.batch.campaign_design import corrected_by
    from winchcascade.batch.seas_given import seas_of
    from winchcascade.design.design import check_options
    from winchcascade.design.design_result import Limits
    from winchcascade.report.results.sea_report import sea_csv, sea_record, sea_report
    from winchcascade.sea.hydrodynamics import read_float
    from winchcascade.sea.line_motion import FOLLOWER
    from winchcascade.sea.sea_study import BINS, sea_study

    outputs.check([source, scatter, motion, float_, rig])
    seas = seas_of(
        scatter, motion, numbers("--hs", hs), numbers("--tp", tp), gamma=gamma, bins=numbers("--bins", bins) or BINS,
        froude=froude, minutes=minutes, seed=seed,
    )  # fmt: skip
    if not (math.isnan(load) or load > 0.0):
        raise OptionError(f"--load {load:g}: expected a number of ohms above 0.")
    stated = Limits(current_limit, speed_limit, tension_limit)
    check_options((), (), stated)
    limits = {name: limit for name, limit in asdict(stated).items() if limit < math.inf}
    with status_line(f"putting {source.name} under waves") as on_progress:
        posterior, tested = corrected_by(source, rig, on_progress, force=outputs.force)
        on_progress("stepping through the seas")
        found = sea_study(
            posterior, tested, seas, body=FOLLOWER if float_ is None else read_float(float_),
            moved_by=" in ".join(path.name for path in (float_, motion) if path is not None) or "the surface", load=load,
            compare=compare,
            schedule=_schedule(posterior, tested, limits) if compare else None,
            limits=limits, payout=payout, draws=draws,
        )  # fmt: skip
    present(
        lambda: sea_report(found, command=given_command()),
        outputs,
        record=lambda: sea_record(found),
        texts={"csv": lambda: sea_csv(found)},
        name="sea",
    )


def _schedule(
    posterior: RigPosterior, tested: Tested, limits: Mapping[str, float]
) -> Control | None:
    """The schedule of `design` for most power within limits, by their names; None where it has
    no load.
    """
    from winchcascade.design.design import design
    from winchcascade.design.design_result import Limits
    from winchcascade.sea.in_sea import scheduled

    designed = design(posterior, tested, limits=Limits(**limits))
    rows = [
        (one.rpm_low, one.rpm_high, one.load)
        for one in designed.schedule
        if one.criterion == "power" and one.load is not None
    ]
    return scheduled(rows, "design") if rows else None
