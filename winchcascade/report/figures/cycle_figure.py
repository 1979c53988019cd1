"""Time history of the cycle with the largest gap of a diagnosed campaign (Figs 11 and 12)."""

from __future__ import annotations

import numpy as np

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.simulated_cycle import SimulatedCycle
from winchcascade.report.diagnosis_names import NAMES, baseline_words
from winchcascade.report.figures.diagnosis_figures import AFTER, DASHES
from winchcascade.report.figures.histories import Curve, History, Mark, Panel, repaired_spans, thinned
from winchcascade.report.glossary import CHANNELS as TERMS
from winchcascade.report.glossary import typeset, upper


def cycle_history(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> History:
    """The channels of one cycle as logged, by the model of the rig file, and with the fitted effects, later ones above.

    Parameters
    ----------
    word : what the logs are called
    """
    run = found.data.logs[item.log].run
    here, count = [name for name in CHANNELS if name in run.channels], len(item.sides)
    full = [side[:, CHANNELS.index(name)] * TERMS[name].factor for name in here for side in item.sides]
    t, curves = thinned(item.t, full)
    looks = ((word, "ink", "-"), (baseline_words(found), "mech", DASHES), (AFTER, "gen", "-"))
    ends = [np.clip(span, t[0], t[-1]).tolist() for span in repaired_spans(run, CHANNELS, item.onset)]
    repaired = [(begin, end) for begin, end in ends if begin < end]
    panels = []
    for k, name in enumerate(here):
        drawn = zip(looks, curves[k * count : (k + 1) * count], strict=False)
        lines = [Curve(label, curve, colour, dashes) for (label, colour, dashes), curve in drawn]
        panels.append(Panel(upper(NAMES[name]), typeset(TERMS[name].unit), lines, repaired))
    return History(
        t, "Time since the onset of the payout (s)", panels, [Mark("payout", "payout", [(0.0, item.payout_end)])]
    )
