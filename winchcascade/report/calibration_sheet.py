"""The sheet of a calibration for the files of a laboratory: what was calibrated, from what, the results, how, and findings."""

from __future__ import annotations

import math

import numpy as np

from winchcascade.core.campaign_file import banner
from winchcascade.core.quantity import KGF
from winchcascade.core.run import Signal
from winchcascade.diagnosis.calibrate import Calibration, Number
from winchcascade.report import calibration_text as words
from winchcascade.report.digits import number, places, significant, uncertain, upper
from winchcascade.report.model_account import Regression
from winchcascade.report.model_figures import back_emf_figure
from winchcascade.report.provenance import data_point, file_digest, provenance_table
from winchcascade.report.report_model import Note, Point, Report, Section, Tile, picture, section
from winchcascade.report.style import house_style
from winchcascade.report.table_model import Table, TableColumn, items_table, make_table, text_column
from winchcascade.report.typesetting import page_text
from winchcascade.rig.backemf import RPM_LEAST

METHOD = (
    Note(
        "The back-EMF constant is the slope of a line through zero: back-EMF, line to line, rms, over the speed of the "
        f"generator above {RPM_LEAST:g} rpm, in payouts without their braking. The back-EMF follows from the DC voltage; the "
        "two conducting diodes, commutation, and the currents of bleed resistor and charging capacitor are included. A lag of "
        "Vdc is fitted beside the slope. The uncertainty combines that of the fit and that of the gain of the Vdc sensor.",
        "Back-EMF constant",
    ),
    Note(
        "The other numbers follow from a least-squares fit of the model of the rig to means of line tension, torque and "
        "pressure in blocks of about 0.44 s. Everything else that is known to a tolerance is fitted with them: precharge, gas "
        "volume, piston area, gains and zeros of the sensors. The uncertainties include these tolerances.",
        "Damper and screw friction",
    ),
    Note(
        "Intervals have a level of 95 % and a coverage factor of 1.96. A number that the log determines no better than the "
        "rig file stays as it was.",
        "Intervals",
    ),
)
"""How the numbers are found."""


def calibration_report(calibration: Calibration, *, command: str = "") -> Report:
    """Make the rows and figures of the sheet of a calibration."""
    run, rig = calibration.run, calibration.rig
    with house_style():
        sections = (
            section("results", "Results", _numbers(calibration), _note(words.together_words(calibration))),
            _fit(calibration),
            section("conditions", "Conditions", _conditions(calibration)),
            section("method", "Method", *METHOD),
            section("findings", "Findings", _findings(calibration)),
            section("provenance", "Provenance", _provenance(calibration, command)),
        )
    return Report(
        kind="Calibration of a rig in open circuit",
        title=rig.name,
        subtitle=" · ".join(part for part in (rig.title, f"log {run.name}", run.about) if part),
        tiles=tuple(_tile(n) for n in calibration.numbers if n.new)[:3],
        points=_points(calibration),
        sections=sections,
        banner=banner([run.origin]),
    )


def _note(text: str) -> Note:
    return Note(f"{upper(page_text(text))}.")


def _tile(n: Number) -> Tile:
    decimals = places(n.u) if n.u > 0.0 else 6
    low, high = (number(x, decimals) for x in (n.low, n.high))
    unit = "" if n.unit == "1" else f" {page_text(n.unit)}"
    return Tile(n.name, n.section, f"{number(n.value, decimals)}{unit}", f"95 %: {low} to {high}{unit}")


def _points(calibration: Calibration) -> tuple[Point, ...]:
    """What was calibrated, how it compares with the rig file, and whether anything speaks against it."""
    found = words.findings(calibration)
    new = ", ".join(n.name for n in calibration.numbers if n.new) or "no number"
    return (
        data_point([calibration.run.origin]),
        Point("Calibrated", f"{new} of rig {calibration.rig.name}, from log {calibration.run.name}."),
        Point("Against the rig file", f"{page_text(words.comparison(calibration))}."),
        *(Point("Finding", f"{upper(page_text(text))}.", "warn") for text in found),
        *([] if found else [Point("Findings", "None.", "good")]),
    )


