"""What a calibration states: the numbers of the rig beside those of its file, what speaks
against them, and its JSON.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from winchcascade.core.campaign_file import origin_record
from winchcascade.core.store import fingerprint
from winchcascade.core.version import __version__
from winchcascade.diagnosis.handover.calibrate import STRAINED, Calibration, Number, Strain
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.report.content import (
    Block,
    Column,
    Measured,
    Note,
    Report,
    Span,
    Tile,
    picture,
    section,
    shown,
    table,
)
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.wording import banner

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
    Column("rig file", lambda n: Measured(n.before, n.u), own_digits=True),
    Column("found", lambda n: Measured(n.value, n.u), own_digits=True),
    Column("u", lambda n: Measured(n.u, n.u), own_digits=True, brief=False),
    Column("95 % interval", lambda n: Span(n.low, n.high, n.u), own_digits=True),
    Column("unit", lambda n: "" if n.unit == "1" else n.unit),
    Column("change", lambda n: _change(n), "%", signed=True, own_digits=True),
    Column("found from", lambda n: n.how, brief=False),
)

STRAINS: tuple[Column[Strain], ...] = (
    Column("number or sensor", lambda strain: strain.name),
    Column("moved by", lambda strain: strain.by, "standard uncertainties", 0, signed=True),
)


def calibration_report(
    calibration: Calibration, fit: Sequence[Block | None] = (), *, command: str = ""
) -> Report:
    """Report of a calibration.

    Parameters
    ----------
    fit : figures of the fits, as `fit_blocks` makes them
    """
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
            section("fit", "Fit", *fit, Note(_regression(calibration), "Back-EMF")),
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


def drawn_calibration(calibration: Calibration, *, command: str = "") -> Report:
    """Report of a calibration with its figures."""
    from winchcascade.report.figures.style import house_style

    with house_style():
        return calibration_report(calibration, fit_blocks(calibration), command=command)


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


def fit_blocks(calibration: Calibration) -> list[Block | None]:
    """Viscous loss and screw by the blocks of the fit, and the regression of the back-EMF. Called
    within the style of figures.
    """
    from winchcascade.report.figures.calibration_figures import back_emf_figure, damper_and_screw

    word, gas = calibration.run.origin.word, calibration.rig.restoring.has_gas
    over = (
        "gas pressure: screw friction makes that of payout and haul-in"
        if gas
        else "displacement in payout and haul-in"
    )
    return [
        picture(
            damper_and_screw(calibration.blocks, word=word), "model-damper",
            "Block means of the log and of the fit. Torque in payout beyond that of a shaft "
            "without the viscous loss, over "
            f"generator speed. Line tension over {over}.",
            "Dots along a line through zero, and along the two branches of payout and haul-in.",
        ),
        picture(
            back_emf_figure(calibration.regression, calibration.numbers[0].before, word=word), "model-emf",
            "DC voltage and back-EMF over generator speed; the line has the slope k_e (Fig. 12 of "
            "Hsu et al. 2026).",
            "Dots along a straight line through zero.",
        ),
    ]  # fmt: skip


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
