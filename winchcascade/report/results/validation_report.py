"""What a validation states on one page: comparison errors, their uncertainties, intervals of the
model error, the domain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.explain.validation import Compared, Validated
from winchcascade.diagnosis.handover.tested import Tested, tested_by
from winchcascade.report.content import (
    PAIRS,
    Cell,
    Column,
    Measured,
    Note,
    Picture,
    Report,
    Section,
    Span,
    Table,
    section,
    table,
)
from winchcascade.report.diagnosis_names import origins_of
from winchcascade.report.figures.style import (
    COLOURS,
    Look,
    draw_intervals,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
)
from winchcascade.report.glossary import metric, short, tex
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.results.judgement import judgement_banner, judgement_note
from winchcascade.report.wording import banner

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILED = ("power_gen", "eta_trans", "eta_gen", "eta_pto")
"""Quantities on the page; the JSON has every metric."""

TERMS: tuple[tuple[str, Cell], ...] = (
    (
        "E = S - D",
        "comparison error: simulation S minus reduced data D, a mean over the integration windows "
        "of a run",
    ),
    ("before, after", "S of the model of the rig file, S of the model with the causes"),
    (
        "D",
        "without the errors of sensors that the diagnosis found; their uncertainty is a part of "
        "u_D",
    ),
    (
        "u_D, u_num",
        "standard uncertainties of D by sensors and gaps, and of S by its step: its change with one "
        "that is 2.5 times as long",
    ),
    (
        "u_input",
        "that of S by rig and loads: before within their tolerances, after as the fit leaves them",
    ),
    (
        "model error",
        "with 95 % from E - 1.96 u_val to E + 1.96 u_val, u_val^2 = u_num^2 + u_input^2 + u_D^2",
    ),
)
"""Words of ASME V&V 20-2009."""

BEFORE, AFTER = Look("mech", "-", "o"), Look("gen", "-", "s")
"""Looks of the two simulations."""

Which = Callable[[Validated], "Compared | None"]
"""One of the two simulations of a comparison."""


def validation_section(found: ModelDiagnosis) -> Section:
    """The validation as a part of a diagnosis."""
    rows = [row for row in found.validation if row.quantity in FILED]
    picture = Picture(
        "validation-errors",
        "Comparison errors E with E +- 1.96 u_val, by run, before (hollow) and after (full).",
        "Points with intervals about zero, one panel for each quantity; the values are in the table.",
        partial(errors_figure, rows),
    )
    blocks = (picture, _table(rows)) if rows else ()
    return section("validation", "Validation (ASME V&V 20)", *blocks, folded=True)


def errors_figure(rows: Sequence[Validated]) -> Figure:
    """Draw the comparison errors of each quantity with the intervals of the model error, run by
    run: before hollow, after full.
    """
    from matplotlib.ticker import MaxNLocator

    quantities = [name for name in FILED if any(row.quantity == name for row in rows)]
    figure, axes = panel_figure(0.6 + 1.15 * len(quantities), len(quantities), share="x")
    for ax, letter, name in zip(axes, "abcd", quantities, strict=False):
        ax.axhline(0.0, color=COLOURS["ink"], lw=0.8, zorder=1)
        for (side, which), look, shift in zip(
            _sides().items(), (BEFORE, AFTER), (-0.12, 0.12), strict=True
        ):
            known = [(r.log + 1, one) for r in rows if r.quantity == name and (one := which(r))]
            ends = [(one.error, one.low, one.high) for _, one in known]
            full = [side == "after"] * len(known)
            draw_intervals(ax, [run + shift for run, _ in known], ends, look, full)
        label_panel(ax, letter, f"E of {tex(name)}", y=f"E ({metric(name).unit or 1})")
        ax.grid(axis="x", visible=False)
    axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    axes[-1].set_xlabel("Run, as in the table")
    entries = [line_entry("before", BEFORE.colour, marker=BEFORE.mark, ms=4, mfc=COLOURS["paper"])]
    if any(row.after for row in rows):
        entries.append(line_entry("after", AFTER.colour, marker=AFTER.mark, ms=4))
    legend_above(figure, entries)
    return figure


def validation_report(found: ModelDiagnosis, *, command: str = "") -> Report:
    """The validation as a page of its own, to be filed."""
    rows = [row for row in found.validation if row.quantity in FILED]
    held = {
        name: sum(one is not None and one.low <= 0.0 <= one.high for one in map(which, rows))
        for name, which in _sides().items()
    }
    after = f", after in {held['after']}" if any(row.after for row in rows) else ""
    return Report(
        kind="Validation of a model",
        title=f"{found.title}: model error by ASME V&V 20",
        subtitle=f"rig {found.rig.name} · {len(found.runs)} logs",
        points=[
            data_note(origins_of(found)),
            judgement_note(found.judgement),
            Note(f"The interval of the model error contains 0 in {held['before']} of {len(rows)} "
                 f"comparisons before{after}.",
                 "Result"),
            None if not (worse := [row for row in rows if row.worse]) else Note(
                f"After is further from the data than before, beyond its uncertainty, in "
                f"{len(worse)} comparisons: "
                f"{'; '.join(f'{short(row.quantity)} of run {row.log + 1}' for row in worse)}.", "Worse", "warn"),
            None if (tested := tested_by(found)) is None else Note(_domain(tested), "Domain"),
        ],
        sections=[
            msgspec.structs.replace(validation_section(found), folded=False),
            section("terms", "Terms of ASME V&V 20-2009", table("validation-terms", "Symbols.", PAIRS, TERMS)),
            provenance([("Runs", "; ".join(f"{k} {run.name}" for k, run in enumerate(found.runs, 1)))], command),
        ],
        banner=" ".join(filter(None, [banner(origins_of(found)), judgement_banner(found.judgement)])),
    )  # fmt: skip


def _sides() -> dict[str, Which]:
    """The two simulations by name."""
    return {"before": lambda row: row.before, "after": lambda row: row.after}


def _table(rows: Sequence[Validated]) -> Table[Validated]:
    """Comparison errors before and after with the intervals of the model error, by run and
    quantity.
    """

    def of(which: Which, cell: Callable[[Compared], Cell]) -> Callable[[Validated], Cell]:
        return lambda row: None if (one := which(row)) is None else cell(one)

    columns: list[Column[Validated]] = [
        Column("run", lambda row: row.log + 1),
        Column(
            "load",
            lambda row: "open" if math.isinf(row.load or 0.0) else row.load,
            "ohm",
        ),
        Column("speed", lambda row: row.speed, "m/s", 2),
        Column("of", lambda row: short(row.quantity)),
        Column("D", lambda row: Measured(row.measured, row.u_d)),
        Column("u_D", lambda row: Measured(row.u_d, row.u_d)),
    ]
    for name, which in _sides().items():
        columns += [
            Column(
                f"u_input {name}",
                of(which, lambda one: Measured(one.u_input, one.u_input)),
            ),
            Column(
                f"E {name}",
                of(which, lambda one: Measured(one.error, one.u_val)),
                signed=True,
            ),
            Column(
                f"model error {name}",
                of(which, lambda one: Span(one.low, one.high, one.u_val)),
            ),
        ]
    own = sum(row.after is not None and not row.held_out for row in rows)
    caption = (
        "Comparison errors with the 95 % interval of the model error; powers in W. After: by fits "
        "without the logs of the load"
        f"{f', but for {own} rows' * bool(own)}. u_num is at most "
        f"{max((row.u_num for row in rows), default=0.0):.1g}."
    )
    return table("validation", caption, columns, rows, brief=False)


def _domain(tested: Tested) -> str:
    """What the logs cover: beyond it the model is not validated."""
    speed, current = np.max(np.array(tested.border), axis=0)
    loads = ", ".join(f"{load:g}" for load in tested.loads)
    return (
        f"{loads} ohm; in payout up to {speed:.2f} m/s of line speed and {current:.3g} A of DC "
        f"current; up to "
        f"{tested.force:.0f} N of line tension."
    )
