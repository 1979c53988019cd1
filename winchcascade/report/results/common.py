"""Blocks that the reports of several results have: where the data come from, provenance, and
time histories.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy

from winchcascade.core.campaign_file import Origin
from winchcascade.core.store import fingerprint
from winchcascade.core.version import __version__, made_at
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import PAIRS, Cell, Note, Section, Table, picture, section
from winchcascade.report.glossary import upper
from winchcascade.report.wording import origin_words

if TYPE_CHECKING:
    from winchcascade.core.run import Run
    from winchcascade.tables.published_table import PublishedTable

PRINTED = 20.0
"""Standard uncertainty with which a number has the decimals that are printed, per half a unit of
the last one.
"""


def table_rows(table: PublishedTable) -> list[tuple[str, Cell]]:
    """Which published table it is, for the provenance."""
    from winchcascade.tables.table_file import table_place

    return [
        ("Published table", table_place(table.path) or table.name),
        ("SHA-256 of the table", fingerprint(table.path)),
        ("Source", table.source),
    ]


def samples_row(run: Run) -> tuple[str, str]:
    """Number, rate and duration of the samples of a log, for the provenance."""
    return "Samples", f"{run.samples} at {run.fs:.6g} Hz, {run.t[-1] - run.t[0]:.1f} s"


def data_note(origins: Sequence[Origin]) -> Note:
    """Whether the data are measured and where they come from; a warning where any are not
    measured.
    """
    words = upper(origin_words(origins))
    made = any(origin.measured is False for origin in origins)
    return Note(words if words.endswith(".") else f"{words}.", "Data", "warn" if made else "plain")


def provenance(rows: Sequence[tuple[str, Cell]], command: str = "") -> Section:
    """Where every number comes from, rows without a value left out, and how the report was made;
    folded.
    """
    made: list[tuple[str, Cell]] = [
        (
            "Made by",
            f"winchcascade {__version__}, Python {platform.python_version()}, numpy "
            f"{numpy.__version__}",
        ),
        ("Command", command),
        ("Made on", made_at().strftime("%Y-%m-%d %H:%M:%S UTC")),
    ]
    given = [row for row in (*rows, *made) if row[1] not in (None, "")]
    listed = Table(
        "provenance", "What the report was made from, and how.", PAIRS, given, brief=False
    )
    return section("provenance", "Provenance", listed, folded=True)


def histories(reduction: Reduction) -> Section:
    """Channels and powers over the whole log, phases shaded. Called within the style of figures."""
    from winchcascade.report.figures.histories import history_figure, history_json, log_history

    history = log_history(reduction)
    caption = "Channels and powers over the whole log." + (
        " Shaded: payout and hold; lines: integration window." if history.marks else ""
    )
    caption += " At the lower edge: repaired stretches." if reduction.run.gaps else ""
    return section(
        "histories", "Time histories",
        picture(
            history_figure(history), "histories", caption,
            "Line plots of every channel over time; the values are in the log, means of the "
            "phases in the tables.",
            history_json(history),
        ),
    )  # fmt: skip


RATIOS = {"eta_trans": "line to shaft", "eta_gen": "shaft to DC link", "eta_pto": "line to DC link"}
"""Efficiencies of the cascade of the paper, for a tile."""


def ratio_words(eta: str, stages: tuple[str, str]) -> str:
    """Between which stages an efficiency is."""
    return RATIOS.get(eta) or " to ".join(stages)
