"""Phases that a log states itself: a column of labels, or a row for each step of a test plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.log_thresholds import completed, log_scales
from winchcascade.core.phase_rule import PhaseRule
from winchcascade.core.plain_text import first_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.assign import named_column, near_columns
from winchcascade.ingest.checks.quality import Checked
from winchcascade.ingest.headers import Header
from winchcascade.ingest.source import LogTable

MAX_VALUES = 8
"""Values of a column that a message lists."""

NEARLY = 1.0 - 1e-9
"""End of the second of a row: stamps rise, and means over the second are the values of the row.
[s]
"""


def label_column(headers: Sequence[Header], rule: PhaseRule, where: str) -> int:
    """Index of the column of labels; LogError for a log that does not have it."""
    index = named_column(headers, rule.column)
    if index is None:
        near = near_columns([rule.column], headers)
        raise LogError(
            f"{where}: no column {rule.column!r}, which [phases] of the rig names; {near}. "
            f"Correct it in the rig file."
        )
    return index


def phase_labels(table: LogTable, column: int, rule: PhaseRule, where: str) -> Signal:
    """Phase of each row of a table, (n,): 1 in payout, -1 in haul-in, 0 elsewhere.

    Labels are numbers or texts; case and blanks around a text do not matter.

    Raises
    ------
    LogError : the column holds neither numbers nor texts; none of its values is one of payout
    """
    numbers = table.values[column]
    values = table.texts.get(column) or (
        [f"{x:g}" for x in numbers.tolist()] if np.isfinite(numbers).any() else []
    )
    if not any(text.strip() for text in values):
        raise LogError(
            f"{where}: the column {rule.column!r} holds neither numbers nor texts; expected a "
            f"label in each row. Correct "
            "column under [phases] of the rig file."
        )
    payout, haul_in = (
        {_plain(str(value)) for value in values} for values in (rule.payout, rule.haul_in)
    )
    found = {
        value: 1.0 if _plain(value) in payout else -1.0 if _plain(value) in haul_in else 0.0
        for value in set(values)
    }
    if 1.0 not in found.values():
        seen = first_of([repr(value.strip()) for value in sorted(found)], MAX_VALUES)
        raise LogError(
            f"{where}: no sample of the column {rule.column!r} has a value of payout, "
            f"{list(rule.payout)}; it holds {seen}. "
            "Correct payout under [phases] of the rig file."
        )
    return np.array([found[value] for value in values])


def _plain(text: str) -> str:
    """Fold the spellings of one label: case, blanks and quotes around it, and 1.0 for 1."""
    text = text.strip().strip("\"'").strip().casefold()
    try:
        return f"{float(text):g}"
    except ValueError:
        return text


def steps_of_rows(channels: Mapping[str, Signal], rig: Rig) -> Checked:
    """Channels in which each row holds for one second, so that an energy in joules is the mean
    power of the row in watts.

    Stamps of the table do not count. Rows in which a channel holds no number are left out. Rows are
    means over steps: spikes, stuck sensors and the clock are not checked.

    Parameters
    ----------
    channels : (n,) each, SI units, NaN where a cell was not a number; one without any number is
        left out
    """
    findings = [
        Finding("missing_channel", f"the column for {name} holds no number", "left out", name)
        for name, x in channels.items()
        if np.isnan(x).all()
    ]
    channels = {name: x for name, x in channels.items() if not np.isnan(x).all()}
    if not channels:
        return Checked(np.empty(0), {}, {}, tuple(findings), np.empty((0, 2)), rig)
    known = np.isfinite(np.sum([*channels.values()], axis=0))
    rows = np.flatnonzero(known)
    t = np.column_stack((rows, rows + NEARLY)).ravel().astype(np.float64)
    if rows.size < known.size:
        lost = known.size - rows.size
        message = f"{lost} row{'s' if lost > 1 else ''} with a cell that is no number"
        findings.append(Finding("not_a_number", message, "left out", count=lost, removed=lost))
    doubled = {name: np.repeat(x[rows], 2) for name, x in channels.items()}
    return Checked(
        t,
        doubled,
        {},
        tuple(findings),
        np.empty((0, 2)),
        completed(rig, log_scales(t, doubled, rig)),
    )
