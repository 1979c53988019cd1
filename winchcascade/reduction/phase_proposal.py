"""Which source of cycles fits a log in which none, or none of the paper's crane, was found: a sentence about it."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from winchcascade.core.integrate import largest, median
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
        return (
            f'{run.name}: no cycle found by "{rig.phases.source}" under [phases] of the rig {rig.name}. Check its thresholds '
            f'({_thresholds(rig.phases)}), or choose another one, such as from = "whole".'
        )
    limits, motion = rig.thresholds, smoothed_motion(run, rig)
    expected = f"expected the line to pay out more than {limits.stroke_min:g} m at more than {limits.v_onset:g} m/s"
    if "velocity" not in run.channels:
        expected = "expected the line to pay out, and the log has no velocity of the line"
    return f"{run.name}: no payout found; {expected}. {_proposal(run, rig, motion)} under [phases] of a rig file."


def _thresholds(rule: PhaseRule) -> str:
    """Settings that decide whether a source finds a cycle."""
    return {
        "waves": "a wave goes beyond v_onset under [thresholds] both ways, or beyond rpm_onset of a shaft",
        "steps": "speed_band, torque_band, step_min_s and settle_s",
        "column": f"no sample of the column {rule.column!r} has a value of payout = {list(rule.payout)}",
    }.get(rule.source, "none")


def _proposal(run: Run, rig: Rig, motion: Motion | None) -> str:
    """The fitting setting with its reason; the columns to check where the line moves and nothing else fits."""
    if run.samples <= FEW_ROWS and any(f.kind == "backward_stamp" for f in run.findings):
        return f'The stamps of its {run.samples} rows are out of order: for rows that are step means, set from = "rows"'
    labels = [name for finding in run.findings for name in finding.columns if _LABELS.fullmatch(name)]
    if labels:
        return (
            f'The column {labels[0]!r} may label the phases: set from = "column", column = "{labels[0]}" and the values of '
            "payout and haul_in"
        )
    if motion is None or largest(motion.v_smooth) <= motion.thresholds.v_onset:
        return 'The log shows no motion: for the energies of the whole record, set from = "whole"'
    waves = find_waves(run.t, motion.v_smooth, motion.thresholds.v_onset)
    back, ahead = -float(np.min(motion.v_smooth)), float(np.max(motion.v_smooth))
    if len(waves) >= FEW_WAVES and min(back, ahead) > RECIPROCATES * max(back, ahead):
        return f'The motion reciprocates about zero: for its {len(waves)} waves, set from = "waves"'
    steps = _steps(run, rig)
    if steps:
        return f'The speed has {steps} steady stretches: for operating points, set from = "steps"'
    if "speed" in run.channels:
        return 'The shaft turns without steady stretches: check the speed column, or set from = "whole" or "speed"'
    return "Check name, unit and sign of the velocity column, or name another source"


def _steps(run: Run, rig: Rig) -> int:
    """Number of the steady stretches of a shaft."""
    return len(find_steps(run, rig.phases, rig.thresholds.gap_max)) if "speed" in run.channels else 0


def other_source(phased: PhasedRun, results: Sequence[CycleResult]) -> list[Finding]:
    """Report a log whose motion is none of a crane, where the rig file leaves the source of cycles open.

    That is a shaft of whose line the log shows nothing, or a motion that reciprocates without rests. Payout and haul-in of a
    winch are steady stretches too, two of each cycle; of a kite that reels in and out while it pays out, most waves are no
    payouts.
    """
    run, rig = phased.run, phased.rig
    if rig.phases != PhaseRule() or not phased.cycles:
        return []
    found = ""
    derived = any(f.kind == "derived_channel" and f.channel == "velocity" for f in run.findings)
    if derived and run.channels.keys().isdisjoint({"displacement", "force", "pressure"}):
        steps, whole = _steps(run, rig), any(result.complete for result in results)
        if steps > 2 * len(results) or (steps and not whole):
            found = (
                f"a speed of rotation with {steps} steady stretches and no line: for operating points of a machine set "
                'from = "steps"'
            )
        elif not whole:
            found = 'a speed of rotation and no line: for the energies of the whole record set from = "whole"'
    v, onset = phased.v_smooth, rig.thresholds.v_onset
    waves = np.array([(wave.onset, wave.haul_in[1]) for wave in find_waves(run.t, v, onset) if wave.haul_in])
    if not found and MANY_WAVES <= len(waves) <= 2 * len(phased.cycles):
        period = median(waves[:, 1] - waves[:, 0])
        between = v[slice(*np.searchsorted(run.t, (waves[0, 0], waves[-1, 1])).tolist())]
        if period <= SEA_PERIOD and np.mean((between < onset) & (between > -onset)) <= RESTS:
            found = (
                f"a line that reciprocates without rests, in {len(waves)} waves of {period:.1f} s: for the energies of whole "
                'waves and of the record set from = "waves"'
            )
    message = f"the log shows {found} under [phases] of a rig file"
    return [Finding("phase_source", message, "cycles are payouts")] if found else []
