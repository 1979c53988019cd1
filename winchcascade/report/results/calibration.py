"""What a calibration states: the numbers of the rig beside those of its file, what speaks
against them, its figures, and its JSON.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.campaign_file import origin_record
from winchcascade.core.store import fingerprint
from winchcascade.core.version import __version__
from winchcascade.diagnosis.fit.block_means import HAUL_IN, PAYOUT
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.handover.calibrate import (
    STRAINED,
    Calibration,
    FittedBlocks,
    Number,
    Strain,
)
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.report.content import (
    Column,
    Measured,
    Note,
    Picture,
    Report,
    Span,
    Tile,
    section,
    shown,
    table,
)
from winchcascade.report.figures.style import (
    COLOURS,
    LineStyle,
    dots,
    from_zero,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
    samples_entry,
)
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.wording import banner
from winchcascade.rig.backemf import BackEmf

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LAG_SIGNIFICANT = 3.0
"""Number of standard uncertainties from which a lag is reported."""

LAG_MIN = 5e-3
"""Lag up to which none is reported: a logger reads its channels one after the other. [s]"""

MISFIT_MAX = 1.5
"""Mean square of the misfit over its noise up to which the fit follows the log. That of noise alone
is 1, and scatters by less than 0.15 over the hundred blocks of a short log. [1]"""

WHAT = {
    "k_e": "back-EMF constant",
    "mu_screw": "friction of the screw",
    "b_rotor": "viscous loss of the high-speed shaft",
}
"""Numbers that a calibration can find."""

NUMBERS: tuple[Column[Number], ...] = (
    Column("number", lambda n: n.name),
    Column("rig file", lambda n: Measured(n.before, n.u)),
    Column("found", lambda n: Measured(n.value, n.u)),
    Column("u", lambda n: Measured(n.u, n.u), brief=False),
    Column("95 % interval", lambda n: Span(n.low, n.high, n.u)),
    Column("unit", lambda n: "" if n.unit == "1" else n.unit),
    Column("change", lambda n: _change(n), "%", signed=True),
    Column("found from", lambda n: n.how, brief=False),
)

STRAINS: tuple[Column[Strain], ...] = (
    Column("number or sensor", lambda strain: strain.name),
    Column("moved by", lambda strain: strain.by, "standard uncertainties", 0, signed=True),
)


def calibration_report(calibration: Calibration, *, command: str = "") -> Report:
    """Report of a calibration."""
    run, rig, against = calibration.run, calibration.rig, _against(calibration)
    outcome = Note(_outcome(calibration), "Outcome", "warn" if against else "good", brief=False)
    together = "; ".join(calibration.together)
    return Report(
        kind="Calibration of a rig in open circuit",
        title=f"{rig.name} calibrated by {run.name}",
        subtitle=f"open circuit ({run.load_source})",
        tiles=[_tile(n) for n in _found(calibration)],
        points=[data_note([run.origin]), outcome, *against, _advice(calibration)],
        sections=[
            section(
                "numbers", "Numbers",
                table("calibrated-numbers", "Calibrated numbers of the rig.", NUMBERS, calibration.numbers),
                Note(f"{together}: an open circuit cannot distinguish them.", "Together") if together else None,
            ),
            section("fit", "Fit", *_fit_pictures(calibration), Note(_regression(calibration), "Back-EMF")),
            section(
                "strained", "Priors that the fit exceeds",
                table("strained", "Moves beyond what is known.", STRAINS, calibration.strained, brief=False), folded=True,
            ),
            provenance(
                [
                    ("Log file", run.path),
                    ("Samples", f"{run.samples} at {run.fs:.6g} Hz in {len(calibration.payouts)} "
                                f"payouts"),
                    ("First stamp of the log", run.first_stamp),
                    ("SHA-256 of the log", run.sha256),
                    ("Table in the file", run.table),
                    ("Rig file", rig.path or rig.name),
                    ("SHA-256 of the rig file", fingerprint(rig.path)),
                ],
                command,
            ),
        ],
        verdict=outcome,
        banner=banner([run.origin]),
    )  # fmt: skip


def _change(number: Number) -> Measured | None:
    """By how much a number differs from that of the rig file, with the digits that its
    uncertainty allows. [%]
    """
    if not number.before:
        return None
    return Measured(
        100.0 * (number.value / number.before - 1.0), 100.0 * number.u / abs(number.before)
    )


def _found(calibration: Calibration) -> list[Number]:
    """Numbers that the log determines; k_e alone where the fit of the others did not converge."""
    return [n for n in calibration.numbers if n.new and (calibration.settled or n.name == "k_e")]


def _tile(n: Number) -> Tile:
    unit = "" if n.unit == "1" else f" {n.unit}"
    return Tile(
        n.name,
        WHAT[n.name],
        shown(Measured(n.value, n.u)) + unit,
        f"95 %: {shown(Span(n.low, n.high, n.u))}",
    )


def _names(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _outcome(calibration: Calibration) -> str:
    """Which numbers were found, and which of them differ from the rig file."""
    found = _found(calibration)
    agreeing = {n.name: _agrees(n) for n in found if math.isfinite(n.before)}
    differ, agree = (
        [name for name, agrees in agreeing.items() if agrees is wanted] for wanted in (False, True)
    )
    sentences = [f"{_names([n.name for n in found])} calibrated"]
    sentences += (
        [f"{_names(differ)} differ{'s' * (len(differ) == 1)} from the rig file"] if differ else []
    )
    sentences += (
        [f"{_names(agree)} agree{'s' * (len(agree) == 1)} with the rig file"] if agree else []
    )
    return f"{'; '.join(sentences)}."


def _agrees(n: Number) -> bool:
    """Whether a number is that of the rig file within the 95 % interval of their difference."""
    u_before = n.u_before if math.isfinite(n.u_before) else 0.0
    return abs(n.value - n.before) <= COVERED * math.hypot(n.u, u_before)


def _against(calibration: Calibration) -> list[Note]:
    """What speaks against the numbers: a lag of Vdc, a fit that does not follow the log, or does
    not come to rest.
    """
    r, strained = (
        calibration.regression,
        sorted(calibration.strained, key=lambda strain: -abs(strain.by)),
    )
    found = []
    if abs(r.lag) > max(LAG_SIGNIFICANT * r.u_lag, LAG_MIN):
        when, within = "late" if r.lag > 0 else "early", 1e3 * COVERED * r.u_lag
        found.append(
            f"Vdc is recorded {1e3 * abs(r.lag):.0f} ms {when}, 95 % within {within:.0f} ms."
        )
    if calibration.misfit > MISFIT_MAX:
        found.append(
            f"The log differs from the calibrated model by {math.sqrt(calibration.misfit):.1f} "
            f"times its noise."
        )
    if strained:
        most = _names([f"{strain.name} by {abs(strain.by):.0f}" for strain in strained[:3]])
        found.append(
            f"The fit moves priors by more than {STRAINED:g} standard uncertainties, above all "
            f"{most}."
        )
    if not calibration.settled:
        found.append("The fit did not converge, so viscous loss and friction are no result.")
    if calibration.run.findings:
        found.append(
            f"`winchcascade reduce` lists what is wrong with the log "
            f"({len(calibration.run.findings)})."
        )
    return [Note(text, "Finding", "warn") for text in found]


def _advice(calibration: Calibration) -> Note:
    """What to do next."""
    absorbed = _names([n.name for n in _found(calibration) if n.name != "k_e"]) or "the numbers"
    if not calibration.settled:
        return Note("Use a log with more payouts.", "Next")
    if calibration.misfit > MISFIT_MAX or calibration.strained:
        why = f"something else acts on this rig, and part of it may be contained in {absorbed}"
        return Note(f"`winchcascade diagnose` on the campaign finds the cause: {why}.", "Next")
    return Note(
        "`--write RIG.toml` writes a rig file with these numbers, `--rig` uses it.",
        "Next",
        brief=False,
    )


def _regression(calibration: Calibration) -> str:
    """The regression of the back-EMF, the parts of its uncertainty, and what Eq. 8 alone would
    give.
    """
    r = calibration.regression
    eq8 = shown(Measured(r.eq8, (r.high - r.k_e) / COVERED))
    return (
        f"{r.rpm.size} samples from {r.rpm.min():.0f} to {r.rpm.max():.0f} rpm; u of the fit "
        f"{100.0 * r.u_fit / r.k_e:.2f} %, of the gain of the Vdc sensor "
        f"{100.0 * r.u_sensor / r.k_e:.2f} %. Eq. 8 alone gives "
        f"{eq8} V/rpm ({100.0 * (r.eq8 / r.k_e - 1.0):+.1f} %): it leaves out the currents of "
        f"bleed resistor and capacitor."
    )


def _fit_pictures(calibration: Calibration) -> list[Picture]:
    """Viscous loss and screw by the blocks of the fit, and the regression of the back-EMF."""
    word, gas = calibration.run.origin.word, calibration.rig.restoring.has_gas
    over = (
        "gas pressure: screw friction makes that of payout and haul-in"
        if gas
        else "displacement in payout and haul-in"
    )
    return [
        Picture(
            "model-damper",
            "Block means of the log and of the fit. Torque in payout beyond that of a shaft "
            f"without the viscous loss, over generator speed. Line tension over {over}.",
            "Dots along a line through zero, and along the two branches of payout and haul-in.",
            partial(damper_and_screw, calibration.blocks, word=word),
        ),
        Picture(
            "model-emf",
            "Back-EMF over generator speed; the line has the slope k_e (Fig. 12 of Hsu et al. "
            "2026).",
            "Dots along a straight line through zero.",
            partial(
                back_emf_figure, calibration.regression, calibration.numbers[0].before, word=word
            ),
        ),
    ]


# --------------------------------------------------------------------------------------- the JSON
SCHEMA = "winchcascade/calibration/1"

NUMBER = (
    "section",
    "name",
    "unit",
    "before",
    "u_before",
    "value",
    "low",
    "high",
    "u",
    "how",
    "new",
)
"""Fields of a number; one that the rig file does not state is not finite, which JSON has as
null.
"""


def calibration_record(calibration: Calibration) -> dict[str, object]:
    """The calibration as nested records, numbers in their `unit`."""
    run, regression = calibration.run, calibration.regression
    return {
        "schema": SCHEMA,
        "version": __version__,
        "data": origin_record(run.origin),
        "log": {"path": run.path, "sha256": run.sha256, "samples": run.samples},
        "rig": calibration.rig.name,
        "numbers": [
            {name: getattr(number, name) for name in NUMBER} for number in calibration.numbers
        ],
        "regression": {
            **{name: getattr(regression, name) for name in ("k_e", "low", "high", "r2")},
            "samples": int(regression.rpm.size),
            "eq8": regression.eq8,
            "lag_s": regression.lag,
            "u_lag_s": regression.u_lag,
        },
        "together": list(calibration.together),
        "misfit": calibration.misfit,
        "settled": calibration.settled,
        "strained": [
            {"name": strain.name, "tolerances": strain.by} for strain in calibration.strained
        ],
    }


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
    """Draw the back-EMF of an open circuit over generator speed, with the line through zero
    (Fig. 12).

    Parameters
    ----------
    reference : back-EMF constant of the rig file, not finite where it has none [V/rpm]
    """
    figure, (ax,) = panel_figure(2.6)
    ends = np.array([0.0, 1.05 * float(fit.rpm.max())])
    rig: LineStyle = {"ls": (0, (5, 2)), "lw": 0.9}
    entries = [
        samples_entry(f"{word}, samples used", "ink"),
        line_entry("line through zero", "mech", lw=0.9),
    ]
    if np.isfinite(reference):
        ax.fill_between(
            ends, 0.9 * reference * ends, 1.1 * reference * ends, color=COLOURS["payout"], lw=0
        )
        ax.plot(ends, reference * ends, color=COLOURS["soft"], **rig)
        entries += [line_entry("rig file", "soft", **rig), patch_entry("rig file ± 10 %", "payout")]
    ax.plot(ends, fit.k_e * ends, color=COLOURS["mech"], lw=0.9)
    dots(ax, fit.rpm, fit.v_ll, COLOURS["ink"])
    from_zero(ax)
    ax.set(xlim=ends, xlabel=SPEED, ylabel="Back-EMF, line to line, rms (V)")
    legend_above(figure, entries)
    return figure
