"""What a design begins from: the corrected rig of a campaign or of a written diagnosis, and a
motion or the speeds of a sea.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.batch.campaign_diagnosis import diagnose_listed
from winchcascade.core.campaign_file import CAMPAIGN_FILE, load_campaign
from winchcascade.core.errors import OptionError
from winchcascade.core.number_table import number_rows
from winchcascade.design.operating import Motion, motion_of_run
from winchcascade.design.run_plan import MOST, RunPlan, after, before, determine
from winchcascade.design.run_plan import separate as split
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.handover.posterior import posterior_of_rig
from winchcascade.diagnosis.handover.posterior_record import posterior_from
from winchcascade.diagnosis.handover.tested import tested_by
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import load_rig
from winchcascade.rig.effects.catalogue import EFFECTS

if TYPE_CHECKING:
    from winchcascade.diagnosis.handover.posterior import RigPosterior
    from winchcascade.diagnosis.handover.tested import Tested

SEA = ("speed_mps", "cycles_per_year")
"""Columns of a table of payout speeds."""

LONGEST_HEAD = 200
"""Length of the longest first line of such a table. [characters]"""

Sea = list[tuple[float, float]]
"""Speeds of payouts [m/s], each with its number in a year."""


def corrected_by(
    source: Path, rig: str | None, on_progress: Callable[[str], None], *, force: bool = False
) -> tuple[RigPosterior, Tested]:
    """The corrected rig of a campaign, which is diagnosed, or of the JSON of a diagnosis, and what
    its logs cover.

    Raises
    ------
    OptionError : the JSON is no diagnosis by a model, the rig has no model, or the gap is
        unexplained and `force` does not allow to go on
    WinchcascadeError : the campaign cannot be diagnosed
    """
    if source.suffix.casefold() == ".json":
        if rig is not None:
            raise OptionError(
                f"--rig {rig}: a diagnosis has its rig already; leave --rig out, or give the "
                f"campaign."
            )
        posterior, tested = posterior_from(_record(source).get("posterior"), str(source))
    else:
        found = _diagnosed(source, rig, on_progress)
        covered = tested_by(found)
        if covered is None:
            raise OptionError(f"{source}: no log has a payout; expected one at least.")
        posterior, tested = posterior_of_rig(found), covered
    tested.judgement.check(f"{source}", force=force)
    return posterior, tested


def _diagnosed(source: Path, rig: str | None, on_progress: Callable[[str], None]) -> ModelDiagnosis:
    """The diagnosis of a campaign by a model of its rig."""
    found = diagnose_listed(load_campaign(source), EFFECTS, rig=rig, on_progress=on_progress)
    if not isinstance(found, ModelDiagnosis):
        raise OptionError(
            f"{source}: no model can be made of rig {found.rig.name}; expected all numbers of the "
            f"rig."
        )
    return found


def _record(source: Path) -> dict[str, Any]:
    """The JSON of a diagnosis."""
    try:
        record = msgspec.json.decode(source.read_bytes())
    except (OSError, msgspec.DecodeError) as fault:
        raise OptionError(
            f"{source}: cannot be read ({fault}); expected the JSON of `winchcascade diagnose`."
        ) from None
    if not isinstance(record, dict) or not str(record.get("schema", "")).startswith(
        "winchcascade/diagnosis/"
    ):
        raise OptionError(
            f"{source}: is no diagnosis; expected the JSON that `winchcascade diagnose CAMPAIGN "
            f"--json` writes."
        )
    return record


def motions_of(path: Path | None) -> tuple[Motion | None, Sea]:
    """The motion of a log or profile, or the speeds of a table with the columns of `SEA`; neither
    without a file.

    Raises
    ------
    OptionError : a row of a table is not a speed and a number above 0
    LogError : the file is neither
    """
    if path is None:
        return None, []
    if _lists_speeds(path):
        expected = "a speed in m/s and a number of cycles, both above 0"
        rows = number_rows(path, SEA, _is_speed, expected)
        return None, [(speed, count) for speed, count in rows]
    return motion_of_run(read_run(path, campaign=False)), []


def _lists_speeds(path: Path) -> bool:
    """Whether a file is a table of speeds, and not a log of any format."""
    if not path.is_file():  # a device may have no end
        return False
    try:
        with path.open(encoding="utf-8-sig") as file:
            head = file.readline(LONGEST_HEAD)
    except (OSError, ValueError):
        return False
    return tuple(cell.strip() for cell in head.split(",")) == SEA


def _is_speed(speed: float, count: float) -> bool:
    return 0.0 < speed < math.inf and 0.0 < count < math.inf


# ------------------------------------------------------------------------------------------ plans
def planned_from(
    source: Path,
    rig: str | None,
    *,
    separate: tuple[str, str] | None,
    uncertainty: tuple[str, float] | None,
    most: int | None,
    loads: Sequence[float],
    speeds: Sequence[float],
    length: float,
    on_progress: Callable[[str], None],
) -> RunPlan:
    """Plan runs after the diagnosis of a campaign, or before any run for a rig.

    Raises
    ------
    OptionError : both aims or, before any run, none of them; no such effect or metric; a campaign
        without two explanations
    WinchcascadeError : the campaign or the rig cannot be used
    """
    if separate is not None and uncertainty is not None:
        raise OptionError("--separate and --uncertainty: expected one of them.")
    found = None
    if source.is_dir() or source.name == CAMPAIGN_FILE:
        found = _diagnosed(source, rig, on_progress)
        basis, suspects = after(found, loads, speeds), found.suspects
    else:
        stated = load_rig(str(source))
        basis, suspects = before(stated, loads, speeds, length), EFFECTS
    on_progress("planning runs")
    if uncertainty is not None:
        return determine(basis, *uncertainty, most or MOST)
    if separate is None:
        if found is None or found.experiment is None:
            raise OptionError(
                f"{source}: no two explanations are given; expected --separate EFFECT EFFECT or "
                f"--uncertainty METRIC=X."
            )
        separate = found.experiment.separates
    return split(basis, separate, suspects, most or MOST)
