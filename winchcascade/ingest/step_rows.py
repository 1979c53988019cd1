"""Tables of step means, whose rows are operating points in any order: each row becomes a second of its own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.checks.quality import Checked

NEARLY = 1.0 - 1e-9
"""End of the second of a row: stamps rise, and means over the second are the values of the row. [s]"""


def steps_of_rows(channels: Mapping[str, Signal]) -> Checked:
    """Channels in which each row holds for one second, so that an energy in joules is the mean power of the row in watts.

    Stamps of the table do not count. Rows in which a channel holds no number are left out. Rows are means over steps: spikes,
    stuck sensors and the clock are not checked.

    Parameters
    ----------
    channels : (n,) each, SI units, NaN where a cell was not a number; one without any number is left out
    """
    findings = [
        Finding("missing_channel", f"the column for {name} holds no number", "left out", name)
        for name, x in channels.items()
        if np.isnan(x).all()
    ]
    channels = {name: x for name, x in channels.items() if not np.isnan(x).all()}
    if not channels:
        return Checked(np.empty(0), {}, {}, tuple(findings), np.empty((0, 2)))
    known = np.isfinite(np.sum([*channels.values()], axis=0))
    rows = np.flatnonzero(known)
    t = np.column_stack((rows, rows + NEARLY)).ravel().astype(np.float64)
    if rows.size < known.size:
        lost = known.size - rows.size
        message = f"{lost} row{'s' if lost > 1 else ''} with a cell that is no number"
        findings.append(Finding("not_a_number", message, "left out", count=lost, removed=lost))
    doubled = {name: np.repeat(x[rows], 2) for name, x in channels.items()}
    return Checked(t, doubled, {}, tuple(findings), np.empty((0, 2)))
