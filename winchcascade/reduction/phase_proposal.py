"""Which source of cycles fits a log in which none, or none of the paper's crane, was found: a sentence about it."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from winchcascade.core.integrate import median
from winchcascade.core.rig_file import PhaseRule, Rig
from winchcascade.core.run import Finding, Run
from winchcascade.reduction.phase_sources import Motion, find_steps, find_waves, smoothed_motion
from winchcascade.reduction.phased_run import PhasedRun
from winchcascade.reduction.reduction_result import CycleResult

FEW_WAVES = 2
"""Smallest number of waves that shows a reciprocating motion."""

MANY_WAVES = 5
"""Smallest number of waves of a log whose payouts were found, that shows a sea and no crane."""

RECIPROCATES = 0.2
"""Smallest share of the top speed that a reciprocating motion reaches in the other direction. [1]"""

FEW_ROWS = 500
"""Largest number of rows of a table of step means."""

SEA_PERIOD = 30.0
"""Median period up to which a motion without rests is that of waves: swell has 20 s at most, a crane needs more. [s]"""

RESTS = 0.25
"""Largest share of the time for which such a motion is slower than the onset: a crane rests for longer. [1]"""

_LABELS = re.compile(
    r"(?:.*[\W_])?(?:phase|phasen|label|state|status|mode|modus|stage|segment|etat|état|fase|estado|阶段|階段|フェーズ)\d*",
    re.IGNORECASE,
)
"""Names of columns that may label the phases."""


def no_cycles(run: Run, rig: Rig) -> str:
    """Message about a log without a cycle: what was expected, and the setting under [phases] that fits the log."""
    if not rig.phases.by_motion:
        found = f'no cycle found by "{rig.phases.source}" under [phases] of the rig {rig.name}'
        return f"{run.name}: {found}. {_loosen(rig.phases)}"
    limits, motion = rig.thresholds, smoothed_motion(run, rig)
    expected = (
        "the motion of the line or the shaft is unknown"
        if motion is None
        else f"expected the line to pay out more than {limits.stroke_min:g} m at more than {limits.v_onset:g} m/s"
        if "velocity" in run.channels
        else "expected the line to pay out, and the log has no velocity of the line"
    )
    return f"{run.name}: no payout found; {expected}. {_proposal(run, rig, motion)}"


def other_source(phased: PhasedRun, results: Sequence[CycleResult]) -> list[Finding]:
    """Report a log whose motion is none of a crane, where the rig file leaves the source of cycles open."""
    run, rig = phased.run, phased.rig
    if rig.phases != PhaseRule() or not phased.cycles:
        return []
    what = _turning(run, rig, results) or _reciprocating(phased)
    return [Finding("phase_source", f"{what} under [phases] of a rig file", "cycles are payouts")] if what else []


def _turning(run: Run, rig: Rig, results: Sequence[CycleResult]) -> str:
    """What a shaft does of whose line the log shows nothing, and the source of cycles for it; empty for a winch.

    Payout and haul-in of a winch are steady stretches too, two of each cycle.
    """
    derived = any(f.kind == "derived_channel" and f.channel == "velocity" for f in run.findings)
    if not derived or "speed" not in run.channels or {"displacement", "force", "pressure"} & run.channels.keys():
        return ""
    steps = find_steps(run, replace(rig.phases, source="steps"), rig.thresholds.gap_max)
    shaft = "the log shows a speed of rotation and no line"
    whole = any(result.complete for result in results)
    if steps and (len(steps) > 2 * len(results) or not whole):
        plural = "es" if len(steps) > 1 else ""
        return (
            f'{shaft}, with {len(steps)} steady stretch{plural}: for operating points of a machine set from = "steps"'
        )
    return "" if whole else f'{shaft}: for the energies of the whole record set from = "whole"'


def _reciprocating(phased: PhasedRun) -> str:
    """How a motion reciprocates without rests, and the source of cycles for it; empty for another motion.

    Of a kite that reels in and out while it pays out, most waves are no payouts.
    """
    run, v_smooth, v_onset = phased.run, phased.v_smooth, phased.rig.thresholds.v_onset
    waves = find_waves(run.t, v_smooth, v_onset)
    if len(waves) < MANY_WAVES or 2 * len(phased.cycles) < len(waves):
        return ""
    ends = np.array([(wave.onset, wave.haul_in[1]) for wave in waves if wave.haul_in is not None])
    period = median(ends[:, 1] - ends[:, 0])
    first, last = np.searchsorted(run.t, (ends[0, 0], ends[-1, 1]))
    between = v_smooth[first:last]
    resting = np.count_nonzero((between < v_onset) & (between > -v_onset)) / between.size
    if period > SEA_PERIOD or resting > RESTS:
        return ""
    return (
        f"the line reciprocates without rests, in {len(waves)} waves of {period:.1f} s: for the energies of whole waves and of "
        'the record set from = "waves"'
    )


def _loosen(rule: PhaseRule) -> str:
    """What to change of a source that finds nothing."""
    return {
        "waves": "A wave goes beyond the onset speed both ways; check v_onset under [thresholds], or rpm_onset for a shaft.",
        "steps": "Check speed_band, torque_band, step_min_s and settle_s.",
        "column": f"No sample of the column {rule.column!r} has a value of payout = {list(rule.payout)}; check both.",
    }.get(rule.source, 'Choose another source, such as from = "whole".')


def _proposal(run: Run, rig: Rig, motion: Motion | None) -> str:
    """The fitting setting with its reason; the columns to check where the line moves and nothing else fits."""
    setting = "under [phases] of a rig file"
    if run.samples <= FEW_ROWS and any(f.kind == "backward_stamp" for f in run.findings):
        rows = f"The stamps of its {run.samples} rows are out of order"
        return f'{rows}: for rows that are step means, set from = "rows" {setting}.'
    labels = [name for finding in run.findings for name in finding.columns if _LABELS.fullmatch(name)]
    if labels:
        return (
            f'The column {labels[0]!r} may label the phases: set from = "column", column = "{labels[0]}" and the values of '
            "payout and haul_in under [phases] of a rig file."
        )
    if motion is None:
        return (
            f'For the energies of the whole record, set from = "whole" {setting}; else name the column of the motion.'
        )
    if float(np.max(np.abs(motion.v_smooth))) <= motion.thresholds.v_onset:
        return f'The log shows no motion: for the energies of the whole record, set from = "whole" {setting}.'
    waves = find_waves(run.t, motion.v_smooth, motion.thresholds.v_onset)
    back, ahead = -float(np.min(motion.v_smooth)), float(np.max(motion.v_smooth))
    if len(waves) >= FEW_WAVES and min(back, ahead) > RECIPROCATES * max(back, ahead):
        return f'The motion reciprocates about zero: for its {len(waves)} waves, set from = "waves" {setting}.'
    if "speed" in run.channels:
        steps = find_steps(run, replace(rig.phases, source="steps"), rig.thresholds.gap_max)
        if steps:
            return f'The speed has {len(steps)} steady stretches: for operating points, set from = "steps" {setting}.'
        return f'The shaft turns without steady stretches: set from = "whole" or "speed" {setting}, or check the speed column.'
    return "Check name, unit and sign of the velocity column."
