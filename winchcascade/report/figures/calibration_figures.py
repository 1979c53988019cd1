"""Figures of a calibration: viscous loss and screw by the blocks of the fit, and the regression of
the back-EMF (Fig. 12).
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from winchcascade.diagnosis.fit.block_means import HAUL_IN, PAYOUT
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.handover.calibrate import FittedBlocks
from winchcascade.report.figures.style import (
    COLOURS,
    LineStyle,
    dots,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
    samples_entry,
)
from winchcascade.rig.backemf import BackEmf

SPEED = "Generator speed (rpm)"

KGF_PER_CM2 = 1.0 / 98066.5
"""From Pa to kg/cm2."""


def damper_and_screw(blocks: FittedBlocks, *, word: str) -> Figure:
    """Draw the torque of the viscous loss over generator speed, and line tension over gas pressure,
    without gas over displacement.
    """
    figure, (left, right) = panel_figure(2.8, 1, 2)
    force, torque, pressure = (CHANNELS.index(name) for name in ("force", "torque", "pressure"))
    out = np.flatnonzero(blocks.phase == PAYOUT)[np.argsort(blocks.rpm[blocks.phase == PAYOUT])]
    taken = blocks.measured[:, torque] - (blocks.fitted[:, torque] - blocks.damper)
    dots(left, blocks.rpm[out], taken[out], COLOURS["ink"])
    left.plot(blocks.rpm[out], blocks.damper[out], color=COLOURS["mech"], lw=0.9)
    label_panel(left, "a", "Torque of the viscous loss, at the PTO shaft", x=SPEED, unit="N·m")
    marks: LineStyle = {"ls": "none", "marker": ".", "ms": 3.0, "mew": 0.0}
    moving = np.isin(blocks.phase, (PAYOUT, HAUL_IN))
    over, label = blocks.fitted[:, pressure] * KGF_PER_CM2, "Gas pressure, gauge (kg/cm²)"
    if blocks.displacement is not None:
        over, label = blocks.displacement, "Line displacement (m)"
    dots(right, over[moving], blocks.measured[moving, force], COLOURS["ink"])
    for phase, colour in ((PAYOUT, "mech"), (HAUL_IN, "gen")):
        here = blocks.phase == phase
        right.plot(over[here], blocks.fitted[here, force], color=COLOURS[colour], **marks)
    label_panel(right, "b", "Line tension", x=label, unit="N")
    names = {"fitted, payout": "mech", "fitted, haul-in": "gen"}
    legend_above(
        figure,
        [samples_entry(word, "ink"), *(line_entry(name, c, **marks) for name, c in names.items())],
    )
    return figure


def back_emf_figure(fit: BackEmf, reference: float, *, word: str) -> Figure:
    """Draw the DC voltage and the back-EMF of an open circuit over generator speed, with the line
    through zero (Fig. 12).

    Parameters
    ----------
    reference : back-EMF constant of the rig file, not finite where it has none [V/rpm]
    """
    figure, (left, right) = panel_figure(2.6, 1, 2)
    ends = np.array([0.0, 1.05 * float(fit.rpm.max())])
    rig: LineStyle = {"ls": (0, (5, 2)), "lw": 0.9}
    stated = []
    if np.isfinite(reference):
        right.fill_between(
            ends, 0.9 * reference * ends, 1.1 * reference * ends, color=COLOURS["payout"], lw=0
        )
        right.plot(ends, reference * ends, color=COLOURS["soft"], **rig)
        stated = [line_entry("rig file", "soft", **rig), patch_entry("rig file ± 10 %", "payout")]
    right.plot(ends, fit.k_e * ends, color=COLOURS["mech"], lw=0.9)
    titles = ("Voltage of the DC link", "Back-EMF, line to line, rms")
    for ax, letter, title, volt in zip(
        (left, right), "ab", titles, (fit.vdc, fit.v_ll), strict=True
    ):
        dots(ax, fit.rpm, volt, COLOURS["ink"])
        ax.set(xlim=ends, ylim=(0.0, None))
        label_panel(ax, letter, title, x=SPEED, unit="V")
    own = [
        samples_entry(f"{word}, samples used", "ink"),
        line_entry("line through zero", "mech", lw=0.9),
    ]
    legend_above(figure, [*own, *stated])
    return figure