def _numbers(calibration: Calibration) -> Table:
    """Every number with its uncertainty, beside the one of the rig file."""
    columns: list[TableColumn[Number]] = [
        TableColumn("Number", text=True, of=lambda n: f"{n.section}.{n.name}"),
        TableColumn("Rig file", of=lambda n: number(n.before, _decimals(n))),
        TableColumn("Found", of=lambda n: number(n.value, _decimals(n))),
        TableColumn("Standard uncertainty", of=lambda n: uncertain(n.u)),
        TableColumn("95 % interval, from", of=lambda n: number(n.low, _decimals(n))),
        TableColumn("to", of=lambda n: number(n.high, _decimals(n))),
        TableColumn("Unit", text=True, of=lambda n: page_text(n.unit)),
        TableColumn("State", text=True, of=lambda n: "calibrated" if n.new else "as before"),
        TableColumn("Method", text=True, of=lambda n: page_text(n.how)),
    ]
    found = items_table("calibrated-numbers", "Calibrated numbers of the rig.", columns, calibration.numbers)
    assert found is not None  # the back-EMF constant is always there
    return found


def _decimals(n: Number) -> int:
    return places(n.u) if n.u > 0.0 else 6


def _fit(calibration: Calibration) -> Section:
    """The regression of the back-EMF in words and as a figure."""
    fit, before = calibration.regression, calibration.numbers[0].before
    drawn = Regression(
        rpm=tuple(fit.rpm.tolist()), v_ll=tuple(fit.v_ll.tolist()), v_dc=tuple(fit.vdc.tolist()),
        slope=fit.k_e, low=fit.low, high=fit.high, r2=fit.r2, points=fit.rpm.size, reference=before,
    )  # fmt: skip
    word = "simulated log" if calibration.run.simulated else "log"
    return section(
        "fit", "Fit",
        picture(
            back_emf_figure(drawn, word=word), "model-emf",
            "DC voltage and back-EMF over the speed of the generator, with the line through zero whose slope is the back-EMF "
            "constant.",
            f"Dots along a straight line through zero; its slope is {significant(fit.k_e, 5)} V/rpm.",
        ),
        _note(words.regression_words(fit)),
        _note(words.eq8_words(fit, calibration)),
        Note(
            f"With the numbers found, force, torque and pressure differ from the model by "
            f"{significant(math.sqrt(calibration.misfit), 2)} times their noise (root mean square)."
        ),
    )  # fmt: skip


def _conditions(calibration: Calibration) -> Table:
    """The run that was used, and the ranges within which the numbers were found."""
    run, fit = calibration.run, calibration.regression
    rows = [
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
    ]
    return make_table("conditions", "Conditions of the calibration.", (text_column("Item"), text_column("Value")), rows)


def _range(x: Signal) -> str:
    """Smallest and largest value of a channel, with the decimals of three digits of the larger one."""
    size = float(np.abs(x).max())
    decimals = max(2 - math.floor(math.log10(size)), 0) if size > 0.0 else 0
    return f"{number(float(x.min()), decimals)} to {number(float(x.max()), decimals)}"


def _findings(calibration: Calibration) -> Table | Note:
    """What speaks against the numbers, and what is wrong with the log."""
    rows = [("calibration", page_text(text)) for text in words.findings(calibration)]
    rows += [(f"log, {f.kind.replace('_', ' ')}", f"{f.message}; {f.action}") for f in calibration.run.findings]
    if not rows:
        return Note("Nothing speaks against the numbers, and no fault was found in the log.")
    columns = (text_column("Of"), text_column("What was found"))
    return make_table("findings", "Findings about the calibration and about the log.", columns, rows)


def _provenance(calibration: Calibration, command: str) -> Table:
    run, rig = calibration.run, calibration.rig
    rows = [
        ("Log file", run.path),
        ("SHA-256 of the log", run.sha256),
        ("Table in the file", run.table or ""),
        ("Rig file", rig.path or rig.name),
        ("SHA-256 of the rig file", file_digest(rig.path)),
    ]
    return provenance_table(rows, command)
