"""Blocks that the reports of several results have: where the data come from, provenance, and time
histories.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy

from winchcascade.core.campaign_file import Origin
from winchcascade.core.store import fingerprint
from winchcascade.core.version import __version__, made_at
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import (
    PAIRS,
    PROVENANCE,
    Cell,
    Note,
    Picture,
    Section,
    Table,
    section,
)
from winchcascade.report.figures.histories import (
    SHADED_CYCLES,
    history_figure,
    history_json,
    log_history,
)
from winchcascade.report.glossary import upper
from winchcascade.report.wording import origin_words

if TYPE_CHECKING:
    from winchcascade.core.run import Run
    from winchcascade.report.content import Blocks
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
    listed = Table(PROVENANCE, "What the report was made from, and how.", PAIRS, given, brief=False)
    return section(PROVENANCE, "Provenance", listed, folded=True)


def histories(reduction: Reduction) -> Section:
    """Channels and powers over the whole log, phases shaded."""
    history = cache(lambda: log_history(reduction))
    shaded = 0 < len(reduction.cycles) <= SHADED_CYCLES
    marked = " Shaded: payout and hold; lines: integration window." if shaded else ""
    caption = f"Channels and powers over the whole log.{marked}"
    caption += " At the lower edge: repaired stretches." if reduction.run.gaps else ""
    return section(
        "histories", "Time histories",
        Picture(
            "histories", caption,
            "Line plots of every channel over time; the values are in the log, means of the "
            "phases in the tables.",
            lambda: history_figure(history()),
            lambda: history_json(history()),
        ),
    )  # fmt: skip


def model_section(word: str, parts: Callable[[], Blocks]) -> Section:
    """Logs beside their simulations, made where a page needs them; `word` is what the logs are
    called.
    """
    heading = "Measured and simulated" if word == "measured" else "Log and simulation"
    return Section("model", heading, parts, folded=True)


RATIOS = {"eta_trans": "line to shaft", "eta_gen": "shaft to DC link", "eta_pto": "line to DC link"}
"""Efficiencies of the cascade of the paper, for a tile."""


def ratio_words(eta: str, stages: tuple[str, str]) -> str:
    """Between which stages an efficiency is."""
    return RATIOS.get(eta) or " to ".join(stages)
