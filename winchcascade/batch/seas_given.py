"""The seas of a command: wave heights and periods as given, the bins of a scatter table, or the
waves of a log.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from winchcascade.core.errors import OptionError
from winchcascade.core.number_table import number_rows
from winchcascade.core.scales import motion_of_runs
from winchcascade.design.operating import require_positive
from winchcascade.ingest.read import read_run
from winchcascade.rig.line_velocity import line_velocity
from winchcascade.sea.sea_study import BINS, Seas
from winchcascade.sea.wave_spectra import SeaState, logged

SCATTER = ("hs_m", "tp_s", "hours_per_year")
"""Columns of a scatter table: significant wave height [m], peak period [s], hours in a year [h]."""

MAX_SEAS = 1000
"""Maximum number of seas: so many take an hour."""


def seas_of(
    scatter: Path | None,
    motion: Path | None,
    heights: Sequence[float],
    periods: Sequence[float],
    *,
    gamma: float,
    bins: Sequence[float] = BINS,
    froude: float = 1.0,
    minutes: float,
    seed: int,
) -> Seas:
    """Every height with every period, the rows of a scatter table, of which those in one bin are
    put together, or a log.

    Parameters
    ----------
    motion : log of the displacement of the surface or the line, or of its velocity
    bins : widths of the bins of a scatter table, which lie about multiples of them [m, s]
    froude : scale of the seas over that of the rig [1]

    Raises
    ------
    OptionError : none or several are given, or a number that is none
    LogError : the log cannot be read
    """
    ways = [scatter is not None, motion is not None, bool(heights or periods)]
    if sum(ways) != 1 or bool(heights) != bool(periods):
        raise OptionError("sea: expected --hs M and --tp S, --scatter FILE, or --motion LOG.")
    numbers = {
        "--hs": heights,
        "--tp": periods,
        "--bins": bins,
        "--froude": [froude],
        "--minutes": [minutes],
        "--gamma": [gamma],
    }
    for option, given in numbers.items():
        require_positive(option, given)
    if len(bins) != len(BINS):
        raise OptionError(f"--bins: {len(bins)} numbers; expected a height [m] and a period [s].")
    if motion is not None:
        return _of_log(motion, froude, seed)
    found = (
        {(hs, tp): math.nan for hs in heights for tp in periods}
        if scatter is None
        else _binned(scatter, bins)
    )
    if len(found) > MAX_SEAS:
        raise OptionError(f"sea: {len(found)} seas; expected {MAX_SEAS} at most.")
    return Seas(
        tuple(SeaState(hs, tp, gamma) for hs, tp in found),
        tuple(found.values()),
        froude=froude,
        minutes=minutes,
        seed=seed,
    )


def _of_log(path: Path, froude: float, seed: int) -> Seas:
    """The waves of a log as the only sea; they have no hours."""
    run = read_run(path, campaign=False)
    if "velocity" not in run.channels:
        raise OptionError(
            f"--motion {path}: no displacement or velocity of a line; expected one of them over "
            f"time."
        )
    ramp = motion_of_runs([run]).ramp
    try:
        sea, waves = logged(run.t, line_velocity(run, ramp).value, ramp)
    except OptionError as fault:
        raise OptionError(f"--motion {path}: {fault}") from None
    return Seas(
        (sea,), (math.nan,), froude=froude, minutes=waves.duration / 60.0, seed=seed, log=waves
    )


def _binned(path: Path, bins: Sequence[float]) -> dict[tuple[float, float], float]:
    """Hours by the middles of the bins of a scatter table, in their order."""
    found: dict[tuple[float, ...], float] = {}
    expected = "a height [m] and a period [s] above 0, and hours"
    for *sea, hours in number_rows(path, SCATTER, _is_sea, expected, "--scatter"):
        middle = tuple(round(x / width) * width for x, width in zip(sea, bins, strict=True))
        if not all(middle):
            raise OptionError(
                f"--scatter {path}: {sea[0]:g} m and {sea[1]:g} s lie in a bin about 0; expected "
                f"seas above half of {bins[0]:g} m and {bins[1]:g} s, so give narrower --bins."
            )
        place = tuple(round(x, 9) for x in middle)
        found[place] = found.get(place, 0.0) + hours
    known = {(hs, tp): hours for (hs, tp), hours in sorted(found.items()) if hours > 0.0}
    if not known:
        raise OptionError(f"--scatter {path}: no row with hours below {','.join(SCATTER)}.")
    return known


def _is_sea(hs: float, tp: float, hours: float) -> bool:
    return 0.0 < hs < math.inf and 0.0 < tp < math.inf and 0.0 <= hours < math.inf
