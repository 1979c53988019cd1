"""A calibration as text, as a record for JSON, and as a sheet for the files of a laboratory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from winchcascade.core.campaign_file import banner, origin_record
from winchcascade.core.plain_text import one_line
from winchcascade.core.quantity import KGF
from winchcascade.core.run import Signal
from winchcascade.core.version import __version__
from winchcascade.diagnosis.calibrate import Calibration, Number
from winchcascade.report import sheet as content
from winchcascade.report.digits import NumberText, number, places, significant, uncertain, upper
from winchcascade.report.screen import toned
from winchcascade.report.sheet import TableColumn
from winchcascade.report.text_table import data_lines, headed, indented, joined, table_lines, wrapped
from winchcascade.report.wording import page_text
from winchcascade.rig.backemf import RPM_MIN, BackEmf

CALIBRATION_SCHEMA = "winchcascade/calibration/1"

SURE = 3.0
"""Number of standard uncertainties from which a lag is reported."""

LATE = 5e-3
"""And only if it is longer than this: a logger reads its channels one after the other. [s]"""

BEYOND = 1.96
"""A number differs from that of the rig file if it is further away than this factor times the standard uncertainty of both."""

MISFIT = 1.5
"""What noise explains has a mean square of 1, which scatters by less than 0.15 over the hundred blocks of a short log."""

_HEAD = ("number", "before", "found", "95 % interval", "unit", "how")


def calibration_text(calibration: Calibration, written: Path | None = None) -> str:
    """Results of an open circuit: numbers of the rig, the regression of the back-EMF, findings.

    Parameters
    ----------
    written : the rig file that was made of it
    """
    run, rig = calibration.run, one_line(calibration.rig.name)
    found, many = findings(calibration), len(run.findings)
    kept = ", ".join(n.name for n in calibration.numbers if not n.new)
    return joined(
        [
            *wrapped(
                f"{one_line(run.name)}: open circuit ({one_line(run.load_source)}), {run.samples} samples at {run.fs:.6g} Hz; "
                f"rig {rig}"
            ),
            *data_lines([run.origin]),
            "",
            *table_lines([_HEAD, *(_row(n) for n in calibration.numbers)], left=(0, 4, 5), omit=("how", "before")),
            "",
            *wrapped(regression_words(calibration.regression)),
            *wrapped(eq8_words(calibration.regression, calibration)),
            *wrapped(together_words(calibration)),
            *wrapped(f"against rig {rig}: {comparison(calibration)}"),
            f"findings: {toned(f'{len(found)}', 'warning') if found else toned('none', 'good')}",
            *(line for text in found for line in headed(indented(text), text.split(":")[0], "warning")),
            *(wrapped(f"the log itself has {many}: `winchcascade reduce` lists what is wrong with it") if many else []),
            *([] if written is None else wrapped(f"rig file: {written}" + (f" ({kept} as before)" if kept else ""))),
        ]
    )


def calibration_record(calibration: Calibration) -> dict[str, Any]:
    """The calibration as nested records, schema `winchcascade/calibration/1`; numbers in their `unit`."""
    run, regression = calibration.run, calibration.regression
    return {
        "schema": CALIBRATION_SCHEMA,
        "version": __version__,
        "data": origin_record(run.origin),
        "log": {"path": run.path, "sha256": run.sha256, "samples": run.samples},
        "rig": calibration.rig.name,
        "numbers": [
            {
                "section": n.section,
                "name": n.name,
                "unit": n.unit,
                "before": n.before if math.isfinite(n.before) else None,
                "u_before": n.u_before if math.isfinite(n.u_before) else None,
                "value": n.value,
                "low": n.low,
                "high": n.high,
                "u": n.u,
                "how": n.how,
                "new": n.new,
            }
            for n in calibration.numbers
        ],
        "regression": {
            "k_e": regression.k_e,
            "low": regression.low,
            "high": regression.high,
            "r2": regression.r2,
            "samples": int(regression.rpm.size),
            "eq8": regression.eq8,
            "lag_s": regression.lag,
            "u_lag_s": regression.u_lag,
        },
        "together": list(calibration.together),
        "misfit": calibration.misfit,
        "settled": calibration.settled,
        "strained": [{"name": s.name, "tolerances": s.by} for s in calibration.strained],
    }


def _texts(n: Number) -> list[NumberText]:
    """A number before and as found, and the ends of its interval, with the digits that its uncertainty allows."""
    return [number(x, places(n.u) if n.u > 0.0 else 6) for x in (n.before, n.value, n.low, n.high)]


def _row(n: Number) -> tuple[str, ...]:
    """A number in the terminal."""
    before, value, low, high = _texts(n)
    return (n.name, before.replace("–", "-"), value, f"{low} to {high}", n.unit, n.how)


def regression_words(r: BackEmf) -> str:
    """The back-EMF constant by regression, with the parts of its uncertainty."""
    u = (r.high - r.k_e) / BEYOND
    k_e, low, high = (number(x, places(u)) for x in (r.k_e, r.low, r.high))
    return (
        f"back-EMF: {r.rpm.size} samples from {r.rpm.min():.0f} to {r.rpm.max():.0f} rpm, R2 = {r.r2:.5f}, "
        f"k_e = {k_e} V/rpm, 95 % from {low} to {high}; standard "
        f"uncertainty {100.0 * u / r.k_e:.2f} %, of which the fit {100.0 * r.u_fit / r.k_e:.2f} %, the gain of the Vdc sensor "
        f"{100.0 * r.u_sensor / r.k_e:.2f} %"
    )


def eq8_words(r: BackEmf, calibration: Calibration) -> str:
    """What the plain formula of the paper would give, and why that deviates."""
    bleed = calibration.rig.dc_link.r_bleed
    deviation = r.eq8 / r.k_e - 1.0
    draws = "" if bleed is None else f" of {bleed.value:g} ohm, {1e3 * r.vdc.max() / bleed.value:.0f} mA at most,"
    return (
        f"Eq. 8 alone would give {number(r.eq8, places((r.high - r.k_e) / BEYOND))} V/rpm, {100.0 * abs(deviation):.1f} % too "
        f"{'low' if deviation < 0 else 'high'}: it leaves out the current of the bleed{draws} and that of the "
        "charging capacitor, which both pass the bridge"
    )


def together_words(calibration: Calibration) -> str:
    """What the log cannot distinguish."""
    return f"cannot be distinguished here: {'; '.join(calibration.together) or 'nothing'}"


def comparison(calibration: Calibration) -> str:
    """How the numbers found compare with those of the rig file."""
    agree, differ = [], []
    for n in (n for n in calibration.numbers if n.new and math.isfinite(n.before)):
        z = (n.value - n.before) / math.hypot(n.u, n.u_before if math.isfinite(n.u_before) else 0.0)
        share = 100.0 * abs(n.value / n.before - 1.0) if n.before else math.nan
        beyond = (
            f"{n.name} is {significant(share, 2)} % {'above' if z > 0 else 'below'} it, {abs(z):.0f} standard uncertainties of "
            "both together"
        )
        agree += [n.name] if abs(z) <= BEYOND else []
        differ += [beyond] if abs(z) > BEYOND else []
    sentences = [f"{_and(agree)} agree{'s' if len(agree) == 1 else ''} within the tolerances"] if agree else []
    return "; ".join([*sentences, *differ]) or "nothing to compare"


def _and(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def findings(calibration: Calibration) -> list[str]:
    """A lag of Vdc that is significant, signs that something else acts on the rig, and a fit that did not come to rest."""
    r, found = calibration.regression, []
    names = [n.name for n in calibration.numbers if n.new and n.name != "k_e"]
    if calibration.misfit > MISFIT:
        found.append(
            f"fit: with the numbers found, force, torque and pressure still differ from the model by "
            f"{math.sqrt(calibration.misfit):.1f} times their noise"
        )
    if calibration.strained:
        strains = _and([f"{s.name} by {abs(s.by):.0f}" for s in calibration.strained])
        found.append(f"fit: it moves {strains} of their tolerances")
    if found:
        inside = _and(names or ["the numbers"])
        found[-1] += (
            f"; something else acts on this rig, and part of it may be contained in {inside}: `winchcascade diagnose` "
            "finds what it is"
        )
    if abs(r.lag) > max(SURE * r.u_lag, LATE):
        when = "late" if r.lag > 0 else "early"
        within = f"95 % within {1e3 * BEYOND * r.u_lag:.0f} ms"
        found.insert(0, f"lag: Vdc is recorded {1e3 * abs(r.lag):.0f} ms {when} ({within})")
    if not calibration.settled:
        others = _and(names or ["other numbers than k_e"])
        found.append(f"fit: it did not converge, so {others} are no result; use a log with more payouts")
    return found


METHOD = (
    content.Note(
        "The back-EMF constant is the slope of a line through zero: back-EMF, line to line, rms, over the speed of the "
        f"generator above {RPM_MIN:g} rpm, in payouts without their braking. The back-EMF follows from the DC voltage; the "
        "two conducting diodes, commutation, and the currents of bleed resistor and charging capacitor are included. A lag of "
        "Vdc is fitted beside the slope. The uncertainty combines that of the fit and that of the gain of the Vdc sensor.",
        "Back-EMF constant",
    ),
    content.Note(
        "The other numbers follow from a least-squares fit of the model of the rig to means of line tension, torque and "
        "pressure in blocks of about 0.44 s. Everything else that is known to a tolerance is fitted with them: precharge, gas "
        "volume, piston area, gains and zeros of the sensors. The uncertainties include these tolerances.",
        "Damper and screw friction",
    ),
    content.Note(
        "Intervals have a level of 95 % and a coverage factor of 1.96. A number that the log determines no better than the "
        "rig file stays as it was.",
        "Intervals",
    ),
)
"""How the numbers are found."""


def calibration_report(calibration: Calibration, *, command: str = "") -> content.Report:
    """Make the rows and figures of the sheet of a calibration."""
    from winchcascade.report.style import house_style

    run, rig = calibration.run, calibration.rig
    found, new = findings(calibration), [n for n in calibration.numbers if n.new]
    with house_style():
        fit = _fit(calibration)
    return content.Report(
        kind="Calibration of a rig in open circuit",
        title=rig.name,
        subtitle=" · ".join(part for part in (rig.title, f"log {run.name}", run.about) if part),
        tiles=tuple(_tile(n) for n in calibration.numbers if n.new),
        points=(
            content.data_point([run.origin]),
            content.Point(
                "Calibrated", f"{', '.join(n.name for n in new) or 'no number'} of rig {rig.name}, from log {run.name}."
            ),
            content.Point("Against the rig file", f"{page_text(comparison(calibration))}."),
            *(content.Point("Finding", f"{upper(page_text(text))}.", "warn") for text in found),
            *([] if found else [content.Point("Findings", "None.", "good")]),
        ),
        sections=(
            content.section("results", "Results", _NUMBERS.of(calibration.numbers), _note(together_words(calibration))),
            fit,
            content.section("conditions", "Conditions", _conditions(calibration)),
            content.section("method", "Method", *METHOD),
            content.section("findings", "Findings", _findings(calibration)),
            content.provenance_section(
                [
                    ("Log file", run.path),
                    ("SHA-256 of the log", run.sha256),
                    ("Table in the file", run.table or ""),
                    ("Rig file", rig.path or rig.name),
                    ("SHA-256 of the rig file", content.file_digest(rig.path)),
                ],
                command,
            ),
        ),
        banner=banner([run.origin]),
    )


def _note(text: str) -> content.Note:
    return content.Note(f"{upper(page_text(text))}.")


def _tile(n: Number) -> content.Tile:
    _, value, low, high = _texts(n)
    unit = "" if n.unit == "1" else f" {page_text(n.unit)}"
    return content.Tile(n.name, n.section, f"{value}{unit}", f"95 %: {low} to {high}{unit}")


_NUMBERS = content.ItemTable[Number](
    "calibrated-numbers",
    "Calibrated numbers of the rig.",
    [
        TableColumn("Number", text=True, of=lambda n: f"{n.section}.{n.name}"),
        TableColumn("Rig file", of=lambda n: _texts(n)[0]),
        TableColumn("Found", of=lambda n: _texts(n)[1]),
        TableColumn("Standard uncertainty", of=lambda n: uncertain(n.u)),
        TableColumn("95 % interval, from", of=lambda n: _texts(n)[2]),
        TableColumn("to", of=lambda n: _texts(n)[3]),
        TableColumn("Unit", text=True, of=lambda n: page_text(n.unit)),
        TableColumn("State", text=True, of=lambda n: "calibrated" if n.new else "as before"),
        TableColumn("Method", text=True, of=lambda n: page_text(n.how)),
    ],
)


def _fit(calibration: Calibration) -> content.Section:
    """The regression of the back-EMF in words and as a figure."""
    from winchcascade.report.model_account import Regression
    from winchcascade.report.model_figures import back_emf_figure

    fit, before = calibration.regression, calibration.numbers[0].before
    drawn = Regression(
        rpm=tuple(fit.rpm.tolist()), v_ll=tuple(fit.v_ll.tolist()), v_dc=tuple(fit.vdc.tolist()),
        slope=fit.k_e, low=fit.low, high=fit.high, r2=fit.r2, points=fit.rpm.size, reference=before,
    )  # fmt: skip
    word = "simulated log" if calibration.run.simulated else "log"
    return content.section(
        "fit", "Fit",
        content.picture(
            back_emf_figure(drawn, word=word), "model-emf",
            "DC voltage and back-EMF over the speed of the generator, with the line through zero whose slope is the back-EMF "
            "constant.",
            f"Dots along a straight line through zero; its slope is {significant(fit.k_e, 5)} V/rpm.",
        ),
        _note(regression_words(fit)),
        _note(eq8_words(fit, calibration)),
        content.Note(
            f"With the numbers found, force, torque and pressure differ from the model by "
            f"{significant(math.sqrt(calibration.misfit), 2)} times their noise (root mean square)."
        ),
    )  # fmt: skip


def _conditions(calibration: Calibration) -> content.Table:
    """The run that was used, and the ranges within which the numbers were found."""
    run, fit = calibration.run, calibration.regression
    return content.pairs_table(
        "conditions",
        "Conditions of the calibration.",
        [
            ("Log", run.name),
            ("Date of the log (first stamp)", run.first_stamp or "not in the log"),
            ("Load", f"open circuit ({run.load_source})"),
            ("Samples", f"{run.samples} at {run.fs:.6g} Hz, {run.t[-1] - run.t[0]:.1f} s"),
            ("Samples of the regression", f"{fit.rpm.size}"),
            ("Generator speed of the regression", f"{fit.rpm.min():.0f} to {fit.rpm.max():.0f} rpm"),
            ("DC voltage of the regression", f"{fit.vdc.min():.1f} to {fit.vdc.max():.1f} V"),
            *(
                (title, f"{_range(run.channels[name] * factor)} {unit}")
                for name, title, factor, unit in (
                    ("velocity", "Line velocity", 1.0, "m/s"),
                    ("force", "Line tension", 1.0, "N"),
                    ("pressure", "Accumulator pressure, gauge", 1.0 / (KGF * 1e4), "kg/cm²"),
                )
                if name in run.channels
            ),
            ("Temperature", "not recorded"),
        ],
    )


def _range(x: Signal) -> str:
    """Smallest and largest value of a channel, with the decimals of three digits of the larger one."""
    size = float(np.abs(x).max())
    decimals = max(2 - math.floor(math.log10(size)), 0) if size > 0.0 else 0
    return f"{number(float(x.min()), decimals)} to {number(float(x.max()), decimals)}"


def _findings(calibration: Calibration) -> content.Table | content.Note:
    """What speaks against the numbers, and what is wrong with the log."""
    rows = [("calibration", page_text(text)) for text in findings(calibration)]
    rows += [(f"log, {f.kind.replace('_', ' ')}", f"{f.message}; {f.action}") for f in calibration.run.findings]
    caption = "Findings about the calibration and about the log."
    none = content.Note("Nothing speaks against the numbers, and no fault was found in the log.")
    return content.pairs_table("findings", caption, rows, ("Of", "What was found")) if rows else none
