"""Time histories of the cycle with the largest gap of a diagnosed campaign (Figs 11 and 12), static and for a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.model_account import COMPARED
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.simulated_cycle import SimulatedCycle, largest_gap
from winchcascade.report.content import Picture
from winchcascade.report.diagnosis_figures import AFTER, DASHES
from winchcascade.report.digits import upper
from winchcascade.report.figures.histories import plain, repaired_spans, thinned
from winchcascade.report.figures.style import (
    COLOURS,
    LineStyle,
    Margins,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.gap_words import NAMES, baseline_words
from winchcascade.report.wording import load_words

PANEL = 1.15
"""Height of the panel of a channel with the space below it. [in]"""

LINES: tuple[tuple[str, LineStyle], ...] = (
    ("ink", {"lw": 0.8}),
    ("mech", {"lw": 1.0, "ls": DASHES}),
    ("gen", {"lw": 1.2}),
)
"""Colours and styles of what is logged, given, and with the fitted effects; later ones lie above."""


class Row(NamedTuple):
    """A channel of a cycle as it is drawn: its name, its unit, and its curves in that unit, (n,) each."""

    name: str
    unit: str
    curves: list[Signal]


def cycle_picture(found: ModelDiagnosis, word: str) -> Picture | None:
    """The cycle with the largest gap as a block; None where no run has a payout.

    Parameters
    ----------
    word : what the logs are called
    """
    item = largest_gap(found)
    if item is None:
        return None
    run = found.data.logs[item.log].run
    return Picture(
        "histories",
        f"Cycle {item.cycle} of {run.name} ({load_words(run.load, 'ohm')}), which has the largest gap, over the time since its "
        f"onset; the zeros of the sensors are taken off the {word}. Shaded: payout.",
        "Line plots of every channel over time; the values are in the log.",
        histories_figure(found, item, word),
        histories_json(found, item, word),
    )


def names_of(found: ModelDiagnosis, word: str) -> tuple[str, ...]:
    """Names of the curves of a channel."""
    return word, baseline_words(found), AFTER


def drawn(found: ModelDiagnosis, item: SimulatedCycle) -> tuple[Signal, list[Row]]:
    """Instants [s] and the channels of the run, thinned so that no peak is lost."""
    here = [name for name in CHANNELS if name in found.data.logs[item.log].run.channels]
    full = [side[:, CHANNELS.index(name)] * COMPARED[name][1] for name in here for side in item.sides]
    t, curves = thinned(item.t, full)
    count = len(item.sides)
    return t, [
        Row(upper(NAMES[name]), COMPARED[name][0], curves[k * count : (k + 1) * count]) for k, name in enumerate(here)
    ]


def spans_of(found: ModelDiagnosis, item: SimulatedCycle) -> Iterator[tuple[float, float, str]]:
    """The payout and what was repaired in any channel that is drawn: from when to when, and the colour. [s]"""
    yield 0.0, item.payout_end, "payout"
    for begin, end in repaired_spans(found.data.logs[item.log].run, CHANNELS):
        a, b = np.clip((begin - item.onset, end - item.onset), item.t[0], item.t[-1]).tolist()
        if a < b:
            yield a, b, "repaired"


def histories_json(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> str:
    """The cycle as `page.js` reads it, one plot for each channel."""
    t, rows = drawn(found, item)
    dashes = [{"dash": [6, 3]} if "ls" in style else {} for _, style in LINES]

    def series(row: Row) -> list[dict[str, object]]:
        names, colours = names_of(found, f"{row.name}, {word}"), (colour for colour, _ in LINES)
        return [
            {"label": name, "colour": colour, "values": plain(curve), **dash}
            for name, colour, dash, curve in zip(names, colours, dashes, row.curves, strict=False)
        ]

    record = {
        "t": plain(t),
        "rows": [{"label": row.unit, "series": series(row)} for row in rows],
        "spans": [{"from": a, "to": b, "colour": colour} for a, b, colour in spans_of(found, item)],
    }
    return msgspec.json.encode(record).decode()


def histories_figure(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> Figure:
    """Draw the channels of one cycle one below the other."""
    t, rows = drawn(found, item)
    figure, axes = panel_figure(
        0.75 + PANEL * len(rows), len(rows), margins=Margins(left=0.11), gaps={"hspace": 0.18}, share="x"
    )
    spans = list(spans_of(found, item))
    for ax, row in zip(axes, rows, strict=True):
        for begin, end, colour in spans:
            ax.axvspan(begin, end, color=COLOURS[colour], lw=0, zorder=0.1)
        for curve, (colour, style) in zip(row.curves, LINES, strict=False):
            ax.plot(t, curve, color=COLOURS[colour], **style)
        ax.set_ylabel(f"{row.name}\n({row.unit})")
        ax.margins(x=0.0)
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("Time since the onset of the payout (s)")
    lines = [
        line_entry(name, colour, **style) for name, (colour, style) in zip(names_of(found, word), LINES, strict=True)
    ]
    patches = {"payout": patch_entry("payout", "payout", lw=0), "repaired": patch_entry("repaired", "repaired", lw=0)}
    legend_above(
        figure, [*lines[: len(item.sides)], *(patches[colour] for colour in dict.fromkeys(s[2] for s in spans))]
    )
    return figure
