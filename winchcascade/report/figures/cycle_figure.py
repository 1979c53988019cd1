"""Time histories of the cycle with the largest gap of a diagnosed campaign (Figs 11 and 12), static and for a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.simulated_cycle import SimulatedCycle
from winchcascade.report.diagnosis_names import NAMES, baseline_words
from winchcascade.report.figures.diagnosis_figures import AFTER, DASHES, quantity_label
from winchcascade.report.figures.histories import plain, repaired_spans, thinned
from winchcascade.report.figures.style import (
    COLOURS,
    LineStyle,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.glossary import CHANNELS as TERMS
from winchcascade.report.glossary import typeset, upper

LINES: tuple[tuple[str, LineStyle], ...] = (
    ("ink", {"lw": 0.8}),
    ("mech", {"lw": 1.0, "ls": DASHES}),
    ("gen", {"lw": 1.2}),
)
"""Colours and styles of what is logged, given, and with the fitted effects; later ones lie above."""


class ChannelCurves(NamedTuple):
    """A channel of a cycle and its curves in the unit in which it is shown, (n,) each: logged, given and with the effects."""

    channel: str
    curves: list[Signal]


def cycle_figure(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> Figure:
    """Draw the channels of one cycle one below the other.

    Parameters
    ----------
    word : what the logs are called
    """
    t, rows = _drawn(found, item)
    spans = list(_spans(found, item))
    figure, axes = panel_figure(0.6 + 1.05 * len(rows), len(rows), share="x")
    for ax, row in zip(axes, rows, strict=True):
        for begin, end, colour in spans:
            ax.axvspan(begin, end, color=COLOURS[colour], lw=0, zorder=0.1)
        for curve, (colour, style) in zip(row.curves, LINES, strict=False):
            ax.plot(t, curve, color=COLOURS[colour], **style)
        ax.set_ylabel(quantity_label(row.channel).replace(" (", "\n("))
        ax.margins(x=0.0)
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("Time since the onset of the payout (s)")
    names = (word, baseline_words(found), AFTER)[: len(item.sides)]
    lines = [line_entry(name, colour, **style) for name, (colour, style) in zip(names, LINES, strict=False)]
    legend_above(
        figure, [*lines, *(patch_entry(colour, colour, lw=0) for colour in dict.fromkeys(s[2] for s in spans))]
    )
    return figure


def cycle_json(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> str:
    """The cycle as `page.js` reads it, one plot for each channel."""
    t, rows = _drawn(found, item)
    names = (word, baseline_words(found), AFTER)

    def curves(row: ChannelCurves) -> list[dict[str, object]]:
        quantity = upper(NAMES[row.channel])
        return [
            {"label": name, "colour": colour, "values": plain(curve), **({"dash": [6, 3]} if "ls" in style else {})}
            for name, (colour, style), curve in zip(
                (f"{quantity}, {word}", *names[1:]), LINES, row.curves, strict=False
            )
        ]

    record = {
        "t": plain(t),
        "rows": [{"label": typeset(TERMS[row.channel].unit), "series": curves(row)} for row in rows],
        "spans": [{"from": a, "to": b, "colour": colour} for a, b, colour in _spans(found, item)],
    }
    return msgspec.json.encode(record).decode()


def _drawn(found: ModelDiagnosis, item: SimulatedCycle) -> tuple[Signal, list[ChannelCurves]]:
    """Instants [s] and the channels of the run, thinned so that no peak is lost."""
    here = [name for name in CHANNELS if name in found.data.logs[item.log].run.channels]
    full = [side[:, CHANNELS.index(name)] * TERMS[name].factor for name in here for side in item.sides]
    t, curves = thinned(item.t, full)
    count = len(item.sides)
    return t, [ChannelCurves(name, curves[k * count : (k + 1) * count]) for k, name in enumerate(here)]


def _spans(found: ModelDiagnosis, item: SimulatedCycle) -> Iterator[tuple[float, float, str]]:
    """The payout and what was repaired in any channel that is drawn: from when to when, and the colour. [s]"""
    yield 0.0, item.payout_end, "payout"
    for begin, end in repaired_spans(found.data.logs[item.log].run, CHANNELS):
        a, b = np.clip((begin - item.onset, end - item.onset), item.t[0], item.t[-1]).tolist()
        if a < b:
            yield a, b, "repaired"
