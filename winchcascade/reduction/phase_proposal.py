"""Which source of cycles fits a log in which none, or none of the paper's crane, was found: a
sentence about it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from winchcascade.core.integrate import largest, median
from winchcascade.core.phase_rule import PhaseRule
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Run
from winchcascade.reduction.phase_sources import find_steps, find_waves, smoothed_motion
from winchcascade.reduction.phased_run import PhasedRun
from winchcascade.reduction.phases import Cycle
from winchcascade.reduction.reduction_result import CycleResult

MANY_WAVES = 5
"""Smallest number of waves that shows a reciprocating motion."""

FEW_ROWS = 500
"""Largest number of rows of a table of step means."""

RECIPROCATES = 0.2
"""Smallest share of the top speed that a reciprocating motion reaches in the other direction.
[1]
"""

RESTS = 0.1
"""Share of the time for which a line that follows waves rests at most: a sine does for a
fiftieth, a crane for a third. [1]
"""

ALIKE = 2.0
"""Largest ratio of the times of payout and haul-in of waves: a kite pays out for three times as
long as it hauls in. [1]
"""

STEADY = 0.5
"""Share of its payouts in which a crane keeps its speed; a sine does so in a fifth of each wave.
[1]
"""

_LABELS = re.compile(
    r"(?:.*[\W_])?(?:phase|phasen|label|state|status|mode|modus|stage|segment|etat|état|fase|estado|阶段|階段|フェーズ)\d*",
    re.IGNORECASE,
)
"""Names of columns that may label the phases."""


def no_cycles(run: Run, rig: Rig) -> str:
    """Message about a log without a cycle: what was expected, and the setting under [phases]
    that fits the log.
    """
    limits = rig.thresholds
    if not rig.phases.by_motion:
        return (
            f'{run.name}: no cycle found by "{rig.phases.source}" under [phases] of the rig '
            f"{rig.name}. Check its values of "
            "payout and its thresholds there and under [thresholds], or choose another source, "
            'such as from = "whole".'
        )
    expected = "expected the line to pay out, and it rests"
    if math.isfinite(limits.v_onset):
        expected = f"expected the line to pay out more than {limits.stroke_min:.3g} m at more than {limits.v_onset:.3g} m/s"
    if "velocity" not in run.channels:
        expected = "expected the line to pay out, and the log has no velocity of the line"
    return f"{run.name}: no payout found; {expected}. {_proposal(run, rig)} under [phases] of a rig file."


def _proposal(run: Run, rig: Rig) -> str:
    """The fitting setting with its reason; the columns to check where the line moves and nothing
    else fits.
    """
    if run.samples <= FEW_ROWS and any(f.kind == "backward_stamp" for f in run.findings):
        return f'The stamps of its {run.samples} rows are out of order: for rows that are step means, set from = "rows"'
    labels = [
        name for finding in run.findings for name in finding.columns if _LABELS.fullmatch(name)
    ]
    if labels:
        return (
            f'The column {labels[0]!r} may label the phases: set from = "column", column = '
            f'"{labels[0]}" and the values of '
            "payout and haul_in"
        )
    motion = smoothed_motion(run, rig)
    if motion is None or largest(motion.v_smooth) <= motion.thresholds.v_onset:
        return 'The log shows no motion: for the energies of the whole record, set from = "whole"'
    waves = find_waves(run.t, motion.v_smooth, motion.thresholds.v_onset)
    slower, faster = sorted((-float(np.min(motion.v_smooth)), float(np.max(motion.v_smooth))))
    if len(waves) >= MANY_WAVES and slower > RECIPROCATES * faster:
        return f'The motion reciprocates about zero: for its {len(waves)} waves, set from = "waves"'
    steps = _steps(run, rig)
    if steps:
        return f'The speed has {steps} steady stretches: for operating points, set from = "steps"'
    if "speed" in run.channels:
        return 'The shaft turns without steady stretches: check the speed column, or set from = "whole" or "speed"'
    return "Check name, unit and sign of the velocity column, or name another source"


def _steps(run: Run, rig: Rig) -> int:
    """Number of the steady stretches of a shaft."""
    return (
        len(find_steps(run, rig.phases, rig.thresholds.gap_max)) if "speed" in run.channels else 0
    )


def other_source(phased: PhasedRun, results: Sequence[CycleResult]) -> list[Finding]:
    """Report a log without a cycle, or whose motion is none of a crane where the rig file leaves
    the source of cycles open.

    That is a shaft of whose line the log shows nothing, or a motion that reciprocates without
    plateaus. Payout and haul-in of a winch are steady stretches too, two of each cycle; of a kite
    that reels in and out while it pays out, most waves are no payouts.
    """
    run, cycles, found = phased.run, phased.cycles, ""
    left_open = replace(phased.rig.phases, rpm_onset=math.nan) == PhaseRule()
    if not cycles:
        return [
            Finding(
                "phase_source",
                no_cycles(run, phased.rig).removeprefix(f"{run.name}: "),
                "every metric is null",
            )
        ]
    if not left_open:
        return []
    derived = any(f.kind == "derived_channel" and f.channel == "velocity" for f in run.findings)
    if derived and run.channels.keys().isdisjoint({"displacement", "force", "pressure"}):
        steps, whole = _steps(run, phased.rig), any(result.complete for result in results)
        if steps > 2 * len(results) or (steps and not whole):
            found = (
                f"a speed of rotation with {steps} steady stretches and no line: for operating "
                f"points of a machine set "
                'from = "steps"'
            )
        elif not whole:
            found = 'a speed of rotation and no line: for the energies of the whole record set from = "whole"'
    steady = sum(
        plateau.braking - plateau.begin for plateau in phased.plateaus if plateau is not None
    )
    if not found and steady < STEADY * sum(cycle.payout_end - cycle.onset for cycle in cycles):
        waves = find_waves(run.t, phased.v_smooth, phased.rig.thresholds.v_onset)
        if MANY_WAVES <= len(waves) <= 2 * len(cycles) and _like_waves(phased, waves):
            period = median(
                np.array([wave.haul_in[1] - wave.onset for wave in waves if wave.haul_in])
            )
            found = (
                f"a line that reciprocates without rests, in {len(waves)} waves of {period:.1f} "
                f"s: for the energies of whole "
                'waves and of the record set from = "waves"'
            )
    message = f"the log shows {found} under [phases] of a rig file"
    return [Finding("phase_source", message, "cycles are payouts")] if found else []


def _like_waves(phased: PhasedRun, waves: Sequence[Cycle]) -> bool:
    """Whether a motion of some waves hardly rests, and takes about as long in both directions."""
    halves = [
        (wave.payout_end - wave.onset, wave.haul_in[1] - wave.payout_end)
        for wave in waves
        if wave.haul_in
    ]
    if not halves:
        return False
    out, back = (median(np.array(half)) for half in zip(*halves, strict=True))
    rows = phased.rows(waves[0].onset, waves[-1].onset + out + back)
    still = np.mean(np.abs(phased.v_smooth[rows]) <= phased.rig.thresholds.v_onset)
    return bool(still <= RESTS) and max(out, back) <= ALIKE * min(out, back)
