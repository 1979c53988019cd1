"""Where the numbers of a report come from: its data, its inputs, and how it was made."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from winchcascade.core.campaign_file import Origin, origin_words
from winchcascade.core.version import __version__
from winchcascade.report.digits import upper
from winchcascade.report.report_model import Point
from winchcascade.report.table_model import Table, make_table, text_column


def data_point(origins: Sequence[Origin]) -> Point:
    """State whether the data are measured and where they come from; a warning where any are not measured."""
    words = origin_words(origins)
    text = words if words.endswith(".") else f"{words}."
    made = any(origin.measured is False for origin in origins)
    return Point("Data", upper(text), "warn" if made else "plain")


def provenance_table(rows: Sequence[tuple[str, str]], command: str) -> Table:
    """Where every number comes from: items with their values, those without one left out, and how the report was made."""
    import platform

    import numpy

    versions = f"winchcascade {__version__}, Python {platform.python_version()}, numpy {numpy.__version__}"
    made = (
        ("Made by", versions),
        ("Command", command),
        ("Made on", made_at().strftime("%Y-%m-%d %H:%M:%S UTC")),
    )
    columns = (text_column("Item"), text_column("Value"))
    return make_table(
        "provenance", "What the report was made from, and how.", columns, [row for row in (*rows, *made) if row[1]]
    )


def made_at() -> datetime:
    """Give the time of making, or SOURCE_DATE_EPOCH where a build must be repeatable; UTC, whole seconds."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    given = epoch.isdigit() and len(epoch) <= 11
    now = datetime.fromtimestamp(int(epoch), UTC) if given else datetime.now(UTC)
    return now.replace(microsecond=0)


def file_digest(path: str) -> str:
    """SHA-256 of a rig file, nothing for a built-in one."""
    from winchcascade.core.store import digest_of

    return digest_of(Path(path).read_bytes()) if Path(path).is_file() else ""
